"""Mouse on the skin: pointing, clicks and drags of loads."""

import numpy as np
from PySide6.QtCore import QEvent, QObject, QPointF, Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent
from pyvistaqt import QtInteractor

from kappaskin.frames import Array
from kappaskin_app.features.membrane.camera import Projection
from kappaskin_app.guard import guarded
from kappaskin_app.shell.drawn_skin import NO_SKIN

ARROW = 0.22  # from a load's tip to its tail, as a share of the skin's size
_NEAR = 14.0  # px around an arrow in which the mouse grabs it


class LoadDrag(QObject):
    """Drags of loads with the mouse; positions are (x, y) on the skin in m.

    `handles` (k, 2) are the positions of the drawn loads on the `skin`. Escape cancels a drag.
    """

    grabbed = Signal(float, float)
    dragged = Signal(float, float)
    released = Signal()
    cancelled = Signal()

    def __init__(self, plotter: QtInteractor) -> None:
        super().__init__(plotter)
        self._plotter, self._projection = plotter, Projection(plotter)
        self.skin = NO_SKIN
        self.handles: Array = np.empty((0, 2))
        self._pressed = self._dragging = False
        self._offset, self._held = np.zeros(2), np.zeros(2)
        plotter.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind, left = event.type(), Qt.MouseButton.LeftButton
        if kind in (QEvent.Type.KeyPress, QEvent.Type.KeyRelease):
            escapes = isinstance(event, QKeyEvent) and event.key() == Qt.Key.Key_Escape
            # Else VTK's own keys would switch to stereo or wireframe.
            event.setAccepted(escapes and self._dragging)
            if escapes:
                self._give_up()
            return True
        if isinstance(event, QMouseEvent):
            presses = (QEvent.Type.MouseButtonPress, QEvent.Type.MouseButtonDblClick)
            if kind in presses and event.button() == left:
                return self._grab(event.position())
            if kind == QEvent.Type.MouseMove:
                return self._move(event.position())
            if kind == QEvent.Type.MouseButtonRelease and self._pressed:
                self._release()
                return True
        return False

    def _ends(self, handle: Array) -> tuple[Array, Array]:
        """Widget pixels (2,) of the tip and the tail of the arrow at `handle`."""
        points, out = self.skin.place(handle[None])
        tail = points[0] + out[0] * ARROW * self.skin.size
        return self._projection.to_screen(points[0]), self._projection.to_screen(tail)

    def _handle_near(self, at: QPointF) -> Array | None:
        """The handle (2,) in m of an arrow near `at`, if any."""
        for handle in self.handles:
            tip, tail = self._ends(handle)
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
        self._pressed = self._dragging = True
        self._plotter.setFocus(Qt.FocusReason.MouseFocusReason)  # for Escape
        self._held = handle
        self._offset = handle - self._position_at(at, handle)
        self.grabbed.emit(*handle)
        return True

    def _release(self) -> None:
        self._pressed = False
        if self._dragging:
            self._dragging = False
            self.released.emit()

    def _give_up(self) -> None:
        if self._dragging:
            self._dragging = False
            self.cancelled.emit()

    def _move(self, at: QPointF) -> bool:
        if not self._pressed:
            over = self._handle_near(at) is not None
            shape = Qt.CursorShape.OpenHandCursor if over else Qt.CursorShape.ArrowCursor
            self._plotter.setCursor(shape)
            return False
        self._plotter.setCursor(Qt.CursorShape.ClosedHandCursor)
        if self._dragging:
            held = self._held
            if len(self.handles):  # at the height of the load, which changes as it moves
                held = self.handles[np.argmin(np.linalg.norm(self.handles - held, axis=1))]
            self._held = self._position_at(at, held) + self._offset
            self.dragged.emit(*self._held)
        return True

    def _position_at(self, at: QPointF, handle: Array) -> Array:
        """Position (2,) in m under `at` on the skin at the drawn height of `handle`."""
        near, far = self._projection.line(at)
        return self.skin.seen_at(near, far, float(self.skin.height_at(handle[None])[0]), handle)

    def on_screen(self) -> QPointF | None:
        """Pixel of the tip of the first load's arrow, None without a load."""
        if not len(self.handles):
            return None
        return QPointF(*self._ends(self.handles[0])[0])


_STILL = 4.0  # px that the mouse may move in a click
_PERIOD = 30  # ms between two positions


class SurfacePointer(QObject):
    """Position of the mouse on the `skin`, (x, y) in m.

    `moved` emits None outside the skin.
    """

    clicked = Signal(float, float)
    moved = Signal(object)

    def __init__(self, plotter: QtInteractor) -> None:
        super().__init__(plotter)
        self.skin, self._projection = NO_SKIN, Projection(plotter)
        self._pressed_at: QPointF | None = None
        self._moved_to: QPointF | None = None
        self._timer = QTimer(self, interval=_PERIOD, singleShot=True)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(self._report))
        plotter.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind, left = event.type(), Qt.MouseButton.LeftButton
        if kind == QEvent.Type.Leave:
            self._moved_to = None
            self.moved.emit(None)
        if isinstance(event, QMouseEvent):
            at = event.position()
            if kind == QEvent.Type.MouseButtonPress:
                self._pressed_at = at if event.button() == left else None
            elif kind == QEvent.Type.MouseButtonRelease:
                self._release(at)
            elif kind == QEvent.Type.MouseMove and not event.buttons():
                self._moved_to = at
                if not self._timer.isActive():
                    self._report()
        return False

    def _release(self, at: QPointF) -> None:
        pressed, self._pressed_at = self._pressed_at, None
        if pressed is None or (at - pressed).manhattanLength() > _STILL:
            return
        place = self.skin.hit(*self._projection.line(at))
        if place is not None:
            self.clicked.emit(*place.tolist())

    def _report(self) -> None:
        """Emit the last position of the mouse, at most once per period."""
        at, self._moved_to = self._moved_to, None
        if at is not None:
            self._timer.start()
            self.moved.emit(self.skin.hit(*self._projection.line(at)))
