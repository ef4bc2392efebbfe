"""Loads on a patch, as what each basis function feels of them: a point, a line."""

import math
from dataclasses import dataclass, fields, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from kappaskin.bases import Basis, SineBasis
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.skin import Patch, Polygon


class Load(Protocol):
    """A force in N somewhere on a patch; positive pushes along the normal."""

    @property
    def force(self) -> float: ...

    def centre(self) -> Array:
        """Its point of application (2,) in m."""
        ...

    def check(self, patch: Patch) -> None:
        """Refuse a load that does not lie on `patch`."""
        ...

    def shifted(self, dx: float, dy: float) -> "Load":
        """The same load moved by `dx`, `dy` in m."""
        ...

    def scaled(self, factor: float) -> "Load":
        """The same load with `factor` times the force."""
        ...

    def modal(self, basis: Basis) -> Array:
        """The force times each function's mean under the load, (Ni, Nj) in N."""
        ...


def check_on(load: Load, patch: Patch, points: ArrayLike) -> None:
    """Refuse a `load` of no finite force, or whose `points` (P, 2) are not all on `patch`."""
    if not math.isfinite(load.force):
        raise Refusal(f"expected a finite force in N, got {load.force}")
    if not patch.contains(np.asarray(points)).all():
        raise Refusal(
            f"expected a load on the {patch.name}, got {load}; "
            "positions are in metres from the corner x = y = 0"
        )


_t, _w = np.polynomial.legendre.leggauss(96)
_LINE = (_t + 1) / 2, _w / 2  # Gauss points and weights on [0, 1]: exact for our functions


@dataclass(frozen=True)
class PointLoad:
    """A force in N at (x, y) in m."""

    x: float
    y: float
    force: float = 1.0

    def centre(self) -> Array:
        return np.array([self.x, self.y])

    def check(self, patch: Patch) -> None:
        check_on(self, patch, self.centre()[None])

    def shifted(self, dx: float, dy: float) -> "PointLoad":
        return replace(self, x=self.x + dx, y=self.y + dy)

    def scaled(self, factor: float) -> "PointLoad":
        return replace(self, force=self.force * factor)

    def modal(self, basis: Basis) -> Array:
        return self.force * basis.at(self.centre()[None]).reshape(basis.shape)


@dataclass(frozen=True)
class LineLoad:
    """A force in N spread evenly along the line from (x0, y0) to (x1, y1) in m."""

    x0: float
    y0: float
    x1: float
    y1: float
    force: float = 1.0

    def centre(self) -> Array:
        return np.array([self.x0 + self.x1, self.y0 + self.y1]) / 2

    def check(self, patch: Patch) -> None:
        check_on(self, patch, [(self.x0, self.y0), (self.x1, self.y1)])
        if isinstance(patch, Polygon):  # what else there is has no inward corner
            check_on(self, patch, self._along())

    def _along(self) -> Array:
        """The points (G, 2) that stand for the line."""
        s = _LINE[0][:, None]
        return (1 - s) * (self.x0, self.y0) + s * (self.x1, self.y1)

    def shifted(self, dx: float, dy: float) -> "LineLoad":
        x0, y0, x1, y1, force = (getattr(self, f.name) for f in fields(self))
        return LineLoad(x0 + dx, y0 + dy, x1 + dx, y1 + dy, force)

    def scaled(self, factor: float) -> "LineLoad":
        return replace(self, force=self.force * factor)

    def modal(self, basis: Basis) -> Array:
        if not isinstance(basis, SineBasis) or basis.patch.strip:
            return self.force * (_LINE[1] @ basis.at(self._along())).reshape(basis.shape)
        # The mean over s in [0, 1] of sin(A + B s) sin(C + F s): the product is half a difference
        # of cosines, and the mean of a cosine is its value at the middle times a sinc.
        ki, kj = basis.wavenumbers
        A, B = ki[:, None] * self.x0, ki[:, None] * (self.x1 - self.x0)
        C, F = kj[None, :] * self.y0, kj[None, :] * (self.y1 - self.y0)

        def mean_cosine(phase: Array, turn: Array) -> Array:
            return np.cos(phase + turn / 2) * np.sinc(turn / (2 * np.pi))

        return self.force / 2 * (mean_cosine(A - C, B - F) - mean_cosine(A + C, B + F))


def is_point(load: Load) -> bool:
    """Whether all of the force acts at one point."""
    if isinstance(load, LineLoad):
        return (load.x0, load.y0) == (load.x1, load.y1)
    return isinstance(load, PointLoad)
