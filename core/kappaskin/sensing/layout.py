"""Sensor layout: where the elements are, and the curvature that their gages read."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from kappaskin.bases import Basis, SineBasis, curvature_at, gauss, hoop_at
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Indices, Mask
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

    @property
    def frame_shape(self) -> tuple[int, ...]:
        """The shape of the readings of a frame: (3, P)."""
        return self.live.shape

    @property
    def channels(self) -> int:
        """The number R of readings of a frame."""
        return self.live.size

    @property
    def element(self) -> Indices:
        """The element (R,) of each reading."""
        return np.tile(np.arange(len(self)), 3)

    @property
    def kind(self) -> Indices:
        """What each reading (R,) is of its element, as a number: xx, yy, xy."""
        return np.repeat(np.arange(3), len(self))

    def operator(self, basis: Basis, plate: Plate | None = None) -> Array:
        """M (R, N): `M @ coefficients.ravel()` is a frame's readings, flattened (Eqs. 2-5, 11).

        With a `plate`, that of its deflection under loads: a bent skin stretches under them.
        """
        if basis.patch != self.patch:
            raise Refusal(f"the layout is on {self.patch}, the basis on {basis.patch}; use one")
        curvature = plate.curvature(basis) if plate else None
        K = mean_curvature_at(basis, self.positions, self.gage_length, curvature)
        return K.reshape(self.channels, basis.size)


# The deflected skin is r = r0 - f n0 + v t. r0 is the skin at rest, of curvature H along x, t and e
# are unit vectors along x and y, n0 the outward normal; f is the displacement inward, and v the one
# along the arc that the curvature of first order has: none on a flat skin. With the slopes
# p = f_x + H v and q = f_y and with w = v_y, the derivatives of r along t, e and n0 are
#     r_x = (1, 0, -p)     r_xx = (-H p, 0, -H - p_x)     r_xy = (0, 0, -p_y)
#     r_y = (w, 1, -q)     r_yy = (w_y, 0, -q_y)          r_x x r_y = (p, q - p w, 1) = W n.
# p_x, q_y and p_y are xx, yy and xy of first order. Gages along y have turned to r_y. So have gages
# along x, as the skin is not sheared: they lie along d = r_x - w r_y. With the metric I, the scalar
# products of d and r_y, and the second form II_ij = -n . r_ij of the same vectors the readings are
#     xx: II_dd / I_dd - H      yy: II_yy / I_yy      xy: (II_dy - H I_dy / 2) / sqrt(I_dd I_yy).
# Of first order they are that one; that the arc is hardly stretched, v_x = H f, is taken for
# granted. On a flat skin W^2 = 1 + p^2 + q^2, and they are
#     f_xx / (W (1 + p^2))      f_yy / (W (1 + q^2))      f_xy / (W sqrt((1 + p^2) (1 + q^2))).
_XX, _YY, _XY = range(3)
_EACH = [_XX, _YY, _XY]
_IN_X, _IN_Y = np.array([[[1.0], [0.0], [0.5]], [[0.0], [1.0], [0.5]]])
"""Powers of 1/I_dd and of 1/I_yy in the readings, (3, 1)."""


class DeflectedSurface:
    """The deflected surface at P elements, from its `jet` (Q, ..., P).

    That is p_x, q_y, p_y, p and q as derived above; on a skin of `base_curvature` H in 1/m, also w
    and w_y.
    """

    def __init__(self, jet: Array, base_curvature: float) -> None:
        self._jet, self._H = jet, base_curvature
        first, p, q = jet[:3], jet[3], jet[4]
        lengths = np.empty_like(first)  # I_dd, I_yy and the root of their product
        lengths[_YY] = 1 + q * q
        if base_curvature:
            w = jet[5]
            lengths[_XX] = 1 + (p - w * q) ** 2 + w * w * (w * w - 1)
            lengths[_YY] += w * w
            self._area: Array = np.sqrt(1 + p * p + (q - p * w) ** 2)  # W
        else:
            lengths[_XX] = 1 + p * p
            self._area = np.sqrt(lengths[_XX] + q * q)
        np.sqrt(lengths[_XX] * lengths[_YY], out=lengths[_XY])
        self._lengths, self._scale = lengths, 1 / (self._area * lengths)
        self._second = self._scale * (self._second_form() if base_curvature else first)

    def _second_form(self) -> Array:
        """W times II_dd, II_yy and II_dy, of a bent skin."""
        px, qy, py, p, _, w, wy = self._jet
        yy = qy - p * wy
        return np.stack([self._H * (1 + p * p) + px - w * (2 * py - w * yy), yy, py - w * yy])

    @property
    def readings(self) -> Array:
        """What the gages read, (3, ..., P) in 1/m."""
        if not self._H:
            return self._second
        readings = self._ratios()
        readings[_XX] -= self._H
        return readings

    def _ratios(self) -> Array:
        """The readings plus, along x of a bent skin, H."""
        if not self._H:
            return self._second
        p, q, w = self._jet[3:6]
        ratios = self._second.copy()
        ratios[_XY] -= self._H / 2 * (p * q - w * (w * w + q * q)) / self._lengths[_XY]
        return ratios

    @property
    def slope(self) -> Array:
        """The slope (..., P) along the steepest direction."""
        return np.hypot(self._jet[3], self._jet[4])

    def jacobian(self) -> Array:
        """How the readings of one frame change with its jet, (3, Q, P)."""
        jet, second, ratios = self._jet, self._second, self._ratios()
        in_x, in_y = ratios * (_IN_X / self._lengths[_XX]), ratios * (_IN_Y / self._lengths[_YY])
        if self._H:
            found, rates = self._of_second_form() * self._scale[:, None], self._rates()
            found[_XY, 3:6] -= self._of_shear()
        else:
            found, (p, q) = np.zeros((3, *jet.shape), jet.dtype), jet[3:]
            found[_EACH, _EACH] = self._scale
            rates = [(p, 2 * p, 0.0), (q, 0.0, 2 * q)]
        second = second / self._area**2
        for column, (area, along_x, along_y) in enumerate(rates, 3):
            found[:, column] -= second * area + in_x * along_x + in_y * along_y
        return found

    def _rates(self) -> list[tuple[Array, Array, Array | float]]:
        """How W^2 / 2, I_dd and I_yy change with p, with q and with w."""
        p, q, w = self._jet[3:6]
        m, e = q - p * w, p - w * q
        return [
            (p - w * m, 2 * e, 0.0),
            (m, -2 * w * e, 2 * q),
            (-p * m, 4 * w**3 - 2 * w - 2 * q * e, 2 * w),
        ]

    def _of_second_form(self) -> Array:
        """How W times II_dd, II_yy and II_dy change with the jet, (3, Q, P)."""
        _, qy, py, p, _, w, wy = self._jet
        yy, found = qy - p * wy, np.zeros((3, *self._jet.shape), self._jet.dtype)
        found[_EACH, _EACH], found[_YY, 3], found[_YY, 6] = 1.0, -wy, -p
        found[_XY, 1], found[_XY, 3], found[_XY, 5], found[_XY, 6] = -w, w * wy, -yy, w * p
        found[_XX, 1], found[_XX, 2], found[_XX, 3] = w * w, -2 * w, 2 * self._H * p - w * w * wy
        found[_XX, 5], found[_XX, 6] = 2 * (w * yy - py), -w * w * p
        return found

    def _of_shear(self) -> Array:
        """How H I_dy / 2, over the lengths, changes with p, q and w, (3, P)."""
        p, q, w = self._jet[3:6]
        rates = np.stack([q, p - 2 * w * q, -3 * w * w - q * q])
        return self._H / 2 * rates / self._lengths[_XY]


class NormalCurvature:
    """The map from coefficients to the true normal curvature of the surface along the gages.

    A gage of some length reads the mean of the curvature of first order along it, at the slope in
    its middle. With a `plate` the shapes are those of its deflection under loads.
    """

    def __init__(
        self,
        basis: Basis,
        layout: SensorLayout,
        dtype: DTypeLike = np.float64,
        plate: Plate | None = None,
    ) -> None:
        places, H = layout.positions, basis.patch.base_curvature
        maps = [*layout.operator(basis, plate).reshape(3, len(layout), basis.size)]
        maps += [basis.at(places, 1, 0), basis.at(places, 0, 1)]
        if H:
            v, *turns = plate.hoop(basis, places) if plate else hoop_at(basis, places)
            maps[3] = maps[3] + H * v
            maps += turns
        self.maps = np.stack(maps).astype(dtype)
        """From coefficients to the jet of a `DeflectedSurface`, (Q, P, N)."""
        self._columns, self._H = self.maps.reshape(-1, basis.size).T, H

    def surface(self, flat: Array) -> DeflectedSurface:
        """The surface at the elements, for flattened coefficients (..., N)."""
        jet = np.dot(flat, self._columns).reshape(*flat.shape[:-1], *self.maps.shape[:2])
        return DeflectedSurface(np.moveaxis(jet, -2, 0), self._H)

    def __call__(self, coefficients: Array) -> Array:
        """Curvature (..., 3, P) in 1/m for `coefficients` (..., Ni, Nj)."""
        flat = coefficients.reshape(*coefficients.shape[:-2], self.maps.shape[2])
        return np.moveaxis(self.surface(flat).readings, 0, -2)
