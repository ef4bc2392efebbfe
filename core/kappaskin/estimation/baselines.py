"""The ways from curvature to coefficients that others take, for teaching and comparison."""

import numpy as np

from kappaskin.errors import RankDeficient
from kappaskin.estimation.estimator import Estimator, column_lengths
from kappaskin.estimation.fit import DenseSpread, Fit
from kappaskin.frames import Array, Mask


class _PerFrame(Estimator):
    """An estimator that factors nothing: A = M with its weights is solved anew in each call."""

    def _set_up(self) -> None:
        self._A = (self.weight[:, None] * self._columns()).astype(self.dtype)

    def _columns(self) -> Array:
        return self.M

    def _rows(self, flat: Array, used: Mask) -> tuple[Array, Array]:
        """Of the readings used: A (R, F) and K (R, T), weighted."""
        weight = self.weight[used].astype(self.dtype)
        return self._A[used], (flat[..., used] * weight).T


class AsPrinted(_PerFrame):
    """c = (M^T M)^-1 M^T K, the normal equations of Eq. 6 as the paper prints them.

    They square the condition number, and nothing tells when that has eaten every digit: kept to
    show what it costs. Refuses only where the elimination itself divides by zero.
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
                "says what is not determined"
            ) from error

        def covariance() -> Array:
            N: Array = A.astype(np.float64)
            return np.linalg.pinv(N.T @ N).astype(np.float64)

        return self._answer(flat, c.T, DenseSpread(covariance), len(A) - self.unknowns)


class Direct(_PerFrame):
    """The least-squares shape by a general solver (LAPACK's gelsd) in every frame.

    The columns of M are scaled to unit length first. Raises `RankDeficient` when the readings do
    not decide the coefficients.
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
        return self._answer(flat, c, DenseSpread(covariance), len(A) - self.unknowns)
