"""Settings of the simulated scene: skin, load, noise, electronics and scan."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from kappaskin.scenes import PARTS
from kappaskin.skin import Cap, Disk, Patch, Polygon
from kappaskin_app.shell.settings.form_fields import (
    MILLIMETRES,
    PER_METRE,
    Choice,
    Range,
    setting,
    setting_of_key,
)

_FINGERTIP = 0.0129  # m, the paper's
_CAP_ANGLE = math.radians(80)


@dataclass(frozen=True)
class Shape:
    """A shape with its `lengths` by setting, and the `defaults` of other settings when selected.

    `rate` in frames/s is the highest that the simulation sustains.
    """

    label: str
    make: Callable[..., Patch]
    lengths: Mapping[str, float]
    defaults: Mapping[str, Any] = field(default_factory=dict[str, Any])
    rate: float = 500.0


def _strip(side_x: float, side_y: float, base_radius: float) -> Patch:
    """The paper's planar finger: an arc, uniform along its width."""
    return Patch(side_x, side_y, base_radius, strip=True)


def _dome(side_x: float, side_y: float, radius_x: float, radius_y: float) -> Patch:
    """A dome, or a saddle where one radius is negative; a radius of 0 is straight."""
    return Patch(side_x, side_y, (radius_x or math.inf, radius_y or math.inf))


def _hexagon(rim_radius: float) -> Patch:
    """A hexagon with corners `rim_radius` from its middle, one each on the left and right."""
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
    "dome": Shape(
        "Dome or saddle",
        _dome,
        {"side_x": 0.05, "side_y": 0.05, "radius_x": 0.15, "radius_y": 0.15},
        {"force": 0.5, "exaggeration": 10.0},
    ),
    "cap": Shape(
        "Cap (fingertip)",
        Cap,
        {"cap_radius": 8e-3, "cap_angle": _CAP_ANGLE, "cap_stretch": 1.0},
        # Hinged, a hemisphere may move as a whole, and a cap nearly so: hardly a reading shows it.
        {"force": 1.0, "exaggeration": 40.0, "edge": "clamped"},
        rate=200.0,
    ),
    "disk": Shape("Disk", Disk, {"rim_radius": 0.05}, _AS_TABLE_1, rate=200.0),
    "hexagon": Shape("Hexagon", _hexagon, {"rim_radius": 0.05}, _AS_TABLE_1, rate=100.0),
}
"""By name; `make` is called with the `lengths`, in their order."""


_SKIN = PARTS["skin"]


def _side(axis: str, more: str = "") -> Range:
    tip = f"Length of the skin along {axis}{more}. The loads keep their relative positions."
    return Range(f"Length along {axis}", tip, 0.005, 1.0, 0.001, *MILLIMETRES, decimals=1)


def _radius(axis: str) -> Range:
    tip = f"Radius of the unloaded skin along {axis}; negative: hollow from outside; 0: straight."
    return Range(f"Radius along {axis}", tip, -1.0, 1.0, 0.001, *MILLIMETRES, decimals=1)


def _elements(axis: str, letter: str) -> Range:
    tip = f"{letter}, the number of elements along {axis}, each in the middle of its tile."
    return Range(f"Elements along {axis}", tip, 1, 32, 1)


