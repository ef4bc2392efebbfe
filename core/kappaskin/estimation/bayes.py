"""Bayesian estimator, with the prior of a plate under random loads."""

import math
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from scipy import linalg

from kappaskin.bases import Basis, SineBasis, covariant_at
from kappaskin.errors import Refusal
from kappaskin.estimation.estimator import Estimator, PatternCache
from kappaskin.estimation.fit import Fit, Uncertainty, power_of_two
from kappaskin.frames import Array, Mask
from kappaskin.mechanics import Plate
from kappaskin.skin import Cap, MeshSkin

_THICKNESSES = 0.25e-3, 1e-3, 4e-3  # m
_WIDTH = 0.15  # of the shorter side, over which wide loads are smoothed twice


def prior_root(basis: Basis) -> Array:
    """L (N, F) in m: L L' is the covariance of the coefficients of a plate under a white load.

    White means that loads at two points are independent: with G the Gram matrix of the functions,
    the modal forces have the covariance G, and the coefficients of a plate of compliance C have
    C G C. L spans the F combinations that are `basis.free`, on a cap all; unobservable shapes are
    left out. Scaled so that the displacement's RMS over the skin is 1 m.

    For sines on a flat skin it is the diagonal of 1 / (k_i^2 + k_j^2)^2, so scaled. A skin that
    curves both ways stretches: how fine its shapes are depends on its thickness and on how wide
    loads are, of which nothing is known. It is the mean covariance of skins of `_THICKNESSES` under
    loads that are white, and smoothed over `_WIDTH`.
    """
    if isinstance(basis, SineBasis) and not any(basis.patch.curvatures):
        # The squares of sines average 1/2, along x and along y.
        sd: Array = 1 / basis.laplacian.ravel() ** 2
        squares = sd @ sd / (2 if basis.patch.strip else 4)
        return np.diag(sd / np.sqrt(squares))
    points, weights = basis.quadrature()
    f = np.sqrt(weights / weights.sum())[:, None] * basis.at(points)
    # With f = Q R, G = R'R and C R' is a root of C G C; R C R' is one of the displacement's.
    R = _triangle(f)
    plates, loads = [Plate(basis.patch)], [R]
    if isinstance(basis.patch, Cap | MeshSkin) or basis.patch.is_shallow:
        plates = [
            replace(plates[0], axial_stiffness=plates[0].modulus(h) * h) for h in _THICKNESSES
        ]
        slopes = covariant_at(basis, points)[1:3] * np.sqrt(weights / weights.sum())[:, None]
        along = slopes.reshape(-1, basis.size) @ np.asarray(np.linalg.inv(R), float)
        square = (_WIDTH * min(basis.patch.a, basis.patch.b)) ** 2
        smooth = np.asarray(np.linalg.inv(np.eye(basis.size) + square * (along.T @ along)), float)
        loads.append(smooth @ smooth @ R)
    roots = [plate.compliance(basis).after(load).T for plate in plates for load in loads]
    joined = np.hstack([root / np.linalg.norm(R @ root) for root in roots])
    # How far a cap moves along its axis is a matter of its stiffness, not of its edge.
    root = (
        _triangle(joined.T).T
        if isinstance(basis.patch, Cap | MeshSkin)
        else _on_free(basis, joined)
    )
    return root / np.linalg.norm(R @ root)


def _on_free(basis: Basis, root: Array) -> Array:
    """The part of a covariance's `root` (N, n) in the free combinations, as a root (N, F)."""
    W = np.eye(basis.size) if basis.free is None else basis.free
    V = W if basis.unobservable is None else np.hstack([W, basis.unobservable])
    share = cast("Array", np.linalg.lstsq(V, root)[0])[: W.shape[1]]
    return W @ _triangle(share.T).T


def _triangle(A: Array) -> Array:
    """The triangular R of A = Q R: a root, R'R = A'A."""
    return cast("Array", np.linalg.qr(A, mode="r"))


_LEAST, _MOST = -12.0, 60.0  # ln of signal over noise in power, of the best seen direction
_GRID = np.linspace(_LEAST, _MOST, 145)
_AWAY = 0.9  # the power of scale and noise in their density
_NEWTON = 3  # steps from the best of them


@dataclass(frozen=True, slots=True, eq=False)
class PosteriorUncertainty:
    """Covariance B diag(v) B^T for unit noise: B (N, F), v (F,)."""

    B: Array
    v: Array

    @property
    def sd(self) -> Array:
        return np.sqrt(self.B**2 @ self.v)

    def covariance_of(self, rows: Array) -> Array:
        left = rows @ self.B
        return (left * self.v) @ left.swapaxes(-1, -2)

    def sd_of(self, rows: Array) -> Array:
        return np.sqrt((rows @ self.B) ** 2 @ self.v)


