"""What spoils a reading; an empty list of effects spoils nothing."""

from kappaskin.effects.noise import Effect as Effect
from kappaskin.effects.noise import GaussianNoise as GaussianNoise
from kappaskin.effects.noise import UniformNoise as UniformNoise
