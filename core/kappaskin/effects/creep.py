"""Creep: curvature to a reading that relaxes while the curvature stays, and back."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kappaskin.effects.effect import ReadingEffect, Running, Size
from kappaskin.effects.survey import Survey
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.memory import Remembering


def _step(elapsed: float, time_constant: float) -> tuple[float, float, float]:
    """What the slow part keeps of itself, takes of the last curvature and of the present one.

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
    """y = x - phi s, tau s' = x - s: what is read at once relaxes to its share 1 - phi.

    `share` phi is (C,), the part of the reading that goes; `time_constant` tau in s.
    """

    share: Array
    time_constant: float

    def __post_init__(self) -> None:
        if not (self.share.ndim == 1 and ((self.share >= 0) & (self.share < 1)).all()):
            raise Refusal(f"expected shares (C,) from 0 to below 1, got {self.share}")
        if not 0 < self.time_constant < math.inf:
            raise Refusal(f"expected a time constant above zero in s, got {self.time_constant}")

    def start(self) -> "Relaxing":
        """Curvature to reading, from rest."""
        return Relaxing(self)

    def start_inverse(self) -> "Restoring":
        """Reading to curvature, from rest."""
        return Restoring(self)


class _Slow(Remembering):
    """The slow part s and the curvature before, both (C,)."""

    REMEMBERED = ("_s", "_x", "_time")

    def __init__(self, solid: StandardLinearSolid) -> None:
        self._share, self._tau = solid.share, solid.time_constant
        self._s = np.zeros_like(self._share)
        self._x = np.zeros_like(self._share)
        self._time = math.nan

    def _begin(self, time: float) -> float:
        """Let the time pass as far as the past decides it; the weight of the present curvature."""
        # A first frame finds the skin at rest; a clock that went back tells of no time.
        keep, last, new = _step(time - self._time, self._tau)
        self._time = time
        self._s = keep * self._s + last * self._x
        return new

    def _end(self, x: Array, new: float) -> None:
        self._s += new * x
        self._x = x


class Relaxing(_Slow):
    """The solid at work, from curvature to reading."""

    def __call__(self, x: Array, time: float) -> Array:
        """What is read (C,) when the curvature is `x` (C,) at `time` in s."""
        self._end(x.copy(), self._begin(time))
        return x - self._share * self._s


class Restoring(_Slow):
    """The solid at work backwards: the curvature that `Relaxing` reads as `y`."""

    def __call__(self, y: Array, time: float) -> Array:
        """The curvature (C,) when `y` (C,) is read at `time` in s."""
        new = self._begin(time)
        x = (y + self._share * self._s) / (1 - new * self._share)
        self._end(x, new)
        return x.copy()


@dataclass(frozen=True)
class Creep(ReadingEffect):
    """Of every reading the `share` relaxes away, with the `time_constant` in s."""

    name: ClassVar = "creep"
    formula: ClassVar = "share that relaxes away while the scene lasts"

    share: float
    time_constant: float

    def __post_init__(self) -> None:
        self.solid(1)

    def solid(self, channels: int) -> StandardLinearSolid:
        """The same creep in each of so many `channels`."""
        return StandardLinearSolid(np.full(channels, float(self.share)), self.time_constant)

    def size(self, survey: Survey) -> Size:
        gone = -self.share * math.expm1(-survey.duration / self.time_constant)
        return Size(gone, gone)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        from kappaskin.effects.at_work.creep import creep

        return creep(self.solid(int(np.prod(shape))), shape)
