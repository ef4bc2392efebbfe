"""What the shape is fitted with, and how it is shown."""

from dataclasses import dataclass

from kappaskin_app.settings.asks import Choice, Range, Switch, asked
from kappaskin_app.settings.skin import EDGE_NAMES

COLOURS = (
    ("displacement", "Displacement"),
    ("xx", "Curvature xx"),
    ("yy", "Curvature yy"),
    ("xy", "Twist xy"),
)
METHOD_NAMES = (
    ("least-squares", "Least squares"),
    ("as-printed", "As printed (Eq. 6)"),
    ("direct", "Direct, each frame anew"),
    ("fast", "Fast, a regular grid"),
    ("tracking", "Tracking, from frame to frame"),
    ("bayes", "Bayes, a plate's prior"),
    ("finite-slope", "Finite slope"),
    ("robust", "Robust, leaves out bad elements"),
)
METHOD_SHORT = {name: words.split(",")[0].split(" (")[0] for name, words in METHOD_NAMES}


@dataclass(frozen=True)
class Fit:
    """The functions that the shape is made of, and how they are fitted."""

    functions_x: int = asked(
        8,
        Range(
            "Functions along x",
            "Ni, the number of functions along x (Eq. 1). More follow finer shapes and more noise; "
            "m elements along x decide at most m of them.",
            1,
            64,
            1,
        ),
    )
    functions_y: int = asked(
        8, Range("Functions along y", "Nj, the same along y (Eq. 1).", 1, 64, 1)
    )
    method: str = asked(
        "least-squares",
        Choice(
            "Estimator",
            "How the shape is found from the readings. Every way tells its error bars; Cost of "
            "accuracy (F9) shows what each takes and gives.",
            METHOD_NAMES,
        ),
    )
    fit_edge: str = asked(
        "",
        Choice(
            "Edge assumed",
            "How the fit believes that the skin is held. Another edge than the skin's own shows "
            "what a wrong belief costs: compare the errors above.",
            (("", "As the skin says"), *EDGE_NAMES),
        ),
    )


@dataclass(frozen=True)
class View:
    """How the skin is shown."""

    colour_by: str = asked(
        "displacement",
        Choice(
            "Colour",
            "What colours the skin: how far it moved, or how much it bends along x (xx), along y "
            "(yy) or twists (xy) (Eqs. 3 to 5).",
            COLOURS,
        ),
    )
    exaggeration: float = asked(
        6.0,
        Range(
            "Height",
            "How many times the displacement is drawn larger, at most: never so much that it "
            "leaves the picture. Below the colours stands how many times it is.",
            1,
            50,
            1,
            1.0,
            "times",
        ),
    )
    show_elements: bool = asked(True, Switch("Elements", "Draw the sensing elements as points."))
    show_truth: bool = asked(
        True,
        Switch("True surface", "Draw the surface the simulation knows as a wireframe."),
    )
    theme: str = asked(
        "dark", Choice("Theme", "Colours of the window.", (("light", "Light"), ("dark", "Dark")))
    )
    range_displacement: float = 0.0  # m, colours up to this; 0 follows what is shown
    range_xx: float = 0.0  # 1/m, colours from minus to plus this
    range_yy: float = 0.0
    range_xy: float = 0.0
