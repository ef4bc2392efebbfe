"""Least-squares estimators, also for finite slopes."""

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar, cast

import numpy as np
from scipy import linalg
from scipy.linalg import get_lapack_funcs

from kappaskin.errors import RankDeficient
from kappaskin.estimation.estimator import Estimator, PatternCache, column_lengths
from kappaskin.estimation.fit import DenseUncertainty, Fit, RootUncertainty
from kappaskin.frames import Array, Mask
from kappaskin.sensing import DeflectedSurface, NormalCurvature

_MILD = 100.0  # a condition up to which a product of factors rounds no worse than they do
_REFACTOR = 1e-6  # below this share of a direction left, updating loses digits: factor anew


@dataclass(frozen=True, slots=True, eq=False)
class _FactoredSolver:
    """The transposed solution operator (r, N + d) for the r readings that are `used` (R,).

    It is the product of the `factors`: one, or two, (r, F) and (F, N + d), where rounding of a
    single one would show in the residual. `offsets` (R, d) are the readings of the offsets that are
    unknown; `spare` are the degrees of freedom left.
    """

    used: Mask
    factors: tuple[Array, ...]
    spread: DenseUncertainty
    count: int
    spare: int
    offsets: Array | None


class LeastSquares(Estimator):
    """The least-squares shape (Eq. 6): `fit = LeastSquares(basis, layout)`; `fit(readings)`.

    The normal equations of Eq. 6 square the condition number, so they are never formed: the
    columns of M are scaled to unit length and factored, M = Q R by Householder reflections and
    R = U S V^T, once. Missing readings (NaN) are taken out by an update of that factorisation.

    Where the basis leaves only some combinations free, c = W g, only those are fitted. Offsets of
    readings whose zero is unknown are fitted in the same factorisation, so that error bars and
    degrees of freedom account for them; `Fit.readings` are less them. Raises
    `RankDeficient` when the readings do not determine the coefficients.
    """

    has_datum = True

    def _set_up(self) -> None:
        readings, offsets = int(self.readable.sum()), self.layout.offsets
        self._offsets = offsets[:, offsets[self.readable].any(axis=0)]
        self.unknowns += self._offsets.shape[1]
        if readings < self.unknowns:  # before any memory is taken for it
            raise self.refusal(readings, readings, self.readable)
        self._factor(self.readable)
        self._solver = self._made(self.readable, self._root, self._U)
        self._reduced = PatternCache[_FactoredSolver]()

    def _factor(self, used: Mask) -> None:
        """U (r, F) orthonormal and root (N + d, F) with operator = root U^T, for readings used."""
        W, A = self.combinations, self._columns(used)
        length = column_lengths(A)
        Q, R = cast("tuple[Array, Array]", linalg.qr(A / length, mode="economic"))
        U, s, Vt = linalg.svd(R)
        rank = int(np.sum(s > s[0] * max(A.shape) * np.finfo(float).eps))
        if rank < self.unknowns:
            raise self.refusal(len(A), rank, used)
        self._U = Q @ U
        root = (Vt.T / s) / length[:, None]
        d = self._offsets.shape[1]
        self._root = (
            root if W is None else np.vstack([W @ root[: len(root) - d], root[len(root) - d :]])
        )
        self.condition = float(s[0] / s[-1])
        """Condition number of M with its columns scaled to unit length."""

    def _columns(self, used: Mask) -> Array:
        shapes = super()._columns(used)
        if not self._offsets.size:
            return shapes
        return np.hstack([shapes, self.weight[used, None] * self._offsets[used]])

    def _made(
        self, used: Mask, root: Array, U: Array, inverse: Array | None = None
    ) -> _FactoredSolver:
        """The solver root X U^T, whose covariance is root X root^T; X = 1 without an `inverse`."""
        left = root if inverse is None else root @ inverse
        weighted = U if self.sigma is None else self.weight[used, None] * U
        factors = ((left @ weighted.T).T,) if self.condition <= _MILD else (weighted, left.T)
        N, count, offsets = self.basis.size, len(U), self._offsets
        return _FactoredSolver(
            used,
            tuple(f.astype(self.dtype) for f in factors),
            DenseUncertainty(lambda: left[:N] @ root[:N].T),
            count,
            count - self.unknowns,
            offsets.astype(self.dtype) if offsets.size else None,
        )

    def _without(self, used: Mask) -> _FactoredSolver:
        """The solver for the readings `used` (R,), cached for the next frames."""
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
            sigma = sigma.reshape(self.frame_shape)
            fresh = LeastSquares(self.basis, self.layout, sigma, dtype=self.dtype)
            return fresh._solver
        inverse = np.eye(self.unknowns) + U_k.T @ np.linalg.solve(G, U_k)
        return self._made(used, self._root, U_r, inverse)

    def _fit(self, flat: Array, used: Mask) -> Fit:
        return self._solution(flat, used)[0]

    def _solution(self, flat: Array, used: Mask) -> tuple[Fit, Array]:
        """The fit, and its coefficients and offsets (..., N + d)."""
        solver = self._without(used)
        c = found = flat if solver.count == flat.shape[-1] else flat[..., used]
        for factor in solver.factors:
            c = found = np.dot(found, factor)
        if solver.offsets is not None:
            c, zero = np.split(found, [self.basis.size], axis=-1)
            flat = flat - np.dot(zero, solver.offsets.T)
        return self._answer(flat, c, solver.spread, solver.spare), found


