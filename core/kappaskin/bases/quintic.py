"""Functions that are quintic on each triangle of a mesh: their values and derivatives at points."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.special import perm

from kappaskin.bases.basis import ORDERS, Order
from kappaskin.bases.product import gauss
from kappaskin.frames import Array

_NEAREST = 10  # triangles that a point is looked for in first
_ROUNDING = 1e-8  # of a triangle: a point on the rim as computed may stand this far outside
_FAR = 1e9  # m: off any skin

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
        """xi, eta and 1 - xi - eta, one after the other for all triangles (3 T, 3), of (x, y, 1).

        They are how deep a point is inside of each triangle, counted from its three sides.
        """
        slopes = np.concatenate([self.inverse, -self.inverse.sum(axis=1, keepdims=True)], axis=1)
        at_zero = np.array([0.0, 0.0, 1.0]) - np.einsum("tij,tj->ti", slopes, self.origins)
        rows = np.concatenate([slopes, at_zero[..., None]], axis=-1)
        return np.swapaxes(rows, 0, 1).reshape(-1, 3)

    def _searched(self, x: float, y: float) -> tuple[int, Array, float]:
        """The triangle that (x, y) is deepest inside of, xi (2,) there, and how deep."""
        depths = (self._depths @ np.array([x, y, 1.0])).reshape(3, -1)
        deepest = depths.min(axis=0)
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

    def jet(self, x: float, y: float) -> Array:
        """All derivatives (6, N) at one point; NaN off the mesh."""
        finite = math.isfinite(x) and math.isfinite(y)
        t, xi, depth = self._searched(x, y) if finite else self._searched(_FAR, _FAR)
        if not depth > -_ROUNDING:
            return np.full((len(ORDERS), self.coefficients.shape[-1]), np.nan)
        return self._chained[t] @ monomials(xi) @ self.coefficients[t]

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
