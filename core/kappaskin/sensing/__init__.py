"""Sensing: what the elements read, the electronics, hysteresis, and a sensor's description."""

from kappaskin.sensing.hysteresis import PrandtlIshlinskii as PrandtlIshlinskii
from kappaskin.sensing.hysteresis import StandardLinearSolid as StandardLinearSolid
from kappaskin.sensing.layout import QUANTITIES as QUANTITIES
from kappaskin.sensing.layout import SHOWN_UNITS as SHOWN_UNITS
from kappaskin.sensing.layout import DeflectedSurface as DeflectedSurface
from kappaskin.sensing.layout import NormalCurvature as NormalCurvature
from kappaskin.sensing.layout import Readings as Readings
from kappaskin.sensing.layout import SensorLayout as SensorLayout
from kappaskin.sensing.layout import gage_multipliers as gage_multipliers
from kappaskin.sensing.layout import kind_of_reading as kind_of_reading
from kappaskin.sensing.layout import name_of_reading as name_of_reading
from kappaskin.sensing.sensor import Scan as Scan
from kappaskin.sensing.sensor import Sensor as Sensor
from kappaskin.sensing.transduction import FIRST_GENERATION as FIRST_GENERATION
from kappaskin.sensing.transduction import SECOND_GENERATION as SECOND_GENERATION
from kappaskin.sensing.transduction import Amplifier as Amplifier
from kappaskin.sensing.transduction import Converter as Converter
from kappaskin.sensing.transduction import DigitalReadings as DigitalReadings
from kappaskin.sensing.transduction import HalfBridge as HalfBridge
from kappaskin.sensing.transduction import Multiplexer as Multiplexer
from kappaskin.sensing.transduction import Transduction as Transduction
