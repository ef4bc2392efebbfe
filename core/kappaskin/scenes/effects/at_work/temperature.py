"""Temperature at work."""

from collections.abc import Callable

from kappaskin.frames import Array
from kappaskin.scenes.effects.effect import Running


def temperature(warmer: Callable[[float], float], gain: float, offsets: Array) -> Running:
    def read(curvature: Array, time: float) -> Array:
        T = warmer(time)
        return (1 + gain * T) * curvature + T * offsets

    return read
