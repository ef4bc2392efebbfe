"""Pad: the skin from above, where the user moves a simulated object and presses it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

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
from PySide6.QtWidgets import (
    QButtonGroup,
    QGridLayout,
    QHBoxLayout,
    QPushButton,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from kappaskin.scenes import Indenter, Scene
from kappaskin.skin import Disk, Patch, Polygon
from kappaskin_app.features.presenter.feedback import Feedback
from kappaskin_app.features.presenter.indicators import Indicator
from kappaskin_app.guard import guarded
from kappaskin_app.theme import current, follow_look, series
from kappaskin_app.widgets.lettering import CAPTION, Words, letters, shrunk


@dataclass(frozen=True)
class DemoObject:
    """An object of the demonstration: title and tooltip of its button, and its scene settings."""

    title: str
    tip: str
    settings: Mapping[str, Any]

    def is_in(self, scene: Scene) -> bool:
        """Whether it is the object in `scene`."""
        what = scene.stimuli[0].what
        rigid = what.rigid if isinstance(what, Indenter) else what
        named = type(rigid).__name__.removesuffix("Load").lower()
        sizes = {name: value for name, value in self.settings.items() if name != "what"}
        return named == self.settings["what"] and all(
            getattr(rigid, name, None) == value for name, value in sizes.items()
        )


DEMO_OBJECTS = (
    DemoObject("Ball 40 mm", "A ball of 40 mm radius.", {"what": "sphere", "radius": 0.04}),
    DemoObject("Ball 60 mm", "A ball of 60 mm radius.", {"what": "sphere", "radius": 0.06}),
    DemoObject("Ball 80 mm", "A ball of 80 mm radius.", {"what": "sphere", "radius": 0.08}),
    DemoObject(
        "Pipe 150 mm",
        "A pipe of 150 mm radius and 50 mm length that lies along x.",
        {"what": "cylinder", "radius": 0.15, "length": 0.05},
    ),
    DemoObject(
        "Edge",
        "The edge of a box, 40 mm long, along x.",
        {"what": "wedge", "angle": math.pi / 2, "length": 0.04, "width": 0.02},
    ),
    DemoObject("Point", "A point, without a radius.", {"what": "point"}),
)


_MARGIN = 0.05  # of the pad's shorter side, around the skin
_PER_NOTCH = 1.08  # factor of the force per notch of the wheel or key
_PER_PIXEL = 1.01  # factor of the force per px of Shift and drag
_STEP = 0.01  # of the skin's longer side, per key
_RELEASE_DELAY = 400  # ms after the last notch or key
_HAND_COLOUR = "#e8543f"  # as the load in the view of the skin

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


class Hand(NamedTuple):
    """Position in m and force in N of the simulated object."""

    x: float
    y: float
    force: float


class Pad(Indicator):
    """Pad to move and press the object.

    Dragging emits `dragged` to (x, y) in m; the wheel, or Shift and drag, `pressed` with the factor
    of the force. `grabbed` comes before them, `released` after; Escape emits `cancelled`. Arrow
    keys move, Page Up and Page Down press.
    """

    grabbed = Signal(float, float)
    dragged = Signal(float, float)
    pressed = Signal(float)
    released = Signal()
    cancelled = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("Pad: drag to move the object, wheel to press harder")
        self.setToolTip(
            "Drag to move the object; wheel, or Shift and drag, to press harder. Arrow keys move, "
            "Page Up and Page Down press, Esc cancels."
        )
        self.setCursor(Qt.CursorShape.CrossCursor)
        self._patch: Patch | None = None
        self.hand: Hand | None = None
        self.feedback: Feedback | None = None
        self.holding = False
        self._factor, self._place = 1.0, QPointF()
        self._from = QPointF()
        self._timer = QTimer(self, interval=_RELEASE_DELAY, singleShot=True)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(self.release)

    # Display.

    def show_skin(self, patch: Patch) -> None:
        if patch != self._patch:
            self._patch = patch
            self.update()

    def show_hand(self, hand: Hand | None) -> None:
        """Show the true position of the simulated object."""
        if hand != self.hand:
            self.hand = hand
            self.update()

    def show_feedback(self, feedback: Feedback | None) -> None:
        self.feedback = feedback
        self.update()

    @property
    def skin(self) -> QRectF:
        """Place of the skin, as large as fits."""
        if self._patch is None:
            return QRectF(self.rect())
        margin = _MARGIN * min(self.width(), self.height())
        wide, high = self.width() - 2 * margin, self.height() - 2 * margin
        scale = min(wide / self._patch.a, high / self._patch.b)
        place = QRectF(0, 0, scale * self._patch.a, scale * self._patch.b)
        place.moveCenter(self.middle)
        return place

    def to_pixel(self, x: float, y: float) -> QPointF:
        """Pixel of (x, y) in m; y points up."""
        place, patch = self.skin, self._patch
        if patch is None:
            return place.center()
        return QPointF(
            place.left() + x / patch.a * place.width(),
            place.bottom() - y / patch.b * place.height(),
        )

    def to_skin(self, at: QPointF) -> tuple[float, float]:
        """Position (x, y) in m of the pixel `at`, limited to the skin's rectangle."""
        place, patch = self.skin, self._patch
        if patch is None:
            return 0.0, 0.0
        x = (at.x() - place.left()) / place.width() * patch.a
        y = (place.bottom() - at.y()) / place.height() * patch.b
        return min(max(x, 0.0), patch.a), min(max(y, 0.0), patch.b)

    def draw(self, painter: QPainter) -> None:
        theme, place = current(), self.skin
        focus = theme.accent if self.hasFocus() else theme.line
        painter.setPen(QPen(QColor(focus), 2 if self.hasFocus() else 1))
        painter.setBrush(QColor(theme.base))
        self._draw_outline(painter, place)
        if self.feedback is not None:
            self._draw_feedback(painter, self.feedback)
        if self.hand is not None:
            at, r = self.to_pixel(self.hand.x, self.hand.y), 13 * self.unit + 3
            painter.setPen(QPen(QColor(_HAND_COLOUR), max(2.0, 4 * self.unit)))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawEllipse(at, r, r)
            for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                way = QPointF(dx, dy)
                painter.drawLine(at + way * 0.6 * r, at + way * 1.7 * r)

    def _draw_outline(self, painter: QPainter, place: QRectF) -> None:
        if isinstance(self._patch, Disk):
            painter.drawEllipse(place)
        elif isinstance(self._patch, Polygon):
            corners = [self.to_pixel(x, y) for x, y in np.asarray(self._patch.vertices).tolist()]
            painter.drawPolygon(QPolygonF(corners))
        else:
            painter.drawRect(place)

    def _draw_feedback(self, painter: QPainter, feedback: Feedback) -> None:
        """Draw a dot at the estimated contact."""
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(current().faint) if feedback.near_rim else series(3))
        r = 7 * self.unit + 2
        painter.drawEllipse(self.to_pixel(*feedback.position), r, r)

    # Input.

    def _grab(self) -> bool:
        """Grab the object unless it is held already; whether there is one."""
        if not self.holding and self.hand is not None:
            self.holding, self._factor = True, 1.0
            self._place = QPointF(self.hand.x, self.hand.y)
            self.grabbed.emit(self.hand.x, self.hand.y)
        return self.holding

    def release(self) -> None:
        self._timer.stop()
        if self.holding:
            self.holding = False
            self.released.emit()

    def give_up(self) -> None:
        """Cancel the drag, if there is one."""
        self._timer.stop()
        if self.holding:
            self.holding = False
            self.cancelled.emit()

    def _press(self, times: float) -> None:
        self._factor *= times
        self.pressed.emit(self._factor)

    def _move(self, x: float, y: float) -> None:
        self._place = QPointF(x, y)
        self.dragged.emit(x, y)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton and self._grab():
            self._timer.stop()
            self._from = event.position()
            if not event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
                self._move(*self.to_skin(event.position()))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if not self.holding or not event.buttons() & Qt.MouseButton.LeftButton:
            return
        if event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
            self._press(_PER_PIXEL ** (self._from.y() - event.position().y()))
        else:
            self._move(*self.to_skin(event.position()))
        self._from = event.position()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.release()

    def wheelEvent(self, event: QWheelEvent) -> None:
        notches = event.angleDelta().y() / 120 or event.angleDelta().x() / 120
        if notches and self._grab():
            self._press(_PER_NOTCH**notches)
            self._release_later(event.buttons())
        event.accept()

    def _release_later(self, buttons: Qt.MouseButton = Qt.MouseButton.NoButton) -> None:
        """Release after a delay, unless the mouse button is held."""
        if not buttons & Qt.MouseButton.LeftButton:
            self._timer.start()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = Qt.Key(event.key())
        others = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier
        if key == Qt.Key.Key_Escape and self.holding:
            self.give_up()
        elif key in _MOVE_KEYS and not event.modifiers() & others and self._grab():
            self._step(*_MOVE_KEYS[key])
        elif key in _FORCE_KEYS and not event.modifiers() & others and self._grab():
            self._press(_PER_NOTCH ** _FORCE_KEYS[key])
            self._release_later()
        else:
            super().keyPressEvent(event)

    def _step(self, dx: int, dy: int) -> None:
        """Move by one step of a key."""
        patch = self._patch
        step = _STEP * max(patch.a, patch.b) if patch is not None else 0.0
        there = self.to_pixel(self._place.x() + dx * step, self._place.y() + dy * step)
        self._move(*self.to_skin(there))
        self._release_later()

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.update()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self.release()
        self.update()


