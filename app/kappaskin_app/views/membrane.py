"""The skin in three dimensions: its shape, what bends it, and where it is touched."""

import time
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PySide6.QtCore import QTimer, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget
from pyvistaqt import QtInteractor

from kappaskin import Estimate, LineLoad, Load, Patch, Sensor
from kappaskin_app.theme import Colours, Theme
from kappaskin_app.views.camera import fit_camera
from kappaskin_app.views.drag import ARROW, MM, LoadDrag

Array = NDArray[np.float64]

_LIFT = 0.006  # of the longer side above the surface, or half of a line drowns in it
_STRIDE = 8  # surface lines between two lines of the true surface's wireframe


class MembraneView(QWidget):
    """Shows estimates, the skin pressed in downwards; `drag` says when a load is moved."""

    drawn = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        # Multisampling would halve the rate in software; a timer of its own would draw twice.
        self.plotter = QtInteractor(self, auto_update=False, multi_samples=0)
        around = QVBoxLayout(self)
        around.setContentsMargins(0, 0, 0, 0)
        around.addWidget(self.plotter)
        self._make_actors()
        self._make_lights()
        self.drag = LoadDrag(self.plotter, self._height_at)
        self.setMinimumSize(320, 240)
        self.ages: deque[tuple[float, float]] = deque(maxlen=8192)
        """(when, age of its frame in s) of each drawing completed."""
        self._host_time = float("nan")
        self._drawn = True
        self.plotter.renderer.AddObserver("EndEvent", self._note_drawing)
        self._exaggeration, self._lift, self._want_truth = 1.0, 0.0, True
        self._element_positions: Array = np.zeros((1, 2))
        self._layout_of: Sensor | None = None
        self._heights: Array = np.zeros((2, 2))
        self._lost = False
        self._fitted = True
        for turning in ("InteractionEvent", "MouseWheelForwardEvent", "MouseWheelBackwardEvent"):
            self.plotter.iren.interactor.AddObserver(turning, self._note_turning)
        self._theme: Theme | None = None
        self._ink = "#ffffff"

    def _make_actors(self) -> None:
        plotter = self.plotter
        self._colours = pv.LookupTable()
        # Any: what PyVista says of its own types is too narrow to write into arrays in place.
        self._mesh: Any = pv.PolyData()
        self._wire: Any = pv.PolyData()
        self._elements: Any = pv.PolyData(np.zeros((1, 3)))
        self._line: Any = pv.PolyData(np.zeros((2, 3)), lines=[2, 0, 1])
        self._surface_actor: Any = None
        self._wire_actor: Any = None
        unlit = {"lighting": False, "pickable": False, "reset_camera": False, "render": False}
        self._elements_actor = plotter.add_mesh(
            self._elements, style="points", point_size=5, **unlit
        )
        self._line_actor = plotter.add_mesh(self._line, line_width=5, color="#e8543f", **unlit)
        # Sized for a skin whose longer side is 1; `show_skin` scales them to the one there is.
        arrow = pv.Arrow(start=(0, 0, ARROW), direction=(0, 0, -1), scale=ARROW, tip_length=0.35)
        self._arrows = [
            plotter.add_mesh(arrow, color="#e8543f", reset_camera=False, render=False)
            for _ in range(2)
        ]
        self._contact = plotter.add_mesh(
            pv.Sphere(radius=0.018), color="#1fd17a", reset_camera=False, render=False
        )
        self._labels: list[Any] = [pv.Label(size=15) for _ in range(3)]
        for label in self._labels:
            plotter.add_actor(label, reset_camera=False, render=False)

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
        self.ages.append((now, now - self._host_time))
        self.drawn.emit()

    def _note_turning(self, *_: object) -> None:
        self._fitted = False  # the person chose this view: a new size must not undo it

    # What a skin looks like: rebuilt only when another one appears.

    def show_skin(self, sensor: Sensor, nx: int, ny: int) -> None:
        """Draw a surface of nx x ny points for the skin of `sensor`, flat until an estimate."""
        patch = sensor.layout.patch
        x, y = patch.grid(nx, ny)
        points = np.zeros((ny, nx, 3))
        points[..., 0], points[..., 1] = np.meshgrid(x * MM, y * MM)
        index = np.arange(nx * ny).reshape(ny, nx)
        corners = [index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]]
        quads = np.stack([np.full_like(corners[0], 4), *corners], axis=-1)
        self._mesh = pv.PolyData(points.reshape(-1, 3), faces=quads.ravel())
        self._mesh.point_data["value"] = np.zeros(nx * ny)
        self._mesh.point_data.active_normals = np.tile([0.0, 0.0, 1.0], (nx * ny, 1))
        self._wire = self._wireframe(points)
        self._cell = np.array([x[1] - x[0], y[1] - y[0]])
        self._heights = np.zeros((ny, nx))
        plotter = self.plotter
        for actor in (self._surface_actor, self._wire_actor):
            if actor is not None:
                plotter.remove_actor(actor, render=False)
        self._surface_actor = plotter.add_mesh(
            self._mesh,
            scalars="value",
            cmap=self._colours,
            show_scalar_bar=False,
            smooth_shading=False,
            reset_camera=False,
            render=False,
            specular=0.0,
            ambient=0.6,
            diffuse=0.42,
        )
        self._surface_actor.prop.interpolation = "Gouraud"
        self._wire_actor = plotter.add_mesh(
            self._wire, line_width=1, lighting=False, reset_camera=False, render=False
        )
        positions = np.column_stack([sensor.layout.positions * MM, np.zeros(len(sensor.layout))])
        positions = positions[sensor.layout.live.any(axis=0)]
        self._element_positions = positions[:, :2] / MM
        self._elements.points = positions
        self._elements.verts = np.column_stack(
            [np.ones(len(positions), int), np.arange(len(positions))]
        ).ravel()
        side = MM * max(patch.a, patch.b)
        self._lift, self.drag.arrow = _LIFT * side, ARROW * side
        self._contact.scale = side
        self._place_labels(patch)
        another = self._layout_of is None or self._layout_of.layout.patch != patch
        self._layout_of = sensor
        if another:
            self.reset_camera()
        self._wire_actor.prop.color = self._ink
        if self._theme:
            self.show_theme(self._theme)

    def _wireframe(self, points: Array) -> pv.PolyData:
        """Every few lines of the grid, as lines through their own points alone."""
        ny, nx = points.shape[:2]
        index = np.arange(nx * ny).reshape(ny, nx)
        lines = [*index[::_STRIDE], *index[:, ::_STRIDE].T]
        self._wire_points = np.concatenate(lines)
        ends = np.cumsum([len(line) for line in lines])
        cells = [np.r_[len(x), np.arange(e - len(x), e)] for x, e in zip(lines, ends, strict=True)]
        return pv.PolyData(points.reshape(-1, 3)[self._wire_points], lines=np.concatenate(cells))

    def _place_labels(self, patch: Patch) -> None:
        a, b = patch.a * MM, patch.b * MM
        for label, text, at in zip(
            self._labels,
            ("0", f"x {a:g} mm", f"y {b:g} mm"),
            ((-0.04 * a, -0.04 * b), (a, -0.06 * b), (0.0, 1.05 * b)),
            strict=True,
        ):
            label.input = text
            label.position = (*at, 0.0)
            label.prop.justification_horizontal = "center" if text[0] == "y" else "left"

    def reset_camera(self) -> None:
        """Look at the whole skin, as large as it fits, and again whenever the size changes."""
        if self._layout_of is None:
            return
        fit_camera(self.plotter.renderer, self._layout_of.layout.patch)
        self._fitted = True
        self.plotter.update()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if self._fitted:
            QTimer.singleShot(0, self.reset_camera)  # after VTK has its new size

    # What changes with every estimate.

    def show_estimate(self, estimate: Estimate, values: Array, limits: tuple[float, float]) -> None:
        """Draw a shape, coloured by `values` (ny, nx) between `limits`, in any unit."""
        if self._surface_actor is None or estimate.surface.shape != self._heights.shape:
            return
        if self._lost:
            return  # a last one that came after the news
        self._heights = -MM * self._exaggeration * np.nan_to_num(estimate.surface)
        self._mesh.points[:, 2] = self._heights.ravel()
        self._mesh.point_data.active_normals[:] = self._normals(self._heights)
        self._mesh.point_data["value"][:] = values.ravel()
        self._surface_actor.mapper.scalar_range = limits
        known = bool(np.isfinite(estimate.true_surface[0, 0]))
        self._wire_actor.visibility = known and self._want_truth
        if self._wire_actor.visibility:
            true = estimate.true_surface.ravel()[self._wire_points]
            self._wire.points[:, 2] = -MM * self._exaggeration * true + self._lift
        if self._elements_actor.visibility:
            self._elements.points[:, 2] = self._height_at(self._element_positions) + self._lift
        self._place(self._contact, estimate.touch.position)
        self._host_time = estimate.host_time
        self._request()

    def _request(self) -> None:
        # One picture at a time: asking again while one is due only makes Qt queue them.
        self._drawn = False
        self.plotter.update()

    @property
    def ready(self) -> bool:
        """Whether the picture asked for last has been drawn."""
        return self._drawn

    def _normals(self, z: Array) -> Array:
        """Unit normals (points, 3) of the drawn surface z (ny, nx), in one pass of differences."""
        dy, dx = np.gradient(z, self._cell[1] * MM, self._cell[0] * MM)
        normals = np.stack([-dx, -dy, np.ones_like(z)], axis=-1)
        normals /= np.sqrt(1 + dx**2 + dy**2)[..., None]
        return normals.reshape(-1, 3)

    def _height_at(self, positions: Array) -> Array:
        """Drawn height (P,) in mm of the nearest surface points to `positions` (P, 2) in m."""
        p, q = np.rint(positions / self._cell).astype(int).T
        ny, nx = self._heights.shape
        return self._heights[np.clip(q, 0, ny - 1), np.clip(p, 0, nx - 1)]

    def _place(self, actor: pv.Actor, position: Array) -> None:
        shown = bool(np.isfinite(position).all())
        actor.visibility = shown
        if shown:
            height = float(self._height_at(position[None])[0])
            actor.position = (position[0] * MM, position[1] * MM, height)

    def _point(self, arrow: pv.Actor, pulls: bool) -> None:
        """Down for a push; for a pull up, from the surface."""
        side = self.drag.arrow / ARROW
        arrow.scale = (side, side, -side if pulls else side)
        if pulls:
            x, y, z = arrow.position
            arrow.position = (x, y, z + self.drag.arrow)

    def show_loads(self, loads: Sequence[Load], moving_to: Array | None) -> None:
        """Draw the simulated loads, none for a real sensor; a moving one where it is now."""
        loads = [load for load in loads if load.force]
        moving = moving_to is not None and bool(np.isfinite(moving_to).all())
        centres = [moving_to] if moving and loads else [load.centre() for load in loads]
        self.drag.handles = np.array(centres).reshape(-1, 2)
        for number, arrow in enumerate(self._arrows):
            there = number < len(centres)
            self._place(arrow, self.drag.handles[number] if there else np.full(2, np.nan))
            if there:
                self._point(arrow, pulls=loads[number].force < 0)
        lines = [load for load in loads if isinstance(load, LineLoad)]
        self._line_actor.visibility = bool(lines)
        for load in lines[:1]:
            s = np.linspace(0, 1, 41)[:, None]
            along = (1 - s) * [load.x0, load.y0] + s * [load.x1, load.y1]
            points = np.column_stack([along * MM, self._height_at(along) + self._lift])
            if len(points) != self._line.n_points:
                self._line.points = points
                self._line.lines = [41, *range(41)]
            self._line.points[:] = points

    # How it is shown.

    def show_options(self, exaggeration: float, elements: bool, truth: bool) -> None:
        self._exaggeration, self._want_truth = exaggeration, truth
        self._elements_actor.visibility = elements
        self.plotter.update()

    def show_colours(self, colours: Colours, ink: str) -> None:
        """Colour by a map of 256 colours (256, 3), with points and lines in `ink`."""
        opaque = np.full((len(colours), 1), 255, np.uint8)
        self._colours.values = np.hstack([colours, opaque])
        self._ink = ink
        self._elements_actor.prop.color = ink
        if self._wire_actor:
            self._wire_actor.prop.color = ink

    @property
    def greyed(self) -> bool:
        """Whether the skin is drawn without colours."""
        return self._surface_actor is not None and not self._surface_actor.mapper.scalar_visibility

    def show_lost(self, lost: bool) -> None:
        """Grey the skin while what it shows is not coming in any more."""
        if self._surface_actor is None or lost == self._lost:
            return
        if lost:
            self.show_loads((), None)
        self._lost = lost
        self._surface_actor.mapper.scalar_visibility = not lost
        self._contact.visibility = not lost
        self.plotter.update()

    def show_theme(self, theme: Theme) -> None:
        self._theme = theme
        self.plotter.set_background(theme.scene, top=theme.scene_top)
        for label in self._labels:
            label.prop.color = theme.text
        if self._surface_actor:
            self._surface_actor.prop.color = theme.missing
        self.plotter.update()

    def close_plotter(self) -> None:
        """Before the window goes: give VTK's resources back."""
        self.plotter.close()
