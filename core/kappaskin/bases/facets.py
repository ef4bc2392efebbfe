"""A thin shell of flat triangles: its stiffness, and displacements under forces."""

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from scipy.sparse import bsr_array, csc_array
from scipy.sparse.linalg import splu

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Indices, Mask

_NEXT, _LAST = [1, 2, 0], [2, 0, 1]  # of each corner
_FLATTEST = 1e-6  # twice the area over the square of the longest side
_BLOCK = 24  # right-hand sides solved at once: more no longer fit the processor's cache
_LOST = 1e-4  # of a displacement that is known, when found again

# Felippa's optimal element: the strain at a corner by the rotations of the corners beyond the mean,
# as the stretches of the sides 1 2, 2 3 and 3 1 by their lengths. Between corners it is the mean.
_AT_CORNERS = np.array(
    [
        [[1, 2, 1], [0, 1, -1], [-1, -1, -2]],
        [[-2, -1, -1], [1, 1, 2], [-1, 0, 1]],
        [[1, -1, 0], [-1, -2, -1], [2, 1, 1]],
    ]
)
_AT_SIDES = (_AT_CORNERS + _AT_CORNERS[_NEXT]) / 2
_DRILLED = 3 / 4  # half of alpha_b
_MIDDLES = (1 - np.eye(3)) / 2  # barycentric coordinates of the middles of the sides


