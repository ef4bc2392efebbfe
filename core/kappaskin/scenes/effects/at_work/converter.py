"""The converter's steps and rails at work."""

import numpy as np

from kappaskin.scenes.effects.effect import Running
from kappaskin.sensing import Transduction


def quantisation(electronics: Transduction) -> Running:
    sensitivity, offset = electronics.sensitivity, electronics.offset
    step, resolution = electronics.converter.step, electronics.resolution
    # The volts as the converter computes them, or counts next to the middle of a step would differ.
    return lambda curvature, _: (
        np.rint((sensitivity * curvature + offset) / step) * resolution - offset / sensitivity
    )


def saturation(low: float, high: float) -> Running:
    return lambda curvature, _: np.minimum(np.maximum(curvature, low), high)
