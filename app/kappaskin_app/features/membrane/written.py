"""Words in the picture, in as many lines as its width makes of them."""

import textwrap
from typing import Any

import pyvista as pv

from kappaskin_app.theme import grown

_LETTER = 0.55  # times its height that a letter is wide on the average, or less
_BESIDE = 0.015  # of the picture's width on both sides
_LEAST = 12  # characters in a line


def room_for(plotter: Any, px: float) -> int:
    """How many letters of `px`, in those of now, have room beside each other in the picture."""
    room = (1 - 2 * _BESIDE) * plotter.width() / (_LETTER * grown(px))
    return max(int(room), _LEAST)


class Caption:
    """Says something from `height` of the picture of a `plotter` on, in letters of `px`."""

    def __init__(self, plotter: Any, px: float, height: float, vertical: str = "bottom") -> None:
        self._plotter, self._px, self.words = plotter, px, ""
        self.text: Any = pv.Text("")
        self.text.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
        self.text.position = _BESIDE, height
        self.text.prop.justification_vertical = vertical
        plotter.add_actor(self.text, reset_camera=False, render=False)

    def say(self, words: str) -> None:
        """Say `words`; a number and its unit stay together."""
        self.words = words
        self.fit()

    def fit(self) -> None:
        """Say them in the letters of now, in lines for which the picture of now has room."""
        whole = self.words.replace(" mm", "\N{NO-BREAK SPACE}mm")
        lines = textwrap.wrap(whole, room_for(self._plotter, self._px))
        self.text.prop.font_size = grown(self._px)
        self.text.input = "\n".join(lines).replace("\N{NO-BREAK SPACE}", " ")

    def show_colour(self, colour: str) -> None:
        self.text.prop.color = colour
        self.fit()