class Facets:
    """A thin shell of flat triangles with six freedoms a node.

    `nodes` (n, 3) in m and `triangles` (F, 3) of their numbers, counter-clockwise seen from
    outside. The freedoms of a node follow each other: displacement along x, y and z in m, rotation
    about x, y and z in rad. Bending is the discrete Kirchhoff triangle (Batoz, Bathe and Ho 1980,
    doi:10.1002/nme.1620151205), stretching Felippa's optimal triangle with rotations in its plane
    (2003, doi:10.1016/S0045-7825(03)00253-6).
    `normals` (n, 3) are outward unit vectors, the mean of those of the triangles by their angles
    at the node; `areas` (n,) in m^2 are a third of those of the triangles there.
    A `Refusal` names triangles without area and nodes without triangles.
    """

    def __init__(self, nodes: Array, triangles: Indices) -> None:
        self._count, self._triangles = len(nodes), triangles
        corners = nodes[triangles]
        sides = corners[:, _NEXT] - corners  # from each corner to the next
        lengths = np.linalg.norm(sides, axis=-1)
        across = np.cross(sides[:, 0], sides[:, 1])
        doubled = np.linalg.norm(across, axis=-1)
        flat = np.flatnonzero(~(doubled > _FLATTEST * lengths.max(axis=1) ** 2))
        if flat.size:
            raise Refusal(
                f"expected triangles with an area, got {flat.size} with none, the first of them "
                f"number {flat[0]}; remove them or move their corners"
            )
        loose = np.setdiff1d(np.arange(len(nodes)), triangles)
        if loose.size:
            raise Refusal(
                f"expected nodes at corners of triangles, got {loose.size} that are at none, the "
                f"first of them number {loose[0]}; remove them"
            )
        normals = across / doubled[:, None]
        along = sides[:, 0] / lengths[:, :1]
        self._frames = np.stack([along, np.cross(normals, along), normals], axis=1)
        from_centre = corners - corners.mean(axis=1, keepdims=True)
        self._corners = from_centre @ np.swapaxes(self._frames[:, :2], 1, 2)
        self._areas = doubled / 2
        directions = sides / lengths[..., None]
        angles = np.arccos(np.clip(-np.sum(directions * directions[:, _LAST], axis=-1), -1, 1))
        total = self._summed(angles[..., None] * normals[:, None])
        self.normals: Array = total / np.linalg.norm(total, axis=1)[:, None]
        thirds = np.repeat(self._areas[:, None] / 3, 3, axis=1)
        self.areas: Array = self._summed(thirds[..., None])[:, 0]

    def _summed(self, at_corners: Array) -> Array:
        """The sums (n, k) at the nodes of what is at the corners of the triangles (F, 3, k)."""
        total = np.zeros((self._count, at_corners.shape[-1]))
        np.add.at(total, self._triangles, at_corners)
        return total

    def stiffness(self, D: float, C: float, nu: float) -> csc_array:
        """The stiffness (6 n, 6 n) of an isotropic shell.

        `D` is the flexural rigidity E h^3 / 12 (1 - nu^2) in N m, `C` = E h / (1 - nu^2) in N/m.
        """
        shares = np.linalg.cholesky([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]]).T
        roots = np.sqrt(self._areas)[:, None, None, None]
        stretch = np.sqrt(C) * roots * (shares @ self._strains(nu))
        bent = np.sqrt(D / 3) * roots * (shares @ self._curvatures())
        F, points = len(self._triangles), stretch.shape[1] + 3
        rows = np.zeros((F, points, 3, 3, 2, 3))  # by corner, then displacement and rotation
        stretch, bent = (one.reshape(F, -1, 3, 3, 3) for one in (stretch, bent))
        rows[:, :-3, ..., 0, :2], rows[:, :-3, ..., 1, 2] = stretch[..., :2], stretch[..., 2]
        rows[:, -3:, ..., 0, 2], rows[:, -3:, ..., 1, :2] = bent[..., 0], bent[..., 1:]
        rows = (rows.reshape(F, -1, 3) @ self._frames).reshape(F, -1, 18)
        return self._assembled(np.swapaxes(rows, 1, 2) @ rows)

    def foundation(self, k_f: float) -> csc_array:
        """The stiffness (6 n, 6 n) of springs of `k_f` in N/m^3 along the normals, at the nodes."""
        blocks = np.zeros((self._count, 6, 6))
        across = self.normals[:, :, None] * self.normals[:, None]
        blocks[:, :3, :3] = k_f * self.areas[:, None, None] * across
        return _joined(blocks, np.arange(self._count), np.arange(self._count + 1))

    def _slopes(self) -> Array:
        """Gradients (F, 3, 2) of the barycentric coordinates in the triangles."""
        opposite = self._corners[:, _LAST] - self._corners[:, _NEXT]
        return opposite[..., ::-1] * (-1, 1) / (2 * self._areas)[:, None, None]

    def _strains(self, nu: float) -> Array:
        """Strains (F, 4, 3, 9) xx, yy, 2 xy by u, v and the rotation at each corner.

        First the mean, as if a corner moved with its rotation about the centre; then what rotations
        beyond the mean add at the middles of the sides, by the root of its share of the energy.
        """
        slopes = self._slopes()
        F = len(slopes)
        mean = np.zeros((F, 3, 3, 3))
        mean[:, 0, :, 0] = mean[:, 2, :, 1] = slopes[..., 0]
        mean[:, 1, :, 1] = mean[:, 2, :, 0] = slopes[..., 1]
        turned = self._corners[..., ::-1] * (1, -1)
        mean[..., 2] = _DRILLED * np.einsum("fcid,fid->fci", mean[..., :2], turned)
        beyond = np.zeros((F, 3, 3, 3))
        beyond[..., :2] = slopes[:, None, :, ::-1] * (0.5, -0.5)
        beyond[..., 2] = np.eye(3)
        stretches = -_symmetric(slopes, slopes[:, _NEXT]) * (2 / 3 * self._areas)[:, None, None]
        share = np.sqrt(3 / 4 * max((1 - 4 * nu**2) / 2, 0.01))
        more = (share * stretches[:, None] @ _AT_SIDES) @ beyond.reshape(F, 1, 3, 9)
        return np.concatenate([mean.reshape(F, 1, 3, 9), more], axis=1)

    def _curvatures(self) -> Array:
        """Curvatures (F, 3, 3, 9) xx, yy, 2 xy at the sides' middles, by w and two rotations.

        The normal turns by b = (b_x, b_y), linear in the barycentric coordinates L, plus on each
        side ij of direction t and length l
            4 L_i L_j t (3/2 (w_i - w_j) / l - 3/4 t . (b_i + b_j)),
        with which it stays normal to the cubic w in the middle of the side.
        """
        slopes, corners = self._slopes(), self._corners
        F = len(slopes)
        turns = np.array([[0, 0, 1], [0, -1, 0]])  # b by w and the rotations
        linear = np.zeros((F, 3, 3, 3))
        for axis in (0, 1):
            unit = np.broadcast_to(np.eye(2)[axis], slopes.shape)
            linear += _symmetric(slopes, unit)[..., None] * turns[axis]
        sides = corners[:, _NEXT] - corners
        squares = np.sum(sides**2, axis=-1)[..., None]
        row = np.zeros((F, 3, 3, 3))  # times l, by side and corner
        each = np.arange(3)
        row[:, each, each] = row[:, each, _NEXT] = -3 / 4 * sides @ turns
        row[:, each, each, 0], row[:, each, _NEXT, 0] = 3 / 2, -3 / 2
        L = _MIDDLES[:, None, :, None]
        g = 4 * (L * slopes[:, _NEXT] + L[:, :, _NEXT] * slopes)  # by point, then of sides
        bow = _symmetric(np.moveaxis(g, 0, 1), (sides / squares)[:, None])
        return linear.reshape(F, 1, 3, 9) + bow @ row.reshape(F, 1, 3, 9)

    def _assembled(self, element: Array) -> csc_array:
        """The matrix (6 n, 6 n) of those of the triangles (F, 18, 18)."""
        n = self._count
        blocks = element.reshape(-1, 3, 6, 3, 6).swapaxes(2, 3).reshape(-1, 6, 6)
        keys = (n * self._triangles[:, :, None] + self._triangles[:, None]).ravel()
        order = np.argsort(keys, kind="stable")
        first = np.flatnonzero(np.diff(keys[order], prepend=-1))
        row, column = np.divmod(keys[order[first]], n)
        starts = np.searchsorted(row, np.arange(n + 1))
        return _joined(np.add.reduceat(blocks[order], first), column, starts)


