"""Words across the picture that cannot be missed: nothing new comes in, since when, and why."""

import textwrap
from typing import Any

import pyvista as pv

from kappaskin_app.features.membrane.written import room_for
from kappaskin_app.theme import Theme, grown

_WIDTH = 54  # characters, at which what is said still fits beside the panels of a small window
_LINES = 5  # of such a width, and more of a lesser one
_LETTERS = 15  # px


class Alarm:
    """A box of text in the upper left of the picture of `plotter`."""

    def __init__(self, plotter: Any) -> None:
        self._plotter, self.text = plotter, ""
        self.actor: Any = pv.Text("")
        self.actor.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
        self.actor.position = 0.015, 0.9
        style = self.actor.prop
        style.color, style.background_opacity = "white", 0.9
        style.bold, style.justification_vertical = True, "top"
        plotter.add_actor(self.actor, reset_camera=False, render=False)

    def show(self, text: str) -> None:
        """Say `text`, its first line apart; or nothing."""
        if text == self.text:
            return
        self.text = text
        self.fit()
        self._plotter.update()

    def fit(self) -> None:
        """Say it in the letters of now, in lines for which the picture of now has room."""
        head, _, rest = self.text.partition("\n")
        wide = min(room_for(self._plotter, _LETTERS), _WIDTH)
        most = _LINES * _WIDTH // wide
        lines = textwrap.wrap(rest, wide, max_lines=most, placeholder=" ...")
        self.actor.prop.font_size = grown(_LETTERS)
        self.actor.input = "\n".join([head, *lines]) if self.text else ""

    def show_theme(self, theme: Theme) -> None:
        self.actor.prop.background_color = theme.bad