# With c = tau L z and z ~ N(0, 1), the weighted readings are K = tau A z + noise, A = M L. By
# A = U S V^T, y = U^T K has variances sigma^2 d_k, d_k = 1 + gamma s_k^2 with gamma = tau^2 /
# sigma^2, and what is orthogonal to U has sigma^2. Of sigma^2 the most likely value for each gamma
# is sigma^2 = (sum_k y_k^2 / d_k + rest) / R, so that one number is left to search:
#     -2 ln p(K | gamma) = R ln sigma^2 + sum_k ln d_k,
# or, where sigma is given and the readings are in units of it, sum_k y_k^2 / d_k + ln d_k. Where
# noise hides the signal this may be least at tau = 0, and where there are more functions than
# readings at sigma = 0, with error bars of nothing. A density that grows as a power of both keeps
# it from there (doi:10.1007/s11336-013-9328-2): -2 p ln (tau sigma) = -p ln gamma - 2 p ln sigma^2
# more. With p = 1, one function that is seen among others unseen would let tau run away.
class MarginalLikelihood:
    """The scale of the prior and the noise that make readings K = A z most likely, A (R, F).

    Of the R readings `spent` have no say: both A and K lack their part along as many directions.
    """

    def __init__(self, A: Array, sigma_known: bool, floor: float, spent: int = 0) -> None:
        U, s, Vt = linalg.svd(A, full_matrices=len(A) < A.shape[1])
        k = len(s)
        self.U, self.V = U[:, :k], Vt.T
        self.s2 = np.zeros(len(Vt))
        self.s2[:k] = s**2
        self._k, self._sigma_known = k, sigma_known
        self._count = len(A) - spent
        # Less what the density of sigma takes.
        self._readings = max(self._count - 2 * _AWAY, 1.0)
        self._top = math.log(self.s2[0]) if s[0] > 0 else 0.0
        self._floor = floor  # of the readings' own power: what their rounding leaves
        d = 1 + np.exp(_GRID - self._top)[:, None] * self.s2[:k]
        self._share, self._volume = 1 / d, np.log(d).sum(axis=1)

    def __call__(self, K: Array) -> tuple[Array, Array, Array]:
        """y (T, k), gamma (T,) and sigma (T,) for readings K (T, R)."""
        if self._sigma_known:
            y, gamma = self._likeliest(K)[:2]
            return y, gamma, np.ones(len(K))
        unit = power_of_two(K)
        y, gamma, sigma = self._likeliest(K / unit)
        return y * unit, gamma, sigma * unit[:, 0]

    def expected(self, K: Array, noise: float) -> float:
        """gamma of the readings K (R,) with `noise` on them: that of their mean squares."""
        _, y2, left = self._squares(K[None])
        return float(self._scale(y2 + noise**2, left + noise**2 * (self._count - self._k))[0])

    def _squares(self, K: Array) -> tuple[Array, Array, Array]:
        """y (T, k), their squares, and those of what is orthogonal to U (T,)."""
        y = K @ self.U
        rest = K - y @ self.U.T
        power = np.vecdot(K, K)
        # Rounding looks like noise: below it there is none to be found.
        return y, y**2, np.maximum(np.vecdot(rest, rest), self._floor * power)

    def _likeliest(self, K: Array) -> tuple[Array, Array, Array]:
        """The same for readings whose squares can be added up; sigma as if it were not known."""
        y, y2, left = self._squares(K)
        gamma = self._scale(y2, left)
        fit = np.vecdot(y2, 1 / (1 + gamma[:, None] * self.s2[: self._k])) + left
        return y, gamma, np.sqrt(fit / self._readings)

    def _scale(self, y2: Array, left: Array) -> Array:
        """The most likely gamma (T,) of squares y2 (T, k) and `left` (T,)."""
        fit = y2 @ self._share.T + left[:, None]
        cost = self._cost(fit, self._volume) - _AWAY * _GRID
        best = np.argmin(cost, axis=1)
        return np.exp(self._refined(_GRID[best], y2, left) - self._top)

    def _cost(self, fit: Array, volume: Array) -> Array:
        if self._sigma_known:
            return fit + volume
        tiny = np.finfo(float).tiny
        return self._readings * np.log(np.maximum(fit, tiny)) + volume

    def _refined(self, t: Array, y2: Array, left: Array) -> Array:
        """Newton's steps in t = ln(gamma s_0^2) from the best place on the grid."""
        half = _GRID[1] - _GRID[0]
        low, high = np.maximum(t - half, _LEAST), np.minimum(t + half, _MOST)
        s2 = self.s2[: self._k]
        for _ in range(_NEWTON):
            g = np.exp(t - self._top)[:, None] * s2
            q = g / (1 + g)  # the share of each direction that the readings decide
            e = y2 / (1 + g)
            fit = e.sum(axis=1) + left
            # d fit / dt and d2 fit / dt2; d volume / dt = sum q, d2 = sum q (1 - q).
            f1, f2 = -np.vecdot(e, q), np.vecdot(e, q * (2 * q - 1))
            v1, v2 = q.sum(axis=1), (q * (1 - q)).sum(axis=1)
            if self._sigma_known:
                slope, bend = f1 + v1 - _AWAY, f2 + v2
            else:
                fit = np.maximum(fit, np.finfo(float).tiny)
                R = self._readings
                slope, bend = R * f1 / fit + v1 - _AWAY, R * (f2 / fit - (f1 / fit) ** 2) + v2
            step = np.divide(-slope, bend, where=bend > 0, out=np.zeros_like(t))
            t = np.clip(t + step, low, high)
        return t


