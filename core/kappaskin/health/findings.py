"""Findings: what is wrong with each channel, and what its exclusion costs in accuracy."""

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import RankDeficient
from kappaskin.estimation import FAULTS, Estimator, Fit, Uncertainty
from kappaskin.frames import COMPONENTS, Array, Mask
from kappaskin.health.inconsistency import InconsistencyTest, Indices, centred
from kappaskin.sensing import Sensor

_MOST_LISTED = 256  # findings that are told one by one


@dataclass(frozen=True)
class Finding:
    """What is wrong with one channel: `kind` is a word of `FAULTS`, `figure` says by how much.

    `since` when, in s on the clock of `Frame.host_time`. `kept` says that it is in the fit all the
    same, as no shape could be told without it.
    """

    channel: int
    element: int
    component: str
    kind: str
    since: float
    figure: str
    kept: bool = False

    def __str__(self) -> str:
        kept = "; kept, as no shape can be told without it" if self.kept else ""
        return f"{self.component} of element {self.element} {self.kind}: {self.figure}{kept}"


@dataclass(frozen=True)
class Health:
    """All that is wrong with the channels of a skin now.

    `findings` are told one by one, upwards, at most 256 of the `count` there are. Leaving them out
    makes the error bars of the shape `cost` times as wide, and that of the displacement at the
    contact `contact_cost` times, NaN where there is no contact. `kept` of them are in the fit all
    the same.
    """

    findings: tuple[Finding, ...] = ()
    count: int = 0
    kept: int = 0
    cost: float = 1.0
    contact_cost: float = math.nan

    def __str__(self) -> str:
        if not self.count:
            return "no channel is found wanting"
        out = self.count - self.kept
        words = [f"{out} channel{'' if out == 1 else 's'} left out"]
        words.append(f"error bars {100 * (self.cost - 1):+.0f} %")
        if math.isfinite(self.contact_cost):
            words.append(f"at the contact {100 * (self.contact_cost - 1):+.0f} %")
        if self.kept:
            words.append(f"{self.kept} found wanting, but no shape can be told without")
        return ", ".join(words)


