"""Temperature: what two gages back to back do not cancel of it."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from kappaskin.frames import Array
from kappaskin.scenes.effects.effect import ReadingEffect, Running, Size
from kappaskin.scenes.effects.parameters import Within
from kappaskin.scenes.effects.survey import Survey


@dataclass(frozen=True)
class Temperature(ReadingEffect):
    """y = (1 + g T) x + o T as the skin warms from time 0 on by T = rise (1 - exp(-t / tau)).

    `rise` in K and tau, the `time_constant` in s: short for a step, long for a drift. The half
    bridge leaves over the apparent curvature o, `offset` in 1/m/K, which differs from channel to
    channel with the standard deviation `spread`, a share of it; the `seed` is the skin's own. The
    gage factor changes by g, `gain` per K.
    """

    name: ClassVar = "temperature"
    formula: ClassVar = "apparent curvature over peak curvature, plus change of the gain"

    rise: Annotated[float, Within(-200, 200, "K")]
    time_constant: Annotated[float, Within(1e-3, 1e6, "s")]
    offset: Annotated[float, Within(-100, 100, "1/m/K")]
    spread: Annotated[float, Within(0, 1)] = 0.0
    gain: Annotated[float, Within(-1e-2, 1e-2, "1/K")] = 0.0
    seed: Annotated[int, Within(0, 2**63 - 1, whole=True)] = 0

    def warmer(self, time: float) -> float:
        """By how many K the skin is warmer at `time` in s than it was at rest."""
        return -self.rise * math.expm1(-max(time, 0.0) / self.time_constant)

    def offsets(self, shape: tuple[int, ...]) -> Array:
        """The apparent curvature in 1/m per K of every channel of a skin of `shape`."""
        rng = np.random.default_rng(self.seed)
        return self.offset * rng.normal(1.0, self.spread, shape)

    def size(self, survey: Survey) -> Size:
        T = abs(self.warmer(survey.duration))
        K = survey.curvature.reshape(len(survey.times), -1)
        change = T * (self.gain * K + self.offsets(K.shape[1:]))
        number = T * (abs(self.offset) / survey.peak + abs(self.gain))
        return Size(number, survey.share(change))

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        from kappaskin.scenes.effects.at_work.temperature import temperature

        return temperature(self.warmer, self.gain, self.offsets(shape))
