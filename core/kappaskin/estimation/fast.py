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
from kappaskin.frames import Array, Indices, Mask
from kappaskin.sensing import SensorLayout

# Of a cell: an element so far off reads 3 parts in 10^9 wrong of the shortest wave, and positions
# that were computed otherwise, of a million cells along a side, are no farther off.
_OFF = 1e-9
_ALONG = 1e-8  # rad that a direction may be off x or y, by its rounding
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

    def gain(self, k: Array, order: int) -> Array:
        """Lengths (count,) of a derivative of the sampled sines of wave numbers k (count,)."""
        sines, cosines = self.lengths
        return (sines, k * cosines, -(k**2) * sines)[order]

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

    The elements are those of a `layout`, all of which read the same k quantities: channels.

    The sampled sines and cosines are orthogonal (DST-II and DCT-II), so that M c is one factor per
    function and channel, `gain` (k, Nj, Ni), and a fast transform per channel. Readings here are
    (..., k, n, m) and coefficients (..., Nj, Ni): x runs fastest.
    """

    def __init__(
        self, basis: SineBasis, layout: SensorLayout, m: int, n: int, dtype: DTypeLike = np.float64
    ) -> None:
        self.cells = (n, m)
        self._x = _GridSide(basis.Ni, m)
        self._y = _GridSide(basis.Nj, n, constant=basis.patch.strip)
        self._orders = [_derivative(*kind) for kind in layout.kinds]
        gain = [self._gain(basis, order) for order in self._orders]
        self.gain = (gain * layout.multipliers(basis).swapaxes(-1, -2)).astype(dtype)

    def _gain(self, basis: SineBasis, order: "_Derivative") -> Array:
        """Factors (Nj, Ni) of a derivative, of functions of unit length on the grid."""
        along = zip((self._y, self._x), basis.wavenumbers[::-1], order.orders[::-1], strict=True)
        return order.sign * np.multiply.outer(*(side.gain(k, times) for side, k, times in along))

    def analysed(self, K: Array, scale: Array) -> Array:
        """M^T K (..., Nj, Ni), each channel times its `scale` (k,); one with zero is skipped."""
        total: Array | None = None
        for channel in np.flatnonzero(scale):
            in_x, in_y = self._orders[channel].cosines
            along_y = self._y.analysed(K[..., channel, :, :], -2, in_y)
            parts = self._x.analysed(along_y, -1, in_x, spend=True)
            Nj, Ni = parts.shape[-2:]  # at i = m and j = n the cosines have no part
            parts *= self.gain[channel, :Nj, :Ni]
            if scale[channel] != 1:
                parts *= float(scale[channel])
            if total is None and (Nj, Ni) == self.gain.shape[1:]:
                total = parts
                continue
            if total is None:
                total = np.zeros((*K.shape[:-3], *self.gain.shape[1:]), self.gain.dtype)
            total[..., :Nj, :Ni] += parts
        if total is None:
            return np.zeros((*K.shape[:-3], *self.gain.shape[1:]), self.gain.dtype)
        return total

    def readings(self, c: Array) -> Array:
        """M c (..., k, n, m)."""
        (n, m), k = self.cells, len(self.gain)
        K = np.zeros((*c.shape[:-2], k, n, m), self.gain.dtype)
        for channel in np.flatnonzero(self.gain.any(axis=(1, 2))):
            in_x, in_y = self._orders[channel].cosines
            parts = (self.gain[channel] * c)[..., : n - in_y, : m - in_x]
            along_x = self._x.summed(parts, -1, in_x)
            K[..., channel, :, :] = self._y.summed(along_x, -2, in_y)
        return K


@dataclass(frozen=True)
class _Derivative:
    """A derivative of the displacement: its orders along x and y, times a `sign`."""

    orders: tuple[int, int]
    sign: float = 1.0

    @property
    def cosines(self) -> tuple[bool, bool]:
        """Whether sines become cosines by it, along x and along y."""
        return self.orders[0] == 1, self.orders[1] == 1


def _derivative(quantity: str, direction: float) -> _Derivative:
    """What a reading is; raises a `Refusal` for a sum of derivatives, which is not orthogonal."""
    if quantity in ("height", "twist"):
        return _Derivative((0, 0) if quantity == "height" else (1, 1))
    quarter = round(direction / (math.pi / 2))
    if abs(direction - quarter * math.pi / 2) > _ALONG:
        raise Refusal(
            f"expected slopes and curvatures along x or y for the fast transforms, got {quantity} "
            f"at {math.degrees(direction):g} degrees; use least-squares"
        )
    order = 1 if quantity == "slope" else 2
    sign = -1.0 if quantity == "slope" and quarter in (2, 3) else 1.0
    return _Derivative((0, order) if quarter % 2 else (order, 0), sign)


@dataclass(frozen=True, eq=False)
class ScaledOperator:
    """A = w M D^-1/2 on the grid, whose columns have about unit length.

    `weights` (k, n, m) or (k, 1, 1) are w, zero where there is no reading, and `root` (Nj, Ni) is
    D^-1/2 for a D that is exact when in each channel all weigh the same: then A^T A = 1.
    """

    transforms: Transforms
    weights: Array
    root: Array

    def forward(self, g: Array) -> Array:
        """A g (..., k, n, m) for g (..., Nj, Ni)."""
        read = self.transforms.readings(self.root * g)
        read *= self.weights
        return read

    def back(self, K: Array) -> Array:
        """A^T K (..., Nj, Ni) for K (..., k, n, m)."""
        return self.root * self.transforms.analysed(self.weights * K, np.ones(len(self.weights)))


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


def _places(layout: SensorLayout, count: int, cells: NDArray[np.intp] | None) -> Indices | None:
    """The place of each reading among those of `count` cells, channel after channel.

    None where they are in order; `cells` (P,) are those of the elements, None for 0, 1, 2, ...
    """
    element = layout.element if cells is None else cells[layout.element]
    places = count * layout.kind + element
    total = count * len(layout.kinds)
    if len(places) == total and np.array_equal(places, np.arange(total)):
        return None
    if len(np.unique(places)) < len(places):
        raise Refusal(
            "expected each element to read a quantity once for the fast transforms, got some "
            "twice; use least-squares"
        )
    return places


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
    """The least-squares g (T, Nj, Ni) of A g = K (T, k, n, m) and steps (T,); None without an end.

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
        usual = np.array(usual).reshape(-1, 1, 1)
        root = 1 / np.sqrt(np.sum((usual * transforms.gain) ** 2, axis=0))
        self._A = ScaledOperator(transforms, usual, root)
        share = np.divide(weights, usual, where=usual > 0, out=np.ones(weights.shape))
        self._other = np.flatnonzero(share != 1)
        self._E = 1 - share.ravel()[self._other] ** 2
        self._whole = (len(weights), *transforms.cells)
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
    D = M^T M is diagonal: a fast transform of each component and a division give the shape exactly,
    also when whole components are dead or have another weight. Components are xx, yy and xy, or the
    heights, and the slopes along x and along y. With single dead elements, missing readings
    or individual weights, conjugate gradients in the unknowns D^1/2 c need a few steps
    (`Fit.steps`). M is never made. Elements may come in any order (`grid_cells`).

    Raises `RankDeficient` when the readings do not determine the coefficients, or hardly.
    """

    has_matrix = False

    def _set_up(self) -> None:
        sines, layout = _sines(self.basis, self.layout), self.layout
        m, n, cells = grid_cells(layout)
        self._places = _places(layout, m * n, cells)
        if sines.Ni > m or sines.Nj > n:
            raise Refusal(
                f"expected at most {m} x {n} functions for the fast transforms of {layout}, got "
                f"{sines.Ni} x {sines.Nj}; use fewer, or least-squares"
            )
        self._exact = Transforms(sines, layout, m, n)
        exactly = self.dtype == np.float64
        self._transforms = self._exact if exactly else Transforms(sines, layout, m, n, self.dtype)
        self._least = math.sqrt(np.finfo(self.dtype).eps)  # half of the digits are left
        self._solvers = PatternCache[_GridSolver]()
        self._whole = self._made(self.readable)

    def _on_grid(self, flat: Array) -> Array:
        """Readings (T, R) as (T, k, n, m); zero where an element was left out."""
        (n, m), k = self._exact.cells, len(self._exact.gain)
        if self._places is None:
            return flat.reshape(-1, k, n, m)
        K = np.zeros((len(flat), k * n * m), flat.dtype)
        K[:, self._places] = flat
        return K.reshape(-1, k, n, m)

    def _made(self, used: Mask) -> _GridSolver:
        count, gain = int(used.sum()), self._exact.gain
        if count < self.unknowns:
            raise self.refusal(count, count, used)
        w = self._on_grid(np.where(used, self.weight, 0.0)[None])[0]
        if even := bool(np.all(w == w[:, :1, :1])):
            w = w[:, :1, :1].copy()
        scale = _squares(w, 2) / w[0].size
        D = np.einsum("c,cji,cji->ji", scale, gain, gain)
        if not np.all(D > 0):
            raise self.refusal(count, int(np.count_nonzero(D > 0)), used)
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
        frames, places = coefficients.shape[:-2], self._places
        c = coefficients.reshape(-1, *self.basis.shape).swapaxes(-1, -2)
        parts = _parts(len(c), self.layout.channels)
        K = _joined([self._transforms.readings(c[part]) for part in parts])
        flat = K.reshape(len(c), math.prod(K.shape[1:]))
        read = flat if places is None else flat[:, places]
        return read.reshape(*frames, *self.frame_shape)

    def _solved(self, solver: _GridSolver, K: Array) -> tuple[Array, NDArray[np.intp]]:
        """Coefficients (T, Nj, Ni) and steps (T,) for readings K (T, k, n, m)."""
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
        (Ni, Nj), total = self.basis.shape, self.layout.channels
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
    """`basis` as sines on no cylinder skin; raises a `Refusal` for any other basis."""
    if not isinstance(basis, SineBasis):
        raise Refusal(
            f"expected sines (a hinged rectangle) for the fast transforms, got "
            f"{type(basis).__name__}; use least-squares"
        )
    if basis.patch.arc_curvature:
        raise Refusal(
            f"expected a flat skin or a shallow one for the fast transforms, got a "
            f"{basis.patch.name}: on an arc the functions are not orthogonal; use least-squares"
        )
    if basis.patch != layout.patch:
        raise Refusal(f"the layout is on {layout.patch}, the basis on {basis.patch}; use one")
    return basis
