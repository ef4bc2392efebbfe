"""Surfaces on the grid of a skin: interpolation, the rim, and distances along the skin."""

from dataclasses import dataclass

import numpy as np

from kappaskin.frames import Array, Indices, Mask
from kappaskin.skin.mesh import MeshSkin
from kappaskin.skin.patch import Patch

_HALVINGS = 24  # of a cell, until the rim is found


def snapped_to_rim(patch: Patch, grid: Array, on: Mask) -> tuple[Array, Indices]:
    """The `grid` (ny, nx, 2) in m with the points just outside the skin moved on to its rim.

    `on` (ny, nx) says which points lie on the skin. Also the number (ny nx,) of the point whose
    value each one shows: its own, or for a moved point that of its neighbour on the skin.
    """
    ny, nx = on.shape
    moved, shown = grid.copy(), np.arange(on.size).reshape(ny, nx)
    least = np.full(on.shape, np.inf)
    for dy, dx in ((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j):
        q, p = np.nonzero(~on)
        neighbour = (q + dy >= 0) & (q + dy < ny) & (p + dx >= 0) & (p + dx < nx)
        q, p = q[neighbour], p[neighbour]
        neighbour = on[q + dy, p + dx]
        q, p = q[neighbour], p[neighbour]
        inside, outside = grid[q + dy, p + dx], grid[q, p]
        for _ in range(_HALVINGS):
            middle = (inside + outside) / 2
            there = patch.contains(middle)[:, None]
            inside, outside = np.where(there, middle, inside), np.where(there, outside, middle)
        far = np.linalg.norm(inside - grid[q, p], axis=-1)
        near = far < least[q, p]
        q, p = q[near], p[near]
        least[q, p], moved[q, p] = far[near], inside[near]
        shown[q, p] = shown[q + dy, p + dx]
    return moved, shown.ravel()


class RestMesh:
    """The skin of `patch` at rest at nx x ny points; those outside its rim are moved onto it.

    Of a mesh at its nodes. At `positions` (k, 2) in m on the skin are the `points` (k, 3) in m in
    space with outward `normals`; the `triangles` (n, 3) of them turn left as seen from outside.
    """

    def __init__(self, patch: Patch, nx: int, ny: int) -> None:
        self.positions: Array
        self.triangles: Indices
        if isinstance(patch, MeshSkin):
            self.positions, self.triangles = patch.places, patch.triangles
        else:
            grid = np.stack(np.meshgrid(*patch.grid(nx, ny)), axis=-1)
            on = patch.contains(grid.reshape(-1, 2)).reshape(ny, nx)
            if not on.all():
                grid, _ = snapped_to_rim(patch, grid, on)
            used, self.triangles = np.unique(_triangles(on), return_inverse=True)
            self.positions = grid.reshape(-1, 2)[used]
        self.points, self.normals = patch.at_rest(self.positions)

    def displaced(self, displacement: Array) -> Array:
        """Where the points (k, 3) in m are when displaced by (k,) in m, positive inward."""
        return self.points - displacement[:, None] * self.normals


def _triangles(on: Mask) -> Indices:
    """Two for each square with a corner `on` the skin, turning left as seen from outside."""
    index = np.arange(on.size).reshape(on.shape)
    square = (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    corners = np.stack(square, axis=-1).reshape(-1, 4)
    inside = on.ravel()[corners]
    # The diagonal ends at a corner on the skin: three points of the rim would face anywhere.
    turned = ~inside[:, 0] & ~inside[:, 2]
    corners[turned] = np.roll(corners[turned], 1, axis=1)
    corners = corners[inside.any(axis=1)]
    return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])


_STEPS = 256  # of the line along the skin


@dataclass(frozen=True)
class Distances:
    """Distances between two points of a bent skin, in m.

    `straight` through the air, `along` the skin on the line that is straight in its own
    coordinates, and how much `higher` the second point is than the first.
    """

    straight: float
    along: float
    higher: float


def distances(patch: Patch, surface: Array, first: Array, second: Array) -> Distances:
    """Distances between `first` and `second` (2,) in m, with displacement `surface` (ny, nx)."""
    places = first + np.linspace(0.0, 1.0, _STEPS + 1)[:, None] * (second - first)
    rest, out = patch.at_rest(places)
    points = rest - out * interpolated(patch, surface, places)[:, None]
    whole = points[-1] - points[0]
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return Distances(float(np.linalg.norm(whole)), float(steps.sum()), float(whole[2]))


def interpolated(patch: Patch, values: Array, places: Array) -> Array:
    """`values` (ny, nx) on the grid of a patch, interpolated at `places` (P, 2) in m: (P,).

    Bilinear; NaN, as off the skin, counts as zero.
    """
    ny, nx = values.shape
    known = np.nan_to_num(values)
    p, q = np.clip(places / (patch.a, patch.b) * (nx - 1, ny - 1), 0, (nx - 1, ny - 1)).T
    i, j = np.minimum(p.astype(int), nx - 2), np.minimum(q.astype(int), ny - 2)
    low, high = (known[k, i] * (1 - p + i) + known[k, i + 1] * (p - i) for k in (j, j + 1))
    return low * (1 - q + j) + high * (q - j)
