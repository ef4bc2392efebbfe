"""Computation of the failures of elements and of the link."""

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from kappaskin.frames import Array
from kappaskin.scenes.effects.at_work import RunningEffect


def stuck(channels: NDArray[np.intp], since: float) -> RunningEffect:
    held: Array | None = None

    def read(curvature: Array, time: float) -> Array:
        nonlocal held
        flat = curvature.flatten()
        if held is None and time >= since:
            held = flat[channels]
        if held is not None:
            flat[channels] = held
        return flat.reshape(curvature.shape)

    return read


def intermittent(
    channels: NDArray[np.intp], on: float, off: float, rng: np.random.Generator
) -> RunningEffect:
    there = rng.random(len(channels[0])) < on / (on + off)
    last = math.nan

    def read(curvature: Array, time: float) -> Array:
        nonlocal there, last
        # A first frame finds them as they are; after a clock went back no time is counted.
        elapsed, last = time - last, time
        if elapsed > 0:
            # Solved exactly: how likely each is to have changed, once or any odd number of times.
            changed = -math.expm1(-elapsed * (1 / on + 1 / off)) / (on + off)
            odds = np.where(there, off, on) * changed
            there = np.not_equal(there, rng.random(len(there)) < odds)
        flat = curvature.flatten()
        flat[channels[:, ~there]] = 0.0
        return flat.reshape(curvature.shape)

    return read


_AT_ONCE = 256  # frames


def hits(share: float, rng: np.random.Generator) -> Callable[[int], bool]:
    key = int(rng.integers(2**63))

    # Numbered draws: a frame's own, whichever were asked for before.
    @lru_cache(1)
    def part(number: int) -> list[bool]:
        draws = np.random.Generator(np.random.Philox(counter=number * _AT_ONCE, key=key))
        return [each < share for each in draws.random(_AT_ONCE).tolist()]

    return lambda n: part(n // _AT_ONCE)[n % _AT_ONCE]
