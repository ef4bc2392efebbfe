"""When frames came, and how evenly."""

import math
from collections import deque

import numpy as np

from kappaskin.frames import Frame

_KEPT = 4096  # frames, and gaps between them
_RATE = 1.0  # s that the rate is of
_AGAIN = 0.5  # s between two times that the percentile is worked out


class Arrivals:
    """Keeps when frames came since the last `clear`; `last` is when the last that was used did."""

    def __init__(self) -> None:
        self._gaps: deque[float] = deque(maxlen=_KEPT)
        self._times: deque[float] = deque(maxlen=_KEPT)
        self.clear()

    def clear(self) -> None:
        self._gaps.clear()
        self._times.clear()
        self.last = -math.inf
        self._last, self._gap, self._next = math.inf, math.nan, -math.inf

    def read(self, frames: list[Frame]) -> None:
        """So many have come."""
        for frame in frames:
            if frame.host_time > self._last:
                self._gaps.append(frame.host_time - self._last)
            self._last = frame.host_time

    def used(self, frame: Frame) -> None:
        """It has been worked out, or passed over."""
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
