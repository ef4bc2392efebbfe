"""An outline to triangles: of even size, smaller towards corners where curvature changes fast."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.skin import Outline, turn

_INWARD = 1 / 256  # of the spacing, at corners that point inward: curvature is unbounded there
_GROWTH = 1.0  # of the spacing per distance
_STRAIGHT = 1e-6  # rad: a corner that turns by less is none
_BLUNT = np.pi / 2 - 1e-6  # rad: one that turns by less than a right angle is blunt
_FREE = 0.6  # of the spacing: how near to the rim no point is put
_SMOOTHINGS = 5
_ROUNDS = 60

Triangles = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Mesh:
    """`points` (Q, 2), the first `rim` of them along the outline, and `triangles` (T, 3)."""

    points: Array
    triangles: Triangles
    rim: int


def meshed(line: Outline, spacing: float, blunt: float) -> Mesh:
    """Triangles with sides of about `spacing` inside an outline that touches x = 0 and y = 0.

    Towards corners wider than a right angle they are smaller, at those that point outward `blunt`
    of it. Points along the rim and inside it are joined by Delaunay's triangulation, where edges of
    the outline are missing from it they are halved, and the points inside are moved to the mean of
    their neighbours.
    """
    rim = _along_rim(line, spacing, blunt)
    inner = _inside(line, rim, spacing)
    smoothed = 0
    for _ in range(_ROUNDS):
        points = np.vstack([rim, inner])
        triangles = _joined(points)
        if (cut := _cut(triangles, len(rim))).size:
            middle = (rim[cut] + np.roll(rim, -1, axis=0)[cut]) / 2
            rim = np.insert(rim, cut + 1, middle, axis=0)
            continue
        triangles = triangles[line.depth(points[triangles].mean(axis=1)) > 0]
        if smoothed == _SMOOTHINGS:
            return Mesh(points, triangles, len(rim))
        inner, smoothed = _smoothed(line, points, triangles)[len(rim) :], smoothed + 1
    raise Refusal(
        f"an outline of {len(line.corners)} corners could not be divided into triangles; leave out "
        "its finest details"
    )


def _sizes(points: Array, around: Array, sizes: Array, most: float) -> Array:
    """The spacing (P,) wanted at `points`: what it is `around` and more with the distance."""
    distance = np.linalg.norm(points[:, None] - around, axis=-1)
    return (sizes + _GROWTH * distance).min(axis=1, initial=most)


def _along_rim(line: Outline, spacing: float, blunt: float) -> Array:
    """Points along the outline, its corners among them."""
    turns = line.turns
    wide = (turns < _BLUNT) & (np.abs(turns) > _STRAIGHT)
    corners, finest = line.corners[wide], spacing * np.where(turns < 0, _INWARD, blunt)[wide]
    share, parts = np.linspace(0, 1, 257), list[Array]()
    for start, along, length in zip(line.corners, line.along, line.lengths, strict=True):
        sizes = _sizes(start + share[:, None] * along, corners, finest, spacing)
        wanted = length / sizes
        steps = np.append(0.0, np.cumsum((wanted[1:] + wanted[:-1]) / 2)) / 256
        count = int(np.ceil(steps[-1] - 1e-9))
        at = np.asarray(np.interp(np.arange(count) / count * steps[-1], steps, share), float)
        parts.append(start + at[:, None] * along)
    return np.vstack(parts)


def _inside(line: Outline, rim: Array, spacing: float) -> Array:
    """Centres of squares that are quartered until they are as small as wanted."""
    sizes = np.linalg.norm(rim - np.roll(rim, 1, axis=0), axis=1)
    sizes = np.maximum(sizes, np.roll(sizes, -1))
    box, side = line.corners.max(axis=0), spacing
    nx, ny = (int(np.ceil(length / side)) for length in box)
    first = (box - np.array([nx - 1, ny - 1]) * side) / 2
    squares: Array = first + side * np.indices((nx, ny)).reshape(2, -1).T
    quarters, kept = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]]) / 4, list[Array]()
    while len(squares):
        wanted, far = _sizes(squares, rim, sizes, spacing), line.depth(squares)
        small = side <= 1.01 * wanted
        kept.append(squares[small & (far > _FREE * wanted)])
        squares = squares[~small & (far > -side)]
        squares = (squares[:, None] + side * quarters).reshape(-1, 2)
        side /= 2
    return np.vstack(kept)


def _joined(points: Array) -> Triangles:
    triangles = Delaunay(points).simplices.astype(np.intp)
    area = np.abs(turn(*np.moveaxis(points[triangles], 1, 0)))
    return triangles[area > 1e-9 * np.median(area)]  # none of points along one edge


def _cut(triangles: Triangles, rim: int) -> Triangles:
    """Which steps along the rim, each from its point to the next, are no side of a triangle."""
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    steps = np.sort(np.column_stack([np.arange(rim), (np.arange(rim) + 1) % rim]), axis=1)
    most = int(triangles.max()) + 1
    return np.flatnonzero(~np.isin(steps @ (most, 1), sides @ (most, 1)))


def _smoothed(line: Outline, points: Array, triangles: Triangles) -> Array:
    """Every point at the mean of its neighbours, unless that is much nearer to the rim."""
    total, count = np.zeros_like(points), np.zeros(len(points))
    for i in range(3):
        for j in ((i + 1) % 3, (i + 2) % 3):
            np.add.at(total, triangles[:, i], points[triangles[:, j]])
            np.add.at(count, triangles[:, i], 1)
    mean = total / np.maximum(count, 1)[:, None]
    kept = line.depth(mean) > 0.5 * line.depth(points)
    return np.where(kept[:, None], mean, points)
