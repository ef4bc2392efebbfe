"""Hysteresis and creep: Prandtl-Ishlinskii operators and standard linear solids."""

import math
from dataclasses import dataclass

import numpy as np

from kappaskin._state import Stateful
from kappaskin.errors import Refusal
from kappaskin.frames import Array


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
            raise Refusal("expected increasing thresholds above zero")
        if not ((self._slopes > 0).all() and (a > 0).all()):
            raise Refusal("expected weights and a stretch for which the reading always increases")

    @property
    def _slopes(self) -> Array:
        """Slope (J + 1, C) of the reading over the curvature while the first j plays move along."""
        return np.cumsum(np.vstack([self.linear[None], self.weights]), axis=0)

    @property
    def inverse(self) -> "PrandtlIshlinskii":
        """The inverse operator, from reading to curvature; its plays have negative weights.

        Coming from rest the operator is a broken line through the points (r_j, y_j). The inverse
        comes from rest along the mirrored line: y_j are its thresholds, the changes of 1 / slope
        its weights.
        """
        slopes, r = self._slopes, self.thresholds
        y = np.cumsum(slopes[:-1] * np.diff(r, axis=0, prepend=0.0), axis=0)
        rise = 1 / slopes
        return PrandtlIshlinskii(y, np.diff(rise, axis=0), rise[0], self.stretch)

    def start(self) -> "PlayFilter":
        """The operator with its state, for C channels, with every play at zero."""
        return PlayFilter(self)


class PlayFilter(Stateful):
    """The positions of all plays; each call with a frame moves them."""

    STATE = ("_w",)

    def __init__(self, operator: PrandtlIshlinskii) -> None:
        self._r, self._p = operator.thresholds, operator.weights
        self._q = operator.linear
        # E(z) = z + (a - 1) max(z, 0), with 1/a for its inverse: a call less than by both halves.
        self._stretch, self._shrink = operator.stretch - 1, 1 / operator.stretch - 1
        self._zero = np.zeros_like(operator.linear)
        self._w = np.zeros_like(self._r)
        self._room = np.empty_like(self._r)

    def __call__(self, x: Array) -> Array:
        """Reading (C,) for the next curvature `x` (C,), both in 1/m; all of it finite."""
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


def _step(elapsed: float, time_constant: float) -> tuple[float, float, float]:
    """Weights of the slow part, of the last curvature and of the present one.

    s' = (x - s) / tau, solved exactly for an x that went straight from the last to the present
    value in the time `elapsed`.
    """
    z = elapsed / time_constant
    if not z > 0:
        return 1.0, 0.0, 0.0
    gone = -math.expm1(-z)
    new = 1 - gone / z
    return 1 - gone, gone - new, new


@dataclass(frozen=True, eq=False)
class StandardLinearSolid:
    """Creep, y = x - phi s with tau s' = x - s: a reading relaxes to its share 1 - phi.

    `share` phi (C,) is the part that relaxes; `time_constant` tau in s.
    """

    share: Array
    time_constant: float

    def __post_init__(self) -> None:
        if not (self.share.ndim == 1 and ((self.share >= 0) & (self.share < 1)).all()):
            raise Refusal(f"expected shares (C,) from 0 to below 1, got {self.share}")
        if not 0 < self.time_constant < math.inf:
            raise Refusal(f"expected a time constant above zero in s, got {self.time_constant}")

    def start(self) -> "CreepFilter":
        """The filter from curvature to reading, from rest."""
        return CreepFilter(self)

    def start_inverse(self) -> "InverseCreepFilter":
        """The filter from reading to curvature, from rest."""
        return InverseCreepFilter(self)


class _CreepState(Stateful):
    """The slow part s and the curvature before, both (C,)."""

    STATE = ("_s", "_x", "_time")

    def __init__(self, solid: StandardLinearSolid) -> None:
        self._share, self._tau = solid.share, solid.time_constant
        self._s = np.zeros_like(self._share)
        self._x = np.zeros_like(self._share)
        self._time = math.nan

    def _begin(self, time: float) -> float:
        """Advance the slow part to `time` in s; the weight of the present curvature in it."""
        # A first frame finds the skin at rest; after a clock went back no time is counted.
        keep, last, new = _step(time - self._time, self._tau)
        self._time = time
        self._s = keep * self._s + last * self._x
        return new

    def _end(self, x: Array, new: float) -> None:
        self._s += new * x
        self._x = x


class CreepFilter(_CreepState):
    """Creep with its state: from curvature to reading."""

    def __call__(self, x: Array, time: float) -> Array:
        """Reading (C,) in 1/m for the curvature `x` (C,) in 1/m at `time` in s."""
        self._end(x.copy(), self._begin(time))
        return x - self._share * self._s


class InverseCreepFilter(_CreepState):
    """Creep compensated, with its state: the curvature that `CreepFilter` reads as `y`."""

    def __call__(self, y: Array, time: float) -> Array:
        """Curvature (C,) in 1/m for the reading `y` (C,) in 1/m at `time` in s."""
        new = self._begin(time)
        x = (y + self._share * self._s) / (1 - new * self._share)
        self._end(x, new)
        return x.copy()