@dataclass(frozen=True)
class Skin:
    """The skin, in SI units; which lengths apply depends on the shape (`SHAPES`)."""

    shape: str = setting(
        "flat",
        Choice(
            "Shape",
            "The flat patch of the paper's Table 1; its fingertip, a half circle, curved along x "
            "and straight along y; a shallow dome or saddle, curved along both; a cap of a "
            "sphere or spheroid; or a flat disk or hexagon. Selecting a shape sets its default "
            "size, force and vertical exaggeration.",
            tuple((name, shape.label) for name, shape in SHAPES.items()),
        ),
    )
    side_x: float = setting(0.1, _side("x", ", along the arc of a curved skin"))
    side_y: float = setting(0.1, _side("y"))
    base_radius: float = setting(
        0.0129,
        Range(
            "Base radius",
            "Radius of the arc of the unloaded skin; that of the paper's fingertip is 12.9 mm.",
            0.002,
            1.0,
            0.0005,
            *MILLIMETRES,
            decimals=1,
        ),
    )
    radius_x: float = setting(0.15, _radius("x"))
    radius_y: float = setting(0.15, _radius("y"))
    cap_radius: float = setting(
        8e-3,
        Range(
            "Radius",
            "Radius of the sphere, or of the equator of the spheroid, that the cap is part of.",
            1e-3,
            0.5,
            5e-4,
            *MILLIMETRES,
            decimals=1,
        ),
    )
    cap_angle: float = setting_of_key(
        _SKIN.key("angle"),
        _CAP_ANGLE,
        label="Rim angle",
        step=math.radians(1),
        decimals=1,
        least=math.radians(5),
    )
    cap_stretch: float = setting_of_key(_SKIN.key("stretch"), 1.0, step=0.05, decimals=2)
    rim_radius: float = setting(
        0.05,
        Range(
            "Rim radius",
            "Distance from the middle of the skin to its rim, or to its corners.",
            0.005,
            0.5,
            0.001,
            *MILLIMETRES,
            decimals=1,
        ),
    )
    edge: str = setting_of_key(_SKIN.key("edge"), "hinged")
    elements_x: int = setting(10, _elements("x", "m"))
    elements_y: int = setting(10, _elements("y", "n"))
    dead_elements: tuple[int, ...] = ()  # by a demonstration
    tension: float = setting_of_key(_SKIN.key("tension"), 0.0, decimals=1, most=1000.0)
    foam: float = setting_of_key(_SKIN.key("foundation"), 0.0, step=1e3, decimals=1, most=1e7)
    fluid: bool = setting_of_key(_SKIN.key("fluid"), False)
    thickness: float = setting_of_key(
        _SKIN.key("thickness"),
        0.0,
        step=1e-5,
        limits=None,
        least=0.0,
        most=5e-3,
        tip=f"{_SKIN.key('thickness').tip} 0: not given.",
    )
    poisson: float = setting_of_key(
        _SKIN.key("poisson"), 0.3, step=0.01, decimals=2, least=0.0, most=0.5
    )
    inplane: str = setting_of_key(
        _SKIN.key("inplane"), "", choices=(("", "Default"), *_SKIN.key("inplane").choices)
    )


@dataclass(frozen=True)
class Written:
    """The TOML `text` of a scene; its name and the paths in it are those of `file`.

    `trust` says whether, or which, files outside the folder of `file` it may name.
    """

    text: str
    file: Path
    trust: bool | frozenset[Path] = False


@dataclass(frozen=True)
class OwnScene:
    """The scene as text in `written`; with None the panels define the scene."""

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
"""Labels of the size of a distributed load."""


def _position(default: float, label: str, tip: str) -> Any:
    return setting(default, Range(label, tip, 0.0, 1.0, 0.001, *MILLIMETRES, decimals=1))


def _size(default: float, label: str, tip: str) -> Any:
    return setting(default, Range(label, tip, 0.0005, 1.0, 0.0005, *MILLIMETRES, decimals=1))


@dataclass(frozen=True)
class LoadSettings:
    """The load in SI units; a free one has a position and a force."""

    load_case: str = setting(
        "circle",
        Choice(
            "Case",
            "Load on the simulated skin. Press on the skin with the mouse to move it freely.",
            LOAD_CASES,
        ),
    )
    force: float = setting(
        0.15,
        Range(
            "Force",
            "Total force of a free load. The other cases set the force so that the skin has the "
            "slopes of Table 1's patch.",
            -50.0,
            50.0,
            0.01,
            1.0,
            "N",
            3,
        ),
    )
    x: float = _position(
        0.05, "x", "Position of the middle of the load, or of the beginning of the line."
    )
    y: float = _position(
        0.05, "y", "Position of the middle of the load, or of the beginning of the line."
    )
    x_end: float = _position(
        0.075, "x, second point", "Position of the second point, or of the end of the line."
    )
    y_end: float = _position(
        0.075, "y, second point", "Position of the second point, or of the end of the line."
    )
    size: float = _size(
        0.005,
        "Size",
        "Size of a distributed load: radius of a disc, width of a rectangle along x, or standard "
        "deviation of a Gaussian, which needs four standard deviations of skin on every side. A "
        "load that would extend over the rim is moved inwards.",
    )
    size_y: float = _size(0.02, "Width along y", "Width of a rectangle along y.")


