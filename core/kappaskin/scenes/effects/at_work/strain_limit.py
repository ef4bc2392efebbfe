"""The strain limit at work."""

import numpy as np

from kappaskin.frames import Array
from kappaskin.scenes.effects.effect import Running


def strain_limit(limit: float, share: float, shape: tuple[int, ...]) -> Running:
    beyond = np.zeros(shape)

    def read(curvature: Array, _: float) -> Array:
        np.maximum(beyond, curvature - limit, out=beyond)
        np.minimum(beyond, curvature + limit, out=beyond)
        return curvature + share * beyond

    return read
