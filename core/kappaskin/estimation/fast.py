"""Fast least squares on a regular grid: sine and cosine transforms instead of a matrix."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray
from scipy.linalg import eigvalsh_tridiagonal

from kappaskin.bases import Basis, SineBasis
from kappaskin.errors import RankDeficient, Refusal
from kappaskin.estimation.estimator import Estimator, PatternCache
from kappaskin.estimation.fit import Fit
from kappaskin.frames import Array, Mask
from kappaskin.sensing import SensorLayout, gage_multipliers

# Of a cell: an element so far off reads 3 parts in 10^9 wrong of the shortest wave, and positions
# that were computed otherwise, of a million cells along a side, are no farther off.
_OFF = 1e-9
_FEW = 0.5  # of the cells of a grid must have elements


@dataclass(frozen=True)
class _GridSide:
    """The first `count` sines along one side at the centres of its `cells`, and their cosines.

    `constant` along the width of a strip: one constant function.
    """

    count: int
    cells: int
    constant: bool = False

    @cached_property
    def lengths(self) -> tuple[Array, Array]:
        """Lengths (count,) of the sampled sines and of the cosines; the latter vanish at i = m."""
        number = np.arange(self.count) + (not self.constant)
        last = number % self.cells == 0
        sines = np.sqrt(self.cells / np.where(last, 1.0, 2.0))
        return sines, np.where(last, 0.0, sines)

    def analysed(self, K: Array, axis: int, cosines: bool, spend: bool = False) -> Array:
        """Components of `K` along the unit sines or cosines, without a last, vanishing cosine.

        With `spend` they may overwrite `K`.
        """
        # Slow to import, and only needed here.
        from scipy.fft import dct, dst

        transform = dct if cosines or self.constant else dst
        parts: Array = transform(K, 2, axis=axis, norm="ortho", overwrite_x=spend)
        used = slice(int(cosines), int(cosines) + self.count)
        return parts[..., used] if axis == -1 else parts[..., used, :]

    def summed(self, parts: Array, axis: int, cosines: bool) -> Array:
        """The sum of unit sines or cosines, each times its part: the transpose of `analysed`."""
        from scipy.fft import idct, idst

        transform = idct if cosines or self.constant else idst
        if cosines:
            none = np.zeros_like(parts[..., :1] if axis == -1 else parts[..., :1, :])
            parts = np.concatenate([none, parts], axis)  # of the constant
        return transform(parts, 2, n=self.cells, axis=axis, norm="ortho", overwrite_x=True)


class Transforms:
    """M of `basis` on a regular grid of m x n elements, and its transpose, computed in `dtype`.

    The gages of the elements are `gage_length` in m long.

    The sampled sines and cosines are orthogonal (DST-II and DCT-II), so that M c is one factor per
    function and channel, `gain` (3, Nj, Ni), and a fast transform per channel. Readings here are
    (..., 3, n, m) and coefficients (..., Nj, Ni): x runs fastest.
    """

    def __init__(
        self,
        basis: SineBasis,
        m: int,
        n: int,
        dtype: DTypeLike = np.float64,
        gage_length: float = 0.0,
    ) -> None:
        self.cells = (n, m)
        self._x = _GridSide(basis.Ni, m)
        self._y = _GridSide(basis.Nj, n, constant=basis.patch.strip)
        (ki, kj), (sx, cx), (sy, cy) = basis.wavenumbers, self._x.lengths, self._y.lengths
        xx, yy = np.outer(sy, -(ki**2) * sx), np.outer(-(kj**2) * sy, sx)
        at_points = np.stack([xx, yy, np.outer(kj * cy, ki * cx)])
        self.gain = (at_points * gage_multipliers(basis, gage_length).swapaxes(-1, -2)).astype(
            dtype
        )

    def analysed(self, K: Array, scale: Array) -> Array:
        """M^T K (..., Nj, Ni), each component times its `scale` (3,); one with zero is skipped."""
        total = np.zeros((*K.shape[:-3], *self.gain.shape[1:]), self.gain.dtype)
        for channel in np.flatnonzero(scale):
            cosines = bool(channel == 2)
            along_y = self._y.analysed(K[..., channel, :, :], -2, cosines)
            parts = self._x.analysed(along_y, -1, cosines, spend=True)
            Nj, Ni = parts.shape[-2:]  # at i = m and j = n the cosines have no part
            parts *= self.gain[channel, :Nj, :Ni]
            if scale[channel] != 1:
                parts *= float(scale[channel])
            total[..., :Nj, :Ni] += parts
        return total

    def readings(self, c: Array) -> Array:
        """M c (..., 3, n, m)."""
        K = np.zeros((*c.shape[:-2], 3, *self.cells), self.gain.dtype)
        for channel in np.flatnonzero(self.gain.any(axis=(1, 2))):
            cosines = bool(channel == 2)
            parts = self.gain[channel] * c
            if cosines:
                n, m = self.cells
                parts = parts[..., : n - 1, : m - 1]
            along_x = self._x.summed(parts, -1, cosines)
            K[..., channel, :, :] = self._y.summed(along_x, -2, cosines)
        return K


@dataclass(frozen=True, eq=False)
class ScaledOperator:
    """A = w M D^-1/2 on the grid, whose columns have about unit length.

    `weights` (3, n, m) or (3, 1, 1) are w, zero where there is no reading, and `root` (Nj, Ni) is
    D^-1/2 for a D that is exact when in each channel all weigh the same: then A^T A = 1.
    """

    transforms: Transforms
    weights: Array
    root: Array

    def forward(self, g: Array) -> Array:
        """A g (..., 3, n, m) for g (..., Nj, Ni)."""
        read = self.transforms.readings(self.root * g)
        read *= self.weights
        return read

    def back(self, K: Array) -> Array:
        """A^T K (..., Nj, Ni) for K (..., 3, n, m)."""
        return self.root * self.transforms.analysed(self.weights * K, np.ones(3))


def grid_cells(layout: SensorLayout) -> tuple[int, int, NDArray[np.intp] | None]:
    """The m x n grid of the elements, and the cell p + m q (P,) of each.

    The cells are None when they are 0, 1, 2, ... Elements may come in any order and some may be
    missing, but not all of the first column or row.
    """
    P, sides = layout.positions, np.array([layout.patch.a, layout.patch.b])
    least = np.maximum(P.min(axis=0), _FEW * sides / (2 * len(P)))
    counts = np.rint(sides / (2 * least)).astype(np.intp)
    m, n = int(counts[0]), int(counts[1])
    at = P * counts / sides - 0.5
    nearest = np.rint(at).astype(np.intp)
    cells = nearest[:, 0] + m * nearest[:, 1]
    there = np.abs(at - nearest).max() <= _OFF and len(np.unique(cells)) == len(P)
    if not there or _FEW * m * n > len(P):
        raise Refusal(
            f"expected elements at the cell centres of a regular grid, {_OFF:g} of a cell off at "
            f"most, got {layout} at other positions; use least-squares"
        )
    in_order = len(P) == m * n and bool(np.all(cells == np.arange(m * n)))
    return m, n, None if in_order else cells


_STEPS = 1000  # at most; most sets of missing readings that decide a shape take 10 to 100
_LOOK = 20  # steps after which to look whether a shape is hardly seen
_SURE = 1e-6  # of its part in a random shape: what is left of one that was seen
_ROUNDING = 10  # times the rounding of the readings is where transforms cannot tell what is left
_AT_ONCE = 2**18  # readings transformed together: about what a cache holds
_Number = TypeVar("_Number", bound=np.generic)
_MISSING = 4096  # readings that may be missing when error bars are requested


def _parts(count: int, readings: int) -> list[slice]:
    """Slices of `count` frames of so many `readings` that are computed together; at least one."""
    length = max(1, _AT_ONCE // readings)
    return [slice(start, start + length) for start in range(0, max(count, 1), length)]


def _joined(parts: list[NDArray[_Number]]) -> NDArray[_Number]:
    """The frames of all parts; a single part is not copied."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _squares(a: Array, axes: int) -> Array:
    """Sums of squares over the last `axes` of them."""
    flat = a.reshape(*a.shape[:-axes], -1)
    return np.vecdot(flat, flat)


