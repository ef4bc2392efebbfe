"""Least-squares estimators, also for finite slopes."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy import linalg

from kappaskin.errors import RankDeficient
from kappaskin.estimation.estimator import Estimator, PatternCache, column_lengths
from kappaskin.estimation.fit import DenseUncertainty, Fit
from kappaskin.frames import Array, Mask
from kappaskin.sensing import NormalCurvature

_MILD = 100.0  # a condition up to which a product of factors rounds no worse than they do
_REFACTOR = 1e-6  # below this share of a direction left, updating loses digits: factor anew


@dataclass(frozen=True, slots=True, eq=False)
class _FactoredSolver:
    """The transposed solution operator (R, N) for the R readings `used` (3 P,).

    It is the product of the `factors`: one, or two, (R, F) and (F, N), where rounding of a single
    one would show in the residual.
    """

    used: Mask
    factors: tuple[Array, ...]
    spread: DenseUncertainty
    count: int


class LeastSquares(Estimator):
    """The least-squares shape (Eq. 6): `fit = LeastSquares(basis, layout)`; `fit(curvature)`.

    The normal equations of Eq. 6 square the condition number, so they are never formed: the
    columns of M are scaled to unit length and factored, M = Q R by Householder reflections and
    R = U S V^T, once. Missing readings (NaN) are taken out by an update of that factorisation.

    Where the basis leaves only some combinations free, c = W g, only those are fitted. Raises
    `RankDeficient` when the readings do not determine the coefficients.
    """

    def _set_up(self) -> None:
        readings = int(self.readable.sum())
        if readings < self.unknowns:  # before any memory is taken for it
            raise self.refusal(readings, readings)
        self._factor(self.readable)
        self._solver = self._made(self.readable, self._root, self._U)
        self._reduced = PatternCache[_FactoredSolver]()

    def _factor(self, used: Mask) -> None:
        """U (R, F) orthonormal and root (N, F) with operator = root U^T, for the readings used."""
        W = self.basis.free
        A = self.weight[used, None] * (self.M[used] if W is None else self.M[used] @ W)
        length = column_lengths(A)
        Q, R = cast("tuple[Array, Array]", linalg.qr(A / length, mode="economic"))
        U, s, Vt = linalg.svd(R)
        rank = int(np.sum(s > s[0] * max(A.shape) * np.finfo(float).eps))
        if rank < self.unknowns:
            raise self.refusal(len(A), rank)
        self._U = Q @ U
        root = (Vt.T / s) / length[:, None]
        self._root = root if W is None else W @ root
        self.condition = float(s[0] / s[-1])
        """Condition number of M with its columns scaled to unit length."""

    def _made(
        self, used: Mask, root: Array, U: Array, inverse: Array | None = None
    ) -> _FactoredSolver:
        """The solver root X U^T, whose covariance is root X root^T; X = 1 without an `inverse`."""
        left = root if inverse is None else root @ inverse
        weighted = U if self.sigma is None else self.weight[used, None] * U
        factors = ((left @ weighted.T).T,) if self.condition <= _MILD else (weighted, left.T)
        spread = DenseUncertainty(lambda: left @ root.T)
        return _FactoredSolver(used, tuple(f.astype(self.dtype) for f in factors), spread, len(U))

    def _without(self, used: Mask) -> _FactoredSolver:
        """The solver for the readings `used` (3 P,), cached for the next frames."""
        return self._solver if used is self.readable else self._reduced(used, self._downdate)

    def _downdate(self, used: Mask) -> _FactoredSolver:
        # With the rows U_k of U taken out, U_r^T U_r = I - U_k^T U_k, whose inverse is
        # I + U_k^T G^-1 U_k with the small G = I - U_k U_k^T. An eigenvalue of G is the share of
        # a direction that the readings left still see.
        left = used[self.readable]
        U_k, U_r = self._U[~left], self._U[left]
        if not len(U_k):
            return self._solver
        G = np.eye(len(U_k)) - U_k @ U_k.T
        if len(U_r) < self.unknowns or np.linalg.eigvalsh(G)[0] < _REFACTOR:
            weight = np.where(used, self.weight, 0.0)
            sigma = np.divide(1.0, weight, where=used, out=np.full(len(weight), np.inf))
            fresh = LeastSquares(self.basis, self.layout, sigma.reshape(3, -1), dtype=self.dtype)
            return fresh._solver
        inverse = np.eye(self.unknowns) + U_k.T @ np.linalg.solve(G, U_k)
        return self._made(used, self._root, U_r, inverse)

    def _fit(self, flat: Array, used: Mask) -> Fit:
        solver = self._without(used)
        c = flat if solver.count == flat.shape[-1] else flat[..., used]
        for factor in solver.factors:
            c = np.dot(c, factor)
        return self._answer(flat, c, solver.spread, solver.count - self.unknowns)


class _PerFrame(Estimator):
    """Base of estimators that factor nothing: the weighted M is solved in each call."""

    def _set_up(self) -> None:
        self._A = (self.weight[:, None] * self._columns()).astype(self.dtype)

    def _columns(self) -> Array:
        return self.M

    def _rows(self, flat: Array, used: Mask) -> tuple[Array, Array]:
        """Weighted operator (R, F) and readings (R, T) of those used."""
        weight = self.weight[used].astype(self.dtype)
        return self._A[used], (flat[..., used] * weight).T


class AsPrinted(_PerFrame):
    """c = (M^T M)^-1 M^T K, the normal equations of Eq. 6 as the paper prints them.

    They square the condition number, and nothing shows when that has eaten every digit: for
    teaching and comparison. Raises `RankDeficient` only where the elimination divides by zero.
    """

    def _fit(self, flat: Array, used: Mask) -> Fit:
        A, K = self._rows(flat, used)
        if not len(A):
            raise self.refusal(0, 0)
        try:
            c: Array = np.linalg.solve(A.T @ A, A.T @ K).astype(self.dtype)
        except np.linalg.LinAlgError as error:
            raise RankDeficient(
                "Eq. 6 as printed divides by zero: M^T M has no inverse; use least-squares, which "
                "refuses with the cause"
            ) from error

        def covariance() -> Array:
            N: Array = A.astype(np.float64)
            return np.linalg.pinv(N.T @ N).astype(np.float64)

        return self._answer(flat, c.T, DenseUncertainty(covariance), len(A) - self.unknowns)


class Direct(_PerFrame):
    """The least-squares shape by a general solver (LAPACK's gelsd) in every frame.

    For comparison. The columns of M are scaled to unit length first. Raises `RankDeficient` when
    the readings do not determine the coefficients.
    """

    def _columns(self) -> Array:
        W = self.basis.free
        A = self.M if W is None else self.M @ W
        length = column_lengths((self.weight[:, None] * A)[self.readable])
        self._back = (np.eye(self.unknowns) if W is None else W) / length
        return A / length

    def _fit(self, flat: Array, used: Mask) -> Fit:
        A, K = self._rows(flat, used)
        if len(A) < self.unknowns:
            raise self.refusal(len(A), len(A))
        g, _, rank, _ = np.linalg.lstsq(A, K, rcond=max(A.shape) * np.finfo(self.dtype).eps)
        if rank < self.unknowns:
            raise self.refusal(len(A), int(rank))
        back = self._back

        def covariance() -> Array:
            root = back @ np.linalg.pinv(A.astype(float))
            return root @ root.T

        c = (back @ g).T.astype(self.dtype)
        return self._answer(flat, c, DenseUncertainty(covariance), len(A) - self.unknowns)


_STEPS = 4  # at most; 2 or 3 do
_EXACT = 1e-6  # of the readings' RMS: a step that changes them by less is the last one
_ROUNDINGS = 100  # relative errors that a step may amount to by rounding alone, as in float32
_CLOSE = 1e-2  # of the readings' RMS: so small must the fourth step be
_CONTRACTS = 0.7  # a step longer than this share of the one before: it will not get there


class FiniteSlopeLeastSquares(Estimator):
    """Least squares for finite slopes: gages sense the curvature of the deflected surface.

    c <- c + M^+ (K - h(c)), from the least-squares shape on, at most four times. h(c) is
    `NormalCurvature`; M^+ is that of `LeastSquares`, factored once. Where the steps do not shrink,
    as when slopes are near one and noise is large, the result is that of least squares and
    `Fit.converged` is false.
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
            first.uncertainty,
            first.spare,
            first.known_noise,
            steps,
            ~diverged,
        )


def _rms(K: Array) -> Array:
    """Root mean square (...) of readings (..., 3, P)."""
    return np.sqrt(np.mean(K**2, axis=(-2, -1)))
