"""Gain and offset errors at work."""

from kappaskin.frames import Array
from kappaskin.scenes.effects.effect import Running


def tolerance(gain: Array, offset: Array) -> Running:
    return lambda curvature, _: gain * curvature + offset
