"""Finite elements: a triangle mesh, Argyris' quintic elements, and modes of polygonal plates."""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, cast

import numpy as np
from scipy.sparse import block_diag, coo_array, csc_array, diags_array, eye_array
from scipy.sparse.linalg import eigsh
from scipy.spatial import Delaunay, KDTree
from scipy.special import perm

from kappaskin._files import cached
from kappaskin.bases.basis import ORDERS, Order
from kappaskin.bases.product import gauss
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Indices
from kappaskin.skin import Outline, doubled_area

_INWARD = 1 / 256  # of the spacing, at corners that point inward: curvature is unbounded there
_GROWTH = 1.0  # of the spacing per distance
_STRAIGHT = 1e-6  # rad: a corner that turns by less is none
_BLUNT = np.pi / 2 - 1e-6  # rad: one that turns by less than a right angle is blunt
_FREE = 0.6  # of the spacing: how near to the rim no point is put
_SMOOTHINGS = 5
_ROUNDS = 60


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """`points` (Q, 2), the first `rim` of them along the outline, and `triangles` (T, 3)."""

    points: Array
    triangles: Indices
    rim: int


def triangulated(line: Outline, spacing: float, blunt: float) -> TriangleMesh:
    """A mesh of triangles with sides of about `spacing` inside an outline.

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
            return TriangleMesh(points, triangles, len(rim))
        inner, smoothed = _smoothed(line, points, triangles)[len(rim) :], smoothed + 1
    raise Refusal(
        f"an outline of {len(line.corners)} corners could not be divided into triangles; remove "
        "its finest details"
    )


def _sizes(points: Array, around: Array, sizes: Array, most: float) -> Array:
    """The spacing (P,) wanted at `points`: `sizes` at those `around`, growing with distance."""
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
        target = length / sizes
        steps = np.append(0.0, np.cumsum((target[1:] + target[:-1]) / 2)) / 256
        count = int(np.ceil(steps[-1] - 1e-9))
        at = np.asarray(np.interp(np.arange(count) / count * steps[-1], steps, share), float)
        parts.append(start + at[:, None] * along)
    return np.vstack(parts)


def _inside(line: Outline, rim: Array, spacing: float) -> Array:
    """Centres of squares that are quartered until they are as small as the desired spacing."""
    sizes = np.linalg.norm(rim - np.roll(rim, 1, axis=0), axis=1)
    sizes = np.maximum(sizes, np.roll(sizes, -1))
    box, side = line.corners.max(axis=0), spacing
    nx, ny = (int(np.ceil(length / side)) for length in box)
    first = (box - np.array([nx - 1, ny - 1]) * side) / 2
    squares: Array = first + side * np.indices((nx, ny)).reshape(2, -1).T
    quarters, accepted = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]]) / 4, list[Array]()
    while len(squares):
        target, far = _sizes(squares, rim, sizes, spacing), line.depth(squares)
        small = side <= 1.01 * target
        accepted.append(squares[small & (far > _FREE * target)])
        squares = squares[~small & (far > -side)]
        squares = (squares[:, None] + side * quarters).reshape(-1, 2)
        side /= 2
    return np.vstack(accepted)


def _joined(points: Array) -> Indices:
    triangles = Delaunay(points).simplices.astype(np.intp)
    area = np.abs(doubled_area(*np.moveaxis(points[triangles], 1, 0)))
    return triangles[area > 1e-9 * np.median(area)]  # none of points along one edge


def _cut(triangles: Indices, rim: int) -> Indices:
    """The numbers of the rim's segments that are no side of a triangle."""
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    steps = np.sort(np.column_stack([np.arange(rim), (np.arange(rim) + 1) % rim]), axis=1)
    most = int(triangles.max()) + 1
    return np.flatnonzero(~np.isin(steps @ (most, 1), sides @ (most, 1)))


def _smoothed(line: Outline, points: Array, triangles: Indices) -> Array:
    """Every point at the mean of its neighbours, unless that is much nearer to the rim."""
    total, count = np.zeros_like(points), np.zeros(len(points))
    for i in range(3):
        for j in ((i + 1) % 3, (i + 2) % 3):
            np.add.at(total, triangles[:, i], points[triangles[:, j]])
            np.add.at(count, triangles[:, i], 1)
    mean = total / np.maximum(count, 1)[:, None]
    accepted = line.depth(mean) > 0.5 * line.depth(points)
    return np.where(accepted[:, None], mean, points)


_NEAREST = 10  # triangles that a point is looked for in first
_ROUNDING = 1e-8  # of a triangle: a point on the rim as computed may stand this far outside
_FAR = 1e9  # m: off any skin


