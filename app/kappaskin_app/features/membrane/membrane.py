"""The skin in three dimensions: its shape, what bends it, and where it is touched."""

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

from kappaskin.frames import Estimate
from kappaskin.mechanics import Load
from kappaskin.sensing import Sensor
from kappaskin_app.features.membrane.annotations import UNLIT, Alarm, Caption, Marks, Sides, pixels
from kappaskin_app.features.membrane.camera import Gaze
from kappaskin_app.features.membrane.loads import DrawnLoads, put_upright
from kappaskin_app.features.membrane.mouse import LoadDrag, SurfacePointer
from kappaskin_app.features.membrane.surface import WHOLE, Box, Shares, Surface
from kappaskin_app.guard import guarded
from kappaskin_app.shell.drawn_skin import MM, DrawnSkin, Indices
from kappaskin_app.theme import DARK_INK, LIGHT_INK, OUT, WANTED, Colours, current, follow_look

Array = NDArray[np.float64]

_LETTERS = 14  # px, of the caption
_LIFT = 0.006  # of the skin's size above the surface, or half of a line drowns in it
_STRIDE = 8  # surface lines between two lines of the true surface's wireframe


def _spare(length: int, ratio: float) -> int:
    """How many px of a length to do without, to end between two pixels of the screen."""
    return next((spare for spare in range(4) if (length - spare) * ratio % 1 == 0), 0)


