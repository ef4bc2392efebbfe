"""A shell of quadratic triangles made from the solid that it is (Ahmad, Irons and Zienkiewicz).

It shares no code with the library that it tests. The surface goes through points (n, 3) on it, six
to a triangle, with their normals outward. What is z along the normal from it moves by u + z t x n,
with u and the turn t of each point. The strains are those of the solid at six points and two
heights, without stress along the normal; the shear across is stiffened, so that normals stay
normal. Curvature is what gages on both faces read over the thickness, positive as of a second
derivative of an inward displacement.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

_STIFFER = 40.0  # times the shear stiffness across: a Kirchhoff-Love shell but for 1/40 of shear

# Six points of a triangle and weights, exact to the fourth power (Strang and Fix), by area
# coordinates; the last three of the nodes are in the middle of the sides 0-1, 1-2 and 2-0.
_A, _B = 0.445948490915965, 0.091576213509771
_POINTS = np.concatenate([[(a, a), (1 - 2 * a, a), (a, 1 - 2 * a)] for a in (_A, _B)])
_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3) / 2


def _shapes(r, s):
    """Values (Q, 6) and derivatives (2, Q, 6) of the functions at r, s (Q,)."""
    t, one = 1 - r - s, np.ones_like(r)
    values = [t * (2 * t - 1), r * (2 * r - 1), s * (2 * s - 1), 4 * r * t, 4 * r * s, 4 * s * t]
    by_r = [1 - 4 * t, 4 * r - 1, 0 * one, 4 * (t - r), 4 * s, -4 * s]
    by_s = [1 - 4 * t, 0 * one, 4 * s - 1, -4 * r, 4 * r, 4 * (t - s)]
    return np.stack(values, -1), np.stack([np.stack(by_r, -1), np.stack(by_s, -1)])


@dataclass(frozen=True, eq=False)
class SolidShell:
    """A shell through `points` (n, 3) in m, with unit `normals`, of `triangles` (F, 6) of them.

    Flexural `rigidity` D in N m and `thickness` h in m; clamped at the points `held`.
    """

    points: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray
    held: np.ndarray
    rigidity: float
    thickness: float
    poisson: float = 0.3

    def _at(self, elements, r, s, z):
        """Of `elements` (F,) at r, s (Q,) and `z` in m: what gives strain along a frame.

        B (F, Q, 3, 3, 36) maps what the points do to the displacement's derivatives in the frame
        (F, Q, 3, 3), whose third direction is the normal; and the volume by r, s and z.
        """
        N, dN = _shapes(r, s)
        X, n = self.points[self.triangles[elements]], self.normals[self.triangles[elements]]
        J = np.empty((len(X), len(r), 3, 3))
        J[:, :, :2] = np.einsum("dqi,fik->fqdk", dN, X + z * n)
        J[:, :, 2] = np.einsum("qi,fik->fqk", N, n)
        spin = np.zeros((len(X), 6, 3, 3))  # t x n = spin t
        for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            spin[:, :, a, b], spin[:, :, b, a] = n[:, :, c], -n[:, :, c]
        D = np.zeros((len(X), len(r), 3, 3, 6, 6))  # derivative, displacement, point, freedom
        for d in range(2):
            D[:, :, d, :, :, :3] = np.einsum("qi,jk->qjik", dN[d], np.eye(3))
            D[:, :, d, :, :, 3:] = z * np.einsum("qi,fijk->fqjik", dN[d], spin)
        D[:, :, 2, :, :, 3:] = np.einsum("qi,fijk->fqjik", N, spin)
        D = D.reshape(*D.shape[:4], 36)
        D = np.linalg.solve(J, D.reshape(*D.shape[:3], -1)).reshape(D.shape)  # in space
        e3 = np.cross(J[:, :, 0], J[:, :, 1])
        e3 /= np.linalg.norm(e3, axis=-1, keepdims=True)
        e1 = np.cross([0.0, 1.0, 0.0], e3)
        e1 /= np.linalg.norm(e1, axis=-1, keepdims=True)
        frame = np.stack([e1, np.cross(e3, e1), e3], 2)
        return np.einsum("fqai,fqijm,fqbj->fqabm", frame, D, frame, optimize=True), np.abs(
            np.linalg.det(J)
        )

    def _strains(self, B):
        return np.stack(
            [
                B[:, :, 0, 0],
                B[:, :, 1, 1],
                B[:, :, 0, 1] + B[:, :, 1, 0],
                B[:, :, 0, 2] + B[:, :, 2, 0],
                B[:, :, 1, 2] + B[:, :, 2, 1],
            ],
            2,
        )

    @cached_property
    def _solve(self):
        h, nu = self.thickness, self.poisson
        E = 12 * (1 - nu**2) * self.rigidity / h**3
        G = E / (2 * (1 + nu))
        law = np.diag([0, 0, G, 5 / 6 * _STIFFER * G, 5 / 6 * _STIFFER * G])
        law[:2, :2] = E / (1 - nu**2) * np.array([[1, nu], [nu, 1]])
        K = np.zeros((len(self.triangles), 36, 36))
        every = np.arange(len(self.triangles))
        for z in h / 2 * np.array([-1, 1]) / np.sqrt(3):
            B, volume = self._at(every, *_POINTS.T, z)
            S = self._strains(B)
            weighted = (volume * _WEIGHTS * h / 2)[:, :, None, None] * (law @ S)
            K += np.einsum("fqam,fqan->fmn", S, weighted, optimize=True)
        for k in range(6):  # a turn about the normal moves nothing
            n, t = self.normals[self.triangles[:, k]], slice(6 * k + 3, 6 * k + 6)
            K[:, t, t] += self.rigidity * n[:, :, None] * n[:, None]
        freedoms = self._freedoms
        rows = np.broadcast_to(freedoms[:, :, None], K.shape)
        columns = np.broadcast_to(freedoms[:, None], K.shape)
        size = 6 * len(self.points)
        whole = coo_array((K.ravel(), (rows.ravel(), columns.ravel())), (size, size)).tocsc()
        free = np.setdiff1d(np.arange(size), (6 * self.held[:, None] + np.arange(6)).ravel())
        factors = splu(whole[free][:, free])

        def solve(right):
            found = np.zeros(right.shape)
            found[free] = factors.solve(right[free])
            return found

        return solve

    @property
    def _freedoms(self):
        return (6 * self.triangles[:, :, None] + np.arange(6)).reshape(-1, 36)

    def places(self, elements):
        """Points (P, 3) in the middle of the triangles `elements` (P,)."""
        N, _ = _shapes(np.array([1 / 3]), np.array([1 / 3]))
        return np.einsum("i,pik->pk", N[0], self.points[self.triangles[elements]])

    def reader(self, elements):
        """The map from a load at the points, its `forces` (n,) in N inward, to curvature (3, P).

        At the middle of the triangles `elements` (P,), along x as it is seen along z, and across.
        """
        third, h = np.array([1 / 3]), self.thickness
        faces = [
            self._strains(self._at(elements, third, third, z)[0])[:, 0] for z in (h / 2, -h / 2)
        ]
        rows = (faces[0] - faces[1])[:, :3] / h * np.array([1, 1, 0.5])[:, None]
        right = np.zeros((6 * len(self.points), 3 * len(elements)))
        freedoms = self._freedoms[elements]
        for k, (row, at) in enumerate(zip(rows, freedoms, strict=True)):
            for c in range(3):
                right[at, c * len(elements) + k] = row[c]
        moved = self._solve(right).reshape(len(self.points), 6, -1)
        by_force = -np.einsum("nk,nkr->rn", self.normals, moved[:, :3])
        return lambda forces: (by_force @ forces).reshape(3, -1)

    def displacement(self, forces):
        """Displacement inward (n,) in m at the points under `forces` (n,) in N inward."""
        right = np.zeros((len(self.points), 6))
        right[:, :3] = -forces[:, None] * self.normals
        moved = self._solve(right.ravel()).reshape(-1, 6)
        return -np.vecdot(moved[:, :3], self.normals)

    def spread(self, pressure):
        """The forces (n,) in N of a `pressure` in Pa, a function of points (Q, 3)."""
        N, dN = _shapes(*_POINTS.T)
        X = self.points[self.triangles]
        J = np.einsum("dqi,fik->dfqk", dN, X)
        area = np.linalg.norm(np.cross(*J), axis=-1) * _WEIGHTS
        p = pressure(np.einsum("qi,fik->fqk", N, X)) * area
        found = np.zeros(len(self.points))
        np.add.at(found, self.triangles, p @ N)
        return found


def quadratic(places, triangles):
    """Places (m, 2) with those in the middle of all sides, and triangles (F, 6) of them."""
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], -1).reshape(-1, 2)
    unique, which = np.unique(sides, axis=0, return_inverse=True)
    middles = places[unique].mean(1)
    return np.concatenate([places, middles]), np.column_stack(
        [triangles, len(places) + which.reshape(-1, 3)]
    )
