"""Mouse and keys on the skin: pointing, clicks, and loads that are moved and pressed."""

import numpy as np
from PySide6.QtCore import QEvent, QObject, QPointF, Qt, QTimer, Signal, SignalInstance
from PySide6.QtGui import QKeyEvent, QMouseEvent, QWheelEvent
from pyvistaqt import QtInteractor

from kappaskin.frames import Array
from kappaskin_app.features.membrane.camera import Projection
from kappaskin_app.guard import guarded
from kappaskin_app.shell.drawn_skin import MM, NO_SKIN

ARROW = 0.22  # from a load's tip to its tail, as a share of the skin's size
_NEAR = 14.0  # px around an arrow in which the mouse grabs it
_PER_NOTCH = 1.08  # factor of the force per notch of the wheel or key
_PER_PIXEL = 1.01  # factor of the force per px of Shift and drag
_STEP = 0.01  # of the skin's longer side, per key
_RELEASE_DELAY = 400  # ms after the last key

_MOVE_KEYS = {
    Qt.Key.Key_Left: (-1, 0),
    Qt.Key.Key_Right: (1, 0),
    Qt.Key.Key_Up: (0, 1),
    Qt.Key.Key_Down: (0, -1),
}
_FORCE_KEYS = {
    Qt.Key.Key_PageUp: 1,
    Qt.Key.Key_Plus: 1,
    Qt.Key.Key_PageDown: -1,
    Qt.Key.Key_Minus: -1,
}
_MODIFIED = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier
_LEFT, _SHIFT = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ShiftModifier


