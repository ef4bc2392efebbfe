"""Noise at work."""

import math

import numpy as np

from kappaskin.scenes.effects.effect import Running


def uniform(rms: float, rng: np.random.Generator) -> Running:
    limit = math.sqrt(3) * rms
    return lambda curvature, _: curvature + rng.uniform(-limit, limit, curvature.shape)


def gaussian(rms: float, rng: np.random.Generator) -> Running:
    return lambda curvature, _: curvature + rng.normal(0.0, rms, curvature.shape)
