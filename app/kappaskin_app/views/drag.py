"""Loads on the skin that the mouse can take hold of; everywhere else it turns the camera."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QObject, QPointF, Qt, Signal
from PySide6.QtGui import QMouseEvent
from pyvistaqt import QtInteractor

Array = NDArray[np.float64]

MM = 1e3
ARROW = 0.22  # from a load's tip to its tail, as a share of the skin's longer side
_NEAR = 14.0  # pixels around an arrow within which the mouse takes hold of it


class LoadDrag(QObject):
    """Watches the mouse over a plotter; positions are (x, y) on the skin in m.

    `handles` (k, 2) are where loads are drawn; `height_at` gives the drawn height (k,) in mm of
    positions (k, 2) in m.
    """

    grabbed = Signal(float, float)
    dragged = Signal(float, float)
    released = Signal()

    def __init__(self, plotter: QtInteractor, height_at: Callable[[Array], Array]) -> None:
        super().__init__(plotter)
        self._plotter, self._height_at = plotter, height_at
        self.handles: Array = np.empty((0, 2))
        self.arrow = MM * 0.1 * ARROW
        """Drawn length of an arrow in mm."""
        self._dragging = False
        self._plane, self._slip, self._held = 0.0, np.zeros(2), np.zeros(2)
        plotter.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind, left = event.type(), Qt.MouseButton.LeftButton
        if kind in (QEvent.Type.KeyPress, QEvent.Type.KeyRelease):
            event.ignore()  # for the window: VTK's own keys turn on stereo or wireframe for good
            return True
        if isinstance(event, QMouseEvent):
            presses = (QEvent.Type.MouseButtonPress, QEvent.Type.MouseButtonDblClick)
            if kind in presses and event.button() == left:
                return self._grab(event.position())
            if kind == QEvent.Type.MouseMove:
                return self._move(event.position())
            if kind == QEvent.Type.MouseButtonRelease and self._dragging:
                self._dragging = False
                self.released.emit()
                return True
        return False

    def _height(self, position: Array) -> float:
        return float(self._height_at(position[None])[0])

    def _handle_near(self, at: QPointF) -> Array | None:
        """The handle (2,) in m whose arrow is drawn near `at`."""
        for handle in self.handles:
            height = self._height(handle)
            tip, tail = (self._to_screen(handle, height + up) for up in (0.0, self.arrow))
            along = tail - tip
            point = np.array([at.x(), at.y()])
            share = np.clip((point - tip) @ along / max(along @ along, 1.0), 0, 1)
            if np.linalg.norm(point - tip - share * along) < _NEAR:
                return handle
        return None

    def _grab(self, at: QPointF) -> bool:
        handle = self._handle_near(at)
        if handle is None:
            return False
        self._dragging = True
        self._plane = self._height(handle)
        self._slip, self._held = handle - self._to_skin(at), handle
        self.grabbed.emit(*handle)
        return True

    def _move(self, at: QPointF) -> bool:
        if not self._dragging:
            over = self._handle_near(at) is not None
            shape = Qt.CursorShape.OpenHandCursor if over else Qt.CursorShape.ArrowCursor
            self._plotter.setCursor(shape)
            return False
        self._plotter.setCursor(Qt.CursorShape.ClosedHandCursor)
        if len(self.handles):  # the skin sinks as the load moves on it: stay at its height
            distance = np.linalg.norm(self.handles - self._held, axis=1)
            self._plane = self._height(self.handles[np.argmin(distance)])
        self._held = self._to_skin(at) + self._slip
        self.dragged.emit(*self._held)
        return True

    def _to_screen(self, position: Array, height: float) -> Array:
        """Widget pixels (2,) of a point at `position` in m and drawn `height` in mm."""
        renderer, ratio = self._plotter.renderer, self._plotter.devicePixelRatioF()
        renderer.SetWorldPoint(position[0] * MM, position[1] * MM, height, 1.0)
        renderer.WorldToDisplay()
        x, y, _ = renderer.GetDisplayPoint()
        return np.array([x / ratio, self._plotter.height() - y / ratio])

    def _to_skin(self, at: QPointF) -> Array:
        """Where the line of sight through `at` meets the plane of the load, (2,) in m."""
        renderer, ratio = self._plotter.renderer, self._plotter.devicePixelRatioF()
        ends = []
        for depth in (0.0, 1.0):
            y_up = self._plotter.height() - at.y()
            renderer.SetDisplayPoint(at.x() * ratio, y_up * ratio, depth)
            renderer.DisplayToWorld()
            x, y, z, w = renderer.GetWorldPoint()
            ends.append(np.array([x, y, z]) / w)
        near, far = ends
        fall = far[2] - near[2]
        share = (self._plane - near[2]) / fall if abs(fall) > 1e-9 else 0.0
        return (near + share * (far - near))[:2] / MM

    def on_screen(self) -> QPointF | None:
        """Where in the plotter the first load's arrow ends, None without a load."""
        if not len(self.handles):
            return None
        return QPointF(*self._to_screen(self.handles[0], self._height(self.handles[0])))
