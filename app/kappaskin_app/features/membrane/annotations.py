"""Annotations in the view of the skin: sides, ruler, marks and alarm."""

import textwrap
from typing import Any

import numpy as np
import pyvista as pv

from kappaskin._text import with_error
from kappaskin.frames import Array, Indices
from kappaskin.skin import Distances, MeshSkin
from kappaskin_app.shell.drawn_skin import MM, Direction, DrawnSkin
from kappaskin_app.theme import WANTED, current, follow_look, grown
from kappaskin_app.widgets.lettering import CAPTION

UNLIT = {"lighting": False, "pickable": False, "reset_camera": False, "render": False}
"""Arguments of `add_mesh`: no lighting, no rendering, no change of the camera."""


def pixels(plotter: Any, size: float) -> float:
    """`size` in px of the window, in physical px of the screen as VTK counts."""
    return size * plotter.devicePixelRatioF()


_USUAL = 600  # px of the shorter side of a view


def magnified(plotter: Any) -> float:
    """How many times larger letters and points are in a view larger than usual."""
    return max(1.0, min(plotter.width(), plotter.height()) / _USUAL) ** 0.5


_LETTER = 0.55  # average width of a letter, of its height
_MARGIN = 0.015  # of the view's width, on both sides
_LEAST = 12  # characters in a line


_CAPITAL = 0.72  # height of a capital, of that of the letters


def letters_of(plotter: Any, px: float, unit: float) -> int:
    """Height in px of letters of `px`; of the presenter's captions where its unit is not 0."""
    return round(CAPTION * unit / _CAPITAL if unit else grown(px) * magnified(plotter))


def room_for(plotter: Any, letters: float) -> int:
    """Number of letters of this height in px that fit in the view's width."""
    room = (1 - 2 * _MARGIN) * plotter.width() / (_LETTER * letters)
    return max(int(room), _LEAST)


class Caption:
    """Text in letters of `px` at a relative `height` of a `plotter`, at its left or right."""

    def __init__(
        self,
        plotter: Any,
        px: float,
        height: float,
        vertical: str = "bottom",
        side: str = "left",
        spared: int = 0,
    ) -> None:
        self._plotter, self._px, self.words, self.unit = plotter, px, "", 0.0
        self._spared = spared  # letters left free on the other side
        self.text: Any = pv.Text("")
        self.text.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
        self.text.position = _MARGIN if side == "left" else 1 - _MARGIN, height
        self.text.prop.justification_vertical = vertical
        self.text.prop.justification_horizontal = side
        plotter.add_actor(self.text, reset_camera=False, render=False)
        follow_look(plotter, self.fit)

    def show(self, words: str) -> None:
        """Show `words`; a number and its unit are not separated."""
        self.words = words
        self.fit()

    def fit(self) -> None:
        """Wrap the text at the present size of letters and view."""
        whole = self.words.replace(" mm", "\N{NO-BREAK SPACE}mm")
        whole = whole.replace("\u03c3", "sigma")  # VTK's letters have no Greek ones
        letters = letters_of(self._plotter, self._px, self.unit)
        room = max(room_for(self._plotter, letters) - self._spared, _LEAST)
        lines = [line for part in whole.split("\n") for line in textwrap.wrap(part, room)]
        self.text.prop.font_size, self.text.prop.color = letters, current().text
        self.text.input = "\n".join(lines).replace("\N{NO-BREAK SPACE}", " ")


_SIDE_LETTERS = 15  # px
_OUT = 0.004  # of the skin's size: how far out lines are drawn, which the surface would hide
_HELD = 4  # px: the line along the rim where it is held
_LABEL_WIDTH = 5.2  # width of a label with its margin, of the letters' height
_MOST_WIDTH = 0.2  # of the view's width, of one label


