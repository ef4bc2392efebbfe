"""Hysteresis at work."""

from kappaskin.scenes.effects.effect import Running
from kappaskin.sensing import PrandtlIshlinskii


def hysteresis(loops: PrandtlIshlinskii, shape: tuple[int, ...]) -> Running:
    plays = loops.start()
    return lambda curvature, _: plays(curvature.ravel()).reshape(shape)
