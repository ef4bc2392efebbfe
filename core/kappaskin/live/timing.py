"""Timing of frames: arrival times, and how many can be computed in time."""

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kappaskin.frames import Frame

_ALL = 0.8  # of the time: where estimates of all frames take less, every one is computed
_SHARE = 0.4  # of it, for estimates where they take more: reading and drawing must not wait
_WANTED = 0.85  # of it, where receivers wait for each
_SAVED = 0.05  # s of computing that may be saved up for a burst, or be owed
_AT_ONCE = 0.02  # s of computing between two reads at most
_FRESH = 1.5e-3  # s of it where receivers wait for the newest
_SHOWN = 1 / 30  # s after which one is computed in any case: the screen shows it
_LATEST = 0.1  # weight of the last costs in what one is taken to cost
_WHILE = 0.5  # s over which it is judged how many come


class RateLimit:
    """Lets every frame be computed where there is time, else the newest, in a share of the time.

    A frame that is not computed costs a hundredth of one that is.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._credit, self._cost, self._rate = _SAVED, 0.0, 0.0
        self._then, self._seen = clock(), -math.inf

    def affordable(self, waiting: int, wanted: bool = False) -> int:
        """How many of so many frames are to be computed now; `wanted` where receivers wait for it.

        The last of those that arrived together is as late as all of them take: then few together.
        """
        share, within = (_WANTED, _FRESH) if wanted else (_SHARE, _AT_ONCE)
        now = self._clock()
        passed, self._then = now - self._then, now
        if passed:
            latest = min(1.0, passed / _WHILE)
            self._rate += latest * (waiting / passed - self._rate)
        self._credit = min(_SAVED, self._credit + share * passed)
        least = int(now - self._seen >= _SHOWN)
        if not self._cost:
            return min(waiting, least)
        allowed = _AT_ONCE if self._rate * self._cost <= _ALL else self._credit
        soon = max(1, int(within / self._cost))
        return min(waiting, soon, max(int(allowed / self._cost), least))

    def spend(self, count: int, seconds: float) -> None:
        """`count` frames were computed in so many s."""
        if not count:
            return
        each = seconds / count
        self._cost = self._cost + _LATEST * (each - self._cost) if self._cost else each
        self._credit = max(-_SAVED, self._credit - seconds)
        self._seen = self._clock()


@dataclass(frozen=True)
class ComputedFrames:
    """How many frames a second are computed, and the mean seconds that one takes.

    The `estimate` is everything that is computed; then it is published, and kept: recorded, and
    written where the window reads it. NaN before any is computed.
    """

    rate: float = 0.0
    estimate: float = math.nan
    publishing: float = math.nan
    keeping: float = math.nan

    @property
    def each(self) -> float:
        """Seconds that one takes in all."""
        return self.estimate + self.publishing + self.keeping


class ComputingTimes:
    """Adds up what frames take, by its parts."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._last = clock, ComputedFrames()
        self._since, self._count, self._spent = clock(), 0, (0.0, 0.0, 0.0)

    def add(self, estimate: float, publishing: float, keeping: float) -> None:
        """A frame took so many s."""
        before = self._spent
        self._spent = before[0] + estimate, before[1] + publishing, before[2] + keeping
        self._count += 1

    def means(self) -> ComputedFrames:
        """Of the last half second or more."""
        now = self._clock()
        if now - self._since >= _WHILE:
            means = [spent / self._count if self._count else math.nan for spent in self._spent]
            self._last = ComputedFrames(self._count / (now - self._since), *means)
            self._since, self._count, self._spent = now, 0, (0.0, 0.0, 0.0)
        return self._last


_LAST = 4096  # frames, and gaps between them
_RATE = 1.0  # s that the rate is of
_AGAIN = 0.5  # s between two times that the percentile is worked out


class ArrivalTimes:
    """Keeps when frames came since the last `clear`; `last` is when the last that was used did."""

    def __init__(self) -> None:
        self._gaps: deque[float] = deque(maxlen=_LAST)
        self._times: deque[float] = deque(maxlen=_LAST)
        self.clear()

    def clear(self) -> None:
        self._gaps.clear()
        self._times.clear()
        self.last = -math.inf
        self._last, self._gap, self._next = math.inf, math.nan, -math.inf

    def read(self, frames: list[Frame]) -> None:
        """Frames have arrived."""
        for frame in frames:
            if frame.host_time > self._last:
                self._gaps.append(frame.host_time - self._last)
            self._last = frame.host_time

    def used(self, frame: Frame) -> None:
        """A frame has been computed, or passed over."""
        self._times.append(frame.host_time)
        self.last = frame.host_time

    def rate(self, now: float) -> float:
        """How many a second are used."""
        times = self._times
        while times and times[0] <= now - _RATE:
            times.popleft()
        return len(times) / min(_RATE, max(now - times[0], 1e-3)) if times else 0.0

    def gap(self, now: float) -> float:
        """The 99th percentile of the time between two arrivals in s."""
        if self._gaps and now >= self._next:
            self._next = now + _AGAIN
            self._gap = float(np.percentile(self._gaps, 99))
        return self._gap
