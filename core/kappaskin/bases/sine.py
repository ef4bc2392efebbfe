"""Sine products: the shapes of a skin that is hinged along its edges."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from kappaskin.bases.basis import ORDERS
from kappaskin.bases.product import ProductBasis
from kappaskin.errors import Refusal
from kappaskin.frames import Array


@dataclass(frozen=True)
class SineBasis(ProductBasis):
    """The Ni x Nj products sin(i pi x/a) sin(j pi y/b), zero along the edges (Eq. 1).

    The ends of a bent skin are pinned and it is inextensible, so that f has no mean along the arc;
    with `sliding` ends it may have one.
    """

    sliding: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self._pinned and self.Ni < 2:
            raise Refusal(
                "a pinned inextensible arc cannot bend in its first function alone: expected at "
                "least 2 functions along x, got 1; use more, or let the ends slide"
            )

    @property
    def _pinned(self) -> bool:
        return self.patch.base_curvature > 0 and not self.sliding

    @property
    def free(self) -> Array | None:
        """On a pinned arc, c_1 = - sum over odd i >= 3 of c_i / i leaves Ni - 1 of Ni."""
        return self._inextensible if self._pinned else None

    @cached_property
    def _inextensible(self) -> Array:
        i = np.arange(1, self.Ni + 1)
        return self._without_mean(np.where(i % 2, 1 / i, 0.0))

    @cached_property
    def wavenumbers(self) -> tuple[Array, Array]:
        """Wave numbers i pi/a (Ni,) and j pi/b (Nj,) in rad/m; 0 along y of a strip."""
        ki, kj = _wavenumbers(self.patch.a, self.Ni), _wavenumbers(self.patch.b, self.Nj)
        return ki, kj * (not self.patch.strip)

    @cached_property
    def laplacian(self) -> Array:
        """Eigenvalues k_i^2 + k_j^2 of minus the Laplacian, (Ni, Nj) in 1/m^2."""
        ki, kj = self.wavenumbers
        return np.add.outer(ki**2, kj**2)

    def _along(self, x: Array, length: float, count: int, derivative: int) -> Array:
        k = _wavenumbers(length, count)
        kx = np.multiply.outer(x, k)
        if derivative == 0:
            return np.sin(kx)
        end = np.cos(k * length)
        if derivative == -2:
            tilt = np.multiply.outer(x - length / 2, (1 + end) / (2 * k))
            return tilt - np.sin(kx) / k**2 + (1 - end) / (k**3 * length)
        if derivative == -1:
            return ((1 + end) / 2 - np.cos(kx)) / k
        return k * np.cos(kx) if derivative == 1 else -(k**2) * np.sin(kx)

    @cached_property
    def _waves(self) -> "_Waves":
        return _Waves(*self.wavenumbers)

    def _factors(self, x: float, y: float) -> tuple[Array, Array]:
        factors = self._waves(x, y)
        return factors[:, : self.Ni], factors[:, self.Ni :]


class _Waves:
    """Sines of x and of y with their derivatives, all from one exponential."""

    def __init__(self, ki: Array, kj: Array) -> None:
        k = np.concatenate([ki, kj])
        of_y = np.arange(len(k)) >= len(ki)
        self._turns = 1j * np.stack([k * ~of_y, k * of_y])
        order = np.array([[dx] * len(ki) + [dy] * len(kj) for dx, dy in ORDERS], np.intp)
        cosines = (order % 2 == 1) | (k == 0)  # on a strip: one, which is the cosine of nothing
        self._which: NDArray[np.intp] = 2 * np.arange(len(k)) + ~cosines
        self._times: Array = k**order * np.where(order == 2, -1, 1)

    def __call__(self, x: float, y: float) -> Array:
        """Derivatives (6, Ni + Nj) along x and y, in the order of `ORDERS`."""
        values = np.exp(np.dot((x, y), self._turns)).view(float).take(self._which)
        values *= self._times
        return values


@lru_cache(64)
def _wavenumbers(length: float, count: int) -> Array:
    """The wave numbers i pi/length (count,) in rad/m, from i = 1 on."""
    return np.arange(1.0, count + 1) * np.pi / length
