"""Least squares that knows the skin's slopes: gages sense the curvature of the bent surface."""

import numpy as np

from kappaskin.estimation.estimator import Estimator
from kappaskin.estimation.fit import Fit
from kappaskin.estimation.least_squares import LeastSquares
from kappaskin.frames import Array, Mask
from kappaskin.sensing import NormalCurvature

_STEPS = 4  # at most; 2 or 3 do
_EXACT = 1e-6  # of the readings' RMS: a step that changes them by less is the last one
_ROUNDINGS = 100  # relative errors that a step may amount to by rounding alone, as in float32
_CLOSE = 1e-2  # of the readings' RMS: so small must the fourth step be
_CONTRACTS = 0.7  # a step longer than this share of the one before: it will not get there


class FiniteSlope(Estimator):
    """c <- c + M^+ (K - h(c)), from the least-squares shape on, at most four times.

    h(c) is `NormalCurvature`; M^+ is that of `LeastSquares`, factored once. Where the steps do not
    shrink, as when slopes are near one and noise is large, the answer is that of least squares and
    `Fit.converged` says no.
    """

    def _set_up(self) -> None:
        basis, layout = self.basis, self.layout
        self._sensed = NormalCurvature(basis, layout, self.dtype)
        self._linear = LeastSquares(basis, layout, self.sigma, self.rim_sd, self.dtype)

    # Steps that run away may overflow: what is infinitely steep reads nothing, and what is no
    # number does not converge.
    @np.errstate(over="ignore", invalid="ignore")
    def predicted(self, coefficients: Array) -> Array:
        """What the elements would read, (..., 3, P) in 1/m, of `coefficients` (..., Ni, Nj)."""
        return self._sensed(coefficients)

    @np.errstate(over="ignore", invalid="ignore")
    def _fit(self, flat: Array, used: Mask) -> Fit:
        K = flat.reshape(*flat.shape[:-1], 3, len(self.layout))
        first = self._linear(K)
        c, size = first.coefficients, _rms(np.where(used.reshape(3, -1), K, 0.0))
        exact = max(_EXACT, _ROUNDINGS * float(np.finfo(self.dtype).eps))
        last, steps = size, np.zeros(size.shape, int)
        going, diverged = size > 0, np.zeros(size.shape, bool)
        while going.any() and steps.max() < _STEPS:
            step = self._linear(K - self.predicted(c)).coefficients
            change = _rms(self._linear.predicted(step))
            diverged |= going & ~(change < _CONTRACTS * last)
            going &= ~diverged
            c = np.where(going[..., None, None], c + step, c)
            steps, last = steps + going, change
            going &= change > exact * size
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
