"""A shape to the skin's surface in space: points, triangles, displacement and curvature."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from kappaskin.bases import Basis
from kappaskin.contact import surface_geometry
from kappaskin.frames import Array
from kappaskin.skin import snapped_to_rim

Triangles: TypeAlias = "NDArray[np.int64]"

_AT_ONCE = 2**20  # values of functions that are worked out at once


@dataclass(frozen=True, eq=False)
class Surface:
    """The skin: `points` (k, 3) in m with outward `normals`, and `triangles` (n, 3) of them.

    `displacement` (k,) in m, positive inward, `curvature` (k, 3) in 1/m, xx, yy and xy of the
    curvature form along x and across it.
    """

    points: Array
    normals: Array
    triangles: Triangles
    displacement: Array
    curvature: Array


class Skin:
    """The skin of a `basis` by nx x ny points of its rectangle, those beside its rim on that."""

    def __init__(self, basis: Basis, nx: int, ny: int) -> None:
        self._basis, patch = basis, basis.patch
        grid = np.stack(np.meshgrid(*patch.grid(nx, ny)), axis=-1)
        on = patch.contains(grid.reshape(-1, 2)).reshape(ny, nx)
        if not on.all():
            grid, _ = snapped_to_rim(patch, grid, on)
        corners = _triangles(on)
        self.triangles: Triangles
        used, self.triangles = np.unique(corners, return_inverse=True)
        self._positions = grid.reshape(-1, 2)[used]
        self._rest, self._out = patch.at_rest(self._positions)

    def __call__(self, coefficients: Array) -> Surface:
        """The surface with `coefficients` (Ni, Nj) in m."""
        step = max(_AT_ONCE // self._basis.size, 1)
        parts = [
            surface_geometry(self._basis, coefficients, self._positions[n : n + step], _no_error)
            for n in range(0, len(self._positions), step)
        ]
        points = np.concatenate([part.position for part in parts])
        K = np.concatenate([part.curvature_form for part in parts])
        displacement = np.einsum("pi,pi->p", self._rest - points, self._out)
        normals = np.concatenate([part.normal for part in parts])
        curvature = np.stack([K[:, 0, 0], K[:, 1, 1], K[:, 0, 1]], axis=-1)
        return Surface(points, normals, self.triangles, displacement, curvature)


def _no_error(rows: Array) -> Array:
    """The covariance (..., 6, 6) of the shape as it is given."""
    return np.zeros((*rows.shape[:-1], rows.shape[-2]))


def _triangles(on: NDArray[np.bool_]) -> Triangles:
    """Two for each square with a corner `on` the skin, turning left as seen from outside."""
    index = np.arange(on.size).reshape(on.shape)
    square = (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    corners = np.stack(square, axis=-1).reshape(-1, 4)
    corners = corners[on.ravel()[corners].any(axis=1)]
    return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