_I, _J = np.array([(i, j) for i in range(6) for j in range(6 - i)]).T
_FACTORS = np.array([perm(_I, a) * perm(_J, b) for a, b in ORDERS], float)
_POWERS: Indices = np.array(
    [[np.maximum(_I - a, 0) for a, _ in ORDERS], [np.maximum(_J - b, 0) for _, b in ORDERS]]
)


def monomials(xi: Array) -> Array:
    """The 21 monomials xi^i eta^j of `xi` (..., 2), with their derivatives, (..., 6, 21)."""
    powers: Array = xi[..., None] ** np.arange(6)
    of_xi: Array = np.take(powers[..., 0, :], _POWERS[0], axis=-1)
    of_eta: Array = np.take(powers[..., 1, :], _POWERS[1], axis=-1)
    return _FACTORS * of_xi * of_eta


def chain_rule(inverse: Array) -> Array:
    """The chain rule (..., 6, 6): derivatives along x, y from those along xi, eta.

    `inverse` (..., 2, 2) holds the derivatives of xi along x and y.
    """
    (p, q), (r, s) = np.moveaxis(inverse, (-2, -1), (0, 1))  # xi_x, xi_y; eta_x, eta_y
    C = np.zeros((*inverse.shape[:-2], 6, 6))
    C[..., 0, 0] = 1
    C[..., 1:3, 1:3] = np.swapaxes(inverse, -1, -2)
    C[..., 3, 3:] = np.stack([p * p, 2 * p * r, r * r], axis=-1)
    C[..., 4, 3:] = np.stack([p * q, p * s + q * r, r * s], axis=-1)
    C[..., 5, 3:] = np.stack([q * q, 2 * q * s, s * s], axis=-1)
    return C


def triangle_quadrature() -> tuple[Array, Array]:
    """Points (36, 2) and weights (36,) on the triangle xi, eta >= 0, xi + eta <= 1: degree 10."""
    t, w = gauss(1.0, 6)
    xi, share = (s.ravel() for s in np.meshgrid(t, t, indexing="ij"))
    weights = np.multiply.outer(w * (1 - t), w).ravel()
    return np.column_stack([xi, share * (1 - xi)]), weights


@dataclass(frozen=True, eq=False)
class Quintics:
    """N functions: on triangle t the monomials of xi (2,) times `coefficients` (T, 21, N).

    xi = `inverse` (T, 2, 2) (x - `origins` (T, 2)) is (0, 0), (1, 0) and (0, 1) at its corners.
    """

    origins: Array
    inverse: Array
    coefficients: Array

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.origins + np.linalg.inv(self.inverse).sum(axis=-1) / 3)

    @cached_property
    def _chained(self) -> Array:
        return chain_rule(self.inverse)

    @cached_property
    def _depths(self) -> Array:
        """xi, eta and 1 - xi - eta, one after the other for all triangles (3 T, 3), of (x, y, 1).

        They are how deep a point is inside of each triangle, counted from its three sides.
        """
        slopes = np.concatenate([self.inverse, -self.inverse.sum(axis=1, keepdims=True)], axis=1)
        at_zero = np.array([0.0, 0.0, 1.0]) - np.einsum("tij,tj->ti", slopes, self.origins)
        rows = np.concatenate([slopes, at_zero[..., None]], axis=-1)
        return np.swapaxes(rows, 0, 1).reshape(-1, 3)

    def _searched(self, x: float, y: float) -> tuple[int, Array, float]:
        """The triangle that (x, y) lies deepest inside, xi (2,) there, and the depth."""
        depths = (self._depths @ np.array([x, y, 1.0])).reshape(3, -1)
        deepest = np.minimum.reduce(depths)
        t = int(deepest.argmax())
        return t, depths[:2, t], float(deepest[t])

    def _located(self, positions: Array) -> tuple[Indices, Array, Array]:
        """The triangle (P,) that each position lies in, xi (P, 2) there, and how deep (P,)."""
        some = min(_NEAREST, len(self.origins))
        near = self._tree.query(positions, some)[1].reshape(len(positions), some)
        offset = positions[:, None] - self.origins[near]
        xi = np.einsum("pkij,pkj->pki", self.inverse[near], offset)
        depths = np.minimum(xi.min(axis=-1), 1 - xi.sum(axis=-1))
        best = np.arange(len(near)), depths.argmax(axis=1)
        triangle, local, depth = near[best], xi[best], depths[best]
        for p in np.flatnonzero(depth < 0):  # in none whose centre is so near
            triangle[p], local[p], depth[p] = self._searched(*positions[p])
        return triangle, local, depth

    def jet(self, x: float, y: float, count: int) -> Array:
        """The first `count` derivatives (count, N) at one point; NaN off the mesh."""
        finite = math.isfinite(x) and math.isfinite(y)
        t, xi, depth = self._searched(x, y) if finite else self._searched(_FAR, _FAR)
        if not depth > -_ROUNDING:
            return np.full((count, self.coefficients.shape[-1]), np.nan)
        return self._chained[t, :count].dot(monomials(xi)).dot(self.coefficients[t])

    def derivative(self, positions: Array, order: Order) -> Array:
        """The derivative (P, N) of one order at `positions` (P, 2); NaN off the mesh."""
        finite = np.isfinite(positions).all(axis=-1, keepdims=True)
        triangle, xi, depth = self._located(np.where(finite, positions, _FAR))
        rows = self._chained[triangle, None, ORDERS.index(order)] @ monomials(xi)
        values = np.full((len(positions), self.coefficients.shape[-1]), np.nan)
        inside = np.flatnonzero(depth > -_ROUNDING)
        inside = inside[np.argsort(triangle[inside], kind="stable")]
        starts = np.flatnonzero(np.diff(triangle[inside], prepend=-1))
        for group in np.split(inside, starts)[1:]:
            values[group] = rows[group, 0] @ self.coefficients[triangle[group[0]]]
        return values


