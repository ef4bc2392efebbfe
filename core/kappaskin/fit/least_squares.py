"""Least squares, factored once: curvature to the coefficients of the shape, with error bars."""

from collections import OrderedDict
from dataclasses import dataclass
from typing import ClassVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg

from kappaskin.bases import Basis
from kappaskin.errors import RankDeficient, Refusal
from kappaskin.frames import Array, Mask
from kappaskin.layout import SensorLayout

RIM_SD = 0.2e-3
"""How far in m a rim that gives is expected to move, unless said otherwise."""

_REMEMBERED = 8  # sets of missing readings whose operators are kept
_UNSEEN = 1e-15  # of the longest column: a function whose curvature cancels, as on half a circle
_REFACTOR = 1e-6  # below this share of a direction left, updating loses digits: factor anew


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """The shape that answers the readings best, of one frame or of T (leading axis).

    `coefficients` (..., Ni, Nj) in m, with their standard deviations `unit_sd` for unit noise;
    `residual` (..., 3, P) in 1/m, NaN where a reading is missing; `noise` (...) the standard
    deviation of a reading in 1/m as the residual tells it, NaN when every reading was spent on a
    coefficient, 1 when the fit was made with `sigma`. Where the rim gives, how far it may have
    moved is in every standard deviation but `unit_sd`.
    """

    arrays: ClassVar = ("coefficients", "unit_sd", "residual", "noise")

    estimator: "LeastSquares"
    coefficients: Array
    unit_sd: Array
    residual: Array
    noise: Array

    @property
    def sd(self) -> Array:
        """Standard deviations (..., Ni, Nj) of the coefficients in m."""
        seen = self.noise[..., None, None] * self.unit_sd
        undecided = np.linalg.norm(self.estimator.undecided, axis=1)
        return np.hypot(seen, undecided.reshape(self.estimator.basis.shape))

    @property
    def covariance(self) -> Array:
        """Covariance (..., Ni Nj, Ni Nj) of the flattened coefficients, in m^2; made on demand."""
        U = self.estimator.undecided
        return self.noise[..., None, None] ** 2 * self._unit_covariance() + U @ U.T

    def _unit_covariance(self) -> Array:
        """Covariance (..., Ni Nj, Ni Nj) of the flattened coefficients for unit noise."""
        missing = np.isnan(self.residual)
        units = [
            self.estimator.unit_covariance(gone)
            for gone in missing.reshape(-1, *missing.shape[-2:])
        ]
        N = self.estimator.basis.size
        return units[0] if self.noise.ndim == 0 else np.reshape(units, (*self.noise.shape, N, N))

    def sd_of(self, rows: Array) -> Array:
        """Standard deviations (..., R) of `rows` (R, N) times the flattened coefficients."""
        seen = np.vecdot(rows @ self._unit_covariance(), rows)
        undecided = np.sum((rows @ self.estimator.undecided) ** 2, axis=-1)
        return np.sqrt(self.noise[..., None] ** 2 * seen + undecided)

    def surface_sd(self, positions: Array) -> Array:
        """Standard deviations (..., P) of the displacement in m at `positions` (P, 2)."""
        return self.sd_of(self.estimator.basis.at(positions))


@dataclass(frozen=True, slots=True, eq=False)
class _Solver:
    """The operator (N, R) for R of the readings, `used` (3 P,), and its unit covariance."""

    used: Mask
    operator: Array
    covariance: Array
    sd: Array
    complete: bool


