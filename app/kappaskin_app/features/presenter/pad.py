"""The skin seen from above, on which a hand moves what touches it and presses harder."""

from typing import NamedTuple

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt, QTimer, Signal
from PySide6.QtGui import (
    QColor,
    QFocusEvent,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPen,
    QPolygonF,
    QWheelEvent,
)

from kappaskin.skin import Disk, Patch, Polygon
from kappaskin_app.features.presenter.board import Board
from kappaskin_app.features.presenter.cue import Cue
from kappaskin_app.theme import SERIES

_MARGIN = 0.05  # of the pad's shorter side, around the skin
_NOTCH = 1.08  # times as hard, by one notch of the wheel or one key
_PER_PIXEL = 1.01  # times as hard, by one px of Shift and drag
_STEP = 0.01  # of the skin's longer side, by one key
_LET_GO = 400  # ms after the last notch or key that a hand lets go
_HAND = "#e8543f"  # as the load in the view of the skin

_KEYS = {
    Qt.Key.Key_Left: (-1, 0),
    Qt.Key.Key_Right: (1, 0),
    Qt.Key.Key_Up: (0, 1),
    Qt.Key.Key_Down: (0, -1),
}
_HARDER = {
    Qt.Key.Key_PageUp: 1,
    Qt.Key.Key_Plus: 1,
    Qt.Key.Key_PageDown: -1,
    Qt.Key.Key_Minus: -1,
}


class Hand(NamedTuple):
    """Where a hand holds what touches, in m, and how hard in N."""

    x: float
    y: float
    force: float


