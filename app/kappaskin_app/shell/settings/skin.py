"""Settings of the simulated skin: its shape, how it is held, its elements and what is below it."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from kappaskin.scenes import PARTS
from kappaskin.skin import Disk, Patch, Polygon
from kappaskin_app.shell.settings.asks import MILLIMETRES, Choice, Range, asked, asked_as

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


_SKIN = PARTS["skin"]


def _side(axis: str, more: str = "") -> Range:
    tip = f"Length of the skin along {axis}{more}. The loads keep their places relative to it."
    return Range(f"Length along {axis}", tip, 0.005, 1.0, 0.001, *MILLIMETRES, decimals=1)


def _elements(axis: str, letter: str) -> Range:
    tip = f"{letter}, the number of sensing elements along {axis}, each amid its own tile."
    return Range(f"Elements along {axis}", tip, 1, 32, 1)


@dataclass(frozen=True)
class Skin:
    """The skin, in SI units; which of its numbers count, its shape says (`SHAPES`)."""

    shape: str = asked(
        "flat",
        Choice(
            "Shape",
            "The flat patch of the paper's Table 1; its fingertip: half a circle, bent along x and "
            "straight along y; or a flat tile, round or with six corners. Choosing one brings its "
            "usual size, force and height.",
            tuple((name, shape.label) for name, shape in SHAPES.items()),
        ),
    )
    side_x: float = asked(0.1, _side("x", ", along the arc where it is bent"))
    side_y: float = asked(0.1, _side("y"))
    base_radius: float = asked(
        0.0129,
        Range(
            "Base radius",
            "Radius of the arc that the skin makes at rest; the paper's fingertip has 12.9 mm.",
            0.002,
            1.0,
            0.0005,
            *MILLIMETRES,
            decimals=1,
        ),
    )
    rim_radius: float = asked(
        0.05,
        Range(
            "Rim radius",
            "From the middle of the skin to its rim, or to its corners.",
            0.005,
            0.5,
            0.001,
            *MILLIMETRES,
            decimals=1,
        ),
    )
    edge: str = asked_as(_SKIN.key("edge"), "hinged")
    elements_x: int = asked(10, _elements("x", "m"))
    elements_y: int = asked(10, _elements("y", "n"))
    dead_elements: tuple[int, ...] = ()  # by a demonstration
    tension: float = asked_as(_SKIN.key("tension"), 0.0, decimals=1, most=1000.0)
    foam: float = asked_as(_SKIN.key("foundation"), 0.0, step=1e3, decimals=1, most=1e7)
    fluid: bool = asked_as(_SKIN.key("fluid"), False)
