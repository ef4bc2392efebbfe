"""Loads: forces at a point, along a line, or distributed over an area."""

import math
from abc import ABC, abstractmethod
from dataclasses import Field, dataclass, fields, replace
from functools import lru_cache
from typing import Any, ClassVar, Protocol, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike

from kappaskin.bases import Basis, CapBasis, MeshBasis, SineBasis
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.skin import Patch, Polygon


class Load(Protocol):
    """A force in N on a patch; positive presses inward."""

    @property
    def force(self) -> float: ...

    def centre(self) -> Array:
        """Point of application (2,) in m."""
        ...

    def check(self, patch: Patch) -> None:
        """Raise a `Refusal` for a load that does not lie on `patch`."""
        ...

    def shifted(self, dx: float, dy: float) -> "Load":
        """The same load moved by `dx`, `dy` in m."""
        ...

    def scaled(self, factor: float) -> "Load":
        """The same load with `factor` times the force."""
        ...

    def modal(self, basis: Basis) -> Array:
        """Modal forces (Ni, Nj) in N: the force times each function's mean under the load."""
        ...


def check_on(load: Load, patch: Patch, points: ArrayLike) -> None:
    """Raise a `Refusal` for an infinite force, or `points` (P, 2) in m that are off `patch`."""
    if not math.isfinite(load.force):
        raise Refusal(f"expected a finite force in N, got {load.force}")
    if not patch.contains(np.asarray(points)).all():
        raise Refusal(
            f"expected a load on the {patch.name}, got {load}; "
            "positions are in metres from the corner x = y = 0"
        )


_t, _w = np.polynomial.legendre.leggauss(96)
_LINE = (_t + 1) / 2, _w / 2  # Gauss points and weights on [0, 1]: exact for our functions


