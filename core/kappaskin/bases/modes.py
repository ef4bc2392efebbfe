"""Bases of whole modes, not products: values at points and on the part of a grid on the skin."""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kappaskin.bases.basis import ORDERS, Order
from kappaskin.bases.functions import FunctionBasis
from kappaskin.errors import Refusal
from kappaskin.frames import Array

_MOST = 1024  # modes: more take minutes to make


@dataclass(frozen=True, eq=False)
class PointMap:
    """A map from coefficients to values on a grid, as one dense product; NaN off the skin.

    It takes as long as its matrix is read: in single precision, good to a ten-millionth of the
    coefficients, half as long.
    """

    values: NDArray[np.float32]
    grid: tuple[int, int]

    def __call__(self, coefficients: Array) -> Array:
        """Values (..., ny, nx) for `coefficients` (..., Ni, Nj)."""
        flat = coefficients.reshape(*coefficients.shape[:-2], -1).astype(np.float32)
        values = np.dot(flat, self.values.T)
        return values.astype(float).reshape(*flat.shape[:-1], *self.grid)


@dataclass(frozen=True)
class ModeBasis(FunctionBasis):
    """The first Ni x Nj modes, by frequency, of a flat skin; their mean square is 1/4 as sines'."""

    def __post_init__(self) -> None:
        if not (self.Ni > 0 and self.Nj > 0 and self.size <= _MOST):
            raise Refusal(
                f"expected 1 x 1 to {_MOST} functions on a {self.patch.name}, got "
                f"{self.Ni} x {self.Nj}"
            )

    @abstractmethod
    def _derivative(self, positions: Array, order: Order) -> Array:
        """The derivative (P, N) of one order at `positions` (P, 2); NaN off the skin."""

    def at(self, positions: Array, dx: int = 0, dy: int = 0) -> Array:
        """Every function's derivative of order `dx`, `dy`, (P, N), at `positions`; NaN off it."""
        if (dx, dy) not in ORDERS:
            raise Refusal(
                f"expected derivatives up to second order, got order {dx} along x and {dy} along y"
            )
        return self._derivative(positions, (dx, dy))

    def on_grid(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> PointMap:
        """The map from coefficients to that derivative on the grid of `x` (nx,), `y` (ny,)."""
        points = np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))])
        return PointMap(self.at(points, dx, dy).astype(np.float32), (len(y), len(x)))