HEIGHT = 330.0  # units
_HINT = (
    "Drag on the pad to move the object; wheel, or Shift and drag, to press harder. Ring: your "
    "hand. Dot: estimated contact."
)
_UNDO_HINT = "Ctrl+Z undoes."
_COLUMNS = 3
_BUTTON = 15.0  # units, height of a capital on a button
_TOP = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop


class _HandText(Indicator):
    """Force and position of the simulated object, and how to move it."""

    def __init__(self) -> None:
        super().__init__()
        self.hand: Hand | None = None
        self.refusal = ""

    def show_hand(self, hand: Hand | None, refusal: str) -> None:
        if (hand, refusal) != (self.hand, self.refusal):
            self.hand, self.refusal = hand, refusal
            self.update()

    def words(self) -> list[Words]:
        if self.hand is None:
            return []
        place, third = self.rect().toRectF(), self.height() / 3
        x, y, force = 1e3 * self.hand.x, 1e3 * self.hand.y, self.hand.force
        hand_text = f"Your hand: {force:.2f} N at {x:.0f}, {y:.0f} mm"
        above = place.adjusted(0, 0, 0, -2 * third)
        below = place.adjusted(0, third, 0, 0)
        hint = f"{self.refusal}. {_UNDO_HINT}" if self.refusal else _HINT
        large, small = self.letters(CAPTION, bold=True), self.letters(0.8 * CAPTION)
        return [
            shrunk(Words(hand_text, large, above, align=_TOP)),
            shrunk(Words(hint, small, below, faint=True, align=_TOP, lines=True)),
        ]


