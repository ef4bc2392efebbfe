"""Inconsistency test of each channel against the prediction of its neighbours."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import scipy
from numpy.typing import NDArray

from kappaskin.frames import Array, Frame, Indices, Mask
from kappaskin.sensing import Sensor, SensorLayout
from kappaskin.skin import MeshSkin

_LONG = 0.25  # s at least
_OFTEN_UP_TO = 3000  # channels that are evaluated so often; more as much less often
_MOST_FRAMES = 64  # frames that are kept of it, evenly
_FEWEST_FRAMES = 8  # whose differences give the noise
_PARTS = 4  # that are averaged, each by itself


@dataclass(frozen=True, slots=True, eq=False)
class ChannelStatistics:
    """Statistics of C channels over `seconds` that ended at `time` in s on the host's clock.

    `means` (T, C) of the readings over each of T parts, of `frames` frames each; NaN where a
    channel was not read or on a rail. `noise` (C,) from frame to frame, NaN where unknown; `railed`
    (C,) the share of the readings on a rail, NaN where there were none.
    """

    time: float
    seconds: float
    means: Array
    frames: float
    noise: Array
    railed: Array


class StatisticsWindow:
    """Collects frames, and computes their statistics four times a second at most.

    With more than 3000 channels less often in proportion, so that it costs no more.
    """

    def __init__(self, sensor: Sensor) -> None:
        self._chain = sensor.transduction
        self._rest = float(self._chain.curvature(np.zeros(1, np.int32))[0])
        self._long = _LONG * max(1.0, sensor.channels / _OFTEN_UP_TO)
        # Typed as float64: in float32 counts are exact up to 24 bits.
        counts = np.empty((_MOST_FRAMES, sensor.channels), np.float32)
        self._counts = cast("Array", counts)
        self._taken, self._begun, self._due = 0, -math.inf, -math.inf

    def __call__(self, frame: Frame) -> ChannelStatistics | None:
        """The statistics of the last quarter of a second where it ends with `frame`, else None."""
        time = frame.device_time
        if time < self._begun:  # the clock of a device that began anew
            self._taken, self._due = 0, time
        if time < self._due:
            if self._taken and len(frame.channels) < self._counts.shape[1]:
                # Or of channels that take turns the same would be passed over every time.
                self._counts[self._taken - 1, frame.channels] = frame.counts
            return None
        if not self._taken:
            self._begun = time
        self._due = time + self._long / _MOST_FRAMES
        row = self._counts[self._taken]
        if len(frame.channels) < len(row):
            row[:] = np.nan
        row[frame.channels] = frame.counts
        self._taken += 1
        seconds = time - self._begun
        if self._taken < _MOST_FRAMES and (self._taken < _FEWEST_FRAMES or seconds < self._long):
            return None
        statistics = self._statistics(self._counts[: self._taken], seconds, frame.host_time)
        self._taken = 0
        return statistics

    def _statistics(self, counts: Array, seconds: float, time: float) -> ChannelStatistics:
        low, high = self._chain.limits
        read, rails = ~np.isnan(counts), (counts <= low) | (counts >= high)
        starts = np.linspace(0, len(counts), _PARTS, endpoint=False).astype(int)

        def summed(values: Array) -> Array:
            return np.add.reduceat(values, starts, axis=0, dtype=float)

        with np.errstate(invalid="ignore", divide="ignore"):  # of none comes NaN
            means = summed(np.where(read, counts, 0.0)) / summed(read.astype(float))
            railed = rails.sum(axis=0) / read.sum(axis=0)
        means[summed(rails.astype(float)) > 0] = np.nan
        curvature = means * self._chain.resolution + self._rest
        noise = _noise(counts) * self._chain.resolution
        return ChannelStatistics(time, seconds, curvature, len(counts) / _PARTS, noise, railed)


def _noise(counts: Array) -> Array:
    """Standard deviations (C,) of white noise, from the second differences of `counts` (n, C)."""
    bends = (counts[2:] - 2 * counts[1:-1] + counts[:-2]).astype(float) ** 2
    known = ~np.isnan(bends)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.sqrt(np.where(known, bends, 0.0).sum(axis=0) / known.sum(axis=0) / 6)


_COUNT = 20  # neighbours that predict an element: two rings of a grid without its corners
_BESIDE = 8  # of them are next to it
_CLOSE = 1.6  # distances of elements: as far as they reach on a grid
_LENGTHS = (1.2, 2.5)  # of what bends the skin, in distances of elements
_NOISE = 1e-3  # in power, beside what a neighbour reads
_MISSING = 1e9  # the same, of a reading that is not there
_TINY = 1e-12
_ELEMENTS_AT_ONCE = 512  # elements whose weights are computed together: 15 MB each time


_ORDERS = {"m": 0, "m/m": 1, "1/m": 2}
"""How often w is derived in readings of each unit."""
_STEPS = np.array([(0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1)])
"""How often w is derived along x and y, in each derivative that readings consist of."""
_HERMITE: tuple[Callable[[Array], Array], ...] = (
    lambda u: np.ones_like(u),
    lambda u: u,
    lambda u: u**2 - 1,
    lambda u: (u**2 - 3) * u,
    lambda u: (u**2 - 6) * u**2 + 3,
)


def _derivatives(kinds: list[tuple[str, float]]) -> Array:
    """The coefficients (k, 6) of the derivatives in each of the `kinds` of readings."""
    found = np.zeros((len(kinds), len(_STEPS)))
    for row, (quantity, direction) in zip(found, kinds, strict=True):
        c, s = round(math.cos(direction), 12), round(math.sin(direction), 12)
        if quantity == "height":
            row[0] = 1.0
        elif quantity == "slope":
            row[1:3] = c, s
        elif quantity == "curvature":
            row[3:] = c * c, s * s, 2 * c * s
        else:
            row[5] = 1.0
    return found


def _covariance(distance: Array, steps: NDArray[np.int_]) -> Array:
    """Covariances (d, d, ...) of derivatives of w at two places a `distance` (2, ...) apart.

    Of a displacement w with the covariance exp(-r^2/2 l^2), the mean over the lengths l: its
    derivatives are (-1)^a He_m(x/l) He_n(y/l) exp(-r^2/2 l^2), with Hermite's polynomials and the
    order a of the derivative at the first place; those derived by `steps` (d, 2) along x and y.
    Scaled so that the variance of w_xx is 1.
    """
    shape = distance.shape[1:]
    orders = {(m, n): np.zeros(shape) for m, n in (steps[:, None] + steps).reshape(-1, 2).tolist()}
    for length in _LENGTHS:
        u, v = distance / length
        bell = np.exp(-(u**2 + v**2) / 2) / (3 * len(_LENGTHS))
        in_x = {m: bell * _HERMITE[m](u) for m in {m for m, _ in orders}}
        in_y = {n: _HERMITE[n](v) for n in {n for _, n in orders}}
        for m, n in orders:
            orders[m, n] += length ** (4.0 - m - n) * in_x[m] * in_y[n]
    total = np.empty((len(steps), len(steps), *shape))
    for i, first in enumerate(steps):
        for j, second in enumerate(steps):
            total[i, j] = (-1) ** first.sum() * orders[first[0] + second[0], first[1] + second[1]]
    return total


def _turned(c: Array, s: Array) -> Array:
    """The map (..., 6, 6) of derivatives along x and y to those along axes at (c, s) from there."""
    found = np.zeros((*c.shape, 6, 6))
    found[..., 0, 0] = 1
    found[..., 1:3, 1:3] = np.moveaxis(np.array([[c, s], [-s, c]]), (0, 1), (-2, -1))
    rows = [c * c, s * s, 2 * c * s], [s * s, c * c, -2 * c * s], [-c * s, c * s, c * c - s * s]
    found[..., 3:, 3:] = np.moveaxis(np.array(rows), (0, 1), (-2, -1))
    return found


def _own_channels(layout: SensorLayout) -> tuple[Indices, Indices]:
    """The elements (E,) that have readings, and those readings (E, q) of each.

    The last reading of an element that has fewer than others stands there several times.
    """
    elements, counts = np.unique(layout.element, return_counts=True)
    column = np.minimum(np.arange(int(counts.max())), counts[:, None] - 1)
    ordered = np.argsort(layout.element, kind="stable")
    return elements, ordered[(np.cumsum(counts) - counts)[:, None] + column]


class Neighbours:
    """Prediction of each of E elements from its k nearest neighbours, by kriging.

    The cost grows as the number of elements. An element's `own` (E, q) readings do not enter its
    prediction. `weights` (E, q, k q) are those of the `channels` (E, k q) around each; `spread`
    (E, q) is the variance of the prediction in units of the mean square of their readings.
    Elements without a reading count as none: `of` (C,) is the element of each channel.

    On a mesh, distances and directions are those along the skin. Where the skin itself bends on a
    shorter length than the elements tell, as where a held part of its rim ends, `soft` (C, N), the
    readings of its softest shapes, make the variance as large as the prediction of these is wrong.
    """

    def __init__(self, layout: SensorLayout, soft: Array | None = None) -> None:
        elements, self.own = _own_channels(layout)
        positions, E, q = layout.positions[elements], *self.own.shape
        self._base, at = None, positions
        if isinstance(layout.patch, MeshSkin):
            self._base = layout.patch.base(*positions.T)
            at = np.stack(self._base.point, axis=1)
        k = min(_COUNT, E - 1)
        distance, near = scipy.spatial.KDTree(at).query(at, k + 1)
        near = cast("Indices", near).reshape(E, k + 1)[:, 1:]
        pitch = float(np.median(np.reshape(distance, (E, k + 1))[:, 1:2])) if k else 1.0
        self._at = at / (pitch or 1.0)
        self.near = near
        """The elements (E, k) around each."""
        self.of: Indices = np.searchsorted(elements, layout.element)
        """The element (C,) of each channel."""
        self.alike: Indices = np.empty((layout.channels, k), int)
        """Of the elements (C, k) around each channel, the reading in the same place."""
        self.alike[self.own] = self.own[near].swapaxes(1, 2)
        self.channels: Indices = self.own[near].reshape(E, k * q)
        self.adjacent: Indices = self.own[near[:, :_BESIDE]].reshape(E, -1)
        """The channels (E, c) of the elements next to each."""
        away = np.reshape(distance, (E, k + 1))
        # On a grid the four nearest are as near as the first; where elements lie unevenly they tell
        # better how near others are.
        side = float(np.median(away[:, min(4, k)]))
        close = (away[:, 1:] < _CLOSE * side).sum(axis=1)
        self.alone: Array = _BESIDE / np.clip(close, 1, _BESIDE)
        """Ratio (E,) of the close neighbours inside a grid to those of each element."""
        kinds, kind = layout.directed
        parts = _derivatives(kinds)
        used = np.flatnonzero(parts.any(axis=0)) if self._base is None else np.arange(6)
        self._steps = _STEPS[used]
        self._parts = parts[kind[self.own]][:, :, used]
        here = _covariance(np.zeros(2), self._steps)
        self._variance = np.einsum("eqi,ij,eqj->eq", self._parts, here, self._parts)
        self.scale = np.ones(layout.channels)
        """What the readings (C,) are divided by, so that those of several units compare."""
        units = np.array(layout.kind_units)[layout.kind]
        for unit in set(layout.kind_units):
            own = (units == unit)[self.own]
            power = float(cast("Array", self._variance[own]).max())
            self._variance[own] /= power
            self._parts[own] /= math.sqrt(power)
            if len(set(layout.kind_units)) > 1:
                order = _ORDERS[unit]
                self.scale[units == unit] = math.sqrt(power) * (pitch or 1.0) ** (1 - order)
        self._soft = None if soft is None else soft / self.scale[:, None]
        self.weights = np.zeros((E, q, k * q))
        self.spread = np.ones((E, q))
        self.exclude(np.zeros(layout.channels, bool), np.arange(len(near)))

    def affected_by(self, channels: Mask) -> Indices:
        """The elements that some of `channels` (C,) predict."""
        return np.flatnonzero(channels[self.channels].any(axis=1))

    def exclude(self, missing: Mask, elements: Indices) -> None:
        """Predict `elements` (n,) without the channels that are `missing` (C,)."""
        for start in range(0, len(elements), _ELEMENTS_AT_ONCE):
            self._weigh(missing, elements[start : start + _ELEMENTS_AT_ONCE])

    def _seen_from(self, elements: Indices) -> tuple[Array, Array]:
        """Where the neighbours of `elements` (n,) are from them (2, n, k), and their derivatives.

        These (n, k, q, d) are along the axes of each of `elements`. On a mesh along the skin: as
        far as on an arc that turns the normal as much, and with the axes turned by the least
        turn of one normal to the other.
        """
        near = self.near[elements]
        far, around = self._at[near] - self._at[elements, None], self._parts[near]
        if self._base is None:
            return np.moveaxis(far, 2, 0), around
        frame, normal = self._base.frame, np.stack(self._base.normal, axis=1)
        own, n, there = frame[elements], normal[elements][:, None], normal[near]
        level = np.vecdot(n, there)
        # An arc is as many times as long as its chord.
        longer = 1 / np.sinc(np.arccos(np.clip(level, -1.0, 1.0)) / (2 * np.pi))
        at = np.einsum("eai,eki->aek", own, far)
        at *= longer * np.linalg.norm(far, axis=2) / np.maximum(np.hypot(*at), _TINY)
        along = frame[near][:, :, 0]
        share = np.vecdot(n, along) / np.maximum(1 + level, _TINY)
        c, s = np.einsum("eai,eki->aek", own, along - share[:, :, None] * (n + there))
        return at, around @ _turned(c, s)

    def _weigh(self, missing: Mask, elements: Indices) -> None:
        at, around = self._seen_from(elements)
        n, k, q = around.shape[:3]
        between = _covariance(at[:, :, :, None] - at[:, :, None], self._steps)
        blocks = np.einsum("ekqi,ijekl,elrj->ekqlr", around, between, around, optimize=True)
        S: Array = blocks.reshape(n, k * q, k * q)
        covariance = _covariance(at, self._steps)
        parts = (around, covariance, self._parts[elements])
        near: Array = np.einsum("ekqi,ijek,erj->ekqr", *parts, optimize=True).reshape(n, k * q, q)
        noise = np.where(missing[self.channels[elements]], _MISSING, _NOISE)
        S[:, np.arange(k * q), np.arange(k * q)] += noise
        W = cast("Array", np.linalg.solve(S, near))
        self.weights[elements] = W.swapaxes(1, 2)
        left = self._variance[elements] - np.sum(W * near, axis=1)
        if self._soft is not None:
            read = np.where(missing[:, None], 0.0, self._soft)[self.channels[elements]]
            wrong = self._soft[self.own[elements]] - self.weights[elements] @ read
            power = np.sum(read**2, axis=(1, 2))[:, None] / max(k * q, 1)
            share = np.sum(wrong**2, axis=2) / np.where(power > 0, power, np.inf)
            left = np.maximum(left, share)
        self.spread[elements] = np.maximum(left, 0.0)

    def predict(self, readings: Array, elements: Indices) -> tuple[Array, Array]:
        """Predicted readings of the channels `own[elements]` (n, q), and their variance.

        (T, n, q) each, from `readings` (T, C), NaN where one of the neighbours is.
        """
        around = readings.T[self.channels[elements]]  # (n, k q, T)
        predicted = np.matmul(self.weights[elements], around)
        power = np.einsum("ert,ert->et", around, around) / max(around.shape[1], 1)
        spread = self.spread[elements][:, :, None] * power[:, None]
        return predicted.transpose(2, 0, 1), spread.transpose(2, 0, 1)


_KEPT = 128  # means, 16 a second
_RECENT = 32  # of them are tested
_OFTEN = 24  # of them at most may be explained for a channel that is inconsistent
_FEWEST_MEANS = 8  # of those at least
_FORGOTTEN = 60.0  # s after which a reading that stays is what one is compared with
_SHAPE = 2.0  # times the mean square around is the most that a shape is thought to be
_GAIN = 0.05  # by which healthy channels may differ
_FAR = 4.0  # standard deviations
# Of what elements beside one change, what a point load on it makes its own reading differ by at
# most: 1.6 times, with 25 x 25 functions, where it presses on 10 x 10 elements; in a corner, with
# fewer beside it, so many times more.
_SHARP = 2.0
_SHARP_IN_ELASTOMER = 6.0  # of heights, under a cone whose contact is as wide as the elements lie
_SAME = 0.99  # of the correlation of what a channel reads and should, where a load presses on it
_USUAL = 1.4826  # standard deviations are so many times the median of the amounts
_FINE = 0.01  # of the largest change anywhere: the precision of any prediction


def rms(values: Array) -> Array:
    """Root mean squares (C,) of `values` (T, C) without NaN; zero where too few are known."""
    known = ~np.isnan(values)
    count = known.sum(axis=0)
    squares = np.where(known, values, 0.0)
    total = np.einsum("tc,tc->c", squares, squares)
    return np.where(count < _FEWEST_MEANS, 0.0, np.sqrt(total / np.maximum(count, 1)))


def _centred_known(values: Array) -> Array:
    """`values` (T, C) less their means over what is not NaN."""
    known = ~np.isnan(values)
    return values - np.where(known, values, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)


def centred(values: Array) -> Array:
    """`values` (T, C) less their means; zero for NaN."""
    return np.nan_to_num(_centred_known(values))


def _median(values: Array) -> float:
    known = values[~np.isnan(values)]
    return float(np.median(known)) if known.size else 0.0


def _largest(values: Array) -> float:
    return float(np.abs(np.nan_to_num(values)).max())


class InconsistencyTest:
    """Changes of C channels, `changed` (T, C), against those `predicted` (T, C) for them.

    Changes are relative to the readings of about a minute ago: offsets and old contacts are
    consistent. A `missing` channel predicts no others, but is predicted by them. `variance` (T, C)
    is that of the prediction. All are of readings over `neighbours.scale`. `distance` (C,) is how
    far a channel was off in the last two seconds, in standard deviations, zero where unknown; `off`
    (C,) the same in those units. `beyond` (C,)
    is above one where for a quarter of the time a channel was further off than four standard
    deviations and a point load on its element explain. A channel that is no further off, and always
    reads more than predicted, may be `pressed` (C,) by such a load.
    """

    def __init__(
        self, layout: SensorLayout, elastomer: bool = False, soft: Array | None = None
    ) -> None:
        C, self._sharp = layout.channels, _SHARP_IN_ELASTOMER if elastomer else _SHARP
        self.neighbours = Neighbours(layout, soft)
        self._every = np.arange(len(self.neighbours.own))
        self.missing = np.zeros(C, bool)
        self.reads: Array = np.full(C, np.nan)
        """Last reading (C,) of each channel."""
        self.base: Array = np.full(C, np.nan)
        """Reference (C,) of the changes."""
        self.changed, self.predicted, self.variance = (
            np.full((_KEPT, C), np.nan) for _ in range(3)
        )
        self._adjacent = np.zeros((_KEPT, len(self._every)))
        """Largest change (T, E) of the elements next to each."""
        self._typical = np.zeros(_KEPT)  # how far off healthy channels are
        self.usual = 0.0
        """Median noise of the channels whose noise is known."""
        self.distance, self.off, self.left_open = np.zeros(C), np.zeros(C), np.zeros(C)
        self.beyond = np.zeros(C)
        self.pressed = np.zeros(C, bool)

    @property
    def recent(self) -> slice:
        return slice(_KEPT - _RECENT, None)

    def scaled(self, statistics: ChannelStatistics) -> ChannelStatistics:
        """The `statistics` of readings over `neighbours.scale`, of which all the rest is."""
        scale = self.neighbours.scale
        return replace(statistics, means=statistics.means / scale, noise=statistics.noise / scale)

    def steps(self, statistics: ChannelStatistics, missing: Mask, wrong: Mask) -> Iterator[None]:
        """Update with `statistics`, without the `missing` (C,) channels, some of them `wrong` (C,).

        In steps that may be spread over frames.
        """
        known = ~np.isnan(statistics.means)
        with np.errstate(invalid="ignore"):  # of none comes NaN
            reads = np.where(known, statistics.means, 0.0).sum(axis=0) / known.sum(axis=0)
        self.reads = np.where(np.isnan(reads), self.reads, reads)
        self.base = np.where(np.isnan(self.base), reads, self.base)
        T = self._push(statistics.means - self.base)
        yield
        self._compare(T)
        yield
        unread = np.isnan(self.changed[self.recent]).all(axis=0)
        self.exclude(missing | unread)
        self._follow(statistics.seconds, wrong)
        yield
        self._measure(statistics)
        yield

    def _push(self, changed: Array) -> int:
        """Append the newest changes (T, C); returns T."""
        T = len(changed)
        for ring in (self.changed, self.predicted, self.variance):
            ring[:-T] = ring[T:]
        self.changed[-T:] = changed
        self._predict(self._every, slice(_KEPT - T, None))
        heard = np.nan_to_num(np.where(self.missing, 0.0, np.abs(self.changed[-T:])))
        self._adjacent[:-T] = self._adjacent[T:]
        self._adjacent[-T:] = heard[:, self.neighbours.adjacent].max(axis=2, initial=0.0)
        return T

    def _compare(self, T: int) -> None:
        """Compute how far off healthy channels were in the newest T means."""
        self._typical[:-T] = self._typical[T:]
        self._typical[-T:] = [
            np.hypot(_USUAL * _median(np.abs(now - predicted)), _FINE * _largest(now))
            for now, predicted in zip(self.changed[-T:], self.predicted[-T:], strict=True)
        ]

    def _predict(self, elements: Indices, when: slice) -> None:
        heard = np.where(self.missing, 0.0, self.changed[when])
        own = self.neighbours.own[elements]
        for ring, new in zip(
            (self.predicted, self.variance), self.neighbours.predict(heard, elements), strict=True
        ):
            ring[when, own] = new

    def exclude(self, missing: Mask) -> None:
        """Exclude exactly the `missing` (C,) channels from all predictions."""
        changed = missing != self.missing
        if changed.any():
            self.missing = missing.copy()
            elements = self.neighbours.affected_by(changed)
            self.neighbours.exclude(missing, elements)
            self._predict(elements, slice(None))

    def _follow(self, seconds: float, wrong: Mask) -> None:
        """Let the reference follow the readings, or the predictions of channels known as wrong."""
        latest = cast("Array", np.where(wrong, self.predicted[-1], self.changed[-1]))
        step: Array = np.nan_to_num(latest) * min(1.0, seconds / _FORGOTTEN)
        self.base += step

    def _measure(self, statistics: ChannelStatistics) -> None:
        heard = statistics.noise[~self.missing & ~np.isnan(statistics.noise)]
        self.usual = float(np.median(heard)) if heard.size else self.usual
        around = np.empty(len(self.reads))
        around[self.neighbours.own] = (self.neighbours.weights**2).sum(axis=2)
        white = np.fmax(statistics.noise, self.usual) ** 2 + self.usual**2 * around
        white /= statistics.frames
        left = (self.changed - self.predicted)[self.recent]
        s2 = _SHAPE * self.variance[self.recent] + (_GAIN * self.predicted[self.recent]) ** 2
        s2 += white + self._typical[self.recent, None] ** 2
        with np.errstate(invalid="ignore", divide="ignore"):
            self.distance = rms(left / np.sqrt(s2))
            beside = self.neighbours.alone * self._adjacent[self.recent]
            sharp = self._sharp * beside[:, self.neighbours.of]
            beyond = np.nan_to_num(np.abs(left) / (_FAR * np.sqrt(s2) + sharp))
        self.beyond = np.partition(beyond, _OFTEN, axis=0)[_OFTEN]
        changed, predicted = (
            np.nan_to_num(ring[self.recent]) for ring in (self.changed, self.predicted)
        )
        own, alike = (np.einsum("tc,tc->c", changed, other) for other in (changed, predicted))
        same = alike**2 > _SAME**2 * own * np.einsum("tc,tc->c", predicted, predicted)
        self.pressed = (self.beyond <= 1) & same & (alike > 0) & (alike < own)
        self.off, self.left_open = rms(left), rms(np.sqrt(s2))

    def motion(self) -> tuple[Array, Array, Array]:
        """RMS (C,) of the motion not predicted, of that predicted, and of its error.

        In the last two seconds, without offsets.
        """
        changed, predicted = self.changed[self.recent], self.predicted[self.recent]
        left = changed - predicted
        predicted = np.where(np.isnan(left), np.nan, predicted)
        return rms(_centred_known(left)), rms(_centred_known(predicted)), self.left_open

    def rebase(self, channels: Mask) -> None:
        """Set the reference of `channels` (C,) so that they agree with their neighbours now."""
        left = (self.changed - self.predicted)[self.recent][:, channels]
        known = ~np.isnan(left)
        shift = np.where(known, left, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        self.base[channels] += shift
        self.changed[:, channels] -= shift

    def predicted_levels(self, channels: Indices) -> tuple[Array, Array]:
        """Predicted readings of `channels` (n,) now, and their variance, (n,) each."""
        reads = np.where(self.missing, 0.0, np.nan_to_num(self.reads))
        elements = self.neighbours.of[channels]
        predicted, spread = self.neighbours.predict(reads[None], elements)
        own = self.neighbours.own[elements] == channels[:, None]
        at = np.arange(len(channels)), own.argmax(axis=1)
        return predicted[0][at], spread[0][at]