def findings(
    kinds: NDArray[np.uint8], since: Array, figures: Array, kept: NDArray[np.bool_]
) -> tuple[Finding, ...]:
    """What is found of C channels: `kinds`, `since` and `kept` (C,), `figures` (C, 2)."""
    P = len(kinds) // 3
    return tuple(
        Finding(
            int(channel),
            int(channel % P),
            COMPONENTS[int(channel) // P],
            FAULTS[int(kinds[channel])],
            float(since[channel]),
            _figure(
                FAULTS[int(kinds[channel])],
                float(figures[channel, 0]),
                float(figures[channel, 1]),
                P,
            ),
            bool(kept[channel]),
        )
        for channel in np.flatnonzero(kinds)[:_MOST_LISTED]
    )


def _figure(kind: str, first: float, second: float, elements: int) -> str:
    """The figures that `classify_faults` gives, with their units in words."""
    if math.isnan(first):
        return "the device says so"
    if kind in ("dead", "stuck"):
        return f"reads {first:+.2f} 1/m while those around it tell of {second:.2f} 1/m of motion"
    if kind == "noisy":
        return f"{first:.2g} 1/m of noise, others have {second:.2g} 1/m"
    if kind == "saturated":
        return f"on a rail for {100 * first:.0f} % of the last second"
    if kind == "swapped":
        other = int(first)
        return f"reads what {COMPONENTS[other // elements]} of element {other % elements} should"
    trend = f", going by {second:+.2g} 1/m a minute" if kind == "drifting" else ""
    return f"{first:+.2f} 1/m off what those around it say{trend}"


DEAD, STUCK, NOISY, SWAPPED, OFFSET, SATURATED, DRIFTING = (
    FAULTS.index(kind)
    for kind in ("dead", "stuck", "noisy", "swapped", "offset", "saturated", "drifting")
)

_STILL = 0.25  # of how the others say that it moves: a channel that moves less does not answer
_MOVED = 4.0  # times what is left open, that others say it moves: what it does then is told by
_AT_REST = 0.1  # of the same: one that stays nearer to zero is dead
_COUNTS = 5.0  # resolutions, within which zero is zero
_CROSSED = 0.2  # of the squares left where two channels are swapped back
_STEADY = 2.0  # times its scatter is what a channel is off by, or it is noise
_LINE = 0.8  # of the scatter that a line explains; of a step it explains 0.75 at most
_MOST_PAIRED = 512  # channels whose pairs are looked at


@dataclass(frozen=True, slots=True, eq=False)
class ChannelFaults:
    """What is wrong with n channels: `kinds` (n,) by number in `FAULTS` and `figures` (n, 2)."""

    kinds: NDArray[np.uint8]
    figures: Array


def classify_faults(
    against: InconsistencyTest, channels: Indices, resolution: float, step: float
) -> ChannelFaults:
    """What is wrong with `channels` (n,), of which one mean comes every `step` s.

    Figures are in 1/m: of dead and stuck ones what they read and how far the others say that they
    move; of noisy ones their noise and the usual one; of swapped ones the channel that reads what
    they should, and NaN; of drifting ones and offsets what they are off by, and by how much more
    each minute.
    """
    changed, told = against.changed[:, channels], against.told[:, channels]
    left = changed - told
    changed, told = (np.where(np.isnan(left), np.nan, values) for values in (changed, told))
    lately = _amounts(told[against.recent]) > _MOVED * against.left_open[channels]
    moves, should = (
        np.where(lately, _amounts(values[against.recent]), _amounts(values))
        for values in (changed, told)
    )
    still = (moves < _STILL * should) & (should > _MOVED * against.left_open[channels])
    reads = against.reads[channels]
    rest = np.maximum(_AT_REST * should, _COUNTS * resolution)
    off, scatter = _means(left[against.recent]), _amounts(left[against.recent])
    line, slope = _trend(left)
    kinds = np.select(
        [still & (np.abs(reads) < rest), still, np.abs(off) < _STEADY * scatter, line > _LINE],
        [DEAD, STUCK, NOISY, DRIFTING],
        OFFSET,
    ).astype(np.uint8)
    figures = np.stack([off, slope * 60 / step], axis=1)
    figures[still] = np.stack([reads, should], axis=1)[still]
    loud = kinds == NOISY
    figures[loud] = np.stack([scatter, np.full(len(scatter), against.usual)], axis=1)[loud]
    crossed, partner = _partners(centred(changed), centred(told))
    kinds[crossed], figures[crossed] = SWAPPED, np.nan
    figures[crossed, 0] = channels[partner[crossed]]
    return ChannelFaults(kinds, figures)


def _means(values: Array) -> Array:
    """Means (n,) of what is known of `values` (T, n)."""
    known = ~np.isnan(values)
    return np.where(known, values, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)


def _amounts(values: Array) -> Array:
    """Standard deviations (n,) of what is known of `values` (T, n)."""
    apart, known = centred(values), np.count_nonzero(~np.isnan(values), axis=0)
    return np.sqrt(np.sum(apart**2, axis=0) / np.maximum(known, 1))


def _trend(left: Array) -> tuple[Array, Array]:
    """How much of the scatter of `left` (T, n) a line explains, and its slope, (n,) each."""
    time = np.where(np.isnan(left), np.nan, np.arange(len(left))[:, None])
    t, r = centred(time), centred(left)
    tt, tr, rr = (np.sum(a * b, axis=0) for a, b in ((t, t), (t, r), (r, r)))
    slope = np.divide(tr, tt, where=tt > 0, out=np.zeros_like(tr))
    return np.divide(slope * tr, rr, where=rr > 0, out=np.zeros_like(tr)), slope


def _partners(d: Array, p: Array) -> tuple[Mask, Indices]:
    """Which of n channels read what another one should and it what they should, and which one.

    Of how they move, `d` (T, n), and how they should, `p` (T, n).
    """
    n = int(d.shape[1])
    crossed = cast("Mask", np.zeros(n, bool))
    partner = cast("Indices", np.zeros(n, np.intp))
    if not 2 <= n <= _MOST_PAIRED:
        return crossed, partner
    D, Q, between = np.sum(d**2, axis=0), np.sum(p**2, axis=0), d.T @ p
    own = D + Q - 2 * np.diag(between)
    other = D[:, None] + Q - 2 * between  # of reading i as if it were j
    left = (other + other.T) / np.maximum(own[:, None] + own, np.finfo(float).tiny)
    np.fill_diagonal(left, np.inf)
    partner = cast("Indices", left.argmin(axis=1))
    # Of two stuck ones each moves as little as the other.
    crossed = cast("Mask", left.min(axis=1) < _CROSSED)
    each_other = cast("Mask", partner[partner] == np.arange(n))
    return crossed & each_other, partner


FaultCodes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class Exclusion:
    """The channels that a fit does without: of those of any of the `kinds` (3, P) all not `kept`.

    `ideal` is the fit at rest with every channel that such a skin has, `fit` the one without these.
    """

    kinds: FaultCodes
    kept: Mask
    ideal: Fit
    fit: Fit
    _out: Mask | None
    _worst: FaultCodes

    @classmethod
    def none(cls, sensor: Sensor, fit: Fit, ideal: Fit) -> "Exclusion":
        """Nothing left out but what `sensor` itself calls dead."""
        shape = sensor.layout.live.shape
        kinds = np.zeros(shape, np.uint8)
        return cls(kinds, np.zeros(shape, bool), ideal, fit, None, kinds[0])

    def __call__(self, curvature: Array) -> Array:
        """The `curvature` (3, P) to fit: NaN where it is left out."""
        return curvature if self._out is None else np.where(self._out, np.nan, curvature)

    def words(self, suspect: FaultCodes | None) -> FaultCodes:
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
            float(cast("Uncertainty", fit.uncertainty).sd_of(row)[0])
            for fit in (self.fit, self.ideal)
        )
        return without / with_all if with_all > 0 else math.nan


def exclude(
    was: Exclusion, estimator: Estimator, kinds: FaultCodes, badness: Array, loosest: float
) -> Exclusion:
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
    worst_of: FaultCodes = own.max(axis=0)
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
