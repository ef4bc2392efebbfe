"""Noise of the readings: uniform, Gaussian and flicker."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from kappaskin._schema import Within
from kappaskin.errors import Refusal
from kappaskin.scenes.effects.effect import ReadingEffect, RunningEffect, Size, Survey

LARGEST = 6.0
"""Standard deviations that no reading of many frames is off by: one of 500 million is."""

_RMS = Within(0, 1e4, "1/m")


@dataclass(frozen=True)
class UniformNoise(ReadingEffect):
    """Noise even between -sqrt(3) rms and sqrt(3) rms, in 1/m (the paper's, section 4)."""

    name: ClassVar = "uniform-noise"
    example: ClassVar = {"rms": 0.1}
    at_once: ClassVar = True
    formula: ClassVar = "RMS of the noise over peak curvature"

    rms: Annotated[float, _RMS]

    def size(self, survey: Survey) -> Size:
        number = self.rms / survey.peak
        return Size(number, math.sqrt(3) * number)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.noise import uniform

        return uniform(self.rms, rng)


@dataclass(frozen=True)
class GaussianNoise(ReadingEffect):
    """Normal noise of standard deviation `rms`, in 1/m."""

    name: ClassVar = "gaussian-noise"
    example: ClassVar = {"rms": 0.1}
    at_once: ClassVar = True
    formula: ClassVar = "RMS of the noise over peak curvature"

    rms: Annotated[float, _RMS]

    def size(self, survey: Survey) -> Size:
        number = self.rms / survey.peak
        return Size(number, LARGEST * number)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.noise import gaussian

        return gaussian(self.rms, rng)


_APART = 4.0  # at most, from one frequency of the sum to the next: 1/f to 0.3 %


@dataclass(frozen=True)
class FlickerNoise(ReadingEffect):
    """Gaussian noise with a spectrum as 1/f from `low` to `high` in Hz, of `rms` in 1/m in all.

    It is flat below the band and falls as 1/f^2 above it: a sum of independent parts of equal
    power, each of them with the spectrum 1 / (1 + (f / f_k)^2), its f_k evenly spaced on a
    logarithmic scale. Channels are independent.
    """

    name: ClassVar = "flicker-noise"
    example: ClassVar = {"rms": 0.1}
    formula: ClassVar = "RMS of the noise over peak curvature"

    rms: Annotated[float, Within(0, 1e4, "1/m")]
    low: Annotated[float, Within(1e-6, 1e6, "Hz")] = 0.01
    high: Annotated[float, Within(1e-6, 1e6, "Hz")] = 100.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.low < self.high:
            raise Refusal(
                f"expected {self.name} in a band from a low to a higher frequency, got "
                f"{self.low:g} to {self.high:g} Hz"
            )

    @property
    def corners(self) -> tuple[float, ...]:
        """The frequencies f_k in Hz, the highest one first."""
        octaves = math.log(self.high / self.low)
        count = math.ceil(octaves / math.log(_APART))
        return tuple(self.high * math.exp(-octaves * (k + 0.5) / count) for k in range(count))

    def size(self, survey: Survey) -> Size:
        number = self.rms / survey.peak
        return Size(number, LARGEST * number)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.noise import flicker

        return flicker(self.rms, self.corners, shape, rng)
