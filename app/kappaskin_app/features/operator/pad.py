"""Pad: a hand moved with mouse and keys."""

import math
from dataclasses import replace

from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFocusEvent,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QWheelEvent,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from kappaskin.hand import HandTarget, OperatorLimits
from kappaskin_app.theme import current, grown

_KEYS = Qt.Key
_MOVES = {
    **dict.fromkeys((_KEYS.Key_Left, _KEYS.Key_A), (-1, 0, 0)),
    **dict.fromkeys((_KEYS.Key_Right, _KEYS.Key_D), (1, 0, 0)),
    **dict.fromkeys((_KEYS.Key_Down, _KEYS.Key_S), (0, -1, 0)),
    **dict.fromkeys((_KEYS.Key_Up, _KEYS.Key_W), (0, 1, 0)),
    **dict.fromkeys((_KEYS.Key_PageDown, _KEYS.Key_Q), (0, 0, -1)),
    **dict.fromkeys((_KEYS.Key_PageUp, _KEYS.Key_E), (0, 0, 1)),
}
_GRIPS = {_KEYS.Key_Minus: -1, _KEYS.Key_Plus: 1, _KEYS.Key_Equal: 1}
_CLOSES = 1.0  # s from no grip to the largest
_PER_NOTCH = 1e-3, 0.05  # m and rad, of the wheel
_PER_PIXEL = 5e-3  # rad, of Shift and drag
_NOTCH = 120  # of the wheel's angle
_SIDE, _DOT = 170, 6  # px
_NONE = (0.0, 0.0, 0.0)
_COMMANDS = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier
_SHIFT, _LEFT = Qt.KeyboardModifier.ShiftModifier, Qt.MouseButton.LeftButton
_TIP = (
    "Drag to move the hand along x and y, turn the wheel for z; with Shift it rolls that way. "
    "Arrow keys or W A S D, Page Up and Page Down or E and Q do the same while held, + and "
    "\N{MINUS SIGN} close and open. Esc switches off."
)