def _symmetric(a: Array, b: Array) -> Array:
    """xx, yy and 2 xy (..., 3, K) of the symmetric parts of a b^T, of `a` and `b` (..., K, 2)."""
    (ax, ay), (bx, by) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    return np.stack([ax * bx, ay * by, ax * by + ay * bx], axis=-2)


def _joined(blocks: Array, at: Indices, starts: Indices) -> csc_array:
    """The symmetric matrix of `blocks` (B, 6, 6) in places `at` of rows that begin at `starts`."""
    by_rows = cast("Any", bsr_array((blocks, at, starts)).tocsr())
    return csc_array((by_rows.data, by_rows.indices, by_rows.indptr), shape=by_rows.shape)


def held_freedoms(edge_nodes: Indices, edge: str, count: int) -> Mask:
    """What (6 count,) an edge holds of `count` nodes: displacements; clamped, rotations too."""
    held = np.zeros((count, 6), bool)
    held[edge_nodes, : 6 if edge == "clamped" else 3] = True
    return held.ravel()


class Factored:
    """A stiffness `K` (6 n, 6 n) without what is `held` (6 n,), factored once.

    A `Refusal` where the held freedoms leave the skin, or a part of it, free to move.
    """

    def __init__(self, K: csc_array, held: Mask) -> None:
        self._free = np.flatnonzero(~held)
        matrix: Any = cast("Any", K)[:, self._free][self._free]
        try:
            self._solved = _solver(matrix)
        except RuntimeError:  # exactly singular
            lost = np.inf
        else:
            known = np.random.default_rng(0).normal(size=len(self._free))
            found = np.zeros(len(known))
            for _ in range(3):  # rounding is mended by repetition, what is free to move is not
                found += self._solved(matrix @ (known - found))
            lost = np.abs(found - known).max(initial=0.0)
        if not lost < _LOST:
            raise Refusal(
                "the skin, or a part of it, moves as a whole without bending: expected edges that "
                "hold it; hold more of the edge, or clamp it"
            )

    def __call__(self, forces: Array) -> Array:
        """Displacements and rotations (6 n, R) under forces and moments (6 n, R)."""
        moved = np.zeros(forces.shape)
        for k in range(0, forces.shape[1], _BLOCK):
            some = np.s_[k : k + _BLOCK]
            moved[self._free, some] = self._solved(forces[self._free, some])
        return moved


def _solver(matrix: Any) -> Callable[[Array], Array]:
    """The map from forces to displacements: by Cholesky's pivots, in an order that fills little."""
    symmetric = {"SymmetricMode": True}
    return cast("Any", splu)(matrix, "MMD_AT_PLUS_A", 0.0, options=symmetric).solve
