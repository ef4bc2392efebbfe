"""How many of the frames that came can be computed, when there are more than time."""

import math
import time
from collections.abc import Callable

_SHARE = 0.6  # of the time, for estimates: the rest is for reading, which must not wait
_SAVED = 0.05  # s of computing that may be saved up for a burst, or be owed
_SEEN = 1 / 30  # s after which one is computed whatever there is time for: somebody looks on
_LATEST = 0.1  # weight of the last costs in what one is taken to cost


class Pace:
    """Spends a share of the time on estimates, and lets those few be of the newest frames.

    Where one takes 0.3 ms, each of 2,000 frames/s is computed; where it takes longer, as many as
    fit. A frame that is not computed costs a tenth.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._credit, self._cost = _SAVED, 0.0
        self._then, self._seen = clock(), -math.inf

    def affordable(self, waiting: int) -> int:
        """How many of so many frames are to be computed now."""
        now = self._clock()
        self._credit = min(_SAVED, self._credit + _SHARE * (now - self._then))
        self._then = now
        least = int(now - self._seen >= _SEEN)
        count = int(self._credit / self._cost) if self._cost else least
        return min(waiting, max(count, least))

    def spend(self, count: int, seconds: float) -> None:
        """Take note that `count` frames were computed in so many s."""
        if not count:
            return
        each = seconds / count
        self._cost = self._cost + _LATEST * (each - self._cost) if self._cost else each
        self._credit = max(-_SAVED, self._credit - seconds)
        self._seen = self._clock()
