"""Curvature noise, uniform and Gaussian, of a given root mean square."""

import math
from dataclasses import dataclass

import numpy as np

from kappaskin.effects.effect import Running
from kappaskin.errors import Refusal


def _check_rms(rms: float) -> None:
    if not (math.isfinite(rms) and rms >= 0):
        raise Refusal(f"expected a noise RMS of at least 0 1/m, got {rms}")


@dataclass(frozen=True)
class UniformNoise:
    """Noise even between -sqrt(3) rms and sqrt(3) rms, in 1/m (the paper's, section 4)."""

    rms: float

    def __post_init__(self) -> None:
        _check_rms(self.rms)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        limit = math.sqrt(3) * self.rms
        return lambda curvature, _: curvature + rng.uniform(-limit, limit, shape)


@dataclass(frozen=True)
class GaussianNoise:
    """Normal noise of standard deviation `rms`, in 1/m."""

    rms: float

    def __post_init__(self) -> None:
        _check_rms(self.rms)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> Running:
        return lambda curvature, _: curvature + rng.normal(0.0, self.rms, shape)