class Sides:
    """Labels of the corner 0 and of the sides along x and y.

    For a flat skin smaller than its rectangle, lines show these sides. A cap or mesh has labels at
    the ends along x and y, and a line around its rim, which is thick where a mesh is held.
    """

    def __init__(self, plotter: Any) -> None:
        self._lines: Any = pv.PolyData(np.zeros((3, 3)), lines=[3, 1, 0, 2])
        self.actor = plotter.add_mesh(self._lines, line_width=pixels(plotter, 1), **UNLIT)
        self._held: Any = pv.PolyData(np.zeros((2, 3)), lines=[2, 0, 1])
        self.held = plotter.add_mesh(self._held, line_width=pixels(plotter, _HELD), **UNLIT)
        self.actor.visibility = self.held.visibility = False
        self._rim = np.empty((0, 3)), np.empty((0, 3))
        self.unit = 0.0
        self.labels: list[Any] = [pv.Label() for _ in range(3)]
        for label in self.labels:
            plotter.add_actor(label, reset_camera=False, render=False)
        follow_look(plotter, self._apply_theme)

    def show_skin(self, skin: DrawnSkin) -> None:
        a, b = skin.patch.a, skin.patch.b
        x, y = f"x {round(a * MM, 1):g} mm", f"y {round(b * MM, 1):g} mm"
        if len(line := skin.rim):
            left, low = line.argmin(axis=0)
            ends, texts = line[[left, line[:, 0].argmax(), low]], ("x 0", x, "y 0")
            shares = np.array([(-0.1, 0, 0), (0.06, 0, 0), (-0.02, -0.12, 0)])
        else:
            ends, texts = np.array([(0.0, 0.0), (a, 0.0), (0.0, b)]), ("0", x, y)
            shares = np.array([(-0.04, -0.04, 0), (0, -0.06, 0), (0, 0.05, 0)])
            line = ends[[1, 0, 2]]
        self._rim = skin.at_rest(line)
        self._lines.points = self._rim[0] + _OUT * skin.size * self._rim[1]
        self._lines.lines = np.r_[len(line), : len(line)]
        self.actor.visibility = not skin.on.all()
        self.held.visibility = isinstance(skin.patch, MeshSkin)
        if isinstance(skin.patch, MeshSkin):
            on = np.isin(skin.patch.rim, skin.patch.held)
            first = np.flatnonzero(on & np.roll(on, -1))
            self._held.points = self._lines.points
            self._held.lines = np.column_stack([np.full_like(first, 2), first, first + 1]).ravel()
        places = skin.at_rest(ends)[0] + shares * (MM * np.array([a, b, 0]))
        for label, text, at in zip(self.labels, texts, places, strict=True):
            label.input = text
            label.position = tuple(at)
        # A centred text would lie below a skin that rises steeply.
        y_at = "right" if any(skin.patch.curvatures) else "center"
        self.labels[2].prop.justification_horizontal = y_at

    def follow(self, skin: DrawnSkin) -> None:
        """Follow the rim of a mesh that is held in part."""
        if self.held.visibility:
            points, out = self._rim
            height = skin.rim_height() + _OUT * skin.size
            for line in (self._lines, self._held):
                line.points[:] = points + out * height[:, None]

    def show_from(self, direction: Direction | None) -> None:
        """Hide the label of a side seen end-on, which would cover the rim."""
        for axis, label in enumerate(self.labels[1:]):
            label.SetVisibility(direction is None or direction.sees(axis))

    def fit(self, plotter: Any) -> float:
        """Fit the letters to the view; the share of its width that a label takes."""
        wide, large = plotter.width(), letters_of(plotter, _SIDE_LETTERS, self.unit)
        size = max(1, min(large, int(_MOST_WIDTH * wide / _LABEL_WIDTH)))
        for label in self.labels:
            label.size = size
        return _LABEL_WIDTH * size / wide

    def _apply_theme(self) -> None:
        for part in (self.actor, self.held, *self.labels):
            part.prop.color = current().text


_LETTERS = 15  # px
_STEPS = 48  # points of the line along the skin


class Ruler:
    """A line along the skin and a straight one, with their lengths."""

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
        self._caption = Caption(plotter, _LETTERS, 0.03)
        self.text: Any = self._caption.text
        self.fit = self._caption.fit
        self.hide()

    def hide(self) -> None:
        self.actor.visibility = self._ends_actor.visibility = False
        self._caption.show("")

    def show_hint(self, words: str) -> None:
        """Show what to do next; nothing is measured yet."""
        self.hide()
        self._caption.show(words)

    def show(self, skin: DrawnSkin, places: Array, lift: float, found: Distances | None) -> None:
        """Draw it between one or two `places` (k, 2) in m, `lift` mm above the skin."""
        line = places[0] + np.linspace(0, 1, _STEPS)[:, None] * (places[-1] - places[0])
        points, _ = skin.place(line, lift)
        self._lines.points[:] = points
        self._ends.points[:] = points[[0, -1]]
        self._ends_actor.visibility = True
        self.actor.visibility = found is not None
        if found is not None:
            self._caption.show(distances_text(found))


def distances_text(found: Distances) -> str:
    """Text of the distances."""
    return (
        f"straight {1e3 * found.straight:.2f} mm, along the skin {1e3 * found.along:.2f} mm, "
        f"height {with_error(1e3 * found.higher, unit='mm', digits=2, sign='+')}"
    )


_ABOVE = 1.5  # of the elements' lift, or marks and elements hide each other


class Marks:
    """Large points of one colour at elements, which follow the shape."""

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
        """Follow the shape of the `skin`, `lift` mm above it."""
        if self.actor.visibility:
            points, out = self._at_rest
            height = skin.height.ravel()[self._nearest] + _ABOVE * lift
            self._points.points[:] = points + out * height[:, None]


_WIDTH = 54  # characters that fit in a small window
_LINES = 5  # of this width, and more if narrower
_ALARM_LETTERS = 15  # px


class Alarm:
    """Box of text in the upper left of the view."""

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
        """Show `text` below its first line; no box if empty."""
        if text == self.text:
            return
        self.text = text
        self.fit()
        self._plotter.update()

    def fit(self) -> None:
        """Wrap the text at the present size of letters and view."""
        head, _, rest = self.text.partition("\n")
        wide = min(room_for(self._plotter, grown(_ALARM_LETTERS)), _WIDTH)
        most = _LINES * _WIDTH // wide
        lines = textwrap.wrap(rest, wide, max_lines=most, placeholder=" ...")
        self.actor.prop.font_size = grown(_ALARM_LETTERS)
        self.actor.prop.background_color = current().bad
        self.actor.input = "\n".join([head, *lines]) if self.text else ""
