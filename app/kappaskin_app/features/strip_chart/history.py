"""History: numbers over time, the last minute whole, an hour before it by tenths of a second."""

import numpy as np
from numpy.typing import NDArray

from kappaskin.frames import Array

WHOLE = 60.0
"""Seconds of which every frame is kept."""
LONG = 3600.0
"""Seconds of which the least, mean and largest in each tenth of a second are kept."""
_BIN = 0.1  # s
_MOST = 2**17  # frames kept: a minute at 2,184 per second
_GAP = 0.5  # s without a frame that a curve does not cross
_LEAST, _MEAN, _LARGEST = range(3)

Columns = NDArray[np.float32]


class _Rows:
    """The last `most` rows, each of a time and numbers (..., T), side by side in memory."""

    def __init__(self, most: int, *shape: int) -> None:
        self._most, self._end = most, 0
        self._times: Array = np.empty(2 * most)
        self._values: Columns = np.empty((*shape, 2 * most), np.float32)

    def clear(self) -> None:
        self._end = 0  # new arrays would take 10 ms: the system clears their memory

    def append(self, times: Array, values: Array) -> None:
        """Append at most `most` rows: `times` (T,), `values` (..., T)."""
        if self._end + len(times) > len(self._times):
            kept = slice(max(self._end - self._most, 0), self._end)
            count = kept.stop - kept.start
            self._times[:count] = self._times[kept].copy()
            self._values[..., :count] = self._values[..., kept].copy()
            self._end = count
        here = slice(self._end, self._end + len(times))
        self._times[here], self._values[..., here] = times, values
        self._end = here.stop

    @property
    def times(self) -> Array:
        return self._times[max(self._end - self._most, 0) : self._end]

    @property
    def values(self) -> Columns:
        return self._values[..., max(self._end - self._most, 0) : self._end]


class Span:
    """A number over a span of time: in each of T parts its `least`, `mean` and `largest`."""

    def __init__(self, times: Array, extremes: Array) -> None:
        self.times = times
        self.least, self.mean, self.largest = extremes

    @property
    def outline(self) -> tuple[Array, Array]:
        """A curve (2 T,) over all between least and largest."""
        y = np.stack([self.least, self.largest], axis=-1)
        y[1::2] = y[1::2, ::-1]  # from part to part the shorter way
        return np.repeat(self.times, 2), y.ravel()


class Bins:
    """Least, mean and largest of `columns` numbers in each of the last `most` bins of `width` s."""

    def __init__(self, columns: int, width: float, most: int) -> None:
        self._width, self._rows = width, _Rows(most, 3, columns)
        self._none = np.empty(0), np.empty((columns, 0))
        self._open = self._none  # of a span that is not complete

    def clear(self) -> None:
        self._rows.clear()
        self._open = self._none

    def append(self, times: Array, values: Array) -> None:
        """Append `values` (columns, T) at `times` (T,) in s, which never decrease."""
        times = np.concatenate([self._open[0], times])
        values = np.concatenate([self._open[1], values], axis=1)
        number = np.floor(times / self._width)
        whole = int(np.searchsorted(number, number[-1])) if len(times) else 0
        self._open = times[whole:], values[:, whole:]
        if whole:
            first = np.flatnonzero(np.diff(number[:whole], prepend=-np.inf))
            self._rows.append(*_combined(times[:whole], np.stack([values[:, :whole]] * 3), first))

    def span(self, column: int, begin: float, end: float, parts: int) -> Span:
        """A column between two times in s, in about so many `parts`."""
        return _in_parts(*self.between(column, begin, end), begin, parts)

    def between(self, column: int, begin: float, end: float) -> tuple[Array, Array]:
        """Times (n,) in s from `begin` until before `end`, and least, mean and largest (3, n)."""
        part = slice(*np.searchsorted(self._rows.times, [begin, end]))
        return self._rows.times[part], self._rows.values[:, column, part].astype(float)


class StripHistory:
    """Numbers of frames over time, in so many `columns`.

    Of a time before the last one everything begins anew: it is of another recording, or place in
    one.
    """

    def __init__(self, columns: int) -> None:
        self.columns, self.last = columns, -np.inf
        self._rows = _Rows(_MOST, columns)
        self._bins = Bins(columns, _BIN, round(LONG / _BIN))

    def clear(self) -> None:
        self._rows.clear()
        self._bins.clear()
        self.last = -np.inf

    def append(self, times: Array, values: Array) -> None:
        """Append `values` (T, columns), NaN where unknown, at `times` (T,) in s."""
        if len(times) and times[0] < self.last:
            self.clear()
        back = np.flatnonzero(np.diff(times) < 0)
        if len(back):
            self.clear()
            times, values = times[back[-1] + 1 :], values[back[-1] + 1 :]
        if not len(times):
            return
        times, columns = broken(times, values, self.last if np.isfinite(self.last) else times[0])
        self.last = float(times[-1])
        self._rows.append(times, columns)
        self._bins.append(times, columns)

    def span(self, column: int, begin: float, parts: int) -> Span:
        """A column since the time `begin` in s, in about so many `parts`."""
        rows = self._rows
        oldest = float(rows.times[0]) if len(rows.times) else np.inf
        early, before = self._bins.between(column, begin, oldest)
        late = slice(int(np.searchsorted(rows.times, begin)), None)
        times = np.concatenate([early, rows.times[late]])
        recent = np.broadcast_to(rows.values[column, late], (3, len(rows.times[late])))
        extremes = np.concatenate([before, recent], axis=1).astype(float)
        return _in_parts(times, extremes, begin, parts)


def _in_parts(times: Array, extremes: Array, begin: float, parts: int) -> Span:
    """What was at `times` (T,) in s since `begin`, in about so many `parts`."""
    if len(times) <= parts:
        return Span(times, extremes)
    part = max((times[-1] - max(begin, times[0])) / parts, 1e-9)
    # By the clock, not by the window: what is drawn does not flicker as it moves on.
    first = np.flatnonzero(np.diff(np.floor(times / part), prepend=-np.inf))
    times, combined = _combined(times, extremes[:, None], first)
    return Span(times, combined[:, 0])


def broken(times: Array, values: Array, last: float) -> tuple[Array, Array]:
    """Times (T,) in s, `values` (T, n) as columns (n, T), with unknown ones in the middle of gaps.

    `last` is the time before the first.
    """
    before = np.concatenate([[last], times[:-1]])
    gaps = np.flatnonzero(times - before > _GAP)
    middles = (before[gaps] + times[gaps]) / 2
    return np.insert(times, gaps, middles), np.insert(values.astype(float), gaps, np.nan, axis=0).T


def _combined(times: Array, extremes: Array, first: NDArray[np.intp]) -> tuple[Array, Array]:
    """Times and least, mean and largest (3, n, k) of runs of (3, n, T) that begin at `first` (k,).

    What is unknown is left out; a run of which nothing is known stays unknown.
    """
    count = np.diff(np.append(first, len(times)))
    known = np.isfinite(extremes[_MEAN])
    number = np.add.reduceat(known.astype(float), first, axis=-1)
    with np.errstate(invalid="ignore"):
        mean = np.add.reduceat(np.where(known, extremes[_MEAN], 0.0), first, axis=-1) / number
    least = np.fmin.reduceat(extremes[_LEAST], first, axis=-1)
    largest = np.fmax.reduceat(extremes[_LARGEST], first, axis=-1)
    return np.add.reduceat(times, first) / count, np.stack([least, mean, largest])
