"""3-D view of the skin: shape, loads and contact."""

import math
import time
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget
from pyvistaqt import QtInteractor

from kappaskin.frames import Array, Estimate, Indices
from kappaskin.mechanics import Load
from kappaskin.sensing import Sensor
from kappaskin_app.features.membrane.annotations import (
    UNLIT,
    Alarm,
    Caption,
    Marks,
    Sides,
    magnified,
    pixels,
)
from kappaskin_app.features.membrane.camera import CameraControl
from kappaskin_app.features.membrane.loads import LOAD, DrawnLoads, put_upright
from kappaskin_app.features.membrane.mouse import LoadDrag, SurfacePointer
from kappaskin_app.features.membrane.surface import WHOLE, Box, GridLines, Shares, Surface
from kappaskin_app.guard import guarded
from kappaskin_app.shell.drawn_skin import DrawnSkin
from kappaskin_app.theme import (
    CONTACT,
    DARK_INK,
    LIGHT_INK,
    OUT,
    WANTED,
    Colours,
    current,
    follow_look,
)

_LETTERS = 14  # px, of the caption
_CORNER = 15  # letters at its right: the vertical exaggeration, and which error bars are drawn
_LIFT = 0.006  # of the skin's size above the surface, which would hide half of a line
_POINT, _POINTS = 5, 80  # px of an element, and of many in a row: or they would hide the skin
_PIN = 0.3  # of the skin's size, length of the mark of a contact
_LATER = 20  # ms after a change of the look
_FITTED, _TRUE = (8, 0), (16, 8)  # lines drawn: every so many, from which one on


def _spare(length: int, ratio: float) -> int:
    """Px to subtract from a length so that it is a whole number of the screen's pixels."""
    return next((spare for spare in range(4) if (length - spare) * ratio % 1 == 0), 0)