class _PerFrame(Estimator):
    """Base of estimators that factor nothing: the weighted M is solved in each call."""

    def _set_up(self) -> None:
        self._A = (self.weight[:, None] * self._scaled()).astype(self.dtype)

    def _scaled(self) -> Array:
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

    def _scaled(self) -> Array:
        W = self.combinations
        A = self.M if W is None else self.M @ W
        length = column_lengths((self.weight[:, None] * A)[self.readable])
        self._back = (np.eye(self.unknowns) if W is None else W) / length
        return A / length

    def _fit(self, flat: Array, used: Mask) -> Fit:
        A, K = self._rows(flat, used)
        if len(A) < self.unknowns:
            raise self.refusal(len(A), len(A), used)
        g, _, rank, _ = np.linalg.lstsq(A, K, rcond=max(A.shape) * np.finfo(self.dtype).eps)
        if rank < self.unknowns:
            raise self.refusal(len(A), int(rank), used)
        back = self._back

        def covariance() -> Array:
            root = back @ np.linalg.pinv(A.astype(float))
            return root @ root.T

        c = (back @ g).T.astype(self.dtype)
        return self._answer(flat, c, DenseUncertainty(covariance), len(A) - self.unknowns)


_STEPS = 6  # at most; slopes of 1.4 take 4 or 5
_EXACT = 1e-6  # of the readings: a step that leaves less than this to go is the last one,
_UNSEEN = 1e-3  # or less than this, of the standard deviation that noise gives the solution
_ROUNDINGS = 100  # relative errors that a step may amount to by rounding alone, as in float32
_DAMPING = 0.1  # of the information on a flat skin, after the first step that explains less


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """Coefficients and offsets (N + d,), their surface, and what they leave of readings (R,)."""

    flat: Array
    surface: DeflectedSurface
    left: Array
    squares: float


