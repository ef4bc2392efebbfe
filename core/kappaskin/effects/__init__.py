"""What spoils a reading; an empty list of effects spoils nothing."""

from kappaskin.effects.creep import Creep as Creep
from kappaskin.effects.creep import StandardLinearSolid as StandardLinearSolid
from kappaskin.effects.effect import Effect as Effect
from kappaskin.effects.effect import ReadingEffect as ReadingEffect
from kappaskin.effects.effect import Running as Running
from kappaskin.effects.effect import Size as Size
from kappaskin.effects.hysteresis import FIRST_GENERATION_LOOPS as FIRST_GENERATION_LOOPS
from kappaskin.effects.hysteresis import SECOND_GENERATION_LOOPS as SECOND_GENERATION_LOOPS
from kappaskin.effects.hysteresis import Hysteresis as Hysteresis
from kappaskin.effects.hysteresis import PrandtlIshlinskii as PrandtlIshlinskii
from kappaskin.effects.noise import GaussianNoise as GaussianNoise
from kappaskin.effects.noise import UniformNoise as UniformNoise
from kappaskin.effects.survey import Survey as Survey
from kappaskin.effects.tolerance import Tolerance as Tolerance
