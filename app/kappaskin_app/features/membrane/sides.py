"""How long the skin's sides are, written beside them."""

from typing import Any

import numpy as np
import pyvista as pv

from kappaskin_app.features.membrane.unlit import UNLIT, pixels
from kappaskin_app.shell.drawn_skin import MM, Direction, DrawnSkin
from kappaskin_app.theme import grown

_LETTERS = 15  # px
_LONG = 5.2  # times as long as its letters are high: a label with a space beside it
_MOST = 0.2  # of a picture's width that one label may take


class Sides:
    """The labels of the corner 0 and of the sides along x and y.

    Where the skin ends inside of its rectangle, lines show the sides that are meant.
    """

    def __init__(self, plotter: Any) -> None:
        self._lines: Any = pv.PolyData(np.zeros((3, 3)), lines=[3, 1, 0, 2])
        self.actor = plotter.add_mesh(self._lines, line_width=pixels(plotter, 1), **UNLIT)
        self.actor.visibility = False
        self.labels: list[Any] = [pv.Label() for _ in range(3)]
        for label in self.labels:
            plotter.add_actor(label, reset_camera=False, render=False)

    def show_skin(self, skin: DrawnSkin) -> None:
        a, b = skin.patch.a, skin.patch.b
        corners, _ = skin.at_rest(np.array([(0.0, 0.0), (a, 0.0), (0.0, b)]))
        self._lines.points = corners
        self.actor.visibility = not skin.on.all()
        beside = MM * np.array([(-0.04 * a, -0.04 * b, 0), (0, -0.06 * b, 0), (0, 0.05 * b, 0)])
        texts = ("0", f"x {round(a * MM, 1):g} mm", f"y {round(b * MM, 1):g} mm")
        for label, text, at in zip(self.labels, texts, corners + beside, strict=True):
            label.input = text
            label.position = tuple(at)
        # Where the skin rises steeply beside it, a text in the middle would lie below it.
        y_at = "right" if skin.patch.base_curvature else "center"
        self.labels[2].prop.justification_horizontal = y_at

    def show_from(self, direction: Direction | None) -> None:
        """Label what is not seen end-on, where a text would lie on the skin's rim."""
        for axis, label in enumerate(self.labels[1:]):
            label.SetVisibility(direction is None or direction.sees(axis))

    def fit(self, wide: float) -> float:
        """The share of a picture of so many px (`wide`) that a label takes, in letters that fit."""
        size = max(1, min(grown(_LETTERS), int(_MOST * wide / _LONG)))
        for label in self.labels:
            label.size = size
        return _LONG * size / wide

    def show_colour(self, colour: str) -> None:
        self.actor.prop.color = colour
        for label in self.labels:
            label.prop.color = colour
