"""Two places on the skin and how far they are apart, drawn and written in the picture."""

from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from kappaskin.skin import Distances
from kappaskin_app.features.membrane.unlit import UNLIT, pixels
from kappaskin_app.features.membrane.written import Caption
from kappaskin_app.shell.drawn_skin import DrawnSkin
from kappaskin_app.theme import WANTED, Theme

Array = NDArray[np.float64]

_LETTERS = 15  # px
_STEPS = 48  # of the line along the skin


class Ruler:
    """A line along the skin and one through the air, with their lengths."""

    def __init__(self, plotter: Any) -> None:
        along = np.insert(np.arange(_STEPS), 0, _STEPS)
        straight = [2, 0, _STEPS - 1]
        self._lines: Any = pv.PolyData(
            np.zeros((_STEPS, 3)), lines=np.concatenate([along, straight])
        )
        self._ends: Any = pv.PolyData(np.zeros((2, 3)))
        self.actor = plotter.add_mesh(
            self._lines, color=WANTED, line_width=pixels(plotter, 3), **UNLIT
        )
        self._ends_actor = plotter.add_mesh(
            self._ends, style="points", point_size=pixels(plotter, 11), color=WANTED, **UNLIT
        )
        self._words = Caption(plotter, _LETTERS, 0.03)
        self.text: Any = self._words.text
        self.fit = self._words.fit
        self.hide()

    def hide(self) -> None:
        self.actor.visibility = self._ends_actor.visibility = False
        self._words.say("")

    def ask(self, words: str) -> None:
        """Say what is to be done; nothing is measured yet."""
        self.hide()
        self._words.say(words)

    def show(self, skin: DrawnSkin, places: Array, lift: float, found: Distances | None) -> None:
        """Draw it between `places` (k, 2) in m, one or two, `lift` mm above the skin."""
        line = places[0] + np.linspace(0, 1, _STEPS)[:, None] * (places[-1] - places[0])
        points, _ = skin.place(line, lift)
        self._lines.points[:] = points
        self._ends.points[:] = points[[0, -1]]
        self._ends_actor.visibility = True
        self.actor.visibility = found is not None
        if found is not None:
            self._words.say(told(found))

    def show_theme(self, theme: Theme) -> None:
        self._words.show_colour(theme.text)


def told(found: Distances) -> str:
    """The distances in words."""
    higher = f"{1e3 * found.higher:+z.2f}".replace("-", "\N{MINUS SIGN}")
    return (
        f"straight {1e3 * found.straight:.2f} mm, along the skin {1e3 * found.along:.2f} mm, "
        f"height {higher} mm"
    )