class MembraneView(QWidget):
    """Shows estimates, the skin pressed in along its normals; `drag` says when a load is moved."""

    drawn = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        # Multisampling would halve the rate in software; a timer of its own would draw twice.
        self.plotter = QtInteractor(self, auto_update=False, multi_samples=0)
        # Else each picture has the whole window put together anew, a fifth of its time in software.
        self.plotter.setAttribute(Qt.WidgetAttribute.WA_DontCreateNativeAncestors)
        self.plotter.setAttribute(Qt.WidgetAttribute.WA_NativeWindow)
        self.plotter.setAcceptDrops(False)  # or it would take any file for a mesh to draw
        self._around = QVBoxLayout(self)
        self._around.setContentsMargins(0, 0, 0, 0)
        self._around.addWidget(self.plotter)
        # Blending in any order adds 8 ms to each picture, as soon as anything is translucent.
        self.plotter.renderer.SetUseOIT(False)
        self._make_actors()
        self._make_lights()
        self.pointing = SurfacePointer(
            self.plotter
        )  # after the drag: of filters the last goes first
        self.drag = LoadDrag(self.plotter)
        self.gaze = Gaze(self.plotter, self.sides)
        # After VTK has its new size.
        self._fitting = QTimer(self, singleShot=True, interval=0)  # pyright: ignore[reportCallIssue]
        self._fitting.timeout.connect(guarded(self._fit))
        self._box = Box()
        self.setMinimumSize(320, 160)
        self.ages: deque[tuple[float, float]] = deque(maxlen=8192)
        """(when, age of its frame in s) of each drawing completed."""
        self.age_sd = float("inf")
        """Standard deviation in s of the last age; infinite where it is only the least."""
        self._taken = float("nan")
        self._drawn = True
        self.plotter.renderer.AddObserver("EndEvent", self._note_drawing)
        self.skin = self.drag.skin
        self.lift = 0.0
        """How far above the skin, in mm, lines and points are drawn."""
        self._want_elements = self._want_truth = True
        self._of_elements: Indices = np.empty(0, np.intp)
        self._elements_at_rest = (np.empty((0, 3)), np.empty((0, 3)))
        self._positions, self._marked = np.empty((0, 2)), (b"", -1)
        self._arrays: dict[str, Any] = {}
        self._ink = "#ffffff"
        follow_look(self, self._dress)

    def _make_actors(self) -> None:
        plotter = self.plotter
        self.surface = Surface(plotter)
        self._wire: Any = pv.PolyData()
        self._elements: Any = pv.PolyData(np.zeros((1, 3)))
        self._wire_actor: Any = None
        self._elements_actor = plotter.add_mesh(
            self._elements, style="points", point_size=pixels(plotter, 5), **UNLIT
        )
        self.out, self.asked = Marks(plotter, 11, OUT), Marks(plotter, 18, WANTED)
        # Seen on every colour.
        self.pointed = Marks(plotter, 17, DARK_INK), Marks(plotter, 12, LIGHT_INK)
        self._loads = DrawnLoads(plotter)
        self._contact = plotter.add_mesh(
            pv.Sphere(radius=0.018), color="#1fd17a", reset_camera=False, render=False
        )
        self.sides = Sides(plotter)
        self._caption = Caption(plotter, _LETTERS, 0.98, "top")
        self.caption: Any = self._caption.text
        self.alarm = Alarm(plotter)

    def _make_lights(self) -> None:
        """One low lamp from the left for relief, and a weak one at the camera."""
        self.plotter.remove_all_lights()
        lamp = pv.Light(position=(-1.0, 0.4, 0.75), light_type="scene light", intensity=0.65)
        lamp.positional = False
        self.plotter.add_light(lamp)
        self.plotter.add_light(pv.Light(light_type="headlight", intensity=0.3))

    def _note_drawing(self, *_: object) -> None:
        now = time.monotonic()
        self._drawn = True
        self.ages.append((now, now - self._taken))
        self.drawn.emit()

    # What a skin looks like: rebuilt only when another one appears.

    def show_skin(self, sensor: Sensor, nx: int, ny: int) -> None:
        """Draw a surface of nx x ny points for the skin of `sensor`, at rest until an estimate."""
        patch = sensor.layout.patch
        another = self.surface.actor is None or self.skin.patch != patch
        skin = DrawnSkin(patch, nx, ny)
        self.skin = self.drag.skin = self.pointing.skin = self.gaze.skin = skin
        self.surface.show_skin(skin, sensor.layout)
        self.lift = _LIFT * skin.size
        self._wire = self._wireframe(skin)
        self._show_wire()
        self._positions = sensor.layout.positions
        self._marked = (b"", -1)
        self.show_marked(np.empty(0, np.intp), -1)
        self.point(-1)
        self._place_elements(sensor.layout.positions[sensor.layout.live.any(axis=0)])
        self._contact.scale = skin.size
        self._arrays = self._changing()
        self.sides.show_skin(skin)
        self.show_box(self._box.shares)
        if another:
            self.gaze.place()
        self._dress()

    def _show_wire(self) -> None:
        if self._wire_actor is not None:
            self.plotter.remove_actor(self._wire_actor, render=False)
        self._wire_actor = self.plotter.add_mesh(
            self._wire, line_width=pixels(self.plotter, 1), **UNLIT
        )
        self._wire_actor.prop.color = self._ink

    def _changing(self) -> dict[str, Any]:
        """VTK's own arrays of what changes; looking them up takes longer than to fill them."""
        return {"wire": self._wire.points, "elements": self._elements.points}

    def _wireframe(self, skin: DrawnSkin) -> pv.PolyData:
        """Every few lines of the grid, as lines through their own points alone."""
        lines = skin.lines(_STRIDE)
        self._wire_points = np.concatenate(lines)
        ends = np.cumsum([len(line) for line in lines])
        cells = [np.r_[len(x), np.arange(e - len(x), e)] for x, e in zip(lines, ends, strict=True)]
        points = skin.points(self._wire_points, np.full(len(self._wire_points), self.lift))
        return pv.PolyData(points, lines=np.concatenate(cells))

    def _place_elements(self, positions: Array) -> None:
        self._elements_at_rest = self.skin.at_rest(positions)
        self._of_elements = self.skin.nearest(positions)
        points, out = self._elements_at_rest
        self._elements_actor.visibility = self._want_elements
        self._elements.points = points + self.lift * out
        self._elements.verts = np.column_stack(
            [np.ones(len(points), int), np.arange(len(points))]
        ).ravel()

    def show_marked(self, out: Indices, asked: int) -> None:
        """Mark elements that are left `out`, and the one that is `asked` to be pressed, if any."""
        marked = (out.tobytes(), asked)
        if marked != self._marked:
            self._marked = marked
            self.out.place(self.skin, self._positions[out])
            self.asked.place(self.skin, self._positions[[asked] if asked >= 0 else []])
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
            marks.follow(self.skin, above * self.lift)  # the inner one is not to sink into the rim

    def resizeEvent(self, event: QResizeEvent) -> None:
        # A picture that ends within a pixel of the screen would have a black edge there.
        right, upper = (_spare(side, self.devicePixelRatioF()) for side in event.size().toTuple())
        self._around.setContentsMargins(0, upper, right, 0)
        super().resizeEvent(event)
        self._fitting.start()

    def _fit(self) -> None:
        """After picture or letters have another size: have all in it."""
        self.gaze.fit()
        self._caption.fit()
        self.alarm.fit()

    # What changes with every estimate.

    def show_estimate(
        self, estimate: Estimate, values: NDArray[Any], limits: tuple[float, float], times: float
    ) -> None:
        """Draw a shape so many `times` higher than it is, coloured by `values`.

        Those (ny, nx) of the surface are coloured between `limits`, in any unit; colours (P, 3)
        are those of the elements.
        """
        skin = self.skin
        if estimate.surface.shape != skin.height.shape or self.surface.lost:
            return  # of another skin, or a last one that came after the news
        skin.height = -MM * times * np.nan_to_num(estimate.surface)
        self.surface.show_shape(skin)
        self.surface.show_values(skin, values, limits)
        self._show_truth(skin, estimate.true_surface, times)
        if self._elements_actor.visibility:
            points, out = self._elements_at_rest
            height = skin.height.ravel()[self._of_elements] + self.lift
            self._arrays["elements"][:] = points + out * height[:, None]
        for marks in (self.out, self.asked):
            marks.follow(skin, self.lift)
        self._follow_pointed()
        put_upright(self._contact, skin, estimate.contact.position)
        if self._box.shares != WHOLE:
            self._box.cut(self.plotter.actors.values())  # some may be new
        known = math.isfinite(estimate.taken)
        # It was taken before it came: where nothing else is known, it is at least so old.
        self._taken = estimate.taken if known else estimate.host_time
        self.age_sd = estimate.taken_sd if known else math.inf
        self._request()

    def _show_truth(self, skin: DrawnSkin, surface: Array, times: float) -> None:
        true = surface.ravel()[self._wire_points]
        self._wire_actor.visibility = bool(np.isfinite(true).any()) and self._want_truth
        if self._wire_actor.visibility:
            height = -MM * times * np.nan_to_num(true) + self.lift
            self._arrays["wire"][:] = skin.points(self._wire_points, height)

    def _request(self) -> None:
        # One picture at a time: asking again while one is due only makes Qt queue them.
        self._drawn = False
        self.plotter.update()

    @property
    def ready(self) -> bool:
        """Whether the picture asked for last has been drawn."""
        return self._drawn

    def show_loads(self, loads: Sequence[Load]) -> None:
        """Draw the simulated loads where they are now; none for a real sensor, or a lost one."""
        loads = [load for load in loads if load.force and not self.surface.lost]
        self.drag.handles = self._loads.show(loads, self.skin, self.lift)

    # How it is shown.

    def show_options(self, elements: bool, truth: bool) -> None:
        self._want_elements, self._want_truth = elements, truth
        self._elements_actor.visibility = elements and self.surface.actor is not None
        self.plotter.update()

    def show_box(self, shares: Shares) -> None:
        """Draw only what is these shares of the skin: from and to, along x, y and upwards."""
        self._box.shares = shares
        self._box.show(self.skin)
        self._box.cut(self.plotter.actors.values())
        self.plotter.update()

    def show_caption(self, text: str) -> None:
        """Say in the picture what else than what is measured colours the skin, or nothing."""
        if text != self._caption.words:
            self._caption.say(text)
            self.plotter.update()

    def show_colours(self, colours: Colours, ink: str) -> None:
        """Colour by a map of 256 colours (256, 3), with points and lines in `ink`."""
        self.surface.show_colours(colours)
        self._ink = ink
        self._elements_actor.prop.color = ink
        if self._wire_actor:
            self._wire_actor.prop.color = ink

    @property
    def greyed(self) -> bool:
        """Whether the skin is drawn without colours."""
        return self.surface.lost

    def show_lost(self, lost: bool) -> None:
        """Grey the skin while what it shows is not coming in any more."""
        if self.surface.actor is None or lost == self.surface.lost:
            return
        if lost:
            self.show_loads(())
        self.surface.show_lost(lost)
        self._contact.visibility = not lost
        self.plotter.update()

    def _dress(self) -> None:
        self.plotter.set_background(current().scene, top=current().scene_top)
        self._fit()
        self.plotter.update()

    def close_plotter(self) -> None:
        """Before the window goes: give VTK's resources back."""
        self._fitting.stop()
        # Its wrapper of a QSurface, which is no QObject, outlives what Qt deletes with the window;
        # whatever comes to lie there next is then taken for it: a wrong type, or a crash.
        self.plotter._cleanup_context()  # noqa: SLF001
        self.plotter.close()
