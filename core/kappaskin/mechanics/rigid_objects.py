"""Rigid objects: spheres, cylinders, wedges, punches, blocks, by the height of their underside."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask

_SIDE = np.linspace(-1.0, 1.0, 17)
_RIM = 64
_LARGEST = 1000.0  # m
_ON = 1 + 1e-9  # of a size: a point of the keel on the rim, as computed, is on the object


class RigidObject(Protocol):
    """An object that presses on a skin, seen along the normal; x and y in m from its centre."""

    @property
    def extent(self) -> tuple[float, float]:
        """Half of its size along x and y in m."""
        ...

    def height(self, points: Array) -> Array:
        """Height (P,) in m of the underside above its lowest point, at `points` (P, 2) in m.

        Infinite where there is no object above.
        """
        ...

    def keel(self) -> Array:
        """Points (k, 2) in m where it is lowest or sharpest, which a grid's nodes would miss."""
        ...


def check_sizes(what: object, *sizes: float) -> None:
    """Raise a `Refusal` for an object `what` with a size that is not above zero, in m."""
    if not all(0 < size <= _LARGEST for size in sizes):
        raise Refusal(
            f"expected an object with sizes above zero in metres, {_LARGEST:g} at most, got {what}"
        )


def _above(height: Array, on: Mask) -> Array:
    return np.where(on, height, np.inf)


def _inside(points: Array, extent: tuple[float, float]) -> Mask:
    """Which of `points` (P, 2) lie in the rectangle of that extent."""
    x, y = np.abs(points.T)
    return (x <= _ON * extent[0]) & (y <= _ON * extent[1])


def _round(radius: float, away: Array) -> Array:
    """Rise in m of a circle at the distance `away` in m from its lowest point."""
    away = np.minimum(np.abs(away), radius)
    # away^2 over the sum: the difference of the two would lose the digits of a slight rise.
    return away**2 / (radius + np.sqrt(radius**2 - away**2))


def _along_x(length: float) -> Array:
    return np.column_stack([length / 2 * _SIDE, np.zeros_like(_SIDE)])


@dataclass(frozen=True)
class Sphere:
    """A ball of `radius` in m."""

    radius: float

    def __post_init__(self) -> None:
        check_sizes(self, self.radius)

    @property
    def extent(self) -> tuple[float, float]:
        return self.radius, self.radius

    def height(self, points: Array) -> Array:
        away = np.hypot(points[:, 0], points[:, 1])
        return _above(_round(self.radius, away), away <= _ON * self.radius)

    def keel(self) -> Array:
        return np.zeros((1, 2))


@dataclass(frozen=True)
class Cylinder:
    """A cylinder of `radius` and `length` in m, its axis along x."""

    radius: float
    length: float

    def __post_init__(self) -> None:
        check_sizes(self, self.radius, self.length)

    @property
    def extent(self) -> tuple[float, float]:
        return self.length / 2, self.radius

    def height(self, points: Array) -> Array:
        return _above(_round(self.radius, points[:, 1]), _inside(points, self.extent))

    def keel(self) -> Array:
        return _along_x(self.length)


@dataclass(frozen=True)
class Wedge:
    """A wedge with an edge of `length` along x, `width` along y, both in m.

    `angle` in rad between the flanks; the edge is rounded to `tip_radius` in m.
    """

    angle: float
    length: float
    width: float
    tip_radius: float = 0.0

    def __post_init__(self) -> None:
        check_sizes(self, self.length, self.width)
        if not 0 < self.angle < math.pi:
            raise Refusal(
                "expected an angle between the flanks of a wedge above zero and below pi rad, got "
                f"{self.angle}; for a flat face take a Block"
            )
        if not 0 <= self.tip_radius * math.cos(self.angle / 2) <= self.width / 2:
            raise Refusal(
                f"expected a tip radius of at least zero and a tip no wider than the wedge, got "
                f"{self}; make it wider, or take a Cylinder"
            )

    @property
    def extent(self) -> tuple[float, float]:
        return self.length / 2, self.width / 2

    def height(self, points: Array) -> Array:
        y = np.abs(points[:, 1])
        half, r = self.angle / 2, self.tip_radius
        # A flank touches the round tip at y = r cos(half) and goes on from there.
        flank = y / math.tan(half) - r * (1 / math.sin(half) - 1)
        height = np.where(y < r * math.cos(half), _round(r, y), flank) if r else flank
        return _above(height, _inside(points, self.extent))

    def keel(self) -> Array:
        return _along_x(self.length)


@dataclass(frozen=True)
class Punch:
    """A round punch of `radius` in m with a flat face."""

    radius: float

    def __post_init__(self) -> None:
        check_sizes(self, self.radius)

    @property
    def extent(self) -> tuple[float, float]:
        return self.radius, self.radius

    def height(self, points: Array) -> Array:
        away = np.hypot(points[:, 0], points[:, 1])
        return _above(np.zeros(len(points)), away <= _ON * self.radius)

    def keel(self) -> Array:
        angle = 2 * np.pi * np.arange(_RIM) / _RIM
        return self.radius * np.column_stack([np.cos(angle), np.sin(angle)])


@dataclass(frozen=True)
class Block:
    """A block with a flat rectangular face, `length` along x by `width` along y in m."""

    length: float
    width: float

    def __post_init__(self) -> None:
        check_sizes(self, self.length, self.width)

    @property
    def extent(self) -> tuple[float, float]:
        return self.length / 2, self.width / 2

    def height(self, points: Array) -> Array:
        return _above(np.zeros(len(points)), _inside(points, self.extent))

    def keel(self) -> Array:
        one, side = np.ones_like(_SIDE), _SIDE[:-1]
        across = np.column_stack([side, one[:-1]])
        along = np.column_stack([one[:-1], -side])
        return np.vstack([across, along, -across, -along]) * (self.length / 2, self.width / 2)