_SPACING = 1.1  # of the mean distance between the highest mode's nodes
_FEWEST = 16  # modes that a mesh is made for
# Of the spacing, at blunt corners: hinged, curvature has no bound there; clamped, it falls to zero
# in no distance.
_BLUNT_HINGED, _BLUNT_CLAMPED = 1 / 256, 1 / 16

# Argyris' element: on each triangle a quintic, 21 numbers: value, slopes and second derivatives at
# the corners and the slope across at the middle of the sides. Triangles that share them join with
# continuous slopes. Its shape functions are found in each triangle's own coordinates: as sums of
# powers of x and y they lose eleven digits on triangles of a hundredth of the skin.


@dataclass(frozen=True, eq=False)
class PlateModes:
    """Modes as `functions`, and the `points` (Q, 2) in m and `weights` (Q,) that integrate them."""

    functions: Quintics
    points: Array
    weights: Array


@lru_cache(8)
def plate_modes(vertices: tuple[tuple[float, float], ...], count: int, clamped: bool) -> PlateModes:
    """The first `count` modes of a plate on an outline, their mean square 1/4.

    They make the bending energy, the integral of w_xx^2 + 2 w_xy^2 + w_yy^2, stationary for a
    given mean square; along straight edges that do not move Poisson's ratio adds nothing to it.
    """
    made = cached(f"plate {vertices} {count} {clamped}", lambda: _made(vertices, count, clamped))
    functions = Quintics(made["origins"], made["inverse"], made["coefficients"])
    return PlateModes(functions, made["points"], made["weights"])


def _made(vertices: tuple[tuple[float, float], ...], count: int, clamped: bool) -> dict[str, Array]:
    corners = np.array(vertices)
    size = np.sqrt(Outline(corners).area)
    spacing = _SPACING / np.sqrt(max(count, _FEWEST))
    blunt = _BLUNT_CLAMPED if clamped else _BLUNT_HINGED
    space = _Space(triangulated(Outline(corners / size), spacing, blunt))
    modes = _lowest(*space.energies(), space.allowed(clamped), count) / 2
    points, weights = space.quadrature()
    return {
        "origins": size * space.origins,
        "inverse": space.inverse / size,
        "coefficients": space.shapes @ modes[space.unknowns],
        "points": size * points.reshape(-1, 2),
        "weights": size**2 * weights.ravel(),
    }


