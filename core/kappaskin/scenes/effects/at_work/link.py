"""Failures of the link at work."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

_AT_ONCE = 256  # frames


def hits(share: float, rng: np.random.Generator) -> Callable[[int], bool]:
    key = int(rng.integers(2**63))

    # Numbered draws: a frame's own, whichever were asked for before.
    @lru_cache(1)
    def part(number: int) -> list[bool]:
        draws = np.random.Generator(np.random.Philox(counter=number * _AT_ONCE, key=key))
        return [each < share for each in draws.random(_AT_ONCE).tolist()]

    return lambda n: part(n // _AT_ONCE)[n % _AT_ONCE]
