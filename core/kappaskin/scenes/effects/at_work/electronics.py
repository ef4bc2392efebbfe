"""Computation of the effects in the electronics, and of noise."""

import math

import numpy as np

from kappaskin.frames import Array
from kappaskin.scenes.effects.at_work import RunningEffect
from kappaskin.sensing import DigitalReadings, Transduction


def hum(amplitude: float, frequency: float, rng: np.random.Generator) -> RunningEffect:
    phase, speed = rng.uniform(0.0, 2 * math.pi), 2 * math.pi * frequency
    return lambda curvature, time: curvature + amplitude * math.sin(speed * time + phase)


_LEAST = 2.0**-53  # of a reading: what is kept of one so far back that it does not count


def cross_talk(share: float, shape: tuple[int, ...]) -> RunningEffect:
    # Unrolled, y_c = (1 - s) sum_n s^n x_(c-n): as many terms as a double can tell.
    terms = math.ceil(math.log(_LEAST) / math.log(share)) if share > _LEAST else 1
    weights = (1 - share) * share ** np.arange(terms)
    before = np.zeros(terms)

    def read(curvature: Array, _: float) -> Array:
        nonlocal before
        scanned = np.concatenate([before, curvature.ravel()])
        before = scanned[-terms:]
        return np.convolve(scanned[1:], weights, "valid").reshape(shape)

    return read


def quantisation(electronics: Transduction | DigitalReadings) -> RunningEffect:
    if isinstance(electronics, DigitalReadings):
        resolution = electronics.resolution
        return lambda readings, _: np.rint(readings / resolution) * resolution
    sensitivity, offset = electronics.sensitivity, electronics.offset
    step, resolution = electronics.converter.step, electronics.resolution
    # The volts as the converter computes them, or counts next to the middle of a step would differ.
    return lambda curvature, _: (
        np.rint((sensitivity * curvature + offset) / step) * resolution - offset / sensitivity
    )


def saturation(low: float, high: float) -> RunningEffect:
    return lambda curvature, _: np.minimum(np.maximum(curvature, low), high)


def uniform(rms: float, rng: np.random.Generator) -> RunningEffect:
    limit = math.sqrt(3) * rms
    return lambda curvature, _: curvature + rng.uniform(-limit, limit, curvature.shape)


def gaussian(rms: float | Array, rng: np.random.Generator) -> RunningEffect:
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