class _Space:
    """Argyris' functions on a mesh: the unknowns of triangle t are `unknowns` (T, 21)."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self._mesh, corners = mesh, mesh.points[mesh.triangles]
        self.origins, self._sides = (
            corners[:, 0],
            np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2),
        )
        self.inverse = np.asarray(np.linalg.inv(self._sides), float)
        ends = np.sort(mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=-1)
        self._ends, which, self._sharing = np.unique(
            ends.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True
        )
        side = 6 * len(mesh.points) + which.reshape(-1, 3)
        at_corners = 6 * mesh.triangles[..., None] + np.arange(6)
        self.unknowns = np.hstack([at_corners.reshape(-1, 18), side])
        self.size = 6 * len(mesh.points) + len(self._ends)
        self.shapes = self._shapes(which.reshape(-1, 3))

    def _shapes(self, side: Indices) -> Array:
        """The quintics (T, 21, 21) whose unknowns are one and otherwise zero."""
        scale = np.sqrt(np.abs(np.linalg.det(self._sides)))
        chain = chain_rule(scale[:, None, None] * self.inverse)  # slopes per size of the triangle
        at_corners = [chain @ monomials(corner) for corner in np.array([[0, 0], [1, 0], [0, 1]])]
        along = self._mesh.points[self._ends[:, 1]] - self._mesh.points[self._ends[:, 0]]
        across = along[:, ::-1] * (-1, 1) / np.linalg.norm(along, axis=1)[:, None]
        slopes = chain[:, None, 1:3] @ monomials(np.array([[0.5, 0], [0.5, 0.5], [0, 0.5]]))
        at_sides = np.einsum("tsd,tsdm->tsm", across[side], slopes)
        orders = [sum(order) for order in ORDERS] * 3 + [1] * 3
        unknowns = np.concatenate([*at_corners, at_sides], axis=1)
        return np.linalg.inv(unknowns) * scale[:, None, None] ** orders

    def quadrature(self) -> tuple[Array, Array]:
        """Points (T, 36, 2) and weights (T, 36)."""
        xi, w = triangle_quadrature()
        points = self.origins[:, None] + xi @ np.swapaxes(self._sides, 1, 2)
        return points, np.multiply.outer(np.abs(np.linalg.det(self._sides)), w)

    def energies(self) -> tuple[csc_array, csc_array]:
        """The matrices (D, D) of the bending energy and of the mean square."""
        at = monomials(triangle_quadrature()[0]) @ self.shapes[:, None]
        w, _, _, w_xx, w_xy, w_yy = np.moveaxis(chain_rule(self.inverse)[:, None] @ at, 2, 0)
        weights = self.quadrature()[1][..., None]

        def product(v: Array) -> Array:
            return np.swapaxes(v, 1, 2) @ (weights * v)

        return (
            self._assembled(product(w_xx) + 2 * product(w_xy) + product(w_yy)),
            self._assembled(product(w)),
        )

    def _assembled(self, element: Array) -> csc_array:
        """The matrix (D, D) of all unknowns from that of each triangle's, (T, 21, 21)."""
        rows, columns = np.repeat(self.unknowns, 21, axis=1).ravel(), np.tile(self.unknowns, 21)
        entries = element.ravel(), (rows, columns.ravel())
        return csc_array(coo_array(entries, (self.size, self.size)))

    def allowed(self, clamped: bool) -> csc_array:
        """The combinations (D, F) of unknowns that the edge allows."""
        rim, points = self._mesh.rim, len(self._mesh.points)
        blocks: list[Any] = [_free_at(self._mesh, point, clamped) for point in range(rim)]
        blocks += [np.eye(6)] * (points - rim)
        sides = eye_array(len(self._ends)).tocsc()
        blocks.append(sides[:, np.flatnonzero((self._sharing == 2) | (not clamped))])
        return csc_array(cast("Any", block_diag(blocks)))


def _free_at(mesh: TriangleMesh, point: int, clamped: bool) -> Array:
    """What (6, F) of w, w_x, w_y, w_xx, w_xy, w_yy at a point of the rim its two edges leave free.

    Along an edge with direction t the deflection vanishes, w = w_t = w_tt = 0; clamped, its slope
    across does so too, w_n = w_tn = 0.
    """
    held = list[list[float]]()
    for other in ((point + 1) % mesh.rim, (point - 1) % mesh.rim):
        along = mesh.points[other] - mesh.points[point]
        tx, ty = along / np.linalg.norm(along)
        held += [[1, 0, 0, 0, 0, 0], [0, tx, ty, 0, 0, 0], [0, 0, 0, tx * tx, 2 * tx * ty, ty * ty]]
        if clamped:
            held += [[0, -ty, tx, 0, 0, 0], [0, 0, 0, -tx * ty, tx * tx - ty * ty, tx * ty]]
    _, s, Vt = np.linalg.svd(np.array(held))
    return Vt[int(np.sum(s > 1e-8)) :].T


def _lowest(K: Any, M: Any, allowed: csc_array, count: int) -> Array:
    """The lowest modes (D, N) of K v = lambda M v among the combinations `allowed` (D, F)."""
    scale = diags_array(1 / np.sqrt((allowed.T @ K @ allowed).diagonal()))
    scaled = allowed @ scale  # values, slopes and second derivatives alike
    start = np.random.default_rng(0).normal(size=scaled.shape[1])  # the same modes every time
    squares, vectors = cast(
        "tuple[Array, Array]",
        eigsh(scaled.T @ K @ scaled, count, scaled.T @ M @ scaled, sigma=0, v0=start),
    )
    return np.asarray(scaled @ vectors[:, np.argsort(squares)])
