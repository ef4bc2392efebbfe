"""Bases whose functions are products of one in x and one in y: values, slopes, grids."""

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kappaskin.bases.basis import ORDERS, Order
from kappaskin.bases.functions import FunctionBasis
from kappaskin.errors import Refusal
from kappaskin.frames import Array

_IN_X, _IN_Y = np.array(ORDERS, np.intp).T
_ALIKE = np.array([[1.0], [0.0], [0.0]])  # along y of a strip


@dataclass(frozen=True, eq=False)
class GridMap:
    """A map from coefficients to values on a grid, made once and called per frame."""

    X: Array
    Y: Array

    def __call__(self, coefficients: Array) -> Array:
        """Values (..., ny, nx) for `coefficients` (..., Ni, Nj)."""
        if coefficients.ndim == 2:
            return self.Y.dot(coefficients.T).dot(self.X.T)  # a quarter faster for one frame
        return self.Y @ np.swapaxes(coefficients, -1, -2) @ self.X.T


@dataclass(frozen=True)
class ProductBasis(FunctionBasis):
    """Ni x Nj products of Ni functions of x and Nj functions of y on a rectangle.

    On a strip they are the Ni functions of x alone, alike along y (Nj = 1).
    """

    def __post_init__(self) -> None:
        if self.Ni < 1 or self.Nj < 1:
            raise Refusal(f"expected at least 1 x 1 functions, got {self.Ni} x {self.Nj}")
        if self.patch.strip and self.Nj != 1:
            raise Refusal(
                f"a strip is alike along y: expected {self.Ni} x 1 functions, got "
                f"{self.Ni} x {self.Nj}"
            )

    @abstractmethod
    def _along(self, x: Array, length: float, count: int, derivative: int) -> Array:
        """The derivative of `count` functions on [0, `length`], (P, count), at `x` (P,).

        Of order -1 it is the integral whose values at 0 and `length` cancel, of order -2 the
        integral of that one whose mean is zero.
        """

    @abstractmethod
    def _factors(self, x: float, y: float) -> tuple[Array, Array]:
        """What every derivative at one point is a product of: in x (6, Ni), and in y (6, Nj)."""

    def _along_x(self, x: Array, derivative: int) -> Array:
        if derivative not in (-2, -1, 0, 1, 2):
            raise Refusal(f"expected a derivative of order -2 to 2, got {derivative}")
        return self._along(x, self.patch.a, self.Ni, derivative)

    def _along_y(self, y: Array, derivative: int) -> Array:
        if derivative not in (0, 1, 2):
            raise Refusal(f"expected a derivative of order 0, 1 or 2 along y, got {derivative}")
        if self.patch.strip:
            return np.full((len(y), 1), float(derivative == 0))
        return self._along(y, self.patch.b, self.Nj, derivative)

    def _place(self, x: float, y: float) -> Array:
        in_x, in_y = self._factors(x, y)
        return (in_x[:, :, None] * in_y[:, None, :]).reshape(6, self.size)

    def value(self, x: float, y: float, coefficients: Array) -> float:
        in_x, in_y = self._factors(x, y)
        return float(in_x[0].dot(coefficients).dot(in_y[0]))

    def at(self, positions: Array, dx: int = 0, dy: int = 0) -> Array:
        """Every function's derivative of order `dx`, `dy`, (P, Ni Nj), at `positions` (P, 2)."""
        X, Y = self._along_x(positions[:, 0], dx), self._along_y(positions[:, 1], dy)
        return (X[:, :, None] * Y[:, None, :]).reshape(len(positions), self.size)

    def on_grid(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> GridMap:
        """The map from coefficients to that derivative on the grid of `x` (nx,), `y` (ny,)."""
        return GridMap(self._along_x(x, dx), self._along_y(y, dy))

    @cached_property
    def _rules(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Points and weights along x and along y: Gauss, exact to rounding."""
        along_y = 1 if self.patch.strip else 2 * self.Nj + 16
        return gauss(self.patch.a, 2 * self.Ni + 16), gauss(self.patch.b, along_y)

    def quadrature(self) -> tuple[Array, Array]:
        """Points (Q, 2) in m and weights (Q,) in m^2: Gauss, exact to rounding."""
        (x, wx), (y, wy) = self._rules
        points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        return points, np.multiply.outer(wx, wy).ravel()

    def overlap(self, one: Order, other: Order) -> Array:
        """The integrals (N, N) of one derivative of each function times another of each.

        Of products they are products of an integral along x and one along y.
        """
        (x, wx), (y, wy) = self._rules
        along_x: Array = (self._along_x(x, one[0]).T * wx) @ self._along_x(x, other[0])
        along_y: Array = (self._along_y(y, one[1]).T * wy) @ self._along_y(y, other[1])
        return np.kron(along_x, along_y).astype(float)

    def _without_mean(self, means: Array) -> Array:
        """The combinations (N, N - Nj) of products whose factor along x has no mean.

        Of `means` (Ni,) of the functions of x the first is not zero: it is eliminated.
        """
        along_x: Array = np.vstack([-means[1:] / means[0], np.eye(self.Ni - 1)])
        return np.kron(along_x, np.eye(self.Nj)).astype(float)


class JetProductBasis(ProductBasis):
    """Products of functions that are told at one place of a side at a time."""

    @abstractmethod
    def _jet(self, x: float, length: float, count: int) -> Array:
        """Values, slopes and second derivatives (3, count) of the same at one place."""

    def _factors(self, x: float, y: float) -> tuple[Array, Array]:
        X = self._jet(x, self.patch.a, self.Ni)
        Y = _ALIKE if self.patch.strip else self._jet(y, self.patch.b, self.Nj)
        return X[_IN_X], Y[_IN_Y]


def gauss(length: float, count: int) -> tuple[Array, Array]:
    """Points and weights of Gauss and Legendre on [0, length]."""
    t, w = np.polynomial.legendre.leggauss(count)
    return (t + 1) * length / 2, w * length / 2