class FiniteSlopeLeastSquares(LeastSquares):
    """Least squares for finite slopes: gages sense the curvature of the deflected surface.

    The squares of K - h(c), with h of `NormalCurvature`, are minimised by Levenberg's and
    Marquardt's method, in at most six steps from the shape of `LeastSquares` on. The covariance is
    that of the problem linearised at the solution. Where six steps are not enough, as for slopes
    above one with much noise, the result is that of least squares and `Fit.converged` is false.
    Heights and slopes are linear on any slope: of these alone it is least squares.
    """

    linear: ClassVar = False

    def _set_up(self) -> None:
        super()._set_up()
        if not self.layout.senses_curvature:
            return
        self._sensed = NormalCurvature(self.basis, self.layout, self.dtype)
        # The unknowns z of (c, offsets) = root z, in which the problem of a flat skin is
        # orthonormal.
        self._to_c, N = self._root.astype(self.dtype), self.basis.size
        self._maps = np.matmul(self._sensed.maps, self._to_c[:N])
        self._zero = self._offsets.astype(self.dtype)
        self._solve = cast("Any", get_lapack_funcs("posv", dtype=self.dtype))
        self._rounding = _ROUNDINGS * float(np.finfo(self.dtype).eps)

    # Steps that run away may overflow: what is infinitely steep reads nothing, and what is no
    # number does not converge.
    @np.errstate(over="ignore", invalid="ignore")
    def predicted(self, coefficients: Array) -> Array:
        """What the elements would read, as the frame, of `coefficients` (..., Ni, Nj)."""
        if not self.layout.senses_curvature:
            return super().predicted(coefficients)
        return self._sensed(coefficients)

    @np.errstate(over="ignore", invalid="ignore")
    def _fit(self, flat: Array, used: Mask) -> Fit:
        linear, start = self._solution(flat, used)
        if not self.layout.senses_curvature:
            return linear
        weight = (self.weight * used).astype(self.dtype)
        K = np.where(used, flat, 0.0) * weight
        if flat.ndim == 1:
            return self._refined(linear, start, flat, K, weight)
        frames = [
            self._refined(one, start[t], flat[t], K[t], weight)
            for t, one in enumerate(linear.alone())
        ]
        return Fit.stacked(frames) if frames else linear

    def _refined(self, linear: Fit, start: Array, flat: Array, K: Array, weight: Array) -> Fit:
        """The fit of one frame `flat`, weighted K (R,), from the `linear` one, `start` (N + d,)."""
        size = last = float(np.linalg.norm(K))
        if not size:
            return linear
        here, damping = self._trial(start, K, weight), 0.0
        exact, no_more = max(_EXACT, self._rounding) * size, 1 + self._rounding
        unseen = _UNSEEN * float(np.sqrt(self.unknowns / np.maximum(linear.spare, 1)))
        for steps in range(1, _STEPS + 1):
            J = self._jacobian(here.surface, weight)
            step = self._step(J, here.left, damping)
            there = self._trial(here.flat + self._to_c @ step, K, weight)
            if not there.squares <= no_more * here.squares + exact**2:
                damping = max(10 * damping, _DAMPING)
                continue
            here, length = there, float(np.linalg.norm(step))
            last, left = length, length * min(length, last) / last if last else 0.0
            if not damping and left <= max(exact, unseen * math.sqrt(here.squares)):
                return self._solved(linear, here, flat, weight, steps)
            damping = damping / 10 if damping > _DAMPING else 0.0
        return replace(linear, steps=_STEPS, converged=False)

    def _split(self, flat: Array) -> tuple[Array, Array]:
        """The coefficients (N,), and the readings (R,) of the offsets."""
        N = self.basis.size
        return flat[:N], self._zero @ flat[N:]

    def _trial(self, flat: Array, K: Array, weight: Array) -> _Trial:
        c, zero = self._split(flat)
        surface = self._sensed.surface(c)
        left = K - weight * (surface.readings + zero)
        return _Trial(flat, surface, left, float(np.vdot(left, left)))

    def _jacobian(self, surface: DeflectedSurface, weight: Array) -> Array:
        """How the weighted readings change with z, (R, F)."""
        of_shape = np.einsum("qr,qrf->rf", surface.jacobian() * weight, self._maps)
        if not self._zero.size:
            return of_shape
        return of_shape + (weight[:, None] * self._zero) @ self._to_c[self.basis.size :]

    def _step(self, J: Array, left: Array, damping: float) -> Array:
        G = J.T @ J
        G.flat[:: len(G) + 1] += damping
        _, step, failed = self._solve(G, J.T @ left)
        return np.full_like(step, np.nan) if failed else step

    def _solved(self, linear: Fit, solution: _Trial, flat: Array, weight: Array, steps: int) -> Fit:
        def half() -> Array:
            J = self._jacobian(solution.surface, weight).astype(float)
            root = linalg.cholesky(J.T @ J, lower=True)
            return linalg.solve_triangular(root, self._root[: self.basis.size].T, lower=True)

        c, zero = self._split(solution.flat)
        return replace(
            linear,
            readings=(flat - zero).reshape(self.frame_shape),
            coefficients=c.reshape(self.basis.shape),
            uncertainty=RootUncertainty(half),
            steps=steps,
            converged=True,
        )
