"""Settings of the estimator and of the view."""

from dataclasses import dataclass, make_dataclass
from typing import Any

from kappaskin.pipeline import SETUP, skin_colours
from kappaskin_app.shell.settings.asks import (
    Choice,
    Range,
    Several,
    Switch,
    asked,
    asked_of_setup,
)


@dataclass(frozen=True)
class Looked:
    """The direction `look`, in which all of the skin is seen; once turned by hand, the `camera`.

    Its numbers are the view's own; none of them where it was not turned.
    """

    look: str = "left"
    camera: tuple[float, ...] = ()


@dataclass(frozen=True)
class Reading:
    """How large the window's letters are."""

    letters: float = asked(
        100.0,
        Range(
            "Letters",
            "How large the window's letters are, of what the system asks for. Where the panels "
            "have no room for larger ones, they scroll.",
            80,
            200,
            10,
            1.0,
            "%",
        ),
    )


COLOURS = tuple((name, colour.label) for name, colour in skin_colours().items())
METHOD_SHORT = {
    name: words.split(",")[0].split(" (")[0] for name, words in SETUP.key("method").choices
}


@dataclass(frozen=True)
class EstimatorSettings:
    """The functions that the shape is made of, and how they are fitted."""

    functions_x: int = asked_of_setup("Ni")
    functions_y: int = asked_of_setup("Nj")
    method: str = asked_of_setup("method")
    fit_edge: str = asked_of_setup("edge")


@dataclass(frozen=True)
class Compared:
    """B, held against the setup in use, A: another basis and estimator on the same readings.

    It has the calibration and tare in use, or none.
    """

    other_x: int = asked_of_setup("Ni", 6)
    other_y: int = asked_of_setup("Nj", 6)
    other_method: str = asked_of_setup("method")
    other_edge: str = asked_of_setup("edge")
    other_calibrated: bool = asked(
        True, Switch("Calibration", "Use the calibration in use for B too; without, Eq. 8 as is.")
    )
    other_tared: bool = asked(True, Switch("Tare", "Use the tare in use for B too."))


def _cut(side: str, axis: str) -> Range:
    tip = f"Cut away what lies beyond this share of the skin, seen from above along {axis}."
    return Range(f"{side} {axis}", tip, 0.0, 1.0, 0.05, 100.0, "%", 0)


def _cut_level(side: str, beyond: str) -> Range:
    tip = (
        f"Cut away what is drawn {beyond} this level, from as deep (0 %) to as high (100 %) as "
        "the skin may be drawn."
    )
    return Range(f"{side} height", tip, 0.0, 1.0, 0.05, 100.0, "%", 0)


ColourRanges: Any = make_dataclass(
    "ColourRanges",
    [(f"range_{name}", float, 0.0) for name in skin_colours() if name != "health"],
    frozen=True,
)
"""How far colours reach, in SI units: on one side, or on both. 0 follows what is shown."""


@dataclass(frozen=True)
class View(ColourRanges):
    """How the skin is shown."""

    colour_by: str = asked(
        "displacement",
        Choice(
            "Colour",
            "What colours the skin: how far it moved, how it bends (Eqs. 3 to 5) and curves, what "
            "the fit leaves of the readings, how sure it is, how wrong, or which elements are "
            "well. Above the scale of colours stands which it is, with its equation.",
            COLOURS,
        ),
    )
    colour_from: str = asked(
        "smooth",
        Choice(
            "Coloured",
            "Smooth: the surface that was fitted, at every point. Per element: each element's own "
            "cell in the colour of what it reads, nothing interpolated; residuals and health are "
            "always so.",
            (("smooth", "Smooth"), ("elements", "Per element")),
        ),
    )
    maps: tuple[str, ...] = asked(
        ("xx", "yy", "xy"),
        Several(
            "Heatmaps",
            "Which heatmaps are shown beside the skin, one cell for each element. What is not "
            "shown is not computed.",
            COLOURS,
        ),
    )
    one_range: bool = asked(
        False,
        Switch(
            "One range for all",
            "Let the colours of all curvatures that are shown reach as far as those of the "
            "largest, and those of all residuals, so that they can be compared.",
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
    show_directions: bool = asked(
        False,
        Switch(
            "Principal directions",
            "Crosses along the directions in which the skin curves most and least, as long as it "
            "does: orange where it is convex, blue where it is hollow. tan 2\u03b1 = 2 xy / "
            "(xx \u2212 yy).",
        ),
    )
    show_band: bool = asked(
        False,
        Switch(
            "Error band",
            "Two translucent surfaces, two standard deviations of the displacement below and "
            "above: the true one lies between them at about 95 of 100 places, as far as noise "
            "alone errs.",
        ),
    )
    show_frame: bool = asked(
        False,
        Switch(
            "Contact frame",
            "At the contact the normal of the skin (green) and its two principal directions "
            "(orange, blue). The cone holds the normal with 95 % by the error bars of the slopes, "
            "stretched as the skin is.",
        ),
    )
    show_object: bool = asked(
        False,
        Switch(
            "Object found",
            "What the readings say touches the skin (plane, cylinder, sphere or edge), green and "
            "translucent where it touches, stretched in height as the skin is. Of a radius known "
            "to be below some length, it has that.",
        ),
    )
    show_pressed: bool = asked(
        False,
        Switch(
            "Object pressed",
            "The rigid object of a simulated scene, red and translucent, where it is pressed in "
            "and stretched in height as the skin is. Loads of the panels have none.",
        ),
    )
    from_x: float = asked(0.0, _cut("From", "x"))
    to_x: float = asked(1.0, _cut("To", "x"))
    from_y: float = asked(0.0, _cut("From", "y"))
    to_y: float = asked(1.0, _cut("To", "y"))
    from_z: float = asked(0.0, _cut_level("From", "below"))
    to_z: float = asked(1.0, _cut_level("To", "above"))
    theme: str = asked(
        "dark", Choice("Theme", "Colours of the window.", (("light", "Light"), ("dark", "Dark")))
    )
    show_start: bool = asked(
        True,
        Switch(
            "Welcome",
            "Offer above the skin, whenever the window opens, what one may begin with: a scene, a "
            "sensor, a lesson, a recording.",
        ),
    )
    traced: tuple[int, ...] = ()  # elements whose last seconds are drawn
