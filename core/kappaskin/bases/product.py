"""Bases whose functions are products of one in x and one in y: values, slopes, grids."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.patch import Patch


def _sine(k: Array, x: Array, length: float, derivative: int) -> Array:
    """The derivative of order -2 to 2 of sin(k x), for every x (rows) and k (columns).

    Of order -1 it is the integral whose values at 0 and `length` cancel, of order -2 the integral
    of that one whose mean is zero.
    """
    kx = np.multiply.outer(x, k)
    end = np.cos(k * length)
    if derivative == -2:
        tilt = np.multiply.outer(x - length / 2, (1 + end) / (2 * k))
        return tilt - np.sin(kx) / k**2 + (1 - end) / (k**3 * length)
    if derivative == -1:
        return ((1 + end) / 2 - np.cos(kx)) / k
    if derivative == 0:
        return np.sin(kx)
    if derivative == 1:
        return k * np.cos(kx)
    if derivative == 2:
        return -(k**2) * np.sin(kx)
    raise Refusal(f"expected a derivative of order -2 to 2, got {derivative}")


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

    On a strip they are the Ni functions sin(i pi x/a) alone, alike along y (Nj = 1). The ends of a
    bent skin are pinned and it is inextensible, so that f has no mean along the arc; with
    `sliding` ends it may have one.
    """

    patch: Patch
    Ni: int
    Nj: int
    sliding: bool = False

    def __post_init__(self) -> None:
        if self.Ni < 1 or self.Nj < 1:
            raise Refusal(f"expected at least 1 x 1 functions, got {self.Ni} x {self.Nj}")
        if self.patch.strip and self.Nj != 1:
            raise Refusal(
                f"a strip is alike along y: expected {self.Ni} x 1 functions, got "
                f"{self.Ni} x {self.Nj}"
            )
        if self._pinned and self.Ni < 2:
            raise Refusal(
                "a pinned inextensible arc cannot bend in its first function alone: expected at "
                "least 2 functions along x, got 1; use more, or let the ends slide"
            )

    @property
    def _pinned(self) -> bool:
        return self.patch.base_curvature > 0 and not self.sliding

    @property
    def shape(self) -> tuple[int, int]:
        return self.Ni, self.Nj

    @property
    def size(self) -> int:
        return self.Ni * self.Nj

    @property
    def free(self) -> Array | None:
        """On a pinned arc, c_1 = - sum over odd i >= 3 of c_i / i leaves Ni - 1 of Ni."""
        return self._inextensible if self._pinned else None

    @cached_property
    def _inextensible(self) -> Array:
        i = np.arange(2, self.Ni + 1)
        along_x: Array = np.vstack([np.where(i % 2, -1 / i, 0.0), np.eye(self.Ni - 1)])
        return np.kron(along_x, np.eye(self.Nj)).astype(float)

    @cached_property
    def wavenumbers(self) -> tuple[Array, Array]:
        """Wave numbers i pi/a (Ni,) and j pi/b (Nj,) in rad/m; 0 along y of a strip."""
        i, j = np.arange(1.0, self.Ni + 1), np.arange(1.0, self.Nj + 1)
        return i * np.pi / self.patch.a, j * np.pi / self.patch.b * (not self.patch.strip)

    @cached_property
    def laplacian(self) -> Array:
        """Eigenvalues k_i^2 + k_j^2 of minus the Laplacian, (Ni, Nj) in 1/m^2."""
        ki, kj = self.wavenumbers
        return np.add.outer(ki**2, kj**2)

    def _along_x(self, x: Array, derivative: int) -> Array:
        return _sine(self.wavenumbers[0], x, self.patch.a, derivative)

    def _along_y(self, y: Array, derivative: int) -> Array:
        if self.patch.strip:
            return np.full((len(y), 1), float(derivative == 0))
        return _sine(self.wavenumbers[1], y, self.patch.b, derivative)

    def at(self, positions: Array, dx: int = 0, dy: int = 0) -> Array:
        """Every function's derivative of order `dx`, `dy`, (P, Ni Nj), at `positions` (P, 2)."""
        X, Y = self._along_x(positions[:, 0], dx), self._along_y(positions[:, 1], dy)
        return (X[:, :, None] * Y[:, None, :]).reshape(len(positions), self.size)

    def with_slopes(self, x: float, y: float) -> Array:
        """Every function and its slopes along x and y at one point, (3, Ni Nj)."""
        ki, kj = self.wavenumbers
        X, slope_x, slope_y = np.sin(ki * x), ki * np.cos(ki * x), kj * np.cos(kj * y)
        Y = np.ones(1) if self.patch.strip else np.sin(kj * y)
        pairs = ((X, Y), (slope_x, Y), (X, slope_y))
        return np.stack([np.multiply.outer(*pair).ravel() for pair in pairs])

    def on_grid(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> GridMap:
        """The map from coefficients to that derivative on the grid of `x` (nx,), `y` (ny,)."""
        return GridMap(self._along_x(x, dx), self._along_y(y, dy))

    def quadrature(self) -> tuple[Array, Array]:
        """Points (Q, 2) in m and weights (Q,) in m^2: Gauss, exact to rounding."""
        x, wx = _gauss(self.patch.a, 2 * self.Ni + 16)
        y, wy = _gauss(self.patch.b, 1 if self.patch.strip else 2 * self.Nj + 16)
        points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        return points, np.multiply.outer(wx, wy).ravel()


def _gauss(length: float, count: int) -> tuple[Array, Array]:
    """Points and weights of Gauss and Legendre on [0, length]."""
    t, w = np.polynomial.legendre.leggauss(count)
    return (t + 1) * length / 2, w * length / 2
