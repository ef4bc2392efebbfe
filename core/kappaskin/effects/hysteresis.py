"""Hysteresis: curvature to a reading that depends on the way the curvature came, and back."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kappaskin.effects.effect import ReadingEffect, Running, Size
from kappaskin.effects.survey import Survey
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.memory import Remembering

_MOST = 100  # plays: each costs time in every frame


@dataclass(frozen=True, eq=False)
class PrandtlIshlinskii:
    """y = E(q u + sum_j p_j w_j), u = E^-1(x): weighted plays, on a scale that E stretches.

    A play w_j follows u and lags behind it by at most its threshold r_j: it stays where it was
    unless that is outside [u - r_j, u + r_j]. E(z) is a z above zero and z below: it makes the
    loops on the positive side a times wider and leaves the slope of a long way, q + sum p_j, alike
    on both. It is one of the generalised Prandtl-Ishlinskii operators of Al Janaideh, Rakheja and
    Su (2010), whose inverse is another of them.

    `thresholds` and `weights` are (J, C), thresholds in 1/m of negative curvature and rising along
    J; `linear` q and `stretch` a are (C,), for C channels.
    """

    thresholds: Array
    weights: Array
    linear: Array
    stretch: Array

    def __post_init__(self) -> None:
        r, p, q, a = self.thresholds, self.weights, self.linear, self.stretch
        if not (r.ndim == 2 and r.shape == p.shape and q.shape == a.shape == r.shape[1:]):
            raise Refusal(
                "expected thresholds and weights (J, C), linear and stretch (C,), got shapes "
                f"{r.shape}, {p.shape}, {q.shape}, {a.shape}"
            )
        if not all(np.isfinite(part).all() for part in (r, p, q, a)):
            raise Refusal("expected finite thresholds, weights, linear parts and stretches")
        if not (np.diff(r, axis=0, prepend=0.0) > 0).all():
            raise Refusal("expected thresholds above zero that rise")
        if not ((self._slopes > 0).all() and (a > 0).all()):
            raise Refusal("expected weights and a stretch with which the reading always rises")

    @property
    def _slopes(self) -> Array:
        """What a reading rises by per curvature once the first j plays move along, (J + 1, C)."""
        return np.cumsum(np.vstack([self.linear[None], self.weights]), axis=0)

    @property
    def inverse(self) -> "PrandtlIshlinskii":
        """The operator that gives the curvature back; its plays have weights below zero.

        Coming from rest the operator is a broken line through the points (r_j, y_j). The inverse
        comes from rest along the mirrored line: y_j are its thresholds, the changes of 1 / slope
        its weights.
        """
        slopes, r = self._slopes, self.thresholds
        y = np.cumsum(slopes[:-1] * np.diff(r, axis=0, prepend=0.0), axis=0)
        rise = 1 / slopes
        return PrandtlIshlinskii(y, np.diff(rise, axis=0), rise[0], self.stretch)

    def start(self) -> "Plays":
        """The operator at work on C channels, with every play at zero."""
        return Plays(self)


class Plays(Remembering):
    """The positions of all plays; called with each frame, it moves them."""

    REMEMBERED = ("_w",)

    def __init__(self, operator: PrandtlIshlinskii) -> None:
        self._r, self._p = operator.thresholds, operator.weights
        self._q = operator.linear
        # E(z) = z + (a - 1) max(z, 0), with 1/a for its inverse: a call less than by both halves.
        self._stretch, self._shrink = operator.stretch - 1, 1 / operator.stretch - 1
        self._zero = np.zeros_like(operator.linear)
        self._w = np.zeros_like(self._r)
        self._room = np.empty_like(self._r)

    def __call__(self, x: Array) -> Array:
        """What is read (C,) when the curvature `x` (C,) comes next; all of it finite."""
        w, room = self._w, self._room
        u = np.maximum(x, self._zero)
        u *= self._shrink
        u += x
        np.maximum(w, np.subtract(u, self._r, out=room), out=w)
        np.minimum(w, np.add(u, self._r, out=room), out=w)
        u *= self._q
        u += np.einsum("jc,jc->c", self._p, w)
        y = np.maximum(u, self._zero)
        y *= self._stretch
        y += u
        return y


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
        from kappaskin.effects.at_work.hysteresis import hysteresis

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
