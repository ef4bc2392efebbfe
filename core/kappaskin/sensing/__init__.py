"""What an element reads: layout, electronics, scan, hysteresis; a sensor's description."""

from kappaskin.sensing.electronics import Amplifier as Amplifier
from kappaskin.sensing.electronics import Converter as Converter
from kappaskin.sensing.electronics import HalfBridge as HalfBridge
from kappaskin.sensing.electronics import Multiplexer as Multiplexer
from kappaskin.sensing.hysteresis import PrandtlIshlinskii as PrandtlIshlinskii
from kappaskin.sensing.hysteresis import StandardLinearSolid as StandardLinearSolid
from kappaskin.sensing.layout import SensorLayout as SensorLayout
from kappaskin.sensing.normal_curvature import NormalCurvature as NormalCurvature
from kappaskin.sensing.normal_curvature import steepness as steepness
from kappaskin.sensing.scan import Scan as Scan
from kappaskin.sensing.sensor import Sensor as Sensor
from kappaskin.sensing.transduction import FIRST_GENERATION as FIRST_GENERATION
from kappaskin.sensing.transduction import SECOND_GENERATION as SECOND_GENERATION
from kappaskin.sensing.transduction import Transduction as Transduction
