"""Least squares that knows the skin's slopes: gages sense the curvature of the bent surface."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from kappaskin.bases import Basis
from kappaskin.errors import Refusal
from kappaskin.fit.estimator import RIM_SD, Estimator, Fit
from kappaskin.fit.least_squares import LeastSquares
from kappaskin.frames import Array, Mask
from kappaskin.layout import SensorLayout

_STEPS = 4  # at most; 2 or 3 do
_EXACT = 1e-6  # of the readings' RMS: a step that changes them by less is the last one
_CLOSE = 1e-2  # of the readings' RMS: so small must the fourth step be
_CONTRACTS = 0.7  # a step longer than this share of the one before: it will not get there


class FiniteSlope(Estimator):
    """c <- c + M^+ (K - h(c)), from the least-squares shape on, at most four times.

    h(c) is the true normal curvature of the deflected surface along the gages; with
    W^2 = 1 + f_x^2 + f_y^2 it is xx: f_xx / (W (1 + f_x^2)), yy: f_yy / (W (1 + f_y^2)),
    xy: f_xy / (W sqrt((1 + f_x^2) (1 + f_y^2))), of which Eqs. 3-5 are the first order. M^+ is
    that of `LeastSquares`, factored once. Where the steps do not shrink, as when slopes are near
    one and noise is large, the answer is that of least squares and `Fit.converged` says no.
    """

    def __init__(
        self,
        basis: Basis,
        layout: SensorLayout,
        sigma: ArrayLike | None = None,
        rim_sd: float = RIM_SD,
        dtype: DTypeLike = np.float64,
    ) -> None:
        if basis.patch.base_curvature:
            raise Refusal(
                f"expected a flat skin for finite slopes, got a {basis.patch.name}: on a bent one "
                "the tangential displacement matters as much as the slope; use least-squares"
            )
        super().__init__(basis, layout, sigma, rim_sd, dtype)
        self._linear = LeastSquares(basis, layout, sigma, rim_sd, dtype)
        self.complete = self._linear.complete
        """The spread of a frame that has every reading."""

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        """Slopes along x and y (N, P) of each function at the elements."""
        at, P = self.basis.at, self.layout.positions
        return at(P, 1, 0).T.astype(self.dtype), at(P, 0, 1).T.astype(self.dtype)

    def predicted(self, coefficients: Array) -> Array:
        """What the elements would read, (..., 3, P) in 1/m, of `coefficients` (..., Ni, Nj)."""
        flat = coefficients.reshape(*coefficients.shape[:-2], self.basis.size)
        along_x, along_y = (1 + np.dot(flat, S) ** 2 for S in self._slopes)
        W2 = along_x + along_y - 1
        inclined = np.stack([along_x**2, along_y**2, along_x * along_y], axis=-2)
        return self._linear.predicted(coefficients) / np.sqrt(W2[..., None, :] * inclined)

    def _fit(self, flat: Array, used: Mask) -> Fit:
        K = flat.reshape(*flat.shape[:-1], 3, len(self.layout))
        first = self._linear(K)
        c, size = first.coefficients, _rms(np.where(used.reshape(3, -1), K, 0.0))
        last, steps = size, np.zeros(size.shape, int)
        going, diverged = size > 0, np.zeros(size.shape, bool)
        while going.any() and steps.max() < _STEPS:
            step = self._linear(K - self.predicted(c)).coefficients
            change = _rms(self._linear.predicted(step))
            diverged |= going & ~(change < _CONTRACTS * last)
            going &= ~diverged
            c = np.where(going[..., None, None], c + step, c)
            steps, last = steps + going, change
            going &= change > _EXACT * size
        diverged |= going & (last > _CLOSE * size)
        return Fit(
            self,
            first.curvature,
            np.where(diverged[..., None, None], first.coefficients, c),
            first.spreads,
            first.spare,
            first.told_noise,
            steps,
            ~diverged,
        )


def _rms(K: Array) -> Array:
    """Root mean square (...) of readings (..., 3, P)."""
    return np.sqrt(np.mean(K**2, axis=(-2, -1)))
