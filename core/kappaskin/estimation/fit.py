"""Fits: the coefficients of one frame or several, with residual, noise and error bars."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, cast

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from kappaskin._lazy import Displayed
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.sensing import SensorLayout

if TYPE_CHECKING:
    from kappaskin.estimation.estimator import Estimator

_FAINT = 2.0**120  # of the least normal number: below it squares, added up, lose digits
_FAINTEST = _FAINT * float(np.finfo(float).tiny)
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


class RootUncertainty:
    """Uncertainty by a `half` (R, N) of the covariance half' half, computed when first needed."""

    def __init__(self, make: Callable[[], Array]) -> None:
        self._make = make

    @cached_property
    def half(self) -> Array:
        return self._make()

    @property
    def sd(self) -> Array:
        return np.linalg.norm(self.half, axis=0)

    def covariance_of(self, rows: Array) -> Array:
        half = rows @ self.half.T
        return half @ half.swapaxes(-1, -2)

    def sd_of(self, rows: Array) -> Array:
        return np.linalg.norm(rows @ self.half.T, axis=-1)


STEEP = 0.3
"""Slope from which on no linear method should neglect it."""


# A gage along x reads p_x / (1 + p^2)^(3/2) of a slope p = tan(t) that varies along x alone: the
# derivative of p / sqrt(1 + p^2) = sin(t). A linear method integrates that to the slope s = sin(t),
# too flat by 1 - s/p = 1 - sqrt(1 - s^2): 8 % at s = 0.4. A dent loses 0.4 to 1 times that of its
# height.
def slope_warning(slope: float, remedy: str = "use finite-slope") -> str:
    """Warning of a linear method about the largest `slope` of its shape; empty for 0."""
    if not slope:
        return ""
    share = 100 * (1 - math.sqrt(max(1 - slope**2, 0.0)))
    flat = f"{share:.0f}" if share >= 1 else f"{share:.1g}"
    return f"slopes reach {slope:.2g}: up to {flat} % too flat; {remedy}"


_ALARM = 1e-3
"""Probability of a warning of a right sigma by chance, of a fit of any number of frames."""
_OFF = 1.25  # times, or as a share of the given sigma, is too far off


