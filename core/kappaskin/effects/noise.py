"""Curvature noise, uniform and Gaussian, of a given root mean square."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kappaskin.effects.effect import ReadingEffect, Running, Size
from kappaskin.effects.survey import Survey
from kappaskin.errors import Refusal

_LARGEST = 4.5
"""Standard deviations that the largest of the readings of many frames is off by."""


def _check_rms(rms: float) -> None:
    if not (math.isfinite(rms) and rms >= 0):
        raise Refusal(f"expected a noise RMS of at least 0 1/m, got {rms}")


@dataclass(frozen=True)
class UniformNoise(ReadingEffect):
    """Noise even between -sqrt(3) rms and sqrt(3) rms, in 1/m (the paper's, section 4)."""

    name: ClassVar = "uniform-noise"
    formula: ClassVar = "RMS of the noise over peak curvature"

    rms: float

    def __post_init__(self) -> None:
        _check_rms(self.rms)

    def size(self, survey: Survey) -> Size:
        number = self.rms / survey.peak
        return Size(number, math.sqrt(3) * number)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        from kappaskin.effects.at_work.noise import uniform

        return uniform(self.rms, shape, rng)


@dataclass(frozen=True)
class GaussianNoise(ReadingEffect):
    """Normal noise of standard deviation `rms`, in 1/m."""

    name: ClassVar = "gaussian-noise"
    formula: ClassVar = "RMS of the noise over peak curvature"

    rms: float

    def __post_init__(self) -> None:
        _check_rms(self.rms)

    def size(self, survey: Survey) -> Size:
        number = self.rms / survey.peak
        return Size(number, _LARGEST * number)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        from kappaskin.effects.at_work.noise import gaussian

        return gaussian(self.rms, shape, rng)
