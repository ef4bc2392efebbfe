"""Effects in the electronics: noise, mains hum, skew, cross-talk, saturation and quantisation."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from kappaskin._schema import Within
from kappaskin.errors import Refusal
from kappaskin.scenes.effects.effect import Effect, ReadingEffect, RunningEffect, Size, Survey
from kappaskin.sensing import DigitalReadings, Transduction

LARGEST = 6.0
"""Standard deviations that no reading of many frames is off by: one of 500 million is."""

_RMS = Within(0, 1e4, "1/m")


@dataclass(frozen=True)
class MainsHum(ReadingEffect):
    """A sine of `amplitude` in 1/m and `frequency` in Hz, alike in all channels of a frame.

    Its phase at time 0 is drawn with the scene's seed: the mains know of no scene, and a fixed one
    would favour some frames in every run.
    """

    name: ClassVar = "mains-hum"
    example: ClassVar = {"amplitude": 0.5}
    formula: ClassVar = "amplitude over the peak reading"

    amplitude: Annotated[float, Within(0, 1e4, "1/m")]
    frequency: Annotated[float, Within(1, 1000, "Hz")] = 50.0

    def size(self, survey: Survey) -> Size:
        number = self.amplitude / survey.peak
        return Size(number, number)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.electronics import hum

        return hum(self.amplitude, self.frequency, rng)


@dataclass(frozen=True)
class Skew(Effect):
    """Channels are read one after the other while the skin moves; `Scan.times` says when."""

    name: ClassVar = "skew"
    of_gages: ClassVar = "digital readings are taken all at once"
    elsewhere: ClassVar = "it follows from the converter's times"
    formula: ClassVar = "scan time times rate of curvature over the peak reading"

    def size(self, survey: Survey) -> Size:
        number = survey.read_after.max() * survey.rates.max() / survey.peak
        change = float((survey.read_after * survey.rates).max()) / survey.peak
        # However fast it moves, a reading goes from one peak to the opposite one at most.
        return Size(float(number), min(change, 2.0))


@dataclass(frozen=True)
class CrossTalk(ReadingEffect):
    """y_c = x_c + s (y_(c-1) - x_c): of the voltage before it a channel keeps the `share` s.

    One capacitor behind the multiplexer is charged by one channel after the other, in the order of
    a whole scan: 0 to 3 P - 1, component by component, and on with the next frame's channel 0. It
    begins at rest.
    """

    name: ClassVar = "cross-talk"
    of_gages: ClassVar = "digital readings have no multiplexer"
    example: ClassVar = {"share": 0.02}
    formula: ClassVar = "share of the previously scanned channel"

    share: Annotated[float, Within(0, 0.5)]

    def size(self, survey: Survey) -> Size:
        K = survey.curvature.reshape(len(survey.times), -1)
        largest = np.abs(K).max(axis=0, initial=0.0)
        between_frames = float(largest[0] + largest[-1])
        step = max(float(np.abs(np.diff(K)).max(initial=0.0)), between_frames) + 2 * survey.carried
        # |y_c - x_c| <= s (|x_(c-1) - x_c| + |y_(c-1) - x_(c-1)|), so the largest is s/(1-s) steps;
        # and y_(c-1) is a mean of readings before, and of rest.
        range_ = max(K.max(initial=0.0), 0.0) - min(K.min(initial=0.0), 0.0) + 2 * survey.carried
        most = min(step / (1 - self.share), float(range_))
        return Size(self.share, self.share * most / survey.peak)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.electronics import cross_talk

        return cross_talk(self.share, shape)


@dataclass(frozen=True)
class Quantisation(ReadingEffect):
    """Curvature is that of the count next to it, as `transduction` counts: no rails, only steps."""

    name: ClassVar = "quantisation"
    elsewhere: ClassVar = "it follows from the converter, or the resolution in [readings]"
    at_once: ClassVar = True
    formula: ClassVar = "half a count over the peak reading"

    transduction: Transduction | DigitalReadings

    def size(self, survey: Survey) -> Size:
        number = self.transduction.resolution / 2 / survey.peak
        return Size(number, number)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.electronics import quantisation

        return quantisation(self.transduction)


@dataclass(frozen=True)
class Saturation(ReadingEffect):
    """Curvature stays between the lowest and the highest count of `transduction`."""

    name: ClassVar = "saturation"
    elsewhere: ClassVar = "it follows from the amplifier and the converter"
    at_once: ClassVar = True
    formula: ClassVar = "largest curvature over that at the limit of the electronics"

    transduction: Transduction

    @property
    def rails(self) -> tuple[float, float]:
        """The curvature in 1/m of the lowest and of the highest count, below and above zero."""
        electronics = self.transduction
        shift = electronics.offset / electronics.sensitivity
        low, high = electronics.limits
        return low * electronics.resolution - shift, high * electronics.resolution - shift

    def size(self, survey: Survey) -> Size:
        (low, high), K = self.rails, survey.curvature
        number = float(np.maximum(K / low, K / high).max(initial=0.0))
        above = float(K.max(initial=0.0)) + survey.carried - high
        below = low - float(K.min(initial=0.0)) + survey.carried
        return Size(number, max(above, below, 0.0) / survey.peak)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.electronics import saturation

        return saturation(*self.rails)


@dataclass(frozen=True)
class _WhiteNoise(ReadingEffect):
    """Noise of standard deviation `rms` in 1/m, independent in every reading."""

    example: ClassVar = {"rms": 0.1}
    at_once: ClassVar = True
    formula: ClassVar = "RMS of the noise over the peak reading"
    largest: ClassVar[float]  # deviation that is counted on, in standard deviations

    rms: Annotated[float, _RMS]

    def size(self, survey: Survey) -> Size:
        number = self.rms / survey.peak
        return Size(number, self.largest * number)


@dataclass(frozen=True)
class UniformNoise(_WhiteNoise):
    """Noise even between -sqrt(3) rms and sqrt(3) rms, in 1/m (the paper's, section 4)."""

    name: ClassVar = "uniform-noise"
    largest: ClassVar = math.sqrt(3)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.electronics import uniform

        return uniform(self.rms, rng)


@dataclass(frozen=True)
class GaussianNoise(_WhiteNoise):
    """Normal noise of standard deviation `rms`, in 1/m."""

    name: ClassVar = "gaussian-noise"
    largest: ClassVar = LARGEST

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.electronics import gaussian

        return gaussian(self.rms, rng)


@dataclass(frozen=True)
class StatedNoise(GaussianNoise):
    """The same as digital readings state it, with an RMS of its own for `each` of k readings."""

    elsewhere: ClassVar = "set noise in [readings]"

    each: tuple[float, ...] = ()

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        from kappaskin.scenes.effects.at_work.electronics import gaussian

        return gaussian(np.array(self.each)[:, None], rng)


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
    formula: ClassVar = "RMS of the noise over the peak reading"

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
        from kappaskin.scenes.effects.at_work.electronics import flicker

        return flicker(self.rms, self.corners, shape, rng)