class OperatorControls(QWidget):
    """Pad and buttons of the objects; `chosen` emits a number in `DEMO_OBJECTS`."""

    chosen = Signal(int)

    def __init__(self) -> None:
        super().__init__()
        self.pad, self.hand_text = Pad(), _HandText()
        self.pad.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Ignored)
        self.objects, self._selection = QButtonGroup(self), QWidget()
        self._selection.setAccessibleName("Object")
        grid = QGridLayout(self._selection)
        grid.setContentsMargins(0, 0, 0, 0)
        for number, demo_object in enumerate(DEMO_OBJECTS):
            button = QPushButton(demo_object.title)
            button.setCheckable(True)
            button.setToolTip(demo_object.tip)
            button.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
            self.objects.addButton(button, number)
            grid.addWidget(button, *divmod(number, _COLUMNS))
        self.objects.idClicked.connect(guarded(self.chosen.emit))
        beside, row = QVBoxLayout(), QHBoxLayout(self)
        beside.addWidget(self.hand_text, 1)
        beside.addWidget(self._selection)
        row.addWidget(self.pad)
        row.addLayout(beside, 1)
        self._row, self._unit = row, 0.0
        follow_look(self, self._apply_theme)

    def show_unit(self, unit: float) -> None:
        self._unit = unit
        self.setFixedHeight(round(HEIGHT * unit))
        self.pad.setFixedWidth(round(HEIGHT * unit))
        edge = round(12 * unit)
        self._row.setContentsMargins(edge, edge, edge, edge)
        self._row.setSpacing(2 * edge)
        for indicator in (self.pad, self.hand_text):
            indicator.show_unit(unit)
        for button in self.objects.buttons():
            button.setFont(letters(self.font(), _BUTTON * unit))

    def show_hand(self, hand: Hand | None, refusal: str = "") -> None:
        """Show the simulated object, and why the last requested scene was refused."""
        self.pad.show_hand(hand)
        self.hand_text.show_hand(hand, refusal)

    def show_objects(self, selectable: bool, number: int) -> None:
        """Check the present one of `DEMO_OBJECTS`, -1 for none; hidden if not `selectable`."""
        self._selection.setVisible(selectable)
        checked = self.objects.checkedId()
        if number != checked:
            self.objects.setExclusive(False)
            for button in self.objects.buttons():
                button.setChecked(self.objects.id(button) == number)
            self.objects.setExclusive(True)

    def _apply_theme(self) -> None:
        theme = current()
        self._selection.setStyleSheet(
            f"QPushButton:checked {{ background: {theme.accent}; color: {theme.base};"
            f" border: 1px solid {theme.accent}; border-radius: 3px; padding: 4px; }}"
        )
