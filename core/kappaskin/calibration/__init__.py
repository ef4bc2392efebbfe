"""Calibration: cylinders, tare, channel map."""

from kappaskin.calibration.calibration import GRAVITY as GRAVITY
from kappaskin.calibration.calibration import Calibration as Calibration
from kappaskin.calibration.calibration import Corrector as Corrector
from kappaskin.calibration.calibration import KnownWeights as KnownWeights
from kappaskin.calibration.calibration import load_calibration as load_calibration
from kappaskin.calibration.channel_map import MapVerdict as MapVerdict
from kappaskin.calibration.press_test import PressPhase as PressPhase
from kappaskin.calibration.press_test import PressTest as PressTest
from kappaskin.calibration.press_test import press_elements as press_elements
from kappaskin.calibration.report import CalibrationReport as CalibrationReport
from kappaskin.calibration.report import calibrate as calibrate
from kappaskin.calibration.sweep import Procedure as Procedure
from kappaskin.calibration.sweep import Sweep as Sweep
from kappaskin.calibration.sweep import take_sweep as take_sweep
from kappaskin.calibration.tare import Drift as Drift
from kappaskin.calibration.tare import DriftMonitor as DriftMonitor
from kappaskin.calibration.tare import Rest as Rest
from kappaskin.calibration.tare import Tare as Tare
from kappaskin.calibration.tare import TareMeasurement as TareMeasurement
from kappaskin.calibration.tare_store import TareStore as TareStore
from kappaskin.calibration.weights import WEIGHT_ADVICE as WEIGHT_ADVICE
from kappaskin.calibration.weights import Weighing as Weighing
from kappaskin.calibration.weights import WeightFit as WeightFit
from kappaskin.calibration.weights import take_weights as take_weights
