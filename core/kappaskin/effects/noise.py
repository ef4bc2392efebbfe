"""Curvature noise, uniform and Gaussian, of a given root mean square."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array


class Effect(Protocol):
    """One thing that spoils a reading."""

    def apply(self, curvature: Array, rng: np.random.Generator) -> Array:
        """Curvature in 1/m, any shape, as it is read."""
        ...


def _check_rms(rms: float) -> None:
    if not (math.isfinite(rms) and rms >= 0):
        raise Refusal(f"expected a noise RMS of at least 0 1/m, got {rms}")


@dataclass(frozen=True)
class UniformNoise:
    """Noise even between -sqrt(3) rms and sqrt(3) rms, in 1/m (the paper's, section 4)."""

    rms: float

    def __post_init__(self) -> None:
        _check_rms(self.rms)

    def apply(self, curvature: Array, rng: np.random.Generator) -> Array:
        limit = math.sqrt(3) * self.rms
        return curvature + rng.uniform(-limit, limit, curvature.shape)


@dataclass(frozen=True)
class GaussianNoise:
    """Normal noise of standard deviation `rms`, in 1/m."""

    rms: float

    def __post_init__(self) -> None:
        _check_rms(self.rms)

    def apply(self, curvature: Array, rng: np.random.Generator) -> Array:
        return curvature + rng.normal(0.0, self.rms, curvature.shape)