@dataclass(frozen=True)
class Noise:
    """The noise of each reading, and its seed."""

    noise_kind: str = setting(
        "uniform",
        Choice(
            "Kind",
            "Distribution of the noise added to each simulated reading.",
            (("none", "None"), ("uniform", "Uniform (Table 1)"), ("gaussian", "Gaussian")),
        ),
    )
    noise_rms: float = setting(
        0.231,
        Range(
            "RMS",
            "Root mean square of the curvature noise. Table 1 has 0.231 1/m, uniform within "
            "\N{PLUS-MINUS SIGN}0.40 1/m.",
            0.0,
            20.0,
            0.05,
            *PER_METRE,
            decimals=3,
        ),
    )
    noise_seed: int = setting(
        0, Range("Seed", "The same seed gives the same noise.", 0, 999_999, 1)
    )


@dataclass(frozen=True)
class AddedNoise:
    """The noise added to what is shown of a device."""

    added_noise: float = setting(
        0.0,
        Range(
            "RMS",
            "Root mean square of the noise added to each reading of the shown estimate. None of it "
            "is recorded or published.",
            0.0,
            20.0,
            0.05,
            *PER_METRE,
            decimals=3,
        ),
    )


_CONVERTER = PARTS["converter"]
PER_CENT = (1e2, "%")


@dataclass(frozen=True)
class Electronics:
    """The electronics, from gage to count."""

    electronics: str = setting_of_key(
        PARTS["electronics"].key("like"),
        "modern",
        label="Electronics",
        tip="Gages, bridge, amplifier and converter (Figs. 4 and 5). The paper's prototypes "
        "convert 12 bits in 20 \N{MICRO SIGN}s. Selecting one sets its converter.",
    )
    bits: int = setting_of_key(_CONVERTER.key("bits"), 16)
    conversion_time: float = setting_of_key(
        _CONVERTER.key("conversion_time"), 5e-6, step=1e-6, decimals=1, least=1e-6, most=1e-3
    )


@dataclass(frozen=True)
class GageEffects:
    """Mechanical effects of the gages on a reading."""

    loops: str = setting(
        "none",
        Choice(
            "Hysteresis",
            "Hysteresis loops of the reading against the curvature, as in Fig. 8: the widest is "
            "7 1/m for the second prototype and three times that for the first.",
            (("none", "None"), ("second", "Second prototype"), ("first", "First prototype")),
        ),
    )
    creep: float = setting(
        0.0,
        Range(
            "Creep",
            "Fraction of a constant reading that relaxes, with a time constant of 5 s (standard "
            "linear solid).",
            0.0,
            0.5,
            0.01,
            *PER_CENT,
            decimals=0,
        ),
    )
    tolerance: float = setting(
        0.0,
        Range(
            "Tolerance",
            "Standard deviation of the gains of uncalibrated gages; that of their offsets is "
            "0.1 1/m for each 1 %. Calibration removes both.",
            0.0,
            0.2,
            0.01,
            *PER_CENT,
            decimals=0,
        ),
    )


@dataclass(frozen=True)
class Scanning:
    """The elements scanned in each frame."""

    region: str = setting(
        "off",
        Choice(
            "Scan",
            "Scanning a region of interest increases the frame rate (paper, section 6.2). By force "
            "and torque locates the contact with a force/torque sensor at the base of the "
            "fingertip (intrinsic contact sensing). Most informative needs the estimator Tracking; "
            "with any other the channels are scanned in turn. A connected sensor scans around the "
            "contact or selected elements; the other regions are simulated only.",
            (
                ("off", "All elements"),
                ("skin", "Around the contact"),
                ("intrinsic", "By force and torque"),
                ("elements", "Selected elements"),
                ("adaptive", "Most informative"),
            ),
        ),
    )
    region_radius: float = setting(
        0.025,
        Range(
            "Radius",
            "Elements within this distance of the contact are in every frame.",
            0.002,
            0.5,
            0.001,
            *MILLIMETRES,
            decimals=1,
        ),
    )
    region_share: float = setting(
        0.1,
        Range(
            "Share",
            "Fraction of the other elements that are scanned in each frame, in turn; between scans "
            "their last readings are used. With Most informative, the fraction of all channels, at "
            "least 5 %.",
            0.0,
            1.0,
            0.05,
            *PER_CENT,
            decimals=0,
        ),
    )
    region_elements: tuple[int, ...] = ()  # chosen on a heatmap
