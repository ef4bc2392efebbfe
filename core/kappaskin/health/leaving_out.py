"""Findings to the readings that a fit does without, and to what that costs in accuracy."""

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import RankDeficient
from kappaskin.estimation import Estimator, Fit, Spread
from kappaskin.frames import Array, Mask
from kappaskin.sensing import Sensor

Kinds = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class LeftOut:
    """The channels that a fit does without: of those of any of the `kinds` (3, P) all not `kept`.

    `ideal` is the fit at rest with every channel that such a skin has, `fit` the one without these.
    """

    kinds: Kinds
    kept: Mask
    ideal: Fit
    fit: Fit
    _out: Mask | None
    _worst: Kinds

    @classmethod
    def none(cls, sensor: Sensor, fit: Fit, ideal: Fit) -> "LeftOut":
        """Nothing left out but what `sensor` itself calls dead."""
        shape = sensor.layout.live.shape
        kinds = np.zeros(shape, np.uint8)
        return cls(kinds, np.zeros(shape, bool), ideal, fit, None, kinds[0])

    def __call__(self, curvature: Array) -> Array:
        """The `curvature` (3, P) to fit: NaN where it is left out."""
        return curvature if self._out is None else np.where(self._out, np.nan, curvature)

    def words(self, suspect: Kinds | None) -> Kinds:
        """What is wrong with each element (P,), of which the fit itself may `suspect` some."""
        found = self._worst
        return found if suspect is None else np.where(found > 0, found, suspect)

    @property
    def cost(self) -> float:
        """How many times as wide the error bars of the shape are, by root mean square."""
        return float(np.linalg.norm(self.fit.unit_sd) / np.linalg.norm(self.ideal.unit_sd))

    def cost_at(self, place: Array) -> float:
        """How many times as wide the error bar of the displacement at `place` (2,) is.

        NaN where there is no place, and where the edge holds the skin; 1 where nothing is left out.
        """
        if not np.isfinite(place).all():
            return math.nan
        if self.fit is self.ideal:
            return 1.0
        row = self.fit.estimator.basis.at(place[None])
        without, with_all = (
            float(cast("Spread", fit.spreads).sd_of(row)[0]) for fit in (self.fit, self.ideal)
        )
        return without / with_all if with_all > 0 else math.nan


def leave_out(
    was: LeftOut, estimator: Estimator, kinds: Kinds, badness: Array, loosest: float
) -> LeftOut:
    """As many of the channels of any of `kinds` (C,) left out as leave a shape decided.

    By `badness` (C,), the worst first. A shape is decided while its error bars for unit noise have
    a norm of at most `loosest`.
    """
    shape = was.kinds.shape
    if np.array_equal(kinds.reshape(shape), was.kinds):
        return was
    found = np.flatnonzero((kinds > 0) & estimator.readable)
    worst = found[np.argsort(-badness[found], kind="stable")]
    fit, count = _most(estimator, worst, loosest)
    out = np.isin(np.arange(kinds.size), worst[:count]).reshape(shape)
    kept = np.isin(np.arange(kinds.size), worst[count:]).reshape(shape)
    own = kinds.reshape(shape).copy()
    worst_of: Kinds = own.max(axis=0)
    return replace(was, kinds=own, kept=kept, fit=fit, _out=out if count else None, _worst=worst_of)


def _most(estimator: Estimator, worst: NDArray[np.intp], loosest: float) -> tuple[Fit, int]:
    """The fit at rest without the most of the `worst` channels that it can be told without."""
    fit, least, most = estimator.at_rest(), 0, len(worst)
    count = most
    while least < most:
        found = _without(estimator, worst[:count])
        if found is not None and np.linalg.norm(found.unit_sd) <= loosest:
            fit, least = found, count
        else:
            most = count - 1
        count = (least + most + 1) // 2
    return fit, least


def _without(estimator: Estimator, channels: NDArray[np.intp]) -> Fit | None:
    missing = np.zeros(3 * len(estimator.layout), bool)
    missing[channels] = True
    with suppress(RankDeficient):
        return estimator.at_rest(missing.reshape(3, -1))
    return None
