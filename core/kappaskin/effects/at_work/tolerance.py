"""Gain and offset errors at work."""

from kappaskin.effects.effect import Running
from kappaskin.frames import Array


def tolerance(gain: Array, offset: Array) -> Running:
    return lambda curvature, _: gain * curvature + offset
