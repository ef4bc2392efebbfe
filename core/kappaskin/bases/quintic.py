"""Functions that are quintic on each triangle of a mesh: their values and derivatives at points."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.special import perm

from kappaskin.bases.modes import ORDERS, Order
from kappaskin.bases.product import gauss
from kappaskin.frames import Array

_NEAREST = 10  # triangles that a point is looked for in first
_ROUNDING = 1e-9  # of a triangle

Indices = NDArray[np.intp]

_I, _J = np.array([(i, j) for i in range(6) for j in range(6 - i)]).T
_FACTORS = np.array([perm(_I, a) * perm(_J, b) for a, b in ORDERS], float)
_POWERS = np.array([(np.maximum(_I - a, 0), np.maximum(_J - b, 0)) for a, b in ORDERS])


def monomials(xi: Array) -> Array:
    """The 21 monomials xi^i eta^j of `xi` (..., 2), with their derivatives, (..., 6, 21)."""
    powers = xi[..., None] ** np.arange(6)
    return _FACTORS * powers[..., 0, _POWERS[:, 0]] * powers[..., 1, _POWERS[:, 1]]


def chained(inverse: Array) -> Array:
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
        return chained(self.inverse)

    @cached_property
    def _depths(self) -> Array:
        """How far (3 T, 3) a point (x, y, 1) is from the sides of every triangle, inward."""
        slopes = np.concatenate([self.inverse, -self.inverse.sum(axis=1, keepdims=True)], axis=1)
        at_origin = np.array([0.0, 0.0, 1.0]) - np.einsum("tij,tj->ti", slopes, self.origins)
        return np.concatenate([slopes, at_origin[..., None]], axis=-1).reshape(-1, 3)

    def _nearest(self, position: Array) -> int:
        """The triangle that a position (2,) is deepest inside of."""
        depths = self._depths @ np.append(position, 1.0)
        return int(depths.reshape(-1, 3).min(axis=1).argmax())

    def _located(self, positions: Array) -> Indices:
        """The triangle (P,) that each position lies in, or nearest to."""
        if len(positions) == 1:  # a tree takes longer
            return np.array([self._nearest(positions[0])])
        some = min(_NEAREST, len(self.origins))
        near = self._tree.query(positions, some)[1].reshape(len(positions), some)
        xi = self._local(positions[:, None], near)
        depth = np.minimum(xi.min(axis=-1), 1 - xi.sum(axis=-1))
        found = near[np.arange(len(near)), depth.argmax(axis=1)]
        for p in np.flatnonzero(depth.max(axis=1) < -_ROUNDING):  # in none with so near a centre
            found[p] = self._nearest(positions[p])
        return found

    def _local(self, positions: Array, triangles: Indices) -> Array:
        """The coordinates xi (..., 2) of `positions` in `triangles`."""
        offset = positions - self.origins[triangles]
        return np.einsum("...ij,...j->...i", self.inverse[triangles], offset)

    def derivatives(self, positions: Array, orders: Sequence[Order]) -> Array:
        """For each of `orders` the derivatives (O, P, N) at `positions` (P, 2) in the mesh."""
        triangle, which = self._located(positions), [ORDERS.index(order) for order in orders]
        rows = self._chained[triangle][:, which] @ monomials(self._local(positions, triangle))
        if len(positions) == 1:
            return (rows[0] @ self.coefficients[triangle[0]])[:, None]
        values = np.empty((len(orders), len(positions), self.coefficients.shape[-1]))
        sorted_by = np.argsort(triangle, kind="stable")
        starts = np.flatnonzero(np.diff(triangle[sorted_by], prepend=-1))
        for group in np.split(sorted_by, starts)[1:]:
            here = rows[group] @ self.coefficients[triangle[group[0]]]
            values[:, group] = np.swapaxes(here, 0, 1)
        return values
