"""Words across the picture that cannot be missed: nothing new comes in, since when, and why."""

import textwrap
from typing import Any

import pyvista as pv

from kappaskin_app.theme import Theme

_WIDTH = 54  # characters, at which what is said still fits beside the panels of a small window
_LINES = 5


class Alarm:
    """A box of text in the upper left of the picture of `plotter`."""

    def __init__(self, plotter: Any) -> None:
        self._plotter, self.text = plotter, ""
        self._actor: Any = pv.Text("")
        self._actor.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
        self._actor.position = 0.015, 0.9
        style = self._actor.prop
        style.font_size, style.color, style.background_opacity = 15, "white", 0.9
        style.bold, style.justification_vertical = True, "top"
        plotter.add_actor(self._actor, reset_camera=False, render=False)

    def show(self, text: str) -> None:
        """Say `text`, its first line apart; or nothing."""
        if text == self.text:
            return
        self.text = text
        head, _, rest = text.partition("\n")
        lines = textwrap.wrap(rest, _WIDTH, max_lines=_LINES, placeholder=" ...")
        self._actor.input = "\n".join([head, *lines]) if text else ""
        self._plotter.update()

    def show_theme(self, theme: Theme) -> None:
        self._actor.prop.background_color = theme.bad
