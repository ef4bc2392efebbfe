"""Failures of the link at work."""

from collections.abc import Callable

import numpy as np


def hits(share: float, rng: np.random.Generator) -> Callable[[int], bool]:
    key = int(rng.integers(2**63))
    # Numbered draws: a frame's own, whichever were asked for before.
    return lambda n: np.random.Generator(np.random.Philox(counter=n, key=key)).random() < share
