"""An outline to the modes of a plate on it, by Argyris' finite element."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, coo_array, csc_array, diags_array, eye_array
from scipy.sparse.linalg import eigsh

from kappaskin.bases.basis import ORDERS
from kappaskin.bases.cache import kept
from kappaskin.bases.mesh import Mesh, meshed
from kappaskin.bases.quintic import Quintics, chained, monomials, triangle_quadrature
from kappaskin.frames import Array
from kappaskin.skin import Outline

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
    made = kept(f"plate {vertices} {count} {clamped}", lambda: _made(vertices, count, clamped))
    functions = Quintics(made["origins"], made["inverse"], made["coefficients"])
    return PlateModes(functions, made["points"], made["weights"])


def _made(vertices: tuple[tuple[float, float], ...], count: int, clamped: bool) -> dict[str, Array]:
    corners = np.array(vertices)
    size = np.sqrt(Outline(corners).area)
    spacing = _SPACING / np.sqrt(max(count, _FEWEST))
    blunt = _BLUNT_CLAMPED if clamped else _BLUNT_HINGED
    space = _Space(meshed(Outline(corners / size), spacing, blunt))
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

    def __init__(self, mesh: Mesh) -> None:
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

    def _shapes(self, side: NDArray[np.intp]) -> Array:
        """The quintics (T, 21, 21) whose unknowns are one and otherwise zero."""
        scale = np.sqrt(np.abs(np.linalg.det(self._sides)))
        chain = chained(scale[:, None, None] * self.inverse)  # slopes per size of the triangle
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
        w, _, _, w_xx, w_xy, w_yy = np.moveaxis(chained(self.inverse)[:, None] @ at, 2, 0)
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


def _free_at(mesh: Mesh, point: int, clamped: bool) -> Array:
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