class Pad(QWidget):
    """The workspace from above with the hand in it, which mouse and keys move.

    The line from the hand is its yaw, the mark at the right edge its height.

    The hand stops when the button or the key is released, and when the pad loses the focus. Escape
    emits `stopped`.
    """

    stopped = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("pad")
        self.setAccessibleName("Pad that moves the hand")
        self.setToolTip(_TIP)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self._limits, self._target, self._moving = OperatorLimits(), HandTarget(), False
        self._held = set[int]()
        self._pressed: tuple[QPointF, HandTarget] | None = None
        self._at, self._turns = QPointF(), False
        self._rolled: HandTarget | None = None

    def wanted(
        self, target: HandTarget, limits: OperatorLimits, seconds: float
    ) -> HandTarget | None:
        """Where mouse and keys want the hand after `seconds`, from `target`; None for nowhere."""
        if self._pressed is not None:
            start, at = self._pressed
            return replace(self._dragged(at, self._at - start), grip=target.grip)
        if self._held:
            return self._keyed(target, limits, seconds)
        if self._rolled is not None:
            at = replace(limits.nearest(self._rolled), grip=target.grip)
            if (at.position, at.rotation) != (target.position, target.rotation):
                return at
            self._rolled = None
        return None

    def _dragged(self, at: HandTarget, way: QPointF) -> HandTarget:
        if self._turns:
            return at.moved(_NONE, (_PER_PIXEL * way.y(), _PER_PIXEL * way.x(), 0.0), 0.0)
        scale = 1.0 / self._scale()
        return at.moved((scale * way.x(), -scale * way.y(), 0.0), _NONE, 0.0)

    def _keyed(self, target: HandTarget, limits: OperatorLimits, seconds: float) -> HandTarget:
        ways = [way for key, way in _MOVES.items() if key in self._held]
        x, y, z = (float(sum(way[axis] for way in ways)) for axis in range(3))
        grip = sum(way for key, way in _GRIPS.items() if key in self._held)
        shift = turn = _NONE
        if self._turns:
            step = limits.turn_rate * seconds
            turn = -step * y, step * x, step * z
        else:
            step = limits.speed * seconds
            shift = step * x, step * y, step * z
        return target.moved(shift, turn, limits.grip * grip * seconds / _CLOSES)

    def release(self) -> None:
        """Let go of all keys and of the mouse."""
        self._held.clear()
        self._pressed = self._rolled = None

    def show_target(self, target: HandTarget, limits: OperatorLimits, moving: bool) -> None:
        """Show where the hand is in its workspace, and whether it moves."""
        self._target, self._limits, self._moving = target, limits, moving
        self.update()

    # Events

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = event.key()
        if key == _KEYS.Key_Escape:
            self.release()
            self.stopped.emit()
        elif key == _KEYS.Key_Shift:
            self._turns = True
        elif key not in (*_MOVES, *_GRIPS) or event.modifiers() & _COMMANDS:
            super().keyPressEvent(event)
        elif not event.isAutoRepeat():
            self._turns = bool(event.modifiers() & _SHIFT)
            self._held.add(key)

    def keyReleaseEvent(self, event: QKeyEvent) -> None:
        if event.key() == _KEYS.Key_Shift:
            self._turns = False
        elif event.isAutoRepeat():
            pass
        elif event.key() in _GRIPS:  # with Shift, + is another key when it is released than before
            self._held -= _GRIPS.keys()
        else:
            self._held.discard(event.key())

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == _LEFT:
            self._turns = bool(event.modifiers() & _SHIFT)
            self._at = event.position()
            self._pressed = self._at, self._target

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        self._at = event.position()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == _LEFT:
            self._pressed = None

    def wheelEvent(self, event: QWheelEvent) -> None:
        notches = (event.angleDelta().y() or event.angleDelta().x()) / _NOTCH
        step, turn = (notches * each for each in _PER_NOTCH)
        turns = bool(event.modifiers() & _SHIFT)
        by = (_NONE, (0.0, 0.0, turn)) if turns else ((0.0, 0.0, step), _NONE)
        if self._pressed is not None:
            start, at = self._pressed
            self._pressed = start, at.moved(*by, 0.0)
        else:
            before = self._rolled or self._target
            self._rolled = self._limits.nearest(before.moved(*by, 0.0))
        event.accept()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        self.release()
        super().focusOutEvent(event)
        self.update()

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.update()

    def hideEvent(self, event: QEvent) -> None:
        self.release()

    # Painting

    def sizeHint(self) -> QSize:
        return QSize(grown(_SIDE), grown(_SIDE))

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def _scale(self) -> float:
        """How many px a metre has."""
        x, y, _ = self._limits.reach
        return min((self.width() - 4 * _DOT) / (2 * x), (self.height() - 2) / (2 * y))

    def paintEvent(self, event: QPaintEvent) -> None:
        theme, scale = current(), self._scale()
        x, y, _ = self._limits.reach
        middle = QPointF(self.width() / 2, self.height() / 2)
        inside = QRectF(0, 0, 2 * x * scale, 2 * y * scale)
        inside.moveCenter(middle)
        yaw, height = self._target.rotation[2], self._target.position[2] / self._limits.reach[2]
        level = middle + QPointF(x * scale, -y * scale * height)
        at = middle + QPointF(self._target.position[0], -self._target.position[1]) * scale
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            edge = theme.accent if self.hasFocus() else theme.line
            painter.setPen(QPen(QColor(edge), 2 if self.hasFocus() else 1))
            painter.setBrush(QColor(theme.base))
            painter.drawRect(inside)
            painter.setPen(QColor(theme.line))
            painter.drawLine(
                QPointF(inside.left(), middle.y()), QPointF(inside.right(), middle.y())
            )
            painter.drawLine(
                QPointF(middle.x(), inside.top()), QPointF(middle.x(), inside.bottom())
            )
            painter.setPen(QPen(QColor(theme.text), 2))
            painter.setBrush(QColor(theme.accent if self._moving else theme.off))
            painter.drawLine(at, at + QPointF(math.cos(yaw), -math.sin(yaw)) * 3 * _DOT)
            painter.drawEllipse(at, _DOT, _DOT)
            painter.drawPolygon([level, *(level + QPointF(2 * _DOT, d * _DOT) for d in (-1, 1))])
