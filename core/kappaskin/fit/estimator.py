"""What every estimator takes and answers: curvature to coefficients, error bars, what is left."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from kappaskin.bases import Basis
from kappaskin.bases.basis import curvature_at
from kappaskin.errors import RankDeficient, Refusal
from kappaskin.frames import Array, Mask
from kappaskin.layout import SensorLayout

RIM_SD = 0.2e-3
"""How far in m a rim that gives is expected to move, unless said otherwise."""

_MOST = 10_000  # coefficients: their covariance takes 800 MB


class Spread(Protocol):
    """How far the N coefficients of a frame may be off, for unit noise."""

    @property
    def sd(self) -> Array:
        """Standard deviations (N,) of the coefficients in m for noise of 1 1/m."""
        ...

    def of(self, rows: Array) -> Array:
        """Covariance (..., R, R) of `rows` (..., R, N) times the coefficients."""
        ...

    def sd_of(self, rows: Array) -> Array:
        """Standard deviations (R,) of `rows` (R, N) times the coefficients."""
        ...


class DenseSpread:
    """The spread that a covariance (N, N) tells; it is made when first asked for."""

    def __init__(self, make: Callable[[], Array]) -> None:
        self._make = make

    @cached_property
    def covariance(self) -> Array:
        return self._make()

    @property
    def sd(self) -> Array:
        return _root(np.diag(self.covariance))

    def of(self, rows: Array) -> Array:
        return rows @ self.covariance @ rows.swapaxes(-1, -2)

    def sd_of(self, rows: Array) -> Array:
        return _root(np.vecdot(rows @ self.covariance, rows))


def _root(variance: Array) -> Array:
    """Standard deviations; NaN where rounding has left no variance."""
    return np.sqrt(np.where(variance >= 0, variance, np.nan))


@dataclass(frozen=True, eq=False)
class Fit:
    """The shape that answers the readings best, of one frame or of T (leading axis).

    `curvature` (..., 3, P) in 1/m is what it rests on, NaN where a reading is missing or was not
    trusted; `coefficients` (..., Ni, Nj) in m; `spreads` says how far they may be off for unit
    noise, of each frame when there are several; `spare` (...) how many readings there are beyond
    those that the shape took. `told_noise` (...) is the noise in 1/m where the estimator knows it.
    An iteration took `steps` (...); where it has not `converged` (...), the answer is that of
    least squares. `suspect` (..., P) says which elements were left out and why, by their number in
    `WHY`; None where none is ever suspected.
    """

    estimator: "Estimator"
    curvature: Array
    coefficients: Array
    spreads: "Spread | Sequence[Spread]"
    spare: ArrayLike
    told_noise: Array | None = None
    steps: ArrayLike = 0
    converged: ArrayLike = True
    suspect: "NDArray[np.uint8] | None" = None

    @cached_property
    def residual(self) -> Array:
        """What the shape leaves of the readings, (..., 3, P) in 1/m; NaN where it rests on none."""
        return self.curvature - self.estimator.predicted(self.coefficients)

    @cached_property
    def noise(self) -> Array:
        """Standard deviation (...) of a reading in 1/m; 1 where the fit was told each one's sigma.

        It is as the residual tells it, NaN when every reading was spent on a coefficient, or as
        the estimator knows it.
        """
        if self.told_noise is not None:
            return self.told_noise
        left = self.residual.reshape(*self.residual.shape[:-2], 3 * len(self.estimator.layout))
        squares = np.vecdot(left, left)
        if np.count_nonzero(squares != squares):  # NaN, told in a tenth of the time of any()
            left = np.where(np.isnan(left), 0.0, left)
            squares = np.vecdot(left, left)
        spare = np.array(self.spare, float)
        spare[spare <= 0] = np.nan
        return np.sqrt(squares / spare)

    def _each(self, told: Callable[[Spread], Array], shape: tuple[int, ...]) -> Array:
        """What is `told` of the spread, of this `shape`, for each frame when there are several."""
        if not isinstance(self.spreads, Sequence):
            return told(self.spreads).reshape(shape)
        once = {id(spread): spread for spread in self.spreads}
        known = {number: told(spread) for number, spread in once.items()}
        frames = [known[id(spread)] for spread in self.spreads]
        return np.reshape(frames, (len(frames), *shape))

    @cached_property
    def unit_sd(self) -> Array:
        """Standard deviations (..., Ni, Nj) of the coefficients for unit noise."""
        return self._each(lambda spread: spread.sd, self.estimator.basis.shape)

    @property
    def sd(self) -> Array:
        """Standard deviations (..., Ni, Nj) of the coefficients in m."""
        seen = self.noise[..., None, None] * self.unit_sd
        undecided = np.linalg.norm(self.estimator.undecided, axis=1)
        return np.hypot(seen, undecided.reshape(self.estimator.basis.shape))

    @property
    def covariance(self) -> Array:
        """Covariance (..., Ni Nj, Ni Nj) of the flattened coefficients in m^2; made on demand."""
        if (N := self.estimator.basis.size) > _MOST:
            raise Refusal(
                f"expected at most {_MOST} coefficients whose covariance is made, got {N} x {N} "
                "numbers; ask for the covariance_of what is wanted"
            )
        return self.covariance_of(np.eye(N))

    def covariance_of(self, rows: Array) -> Array:
        """Covariance (..., R, R) of `rows` (..., R, N) times the flattened coefficients.

        With several frames `rows` are those of all of them, (R, N).
        """
        unit = self._each(lambda spread: spread.of(rows), (*rows.shape[:-1], rows.shape[-2]))
        undecided = rows @ self.estimator.undecided
        noise = np.expand_dims(self.noise, tuple(range(self.noise.ndim, unit.ndim)))
        return noise**2 * unit + undecided @ undecided.swapaxes(-1, -2)

    def sd_of(self, rows: Array) -> Array:
        """Standard deviations (..., R) of `rows` (R, N) times the flattened coefficients."""
        seen = self.noise[..., None] * self._each(lambda spread: spread.sd_of(rows), (len(rows),))
        return np.hypot(seen, np.linalg.norm(rows @ self.estimator.undecided, axis=-1))

    def surface_sd(self, positions: Array) -> Array:
        """Standard deviations (..., P) of the displacement in m at `positions` (P, 2)."""
        return self.sd_of(self.estimator.basis.at(positions))


_UNSEEN = 1e-15  # of the longest column: a function whose curvature cancels, as on half a circle


def column_lengths(A: Array) -> Array:
    """Lengths (F,) of the columns of A (R, F); infinite where nothing but rounding is left."""
    length = np.linalg.norm(A, axis=0)
    length[length <= _UNSEEN * length.max(initial=0.0)] = np.inf
    return length


class Estimator(ABC):
    """`fit = LeastSquares(basis, layout)`, factored once; `fit(curvature)` is a `Fit`.

    `sigma`, a scalar or (3, P) in 1/m, is the standard deviation of each reading; without it all
    readings weigh the same and their noise is estimated. An infinite sigma leaves a reading out.
    `rim_sd` in m is how far a rim that gives is expected to move: the standard deviation of each
    shape that no reading sees, by RMS along the rim. A frame is computed in `dtype`, which is
    float64 or float32; the factorisation always in float64.
    """

    has_matrix: ClassVar = True
    """Whether M is made, 3 P x Ni Nj numbers."""
    has_prior: ClassVar = False
    """Whether what the readings do not decide is left to a prior, so that no basis is too large."""
    remembers: ClassVar = False
    """Whether frames depend on earlier ones: each is to be followed once, in order."""

    def __init__(
        self,
        basis: Basis,
        layout: SensorLayout,
        sigma: ArrayLike | None = None,
        rim_sd: float = RIM_SD,
        dtype: DTypeLike = np.float64,
    ) -> None:
        if not 0 <= rim_sd < np.inf:
            raise Refusal(f"expected a rim_sd of at least zero in m, got {rim_sd}")
        if np.dtype(dtype).name not in ("float64", "float32"):
            raise Refusal(f"expected float64 or float32 to compute in, got {np.dtype(dtype)}")
        self.basis, self.layout = basis, layout
        # Typed as float64: what holds for one holds for the other.
        self.dtype = cast("np.dtype[np.float64]", np.dtype(dtype))
        unseen = np.empty((basis.size, 0)) if basis.unseen is None else basis.unseen
        self.undecided = rim_sd * unseen
        """Shapes (N, q) in m that no reading sees, each as far as it is expected to go."""
        self.told_sigma = sigma is not None
        self.weight = self._weights(1.0 if sigma is None else sigma)
        """What each reading (3 P,) is worth, 1 / sigma in m; 1 for all without a sigma."""
        self.readable: Mask = layout.live.ravel() & (self.weight > 0)
        """Which readings (3 P,) are used when they are there."""
        self._all_readable = bool(self.readable.all())
        self.unknowns = basis.size if basis.free is None else basis.free.shape[1]
        """How many numbers there are to tell: the coefficients less what the edges decide."""

    def _weights(self, sigma: ArrayLike) -> Array:
        sigma = np.asarray(sigma, float)
        if sigma.shape not in ((), (3, len(self.layout))):
            raise Refusal(
                f"expected sigma to be one number or (3, {len(self.layout)}), got {sigma.shape}"
            )
        if not np.all(sigma > 0):
            raise Refusal("expected every sigma above zero in 1/m, got zero, less or NaN")
        return np.broadcast_to(1 / sigma, (3, len(self.layout))).reshape(-1)

    @cached_property
    def M(self) -> Array:
        """The curvature operator (3 P, Ni Nj) (Eq. 2)."""
        return self.layout.curvature_operator(self.basis)

    @cached_property
    def _M_T(self) -> Array:
        return self.M.T.astype(self.dtype)

    def predicted(self, coefficients: Array) -> Array:
        """What the elements would read, (..., 3, P) in 1/m, of `coefficients` (..., Ni, Nj)."""
        frames = coefficients.shape[:-2]
        flat = coefficients.reshape(*frames, self.basis.size)
        return np.dot(flat, self._M_T).reshape(*frames, 3, len(self.layout))

    def __call__(self, curvature: ArrayLike) -> Fit:
        """Fit `curvature` (3, P) or (T, 3, P) in 1/m; NaN and infinity mean a missing reading."""
        K = np.array(curvature, self.dtype)  # ours: residuals are told from it later
        if K.ndim not in (2, 3) or K.shape[-2:] != (3, len(self.layout)):
            raise Refusal(
                f"expected curvature of shape (3, {len(self.layout)}) or (T, 3, "
                f"{len(self.layout)}), got {K.shape}"
            )
        flat = K.reshape(*K.shape[:-2], 3 * len(self.layout))
        if self._all_readable and _surely_finite(K.reshape(-1)):
            return self._fit(flat, self.readable)
        used = np.isfinite(flat) & self.readable
        flat[~used] = np.nan
        if np.all(used == self.readable):
            return self._fit(flat, self.readable)
        if K.ndim == 2:
            return self._fit(flat, used)
        patterns, which = np.unique(used, axis=0, return_inverse=True)
        which = which.ravel()
        fits: list[Fit] = []
        for number, pattern in enumerate(patterns):
            try:
                fits.append(self._fit(flat[which == number], pattern))
            except RankDeficient as error:
                first = int(np.argmax(which == number))
                # An estimator inside this one counts the frames that it was given.
                inner = error.__cause__
                why = inner if isinstance(inner, RankDeficient) else error
                raise RankDeficient(f"frame {first}: {why}") from why
        return gathered(fits, np.argsort(np.argsort(which, kind="stable")))

    def follow(self, curvature: Array, times: Array, held: Array) -> Fit:
        """Fit the next frame: `curvature` (3, P) in 1/m read at `times` (3, P) in s.

        Both are NaN where nothing was read; `held` (3, P) has what is known of earlier frames too.
        What remembers nothing itself fits that.
        """
        return self(held)

    def at_rest(self) -> Fit:
        """The fit to a skin at rest, of which every reading is there."""
        return self(np.zeros((3, len(self.layout))))

    @abstractmethod
    def _fit(self, flat: Array, used: Mask) -> Fit:
        """Fit readings (3 P,) or (T, 3 P) of which those `used` (3 P,) are there, the rest NaN."""

    def _moves_as_a_whole(self) -> bool:
        """Whether the basis has a function that changes no curvature anywhere; only arcs may."""
        patch, W = self.basis.patch, self.basis.free
        if not (patch.strip and patch.base_curvature):
            return False
        x, y = patch.cell_centres(2 * self.basis.size + 1, 1)
        bends = curvature_at(self.basis, np.column_stack([x, np.repeat(y, len(x))]))[0]
        return bool(np.isinf(column_lengths(bends if W is None else bends @ W)).any())

    def refusal(self, readings: int, rank: int) -> RankDeficient:
        """Why `readings` of them, which determine `rank` coefficients, do not decide a shape."""
        (Ni, Nj), N, layout = self.basis.shape, self.unknowns, self.layout
        bound = "at most " if readings < N else ""
        what = f"{layout} with {readings} readings determine {bound}{rank} of the {N} coefficients "
        what += f"of a {Ni} x {Nj} basis"
        if readings == 0:
            return RankDeficient(
                f"{what}: no readings are left; check the connection and the dead elements"
            )
        channels = len(layout) if layout.patch.strip else 3 * len(layout)
        missing = channels - readings
        if self._moves_as_a_whole():
            return RankDeficient(
                f"{what}: a function moves the skin as a whole and bends it nowhere; hold the "
                "edges so that it cannot (pin the ends of the arc)"
            )
        if layout.shape and not missing:
            m, n = layout.shape
            # Along each direction, mode m + q looks like m - q at the cell centres.
            return RankDeficient(
                f"{what}: functions beyond the elements look like lower ones; "
                f"use at most {min(Ni, m)} x {min(Nj, n)} functions, or more elements, or a prior "
                "(bayes)"
            )
        why = (
            f"{missing} of {channels} readings are missing"
            if missing
            else ("the elements do not tell these functions apart")
        )
        return RankDeficient(
            f"{what}: {why}; use a smaller basis (at most {rank} functions), more elements, or a "
            "prior (bayes)"
        )


def _surely_finite(a: Array) -> bool:
    """Whether the sum of squares of `a` is finite: told fastest, and false for huge numbers too."""
    with np.errstate(over="ignore"):
        return math.isfinite(a.dot(a))


def gathered(fits: Sequence[Fit], order: NDArray[np.intp]) -> Fit:
    """One fit of T frames from the fits of groups of them."""

    def joined(parts: list[Array]) -> Array:
        return np.concatenate(parts)[order]

    def of_each(name: str) -> Array:
        return joined([np.broadcast_to(getattr(f, name), len(f.curvature)) for f in fits])

    spreads: list[Spread] = []
    for fit in fits:
        own = fit.spreads
        spreads.extend(own if isinstance(own, Sequence) else [own] * len(fit.curvature))
    told = [fit.told_noise for fit in fits if fit.told_noise is not None]
    suspect: list[NDArray[np.uint8]] = [fit.suspect for fit in fits if fit.suspect is not None]
    return Fit(
        fits[0].estimator,
        joined([fit.curvature for fit in fits]),
        joined([fit.coefficients for fit in fits]),
        [spreads[int(place)] for place in order],
        of_each("spare"),
        joined(told) if told else None,
        of_each("steps"),
        of_each("converged"),
        np.concatenate(suspect)[order] if suspect else None,
    )
