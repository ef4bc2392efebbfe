"""The simulated skin: its shape, how it is held, its elements and what is below it."""

from dataclasses import dataclass

from kappaskin.bases import EDGES
from kappaskin_app.shell.settings.asks import MILLIMETRES, Choice, Range, Switch, asked
from kappaskin_app.shell.skins import SHAPES

EDGE_NAMES = tuple((name, name.capitalize()) for name in EDGES)


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
    edge: str = asked(
        "hinged",
        Choice(
            "Edge",
            "How the skin is held along its edges. Hinged: it cannot move there but turns freely, "
            "and a bent one keeps its length; sliding: the ends of a bent one are free to slide; "
            "clamped: it cannot turn either; elastic: the rim of a flat rectangle gives.",
            EDGE_NAMES,
        ),
    )
    elements_x: int = asked(10, _elements("x", "m"))
    elements_y: int = asked(10, _elements("y", "n"))
    dead_elements: tuple[int, ...] = ()  # by a demonstration
    tension: float = asked(
        0.0,
        Range(
            "Tension",
            "How strongly the skin is stretched, like a drum head; 7 N/m double the stiffness of "
            "Table 1's patch.",
            0.0,
            1000.0,
            1.0,
            1.0,
            "N/m",
            1,
        ),
    )
    foam: float = asked(
        0.0,
        Range(
            "Foam",
            "Foundation modulus of a foam below: its pressure per displacement; 14 kN/m\u00b3 "
            "double the stiffness of Table 1's patch.",
            0.0,
            1e7,
            1e3,
            1e-3,
            "kN/m\u00b3",
            1,
        ),
    )
    fluid: bool = asked(
        False,
        Switch("Fluid", "A fluid below keeps its volume: pressed in here, the skin bulges there."),
    )
