"""Outlines: the corners and edges of a polygonal skin, and distances from them."""

import math

import numpy as np
from numpy.typing import ArrayLike

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask

_MOST_CORNERS = 256
_CLOSEST = 2e-3  # of the longer side: between a corner and an edge that it is no end of
_SHARPEST = math.radians(10)


class Outline:
    """A closed line through `corners` (V, 2), counter-clockwise; edge v runs to the next corner."""

    def __init__(self, corners: Array) -> None:
        self.corners, self.ends = corners, np.roll(corners, -1, axis=0)
        self.along: Array = self.ends - corners
        """The edges (V, 2) in m as vectors; their `lengths` (V,) in m."""
        self.lengths: Array = np.sqrt(np.sum(self.along**2, axis=1))
        level = np.where(self.along[:, 1] == 0, 1.0, self.along[:, 1])
        self._leaning = self.along[:, 0] / level

    @property
    def normals(self) -> Array:
        """Unit normals (V, 2) of the edges, inward."""
        return self.along[:, ::-1] * (-1, 1) / self.lengths[:, None]

    @property
    def turns(self) -> Array:
        """Turning angle (V,) in rad at each corner, positive where the outline is convex."""
        before = np.roll(self.along, 1, axis=0)
        onward = np.sum(before * self.along, axis=1)
        return np.angle(onward + 1j * doubled_area(self.corners - before, self.corners, self.ends))

    @property
    def area(self) -> float:
        return float(np.sum(doubled_area(np.zeros(2), self.corners, self.ends))) / 2

    def feet(self, positions: Array, short: float = 0.0) -> Array:
        """The nearest point (P, V, 2) of each edge to each of `positions` (P, 2), all in m.

        The share `short` of an edge at either end is left out.
        """
        offset = positions[:, None] - self.corners
        share = (offset * self.along).sum(axis=-1) / self.lengths**2
        share = np.minimum(np.maximum(share, short), 1 - short)
        return self.corners + share[..., None] * self.along

    def inside(self, positions: Array) -> Mask:
        """Which of `positions` (P, 2) a ray towards +x leaves through an odd number of edges."""
        x, y = positions[:, :1], positions[:, 1:]
        (x0, y0), y1 = self.corners.T, self.ends[:, 1]
        passed = ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) * self._leaning)
        return np.count_nonzero(passed, axis=1) % 2 == 1

    def depth(self, positions: Array) -> Array:
        """Distance (P,) in m of `positions` (P, 2) from the outline, negative outside."""
        away = positions[:, None] - self.feet(positions)
        distance: Array = np.sqrt((away**2).sum(axis=-1).min(axis=1))
        return np.where(self.inside(positions), distance, -distance)


def doubled_area(a: Array, b: Array, c: Array) -> Array:
    """Twice the signed area of the triangles a, b, c (..., 2): positive when counter-clockwise."""
    u, v = b - a, c - a
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def checked_corners(vertices: ArrayLike) -> Array:
    """The corners (V, 2) in m, counter-clockwise; raises a `Refusal` for no valid outline."""
    try:
        corners = np.array(vertices, float)
    except (ValueError, TypeError, OverflowError) as error:
        raise Refusal(f"expected vertices of shape (V, 2) in m, got {error}") from error
    if corners.ndim != 2 or corners.shape[1] != 2 or not 3 <= len(corners) <= _MOST_CORNERS:
        raise Refusal(
            f"expected vertices of shape (V, 2) in m, V from 3 to {_MOST_CORNERS}, got "
            f"{corners.shape}"
        )
    if not np.isfinite(corners).all():
        raise Refusal("expected finite vertices in m, got NaN or infinity")
    if (low := corners.min(axis=0)).any():
        raise Refusal(
            f"expected an outline whose lowest x and y are 0, got {low[0]:g} and {low[1]:g} m; "
            "subtract them from the vertices and from the positions on the skin"
        )
    if not corners.max(axis=0).all():
        raise Refusal("expected an outline that encloses an area, got vertices on one line")
    shape = Outline(corners / corners.max())
    with np.errstate(invalid="ignore"):  # edges of no length, refused next
        _check_crossings(shape)
    _check_distances(shape)
    _check_corners(shape)
    return corners if shape.area > 0 else np.roll(corners[::-1], 1, axis=0)


def _check_crossings(line: Outline) -> None:
    a, b, c, d = line.corners[:, None], line.ends[:, None], line.corners[None], line.ends[None]
    crossed = (doubled_area(a, b, c) * doubled_area(a, b, d) < 0) & (
        doubled_area(c, d, a) * doubled_area(c, d, b) < 0
    )
    if crossed.any():
        i, j = np.argwhere(crossed)[0]
        raise Refusal(f"edges {i} and {j} of the outline cross; give its corners in order")


def _check_distances(line: Outline) -> None:
    V, limit = len(line.corners), f"a {1 / _CLOSEST:.0f}th of the longer side"
    if (short := line.lengths < _CLOSEST).any():
        i = int(np.argmax(short))
        raise Refusal(
            f"vertices {i} and {(i + 1) % V} of the outline are the same or nearer than {limit}; "
            "leave one out (the last need not repeat the first)"
        )
    gap = np.linalg.norm(line.corners[:, None] - line.feet(line.corners), axis=-1)
    own = np.arange(V)
    gap[own, own] = gap[own, own - 1] = np.inf
    if (near := gap < _CLOSEST).any():
        i, j = np.argwhere(near)[0]
        raise Refusal(
            f"vertex {i} of the outline is on its edge {j} or nearer than {limit}; expected an "
            "outline that does not touch itself"
        )


def _check_corners(line: Outline) -> None:
    sharp = np.abs(line.turns) > math.pi - _SHARPEST
    if sharp.any():
        raise Refusal(
            f"the corner at vertex {int(np.argmax(sharp))} of the outline is sharper than "
            f"{math.degrees(_SHARPEST):.0f} degrees; blunt it with one more vertex"
        )