def _least_eigenvalue(A: ScaledOperator, least: float) -> float:
    """The least eigenvalue of A^T A: the share of the worst observable shape that is read.

    Conjugate gradients on A^T A y = z for a random z, in which every shape has its part. They end
    when no part of z is left, so that every eigenvalue has been met; those of their tridiagonal
    matrix (Lanczos) tell the least one, from above. They end too when that is below `least`.
    """
    left = np.random.default_rng(0).normal(size=A.root.shape)
    step, size = left, float(_squares(left, 2))
    diagonal, off_diagonal, carried = list[float](), list[float](), 0.0
    for number in range(1, _STEPS + 1):
        image = A.forward(step)
        bend = float(_squares(image, 3))
        if bend <= least * float(_squares(step, 2)):
            break
        length = size / bend
        left = left - length * A.back(image)
        before, size = size, float(_squares(left, 2))
        diagonal.append(1 / length + carried)
        ended = size <= _SURE**2  # each of the parts was about 1
        if ended or number % _LOOK == 0:
            share = _least_of(diagonal, off_diagonal)
            if ended or share < least:
                return share
        ratio = size / before
        off_diagonal.append(math.sqrt(ratio) / length)
        carried = ratio / length
        step = left + ratio * step
    return 0.0


def _least_of(diagonal: list[float], off_diagonal: list[float]) -> float:
    """The least eigenvalue of a symmetric tridiagonal matrix."""
    return float(eigvalsh_tridiagonal(diagonal, off_diagonal, select="i", select_range=(0, 0))[0])