class LoadDrag(QObject):
    """Moves and presses loads with mouse and keys; positions are (x, y) on the skin in m.

    The left button on the `skin` takes the nearest load there, on an arrow its load. While it is
    held, `dragged` follows the mouse, and the wheel, or Shift and drag, emits `pressed` with the
    factor of the force since `grabbed`. Arrow keys move, Page Up and Page Down press; Escape emits
    `cancelled`. `handles` (k, 2) are the positions of the drawn loads; `lifted` is whether there
    are loads of which none presses now. Without any, or while not `enabled`, the mouse moves the
    camera.
    """

    grabbed = Signal(float, float)
    dragged = Signal(float, float)
    pressed = Signal(float)
    released = Signal()
    cancelled = Signal()

    def __init__(self, plotter: QtInteractor) -> None:
        super().__init__(plotter)
        self._plotter, self._projection = plotter, Projection(plotter)
        self.skin, self.enabled = NO_SKIN, True
        self.handles: Array = np.empty((0, 2))
        self.lifted = False
        self.holding = self._swallowing = self._taken = False
        self._factor, self._height = 1.0, 0.0
        self._at, self._offset, self._held = QPointF(), np.zeros(2), np.zeros(2)
        self._timer = QTimer(self, interval=_RELEASE_DELAY, singleShot=True)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(lambda: self._end(self.released)))
        plotter.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if isinstance(event, QKeyEvent) and kind != QEvent.Type.ShortcutOverride:
            # Else VTK's own keys would switch to stereo or wireframe.
            event.setAccepted(kind == QEvent.Type.KeyPress and self._key(event))
            return True
        if isinstance(event, QWheelEvent) and self._swallowing:
            # Shift makes it a horizontal wheel.
            notches = (event.angleDelta().y() or event.angleDelta().x()) / 120
            self._press(_PER_NOTCH**notches)
            return True
        if isinstance(event, QMouseEvent):
            if kind in (QEvent.Type.MouseButtonPress, QEvent.Type.MouseButtonDblClick):
                return self._swallowing or (event.button() == _LEFT and self._take(event))
            if kind == QEvent.Type.MouseMove:
                return self._move(event)
            if kind == QEvent.Type.MouseButtonRelease and self._swallowing:
                if event.button() == _LEFT:
                    self._swallowing = False
                    self._end(self.released)
                    self.show_cursor(self._held)
                return True
        return False

    # Holding a load.

    def _grab(self, handle: Array) -> None:
        """Hold the load at `handle`, unless one is held."""
        self._timer.stop()
        if not self.holding:
            self.holding, self._factor, self._held = True, 1.0, handle
            self.grabbed.emit(*handle)

    def _move_to(self, place: Array) -> None:
        if self.holding:
            self._held = place
            self.dragged.emit(*place)

    def _press(self, times: float) -> None:
        if self.holding:
            self._factor *= times
            self.pressed.emit(self._factor)

    def _end(self, how: SignalInstance) -> None:
        self._timer.stop()
        if self.holding:
            self.holding = False
            how.emit()

    def give_up(self) -> None:
        """Cancel the drag, if there is one."""
        self._end(self.cancelled)

    # The mouse.

    def _ends(self, handle: Array) -> tuple[Array, Array]:
        """Widget pixels (2,) of the tip and the tail of the arrow at `handle`."""
        points, out = self.skin.place(handle[None])
        tail = points[0] + out[0] * ARROW * self.skin.size
        return self._projection.to_screen(points[0]), self._projection.to_screen(tail)

    def _handle_near(self, at: QPointF) -> Array | None:
        """The handle (2,) in m of an arrow near `at`, if any."""
        for handle in self.handles if self.enabled else ():
            tip, tail = self._ends(handle)
            along = tail - tip
            point = np.array([at.x(), at.y()])
            share = np.clip((point - tip) @ along / max(along @ along, 1.0), 0, 1)
            if np.linalg.norm(point - tip - share * along) < _NEAR:
                return handle
        return None

    @property
    def _presses(self) -> bool:
        """Whether the left button on the skin presses there."""
        return self.enabled and (self.lifted or len(self.handles) > 0)

    def _nearest(self, place: Array) -> Array:
        """The handle (2,) in m nearest to `place`, which is `place` itself without any."""
        if not len(self.handles):
            return place
        return self.handles[np.argmin(np.linalg.norm(self.handles - place, axis=1))]

    def _take(self, event: QMouseEvent) -> bool:
        """Hold the load under the mouse, or move the nearest one there; whether there is one."""
        at = event.position()
        place = handle = self._handle_near(at)
        if place is None and self._presses:
            place = self.skin.hit(*self._projection.line(at))
        if place is None:
            return False
        self._taken = handle is None
        handle = self._nearest(place) if handle is None else handle
        self._swallowing = True
        self._plotter.setFocus(Qt.FocusReason.MouseFocusReason)  # for the keys and Escape
        self._plotter.setCursor(Qt.CursorShape.ClosedHandCursor)
        self._grab(handle)
        if self._taken and not event.modifiers() & _SHIFT:
            self._move_to(place)
        self._height = float(self.skin.height_at(place[None])[0])
        self._at, self._offset = at, self._held - self._under(at)
        return True

    def _move(self, event: QMouseEvent) -> bool:
        before, self._at = self._at, event.position()
        if not self._swallowing:
            return False
        if event.modifiers() & _SHIFT:
            self._press(_PER_PIXEL ** (before.y() - self._at.y()))
            self._offset = self._held - self._under(self._at)
        else:
            self._move_to(self._under(self._at) + self._offset)
        return True

    def _under(self, at: QPointF) -> Array:
        """Position (2,) in m under `at` for the held load.

        An arrow stays under the mouse as the skin under it rises and sinks. A load that was taken
        to the mouse follows it at one height, or it would jump as the skin sinks under it.
        """
        if not self._taken and len(self.handles):
            self._height = float(self.skin.height_at(self._nearest(self._held)[None])[0])
        return self.skin.seen_at(*self._projection.line(at), self._height, self._held)

    def show_cursor(self, over: Array | None) -> None:
        """Show what the left button does at the mouse, `over` a position of the skin or None."""
        if self._swallowing:
            return
        presses = over is not None and self._presses
        shape = Qt.CursorShape.CrossCursor if presses else Qt.CursorShape.ArrowCursor
        on_arrow = self._handle_near(self._at) is not None
        self._plotter.setCursor(Qt.CursorShape.OpenHandCursor if on_arrow else shape)

    # Keys.

    def _key(self, event: QKeyEvent) -> bool:
        """Move or press the held load, or else the first one; whether the key does so."""
        key = Qt.Key(event.key())
        if key == Qt.Key.Key_Escape and self.holding:
            self.give_up()
            return True
        if (
            not (self.enabled and (self.holding or len(self.handles)))
            or event.modifiers() & _MODIFIED
            or key not in _MOVE_KEYS | _FORCE_KEYS
        ):
            return False
        self._grab(self._held if self.holding else self.handles[0])
        if key in _FORCE_KEYS:
            self._press(_PER_NOTCH ** _FORCE_KEYS[key])
        else:
            sides = self.skin.patch.a, self.skin.patch.b
            step = _STEP * self.skin.side / MM * np.array(_MOVE_KEYS[key])
            self._move_to(np.clip(self._held + step, 0.0, sides))
        if not self._swallowing:
            self._timer.start()
        return True


_STILL = 4.0  # px that the mouse may move in a click
_PERIOD = 30  # ms between two positions


class SurfacePointer(QObject):
    """Position of the mouse on the `skin`, (x, y) in m.

    `moved` emits None outside the skin. The left and the right button click.
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
        kind, buttons = event.type(), (_LEFT, Qt.MouseButton.RightButton)
        if kind == QEvent.Type.Leave:
            self._moved_to = None
            self.moved.emit(None)
        if isinstance(event, QMouseEvent):
            at = event.position()
            if kind == QEvent.Type.MouseButtonPress:
                self._pressed_at = at if event.button() in buttons else None
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