@dataclass(frozen=True, slots=True, eq=False)
class _BayesSolver:
    """What depends on which readings are used: the likelihood, and B = L V (N, F).

    Of offsets that are unknown their weighted readings, orthonormal, `Q` (r, d), and what they are
    of weighted readings, `inverse` (d, r).
    """

    likelihood: MarginalLikelihood
    B: Array
    Q: Array
    inverse: Array
    offsets: Array


class Bayes(Estimator):
    """The posterior mean of the shape of a plate under a white load, given the readings.

    The coefficients are Gaussian with the standard deviation of a plate's under a load that is
    white in space, for sines proportional to 1/(i^2/a^2 + j^2/b^2)^2; of domes, saddles and caps it
    is that of shells of several thicknesses (`prior_root`). Its scale, and the noise
    unless `sigma` is given, are those that make the readings most likely (type II maximum
    likelihood, doi:10.1162/neco.1992.4.3.415), of each frame by itself. The prior decides what the
    readings do not, with error bars that show it: no basis is too large. Where the zero of readings
    is unknown, the likelihood is that of what no offset changes (restricted maximum likelihood,
    doi:10.1093/biomet/58.3.545).
    """

    has_prior = True
    has_rim = False
    has_datum = True

    def _set_up(self) -> None:
        self._root = prior_root(self.basis)
        self._solvers = PatternCache[_BayesSolver]()
        if self.readable.any():
            self._solvers(self.readable, self._made)

    def _made(self, used: Mask) -> _BayesSolver:
        whole = self.weight[used, None] * (self.M[used] @ self._root)
        offsets = self.layout.offsets[:, self.layout.offsets[used].any(axis=0)]
        D = self.weight[used, None] * offsets[used]
        Q: Array = D / np.linalg.norm(D, axis=0)  # each reading has one offset at most
        sigma_known, rounding = self.sigma is not None, float(np.finfo(self.dtype).eps)
        A = whole - Q @ (Q.T @ whole) if Q.size else whole
        likelihood = MarginalLikelihood(A, sigma_known, rounding**2, Q.shape[1])
        inverse = Q.T / np.linalg.norm(D, axis=0)[:, None]
        return _BayesSolver(likelihood, self._root @ likelihood.V, Q, inverse, offsets)

    # Repeated readings of one load scatter by the noise alone: with c = B diag(gamma s / d) y each
    # y_k has the variance of the noise. What readings leave open, which is in error bars, is alike
    # in all of them.
    def scatter(self, noise: float, readings: Array | None = None) -> Uncertainty:
        if readings is None:
            raise Refusal(
                "expected the readings of a load as well, since the prior's scale follows from "
                "them; got none; give those of the load without noise"
            )
        self._of_one_frame(readings)
        flat = readings.ravel()
        used = self._there(flat)
        if not used.any():
            raise self.refusal(0, 0)
        solver = self._solvers(used, self._made)
        K = flat[used] * self.weight[used]
        gamma = solver.likelihood.expected(K - solver.Q @ (solver.Q.T @ K), noise)
        s2 = solver.likelihood.s2
        return PosteriorUncertainty(solver.B, gamma**2 * s2 / (1 + gamma * s2) ** 2)

    def _fit(self, flat: Array, used: Mask) -> Fit:
        if not used.any():
            raise self.refusal(0, 0)
        solver, frames = self._solvers(used, self._made), flat.shape[:-1]
        likelihood, B, Q = solver.likelihood, solver.B, solver.Q
        K = np.atleast_2d(flat[..., used] * self.weight[used])
        y, gamma, sigma = likelihood(K - (K @ Q) @ Q.T if Q.size else K)
        d = 1 + gamma[:, None] * likelihood.s2
        k = y.shape[1]
        z = y * (gamma[:, None] * np.sqrt(likelihood.s2[:k]) / d[:, :k])
        c = (z @ B[:, :k].T).astype(self.dtype)
        spreads = [PosteriorUncertainty(B, v) for v in gamma[:, None] / d]
        spent = (1 - 1 / d).sum(axis=1) + Q.shape[1]
        if Q.size:
            left = K - self.weight[used] * (c @ self.M[used].T)
            flat = flat - (left @ solver.inverse.T @ solver.offsets.T).reshape(flat.shape)
        return Fit(
            self,
            flat.reshape(*frames, *self.frame_shape),
            c.reshape(*frames, *self.basis.shape),
            spreads if frames else spreads[0],
            (int(used.sum()) - spent).reshape(frames),
            sigma.reshape(frames),
        )
