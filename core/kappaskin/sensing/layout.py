"""Sensor layout: where the elements are, and the curvature that their gages read."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from kappaskin.bases import Basis, SineBasis, curvature_at, gauss
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask
from kappaskin.mechanics import Plate
from kappaskin.skin import Patch

_POINTS = 12  # exact to rounding for waves as short as the gage

# A gage along the unit vector e reads the mean of the normal curvature e'Ke over its length L. One
# lies along x and one along y. The twist is half of what two along the diagonals differ by, which
# in the limit of short ones is f_xy. Each alone mixes the modes: it sees sin(k x) sin(l y) as
# waves of k + l and of k - l. What they differ by does not: with h = L / sqrt(8) it is the twist
#     k l cos(k x) cos(l y)   times   (cos(k h) sinc(l h) + sinc(k h) cos(l h)) / 2.
_DIAGONAL = 1 / math.sqrt(2)


def gage_multipliers(sines: SineBasis, gage_length: float) -> Array:
    """Factors (3, Ni, Nj) by which gages of `gage_length` in m read sines on a flat skin.

    xx: sinc(k_i L / 2) and yy: sinc(k_j L / 2), with sinc(t) = sin(t) / t; xy as derived above.
    """
    ki, kj = np.meshgrid(*sines.wavenumbers, indexing="ij")
    L, h = gage_length, gage_length * _DIAGONAL / 2
    twist = np.cos(ki * h) * _sinc(kj * h) + _sinc(ki * h) * np.cos(kj * h)
    return np.stack([_sinc(ki * L / 2), _sinc(kj * L / 2), twist / 2])


def _sinc(t: Array) -> Array:
    return np.sinc(t / np.pi)


CurvatureAt = Callable[[Array], Array]
"""From positions (P, 2) in m to curvature xx, yy, xy (3, P, N) in 1/m per m of each function."""


def mean_curvature_at(
    basis: Basis, positions: Array, gage_length: float, curvature: CurvatureAt | None = None
) -> Array:
    """Mean curvature xx, yy, xy (3, P, N) in 1/m per m of each function along the gages.

    The middles of the gages, `gage_length` in m, are at `positions` (P, 2) in m. Without a length
    it is the `curvature` of the functions, unless given that of `curvature_at`.
    """
    curvature = curvature or partial(curvature_at, basis)
    if not gage_length:
        return curvature(positions)

    def along(x: float, y: float) -> Array:
        if basis.patch.base_curvature:
            return _over_points(curvature, positions, gage_length, x, y)
        return _between_ends(basis, positions, gage_length, x, y)

    rising, falling = along(_DIAGONAL, _DIAGONAL), along(_DIAGONAL, -_DIAGONAL)
    return np.stack([along(1.0, 0.0), along(0.0, 1.0), (rising - falling) / 2])


def _between_ends(basis: Basis, positions: Array, L: float, x: float, y: float) -> Array:
    """Mean curvature along (x, y), from the difference of slope between the ends of the gages.

    Exact also for functions whose curvature jumps between triangles.
    """
    half = L / 2 * np.array([x, y])

    def slope(places: Array) -> Array:
        return x * basis.at(places, 1, 0) + y * basis.at(places, 0, 1)

    return (slope(positions + half) - slope(positions - half)) / L


def _over_points(curvature: CurvatureAt, positions: Array, L: float, x: float, y: float) -> Array:
    """Mean curvature along (x, y) by quadrature: on a bent skin it is not only a derivative."""
    along, weights = gauss(L, _POINTS)
    steps = np.multiply.outer(along - L / 2, (x, y))
    xx, yy, xy = curvature((positions + steps[:, None]).reshape(-1, 2))
    normal = (x * x * xx + y * y * yy + 2 * x * y * xy).reshape(_POINTS, len(positions), -1)
    return np.einsum("q,qpn->pn", weights / L, normal)


_SHORTEST = 1e-6  # m: the mean over a shorter gage is lost in rounding
_ROUNDING = 1e-9  # of a depth: gages as long as the element distance end on the rim


def _channels(patch: Patch, elements: int) -> Mask:
    """The channels (3, P) that the patch has: all; on a strip, which bends along x only, xx."""
    live = np.ones((3, elements), bool)
    live[1:] = not patch.strip
    return live


@dataclass(frozen=True, eq=False)
class SensorLayout:
    """P elements at `positions` (P, 2) in m; each senses the curvature xx, yy and xy.

    `live` (3, P) is False for dead channels. `shape` is (m, n) for a regular grid, with element
    p + m q in column p (along x) and row q (along y), and None otherwise. Each element reads the
    mean over gages of `gage_length` in m along x, along y and along both diagonals.
    """

    patch: Patch
    positions: Array
    live: Mask
    shape: tuple[int, int] | None = None
    gage_length: float = 0.0

    def __post_init__(self) -> None:
        P = self.positions
        if P.ndim != 2 or P.shape[1] != 2 or len(P) == 0:
            raise Refusal(f"expected positions of shape (P, 2) with P >= 1, got {P.shape}")
        if self.live.shape != (3, len(P)):
            raise Refusal(f"expected live of shape (3, {len(P)}), got {self.live.shape}")
        if self.shape and self.shape[0] * self.shape[1] != len(P):
            raise Refusal(f"expected {self.shape[0]} x {self.shape[1]} elements, got {len(P)}")
        outside = np.flatnonzero(~self.patch.contains(P))  # NaN counts as outside
        if outside.size:
            p, (x, y) = int(outside[0]), P[outside[0]]
            raise Refusal(
                f"{outside.size} of {len(P)} elements lie outside the {self.patch.name}: element "
                f"{p} is at ({x:g}, {y:g}) m; positions are in metres from the corner x = y = 0"
            )
        self._check_gages()

    def _check_gages(self) -> None:
        L = self.gage_length
        if not L:
            return
        if not _SHORTEST <= L < math.inf:
            raise Refusal(f"expected a gage length of 0 m, or {_SHORTEST:g} m and more, got {L}")
        depth = self.patch.depth(self.positions)
        least = int(np.argmin(depth))
        if depth[least] * (1 + _ROUNDING) < L / 2:
            longest = 2 * depth[least]
            if float(f"{longest:.4g}") > longest * (1 + _ROUNDING):
                longest *= 1 - 5e-4  # which is rounded down to no more than it was
            raise Refusal(
                f"gages of {L:g} m go over the rim of the {self.patch.name}: element {least} is "
                f"{depth[least]:.4g} m inside; expected a gage length of at most "
                f"{longest:.4g} m"
            )

    @classmethod
    def regular(cls, patch: Patch, m: int, n: int) -> "SensorLayout":
        """Elements at the centres of an m x n tiling, without those off a disk or a polygon.

        A layout that lacks some has no `shape`.
        """
        x, y = patch.cell_centres(m, n)
        positions = np.column_stack([np.tile(x, n), np.repeat(y, m)])
        on = patch.contains(positions)
        shape = (m, n) if on.all() else None
        return cls(patch, positions[on], _channels(patch, int(on.sum())), shape)

    @classmethod
    def scattered(cls, patch: Patch, positions: ArrayLike) -> "SensorLayout":
        """Elements at `positions` (P, 2) in m, anywhere on the patch."""
        try:
            points = np.array(positions, float)
        except ValueError as error:
            raise Refusal(f"expected positions of shape (P, 2) in m, got {error}") from error
        if points.ndim != 2:
            raise Refusal(f"expected positions of shape (P, 2) in m, got {points.shape}")
        return cls(patch, points, _channels(patch, len(points)))

    def without(self, elements: Iterable[int]) -> "SensorLayout":
        """The same layout with all three channels of `elements` dead."""
        live = self.live.copy()
        dead = list(elements)
        if any(not 0 <= p < len(self) for p in dead):
            raise Refusal(f"expected dead elements between 0 and {len(self) - 1}, got {dead}")
        live[:, dead] = False
        return replace(self, live=live)

    @property
    def lacking(self) -> Mask:
        """The dead channels (3, P), of those that this patch has."""
        return _channels(self.patch, len(self)) & ~self.live

    def __len__(self) -> int:
        return len(self.positions)

    def __str__(self) -> str:
        return "{} x {} elements".format(*self.shape) if self.shape else f"{len(self)} elements"

    def curvature_operator(self, basis: Basis, plate: Plate | None = None) -> Array:
        """M (3 P, N): `M @ coefficients.ravel()` is curvature (3, P) flattened (Eqs. 2-5, 11).

        With a `plate`, that of its deflection under loads: a bent skin stretches under them.
        """
        if basis.patch != self.patch:
            raise Refusal(f"the layout is on {self.patch}, the basis on {basis.patch}; use one")
        curvature = plate.curvature(basis) if plate else None
        K = mean_curvature_at(basis, self.positions, self.gage_length, curvature)
        return K.reshape(3 * len(self), basis.size)


def slope_correction(slope_x: Array, slope_y: Array) -> Array:
    """The factor (..., 3, P) by which Eqs. 3-5 are too large on slopes (..., P) along x and y.

    With W^2 = 1 + f_x^2 + f_y^2 it is xx: W (1 + f_x^2), yy: W (1 + f_y^2),
    xy: W sqrt((1 + f_x^2) (1 + f_y^2)).
    """
    along_x, along_y = 1 + slope_x**2, 1 + slope_y**2
    W = np.sqrt(along_x + along_y - 1)
    times = np.empty((*W.shape[:-1], 3, W.shape[-1]), W.dtype)
    times[..., 0, :] = W * along_x
    times[..., 1, :] = W * along_y
    times[..., 2, :] = W * np.sqrt(along_x * along_y)
    return times


class NormalCurvature:
    """The map from coefficients to the true normal curvature of the surface along the gages.

    It is the first-order curvature (Eqs. 3-5) over the `slope_correction`. A gage of some length
    reads the mean of Eqs. 3-5 along it, at the slope in its middle.
    """

    def __init__(self, basis: Basis, layout: SensorLayout, dtype: DTypeLike = np.float64) -> None:
        if basis.patch.base_curvature:
            raise Refusal(
                f"expected a flat skin for finite slopes, got a {basis.patch.name}: on a bent one "
                "the tangential displacement matters as much as the slope; use least-squares"
            )
        places = layout.positions
        self._size = basis.size
        self._second = layout.curvature_operator(basis).T.astype(dtype)
        self._first = [basis.at(places, *order).T.astype(dtype) for order in ((1, 0), (0, 1))]

    def __call__(self, coefficients: Array) -> Array:
        """Curvature (..., 3, P) in 1/m for `coefficients` (..., Ni, Nj)."""
        flat = coefficients.reshape(*coefficients.shape[:-2], self._size)
        times = slope_correction(*(np.dot(flat, slope) for slope in self._first))
        return np.dot(flat, self._second).reshape(times.shape) / times
