"""What the same readings are computed with beside: B, which is held against what is in use, A."""

from dataclasses import dataclass

from kappaskin_app.shell.settings.asks import Choice, Range, Switch, asked
from kappaskin_app.shell.settings.shown import METHOD_NAMES
from kappaskin_app.shell.settings.skin import EDGE_NAMES


@dataclass(frozen=True)
class Compared:
    """The other basis and estimator, and whether calibration and tare are used with it."""

    other_x: int = asked(
        6, Range("Functions along x", "Ni of B, the number of functions along x (Eq. 1).", 1, 64, 1)
    )
    other_y: int = asked(6, Range("Functions along y", "Nj of B, the same along y.", 1, 64, 1))
    other_method: str = asked(
        "least-squares",
        Choice("Estimator", "How B finds the shape from the same readings.", METHOD_NAMES),
    )
    other_edge: str = asked(
        "",
        Choice(
            "Edge assumed",
            "How B believes that the skin is held.",
            (("", "As the skin says"), *EDGE_NAMES),
        ),
    )
    other_calibrated: bool = asked(
        True, Switch("Calibration", "Use the calibration in use for B too; without, Eq. 8 as is.")
    )
    other_tared: bool = asked(True, Switch("Tare", "Use the tare in use for B too."))
