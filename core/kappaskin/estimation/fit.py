"""Fits: the coefficients of one frame or several, with residual, noise and error bars."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kappaskin.errors import Refusal
from kappaskin.frames import Array

if TYPE_CHECKING:
    from kappaskin.estimation.estimator import Estimator

_FAINT = 2.0**120  # of the least normal number: below it squares, added up, lose digits
_MOST = 10_000  # coefficients: their covariance takes 800 MB


class Uncertainty(Protocol):
    """Uncertainty of the N coefficients of a frame, for unit noise."""

    @property
    def sd(self) -> Array:
        """Standard deviations (N,) of the coefficients in m, for a noise of 1 1/m."""
        ...

    def covariance_of(self, rows: Array) -> Array:
        """Covariance (..., R, R) of `rows` (..., R, N) times the coefficients."""
        ...

    def sd_of(self, rows: Array) -> Array:
        """Standard deviations (R,) of `rows` (R, N) times the coefficients."""
        ...


class DenseUncertainty:
    """Uncertainty with a full covariance (N, N), computed when first needed."""

    def __init__(self, make: Callable[[], Array]) -> None:
        self._make = make

    @cached_property
    def covariance(self) -> Array:
        return self._make()

    @property
    def sd(self) -> Array:
        return _root(np.diag(self.covariance))

    def covariance_of(self, rows: Array) -> Array:
        return propagated_covariance(rows, self.covariance)

    def sd_of(self, rows: Array) -> Array:
        return _root(np.vecdot(rows @ self.covariance, rows))


def propagated_covariance(rows: Array, covariance: Array) -> Array:
    """Covariance (..., R, R) of `rows` (..., R, N) times what has this `covariance` (..., N, N)."""
    if rows.ndim == 2:
        return rows.dot(covariance).dot(rows.T)  # of small ones in half the time
    return rows @ covariance @ rows.mT


def power_of_two(values: Array) -> Array:
    """The largest power of two (..., 1) in the largest of `values` (..., R); 1 of zeros.

    Divided by it, exactly but for what is 1e300 times smaller, values have squares to add up.
    """
    largest = np.max(np.abs(values), axis=-1, keepdims=True, initial=0.0)
    one = np.ones((), values.dtype)
    return np.ldexp(one, np.frexp(np.where(largest > 0, largest, one))[1] - 1)


def _root(variance: Array) -> Array:
    """Standard deviations; NaN where rounding has left no variance."""
    return np.sqrt(np.where(variance >= 0, variance, np.nan))


@dataclass(frozen=True, eq=False)
class Fit:
    """The shape that explains the readings best, of one frame or of T (leading axis).

    `curvature` (..., 3, P) in 1/m are the readings used, NaN where one is missing or excluded;
    `coefficients` (..., Ni, Nj) in m; `uncertainty` theirs for unit noise, of each frame when there
    are several; `spare` (...) the degrees of freedom left, readings less unknowns. `known_noise`
    (...) in 1/m is the noise where the estimator knows it. An iteration took `steps` (...); where
    it has not `converged` (...), the result is that of least squares. `suspect` (..., P) says which
    elements were excluded and why, as numbers in `FAULTS`; None where the estimator excludes none.
    """

    estimator: "Estimator"
    curvature: Array
    coefficients: Array
    uncertainty: "Uncertainty | Sequence[Uncertainty]"
    spare: ArrayLike
    known_noise: Array | None = None
    steps: ArrayLike = 0
    converged: ArrayLike = True
    suspect: "NDArray[np.uint8] | None" = None

    @cached_property
    def residual(self) -> Array:
        """Residual (..., 3, P) in 1/m, readings less those of the shape; NaN where none is used."""
        return self.curvature - self.estimator.predicted(self.coefficients)

    @cached_property
    def noise(self) -> Array:
        """Standard deviation (...) of a reading in 1/m; 1 where each one's sigma was given.

        Estimated from the residual, NaN without a degree of freedom, or as the estimator knows it.
        """
        if self.known_noise is not None:
            return self.known_noise
        left = self.residual.reshape(*self.residual.shape[:-2], 3 * len(self.estimator.layout))
        squares = np.vecdot(left, left)
        if np.count_nonzero(squares != squares):  # NaN, found in a tenth of the time of any()
            left = np.where(np.isnan(left), 0.0, left)
            squares = np.vecdot(left, left)
        unit: Array | None = None
        if np.count_nonzero(squares < _FAINT * np.finfo(squares.dtype).tiny):
            unit = power_of_two(left)
            left = left / unit
            squares = np.vecdot(left, left)
        if isinstance(self.spare, int) and self.spare > 0:  # as in most frames: the fastest
            noise = np.sqrt(squares / self.spare)
        else:
            noise = np.sqrt(squares / np.where(np.greater(self.spare, 0), self.spare, np.nan))
        return noise if unit is None else noise * unit[..., 0]

    def _each(self, quantity: Callable[[Uncertainty], Array], shape: tuple[int, ...]) -> Array:
        """`quantity(uncertainty)` in this `shape`, for each frame when there are several."""
        if not isinstance(self.uncertainty, Sequence):
            return quantity(self.uncertainty).reshape(shape)
        once = {id(one): one for one in self.uncertainty}
        known = {number: quantity(one) for number, one in once.items()}
        frames = [known[id(one)] for one in self.uncertainty]
        return np.reshape(frames, (len(frames), *shape))

    @cached_property
    def unit_sd(self) -> Array:
        """Standard deviations (..., Ni, Nj) of the coefficients for unit noise."""
        return self._each(lambda one: one.sd, self.estimator.basis.shape)

    @property
    def sd(self) -> Array:
        """Standard deviations (..., Ni, Nj) of the coefficients in m."""
        observed = self.noise[..., None, None] * self.unit_sd
        undecided = np.linalg.norm(self.estimator.undecided, axis=1)
        return np.hypot(observed, undecided.reshape(self.estimator.basis.shape))

    @property
    def covariance(self) -> Array:
        """Covariance (..., Ni Nj, Ni Nj) of the flattened coefficients in m^2."""
        if (N := self.estimator.basis.size) > _MOST:
            raise Refusal(
                f"expected at most {_MOST} coefficients for a covariance matrix, got {N} x {N} "
                "numbers; use covariance_of with the rows that are needed"
            )
        return self.covariance_of(np.eye(N))

    def covariance_of(self, rows: Array) -> Array:
        """Covariance (..., R, R) of `rows` (..., R, N) times the flattened coefficients.

        With several frames, `rows` (R, N) are the same for all of them.
        """
        noise, uncertainty = self.noise, self.uncertainty
        if isinstance(uncertainty, Sequence):
            unit = self._each(
                lambda one: one.covariance_of(rows), (*rows.shape[:-1], rows.shape[-2])
            )
            noise = noise.reshape(noise.shape + (1,) * (unit.ndim - noise.ndim))
        else:
            unit = uncertainty.covariance_of(rows)
        observed = noise**2 * unit
        if not self.estimator.undecided.size:
            return observed
        undecided = rows @ self.estimator.undecided
        return observed + undecided @ undecided.swapaxes(-1, -2)

    @cached_property
    def _jets(self) -> dict[tuple[float, float], tuple[Array, Array]]:
        return {}

    def jet(self, x: float, y: float) -> tuple[Array, Array]:
        """Derivatives (6,) of the shape of one frame at (x, y) in m, in the order of `ORDERS`.

        And their covariance (6, 6). Those of the last point are cached.
        """
        if (x, y) not in self._jets:
            rows = self.estimator.basis.jet(x, y)
            self._jets.clear()
            self._jets[x, y] = rows.dot(self.coefficients.ravel()), self.covariance_of(rows)
        return self._jets[x, y]

    def sd_of(self, rows: Array) -> Array:
        """Standard deviations (..., R) of `rows` (R, N) times the flattened coefficients."""
        observed = self.noise[..., None] * self._each(lambda one: one.sd_of(rows), (len(rows),))
        return np.hypot(observed, np.linalg.norm(rows @ self.estimator.undecided, axis=-1))

    def surface_sd(self, positions: Array) -> Array:
        """Standard deviations (..., P) of the displacement in m at `positions` (P, 2)."""
        return self.sd_of(self.estimator.basis.at(positions))

    @staticmethod
    def merged(fits: "Sequence[Fit]", order: NDArray[np.intp]) -> "Fit":
        """One fit of T frames from fits of groups of them: frame t is number `order[t]` of all."""

        def joined(parts: list[Array]) -> Array:
            return np.concatenate(parts)[order]

        def of_each(name: str) -> Array:
            return joined([np.broadcast_to(getattr(f, name), len(f.curvature)) for f in fits])

        uncertainties: list[Uncertainty] = []
        for fit in fits:
            own = fit.uncertainty
            uncertainties.extend(own if isinstance(own, Sequence) else [own] * len(fit.curvature))
        known_noises = [fit.known_noise for fit in fits if fit.known_noise is not None]
        suspect: list[NDArray[np.uint8]] = [fit.suspect for fit in fits if fit.suspect is not None]
        return Fit(
            fits[0].estimator,
            joined([fit.curvature for fit in fits]),
            joined([fit.coefficients for fit in fits]),
            [uncertainties[int(place)] for place in order],
            of_each("spare"),
            joined(known_noises) if known_noises else None,
            of_each("steps"),
            of_each("converged"),
            np.concatenate(suspect)[order] if suspect else None,
        )

    @staticmethod
    def stacked(fits: "Sequence[Fit]") -> "Fit":
        """One fit of T frames from T fits of one frame each."""

        def alone(fit: Fit) -> Fit:
            return replace(
                fit,
                curvature=fit.curvature[None],
                coefficients=fit.coefficients[None],
                uncertainty=[cast("Uncertainty", fit.uncertainty)],
                spare=np.reshape(fit.spare, (1,)),
                known_noise=None if fit.known_noise is None else np.reshape(fit.known_noise, (1,)),
                steps=np.reshape(fit.steps, (1,)),
                converged=np.reshape(fit.converged, (1,)),
                suspect=None if fit.suspect is None else fit.suspect[None],
            )

        return Fit.merged([alone(fit) for fit in fits], np.arange(len(fits)))
