import math
from dataclasses import dataclass

import numpy as np
from kappaskin.scenes.effects import ReadingEffect, Size


@dataclass(frozen=True)
class LagEffect(ReadingEffect):
    """Readings follow with a time constant in s, as behind a low-pass filter."""

    name = "lag"
    formula = "time constant times the fastest change, over the peak reading"
    example = {"time_constant": 0.05}

    time_constant: float

    def size(self, survey):
        number = survey.share(self.time_constant * survey.rates)
        return Size(number, number)

    def start(self, shape, rng):
        last, value = math.inf, np.zeros(shape)

        def read(curvature, time):
            nonlocal last, value
            passed, last = max(time - last, 0.0), time
            left = math.exp(-passed / self.time_constant) if value.any() else 0.0
            value = curvature + left * (value - curvature)
            return value.copy()

        return read
