"""Hysteresis at work."""

from kappaskin.effects.effect import Running
from kappaskin.hysteresis import PrandtlIshlinskii


def hysteresis(loops: PrandtlIshlinskii, shape: tuple[int, ...]) -> Running:
    plays = loops.start()
    return lambda curvature, _: plays(curvature.ravel()).reshape(shape)
