"""Settings of the scene: a written one, or what presses on the simulated skin."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kappaskin_app.shell.settings.asks import MILLIMETRES, PER_METRE, Choice, Range, asked


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
