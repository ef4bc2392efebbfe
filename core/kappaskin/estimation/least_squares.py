"""Least squares, factored once: curvature to the coefficients of the shape, with error bars."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy import linalg

from kappaskin.estimation.estimator import Estimator, column_lengths
from kappaskin.estimation.fit import DenseSpread, Fit
from kappaskin.estimation.remembered import Remembered
from kappaskin.frames import Array, Mask

_MILD = 100.0  # a condition up to which a product of factors rounds no worse than they do
_REFACTOR = 1e-6  # below this share of a direction left, updating loses digits: factor anew


@dataclass(frozen=True, slots=True, eq=False)
class _Solver:
    """The transposed operator (R, N) for the R readings `used` (3 P,), and what it is worth.

    It is the product of the `factors`: of one, or where rounding it would show in the residual of
    two, (R, F) and (F, N).
    """

    used: Mask
    factors: tuple[Array, ...]
    spread: DenseSpread
    count: int


class LeastSquares(Estimator):
    """`fit = LeastSquares(basis, layout)`; `fit(curvature)` is the least-squares shape (Eq. 6).

    The normal equations of Eq. 6 square the condition number, so they are never formed: the
    columns of M are scaled to unit length and factored, M = Q R by Householder reflections and
    R = U S V^T, once. Missing readings (NaN) are taken out by an update of that factorisation.

    Where the basis leaves only some combinations free, c = W g, only those are fitted. Raises
    `RankDeficient` when the readings do not decide the coefficients.
    """

    def _set_up(self) -> None:
        readings = int(self.readable.sum())
        if readings < self.unknowns:  # before any memory is taken for it
            raise self.refusal(readings, readings)
        self._factor(self.readable)
        self._solver = self._made(self.readable, self._root, self._U)
        self._reduced = Remembered[_Solver]()

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

    def _made(self, used: Mask, root: Array, U: Array, inverse: Array | None = None) -> _Solver:
        """The solver root X U^T, whose covariance is root X root^T; X = 1 without an `inverse`."""
        left = root if inverse is None else root @ inverse
        seen = U if self.sigma is None else self.weight[used, None] * U
        factors = ((left @ seen.T).T,) if self.condition <= _MILD else (seen, left.T)
        spread = DenseSpread(lambda: left @ root.T)
        return _Solver(used, tuple(f.astype(self.dtype) for f in factors), spread, len(U))

    def _without(self, used: Mask) -> _Solver:
        """The solver for the readings `used` (3 P,), remembered for the next frames."""
        return self._solver if used is self.readable else self._reduced(used, self._downdate)

    def _downdate(self, used: Mask) -> _Solver:
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
