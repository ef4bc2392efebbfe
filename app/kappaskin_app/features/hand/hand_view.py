"""The hand in 3-D: every skin at its place with its contact, and what is held."""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv
from PySide6.QtCore import QPointF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFocusEvent,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QResizeEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QWidget

from kappaskin.frames import Array, Estimate
from kappaskin.hand import HeldObject, ObjectFit, Placement
from kappaskin.skin import Patch
from kappaskin_app.shell.colouring import SteadyRange
from kappaskin_app.shell.drawn_skin import FROM_THE_LEFT, MM, DrawnSkin
from kappaskin_app.theme import CONTACT, current, follow_look
from kappaskin_app.widgets.tint import Tint

_DRAWN: dict[str, Any] = dict.fromkeys(
    ("reset_camera", "render", "pickable", "show_scalar_bar"), False
)
_SKIN: dict[str, Any] = {"ambient": 0.7, "diffuse": 0.5, "specular": 0.0, "smooth_shading": False}
_FINE = 33  # points of a skin along a side, about: more take twice the time
_FADED, _CLEAR = 0.25, 0.22  # opacities of a stale finger, and of what is held
_EVERY, _SHARE = 0.06, 0.2  # s between two pictures, and share of the time that they may take
_SLOWEST = 0.5  # s between two pictures
_LONGEST, _SHORTEST = 0.3, 0.06  # of the hand, arrows of the largest force and of none
_LEAST = 0.05  # N, of the scale of the arrows
_AXIS, _FRAME = 0.2, 0.06  # of the hand, the axes of its frame and those of a contact
_WIDE = 1.3  # of the contacts' distance, how long a cylinder and how wide a plane is drawn
_THIN = 0.01  # of the hand, radius of an edge
_STILL = 4.0  # px that the mouse may move in a click
_PER_PIXEL, _PER_KEY = 0.5, 10.0  # degrees that the camera turns
_PER_NOTCH = 1.1
_FILLED = 0.72  # of the view, by the skins; arrows and names take room around them
_SPAN = np.array([[-0.5, 0, 0], [0.5, 0, 0], [0, -0.5, 0], [0, 0.5, 0]])
_AXES = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 1, 0], [0, 0, 0], [0, 0, 1.0]])
_KEYS = {
    Qt.Key.Key_Left: (_PER_KEY, 0.0),
    Qt.Key.Key_Right: (-_PER_KEY, 0.0),
    Qt.Key.Key_Up: (0.0, -_PER_KEY),
    Qt.Key.Key_Down: (0.0, _PER_KEY),
}
_ZOOMS = {
    Qt.Key.Key_Plus: _PER_NOTCH,
    Qt.Key.Key_Equal: _PER_NOTCH,
    Qt.Key.Key_Minus: 1 / _PER_NOTCH,
}
_ABOUT = (
    "The skins of the hand at their places, coloured by displacement, each with the force of its "
    "contact on the object; what is held is translucent. A click shows a finger in the window; "
    "drag or arrow keys turn, wheel or + and \N{MINUS SIGN} zoom, a double click or Home shows all."
)


@dataclass(frozen=True, eq=False)
class ShownFinger:
    """A finger: where its `patch` is, its newest estimate, its colours in mm, whether it is old."""

    where: Placement
    patch: Patch
    estimate: Estimate
    tint: Tint
    faded: bool


def _matrix(rotation: Array, position: Array, scale: float | Array = 1.0) -> Array:
    """The matrix (4, 4) that scales, turns and moves what is drawn, to `position` (3,) in mm."""
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = rotation * scale, position
    return found


def _lines(points: Array) -> pv.PolyData:
    return pv.PolyData(points, lines=np.insert(np.arange(len(points)).reshape(-1, 2), 0, 2, axis=1))


