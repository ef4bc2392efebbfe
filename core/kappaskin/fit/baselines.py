"""The ways from curvature to coefficients that others take, for teaching and comparison."""

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from kappaskin.bases import Basis
from kappaskin.errors import RankDeficient
from kappaskin.fit.estimator import (
    RIM_SD,
    DenseSpread,
    Estimator,
    Fit,
    Spread,
    column_lengths,
)
from kappaskin.frames import Array, Mask
from kappaskin.layout import SensorLayout


class _PerFrame(Estimator):
    """An estimator that factors nothing: A = M with its weights is solved anew in each call."""

    def __init__(
        self,
        basis: Basis,
        layout: SensorLayout,
        sigma: ArrayLike | None = None,
        rim_sd: float = RIM_SD,
        dtype: DTypeLike = np.float64,
    ) -> None:
        super().__init__(basis, layout, sigma, rim_sd, dtype)
        self._A = (self.weight[:, None] * self._columns()).astype(self.dtype)

    def _columns(self) -> Array:
        return self.M

    def _rows(self, flat: Array, used: Mask) -> tuple[Array, Array]:
        """Of the readings used: A (R, F) and K (R, T), weighted."""
        weight = self.weight[used].astype(self.dtype)
        return self._A[used], (flat[..., used] * weight).T

    def _fitted(self, flat: Array, used: Mask, c: Array, spread: Spread) -> Fit:
        frames = flat.shape[:-1]
        return Fit(
            self,
            flat.reshape(*frames, 3, len(self.layout)),
            c.reshape(*frames, *self.basis.shape),
            [spread] * frames[0] if frames else spread,
            np.broadcast_to(int(used.sum()) - self.unknowns, frames),
            np.ones(frames) if self.told_sigma else None,
        )


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

        return self._fitted(flat, used, c.T, DenseSpread(covariance))


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

        return self._fitted(flat, used, (back @ g).T.astype(self.dtype), DenseSpread(covariance))
