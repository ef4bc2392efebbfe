"""Settings of the simulated scene: its skin, load, noise, electronics, and what is scanned."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from kappaskin.scenes import PARTS
from kappaskin.skin import Disk, Patch, Polygon
from kappaskin_app.shell.settings.asks import MILLIMETRES, PER_METRE, Choice, Range, asked, asked_as

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


@dataclass(frozen=True)
class Written:
    """The TOML `text` of a scene; it is called as `file` is, and what it names lies beside that."""

    text: str
    file: Path


@dataclass(frozen=True)
class Own:
    """The scene that is `written`, or none: then the panels say what is simulated."""

    written: Written | None = None


TABLE_1_CASES = ("centre", "off-centre", "line")
LOAD_CASES = (
    ("circle", "Moving point"),
    ("centre", "Centred point"),
    ("off-centre", "Off-centre point"),
    ("line", "Skewed line"),
    ("point", "Point, free"),
    ("two-points", "Two points, free"),
    ("free-line", "Line, free"),
    ("disc", "Disc, free"),
    ("rectangle", "Rectangle, free"),
    ("gaussian", "Gaussian, free"),
)
TWO_ENDED = ("two-points", "free-line")
SPREAD_CASES = ("disc", "rectangle", "gaussian")
FREE_CASES = ("point", *TWO_ENDED, *SPREAD_CASES)
READY_CASES = tuple(case for case, _ in LOAD_CASES if case not in FREE_CASES)
SIZES = {"disc": "Radius", "rectangle": "Width along x", "gaussian": "Std. deviation"}
"""What the size of a spread load is called."""


def _position(default: float, label: str, tip: str) -> Any:
    return asked(default, Range(label, tip, 0.0, 1.0, 0.001, *MILLIMETRES, decimals=1))


def _size(default: float, label: str, tip: str) -> Any:
    return asked(default, Range(label, tip, 0.0005, 1.0, 0.0005, *MILLIMETRES, decimals=1))


@dataclass(frozen=True)
class LoadSettings:
    """The load in SI units; a free one has its place on the skin and its force."""

    load_case: str = asked(
        "circle",
        Choice(
            "Case",
            "What presses on the simulated skin. Drag the load on the skin with the mouse to move "
            "it freely.",
            LOAD_CASES,
        ),
    )
    force: float = asked(
        0.15,
        Range(
            "Force",
            "Total force of a free load; the other cases have the force that displaces Table 1's "
            "patch as there, and another skin no more steeply.",
            -50.0,
            50.0,
            0.01,
            1.0,
            "N",
            3,
        ),
    )
    x: float = _position(0.05, "x", "Where the middle of the load presses, or the line begins.")
    y: float = _position(0.05, "y", "Where the middle of the load presses, or the line begins.")
    x_end: float = _position(0.075, "x, second", "The second point, or the end of the line.")
    y_end: float = _position(0.075, "y, second", "The second point, or the end of the line.")
    size: float = _size(
        0.005,
        "Size",
        "How far the load is spread: a disc's radius, a rectangle's width along x, or the standard "
        "deviation of a Gaussian, which needs the skin four times as far on every side. A load "
        "that would reach over the rim moves inwards.",
    )
    size_y: float = _size(0.02, "Width along y", "A rectangle's width along y.")


@dataclass(frozen=True)
class Noise:
    """The noise of each reading, repeatable by its seed."""

    noise_kind: str = asked(
        "uniform",
        Choice(
            "Kind",
            "How the noise added to each simulated reading is distributed.",
            (("none", "None"), ("uniform", "Uniform (Table 1)"), ("gaussian", "Gaussian")),
        ),
    )
    noise_rms: float = asked(
        0.231,
        Range(
            "RMS",
            "Root mean square of the curvature noise. Table 1 has 0.231 1/m, even within "
            "+-0.40 1/m.",
            0.0,
            20.0,
            0.05,
            *PER_METRE,
            decimals=3,
        ),
    )
    noise_seed: int = asked(
        0, Range("Seed", "The same seed gives the same noise again.", 0, 999_999, 1)
    )


_CONVERTER = PARTS["converter"]
PER_CENT = (1e2, "%")


@dataclass(frozen=True)
class Electronics:
    """The chain from gage to count."""

    electronics: str = asked_as(
        PARTS["electronics"].key("like"),
        "modern",
        label="Electronics",
        tip="Gages, bridge, amplifier and converter (Figs. 4 and 5). The paper's prototypes "
        "convert 12 bits in 20 \N{MICRO SIGN}s. Choosing one brings its converter.",
    )
    bits: int = asked_as(_CONVERTER.key("bits"), 16)
    conversion_time: float = asked_as(
        _CONVERTER.key("conversion_time"), 5e-6, step=1e-6, decimals=1, least=1e-6, most=1e-3
    )


@dataclass(frozen=True)
class Spoils:
    """What the mechanics of the gages does to a reading, besides noise."""

    loops: str = asked(
        "none",
        Choice(
            "Hysteresis",
            "Loops of a reading against the curvature, as in Fig. 8: the widest gap of the second "
            "prototype is 7 1/m, of the first three times that.",
            (("none", "None"), ("second", "Second prototype"), ("first", "First prototype")),
        ),
    )
    creep: float = asked(
        0.0,
        Range(
            "Creep",
            "Share of a held reading that relaxes away, with a time constant of 5 s (standard "
            "linear solid).",
            0.0,
            0.5,
            0.01,
            *PER_CENT,
            decimals=0,
        ),
    )
    tolerance: float = asked(
        0.0,
        Range(
            "Tolerance",
            "Spread of the gains of gages that were never calibrated, with offsets of as many "
            "tenths of 1/m: what the calibration takes out.",
            0.0,
            0.2,
            0.01,
            *PER_CENT,
            decimals=0,
        ),
    )


@dataclass(frozen=True)
class Scanning:
    """Which elements every frame scans."""

    region: str = asked(
        "off",
        Choice(
            "Scan",
            "Sampling a region of interest buys rate (paper, section 6.2). The force/torque sensor "
            "stands at the base of the fingertip (intrinsic contact sensing). What tells most is "
            "chosen by the estimator Tracking; with any other the channels take turns. A sensor on "
            "a line scans around the contact or chosen elements; the rest is simulated only.",
            (
                ("off", "All elements"),
                ("skin", "Around the contact"),
                ("intrinsic", "By force and torque"),
                ("elements", "Chosen elements"),
                ("adaptive", "What tells most"),
            ),
        ),
    )
    region_radius: float = asked(
        0.025,
        Range(
            "Radius",
            "Elements within it of the contact are in every frame.",
            0.002,
            0.5,
            0.001,
            *MILLIMETRES,
            decimals=1,
        ),
    )
    region_share: float = asked(
        0.1,
        Range(
            "Share",
            "Of the other elements, those that take their turn in each frame; their last readings "
            "are held until then. Of all channels, those that are scanned where they tell most, "
            "at least 5 %.",
            0.0,
            1.0,
            0.05,
            *PER_CENT,
            decimals=0,
        ),
    )
    region_elements: tuple[int, ...] = ()  # chosen on a heatmap
