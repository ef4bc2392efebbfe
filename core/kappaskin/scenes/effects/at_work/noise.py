"""Computation of noise."""

import math

import numpy as np

from kappaskin.frames import Array
from kappaskin.scenes.effects.effect import RunningEffect


def uniform(rms: float, rng: np.random.Generator) -> RunningEffect:
    limit = math.sqrt(3) * rms
    return lambda curvature, _: curvature + rng.uniform(-limit, limit, curvature.shape)


def gaussian(rms: float, rng: np.random.Generator) -> RunningEffect:
    return lambda curvature, _: curvature + rng.normal(0.0, rms, curvature.shape)


def flicker(
    rms: float, corners: tuple[float, ...], shape: tuple[int, ...], rng: np.random.Generator
) -> RunningEffect:
    # Each part is a first-order one: it keeps exp(-2 pi f_k t) of itself in the time t, and so much
    # is added at random that its power stays. The fastest moves with every frame, of the others
    # one at a time: the k-th with every 2^k-th frame, in which it moves no farther than the one
    # before does in half as many, since they are at least an octave apart.
    sd = rms / math.sqrt(len(corners))
    parts, drawn = rng.normal(0.0, sd, (len(corners), *shape)), np.empty(shape)
    moved, frames = [math.nan] * len(corners), 0

    def move(k: int, time: float) -> None:
        elapsed, moved[k] = time - moved[k], time
        # A first frame finds the parts as they are; after a clock went back no time is counted.
        if elapsed > 0:
            z = 2 * math.pi * corners[k] * elapsed
            rng.standard_normal(out=drawn)
            parts[k] *= math.exp(-z)
            parts[k] += np.multiply(drawn, sd * math.sqrt(-math.expm1(-2 * z)), out=drawn)

    def read(curvature: Array, time: float) -> Array:
        nonlocal frames
        frames += 1
        move(0, time)
        turn = (frames & -frames).bit_length()
        if turn < len(corners):
            move(turn, time)
        return curvature + np.add.reduce(parts)

    return read
