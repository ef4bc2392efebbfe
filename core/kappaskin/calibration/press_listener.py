"""Readings of a skin that is pressed and let go to what they changed by at the most."""

import math
from collections import deque
from enum import Enum

import numpy as np

from kappaskin.frames import Array

_OFTEN = 0.005  # s between two readings that are kept
_STILL = 0.4  # s without motion are a rest
_LATELY = 0.1  # s that are averaged to see a press
_WHOLE = 0.8  # of that, at least, between the first reading kept and the last
_FEWEST, _FEWEST_AT_REST = 3, 6  # readings that are averaged, and of a rest
_CLEAR = 8.0  # standard deviations that a press stands out by
_MOVING = 6.0  # the same, that a skin at rest may move by
_LET_GO = 3.0  # times as far as it is bent in, it bulges where it was let go
_OVER = 0.25  # of its peak: less is left when a press is over


class Phase(Enum):
    """What is waited for."""

    REST = "rest"
    PRESS = "press"
    RELEASE = "release"


class Listener:
    """What C channels answer to one press: their change `peak` (C,) in 1/m when it was hardest.

    The change is that from the rest before it. `phase` says what is waited for: a rest, a press,
    the end of it; after that `peak` is no longer None. Whatever the readings are, nothing here asks
    where their channels are.
    """

    def __init__(self, channels: int, resolution: float) -> None:
        """Readings of `channels` that come in steps of `resolution` in 1/m: never less noise."""
        self.phase = Phase.REST
        self.peak: Array | None = None
        self._held = np.full(channels, np.nan)
        self._kept: deque[tuple[float, Array]] = deque()
        self._rest, self._noise, self._least = np.zeros(channels), math.nan, resolution
        self._hardest, self._most, self._pressed = np.zeros(channels), 0.0, 0.0

    def __call__(self, time: float, readings: Array) -> None:
        """Take in `readings` (C,) in 1/m at `time` in s, NaN where one is missing."""
        if self._kept and time < self._kept[-1][0]:  # a device that began anew
            self._kept.clear()
        # A reading that is missing now, as on a rail, is taken for the last one there was.
        self._held = np.where(np.isnan(readings), self._held, readings)
        if self._kept and time - self._kept[-1][0] < _OFTEN:
            return
        self._kept.append((time, self._held))
        while time - self._kept[0][0] > _STILL:
            self._kept.popleft()
        if self.phase is Phase.REST:
            self._settle()
        elif self.peak is None:
            self._follow()

    def _last(self, count: int | None = None) -> Array:
        """The readings (n, C) kept last, at most `count` of them."""
        kept = list(self._kept) if count is None else list(self._kept)[-count:]
        return np.array([reading for _, reading in kept])

    def _whole(self) -> bool:
        """Whether what is kept is long enough to tell a rest."""
        return self._kept[-1][0] - self._kept[0][0] >= _WHOLE * _STILL

    def _still(self, kept: Array) -> bool:
        """Whether nothing moved from the first half of `kept` (n, C) to the second."""
        half = len(kept) // 2
        moved = np.nan_to_num(np.abs(kept[half:].mean(axis=0) - kept[:half].mean(axis=0)))
        return bool(moved.max() <= _MOVING * self._noise * 2 / math.sqrt(len(kept)))

    def _settle(self) -> None:
        """Call it a rest once nothing has moved for a while."""
        if len(self._kept) < _FEWEST_AT_REST or not self._whole():
            return
        kept = self._last()
        noise = np.sqrt(np.mean(np.diff(kept, axis=0) ** 2, axis=0) / 2)
        self._noise = max(float(np.median(noise[~np.isnan(noise)])), self._least)
        if self._still(kept):
            self._rest, self.phase = kept.mean(axis=0), Phase.PRESS

    def _follow(self) -> None:
        now = self._kept[-1][0]
        count = sum(when >= now - _LATELY for when, _ in self._kept)
        lately = self._last(max(count, _FEWEST))
        change = lately.mean(axis=0) - self._rest
        change[np.isnan(change)] = 0.0
        most = float(np.abs(change).max())
        clear = most > _CLEAR * self._noise / math.sqrt(len(lately))
        if clear and change.max() > _LET_GO * -change.min():
            # It bulges: it was pressed already when it was called at rest.
            self.phase, self._hardest, self._most = Phase.REST, 0 * change, 0.0
            self._kept.clear()
            return
        if most > self._most:
            self._hardest, self._most = change, most
        if self.phase is Phase.PRESS and clear:
            self.phase, self._pressed = Phase.RELEASE, now
        elif self.phase is Phase.RELEASE and self._over(most, now):
            self.peak = self._hardest

    def _over(self, most: float, now: float) -> bool:
        """Whether it was let go, or lies still: then what comes next is the next press."""
        if most < _OVER * self._most:
            return True
        return now - self._pressed > _STILL and self._whole() and self._still(self._last())
