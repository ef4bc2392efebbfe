"""Creep at work."""

from kappaskin.scenes.effects.effect import Running
from kappaskin.sensing import StandardLinearSolid


def creep(solid: StandardLinearSolid, shape: tuple[int, ...]) -> Running:
    relaxing = solid.start()
    return lambda curvature, time: relaxing(curvature.ravel(), time).reshape(shape)