class LeastSquares:
    """`fit = LeastSquares(basis, layout)`; `fit(curvature)` is the least-squares shape (Eq. 6).

    The normal equations of Eq. 6 square the condition number, so they are never formed: the
    columns of M are scaled to unit length and factored, M = Q R by Householder reflections and
    R = U S V^T, once. Missing readings (NaN) are taken out by an update of that factorisation.

    `sigma`, a scalar or (3, P) in 1/m, is the standard deviation of each reading; without it all
    readings weigh the same and their noise is estimated from the residual. An infinite sigma
    leaves a reading out. Where the basis leaves only some combinations free, c = W g, only those
    are fitted. Raises `RankDeficient` when the readings do not decide the coefficients.

    `rim_sd` in m is how far a rim that gives is expected to move: the standard deviation of each
    shape that no reading sees, by RMS along the rim.
    """

    def __init__(
        self,
        basis: Basis,
        layout: SensorLayout,
        sigma: ArrayLike | None = None,
        rim_sd: float = RIM_SD,
    ) -> None:
        if not 0 <= rim_sd < np.inf:
            raise Refusal(f"expected a rim_sd of at least zero in m, got {rim_sd}")
        self.basis, self.layout = basis, layout
        unseen = np.empty((basis.size, 0)) if basis.unseen is None else basis.unseen
        self.undecided = rim_sd * unseen
        """Shapes (N, q) in m that no reading sees, each as far as it is expected to go."""
        self._sigma_known = sigma is not None
        self._weight = self._weights(1.0 if sigma is None else sigma)
        self.unknowns = basis.size if basis.free is None else basis.free.shape[1]
        """How many numbers are fitted: the coefficients less what the edges decide."""
        used = layout.live.ravel() & (self._weight > 0)
        if used.sum() < self.unknowns:  # before any memory is taken for it
            raise RankDeficient(self._refusal(int(used.sum()), int(used.sum())))
        self.M = layout.curvature_operator(basis)
        """The curvature operator (3 P, Ni Nj) (Eq. 2)."""
        self._factor(used)
        self._solver = self._made(used, self._root @ self._U.T, self._root @ self._root.T)
        self._reduced: OrderedDict[bytes, _Solver] = OrderedDict()

    def _weights(self, sigma: ArrayLike) -> Array:
        sigma = np.asarray(sigma, float)
        if sigma.shape not in ((), (3, len(self.layout))):
            raise Refusal(
                f"expected sigma to be one number or (3, {len(self.layout)}), got {sigma.shape}"
            )
        if not np.all(sigma > 0):
            raise Refusal("expected every sigma above zero in 1/m, got zero, less or NaN")
        return np.broadcast_to(1 / sigma, (3, len(self.layout))).ravel()

    def _factor(self, used: Mask) -> None:
        """U (R, F) orthonormal and root (N, F) with operator = root U^T, for the readings used."""
        W = self.basis.free
        A = self._weight[used, None] * (self.M[used] if W is None else self.M[used] @ W)
        length = np.linalg.norm(A, axis=0)
        length[length <= _UNSEEN * length.max(initial=0.0)] = np.inf  # what is left is rounding
        Q, R = cast("tuple[Array, Array]", linalg.qr(A / length, mode="economic"))
        U, s, Vt = linalg.svd(R)
        rank = int(np.sum(s > s[0] * max(A.shape) * np.finfo(float).eps))
        if rank < self.unknowns:
            raise RankDeficient(self._refusal(len(A), rank))
        self._U = Q @ U
        root = (Vt.T / s) / length[:, None]
        self._root = root if W is None else W @ root
        self.condition = float(s[0] / s[-1])
        """Condition number of M with its columns scaled to unit length."""

    def _refusal(self, readings: int, rank: int) -> str:
        (Ni, Nj), N, layout = self.basis.shape, self.unknowns, self.layout
        bound = "at most " if readings < N else ""
        what = f"{layout} with {readings} readings determine {bound}{rank} of the {N} coefficients "
        what += f"of a {Ni} x {Nj} basis"
        if readings == 0:
            return f"{what}: no readings are left; check the connection and the dead elements"
        missing = 3 * len(layout) - readings
        if layout.shape and not missing:
            m, n = layout.shape
            # Along each direction, mode m + q looks like m - q at the cell centres.
            return (
                f"{what}: functions beyond the elements look like lower ones; "
                f"use at most {min(Ni, m)} x {min(Nj, n)} functions, or more elements"
            )
        why = (
            f"{missing} of {3 * len(layout)} readings are missing"
            if missing
            else ("the elements do not tell these functions apart")
        )
        return f"{what}: {why}; use a smaller basis (at most {rank} functions), or more elements"

    def _made(self, used: Mask, operator: Array, covariance: Array) -> _Solver:
        sd = np.sqrt(np.diag(covariance)).reshape(self.basis.shape)
        return _Solver(used, operator, covariance, sd, complete=bool(used.all()))

    def unit_covariance(self, missing: Mask | None = None) -> Array:
        """Covariance (N, N) for unit noise, without the readings `missing` (3, P)."""
        if missing is None:
            return self._solver.covariance
        return self._without(missing.ravel()).covariance

    def _without(self, missing: Mask) -> _Solver:
        """The solver without the readings `missing` (3 P,), remembered for the next frames."""
        if not missing[self._solver.used].any():
            return self._solver
        key = missing.tobytes()
        if key not in self._reduced:
            self._reduced[key] = self._downdate(missing)
            if len(self._reduced) > _REMEMBERED:
                self._reduced.popitem(last=False)
        return self._reduced[key]

    def _downdate(self, missing: Mask) -> _Solver:
        # With the rows U_k of U taken out, U_r^T U_r = I - U_k^T U_k, whose inverse is
        # I + U_k^T G^-1 U_k with the small G = I - U_k U_k^T. An eigenvalue of G is the share of
        # a direction that the readings left still see.
        was, root = self._solver.used, self._root
        gone = missing[was]
        U_k, U_r = self._U[gone], self._U[~gone]
        G = np.eye(len(U_k)) - U_k @ U_k.T
        if len(U_r) < self.unknowns or np.linalg.eigvalsh(G)[0] < _REFACTOR:
            weight = np.where(missing, 0.0, self._weight)
            sigma = np.divide(1.0, weight, where=weight > 0, out=np.full(len(weight), np.inf))
            fresh = LeastSquares(self.basis, self.layout, sigma.reshape(3, -1))
            return fresh._solver
        inverse = np.eye(self.unknowns) + U_k.T @ np.linalg.solve(G, U_k)
        operator, covariance = root @ inverse @ U_r.T, root @ inverse @ root.T
        return self._made(was & ~missing, operator, covariance)

    def __call__(self, curvature: ArrayLike) -> Fit:
        """Fit `curvature` (3, P) or (T, 3, P) in 1/m; NaN and infinity mean a missing reading."""
        K = np.asarray(curvature, float)
        if K.ndim not in (2, 3) or K.shape[-2:] != (3, len(self.layout)):
            raise Refusal(
                f"expected curvature of shape (3, {len(self.layout)}) or (T, 3, "
                f"{len(self.layout)}), got {K.shape}"
            )
        flat = K.reshape(*K.shape[:-2], 3 * len(self.layout))
        finite = np.isfinite(flat)
        if finite.all():
            return self._solve(self._solver, flat)
        missing = ~finite
        if K.ndim == 2:
            return self._solve(self._without(missing), flat)
        patterns, which = np.unique(missing, axis=0, return_inverse=True)
        which = which.ravel()
        fits: list[Fit] = []
        for number, pattern in enumerate(patterns):
            try:
                solver = self._without(pattern)
            except RankDeficient as error:
                first = int(np.argmax(which == number))
                raise RankDeficient(f"frame {first}: {error}") from error
            fits.append(self._solve(solver, flat[which == number]))
        return self._gather(fits, np.argsort(np.argsort(which, kind="stable")))

    def _gather(self, fits: list[Fit], order: NDArray[np.intp]) -> Fit:
        """One fit of T frames from the fits of their groups."""

        def joined(name: str) -> Array:
            return np.concatenate([getattr(fit, name) for fit in fits])[order]

        return Fit(self, *(joined(name) for name in Fit.arrays))

    def _solve(self, solver: _Solver, flat: Array) -> Fit:
        """Fit readings (..., 3 P) that share one set of missing ones."""
        used, shape = solver.used, self.basis.shape
        kept = flat if solver.complete else flat[..., used]
        weighted = kept
        if self._sigma_known:
            weighted = kept * (self._weight if solver.complete else self._weight[used])
        c = np.dot(weighted, solver.operator.T)
        residual = flat - np.dot(c, self.M.T)
        if not solver.complete:
            residual[..., ~used] = np.nan
        noise = self._noise(residual if solver.complete else residual[..., used])
        return Fit(
            self,
            c.reshape(*c.shape[:-1], *shape),
            np.broadcast_to(solver.sd, (*c.shape[:-1], *shape)) if c.ndim > 1 else solver.sd,
            residual.reshape(*flat.shape[:-1], 3, len(self.layout)),
            noise,
        )

    def _noise(self, left: Array) -> Array:
        """Standard deviation (...) of a reading, from the residuals (..., R) of those used."""
        if self._sigma_known:
            return np.ones(left.shape[:-1])
        spare = left.shape[-1] - self.unknowns
        if not spare:
            return np.full(left.shape[:-1], np.nan)
        return np.asarray(np.sqrt(np.vecdot(left, left) / spare))
