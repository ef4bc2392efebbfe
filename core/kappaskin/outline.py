"""The corners of a polygon: checked, and where points lie from its edges."""

import math

import numpy as np
from numpy.typing import ArrayLike

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask

_MOST_CORNERS = 256
_CLOSEST = 2e-3  # of the longer side: between a corner and an edge that it is no end of
_SHARPEST = math.radians(10)


def feet(corners: Array, positions: Array, short: float = 0.0) -> Array:
    """The point (P, V, 2) of every edge, that share `short` of its ends, nearest to each position.

    Edge v runs from corner v of `corners` (V, 2) to the next.
    """
    along = np.roll(corners, -1, axis=0) - corners
    share = np.sum((positions[:, None] - corners) * along, axis=-1) / np.sum(along**2, axis=-1)
    return corners + np.clip(share, short, 1 - short)[..., None] * along


def inside(corners: Array, positions: Array) -> Mask:
    """Which of `positions` (P, 2) a ray towards +x leaves through an odd number of edges."""
    (x0, y0), (x1, y1) = corners.T, np.roll(corners, -1, axis=0).T
    x, y = positions[:, :1], positions[:, 1:]
    height = np.where(y1 == y0, 1.0, y1 - y0)
    passed = ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) / height * (x1 - x0))
    return np.sum(passed, axis=1) % 2 == 1


def depth(corners: Array, positions: Array) -> Array:
    """Distance (P,) of `positions` (P, 2) from the outline, below zero outside."""
    with np.errstate(all="ignore"):  # of points that are not finite
        away: Array = np.linalg.norm(positions[:, None] - feet(corners, positions), axis=-1)
        away = away.min(axis=1)
        return np.where(inside(corners, positions), away, -away)


def turning(corners: Array) -> Array:
    """The angle (V,) in rad that the outline turns by at each corner, to the left above zero."""
    before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    along = np.sum((corners - before) * (after - corners), axis=1)
    return np.angle(along + 1j * turn(before, corners, after))


def inward_normals(corners: Array) -> Array:
    """Unit normals (V, 2) of the edges of counter-clockwise `corners`."""
    along = np.roll(corners, -1, axis=0) - corners
    return along[:, ::-1] * (-1, 1) / np.linalg.norm(along, axis=1)[:, None]


def turn(a: Array, b: Array, c: Array) -> Array:
    """Twice the area of the triangles a, b, c (..., 2): above zero when counter-clockwise."""
    u, v = b - a, c - a
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def checked(vertices: ArrayLike) -> Array:
    """The corners (V, 2) in m, counter-clockwise; refuses what is not the outline of a skin."""
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
    shape = corners / corners.max()
    for check in (_check_crossings, _check_distances, _check_corners):
        check(shape)
    area = np.sum(turn(np.zeros(2), shape, np.roll(shape, -1, axis=0)))
    return corners if area > 0 else np.roll(corners[::-1], 1, axis=0)


def _check_crossings(corners: Array) -> None:
    ends = np.roll(corners, -1, axis=0)
    a, b, c, d = corners[:, None], ends[:, None], corners[None], ends[None]
    crossed = (turn(a, b, c) * turn(a, b, d) < 0) & (turn(c, d, a) * turn(c, d, b) < 0)
    if crossed.any():
        i, j = np.argwhere(crossed)[0]
        raise Refusal(f"edges {i} and {j} of the outline cross; give its corners in order")


def _check_distances(corners: Array) -> None:
    V, limit = len(corners), f"a {1 / _CLOSEST:.0f}th of the longer side"
    short = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1) < _CLOSEST
    if short.any():
        i = int(np.argmax(short))
        raise Refusal(
            f"vertices {i} and {(i + 1) % V} of the outline are the same or nearer than {limit}; "
            "leave one out (the last need not repeat the first)"
        )
    gap = np.linalg.norm(corners[:, None] - feet(corners, corners), axis=-1)
    own = np.arange(V)
    gap[own, own] = gap[own, own - 1] = np.inf
    if (near := gap < _CLOSEST).any():
        i, j = np.argwhere(near)[0]
        raise Refusal(
            f"vertex {i} of the outline is on its edge {j} or nearer than {limit}; expected an "
            "outline that does not touch itself"
        )


def _check_corners(corners: Array) -> None:
    sharp = np.abs(turning(corners)) > math.pi - _SHARPEST
    if sharp.any():
        raise Refusal(
            f"the corner at vertex {int(np.argmax(sharp))} of the outline is sharper than "
            f"{math.degrees(_SHARPEST):.0f} degrees; blunt it with one more vertex"
        )
