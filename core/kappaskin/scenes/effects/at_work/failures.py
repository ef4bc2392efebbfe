"""Stuck and intermittent elements at work."""

import math

import numpy as np
from numpy.typing import NDArray

from kappaskin.frames import Array
from kappaskin.scenes.effects.effect import Running


def stuck(channels: NDArray[np.intp], since: float) -> Running:
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
) -> Running:
    there = rng.random(len(channels[0])) < on / (on + off)
    last = math.nan

    def read(curvature: Array, time: float) -> Array:
        nonlocal there, last
        # A first frame finds them as they are; a clock that went back tells of no time.
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
