"""Hum at work."""

import math

import numpy as np

from kappaskin.scenes.effects.effect import Running


def hum(amplitude: float, frequency: float, rng: np.random.Generator) -> Running:
    phase, speed = rng.uniform(0.0, 2 * math.pi), 2 * math.pi * frequency
    return lambda curvature, time: curvature + amplitude * math.sin(speed * time + phase)
