"""Settings of the estimator, the comparison and the view."""

from collections.abc import Mapping
from dataclasses import dataclass, field, make_dataclass
from typing import Any

from kappaskin.pipeline import SETUP, skin_colours
from kappaskin_app.shell.settings.form_fields import (
    Choice,
    Range,
    Several,
    Switch,
    setting,
    setting_of_setup,
)


@dataclass(frozen=True)
class Camera:
    """The view direction `look`, or the `camera` of the 3D view once it was turned by hand.

    `camera` is empty until then.
    """

    look: str = "left"
    camera: tuple[float, ...] = ()


@dataclass(frozen=True)
class Look:
    """The look of the window: kept from one start to the next, and not part of undo."""

    error_bars: str = "sigma"  # of `ERROR_BARS`
    theme: str = setting(
        "dark", Choice("Theme", "Colours of the window.", (("light", "Light"), ("dark", "Dark")))
    )
    show_start: bool = setting(
        True,
        Switch(
            "Welcome",
            "Show when the window opens how to start: with a scene, a sensor, a lesson or a "
            "recording.",
        ),
    )
    letters: float = setting(
        100.0,
        Range(
            "Text size",
            "Text size of the window, relative to that of the system. Panels that are too small "
            "for larger text scroll.",
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
    """The basis, the estimator and the boundary condition."""

    functions_x: int = setting_of_setup("Ni")
    functions_y: int = setting_of_setup("Nj")
    method: str = setting_of_setup("method")
    fit_edge: str = setting_of_setup("edge")


@dataclass(frozen=True)
class ComparedSettings:
    """The setup B, which is compared with the setup in use, A, on the same readings.

    It has the calibration and tare in use, or none.
    """

    other_x: int = setting_of_setup("Ni", 6)
    other_y: int = setting_of_setup("Nj", 6)
    other_method: str = setting_of_setup("method")
    other_edge: str = setting_of_setup("edge")
    other_calibrated: bool = setting(
        True,
        Switch(
            "Calibration", "Apply the calibration to B too; without it, B uses Eq. 8 unchanged."
        ),
    )
    other_tared: bool = setting(True, Switch("Tare", "Apply the tare to B too."))


def _cut(side: str, axis: str) -> Range:
    tip = f"Limit of the visible part of the skin along {axis}, in per cent of its length."
    return Range(f"{side} {axis}", tip, 0.0, 1.0, 0.05, 100.0, "%", 0)


def _cut_level(side: str, beyond: str) -> Range:
    tip = (
        f"Hide what is drawn {beyond} this level, from the lowest (0 %) to the highest (100 %) "
        "level that can be drawn."
    )
    return Range(f"{side} height", tip, 0.0, 1.0, 0.05, 100.0, "%", 0)


ColourRanges: Any = make_dataclass(
    "ColourRanges",
    [(f"range_{name}", float, 0.0) for name in skin_colours() if name != "health"],
    frozen=True,
)
"""Limits of the colour scales, in SI units, one-sided or symmetric; 0 is automatic."""


def locked_at(name: str, settings: Any) -> float:
    """The limit in SI units that the range of the quantity `name` is locked to, or zero."""
    return getattr(settings, f"range_{name}", settings.ranges.get(name, 0.0))


def locking(limits: Mapping[str, float], settings: Any) -> dict[str, Any]:
    """The settings that lock the ranges of quantities at `limits` in SI units; 0 unlocks."""
    own = {f"range_{n}": limit for n, limit in limits.items() if hasattr(settings, f"range_{n}")}
    read = {n: limit for n, limit in limits.items() if f"range_{n}" not in own}
    return own | {"ranges": {n: at for n, at in {**settings.ranges, **read}.items() if at}}


@dataclass(frozen=True)
class View(ColourRanges):
    """The view of the skin."""

    colour_by: str = setting(
        "displacement",
        Choice(
            "Colour",
            "Quantity shown by the colours of the skin: displacement, what the elements read, "
            "curvatures (Eqs. 3 to 5), principal curvatures, residuals, standard deviation, error, "
            "or health of the elements. The colour scale shows its name and equation.",
            COLOURS,
        ),
    )
    colour_from: str = setting(
        "smooth",
        Choice(
            "Shading",
            "Smooth: the fitted surface at every point. Per element: the cell of each element in "
            "the colour of its reading, without interpolation; residuals and health are always "
            "shown per element.",
            (("smooth", "Smooth"), ("elements", "Per element")),
        ),
    )
    colour_map: str = setting(
        "standard",
        Choice(
            "Colour map",
            "Colours of the skin and of all maps. Each has a sequential map for quantities of one "
            "sign and a diverging one, with zero in its middle, for quantities of both signs. All "
            "are perceptual: equal steps look equal, also with a colour vision deficiency.",
            (
                ("standard", "Blue to yellow"),
                ("viridis", "Viridis"),
                ("cividis", "Cividis"),
                ("inferno", "Inferno, dark zero"),
                ("grey", "Grey"),
            ),
        ),
    )
    maps: tuple[str, ...] = setting(
        ("xx", "yy", "xy"),
        Several(
            "Heatmaps",
            "Heatmaps shown next to the skin, one cell per element. Hidden heatmaps are not "
            "computed.",
            COLOURS,
        ),
    )
    one_range: bool = setting(
        False,
        Switch(
            "Common range",
            "Use one colour range for all curvatures shown, and one for all residuals, so that "
            "they can be compared.",
        ),
    )
    exaggeration: float = setting(
        6.0,
        Range(
            "Vertical exaggeration",
            "Largest factor by which the displacement is drawn enlarged. The factor is reduced "
            "where the surface would leave the view; the view shows the current factor, unless it "
            "is 1.",
            1,
            50,
            1,
            1.0,
            "times",
        ),
    )
    show_fit: bool = setting(
        True, Switch("Fitted surface", "Draw the fitted surface with lines of its grid.")
    )
    show_elements: bool = setting(True, Switch("Elements", "Draw the sensing elements as points."))
    show_truth: bool = setting(
        True,
        Switch("True surface", "Draw the true surface of the simulation as red lines."),
    )
    show_contact: bool = setting(
        True, Switch("Contact", "Draw a green pin at the estimated contact, grey near the rim.")
    )
    show_load: bool = setting(
        True,
        Switch(
            "Load", "Draw the simulated load as a red arrow, with its outline if it has an area."
        ),
    )
    show_directions: bool = setting(
        False,
        Switch(
            "Principal directions",
            "Crosses along the principal directions, their length in proportion to the principal "
            "curvatures: orange where convex, blue where concave. tan 2\u03b1 = 2 xy / "
            "(xx \u2212 yy).",
        ),
    )
    show_band: bool = setting(
        False,
        Switch(
            "Error band",
            "Two translucent surfaces, one error bar (\N{PLUS-MINUS SIGN}1 \u03c3 or 95 %, menu "
            "View) below and above the estimated one: the true surface lies between them at "
            "about 68 or 95 % of the points, as far as noise is the only error.",
        ),
    )
    show_frame: bool = setting(
        False,
        Switch(
            "Contact frame",
            "Normal of the skin at the contact (green) and the two principal directions (orange, "
            "blue). The cone contains the normals whose slopes differ by one error bar "
            "(\N{PLUS-MINUS SIGN}1 \u03c3 or 95 %, menu View); it has the vertical "
            "exaggeration of the skin. The ellipse on the skin has the error bars of the position.",
        ),
    )
    show_object: bool = setting(
        True,
        Switch(
            "Estimated object",
            "The object that is named from the readings (plane, cylinder, sphere or edge), in "
            "translucent green at the contact, in its size, with the vertical exaggeration of the "
            "skin except on a cap; as lines where the true object is drawn. Not drawn while its "
            "radius is unknown.",
        ),
    )
    show_pressed: bool = setting(
        True,
        Switch(
            "True object",
            "The rigid object of a simulated scene, in translucent red, in its size, with the "
            "vertical exaggeration of the skin except on a cap. The loads of the panel Load have "
            "no object.",
        ),
    )
    from_x: float = setting(0.0, _cut("From", "x"))
    to_x: float = setting(1.0, _cut("To", "x"))
    from_y: float = setting(0.0, _cut("From", "y"))
    to_y: float = setting(1.0, _cut("To", "y"))
    from_z: float = setting(0.0, _cut_level("From", "below"))
    to_z: float = setting(1.0, _cut_level("To", "above"))
    traced: tuple[int, ...] = ()  # elements whose last seconds are drawn
    strips: tuple[str, ...] = ("force", "displacement")  # quantities drawn over time
    strip_seconds: float = 60.0
    ranges: Mapping[str, float] = field(default_factory=dict)  # of readings but xx, yy and xy
