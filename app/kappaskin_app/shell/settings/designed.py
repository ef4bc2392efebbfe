"""A sensor that is not built yet: its skin, its elements, what they can do, and where they are."""

from dataclasses import dataclass

from kappaskin_app.shell.settings.asks import MILLIMETRES, PER_METRE, Choice, Range, asked
from kappaskin_app.shell.settings.scene import SHAPES

PLACINGS = (
    ("scene", "Regular grid"),
    ("clustered", "Drawn to the middle"),
    ("D", "D-optimal"),
    ("A", "A-optimal"),
)


def _length(label: str, tip: str) -> Range:
    return Range(label, tip, 5e-3, 0.5, 1e-3, *MILLIMETRES, 1)


@dataclass(frozen=True)
class Designed:
    """What is designed, in SI units; which of its lengths count, its shape says (`SHAPES`)."""

    design_shape: str = asked(
        "flat",
        Choice(
            "Outline",
            "The outline of the skin to be built, hinged along its edges.",
            tuple((name, shape.label) for name, shape in SHAPES.items()),
        ),
    )
    design_side_x: float = asked(0.1, _length("Side x", "Length of the skin along x."))
    design_side_y: float = asked(0.1, _length("Side y", "Length of the skin along y."))
    design_base_radius: float = asked(
        12.9e-3, _length("Radius", "Radius of the arc that the skin makes at rest.")
    )
    design_rim_radius: float = asked(
        0.05, _length("Rim radius", "From the middle of the skin to its rim, or to its corners.")
    )
    design_x: int = asked(
        10,
        Range(
            "Elements along x",
            "m, elements along x. Twice as many elements halve the variance of the shape, and take "
            "twice as long to read.",
            2,
            32,
            1,
        ),
    )
    design_y: int = asked(10, Range("Elements along y", "n, elements along y.", 2, 32, 1))
    design_functions_x: int = asked(
        8,
        Range(
            "Functions along x",
            "Ni, the functions along x that the shape is made of (Eq. 1).",
            1,
            24,
            1,
        ),
    )
    design_functions_y: int = asked(
        8, Range("Functions along y", "Nj, the same along y (Eq. 1).", 1, 24, 1)
    )
    design_noise: float = asked(
        0.23,
        Range(
            "Noise",
            "Standard deviation of what each reading is off by. The error bar is proportional to "
            "it.",
            0.01,
            10.0,
            0.01,
            *PER_METRE,
            2,
        ),
    )
    design_conversion: float = asked(
        5e-6,
        Range(
            "Conversion",
            "Time that the converter takes for one reading; three readings of each element, one "
            "after the other, make a frame.",
            1e-6,
            1e-3,
            1e-6,
            1e6,
            "\N{MICRO SIGN}s",
            1,
        ),
    )
    design_place: str = asked(
        "scene",
        Choice(
            "Placement",
            "Where the elements are. D-optimal makes det M'M largest, so that noise leaves the "
            "smallest volume of shapes; A-optimal makes the mean variance of the displacement "
            "smallest. Both count noise only: what the functions cannot follow, the check tells.",
            PLACINGS,
        ),
    )