class CentredLoad:
    """A force in N about (x, y) in m."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]  # every kind is a dataclass
    x: float
    y: float
    force: float

    def centre(self) -> Array:
        return np.array([self.x, self.y])

    def shifted(self, dx: float, dy: float) -> Self:
        return replace(self, x=self.x + dx, y=self.y + dy)

    def scaled(self, factor: float) -> Self:
        return replace(self, force=self.force * factor)


@dataclass(frozen=True)
class PointLoad(CentredLoad):
    """A force in N at (x, y) in m."""

    x: float
    y: float
    force: float = 1.0

    def check(self, patch: Patch) -> None:
        check_on(self, patch, self.centre()[None])

    def modal(self, basis: Basis) -> Array:
        return self.force * basis.at(self.centre()[None]).reshape(basis.shape)


@dataclass(frozen=True)
class LineLoad:
    """A force in N, uniform along the line from (x0, y0) to (x1, y1) in m."""

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
        """Quadrature points (G, 2) of the line in m."""
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
    """Whether the whole force acts at one point."""
    if isinstance(load, LineLoad):
        return (load.x0, load.y0) == (load.x1, load.y1)
    return isinstance(load, PointLoad)


_INSIDE = 1 - 1e-9  # of a load's size: one that touches an edge is on the patch, as computed


class DistributedLoad(CentredLoad, ABC):
    """A force in N distributed about (x, y) in m, symmetric about the two axes through it.

    Its size is along the skin.

    By the symmetry, the mean of sin(k x) sin(l y) under the load is the product at its centre times
    the mean of cos(k x) cos(l y) about it: a multiplier per function (Eq. 9, extended).
    """

    @abstractmethod
    def _wave(self, k: Array, l: Array) -> Array:
        """Mean of cos(k x) cos(l y) under the load when it is centred on x = y = 0."""

    @abstractmethod
    def _rim(self) -> Array:
        """Points (P, 2) in m on its rim, relative to its centre."""

    @abstractmethod
    def quadrature(self, count: int) -> tuple[Array, Array]:
        """Points (Q, 2) in m, relative to its centre, and weights (Q,) whose sum is one.

        Exact to rounding for functions with up to `count` half waves across the load.
        """

    def check(self, patch: Patch) -> None:
        check_on(self, patch, self.centre()[None])  # beyond a cap's rim, angles begin anew
        check_on(self, patch, patch.around(self.x, self.y, _INSIDE * self._rim()))

    def modal(self, basis: Basis) -> Array:
        if isinstance(basis, SineBasis):
            k, l = np.meshgrid(*basis.wavenumbers, indexing="ij")
            return PointLoad(self.x, self.y, self.force).modal(basis) * self._wave(k, l)
        if isinstance(basis, CapBasis) and isinstance(self, DiscLoad | GaussianLoad):
            felt = _on_cap(replace(self, x=0.0, y=0.0, force=1.0), basis)(self.x, self.y)
            if felt is not None:
                return self.force * felt
        felt = _felt(replace(self, force=1.0), basis)
        if np.isnan(felt).any():  # a notch in the outline that passes between the rim's points
            raise Refusal(f"expected a load completely on the skin, got {self}; make it smaller")
        return self.force * felt.reshape(basis.shape)


@lru_cache(16)
def _felt(load: DistributedLoad, basis: Basis) -> Array:
    """The mean (N,) of each function under the load; NaN where that is not all on the skin."""
    # On a mesh to 1e-5: its functions are splines, which no number of points integrates exactly.
    points, weights = load.quadrature(1 if isinstance(basis, MeshBasis) else max(basis.shape))
    if isinstance(basis, CapBasis | MeshBasis):
        at = basis.patch.around(load.x, load.y, points)
    else:
        at = load.centre() + points
    return weights @ basis.at(at)


def _check_size(load: DistributedLoad, *sizes: float) -> None:
    if not all(0 < size < math.inf for size in sizes):
        raise Refusal(
            f"expected a load of a size above zero in metres, got {load}; without a size use "
            "a point or a line"
        )


def _gauss(count: int) -> tuple[Array, Array]:
    """Points on [-1, 1] and weights whose sum is one."""
    t, w = np.polynomial.legendre.leggauss(16 + count)
    return t, w / 2


_CORNERS = 64  # of a round load's rim, where it is checked


def _circle(count: int) -> Array:
    angle = 2 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _rings(radius: Array, share: Array) -> tuple[Array, Array]:
    """Points (Q, 2) on circles of `radius` (C,), and weights (Q,) that sum to `share` (C,)."""
    round_it = _circle(4 * len(radius))
    points = np.multiply.outer(radius, round_it).reshape(-1, 2)
    return points, np.repeat(share, len(round_it)) / len(round_it)


@dataclass(frozen=True)
class DiscLoad(DistributedLoad):
    """A force in N, uniform over the disc of `radius` about (x, y), all in m."""

    x: float
    y: float
    radius: float
    force: float = 1.0

    def __post_init__(self) -> None:
        _check_size(self, self.radius)

    def _wave(self, k: Array, l: Array) -> Array:
        turn = np.hypot(k, l) * self.radius
        return 2 * scipy.special.j1(turn) / turn

    def _rim(self) -> Array:
        return self.radius * _circle(_CORNERS)

    def quadrature(self, count: int) -> tuple[Array, Array]:
        t, w = _gauss(count)
        radius = (1 + t) / 2
        return _rings(self.radius * radius, 2 * radius * w)


@dataclass(frozen=True)
class GaussianLoad(DistributedLoad):
    """A force in N, distributed as a Gaussian of standard deviation `sd` about (x, y), all in m.

    It must lie on the patch up to four standard deviations from its centre: exp(-8), less than
    0.04 %, of its force lies beyond, and whether that is on the patch makes no difference.
    """

    x: float
    y: float
    sd: float
    force: float = 1.0

    def __post_init__(self) -> None:
        _check_size(self, self.sd)

    def _wave(self, k: Array, l: Array) -> Array:
        return np.exp(-(k**2 + l**2) * self.sd**2 / 2)

    def _rim(self) -> Array:
        return 4 * self.sd * _circle(_CORNERS)

    def quadrature(self, count: int) -> tuple[Array, Array]:
        t, w = _gauss(count)
        radius = 2 * (1 + t)  # in standard deviations
        share = w * radius * np.exp(-(radius**2) / 2)
        return _rings(self.sd * radius, share / share.sum())


@dataclass(frozen=True)
class RectangleLoad(DistributedLoad):
    """A force in N, uniform over `width` along x by `height` along y about (x, y), all in m."""

    x: float
    y: float
    width: float
    height: float
    force: float = 1.0

    def __post_init__(self) -> None:
        _check_size(self, self.width, self.height)

    def _wave(self, k: Array, l: Array) -> Array:
        return np.sinc(k * self.width / (2 * np.pi)) * np.sinc(l * self.height / (2 * np.pi))

    def _rim(self) -> Array:
        t = np.linspace(-1, 1, 17)
        along, one = np.concatenate([t, t]), np.repeat([-1.0, 1.0], 17)
        round_it = np.vstack([np.column_stack([along, one]), np.column_stack([one, along])])
        return round_it * (self.width / 2, self.height / 2)

    def quadrature(self, count: int) -> tuple[Array, Array]:
        t, w = _gauss(count)
        x, y = np.meshgrid(self.width / 2 * t, self.height / 2 * t)
        return np.column_stack([x.ravel(), y.ravel()]), np.multiply.outer(w, w).ravel()


class _RoundOnCap:
    """What a round load feels of the functions of a cap, by a series in its distance from the pole.

    Turned about the pole it feels as much of cos m t, and by its symmetry nothing of sin m t, from
    the azimuth of its centre. The series are Chebyshev's, from the pole to where it meets the rim.
    """

    def __init__(self, load: DiscLoad | GaussianLoad, basis: CapBasis) -> None:
        size = load.radius if isinstance(load, DiscLoad) else 4 * load.sd
        self._rim, (Ni, Nj) = basis.cap.rim_radius, basis.shape
        self._reach, self._shape = self._rim - size, basis.shape
        # Between the points of its rim that are checked, a load may pass the skin's by this much.
        self._most = self._reach * (1 + 1e-9) + size * (1 - math.cos(math.pi / _CORNERS))
        self._degrees = np.arange(2 * Ni + Nj // 2 + 10)
        if self._reach <= 0:
            return
        # A disc has fewer waves across it than a Gaussian, whose weight is no polynomial.
        waves = math.ceil(max(basis.shape) * size / self._rim)
        points, weights = load.quadrature(waves - 8 * isinstance(load, DiscLoad))
        half = points[:, 1] >= -1e-9 * size
        points, weights = (
            points[half],
            np.where(points[:, 1] > 1e-9 * size, 2, 1)[half] * weights[half],
        )
        nodes = np.pi * (self._degrees + 0.5) / len(self._degrees)
        far = self._rim + self._reach * (1 - 1e-12) * (1 + np.cos(nodes)) / 2
        around = [basis.cap.around(at, self._rim, points) for at in far.tolist()]
        felt = [basis.weighed(at, weights) for at in around]
        to_series = 2 / len(nodes) * np.cos(np.multiply.outer(self._degrees, nodes))
        to_series[0] /= 2
        self._series = to_series @ np.array(felt)

    def __call__(self, x: float, y: float) -> Array | None:
        """The means (Ni, Nj) under the load at (x, y) in m; None where it goes over the rim."""
        u, v = x - self._rim, y - self._rim
        far = math.hypot(u, v)
        if far > self._most or self._reach <= 0:
            return None
        turn, t = math.atan2(v, u), math.acos(min(2 * far / self._reach - 1, 1.0))
        felt = (np.cos(t * self._degrees) @ self._series).reshape(self._shape)
        m = (np.arange(self._shape[1]) + 1) // 2
        felt[:, 2::2] = felt[:, 1 : self._shape[1] - 1 : 2] * np.sin(m[2::2] * turn)
        felt[:, 1::2] *= np.cos(m[1::2] * turn)
        return felt


@lru_cache(8)
def _on_cap(load: DiscLoad | GaussianLoad, basis: CapBasis) -> _RoundOnCap:
    return _RoundOnCap(load, basis)