class _DrawnFinger:
    """A skin at its place, with the arrow and the frame of its contact."""

    def __init__(self, plotter: Any, patch: Patch, shape: tuple[int, ...]) -> None:
        self.shape, self.strides = shape, [max(1, (n - 1) // (_FINE - 1)) for n in shape]
        self.strides = [
            s if (n - 1) % s == 0 else 1 for s, n in zip(self.strides, shape, strict=True)
        ]
        ny, nx = ((n - 1) // s + 1 for s, n in zip(self.strides, shape, strict=True))
        self.skin, self.where = DrawnSkin(patch, nx, ny), np.eye(4)
        self._mesh: Any = pv.PolyData(self.skin.points(), faces=self.skin.faces().ravel())
        self._mesh.point_data["rgb"] = np.zeros((self.skin.on.size, 3), np.uint8)
        self._mesh.point_data.active_normals = self.skin.shading()
        self.actor = plotter.add_mesh(self._mesh, scalars="rgb", rgb=True, **_SKIN, **_DRAWN)
        self.actor.prop.interpolation = "Gouraud"
        arrow = pv.Arrow(direction=(0, 0, 1), shaft_radius=0.035, tip_radius=0.1, tip_length=0.3)
        self.arrow = plotter.add_mesh(arrow, color=CONTACT, ambient=0.5, **_DRAWN)
        self.frame = plotter.add_mesh(
            _lines(_SPAN), color=CONTACT, line_width=2, lighting=False, **_DRAWN
        )
        edges: Any = self._mesh.extract_feature_edges(
            feature_edges=False, non_manifold_edges=False, manifold_edges=False
        )
        edges.clear_data()  # or its colours would be those
        self.rim = plotter.add_mesh(edges, line_width=2, lighting=False, **_DRAWN)
        self.actors = self.actor, self.rim, self.arrow, self.frame
        rest = self.skin.points()[self.skin.on.ravel()]
        self.bounds = rest.min(axis=0), rest.max(axis=0)
        middle, out = self.skin.at_rest(np.array([[patch.a / 2, patch.b / 2]]))
        self.behind: Array = middle[0] - 0.9 * self.skin.size * out[0]
        """Where its name is, below the skin."""

    def show(self, finger: ShownFinger, size: float, longest: float) -> None:
        """Draw it on a hand so large in mm, whose arrows of `longest` N are the longest."""
        estimate, contact = finger.estimate, finger.estimate.contact
        (by_y, by_x), where = self.strides, finger.where
        surface = estimate.surface[::by_y, ::by_x]
        self.skin.show_displacement(surface)
        self._mesh.points[:] = self.skin.points()
        self._mesh.point_data.active_normals[:] = self.skin.shading()
        colours = finger.tint.rgb(MM * np.nan_to_num(surface), current().missing)
        self._mesh.point_data["rgb"][:] = colours.reshape(-1, 3)
        self._mesh.Modified()
        self.where = _matrix(where.rotation, MM * where.position)
        self.actor.user_matrix = self.rim.user_matrix = self.where
        self.rim.prop.color = current().text
        self.actor.prop.opacity = _FADED if finger.faded else 1.0
        there = contact.present and not contact.near_rim and not finger.faded
        self.frame.visibility = there
        self.arrow.visibility = there and math.isfinite(contact.force)
        if there:
            at = MM * (where.rotation @ estimate.geometry.position + where.position)
            turned = where.rotation @ estimate.geometry.frame.T
            self.frame.user_matrix = _matrix(turned, at, 2 * _FRAME * size)
            share = min(abs(contact.force) / longest, 1.0)
            length = size * (_SHORTEST + (_LONGEST - _SHORTEST) * share)
            self.arrow.user_matrix = _matrix(turned, at, length)


class _DrawnObject:
    """What is held, translucent: a sphere, a cylinder, a plane or an edge."""

    def __init__(self, plotter: Any) -> None:
        whole = pv.Cylinder(
            direction=(1, 0, 0), radius=1.0, height=1.0, resolution=48, capping=False
        )
        shapes = {
            "sphere": pv.Sphere(radius=1.0, theta_resolution=36, phi_resolution=24),
            "cylinder": whole,
            "plane": pv.Plane(i_size=1.0, j_size=1.0),
            "edge": whole,
        }
        self.actors = {
            kind: plotter.add_mesh(
                shape,
                color=CONTACT,
                opacity=_CLEAR,
                ambient=0.5,
                smooth_shading=kind != "plane",
                **_DRAWN,
            )
            for kind, shape in shapes.items()
        }
        self.actors["edge"].prop.opacity = 1.0
        self.actors["sphere"].prop.culling = "back"  # or its far side takes as long again

    def show(self, held: HeldObject | None, size: float) -> None:
        """Draw it beside a hand so large in mm; hide it where its kind is not known."""
        kind = held.kind if held is not None else ""
        for name, actor in self.actors.items():
            actor.visibility = name == kind
        if held is not None and kind:
            self.actors[kind].user_matrix = self._placed(held.fits[kind], MM * held.extent, size)

    @staticmethod
    def _placed(fit: ObjectFit, extent: float, size: float) -> Array:
        wide = _WIDE * extent
        if fit.kind == "sphere":
            return _matrix(np.eye(3), MM * fit.centre, MM * abs(fit.radius))
        if fit.kind == "cylinder":
            across = MM * abs(fit.radius)
            return _matrix(fit.frame.T, MM * fit.centre, np.array([wide, across, across]))
        if fit.kind == "edge":
            thin = _THIN * size
            return _matrix(fit.frame.T, MM * fit.point, np.array([wide, thin, thin]))
        return _matrix(fit.frame.T, MM * fit.point, np.array([wide, wide, 1.0]))


class HandView(QWidget):
    """The hand in 3-D, a picture drawn off the screen; `clicked` brings the finger of a click."""

    clicked = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("Hand in 3-D")
        self.setToolTip(_ABOUT)
        self.fingers: dict[str, _DrawnFinger] = {}
        self.plotter: Any = None
        self.due = 0.0
        """When the next picture may be drawn, on the monotonic clock."""
        self._image = QImage()
        self._names: dict[str, tuple[QPointF, bool]] = {}
        self._chosen, self._size, self._turned = "", 1.0, False
        self._arrows = SteadyRange(_LEAST)
        self._pressed = self._at = QPointF()
        follow_look(self, self._apply_theme)

    def sizeHint(self) -> QSize:
        return QSize(360, 240)

    def minimumSizeHint(self) -> QSize:
        return QSize(240, 150)

    # What is drawn.

    def mark(self, finger: str) -> None:
        """Mark the finger that the window shows."""
        self._chosen = finger
        self.update()

    def show_hand(self, fingers: Mapping[str, ShownFinger], held: HeldObject | None) -> None:
        """Draw the `fingers` and what is held, if it is time."""
        now = time.monotonic()
        if not fingers or now < self.due or self.width() < 2 or self.height() < 2:
            return
        if self.plotter is None:
            self._begin()
        self._follow(fingers)
        forces = [abs(each.estimate.contact.force) for each in fingers.values() if not each.faded]
        longest = self._arrows.follow(max(filter(math.isfinite, forces), default=0.0), now)
        for name, each in fingers.items():
            self.fingers[name].show(each, self._size, longest)
        self.held.show(held, self._size)
        self._draw()
        took = time.monotonic() - now
        self.due = now + took + min(max(_EVERY, took / _SHARE), _SLOWEST)

    def _begin(self) -> None:
        plotter: Any = pv.Plotter(off_screen=True, window_size=[64, 64])
        self.plotter = plotter
        plotter.render_window.SetMultiSamples(0)
        plotter.renderer.SetUseOIT(False)
        plotter.remove_all_lights()
        plotter.add_light(pv.Light(light_type="headlight", intensity=0.9))
        self._resize()
        self.held = _DrawnObject(plotter)
        self._axes = plotter.add_mesh(_lines(_AXES), line_width=2, lighting=False, **_DRAWN)
        self._apply_theme()
        plotter.show(auto_close=False, interactive=False)

    def _follow(self, fingers: Mapping[str, ShownFinger]) -> None:
        """Draw other skins, and the whole hand then."""
        changed = False
        for name, each in fingers.items():
            drawn, shape = self.fingers.get(name), each.estimate.surface.shape
            if drawn is None or drawn.shape != shape or drawn.skin.patch != each.patch:
                for actor in () if drawn is None else drawn.actors:
                    self.plotter.remove_actor(actor, render=False)
                drawn = self.fingers[name] = _DrawnFinger(self.plotter, each.patch, shape)
                changed = True
            drawn.where = _matrix(each.where.rotation, MM * each.where.position)
        if changed:
            self.fit()

    def fit(self) -> None:
        """Show the whole hand, from the front and a little from the left."""
        if not self.fingers:
            return
        corners = np.concatenate(
            [
                np.stack(np.meshgrid(*np.transpose(each.bounds)), -1).reshape(-1, 3)
                @ each.where[:3, :3].T
                + each.where[:3, 3]
                for each in self.fingers.values()
            ]
        )
        low, high = corners.min(axis=0), corners.max(axis=0)
        self._size = float(np.linalg.norm(high - low)) / math.sqrt(3)
        renderer = self.plotter.renderer
        camera, middle = renderer.GetActiveCamera(), (low + high) / 2
        camera.SetFocalPoint(*middle)
        camera.SetPosition(*(middle + np.array(FROM_THE_LEFT.towards)))
        camera.SetViewUp(*FROM_THE_LEFT.up)
        camera.SetViewAngle(30.0)
        renderer.ResetCamera(*np.column_stack([low, high]).ravel())
        seen = [self.in_view(corner) for corner in corners]
        camera.Zoom(_FILLED / float(np.abs(seen).max()))
        self._turned = False
        self._axes.user_matrix = _matrix(np.eye(3), np.zeros(3), _AXIS * self._size)
        self._redraw()

    def in_view(self, point: Array) -> tuple[float, float]:
        """Where a point in mm is in the view, from -1 to 1."""
        renderer = self.plotter.renderer
        renderer.SetWorldPoint(*point, 1.0)
        renderer.WorldToView()
        return renderer.GetViewPoint()[:2]

    def resizeEvent(self, event: QResizeEvent) -> None:
        if self.fingers:
            self.due = 0.0
            self._resize()
            if not self._turned:
                self.fit()

    def _resize(self) -> None:
        ratio = self.devicePixelRatioF()
        size = [max(round(side * ratio), 2) for side in (self.width(), self.height())]
        if self.plotter.window_size != size:
            self.plotter.window_size = size

    def _draw(self) -> None:
        plotter = self.plotter
        plotter.renderer.ResetCameraClippingRange()
        plotter.render()
        rgb = np.ascontiguousarray(plotter.image)
        high, wide, _ = rgb.shape
        self._image = QImage(rgb.tobytes(), wide, high, 3 * wide, QImage.Format.Format_RGB888)
        tips = zip("xyz", _AXIS * self._size * np.eye(3), strict=True)
        places = {name: (1.1 * tip, True) for name, tip in tips}
        places |= {
            name: ((each.where @ [*each.behind, 1.0])[:3], False)
            for name, each in self.fingers.items()
        }
        self._names = {name: (self.place_of(at), axis) for name, (at, axis) in places.items()}
        self.update()

    def _redraw(self) -> None:
        """Draw at the next opportunity: the camera has moved."""
        self.due = 0.0
        if not self._image.isNull():
            self._draw()

    def place_of(self, point: Array) -> QPointF:
        """Where a point in mm is in the widget."""
        x, y = self.in_view(point)
        return QPointF((1 + x) / 2 * self.width(), (1 - y) / 2 * self.height())

    def paintEvent(self, event: QPaintEvent) -> None:
        with QPainter(self) as painter:
            painter.fillRect(self.rect(), QColor(current().scene))
            if self._image.isNull():
                return
            painter.drawImage(self.rect(), self._image)
            for name, (at, axis) in self._names.items():
                font = painter.font()
                font.setBold(name == self._chosen and not axis)
                painter.setFont(font)
                painter.setPen(QColor(current().faint if axis else current().text))
                wide = painter.fontMetrics().horizontalAdvance(name)
                painter.drawText(at - QPointF(wide / 2, -painter.fontMetrics().ascent() / 2), name)
            if self.hasFocus():
                painter.setPen(QPen(QColor(current().accent), 1))
                painter.drawRect(self.rect().adjusted(0, 0, -1, -1))

    def _apply_theme(self) -> None:
        if self.plotter is not None:
            self.plotter.set_background(current().scene, top=current().scene_top)
            self._axes.prop.color = current().faint
            self._redraw()

    def close_plotter(self) -> None:
        """Free VTK's resources before the window closes."""
        if self.plotter is not None:
            self.plotter.close()
        self.plotter, self._image, self.due = None, QImage(), math.inf
        self.fingers = {}

    # Mouse and keys.

    def _turn(self, azimuth: float, elevation: float) -> None:
        """Turn the camera by degrees."""
        self._turned = True
        camera = self.plotter.renderer.GetActiveCamera()
        camera.Azimuth(azimuth)
        camera.Elevation(elevation)
        camera.OrthogonalizeViewUp()
        self._redraw()

    def _zoom(self, times: float) -> None:
        self._turned = True
        self.plotter.renderer.GetActiveCamera().Dolly(times)
        self._redraw()

    def finger_at(self, at: QPointF) -> str:
        """The finger whose skin is nearest under a place in the widget; empty where none is."""
        renderer, ratio, ends = self.plotter.renderer, self.devicePixelRatioF(), []
        for depth in (0.0, 1.0):
            renderer.SetDisplayPoint(at.x() * ratio, (self.height() - at.y()) * ratio, depth)
            renderer.DisplayToWorld()
            *point, w = renderer.GetWorldPoint()
            ends.append(np.array([*(np.array(point) / w), 1.0]))
        found = dict[str, float]()
        for name, each in self.fingers.items():
            near, far = ((np.linalg.inv(each.where) @ end)[:3] for end in ends)
            if (place := each.skin.hit(near, far)) is not None:
                found[name] = float(np.linalg.norm(each.skin.place(place[None])[0][0] - near))
        return min(found, key=lambda name: found[name], default="")

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._pressed = self._at = event.position()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        moved, self._at = event.position() - self._at, event.position()
        if self.fingers:
            self._turn(-_PER_PIXEL * moved.x(), _PER_PIXEL * moved.y())

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        still = (event.position() - self._pressed).manhattanLength() < _STILL
        if still and self.fingers and (finger := self.finger_at(event.position())):
            self.clicked.emit(finger)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        self.fit()

    def wheelEvent(self, event: QWheelEvent) -> None:
        if self.fingers:
            self._zoom(_PER_NOTCH ** (event.angleDelta().y() / 120))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = Qt.Key(event.key())
        if not self.fingers or key not in {*_KEYS, *_ZOOMS, Qt.Key.Key_Home}:
            super().keyPressEvent(event)
        elif key in _KEYS:
            self._turn(*_KEYS[key])
        elif key in _ZOOMS:
            self._zoom(_ZOOMS[key])
        else:
            self.fit()

    def focusInEvent(self, event: QFocusEvent) -> None:
        self.update()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        self.update()