class Pad(Board):
    """Drag: `dragged` to (x, y) in m; wheel, Shift and drag: `pressed` so many times as hard.

    `grabbed` comes before them, `released` after; Escape emits `given_up`. Arrow keys move, Page
    Up and Page Down press.
    """

    grabbed = Signal(float, float)
    dragged = Signal(float, float)
    pressed = Signal(float)
    released = Signal()
    given_up = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("Pad: drag to move what touches the skin, wheel to press harder")
        self.setToolTip(
            "Drag to move what touches the skin; wheel, or Shift and drag, to press harder. Arrow "
            "keys move, Page Up and Page Down press, Escape puts it back."
        )
        self.setCursor(Qt.CursorShape.CrossCursor)
        self._patch: Patch | None = None
        self.hand: Hand | None = None
        self.cue: Cue | None = None
        self.holding = False
        self._times, self._place = 1.0, QPointF()
        self._from = QPointF()
        self._timer = QTimer(self, interval=_LET_GO, singleShot=True)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(self.let_go)

    # What it shows.

    def show_skin(self, patch: Patch) -> None:
        if patch != self._patch:
            self._patch = patch
            self.update()

    def show_hand(self, hand: Hand | None) -> None:
        """What touches the simulated skin, which the estimate does not know."""
        if hand != self.hand:
            self.hand = hand
            self.update()

    def show_cue(self, cue: Cue | None) -> None:
        self.cue = cue
        self.update()

    @property
    def skin(self) -> QRectF:
        """Where the skin's rectangle is drawn, as large as it fits."""
        if self._patch is None:
            return QRectF(self.rect())
        margin = _MARGIN * min(self.width(), self.height())
        wide, high = self.width() - 2 * margin, self.height() - 2 * margin
        scale = min(wide / self._patch.a, high / self._patch.b)
        place = QRectF(0, 0, scale * self._patch.a, scale * self._patch.b)
        place.moveCenter(self.middle)
        return place

    def seen_at(self, x: float, y: float) -> QPointF:
        """Where (x, y) in m is seen: y goes up."""
        place, patch = self.skin, self._patch
        if patch is None:
            return place.center()
        return QPointF(
            place.left() + x / patch.a * place.width(),
            place.bottom() - y / patch.b * place.height(),
        )

    def placed_at(self, at: QPointF) -> tuple[float, float]:
        """The place (x, y) in m under `at`, or the nearest one of the skin's rectangle."""
        place, patch = self.skin, self._patch
        if patch is None:
            return 0.0, 0.0
        x = (at.x() - place.left()) / place.width() * patch.a
        y = (place.bottom() - at.y()) / place.height() * patch.b
        return min(max(x, 0.0), patch.a), min(max(y, 0.0), patch.b)

    def draw(self, painter: QPainter) -> None:
        theme, place = self.theme, self.skin
        focus = theme.accent if self.hasFocus() else theme.line
        painter.setPen(QPen(QColor(focus), 2 if self.hasFocus() else 1))
        painter.setBrush(QColor(theme.base))
        self._draw_outline(painter, place)
        if self.cue is not None:
            self._draw_cue(painter, self.cue)
        if self.hand is not None:
            at, r = self.seen_at(self.hand.x, self.hand.y), 13 * self.unit + 3
            painter.setPen(QPen(QColor(_HAND), max(2.0, 4 * self.unit)))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawEllipse(at, r, r)
            for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                way = QPointF(dx, dy)
                painter.drawLine(at + way * 0.6 * r, at + way * 1.7 * r)

    def _draw_outline(self, painter: QPainter, place: QRectF) -> None:
        if isinstance(self._patch, Disk):
            painter.drawEllipse(place)
        elif isinstance(self._patch, Polygon):
            corners = [self.seen_at(x, y) for x, y in np.asarray(self._patch.vertices).tolist()]
            painter.drawPolygon(QPolygonF(corners))
        else:
            painter.drawRect(place)

    def _draw_cue(self, painter: QPainter, cue: Cue) -> None:
        """A dot where the contact is estimated to be."""
        dark = QColor(self.theme.window).lightness() < 128
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(SERIES[3][dark]))
        r = 7 * self.unit + 2
        painter.drawEllipse(self.seen_at(*cue.position), r, r)

    # What the hand does.

    def _hold(self) -> bool:
        """Take hold of what touches, unless it is held already; whether there is anything."""
        if not self.holding and self.hand is not None:
            self.holding, self._times = True, 1.0
            self._place = QPointF(self.hand.x, self.hand.y)
            self.grabbed.emit(self.hand.x, self.hand.y)
        return self.holding

    def let_go(self) -> None:
        self._timer.stop()
        if self.holding:
            self.holding = False
            self.released.emit()

    def give_up(self) -> None:
        """Put back what is held, if anything is."""
        self._timer.stop()
        if self.holding:
            self.holding = False
            self.given_up.emit()

    def _press(self, times: float) -> None:
        self._times *= times
        self.pressed.emit(self._times)

    def _move(self, x: float, y: float) -> None:
        self._place = QPointF(x, y)
        self.dragged.emit(x, y)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton and self._hold():
            self._timer.stop()
            self._from = event.position()
            if not event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
                self._move(*self.placed_at(event.position()))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if not self.holding or not event.buttons() & Qt.MouseButton.LeftButton:
            return
        if event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
            self._press(_PER_PIXEL ** (self._from.y() - event.position().y()))
        else:
            self._move(*self.placed_at(event.position()))
        self._from = event.position()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.let_go()

    def wheelEvent(self, event: QWheelEvent) -> None:
        notches = event.angleDelta().y() / 120 or event.angleDelta().x() / 120
        if notches and self._hold():
            self._press(_NOTCH**notches)
            self._soon(event.buttons())
        event.accept()

    def _soon(self, buttons: Qt.MouseButton = Qt.MouseButton.NoButton) -> None:
        """Let go in a moment, unless the mouse holds on."""
        if not buttons & Qt.MouseButton.LeftButton:
            self._timer.start()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = Qt.Key(event.key())
        others = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier
        if key == Qt.Key.Key_Escape and self.holding:
            self.give_up()
        elif key in _KEYS and not event.modifiers() & others and self._hold():
            self._step(*_KEYS[key])
        elif key in _HARDER and not event.modifiers() & others and self._hold():
            self._press(_NOTCH ** _HARDER[key])
            self._soon()
        else:
            super().keyPressEvent(event)

    def _step(self, dx: int, dy: int) -> None:
        """Move by one key."""
        patch = self._patch
        step = _STEP * max(patch.a, patch.b) if patch is not None else 0.0
        there = self.seen_at(self._place.x() + dx * step, self._place.y() + dy * step)
        self._move(*self.placed_at(there))
        self._soon()

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.update()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self.let_go()
        self.update()