def _conjugate_gradients(A: ScaledOperator, K: Array) -> tuple[Array, NDArray[np.intp]] | None:
    """The least-squares g (T, Nj, Ni) of A g = K (T, 3, n, m) and steps (T,); None without an end.

    The residual is carried along in the place of `K` (CGLS), as accurate as A allows and not A^T A.
    It ends where A^T (K - A g) is what rounding leaves of it.
    """

    def of_each(a: Array, like: Array) -> Array:
        return np.expand_dims(a, tuple(range(1, like.ndim)))

    left = K
    g = np.zeros((len(K), *A.root.shape), K.dtype)
    step = A.back(left)
    slope = _squares(step, 2)
    end = (_ROUNDING * np.finfo(K.dtype).eps) ** 2 * _squares(K, 3)
    steps = np.zeros(len(K), np.intp)
    while (going := slope > end).any():
        if steps.max() == _STEPS:
            return None
        image = A.forward(step)
        length = np.divide(slope, _squares(image, 3), where=going, out=np.zeros_like(slope))
        g += of_each(length, g) * step
        image *= of_each(length, image)
        left -= image
        gradient = A.back(left)
        before, slope = slope, np.where(going, _squares(gradient, 2), slope)
        ratio = np.divide(slope, before, where=going, out=np.zeros_like(slope))
        step = gradient + of_each(ratio, step) * step
        steps += going
    return g, steps


