"""Faults of channels, and the loss of accuracy by their exclusion."""

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import RankDeficient
from kappaskin.estimation import FAULTS, Estimator, Fit, Uncertainty
from kappaskin.frames import Array, Indices, Mask
from kappaskin.health.inconsistency import InconsistencyTest, centred
from kappaskin.sensing import SHOWN_UNITS, Sensor, SensorLayout

_MOST_LISTED = 256  # findings that are listed one by one


@dataclass(frozen=True)
class Finding:
    """The fault of one channel: `kind` is a word of `FAULTS`, `figure` says by how much.

    `since` when, in s on the clock of `Frame.host_time`. `retained` means that it is in the fit all
    the same, as the shape is not determined without it.
    """

    channel: int
    element: int
    component: str
    kind: str
    since: float
    figure: str
    retained: bool = False

    def __str__(self) -> str:
        retained = (
            "; not excluded, since the shape is undetermined without it" if self.retained else ""
        )
        return f"{self.component} of element {self.element} {self.kind}: {self.figure}{retained}"


@dataclass(frozen=True)
class Health:
    """The faults of all channels of a skin now.

    `findings` are the first of them by channel, at most 256 of the `count` there are. Their
    exclusion makes the error bars of the shape `cost` times as wide, and that of the displacement
    at the contact `contact_cost` times, NaN without a contact. `retained` of them are in the fit
    all the same.
    """

    findings: tuple[Finding, ...] = ()
    count: int = 0
    retained: int = 0
    cost: float = 1.0
    contact_cost: float = math.nan

    def __str__(self) -> str:
        if not self.count:
            return "all channels OK"
        out = self.count - self.retained
        words = [f"{out} channel{'' if out == 1 else 's'} excluded"]
        words.append(f"error bars {100 * (self.cost - 1):+.0f} %")
        if math.isfinite(self.contact_cost):
            words.append(f"at the contact {100 * (self.contact_cost - 1):+.0f} %")
        if self.retained:
            words.append(
                f"{self.retained} faulty but not excluded: the shape is undetermined without them"
            )
        return ", ".join(words)


def findings(
    kinds: NDArray[np.uint8], since: Array, figures: Array, retained: Mask, layout: SensorLayout
) -> tuple[Finding, ...]:
    """The findings for C channels with `kinds`, `since` and `retained` (C,), `figures` (C, 2)."""
    return tuple(
        Finding(
            int(channel),
            int(layout.element[channel]),
            layout.kind_names[layout.kind[channel]],
            FAULTS[int(kinds[channel])],
            float(since[channel]),
            _figure(FAULTS[int(kinds[channel])], int(channel), figures[channel], layout),
            bool(retained[channel]),
        )
        for channel in np.flatnonzero(kinds)[:_MOST_LISTED]
    )


def _figure(kind: str, channel: int, figures: Array, layout: SensorLayout) -> str:
    """The `figures` (2,) of `classify_faults` in words and units."""
    times, unit = SHOWN_UNITS[layout.kind_units[layout.kind[channel]]]
    first, second = times * figures
    if math.isnan(first):
        return "reported by the device"
    if kind in ("dead", "stuck"):
        return (
            f"reads {first:+.2f} {unit} while its neighbours predict {second:.2f} {unit} of change"
        )
    if kind == "noisy":
        return f"noise {first:.2g} {unit}, other channels {second:.2g} {unit}"
    if kind == "saturated":
        return f"saturated for {100 * figures[0]:.0f} % of the last second"
    if kind == "swapped":
        return f"has the readings of {layout.reading_name(int(figures[0]))}"
    trend = f", drifting by {second:+.2g} {unit} per minute" if kind == "drifting" else ""
    return f"{first:+.2f} {unit} off the prediction of its neighbours{trend}"


DEAD, STUCK, NOISY, SWAPPED, OFFSET, SATURATED, DRIFTING = (
    FAULTS.index(kind)
    for kind in ("dead", "stuck", "noisy", "swapped", "offset", "saturated", "drifting")
)

_STILL = 0.25  # of the predicted motion: a channel that moves less does not respond
_MOVED = 4.0  # times the error of the prediction: motion that is large enough to judge by
_AT_REST = 0.1  # of the same: one that stays nearer to zero is dead
_COUNTS = 5.0  # resolutions, within which zero is zero
_CROSSED = 0.2  # of the squares left where two channels are swapped back
_STEADY = 2.0  # times its scatter is what a channel is off by, or it is noise
_LINE = 0.8  # of the scatter that a line explains; of a step it explains 0.75 at most
_MOST_PAIRED = 512  # channels whose pairs are compared


@dataclass(frozen=True, slots=True, eq=False)
class ChannelFaults:
    """The faults of n channels: `kinds` (n,) by number in `FAULTS` and `figures` (n, 2)."""

    kinds: NDArray[np.uint8]
    figures: Array


