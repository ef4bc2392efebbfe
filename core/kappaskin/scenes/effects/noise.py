"""Curvature noise, uniform and Gaussian, of a given root mean square."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from kappaskin.scenes.effects.effect import ReadingEffect, Running, Size
from kappaskin.scenes.effects.parameters import Within
from kappaskin.scenes.effects.survey import Survey

LARGEST = 6.0
"""Standard deviations that no reading of many frames is off by: one of 500 million is."""

_RMS = Within(0, 1e4, "1/m")


@dataclass(frozen=True)
class UniformNoise(ReadingEffect):
    """Noise even between -sqrt(3) rms and sqrt(3) rms, in 1/m (the paper's, section 4)."""

    name: ClassVar = "uniform-noise"
    at_once: ClassVar = True
    formula: ClassVar = "RMS of the noise over peak curvature"

    rms: Annotated[float, _RMS]

    def size(self, survey: Survey) -> Size:
        number = self.rms / survey.peak
        return Size(number, math.sqrt(3) * number)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        from kappaskin.scenes.effects.at_work.noise import uniform

        return uniform(self.rms, rng)


@dataclass(frozen=True)
class GaussianNoise(ReadingEffect):
    """Normal noise of standard deviation `rms`, in 1/m."""

    name: ClassVar = "gaussian-noise"
    at_once: ClassVar = True
    formula: ClassVar = "RMS of the noise over peak curvature"

    rms: Annotated[float, _RMS]

    def size(self, survey: Survey) -> Size:
        number = self.rms / survey.peak
        return Size(number, LARGEST * number)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        from kappaskin.scenes.effects.at_work.noise import gaussian

        return gaussian(self.rms, rng)