class _GridUncertainty:
    """Uncertainty on a grid: D^-1, corrected for readings of another weight than most.

    With A0 orthonormal, for the weight w0 that most readings of a channel have, and B its rows
    that have another weight w, A^T A = 1 - B^T E B with E = 1 - (w/w0)^2, 1 for a missing reading.
    Its inverse is 1 + B^T X B with the small X = (1 - E B B^T)^-1 E (Woodbury).
    """

    def __init__(self, transforms: Transforms, weights: Array) -> None:
        usual = [np.median(w[w > 0]) if w.any() else 0.0 for w in weights]
        usual = np.array(usual).reshape(3, 1, 1)
        root = 1 / np.sqrt(np.sum((usual * transforms.gain) ** 2, axis=0))
        self._A = ScaledOperator(transforms, usual, root)
        share = np.divide(weights, usual, where=usual > 0, out=np.ones(weights.shape))
        self._other = np.flatnonzero(share != 1)
        self._E = 1 - share.ravel()[self._other] ** 2
        self._whole = (3, *transforms.cells)
        self._readings = int(np.prod(self._whole))

    def _read(self, g: Array) -> Array:
        """B g (R, k) for g (R, Nj, Ni)."""
        return self._A.forward(g).reshape(len(g), self._readings)[:, self._other]

    def _shape(self, K: Array) -> Array:
        """B^T K (R, Nj, Ni) for K (R, k)."""
        whole = np.zeros((len(K), self._readings))
        whole[:, self._other] = K
        return self._A.back(whole.reshape(len(K), *self._whole))

    @cached_property
    def _X(self) -> Array:
        k = len(self._E)
        if k > _MISSING:
            raise Refusal(
                f"expected at most {_MISSING} of {self._readings} readings to be missing or to "
                f"differ in weight when error bars are requested, got {k}; request the "
                "coefficients alone"
            )
        G, unit = np.empty((k, k)), np.eye(k)
        for part in _parts(k, self._readings):
            G[part] = self._read(self._shape(unit[part]))
        return np.linalg.solve(np.eye(k) - self._E[:, None] * G, np.diag(self._E)).astype(float)

    @property
    def sd(self) -> Array:
        return self._sd.copy()  # a copy, which the caller may change

    @cached_property
    def _sd(self) -> Array:
        X, variance = self._X, np.ones(self._A.root.shape)
        for part in _parts(len(X), self._readings):
            unit = np.eye(len(X))[part]
            variance += np.sum(self._shape(unit) * self._shape(X[part]), axis=0)
        return (self._A.root * np.sqrt(variance)).T.ravel()

    def _projected(self, rows: Array) -> tuple[Array, Array]:
        """`rows` (R, N) for the scaled unknowns, (R, N), and what B reads of them, (R, k)."""
        Nj, Ni = self._A.root.shape
        g = self._A.root * rows.reshape(-1, Ni, Nj).swapaxes(-1, -2)
        read = np.empty((len(g), len(self._E)))
        if len(self._E):
            for part in _parts(len(g), self._readings):
                read[part] = self._read(g[part])
        return g.reshape(len(g), -1), read

    def covariance_of(self, rows: Array) -> Array:
        if rows.ndim > 2:
            return np.stack([self.covariance_of(one) for one in rows])
        g, read = self._projected(rows)
        return g @ g.T + read @ self._X @ read.T

    def sd_of(self, rows: Array) -> Array:
        g, read = self._projected(rows)
        variance: Array = np.vecdot(read @ self._X, read)
        variance += np.vecdot(g, g)
        return np.sqrt(variance)


@dataclass(frozen=True, slots=True, eq=False)
class _GridSolver:
    """The solution for the readings used: c = D^-1 M^T `scale` K, or, with `A`, by iteration."""

    count: int
    scale: Array
    inverse: Array
    spread: _GridUncertainty
    A: ScaledOperator | None


