"""Settings of the sensor design: skin, elements, noise and placement."""

from dataclasses import dataclass
from typing import Any

from kappaskin_app.shell.settings.form_fields import (
    MILLIMETRES,
    PER_METRE,
    Choice,
    Range,
    Several,
    Text,
    setting,
)
from kappaskin_app.shell.settings.scene import SHAPES, Skin

OPEN = "open"
"""The outline of the scene that is open."""
PATTERNS = (("grid", "Grid"), ("rings", "Rings"), ("spiral", "Spiral"))
PLACINGS = (
    ("scene", "As given"),
    ("clustered", "Clustered in the middle"),
    ("contact", "Best for contacts"),
    ("D", "D-optimal"),
    ("A", "A-optimal"),
)


def _length(label: str, tip: str) -> Range:
    return Range(label, tip, 5e-3, 0.5, 1e-3, *MILLIMETRES, 1)


def _as_skin(name: str) -> Any:
    """A setting with the default and the form field of the simulated skin's setting `name`."""
    its = Skin.__dataclass_fields__[name]
    return setting(its.default, its.metadata["form"])


def _noise(of: str, least: float, most: float, step: float, scale: float, unit: str) -> Range:
    tip = f"Standard deviation of the noise of {of}. The error of the shape is proportional to it."
    return Range(f"Noise of {of.split()[0]}", tip, least, most, step, scale, unit, 2)


@dataclass(frozen=True)
class DesignSettings:
    """The sensor design, in SI units; which lengths apply depends on the shape (`SHAPES`)."""

    design_shape: str = setting(
        "flat",
        Choice(
            "Outline",
            "The open scene with its skin of any shape, or a skin to design, which is hinged along "
            "its edges; a cap is clamped.",
            ((OPEN, "The open scene"), *((name, shape.label) for name, shape in SHAPES.items())),
        ),
    )
    design_side_x: float = setting(0.1, _length("Side x", "Length of the skin along x."))
    design_side_y: float = setting(0.1, _length("Side y", "Length of the skin along y."))
    design_base_radius: float = setting(
        12.9e-3, _length("Radius", "Radius of the arc of the unloaded skin.")
    )
    design_radius_x: float = _as_skin("radius_x")
    design_radius_y: float = _as_skin("radius_y")
    design_cap_radius: float = _as_skin("cap_radius")
    design_cap_angle: float = _as_skin("cap_angle")
    design_cap_stretch: float = _as_skin("cap_stretch")
    design_rim_radius: float = setting(
        0.05,
        _length(
            "Rim radius", "Distance from the middle of the skin to its rim, or to its corners."
        ),
    )
    design_pattern: str = setting(
        "grid",
        Choice(
            "Pattern",
            "Where the elements are before they are placed. On rings they are evenly far apart; on "
            "a spiral there is one to each equal area.",
            PATTERNS,
        ),
    )
    design_count: int = setting(
        60, Range("Elements", "Number of elements on the spiral.", 4, 400, 1)
    )
    design_rings: str = setting(
        "1, 6, 13, 18, 22",
        Text(
            "Elements on each ring",
            "Number of elements on each ring, from the middle outward; a first ring of one is in "
            "the middle.",
        ),
    )
    design_x: int = setting(
        10,
        Range(
            "Elements along x",
            "m, the number of elements along x. Twice as many elements halve the variance of the "
            "shape and double the scan time.",
            2,
            32,
            1,
        ),
    )
    design_y: int = setting(
        10, Range("Elements along y", "n, the number of elements along y.", 2, 32, 1)
    )
    design_reads: tuple[str, ...] = setting(
        ("xx", "yy", "xy"),
        Several(
            "Readings",
            "What every element reads. Curvatures alone are those of strain gages, converted one "
            "after the other; all other readings arrive together, as numbers.",
            (
                ("xx", "Curvature xx"),
                ("yy", "Curvature yy"),
                ("xy", "Twist xy"),
                ("height", "Height"),
                ("slope@0", "Slope along x"),
                ("slope@90", "Slope along y"),
            ),
        ),
    )
    design_functions_x: int = setting(
        8,
        Range(
            "Basis functions in x",
            "Ni, the number of basis functions in x (Eq. 1).",
            1,
            24,
            1,
        ),
    )
    design_functions_y: int = setting(
        8,
        Range("Basis functions in y", "Nj, the number of basis functions in y (Eq. 1).", 1, 24, 1),
    )
    design_noise: float = setting(
        0.23, _noise("curvatures and the twist", 0.01, 10.0, 0.01, *PER_METRE)
    )
    design_height_noise: float = setting(
        5e-6, _noise("heights", 1e-7, 1e-3, 1e-7, 1e6, "\N{MICRO SIGN}m")
    )
    design_slope_noise: float = setting(5e-4, _noise("slopes", 1e-5, 0.1, 1e-5, 1e3, "mrad"))
    design_conversion: float = setting(
        5e-6,
        Range(
            "Conversion",
            "Conversion time of one reading. A frame is all readings of each element, one after "
            "the other.",
            1e-6,
            1e-3,
            1e-6,
            1e6,
            "\N{MICRO SIGN}s",
            1,
        ),
    )
    design_place: str = setting(
        "scene",
        Choice(
            "Placement",
            "Positions of the elements. Best for contacts minimises the mean squares of the errors "
            "of force and place of the load, wherever it can press. D-optimal maximises det M'M, "
            "which minimises the volume of the confidence region of the coefficients; A-optimal "
            "minimises the mean variance of the displacement. All include noise only; the check by "
            "simulation includes the error of the basis.",
            PLACINGS,
        ),
    )
    design_map: str = setting(
        "displacement",
        Choice(
            "Map",
            "What the map shows the error of: the displacement, or the contact position or the "
            "force of the load of the design where it presses at that place.",
            (
                ("displacement", "Displacement"),
                ("contact", "Contact position"),
                ("force", "Contact force"),
            ),
        ),
    )
