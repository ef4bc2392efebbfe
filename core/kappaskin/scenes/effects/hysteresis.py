"""Hysteresis of the gages: a reading that depends on the way the curvature came."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.scenes.effects.effect import ReadingEffect, Running, Size
from kappaskin.scenes.effects.survey import Survey
from kappaskin.sensing import PrandtlIshlinskii

_MOST = 100  # plays: each costs time in every frame


@dataclass(frozen=True)
class Hysteresis(ReadingEffect):
    """The same loops in every channel: plays of `weights` at `thresholds` in 1/m.

    Loops on positive curvature are `asymmetry` times wider than on negative curvature, in which
    thresholds count. A long way in one direction is read with its true slope of 1.
    """

    name: ClassVar = "hysteresis"
    formula: ClassVar = "how far the plays lag behind, over peak curvature"

    thresholds: tuple[float, ...]
    weights: tuple[float, ...]
    asymmetry: float = 1.0

    def __post_init__(self) -> None:
        if not (len(self.thresholds) == len(self.weights) and min(self.weights, default=0.0) >= 0):
            raise Refusal(
                "expected one weight of at least 0 for each threshold, got "
                f"{len(self.weights)} for {len(self.thresholds)}, {self.weights}"
            )
        if len(self.weights) > _MOST:
            raise Refusal(f"expected at most {_MOST} thresholds, got {len(self.weights)}")
        if not sum(self.weights) < 1:
            raise Refusal(f"expected weights whose sum is below 1, got {sum(self.weights):g}")
        self.operator(1)

    def operator(self, channels: int) -> PrandtlIshlinskii:
        """The same loops in each of so many `channels`."""

        def everywhere(values: tuple[float, ...]) -> Array:
            return np.tile(np.array(values, float)[:, None], channels)

        p = everywhere(self.weights)
        a = np.full(channels, float(self.asymmetry))
        return PrandtlIshlinskii(everywhere(self.thresholds), p, 1 - p.sum(axis=0), a)

    def size(self, survey: Survey) -> Size:
        # Each play lags behind by its threshold, or by all there is to lag behind of.
        wider = max(self.asymmetry, 1.0)
        lags = np.minimum(np.array(self.thresholds) * wider, survey.peak) * self.weights
        number = float(lags.sum()) / survey.peak
        return Size(number, number)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        from kappaskin.scenes.effects.at_work.hysteresis import hysteresis

        return hysteresis(self.operator(int(np.prod(shape))), shape)


# A loop that swings to both sides is 2 a sum p_j r_j wide on the positive one and 2 sum p_j r_j on
# the other, as soon as it is wider than the plays: 7 1/m (the paper's section 6.2) and 4.4 here,
# over +-80 1/m, which is 1 % strain in a skin of 250 um. From rest the first one is 6.5 wide.
_THRESHOLDS = tuple(2.5 * j for j in range(1, 9))
_ASYMMETRY = 1.6
_WEIGHT = 7 / (2 * _ASYMMETRY * sum(_THRESHOLDS))

SECOND_GENERATION_LOOPS = Hysteresis(_THRESHOLDS, (_WEIGHT,) * 8, _ASYMMETRY)
"""The paper's second prototype (Fig. 8): loops up to 7 1/m wide, less on negative curvature."""

FIRST_GENERATION_LOOPS = Hysteresis(_THRESHOLDS, (3 * _WEIGHT,) * 8, _ASYMMETRY)
"""The paper's first prototype (Fig. 7): loops three times as wide."""
