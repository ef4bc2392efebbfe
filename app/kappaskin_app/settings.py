"""What a person may change, with the unit, range and explanation that every form shows."""

from dataclasses import dataclass, field, fields
from typing import Any

MILLIMETRES = (1e3, "mm")
PER_METRE = (1.0, "1/m")


@dataclass(frozen=True)
class Range:
    """How a number is asked for: screen value = SI value times `scale`, in `unit`."""

    label: str
    tip: str
    least: float
    most: float
    step: float
    scale: float = 1.0
    unit: str = ""
    decimals: int = 0


@dataclass(frozen=True)
class Choice:
    """How one of several values is asked for: (value, words) pairs."""

    label: str
    tip: str
    options: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Switch:
    """How yes or no is asked for."""

    label: str
    tip: str


Ask = Range | Choice | Switch


def _ask(default: Any, how: Ask) -> Any:
    return field(default=default, metadata={"ask": how})


def _position(default: float, label: str, tip: str) -> Any:
    return _ask(default, Range(label, tip, 0.0, 0.1, 0.001, *MILLIMETRES, decimals=1))


LOAD_CASES = (
    ("circle", "Moving point"),
    ("centre", "Centred point (Table 1)"),
    ("off-centre", "Off-centre point (Table 1)"),
    ("line", "Skewed line (Table 1)"),
    ("point", "Point, free"),
    ("two-points", "Two points, free"),
    ("free-line", "Line, free"),
)
COLOURS = (
    ("displacement", "Displacement"),
    ("xx", "Curvature xx"),
    ("yy", "Curvature yy"),
    ("xy", "Twist xy"),
)
FREE_CASES = ("point", "two-points", "free-line")
TWO_ENDED = ("two-points", "free-line")


@dataclass(frozen=True)
class Settings:
    """Everything a person may change, in SI units; a change is a new `Settings`."""

    functions_x: int = _ask(
        8,
        Range(
            "Functions along x",
            "Ni, the number of sine functions along x (Eq. 1). More follow finer shapes and more "
            "noise; m elements along x decide at most m of them.",
            1,
            64,
            1,
        ),
    )
    functions_y: int = _ask(
        8, Range("Functions along y", "Nj, the same along y (Eq. 1).", 1, 64, 1)
    )
    noise_kind: str = _ask(
        "uniform",
        Choice(
            "Kind",
            "How the noise added to each simulated reading is distributed.",
            (("none", "None"), ("uniform", "Uniform (Table 1)"), ("gaussian", "Gaussian")),
        ),
    )
    noise_rms: float = _ask(
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
    noise_seed: int = _ask(
        0, Range("Seed", "The same seed gives the same noise again.", 0, 999_999, 1)
    )
    load_case: str = _ask(
        "circle",
        Choice(
            "Case",
            "What presses on the simulated skin. Drag the load on the skin with the mouse to move "
            "it freely.",
            LOAD_CASES,
        ),
    )
    force: float = _ask(
        0.15,
        Range(
            "Force",
            "Total force of a free load; the paper's cases have the force that gives the "
            "displacement of Table 1.",
            -1.0,
            1.0,
            0.01,
            1.0,
            "N",
            3,
        ),
    )
    x: float = _position(0.05, "x", "Where the load presses, or the line begins.")
    y: float = _position(0.05, "y", "Where the load presses, or the line begins.")
    x_end: float = _position(0.075, "x, second", "The second point, or the end of the line.")
    y_end: float = _position(0.075, "y, second", "The second point, or the end of the line.")
    colour_by: str = _ask(
        "displacement",
        Choice(
            "Colour",
            "What colours the skin: how far it moved, or how much it bends along x (xx), along y "
            "(yy) or twists (xy) (Eqs. 3 to 5).",
            COLOURS,
        ),
    )
    exaggeration: float = _ask(
        6.0,
        Range("Height", "How many times the displacement is drawn larger.", 1, 50, 1, 1.0, "times"),
    )
    show_elements: bool = _ask(True, Switch("Elements", "Draw the sensing elements as points."))
    show_truth: bool = _ask(
        True,
        Switch("True surface", "Draw the surface the simulation knows as a wireframe."),
    )
    theme: str = _ask(
        "dark", Choice("Theme", "Colours of the window.", (("light", "Light"), ("dark", "Dark")))
    )
    range_xx: float = 0.0  # 1/m, colours from minus to plus this; 0 follows the readings
    range_yy: float = 0.0
    range_xy: float = 0.0


def ask_of(name: str) -> Ask:
    """How the setting called `name` is asked for."""
    return next(f.metadata["ask"] for f in fields(Settings) if f.name == name)
