"""Shapes of skin that a person may choose; another one is another line here."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from kappaskin.skin import Disk, Patch, Polygon

_FINGERTIP = 0.0129  # m, the paper's


@dataclass(frozen=True)
class Shape:
    """A shape made from the settings named in `asks`, with what else it `begins` as when chosen.

    `rate` in frames/s is what a simulation of it can keep up.
    """

    label: str
    make: Callable[..., Patch]
    asks: Mapping[str, float]
    begins: Mapping[str, float] = field(default_factory=dict[str, float])
    rate: float = 500.0


def _strip(side_x: float, side_y: float, base_radius: float) -> Patch:
    """The paper's planar finger: an arc that is alike all along its width."""
    return Patch(side_x, side_y, base_radius, strip=True)


def _hexagon(rim_radius: float) -> Patch:
    """Its corners `rim_radius` from its middle, two of them on the left and right."""
    height = math.sqrt(3) / 2
    corners = ((0.5, 0.0), (1.5, 0.0), (2.0, height), (1.5, 2 * height), (0.5, 2 * height))
    return Polygon([(rim_radius * x, rim_radius * y) for x, y in (*corners, (0.0, height))])


_AS_TABLE_1 = {"force": 0.15, "exaggeration": 6.0}
SHAPES = {
    "flat": Shape("Flat patch", Patch, {"side_x": 0.1, "side_y": 0.1}, _AS_TABLE_1),
    "cylinder": Shape(
        "Cylinder (fingertip)",
        Patch,
        {"side_x": math.pi * _FINGERTIP, "side_y": 0.04, "base_radius": _FINGERTIP},
        {"force": 1.2, "exaggeration": 30.0},
    ),
    "strip": Shape(
        "Strip (fingertip)",
        _strip,
        {"side_x": math.pi * _FINGERTIP, "side_y": 0.04, "base_radius": _FINGERTIP},
        {"force": 0.5, "exaggeration": 30.0},
    ),
    "disk": Shape("Disk", Disk, {"rim_radius": 0.05}, _AS_TABLE_1, rate=200.0),
    "hexagon": Shape("Hexagon", _hexagon, {"rim_radius": 0.05}, _AS_TABLE_1, rate=100.0),
}
"""By name; `make` is called with the settings named in `asks`, in their order."""
