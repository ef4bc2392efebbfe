"""Inconsistency test of each channel against the prediction of its neighbours."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np
import scipy

from kappaskin.frames import Array, Frame, Indices, Mask
from kappaskin.sensing import Sensor, SensorLayout

_LONG = 0.25  # s at least
_OFTEN_UP_TO = 3000  # channels that are evaluated so often; more as much less often
_MOST_FRAMES = 64  # frames that are kept of it, evenly
_FEWEST_FRAMES = 8  # whose differences give the noise
_PARTS = 4  # that are averaged, each by itself


@dataclass(frozen=True, slots=True, eq=False)
class ChannelStatistics:
    """Statistics of C channels over `seconds` that ended at `time` in s on the host's clock.

    `means` (T, C) in 1/m over each of T parts, of `frames` frames each; NaN where a channel was not
    read or on a rail. `noise` (C,) in 1/m from frame to frame, NaN where unknown; `railed` (C,) the
    share of the readings on a rail, NaN where there were none.
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
_ELEMENTS_AT_ONCE = 512  # elements whose weights are computed together: 15 MB each time


def _covariance(distance: Array) -> Array:
    """Covariances (3, 3, ...) of the curvatures of two elements at a `distance` (2, ...).

    Of a displacement with the covariance exp(-r^2/2 l^2), the mean over the lengths l: its fourth
    derivatives are He_m(x/l) He_n(y/l) exp(-r^2/2 l^2), m + n = 4, with Hermite's polynomials.
    Scaled so that the variance of xx and of yy is 1, and that of xy 1/3.
    """
    total = np.zeros((3, 3, *distance.shape[1:]))
    for length in _LENGTHS:
        u, v = distance / length
        bell = np.exp(-(u**2 + v**2) / 2) / (3 * len(_LENGTHS))
        uu, vv = u**2 - 1, v**2 - 1
        total[0, 0] += (uu * (uu - 4) - 2) * bell
        total[1, 1] += (vv * (vv - 4) - 2) * bell
        total[0, 1] += uu * vv * bell
        total[0, 2] += (uu - 2) * u * v * bell
        total[1, 2] += (vv - 2) * u * v * bell
    total[2, 2] = total[1, 0] = total[0, 1]
    total[2, :2] = total[:2, 2]
    return total


