"""Creep at work."""

from kappaskin.effects.creep import StandardLinearSolid
from kappaskin.effects.effect import Running


def creep(solid: StandardLinearSolid, shape: tuple[int, ...]) -> Running:
    relaxing = solid.start()
    return lambda curvature, time: relaxing(curvature.ravel(), time).reshape(shape)