class Fast(Estimator):
    """The least-squares shape of a flat skin with a regular grid of elements, in O(P log P).

    At the centres of an m x n grid sines and cosines are orthogonal up to i = m and j = n, so that
    D = M^T M is diagonal: three fast transforms and a division give the shape exactly, also when
    whole components are dead or have another weight. With single dead elements, missing readings
    or individual weights, conjugate gradients in the unknowns D^1/2 c need a few steps
    (`Fit.steps`). M is never made. Elements may come in any order (`grid_cells`).

    Raises `RankDeficient` when the readings do not determine the coefficients, or hardly.
    """

    has_matrix = False

    def _set_up(self) -> None:
        sines, layout = _sines(self.basis, self.layout), self.layout
        m, n, self._cells = grid_cells(layout)
        if sines.Ni > m or sines.Nj > n:
            raise Refusal(
                f"expected at most {m} x {n} functions for the fast transforms of {layout}, got "
                f"{sines.Ni} x {sines.Nj}; use fewer, or least-squares"
            )
        length = layout.gage_length
        self._exact = Transforms(sines, m, n, gage_length=length)
        exactly = self.dtype == np.float64
        self._transforms = self._exact if exactly else Transforms(sines, m, n, self.dtype, length)
        self._least = math.sqrt(np.finfo(self.dtype).eps)  # half of the digits are left
        self._solvers = PatternCache[_GridSolver]()
        self._whole = self._made(self.readable)

    def _on_grid(self, flat: Array) -> Array:
        """Readings (T, 3 P) as (T, 3, n, m); zero where an element was left out."""
        n, m = self._exact.cells
        if self._cells is None:
            return flat.reshape(-1, 3, n, m)
        K = np.zeros((len(flat), 3, n * m), flat.dtype)
        K[..., self._cells] = flat.reshape(-1, 3, len(self.layout))
        return K.reshape(-1, 3, n, m)

    def _made(self, used: Mask) -> _GridSolver:
        count, gain = int(used.sum()), self._exact.gain
        if count < self.unknowns:
            raise self.refusal(count, count)
        w = self._on_grid(np.where(used, self.weight, 0.0)[None])[0]
        if even := bool(np.all(w == w[:, :1, :1])):
            w = w[:, :1, :1].copy()
        scale = _squares(w, 2) / w[0].size
        D = np.einsum("c,cji,cji->ji", scale, gain, gain)
        if not np.all(D > 0):
            raise self.refusal(count, int(np.count_nonzero(D > 0)))
        inverse, spread = (1 / D).astype(self.dtype), _GridUncertainty(self._exact, w)
        if even:
            return _GridSolver(count, scale, inverse, spread, None)
        root = 1 / np.sqrt(D)
        if _least_eigenvalue(ScaledOperator(self._exact, w, root), self._least) < self._least:
            raise self._hardly(count)
        A = ScaledOperator(self._transforms, w.astype(self.dtype), root.astype(self.dtype))
        return _GridSolver(count, scale, inverse, spread, A)

    def predicted(self, coefficients: Array) -> Array:
        """What the elements would read, (..., 3, P) in 1/m, of `coefficients` (..., Ni, Nj)."""
        (n, m), P, frames = self._exact.cells, len(self.layout), coefficients.shape[:-2]
        c = coefficients.reshape(-1, *self.basis.shape).swapaxes(-1, -2)
        K = _joined([self._transforms.readings(c[part]) for part in _parts(len(c), 3 * P)])
        on_cells = K.reshape(*frames, 3, n * m)
        return on_cells if self._cells is None else on_cells[..., self._cells]

    def _solved(self, solver: _GridSolver, K: Array) -> tuple[Array, NDArray[np.intp]]:
        """Coefficients (T, Nj, Ni) and steps (T,) for readings K (T, 3, n, m)."""
        A = solver.A
        if A is None:
            c = self._transforms.analysed(K, solver.scale)
            c *= solver.inverse
            return c, np.zeros(len(K), np.intp)
        weighted = np.where(A.weights > 0, K, 0)
        weighted *= A.weights
        size = np.abs(weighted).max(axis=(1, 2, 3), keepdims=True)
        size[size == 0] = 1  # squares of tiny or huge readings would leave the range of numbers
        weighted /= size
        found = _conjugate_gradients(A, weighted)
        if found is None:
            raise self._hardly(solver.count)
        return A.root * found[0] * size[:, 0], found[1]

    def _hardly(self, readings: int) -> RankDeficient:
        (Ni, Nj), total = self.basis.shape, 3 * len(self.layout)
        return RankDeficient(
            f"{self.layout} with {readings} readings barely determine some of the {self.unknowns} "
            f"coefficients of a {Ni} x {Nj} basis: for some shape their sensitivity is below "
            f"{self._least:.1g}, as {total - readings} of {total} readings are missing; use a "
            "smaller basis, more elements, least-squares, or a prior (bayes)"
        )

    def _fit(self, flat: Array, used: Mask) -> Fit:
        whole, frames = used is self.readable, flat.shape[:-1]
        solver = self._whole if whole else self._solvers(used, self._made)
        every = flat.reshape(-1, flat.shape[-1])
        parts = _parts(len(every), flat.shape[-1])
        solved = [self._solved(solver, self._on_grid(every[part])) for part in parts]
        c = _joined([c for c, _ in solved])
        steps = _joined([steps for _, steps in solved])
        spare = solver.count - self.unknowns
        c = c.reshape(*frames, *solver.inverse.shape).swapaxes(-1, -2)
        return self._answer(flat, c, solver.spread, spare, steps.reshape(frames))


def _sines(basis: Basis, layout: SensorLayout) -> SineBasis:
    """`basis` as sines on a flat skin; raises a `Refusal` for any other basis."""
    if not isinstance(basis, SineBasis):
        raise Refusal(
            f"expected sines (a hinged rectangle) for the fast transforms, got "
            f"{type(basis).__name__}; use least-squares"
        )
    if basis.patch.base_curvature:
        raise Refusal(
            f"expected a flat skin for the fast transforms, got a {basis.patch.name}: on a "
            "bent skin the functions are not orthogonal; use least-squares"
        )
    if basis.patch != layout.patch:
        raise Refusal(f"the layout is on {layout.patch}, the basis on {basis.patch}; use one")
    return basis