class Neighbours:
    """Prediction of each of P elements from its k nearest neighbours, by kriging.

    The cost grows as the number of elements. An element's own readings do not enter its
    prediction. `weights` (P, 3, 3 k) are those of the `channels` (P, 3 k) around each; `spread`
    (P, 3) is the variance of the prediction in units of the mean square of their readings.
    """

    def __init__(self, layout: SensorLayout) -> None:
        P = len(layout)
        k = min(_COUNT, P - 1)
        distance, near = scipy.spatial.KDTree(layout.positions).query(layout.positions, k + 1)
        near = cast("Indices", near).reshape(P, k + 1)[:, 1:]
        pitch = float(np.median(np.reshape(distance, (P, k + 1))[:, 1:2])) if k else 1.0
        self._at = layout.positions.T / (pitch or 1.0)
        self.near = near
        """The elements (P, k) around each."""
        self.channels: Indices = (near[:, None] + P * np.arange(3)[:, None]).reshape(P, 3 * k)
        self.adjacent: Indices = self.channels.reshape(P, 3, k)[:, :, :_BESIDE].reshape(P, -1)
        """The channels (P, c) of the elements next to each."""
        close = (np.reshape(distance, (P, k + 1))[:, 1:] < _CLOSE * pitch).sum(axis=1)
        self.alone: Array = _BESIDE / np.clip(close, 1, _BESIDE)
        """Ratio (P,) of the close neighbours inside a grid to those of each element."""
        self.weights = np.zeros((P, 3, 3 * k))
        self.spread = np.ones((P, 3))
        self.exclude(np.zeros(3 * P, bool), np.arange(P))

    def affected_by(self, channels: Mask) -> Indices:
        """The elements that some of `channels` (3 P,) predict."""
        return np.flatnonzero(channels[self.channels].any(axis=1))

    def exclude(self, missing: Mask, elements: Indices) -> None:
        """Predict `elements` without the channels that are `missing` (3 P,)."""
        for start in range(0, len(elements), _ELEMENTS_AT_ONCE):
            self._weigh(missing, elements[start : start + _ELEMENTS_AT_ONCE])

    def _weigh(self, missing: Mask, elements: Indices) -> None:
        near, E = self._at[:, self.near[elements]], len(elements)
        k = near.shape[2]
        between = _covariance(near[:, :, :, None] - near[:, :, None])
        S = between.transpose(2, 0, 3, 1, 4).reshape(E, 3 * k, 3 * k)
        covariance = _covariance(near - self._at[:, elements, None])
        adjacent = covariance.transpose(2, 1, 3, 0).reshape(E, 3 * k, 3)
        noise = np.where(missing[self.channels[elements]], _MISSING, _NOISE)
        S[:, np.arange(3 * k), np.arange(3 * k)] += noise
        W = np.linalg.solve(S, adjacent)
        own = np.diag(_covariance(np.zeros(2)))
        self.weights[elements] = W.swapaxes(1, 2)
        self.spread[elements] = np.maximum(own - np.sum(W * adjacent, axis=1), 0.0)

    def predict(self, readings: Array, elements: Indices) -> tuple[Array, Array]:
        """Predicted readings of `elements` (E,) and their variance, (T, 3, E) each.

        From `readings` (T, 3 P) in 1/m, NaN where one of the neighbours is.
        """
        around = readings.T[self.channels[elements]]  # (E, 3 k, T)
        predicted = np.matmul(self.weights[elements], around)
        power = np.einsum("ert,ert->et", around, around) / max(around.shape[1], 1)
        spread = self.spread[elements][:, :, None] * power[:, None]
        return predicted.transpose(2, 1, 0), spread.transpose(2, 1, 0)


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
    """Changes of C channels, `changed` (T, C) in 1/m, against those `predicted` (T, C) for them.

    Changes are relative to the readings of about a minute ago: offsets and old contacts are
    consistent. A `missing` channel predicts no others, but is predicted by them. `variance` (T, C)
    in 1/m^2 is that of the prediction. `distance` (C,) is how far a channel was off in the last two
    seconds, in standard deviations, zero where unknown; `off` (C,) the same in 1/m. `beyond` (C,)
    is above one where for a quarter of the time a channel was further off than four standard
    deviations and a point load on its element explain. A channel that is no further off, and always
    reads more than predicted, may be `pressed` (C,) by such a load.
    """

    def __init__(self, layout: SensorLayout) -> None:
        C = 3 * len(layout)
        self.neighbours = Neighbours(layout)
        self._every = np.arange(len(layout))
        self.missing = np.zeros(C, bool)
        self.reads: Array = np.full(C, np.nan)
        """Last reading (C,) of each channel in 1/m."""
        self.base: Array = np.full(C, np.nan)
        """Reference (C,) of the changes in 1/m."""
        self.changed, self.predicted, self.variance = (
            np.full((_KEPT, C), np.nan) for _ in range(3)
        )
        self._adjacent = np.zeros((_KEPT, len(layout)))
        """Largest change (T, P) in 1/m of the elements next to each."""
        self._typical = np.zeros(_KEPT)  # in 1/m, how far off healthy channels are
        self.usual = 0.0
        """Median noise in 1/m of the channels whose noise is known."""
        self.distance, self.off, self.left_open = np.zeros(C), np.zeros(C), np.zeros(C)
        self.beyond = np.zeros(C)
        self.pressed = np.zeros(C, bool)

    @property
    def recent(self) -> slice:
        return slice(_KEPT - _RECENT, None)

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
        predicted, spread = self.neighbours.predict(heard, elements)
        P = len(self._every)
        for ring, new in ((self.predicted, predicted), (self.variance, spread)):
            ring.reshape(_KEPT, 3, P)[when][:, :, elements] = new

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
        around = (self.neighbours.weights**2).sum(axis=2).T.ravel()
        white = np.fmax(statistics.noise, self.usual) ** 2 + self.usual**2 * around
        white /= statistics.frames
        left = (self.changed - self.predicted)[self.recent]
        s2 = _SHAPE * self.variance[self.recent] + (_GAIN * self.predicted[self.recent]) ** 2
        s2 += white + self._typical[self.recent, None] ** 2
        with np.errstate(invalid="ignore", divide="ignore"):
            self.distance = rms(left / np.sqrt(s2))
            sharp = _SHARP * np.tile(self.neighbours.alone * self._adjacent[self.recent], 3)
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
        """RMS (C,) in 1/m of the motion not predicted, of that predicted, and of its error.

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
        """Predicted readings of `channels` (n,) now, in 1/m, and their variance, (n,) each."""
        P = len(self._every)
        reads = np.where(self.missing, 0.0, np.nan_to_num(self.reads))
        predicted, spread = self.neighbours.predict(reads[None], channels % P)
        row, each = channels // P, np.arange(len(channels))
        return predicted[0, row, each], spread[0, row, each]
