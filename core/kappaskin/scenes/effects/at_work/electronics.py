"""Computation of the effects in the electronics."""

import math

import numpy as np

from kappaskin.frames import Array
from kappaskin.scenes.effects.effect import RunningEffect
from kappaskin.sensing import Transduction


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


def quantisation(electronics: Transduction) -> RunningEffect:
    sensitivity, offset = electronics.sensitivity, electronics.offset
    step, resolution = electronics.converter.step, electronics.resolution
    # The volts as the converter computes them, or counts next to the middle of a step would differ.
    return lambda curvature, _: (
        np.rint((sensitivity * curvature + offset) / step) * resolution - offset / sensitivity
    )


def saturation(low: float, high: float) -> RunningEffect:
    return lambda curvature, _: np.minimum(np.maximum(curvature, low), high)
