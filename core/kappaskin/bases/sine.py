"""Sine products: the shapes of a skin that is hinged along its edges."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

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
        end = np.cos(k * length)
        if derivative == -2:
            tilt = np.multiply.outer(x - length / 2, (1 + end) / (2 * k))
            return tilt - np.sin(kx) / k**2 + (1 - end) / (k**3 * length)
        if derivative == -1:
            return ((1 + end) / 2 - np.cos(kx)) / k
        if derivative == 0:
            return np.sin(kx)
        return k * np.cos(kx) if derivative == 1 else -(k**2) * np.sin(kx)

    def _jet(self, x: float, length: float, count: int) -> Array:
        jet, kx = np.empty((3, count)), _wavenumbers(length, count) * x
        jet[2] = np.sin(kx, out=jet[0])
        np.cos(kx, out=jet[1])
        jet *= _factors(length, count)
        return jet


@lru_cache(64)
def _wavenumbers(length: float, count: int) -> Array:
    """The wave numbers i pi/length (count,) in rad/m, from i = 1 on."""
    return np.arange(1.0, count + 1) * np.pi / length


@lru_cache(64)
def _factors(length: float, count: int) -> Array:
    """What the derivatives of orders 0 to 2 multiply sines and cosines by, (3, count)."""
    k = _wavenumbers(length, count)
    return np.stack([np.ones(count), k, -k * k])
