"""Functions that are quintic on each triangle of a mesh: their values and derivatives at points."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.special import perm

from kappaskin.bases.modes import Order
from kappaskin.bases.product import gauss
from kappaskin.frames import Array

_NEAREST = 10  # triangles that a point is looked for in first
_ROUNDING = 1e-9  # of a triangle

Indices = NDArray[np.intp]

_I, _J = np.array([(i, j) for i in range(6) for j in range(6 - i)]).T


def _monomials(xi: Array, a: int, b: int) -> Array:
    """The derivative of order a, b of the 21 monomials xi^i eta^j at `xi` (P, 2), (P, 21)."""
    factor = np.asarray(perm(_I, a) * perm(_J, b), float)
    return factor * xi[:, :1] ** np.maximum(_I - a, 0) * xi[:, 1:] ** np.maximum(_J - b, 0)


def quintics(inverse: Array, xi: Array, order: Order) -> Array:
    """The derivative of every monomial along x and y, (P, 21), by the chain rule.

    `inverse` (P, 2, 2) or (2, 2) holds the derivatives of xi (P, 2) along x and y.
    """
    directions = [0] * order[0] + [1] * order[1]
    total = np.zeros((len(xi), 21))
    for steps in product((0, 1), repeat=len(directions)):
        factor = np.ones(len(xi))
        for step, direction in zip(steps, directions, strict=True):
            factor = factor * inverse[..., step, direction]
        total += factor[:, None] * _monomials(xi, steps.count(0), steps.count(1))
    return total


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

    def _local(self, positions: Array, triangles: Indices) -> tuple[Indices, Array, Array]:
        """The best of the `triangles` (P, K) for each position, xi there, how far inside (P,)."""
        offset = positions[:, None] - self.origins[triangles]
        xi = np.einsum("pkij,pkj->pki", self.inverse[triangles], offset)
        inside = np.minimum(xi.min(axis=-1), 1 - xi.sum(axis=-1))
        best = np.arange(len(xi)), inside.argmax(axis=1)
        return triangles[best], xi[best], inside[best]

    def located(self, positions: Array) -> tuple[Indices, Array]:
        """The triangle (P,) that each position lies in, or nearest to, and xi (P, 2) there."""
        T = len(self.origins)
        if len(positions) == 1:  # a tree takes longer
            found, xi, _ = self._local(positions, np.arange(T)[None])
            return found, xi
        nearest = self._tree.query(positions, min(_NEAREST, T))[1].reshape(len(positions), -1)
        found, xi, inside = self._local(positions, nearest)
        for p in np.flatnonzero(inside < -_ROUNDING):  # in none of those with the nearest centres
            found[p : p + 1], xi[p : p + 1], _ = self._local(
                positions[p : p + 1], np.arange(T)[None]
            )
        return found, xi

    def derivatives(self, positions: Array, orders: Sequence[Order]) -> list[Array]:
        """For each of `orders` the derivatives (P, N) at `positions` (P, 2) in the mesh."""
        triangle, xi = self.located(positions)
        rows = np.stack([quintics(self.inverse[triangle], xi, o) for o in orders], axis=1)
        values = np.empty((len(positions), len(orders), self.coefficients.shape[-1]))
        sorted_by = np.argsort(triangle, kind="stable")
        starts = np.flatnonzero(np.diff(triangle[sorted_by], prepend=-1))
        for group in np.split(sorted_by, starts)[1:]:
            values[group] = rows[group] @ self.coefficients[triangle[group[0]]]
        return list(np.moveaxis(values, 1, 0))
