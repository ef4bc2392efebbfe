"""Curvature to volts to ADC counts, and back."""

from kappaskin.transduction.chain import FIRST_GENERATION as FIRST_GENERATION
from kappaskin.transduction.chain import SECOND_GENERATION as SECOND_GENERATION
from kappaskin.transduction.chain import Transduction as Transduction
from kappaskin.transduction.parts import Amplifier as Amplifier
from kappaskin.transduction.parts import Converter as Converter
from kappaskin.transduction.parts import HalfBridge as HalfBridge
from kappaskin.transduction.parts import Multiplexer as Multiplexer
