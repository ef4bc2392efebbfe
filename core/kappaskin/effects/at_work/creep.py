"""Creep at work."""

from kappaskin.effects.effect import Running
from kappaskin.hysteresis import StandardLinearSolid


def creep(solid: StandardLinearSolid, shape: tuple[int, ...]) -> Running:
    relaxing = solid.start()
    return lambda curvature, time: relaxing(curvature.ravel(), time).reshape(shape)
