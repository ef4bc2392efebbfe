"""What is written and marked in the picture of the skin: sides, ruler, elements, alarm."""

import textwrap
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from kappaskin.skin import Distances
from kappaskin_app.shell.drawn_skin import MM, Direction, DrawnSkin, Indices
from kappaskin_app.theme import WANTED, current, follow_look, grown

UNLIT = {"lighting": False, "pickable": False, "reset_camera": False, "render": False}
"""For `add_mesh`: the same colour from every side, nothing drawn and the camera left alone."""


def pixels(plotter: Any, size: float) -> float:
    """How many of VTK's pixels, which are the screen's, are `size` of the window's."""
    return size * plotter.devicePixelRatioF()


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
        follow_look(plotter, self.fit)

    def say(self, words: str) -> None:
        """Say `words`; a number and its unit stay together."""
        self.words = words
        self.fit()

    def fit(self) -> None:
        """Say them in the letters of now, in lines for which the picture of now has room."""
        whole = self.words.replace(" mm", "\N{NO-BREAK SPACE}mm")
        lines = textwrap.wrap(whole, room_for(self._plotter, self._px))
        self.text.prop.font_size, self.text.prop.color = grown(self._px), current().text
        self.text.input = "\n".join(lines).replace("\N{NO-BREAK SPACE}", " ")


_SIDE_LETTERS = 15  # px
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
        follow_look(plotter, self._dress)

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
        size = max(1, min(grown(_SIDE_LETTERS), int(_MOST * wide / _LONG)))
        for label in self.labels:
            label.size = size
        return _LONG * size / wide

    def _dress(self) -> None:
        for part in (self.actor, *self.labels):
            part.prop.color = current().text


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


def told(found: Distances) -> str:
    """The distances in words."""
    higher = f"{1e3 * found.higher:+z.2f}".replace("-", "\N{MINUS SIGN}")
    return (
        f"straight {1e3 * found.straight:.2f} mm, along the skin {1e3 * found.along:.2f} mm, "
        f"height {higher} mm"
    )


_ABOVE = 1.5  # times as high as the elements are drawn, or one hides in the other


class Marks:
    """Large points of one colour at some elements, which move with the skin."""

    def __init__(self, plotter: Any, size: int, colour: str) -> None:
        self._points: Any = pv.PolyData(np.zeros((1, 3)))
        self.actor = plotter.add_mesh(
            self._points,
            style="points",
            point_size=pixels(plotter, size),
            color=colour,
            **UNLIT,
        )
        self.actor.visibility = False
        self._at_rest = (np.empty((0, 3)), np.empty((0, 3)))
        self._nearest: Indices = np.empty(0, np.intp)

    def place(self, skin: DrawnSkin, positions: Array) -> None:
        """Mark the elements at `positions` (n, 2) in m on this `skin`."""
        self.actor.visibility = bool(len(positions))
        if not len(positions):
            return
        self._at_rest, self._nearest = skin.at_rest(positions), skin.nearest(positions)
        self._points.points = self._at_rest[0].copy()
        count = len(positions)
        self._points.verts = np.column_stack([np.ones(count, int), np.arange(count)]).ravel()

    def follow(self, skin: DrawnSkin, lift: float) -> None:
        """Move with a `skin` that has another shape, `lift` above it."""
        if self.actor.visibility:
            points, out = self._at_rest
            height = skin.height.ravel()[self._nearest] + _ABOVE * lift
            self._points.points[:] = points + out * height[:, None]


_WIDTH = 54  # characters, at which what is said still fits beside the panels of a small window
_LINES = 5  # of such a width, and more of a lesser one
_ALARM_LETTERS = 15  # px


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
        follow_look(plotter, self.fit)

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
        wide = min(room_for(self._plotter, _ALARM_LETTERS), _WIDTH)
        most = _LINES * _WIDTH // wide
        lines = textwrap.wrap(rest, wide, max_lines=most, placeholder=" ...")
        self.actor.prop.font_size = grown(_ALARM_LETTERS)
        self.actor.prop.background_color = current().bad
        self.actor.input = "\n".join([head, *lines]) if self.text else ""
