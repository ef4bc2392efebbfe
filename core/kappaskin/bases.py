"""Basis functions on a patch: values and derivatives, at points and on grids."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.patch import Patch


def _sine(k: Array, x: Array, derivative: int) -> Array:
    """The derivative of order 0, 1 or 2 of sin(k x), for every x (rows) and k (columns)."""
    kx = np.multiply.outer(x, k)
    if derivative == 0:
        return np.sin(kx)
    if derivative == 1:
        return k * np.cos(kx)
    if derivative == 2:
        return -(k**2) * np.sin(kx)
    raise Refusal(f"expected a derivative of order 0, 1 or 2, got {derivative}")


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
class SineBasis:
    """The Ni x Nj products sin(i pi x/a) sin(j pi y/b), zero along the edges (Eq. 1).

    Coefficients are (Ni, Nj) arrays in metres; flattened, j runs fastest.
    """

    patch: Patch
    Ni: int
    Nj: int

    def __post_init__(self) -> None:
        if self.Ni < 1 or self.Nj < 1:
            raise Refusal(f"expected at least 1 x 1 functions, got {self.Ni} x {self.Nj}")

    @property
    def shape(self) -> tuple[int, int]:
        return self.Ni, self.Nj

    @property
    def size(self) -> int:
        return self.Ni * self.Nj

    @cached_property
    def wavenumbers(self) -> tuple[Array, Array]:
        """Wave numbers i pi/a (Ni,) and j pi/b (Nj,) in rad/m."""
        i, j = np.arange(1.0, self.Ni + 1), np.arange(1.0, self.Nj + 1)
        return i * np.pi / self.patch.a, j * np.pi / self.patch.b

    @cached_property
    def laplacian(self) -> Array:
        """Eigenvalues k_i^2 + k_j^2 of minus the Laplacian, (Ni, Nj) in 1/m^2."""
        ki, kj = self.wavenumbers
        return np.add.outer(ki**2, kj**2)

    def at(self, positions: Array, dx: int = 0, dy: int = 0) -> Array:
        """Every function's derivative of order `dx`, `dy`, (P, Ni Nj), at `positions` (P, 2)."""
        ki, kj = self.wavenumbers
        X, Y = _sine(ki, positions[:, 0], dx), _sine(kj, positions[:, 1], dy)
        return (X[:, :, None] * Y[:, None, :]).reshape(len(positions), self.size)

    def with_slopes(self, x: float, y: float) -> Array:
        """Every function and its slopes along x and y at one point, (3, Ni Nj)."""
        ki, kj = self.wavenumbers
        X, Y = np.sin(ki * x), np.sin(kj * y)
        slope_x, slope_y = ki * np.cos(ki * x), kj * np.cos(kj * y)
        pairs = ((X, Y), (slope_x, Y), (X, slope_y))
        return np.stack([np.multiply.outer(*pair).ravel() for pair in pairs])

    def on_grid(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> GridMap:
        """The map from coefficients to that derivative on the grid of `x` (nx,), `y` (ny,)."""
        ki, kj = self.wavenumbers
        return GridMap(_sine(ki, x, dx), _sine(kj, y, dy))
