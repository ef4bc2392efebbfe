"""Finite elements of thin shells: flat triangles that bend, stretch and turn in their plane."""

from itertools import product

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Indices, Mask

# A node has six freedoms, displacement and rotation in space. In its own axes a triangle
# - bends as the discrete Kirchhoff triangle of Batoz, Bathe and Ho (10.1002/nme.1620151205), with w
#   and the rotations about x and y at its corners;
# - stretches as the optimal triangle of Felippa (10.1016/S0045-7825(03)00253-6), with u, v and the
#   rotations about the normal.
_STRETCHES, _BENDS = (0, 1, 5), (2, 3, 4)
_MIDDLES = (0.5, 0.0), (0.5, 0.5), (0.0, 0.5)  # of the sides, in the unit triangle
_ALPHA, _LEAST = 1.5, 0.01  # alpha_b of the optimal triangle, and the least beta_0
_BETA = np.array([[1, 2, 1], [0, 1, -1], [-1, -1, -2]], float)  # beta_1 to beta_9
_CORNERS = (0, 1, 2), (1, 2, 0), (2, 0, 1)  # each with the two that follow it
_LOST = 1e-12  # of the largest pivot: one as small is none


class Facets:
    """Flat `triangles` (F, 3) of a thin shell between `nodes` (n, 3) in m.

    Raises a `Refusal` for a triangle without an area.
    """

    def __init__(self, nodes: Array, triangles: Indices) -> None:
        self._triangles, self._count = triangles, len(nodes)
        corners = nodes[triangles]
        u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        normal = np.cross(u, v)
        twice: Array = np.linalg.norm(normal, axis=1)
        if not (twice > 0).all():
            raise Refusal(
                f"expected triangles with an area, got none of triangle {int(twice.argmin())}; "
                "remove it"
            )
        x, z = u / np.linalg.norm(u, axis=1)[:, None], normal / twice[:, None]
        self._area = twice / 2
        self._axes: Array = np.stack([x, np.cross(z, x), z], axis=1)
        place = np.einsum("fik,fck->icf", self._axes[:, :2], corners - corners[:, :1])
        # x_i - x_j and y_i - y_j (3, 3, F) of the corners in the plane, and their squares.
        self._x, self._y = place[:, :, None] - place[:, None]
        self._squares = self._x**2 + self._y**2

    def stiffness(self, D: float, C: float, nu: float) -> csc_array:
        """Stiffness (6 n, 6 n) of a shell of D in N m and C = E h / (1 - nu^2) in N/m.

        Of displacements in m and rotations in rad along the axes in space.
        """
        law = np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
        K = np.zeros((len(self._area), 3, 6, 3, 6))
        parts = (_STRETCHES, self._stretching(C * law, nu)), (_BENDS, self._bending(D * law))
        for freedoms, part in parts:
            for (i, one), (j, other) in product(enumerate(freedoms), repeat=2):
                K[:, :, one, :, other] = part[:, i::3, j::3]
        # Displacements and rotations alike are turned from the axes in space.
        R, K = self._axes[:, None, None], K.reshape(-1, 6, 3, 6, 3)
        K = np.swapaxes(R, -1, -2) @ np.swapaxes(K, 2, 3) @ R
        freedoms = (6 * self._triangles[:, :, None] + np.arange(6)).reshape(-1, 18)
        places = np.repeat(freedoms, 18, axis=1).ravel(), np.tile(freedoms, (1, 18)).ravel()
        values = np.swapaxes(K, 2, 3).ravel()
        return csc_array((values, places), shape=(6 * self._count, 6 * self._count))

    def _stretching(self, law: Array, nu: float) -> Array:
        """Stiffness (F, 9, 9) of u, v and the rotation about the normal at each corner."""
        X, Y, A = self._x, self._y, self._area
        L = np.zeros((len(A), 3, 3, 3))
        turns = np.zeros((len(A), 3, 3))
        for i, j, k in _CORNERS:
            L[:, i, 0, 0] = L[:, i, 1, 2] = Y[j, k]
            L[:, i, 0, 2] = L[:, i, 1, 1] = X[k, j]
            L[:, i, 2, 0] = _ALPHA / 6 * Y[j, k] * (Y[i, k] - Y[j, i])
            L[:, i, 2, 1] = _ALPHA / 6 * X[k, j] * (X[k, i] - X[i, j])
            L[:, i, 2, 2] = _ALPHA / 3 * (X[k, i] * Y[i, k] - X[i, j] * Y[j, i])
            turns[:, i, 0], turns[:, i, 1] = X[k, j], Y[k, j]
        L = L.reshape(-1, 9, 3) / 2
        basic = L @ law @ np.swapaxes(L / A[:, None, None], 1, 2)
        # Rotations beyond that of the mean, and the strains along the sides 12, 23 and 31 by them.
        beyond = np.repeat((turns / (4 * A)[:, None, None]).reshape(-1, 1, 9), 3, axis=1)
        beyond[:, (0, 1, 2), (2, 5, 8)] = 1.0
        along = np.zeros((len(A), 3, 3))
        for side, (i, j, k) in enumerate(_CORNERS):
            share = self._squares[i, j] / (4 * A**2)
            along[:, 0, side] = share * Y[j, k] * Y[i, k]
            along[:, 1, side] = share * X[j, k] * X[i, k]
            along[:, 2, side] = share * (Y[j, k] * X[k, i] + X[k, j] * Y[i, k])
        natural = np.swapaxes(along, 1, 2) @ law @ along
        per_side = 2 * A / 3 / np.stack([self._squares[i, j] for i, j, _ in _CORNERS])
        # At corner c the strains along the sides are these of the rotations; they are linear.
        rotated = [np.roll(_BETA, (c, c), (0, 1)) * per_side.T[:, :, None] for c in range(3)]
        higher = np.zeros_like(natural)
        for c, onward, _ in _CORNERS:
            q = (rotated[c] + rotated[onward]) / 2
            higher += np.swapaxes(q, 1, 2) @ natural @ q
        beta = max((1 - 4 * nu**2) / 2, _LEAST)
        higher *= (0.75 * beta * A)[:, None, None]
        return basic + np.swapaxes(beyond, 1, 2) @ higher @ beyond

    def _bending(self, law: Array) -> Array:
        """Stiffness (F, 9, 9) of w and the rotations about x and y at each corner."""
        K = np.zeros((len(self._area), 9, 9))
        for xi, eta in _MIDDLES:
            B = self._bent(xi, eta)
            K += np.swapaxes(B, 1, 2) @ law @ (self._area[:, None, None] / 3 * B)
        return K

    def _bent(self, xi: float, eta: float) -> Array:
        """Curvature xx, yy and twice xy (F, 3, 9) at one place of the unit triangle."""
        # Shape functions of corners, and of the middles of the sides 23, 31 and 12, derived.
        rest = 1 - xi - eta
        corners = np.array([[1 - 4 * rest, 4 * xi - 1, 0], [1 - 4 * rest, 0, 4 * eta - 1]])
        middles = np.array(
            [[4 * eta, -4 * eta, 4 * (rest - xi)], [4 * xi, 4 * (rest - eta), -4 * xi]]
        )
        sides = [(j, k) for _, j, k in _CORNERS]
        X, Y = (np.stack([of[pair] for pair in sides]) for of in (self._x, self._y))
        squares = np.stack([self._squares[pair] for pair in sides])
        a, b, d = -X / squares, 0.75 * X * Y / squares, -Y / squares
        c, e = (X**2 / 4 - Y**2 / 2) / squares, (Y**2 / 4 - X**2 / 2) / squares
        H = np.zeros((2, 2, 9, len(self._area)))  # rotations x and y, by xi and eta
        for i, j, k in _CORNERS:  # corner i lies between the sides k and j
            for s in range(2):
                p, q, own = middles[s, k], middles[s, j], corners[s, i]
                H[0, s, 3 * i] = 1.5 * (a[k] * p - a[j] * q)
                H[1, s, 3 * i] = 1.5 * (d[k] * p - d[j] * q)
                H[0, s, 3 * i + 1] = b[j] * q + b[k] * p
                H[1, s, 3 * i + 1] = -own + e[j] * q + e[k] * p
                H[0, s, 3 * i + 2] = own - c[j] * q - c[k] * p
                H[1, s, 3 * i + 2] = -H[0, s, 3 * i + 1]
        # By x and y: with x_21, y_21, x_31 and y_31.
        (x2, y2), (x3, y3), twice = (
            (self._x[1, 0], self._y[1, 0]),
            (self._x[2, 0], self._y[2, 0]),
            2 * self._area,
        )
        by_x, by_y = (y3 * H[:, 0] - y2 * H[:, 1]) / twice, (x2 * H[:, 1] - x3 * H[:, 0]) / twice
        return np.moveaxis(np.stack([by_x[0], by_y[1], by_y[0] + by_x[1]]), 2, 0)


class Factored:
    """A stiffness (6 n, 6 n) without the freedoms (6 n,) that are `held`, factored once.

    Raises a `Refusal` where those do not hold the skin.
    """

    def __init__(self, K: csc_array, held: Mask) -> None:
        self._free = np.flatnonzero(~held)
        try:
            self._factors = splu(
                csc_array(K[self._free][:, self._free]),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
            pivots = np.abs(self._factors.U.diagonal())
            held_well = bool(pivots.min() > _LOST * pivots.max())
        except RuntimeError:  # as SuperLU has it for a zero pivot
            held_well = False
        if not held_well:
            raise Refusal(
                "the skin moves as a whole without bending: expected a rim of which enough is "
                "held; hold more of it, or clamp it"
            )

    def __call__(self, forces: Array) -> Array:
        """Displacements and rotations (6 n, k) under `forces` and moments (6 n, k)."""
        found = np.zeros(forces.shape)
        found[self._free] = self._factors.solve(np.ascontiguousarray(forces[self._free]))
        return found