# A shape that the functions cannot follow leaves residuals too, mostly near the contact and in all
# frames alike. So three sums of squares are taken, in units of sigma: of all readings; of the half
# of the elements farthest from the one that bends most; and of the differences between two frames.
# Misfit only adds to each, so the least is nearest to the noise: sigma is too small where even that
# is too much, and too large where one of them is too little, by the chi-squared limits of its
# degrees of freedom. Under a prior those are partly of what it keeps the shape from following, most
# of it near the contact: then sigma is too large only by the sum of all.
def sigma_ratio(
    scaled: Array, bend: Array, layout: SensorLayout, spare: Array, prior: bool = False
) -> float:
    """Noise over sigma by the residuals over sigma, `scaled` (T, R); 1 where sigma may be right.

    `bend` (T, P) in any unit says how far the skin is bent at each element of the `layout`; `spare`
    (T,) are the degrees of freedom, left by a `prior` or by least squares. NaN residuals do not
    count.
    """
    there, positions = np.isfinite(scaled), layout.positions
    share = np.maximum(spare, 0.0) / np.maximum(there.sum(axis=1), 1)
    squares, free = np.where(there, scaled, 0.0) ** 2, there * share[:, None]
    away = np.sum((positions - positions[np.argmax(bend, axis=1), None]) ** 2, axis=2)
    far = (away >= np.median(away, axis=1, keepdims=True))[:, layout.element]
    one, other = slice(0, len(scaled) // 2 * 2, 2), slice(1, None, 2)
    both = there[one] & there[other]
    differ = np.subtract(scaled[one], scaled[other], where=both, out=np.zeros(both.shape))
    sums = [
        (squares.sum(), free.sum()),
        (squares.sum(where=far), free.sum(where=far)),
        (np.sum(differ**2) / 2, np.minimum(free[one], free[other]).sum()),
    ]
    known = [(float(total), float(count)) for total, count in sums if count >= 1]
    if not known:
        return 1.0
    tail = _ALARM / (2 * len(sums))
    if min(total / _chi_squared(count, tail) for total, count in known) > _OFF**2:
        return math.sqrt(min(total / count for total, count in known))
    low = known[:1] if prior else known
    if min(total / _chi_squared(count, 1 - tail) for total, count in low) < 1 / _OFF**2:
        return math.sqrt(min(total / count for total, count in low))
    return 1.0


def _chi_squared(count: float, tail: float) -> float:
    """The value that chi-squared of `count` degrees of freedom exceeds with this probability."""
    return float(scipy.special.chdtri(count, tail))


def sigma_warning(ratio: float) -> str:
    """What to say of a `sigma_ratio`; nothing of 1."""
    if ratio == 1:
        return ""
    said = f"residuals are {ratio:.2g} times what the given sigma explains"
    if ratio < 1:
        return f"{said}: sigma is too large, and so are the error bars; check it"
    return (
        f"{said}: sigma is too small, or the functions cannot follow the shape; check sigma, "
        "or use more functions"
    )


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
class Fit(Displayed):
    """The shape that explains the readings best, of one frame or of T (leading axis).

    `readings` (..., 3, P) in 1/m are those used, NaN where one is missing or excluded;
    `coefficients` (..., Ni, Nj) in m; `uncertainty` theirs for unit noise, of each frame when there
    are several; `spare` (...) the degrees of freedom left, readings less unknowns. `known_noise`
    (...) in 1/m is the noise where the estimator knows it. An iteration took `steps` (...); where
    it has not `converged` (...), the result is that of least squares. `suspect` (..., P) says which
    elements were excluded and why, as numbers in `FAULTS`; None where the estimator excludes none.
    `weights` (T, 3 P) in m, or one number, are 1 / sigma of each frame, None where they are the
    estimator's.
    """

    estimator: "Estimator"
    readings: Array
    coefficients: Array
    uncertainty: "Uncertainty | Sequence[Uncertainty]"
    spare: ArrayLike
    known_noise: Array | None = None
    steps: ArrayLike = 0
    converged: ArrayLike = True
    suspect: "NDArray[np.uint8] | None" = None
    weights: Array | None = None

    @cached_property
    def residual(self) -> Array:
        """Residual (..., 3, P) in 1/m, readings less those of the shape; NaN where none is used."""
        return self.readings - self.estimator.predicted(self.coefficients)

    @cached_property
    def noise(self) -> Array:
        """Standard deviation (...) of a reading in 1/m; 1 where each one's sigma was given.

        Estimated from the residual, NaN without a degree of freedom, or as the estimator knows it.
        """
        if self.known_noise is not None:
            return self.known_noise
        left = self.estimator.flattened(self.residual)
        if left.ndim == 1 and left.dtype == np.float64 and isinstance(self.spare, int):
            square = left.dot(left)
            if self.spare > 0 and square >= _FAINTEST:  # as in most frames: the fastest
                return np.sqrt(square / self.spare)
        squares = np.vecdot(left, left)
        if np.count_nonzero(squares != squares):  # NaN, found in a tenth of the time of any()
            left = np.where(np.isnan(left), 0.0, left)
            squares = np.vecdot(left, left)
        unit: Array | None = None
        if np.count_nonzero(squares < _FAINT * np.finfo(squares.dtype).tiny):
            unit = power_of_two(left)
            left = left / unit
            squares = np.vecdot(left, left)
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

    @cached_property
    def neglected_slope(self) -> float:
        """The largest slope in a frame whose method should not neglect it, 0 without one.

        It should not from 0.3 on, nor where the square of the slope exceeds the relative error bar:
        the standard deviation of the displacement over the displacement, by RMS over the skin.
        Heights and slopes are what they are on any slope.
        """
        if not (self.estimator.linear and self.estimator.layout.senses_curvature):
            return 0.0
        c, axes = self.coefficients, (-2, -1)
        slope = np.array([self.estimator.slope(one) for one in c.reshape(-1, *c.shape[-2:])])
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # of no shape
            error = np.linalg.norm(self.sd, axis=axes) / np.linalg.norm(c, axis=axes)
            matters = (slope >= STEEP) | (slope**2 > error.ravel())
        return float(np.max(slope, initial=0.0, where=matters))

    @cached_property
    def sigma_ratio(self) -> float:
        """Noise over the sigma that was given, by the residuals; 1 where that may be right.

        And where none was given, or the estimator has a memory, whose residuals it decides itself.
        Of one frame, or of all of them together.
        """
        estimator, layout = self.estimator, self.estimator.layout
        given = estimator.sigma is not None or self.weights is not None
        if not given or estimator.has_memory or not self.readings.size:
            return 1.0
        weight = estimator.weight if self.weights is None else self.weights
        residual, read = (
            np.atleast_2d(estimator.flattened(each.astype(float))) * weight
            for each in (self.residual, self.readings)
        )
        squares = np.nan_to_num(read - residual) ** 2
        bend = [np.bincount(layout.element, each, len(layout)) for each in squares]
        spare = np.broadcast_to(np.asarray(self.spare, float), len(read))
        return sigma_ratio(residual, np.array(bend, float), layout, spare, estimator.has_prior)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the answer neglects, in words."""
        frames = np.size(self.converged)
        lost = frames - np.count_nonzero(self.converged)
        found = (slope_warning(self.neglected_slope), sigma_warning(self.sigma_ratio))
        if lost:
            where = f" in {lost} of {frames} frames" if frames > 1 else ""
            found += (self.estimator.failure.format(where),)
        return tuple(filter(None, found))

    def sd_of(self, rows: Array) -> Array:
        """Standard deviations (..., R) of `rows` (R, N) times the flattened coefficients."""
        observed = self.noise[..., None] * self._each(lambda one: one.sd_of(rows), (len(rows),))
        return np.hypot(observed, np.linalg.norm(rows @ self.estimator.undecided, axis=-1))

    def surface_sd(self, positions: Array) -> Array:
        """Standard deviations (..., P) of the displacement in m at `positions` (P, 2)."""
        return self.sd_of(self.estimator.basis.at(positions))

    def alone(self) -> "Iterator[Fit]":
        """Each of T frames as a fit of its own."""
        each = cast("Sequence[Uncertainty]", self.uncertainty)
        for t, uncertainty in enumerate(each):
            yield replace(
                self,
                readings=self.readings[t],
                coefficients=self.coefficients[t],
                uncertainty=uncertainty,
                known_noise=None if self.known_noise is None else self.known_noise[t],
            )

    @staticmethod
    def merged(fits: "Sequence[Fit]", order: NDArray[np.intp]) -> "Fit":
        """One fit of T frames from fits of groups of them: frame t is number `order[t]` of all."""

        def joined(parts: list[Array]) -> Array:
            return np.concatenate(parts)[order]

        def of_each(name: str) -> Array:
            return joined([np.broadcast_to(getattr(f, name), len(f.readings)) for f in fits])

        uncertainties: list[Uncertainty] = []
        for fit in fits:
            own = fit.uncertainty
            uncertainties.extend(own if isinstance(own, Sequence) else [own] * len(fit.readings))
        one = all(fit.estimator is fits[0].estimator for fit in fits)
        weights = [np.tile(fit.estimator.weight, (len(fit.readings), 1)) for fit in fits]
        known_noises = [fit.known_noise for fit in fits if fit.known_noise is not None]
        suspect: list[NDArray[np.uint8]] = [fit.suspect for fit in fits if fit.suspect is not None]
        return Fit(
            fits[0].estimator,
            joined([fit.readings for fit in fits]),
            joined([fit.coefficients for fit in fits]),
            [uncertainties[int(place)] for place in order],
            of_each("spare"),
            joined(known_noises) if known_noises else None,
            of_each("steps"),
            of_each("converged"),
            np.concatenate(suspect)[order] if suspect else None,
            None if one else joined(weights),
        )

    @staticmethod
    def stacked(fits: "Sequence[Fit]") -> "Fit":
        """One fit of T frames from T fits of one frame each."""

        def alone(fit: Fit) -> Fit:
            return replace(
                fit,
                readings=fit.readings[None],
                coefficients=fit.coefficients[None],
                uncertainty=[cast("Uncertainty", fit.uncertainty)],
                spare=np.reshape(fit.spare, (1,)),
                known_noise=None if fit.known_noise is None else np.reshape(fit.known_noise, (1,)),
                steps=np.reshape(fit.steps, (1,)),
                converged=np.reshape(fit.converged, (1,)),
                suspect=None if fit.suspect is None else fit.suspect[None],
            )

        return Fit.merged([alone(fit) for fit in fits], np.arange(len(fits)))