class MembraneView(QWidget):
    """View of estimates, displaced along the normals of the skin; `drag` moves loads."""

    drawn = Signal()
    look_changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        # Multisampling would halve the rate in software; a timer of its own would draw twice.
        self.plotter = QtInteractor(self, auto_update=False, multi_samples=0)
        # Else each drawing composes the whole window, a fifth of its time in software.
        self.plotter.setAttribute(Qt.WidgetAttribute.WA_DontCreateNativeAncestors)
        self.plotter.setAttribute(Qt.WidgetAttribute.WA_NativeWindow)
        self.plotter.setAcceptDrops(False)  # or it would open any file as a mesh
        self._around = QVBoxLayout(self)
        self._around.setContentsMargins(0, 0, 0, 0)
        self._around.addWidget(self.plotter)
        # Order-independent blending adds 8 ms to each drawing with anything translucent.
        self.plotter.renderer.SetUseOIT(False)
        self._make_actors()
        self._make_lights()
        self.pointer = SurfacePointer(
            self.plotter
        )  # after the drag: of filters the last goes first
        self.drag = LoadDrag(self.plotter)
        self.camera_control = CameraControl(self.plotter, self.sides)
        self.pointer.moved.connect(guarded(self.drag.show_cursor))
        self.setFocusProxy(self.plotter)
        # Left of the skin turns the camera; the right button also where the left one presses.
        self.plotter.enable_custom_trackball_style(right="rotate")
        # After VTK has the new size.
        self._fit_timer = QTimer(self, singleShot=True, interval=0)  # pyright: ignore[reportCallIssue]
        self._fit_timer.timeout.connect(guarded(self._fit))
        # What a theme changes here has a turn of its own, or it would hold the window for longer.
        self._look_timer = QTimer(self, singleShot=True, interval=_LATER)  # pyright: ignore[reportCallIssue]
        self._look_timer.timeout.connect(guarded(lambda: (self._fit(), self.look_changed.emit())))
        self._box = Box()
        self.setMinimumSize(300, 160)
        self.ages: deque[tuple[float, float]] = deque(maxlen=8192)
        """(when, age in s) of each frame drawn, once its first drawing is completed."""
        self.age_sd = float("inf")
        """Standard deviation in s of the last age; infinite where it is a lower bound."""
        self._frame_time = self._noted = float("nan")
        self._drawn = True
        self.plotter.renderer.AddObserver("EndEvent", self._note_drawing)
        self.skin = self.drag.skin
        self.lift = 0.0
        """Height in mm of lines and points above the skin."""
        self._shown = dict.fromkeys(("fit", "elements", "truth", "contact", "load"), True)
        self._of_elements: Indices = np.empty(0, np.intp)
        self._elements_at_rest = (np.empty((0, 3)), np.empty((0, 3)))
        self._positions = self._own_elements = np.empty((0, 2))
        self._marked = b"", -1
        self._arrays: dict[str, Any] = {}
        self._ink = "#ffffff"
        follow_look(self, self._apply_theme)

    def _make_actors(self) -> None:
        plotter = self.plotter
        self.surface = Surface(plotter)
        self._elements: Any = pv.PolyData(np.zeros((1, 3)))
        self._grid = GridLines(plotter, *_FITTED, opacity=0.45)
        self._truth = GridLines(plotter, *_TRUE, color=LOAD)
        self._elements_actor = plotter.add_mesh(
            self._elements, style="points", point_size=pixels(plotter, _POINT), **UNLIT
        )
        self.excluded = Marks(plotter, 11, OUT)
        # Visible on every colour.
        self._around_target = Marks(plotter, 26, DARK_INK)
        self.target = Marks(plotter, 18, WANTED)
        self.pointed = Marks(plotter, 17, DARK_INK), Marks(plotter, 12, LIGHT_INK)
        self._loads = DrawnLoads(plotter)
        # A pin, whose upper end is seen where its head lies deep in a dent.
        needle = pv.Cylinder(
            center=(0, 0, _PIN / 2), direction=(0, 0, 1), radius=0.006, height=_PIN
        )
        pin = needle.append_polydata(pv.Sphere(radius=0.018))
        self._contacts = [
            plotter.add_mesh(pin, color=CONTACT, ambient=0.6, reset_camera=False, render=False)
            for _ in range(2)
        ]
        self.sides = Sides(plotter)
        self._caption = Caption(plotter, _LETTERS, 0.98, "top", spared=_CORNER)
        self.caption: Any = self._caption.text
        self.corner, self.error_bars = Caption(plotter, _LETTERS, 0.98, "top", "right"), ""
        self.limited = False
        """Whether the requested exaggeration is too large to be drawn."""
        self.alarm = Alarm(plotter)

    def _make_lights(self) -> None:
        """Add a low light from the left for relief, and a weak one at the camera."""
        self.plotter.remove_all_lights()
        lamp = pv.Light(position=(-1.0, 0.4, 0.75), light_type="scene light", intensity=0.65)
        lamp.positional = False
        self.plotter.add_light(lamp)
        self.plotter.add_light(pv.Light(light_type="headlight", intensity=0.3))

    def _note_drawing(self, *_: object) -> None:
        now = time.monotonic()
        self._drawn = True
        if self._frame_time != self._noted:  # else drawn again, by the camera or while paused
            self._noted = self._frame_time
            self.ages.append((now, now - self._noted))
        self.drawn.emit()

    # Skin: rebuilt only for another one.

    def show_skin(self, sensor: Sensor, nx: int, ny: int) -> None:
        """Draw the skin of `sensor` with nx x ny points, at rest until an estimate."""
        patch = sensor.layout.patch
        another = self.surface.actor is None or self.skin.patch != patch
        skin = DrawnSkin(patch, nx, ny)
        self.skin = self.drag.skin = self.pointer.skin = self.camera_control.skin = skin
        self.surface.show_skin(skin, sensor.layout)
        self.show_options(**self._shown)
        self.lift = _LIFT * skin.size
        for grid in (self._grid, self._truth):
            grid.show_skin(skin)
        self._positions = sensor.layout.positions
        self.show_marked(np.empty(0, np.intp), -1)
        self.point(-1)
        self._own_elements = sensor.layout.positions[sensor.layout.alive]
        self.show_elements()
        for ball in self._contacts:
            ball.scale = skin.size
        self.sides.show_skin(skin)
        self.show_box(self._box.shares)
        if another:
            self.camera_control.place()

    def show_elements(self, positions: Array | None = None) -> None:
        """Draw elements at `positions` (P, 2) in m, or those of the sensor where None."""
        if self.surface.actor is None:
            return
        positions = self._own_elements if positions is None else positions
        self._elements_at_rest = self.skin.at_rest(positions)
        self._of_elements = self.skin.nearest(positions)
        points, out = self._elements_at_rest
        self._elements_actor.visibility = self._shown["elements"]
        self._size_elements()
        height = self.skin.height.ravel()[self._of_elements] + self.lift
        self._elements.points = points + out * height[:, None]
        self._elements.verts = np.column_stack(
            [np.ones(len(points), int), np.arange(len(points))]
        ).ravel()
        # VTK arrays that change; looking them up takes longer than filling them.
        self._arrays = {"elements": self._elements.points}

    def _size_elements(self) -> None:
        size = min(_POINT, _POINTS / max(len(self._positions), 1) ** 0.5) * magnified(self.plotter)
        self._elements_actor.prop.point_size = pixels(self.plotter, size)

    def show_marked(self, excluded: Indices, target: int) -> None:
        """Mark elements that are left `out`, and the one that is `target` to be pressed, if any."""
        marked = (excluded.tobytes(), target)
        if marked != self._marked:
            self._marked = marked
            self.excluded.place(self.skin, self._positions[excluded])
            for marks in (self._around_target, self.target):
                marks.place(self.skin, self._positions[[target] if target >= 0 else []])
            self.plotter.update()

    def point(self, element: int) -> None:
        """Mark the element that is pointed at; -1 for none."""
        there = [element] if 0 <= element < len(self._positions) else []
        for marks in self.pointed:
            marks.place(self.skin, self._positions[there])
        self._follow_pointed()
        self.plotter.update()

    def _follow_pointed(self) -> None:
        for above, marks in enumerate(self.pointed, 2):
            marks.follow(self.skin, above * self.lift)  # the inner one above its rim

    def resizeEvent(self, event: QResizeEvent) -> None:
        # A view that ends within a pixel of the screen would have a black edge.
        right, upper = (_spare(side, self.devicePixelRatioF()) for side in event.size().toTuple())
        self._around.setContentsMargins(0, upper, right, 0)
        super().resizeEvent(event)
        self._fit_timer.start()

    def _fit(self) -> None:
        """Fit camera and texts to the size of the view."""
        self.camera_control.fit()
        self._size_elements()
        for caption in (self._caption, self.corner):
            caption.fit()
        self.alarm.fit()

    # Estimates.

    def show_estimate(
        self, estimate: Estimate, values: NDArray[Any], limits: tuple[float, float], times: float
    ) -> None:
        """Draw a shape exaggerated by `times`, coloured by `values`.

        `values` (ny, nx) of the surface are coloured between `limits` in any unit; (P, 3) are
        colours of the elements.
        """
        skin = self.skin
        if estimate.surface.shape != skin.height.shape or self.surface.lost:
            return  # of another skin, or received after the loss
        skin.show_displacement(estimate.surface, times)
        self.sides.follow(skin)
        self._show_corner(times)
        self.surface.show_shape(skin)
        self.surface.show_values(skin, values, limits)
        self._show_grids(skin, estimate.true_surface, times)
        if self._elements_actor.visibility:
            points, out = self._elements_at_rest
            height = skin.height.ravel()[self._of_elements] + self.lift
            self._arrays["elements"][:] = points + out * height[:, None]
        for marks in (self.excluded, self._around_target):
            marks.follow(skin, self.lift)
        self.target.follow(skin, 1.5 * self.lift)  # above its rim
        self._follow_pointed()
        for ball, contact in zip(self._contacts, (estimate.contact, estimate.second), strict=True):
            put_upright(ball, skin, contact.position)
            ball.visibility = ball.visibility and self._shown["contact"]
            ball.prop.color = current().faint if contact.near_rim else CONTACT
        if self._box.shares != WHOLE:
            self._box.cut(self.plotter.actors.values())  # some may be new
        known = math.isfinite(estimate.taken)
        # Without a known time of its scan the age since arrival is a lower bound.
        self._frame_time = estimate.taken if known else estimate.host_time
        self.age_sd = estimate.taken_sd if known else math.inf
        self._request()

    def _show_corner(self, times: float) -> None:
        """State the vertical exaggeration, unless there is none, and which error bars are drawn.

        An exaggeration below the requested one is explained.
        """
        height = f"height \N{MULTIPLICATION SIGN} {times:.3g}" if times != 1 else ""
        height += "\nmost that fits" * self.limited
        bars = f"errors {self.error_bars}" if self.error_bars else ""
        if (text := "\n".join(filter(None, (height, bars)))) != self.corner.words:
            self.corner.show(text)

    def _show_grids(self, skin: DrawnSkin, true: Array, times: float) -> None:
        """Draw the lines of the fitted and of the `true` (ny, nx) surface."""
        self._grid.show(skin, skin.height + self.lift / 2)
        self._truth.show(skin, self.lift + skin.height_of(true, times))
        self._grid.actor.visibility &= self._shown["fit"]
        self._truth.actor.visibility &= self._shown["truth"]

    def _request(self) -> None:
        # One drawing at a time: further requests would queue up in Qt.
        self._drawn = False
        self.plotter.update()

    @property
    def ready(self) -> bool:
        """Whether the picture target for last has been drawn."""
        return self._drawn

    def show_loads(self, loads: Sequence[Load], lifted: bool = False) -> None:
        """Draw the simulated loads, which may all be `lifted`; none without a connection."""
        self.drag.lifted = lifted and not self.surface.lost
        loads = [load for load in loads if load.force and not self.surface.lost]
        self.drag.handles = self._loads.show(loads, self.skin, self.lift, self._shown["load"])

    # Options.

    def show_unit(self, unit: float) -> None:
        """Use the presenter's large letters where a unit of it is so many px; 0: the usual ones."""
        for part in (self.sides, self._caption, self.corner):
            part.unit = unit
        self._fit_timer.start()

    def show_options(self, **shown: bool) -> None:
        """Draw or hide the fit, the elements, the truth, the contact and the load."""
        self._shown = shown
        if self.surface.actor is not None:
            self._elements_actor.visibility = shown["elements"]
            self.surface.actor.visibility = shown["fit"]
        self.plotter.update()

    def show_box(self, shares: Shares) -> None:
        """Clip the view to shares of the skin: from and to along x, y and height."""
        self._box.shares = shares
        self._box.show(self.skin)
        self._box.cut(self.plotter.actors.values())
        self.plotter.update()

    def show_caption(self, text: str) -> None:
        """Show a text about the colours in the view; none if empty."""
        if text != self._caption.words:
            self._caption.show(text)
            self.plotter.update()

    def show_colours(self, colours: Colours, ink: str) -> None:
        """Set the colour map (256, 3), with points and lines in `ink`."""
        self.surface.show_colours(colours)
        self._ink = ink
        self._elements_actor.prop.color = ink
        self._grid.actor.prop.color = ink

    def show_lost(self, lost: bool) -> None:
        """Grey the skin while the connection is lost."""
        if self.surface.actor is None or lost == self.surface.lost:
            return
        if lost:
            self.show_loads(())
            for ball in self._contacts:
                ball.visibility = False
        self.surface.show_lost(lost)
        self.plotter.update()

    def _apply_theme(self) -> None:
        self.plotter.set_background(current().scene, top=current().scene_top)
        self._look_timer.start()
        self.plotter.update()

    def close_plotter(self) -> None:
        """Free VTK's resources before the window closes."""
        self._fit_timer.stop()
        self._look_timer.stop()
        # Its wrapper of a QSurface, which is no QObject, outlives what Qt deletes with the window;
        # whatever comes to lie there next is then taken for it: a wrong type, or a crash.
        self.plotter._cleanup_context()  # noqa: SLF001
        self.plotter.close()
