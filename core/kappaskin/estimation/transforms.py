"""The curvature operator of sines on a regular grid, as fast transforms instead of a matrix."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import DTypeLike, NDArray

from kappaskin.bases import SineBasis, multipliers
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.sensing import SensorLayout

# Of a cell: an element so far off reads 3 parts in 10^9 wrong of the shortest wave, and positions
# that were computed otherwise, of a million cells along a side, are no farther off.
_OFF = 1e-9
_FEW = 0.5  # of the cells of a grid must have elements


@dataclass(frozen=True)
class _Side:
    """The first `count` sines along one side at the centres of its `cells`, and their cosines.

    `constant` along the width of a strip: one function, alike everywhere.
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
        """Components of `K` along the unit sines or cosines; a last cosine of none is left out.

        They take the place of `K` when it may be spent.
        """
        # Slow to import, and only needed here.
        from scipy.fft import dct, dst

        transform = dct if cosines or self.constant else dst
        parts: Array = transform(K, 2, axis=axis, norm="ortho", overwrite_x=spend)
        kept = slice(int(cosines), int(cosines) + self.count)
        return parts[..., kept] if axis == -1 else parts[..., kept, :]

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

    Their gages are `gage_length` in m long.

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
        self._x = _Side(basis.Ni, m)
        self._y = _Side(basis.Nj, n, constant=basis.patch.strip)
        (ki, kj), (sx, cx), (sy, cy) = basis.wavenumbers, self._x.lengths, self._y.lengths
        xx, yy = np.outer(sy, -(ki**2) * sx), np.outer(-(kj**2) * sy, sx)
        at_points = np.stack([xx, yy, np.outer(kj * cy, ki * cx)])
        self.gain = (at_points * multipliers(basis, gage_length).swapaxes(-1, -2)).astype(dtype)

    def analysed(self, K: Array, scale: Array) -> Array:
        """M^T K (..., Nj, Ni), each channel times its `scale` (3,); one with none is not read."""
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
class Scaled:
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


def cells_of(layout: SensorLayout) -> tuple[int, int, NDArray[np.intp] | None]:
    """The m x n grid that the elements stand on, and the cell p + m q of each (P,).

    The cells are None when they are 0, 1, 2, ... Elements may come in any order and some may be
    left out, but none of the first column and row all together.
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
            f"most, got {layout} that stand otherwise; use least-squares"
        )
    in_order = len(P) == m * n and bool(np.all(cells == np.arange(m * n)))
    return m, n, None if in_order else cells