def classify_faults(
    test: InconsistencyTest, channels: Indices, resolution: Array, step: float
) -> ChannelFaults:
    """The faults of `channels` (n,), which have one mean every `step` s.

    Figures are in the units of the test: for dead and stuck channels their reading and the
    predicted motion; for noisy ones their noise and the median noise; for swapped ones the channel
    that reads what they should, and NaN; for drifting ones and offsets how far they are off, and
    the drift per minute.
    `resolution` (n,) is that of one count.
    """
    changed, predicted = test.changed[:, channels], test.predicted[:, channels]
    left = changed - predicted
    changed, predicted = (
        np.where(np.isnan(left), np.nan, values) for values in (changed, predicted)
    )
    lately = _amounts(predicted[test.recent]) > _MOVED * test.left_open[channels]
    moves, should = (
        np.where(lately, _amounts(values[test.recent]), _amounts(values))
        for values in (changed, predicted)
    )
    still = (moves < _STILL * should) & (should > _MOVED * test.left_open[channels])
    reads = test.reads[channels]
    rest = np.maximum(_AT_REST * should, _COUNTS * resolution)
    off, scatter = _means(left[test.recent]), _amounts(left[test.recent])
    line, slope = _trend(left)
    kinds = np.select(
        [still & (np.abs(reads) < rest), still, np.abs(off) < _STEADY * scatter, line > _LINE],
        [DEAD, STUCK, NOISY, DRIFTING],
        OFFSET,
    ).astype(np.uint8)
    figures = np.stack([off, slope * 60 / step], axis=1)
    figures[still] = np.stack([reads, should], axis=1)[still]
    loud = kinds == NOISY
    figures[loud] = np.stack([scatter, np.full(len(scatter), test.usual)], axis=1)[loud]
    crossed, partner = _partners(centred(changed), centred(predicted))
    kinds[crossed], figures[crossed] = SWAPPED, np.nan
    figures[crossed, 0] = channels[partner[crossed]]
    return ChannelFaults(kinds, figures)


def _means(values: Array) -> Array:
    """Means (n,) of `values` (T, n) without NaN."""
    known = ~np.isnan(values)
    return np.where(known, values, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)


def _amounts(values: Array) -> Array:
    """Standard deviations (n,) of `values` (T, n) without NaN."""
    deviation, known = centred(values), np.count_nonzero(~np.isnan(values), axis=0)
    return np.sqrt(np.sum(deviation**2, axis=0) / np.maximum(known, 1))


def _trend(left: Array) -> tuple[Array, Array]:
    """The share of the scatter of `left` (T, n) that a line explains, and its slope, (n,) each."""
    time = np.where(np.isnan(left), np.nan, np.arange(len(left))[:, None])
    t, r = centred(time), centred(left)
    tt, tr, rr = (np.sum(a * b, axis=0) for a, b in ((t, t), (t, r), (r, r)))
    slope = np.divide(tr, tt, where=tt > 0, out=np.zeros_like(tr))
    return np.divide(slope * tr, rr, where=rr > 0, out=np.zeros_like(tr)), slope


def _partners(d: Array, p: Array) -> tuple[Mask, Indices]:
    """Which of n channels are swapped in pairs, and with which one.

    From their changes `d` (T, n) and the predicted ones `p` (T, n).
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
    """The channels excluded from a fit: with a fault in `kinds` and not `retained`, (3, P) or (R,).

    `ideal` is the fit at rest with every channel of such a skin, `fit` the one without these.
    """

    kinds: FaultCodes
    retained: Mask
    ideal: Fit
    fit: Fit
    _out: Mask | None
    _worst: FaultCodes

    @classmethod
    def none(cls, sensor: Sensor, fit: Fit, ideal: Fit) -> "Exclusion":
        """No exclusion but of the channels that `sensor` itself reports as dead."""
        shape = sensor.layout.live.shape
        no_fault = np.zeros(len(sensor.layout), np.uint8)
        return cls(np.zeros(shape, np.uint8), np.zeros(shape, bool), ideal, fit, None, no_fault)

    def __call__(self, curvature: Array) -> Array:
        """The readings `curvature` to fit: NaN where one is excluded."""
        return curvature if self._out is None else np.where(self._out, np.nan, curvature)

    def words(self, suspect: FaultCodes | None) -> FaultCodes:
        """The fault of each element (P,), of which the fit itself may `suspect` some."""
        found = self._worst
        return found if suspect is None else np.where(found > 0, found, suspect)

    @property
    def cost(self) -> float:
        """Factor by which the error bars of the shape are wider, by root mean square."""
        return float(np.linalg.norm(self.fit.unit_sd) / np.linalg.norm(self.ideal.unit_sd))

    def cost_at(self, place: Array) -> float:
        """Factor by which the error bar of the displacement at `place` (2,) in m is wider.

        NaN for a place of NaN, and where the edge holds the skin; 1 without an exclusion.
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
    """Exclude as many channels with a fault in `kinds` (C,) as the shape is determined without.

    By `badness` (C,), the worst first. A shape is determined while its error bars for unit noise
    have a norm of at most `loosest`. `was` is the exclusion before.
    """
    shape = was.kinds.shape
    if np.array_equal(kinds.reshape(shape), was.kinds):
        return was
    found = np.flatnonzero((kinds > 0) & estimator.readable)
    worst = found[np.argsort(-badness[found], kind="stable")]
    fit, count = _most(estimator, worst, loosest)
    out = np.isin(np.arange(kinds.size), worst[:count]).reshape(shape)
    retained = np.isin(np.arange(kinds.size), worst[count:]).reshape(shape)
    own = kinds.reshape(shape).copy()
    worst_of: FaultCodes = np.zeros(len(estimator.layout), np.uint8)
    np.maximum.at(worst_of, estimator.layout.element, kinds)
    return replace(
        was, kinds=own, retained=retained, fit=fit, _out=out if count else None, _worst=worst_of
    )


def _most(estimator: Estimator, worst: Indices, loosest: float) -> tuple[Fit, int]:
    """The fit at rest without as many of the `worst` channels as possible, and their number."""
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


def _without(estimator: Estimator, channels: Indices) -> Fit | None:
    missing = np.zeros(estimator.layout.channels, bool)
    missing[channels] = True
    with suppress(RankDeficient):
        return estimator.at_rest(missing.reshape(estimator.frame_shape))
    return None
