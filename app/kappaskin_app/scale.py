"""Colour ranges that hold still: round numbers, quick to widen, slow to narrow."""

import math

_PATIENCE = 2.0  # s that the values must stay small before the range narrows


def round_up(value: float) -> float:
    """The least of 1, 1.5, 2, 3, 5, 7 times a power of ten that is at least `value`."""
    if not value > 0:
        return 0.0
    power = 10.0 ** math.floor(math.log10(value))
    return next(m * power for m in (1, 1.5, 2, 3, 5, 7, 10) if m * power >= value * (1 - 1e-12))


class SteadyRange:
    """Follows the largest value shown; a locked range is whatever it was locked to."""

    def __init__(self, least: float) -> None:
        self._least = self.limit = least
        self._small_since = math.inf

    def follow(self, largest: float, now: float) -> float:
        """The limit to use for values up to `largest` at time `now` in s."""
        wanted = max(self._least, round_up(largest))
        if wanted >= self.limit:
            self.limit, self._small_since = wanted, math.inf
        elif self._small_since == math.inf:
            self._small_since = now
        elif now - self._small_since > _PATIENCE:
            self.limit, self._small_since = wanted, math.inf
        return self.limit
