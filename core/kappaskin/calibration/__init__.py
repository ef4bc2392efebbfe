"""Cylinders of known radius to gains, offsets, loops and creep, and what undoes them per frame."""

from kappaskin.calibration.calibration import Calibration as Calibration
from kappaskin.calibration.calibration import Corrector as Corrector
from kappaskin.calibration.file import check_place as check_place
from kappaskin.calibration.file import load_calibration as load_calibration
from kappaskin.calibration.file import save_calibration as save_calibration
from kappaskin.calibration.lines import Lines as Lines
from kappaskin.calibration.procedure import Procedure as Procedure
from kappaskin.calibration.procedure import Sweep as Sweep
from kappaskin.calibration.procedure import Taken as Taken
from kappaskin.calibration.report import CalibrationReport as CalibrationReport
from kappaskin.calibration.report import Limits as Limits
from kappaskin.calibration.report import calibrate as calibrate
from kappaskin.calibration.schedule import ADVICE as ADVICE
from kappaskin.calibration.schedule import RADII as RADII
from kappaskin.calibration.schedule import Presentation as Presentation
from kappaskin.calibration.schedule import Step as Step
from kappaskin.calibration.schedule import radii_for as radii_for
from kappaskin.calibration.schedule import schedule as schedule
from kappaskin.calibration.summary import summary as summary
from kappaskin.calibration.tare import Tare as Tare
from kappaskin.calibration.tares import Kept as Kept
from kappaskin.calibration.tares import Tares as Tares
from kappaskin.calibration.tares import data_folder as data_folder
