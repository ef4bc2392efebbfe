"""What bases have in common: their numbers of functions, and what these are at one point."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

from kappaskin.frames import Array
from kappaskin.skin import Patch


@dataclass(frozen=True)
class FunctionBasis(ABC):
    """Ni x Nj functions on a patch, all of them free, each with some curvature."""

    patch: Patch
    Ni: int
    Nj: int

    @property
    def shape(self) -> tuple[int, int]:
        return self.Ni, self.Nj

    @property
    def size(self) -> int:
        return self.Ni * self.Nj

    @property
    def free(self) -> Array | None:
        return None

    @property
    def unseen(self) -> Array | None:
        return None

    @abstractmethod
    def _place(self, x: float, y: float) -> Array:
        """Every function's derivatives at one point, (6, N), in the order of `ORDERS`."""

    @cached_property
    def _last(self) -> dict[tuple[float, float], Array]:
        return {}

    def jet(self, x: float, y: float) -> Array:
        """Every function's derivatives at one point, (6, N); the last point's are remembered."""
        if (x, y) not in self._last:
            self._last.clear()
            self._last[x, y] = self._place(x, y)
        return self._last[x, y]

    def value(self, x: float, y: float, coefficients: Array) -> float:
        """The value at one point of the shape with `coefficients` (Ni, Nj)."""
        return float(self.jet(x, y)[0].dot(coefficients.ravel()))
