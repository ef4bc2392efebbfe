"""The pad: the skin from above, on which a hand moves an object and presses."""

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
from kappaskin_app.features.presenter.feedback import Cue
from kappaskin_app.features.presenter.indicators import Board
from kappaskin_app.guard import guarded
from kappaskin_app.theme import current, follow_look, series
from kappaskin_app.widgets.lettering import CAPTION, Words, letters, shrunk


@dataclass(frozen=True)
class DemoObject:
    """An object that a simulated finger may press: what its button and its tooltip say."""

    title: str
    tip: str
    said: Mapping[str, Any]

    def is_in(self, scene: Scene) -> bool:
        """Whether it is what touches in `scene`."""
        what = scene.stimuli[0].what
        rigid = what.rigid if isinstance(what, Indenter) else what
        named = type(rigid).__name__.removesuffix("Load").lower()
        sizes = {name: value for name, value in self.said.items() if name != "what"}
        return named == self.said["what"] and all(
            getattr(rigid, name, None) == value for name, value in sizes.items()
        )


THINGS = (
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
    DemoObject("Point", "A point: it has no radius.", {"what": "point"}),
)


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
        theme, place = current(), self.skin
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
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(series(3))
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


HEIGHT = 330.0  # units
_HINT = (
    "Drag on the pad to move it; wheel, or Shift and drag, to press harder. The ring is your hand, "
    "the dot where the skin feels it."
)
_BACK = "Ctrl+Z takes it back."
_COLUMNS = 3
_BUTTON = 15.0  # units that a capital on a button is high
_TOP = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop


class _Told(Board):
    """What the hand does, which the cue does not know of, and how to move it."""

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
        told = f"Your hand: {force:.2f} N at {x:.0f}, {y:.0f} mm"
        above = place.adjusted(0, 0, 0, -2 * third)
        below = place.adjusted(0, third, 0, 0)
        hint = f"{self.refusal}. {_BACK}" if self.refusal else _HINT
        large, small = self.letters(CAPTION, bold=True), self.letters(0.8 * CAPTION)
        return [
            shrunk(Words(told, large, above, align=_TOP)),
            shrunk(Words(hint, small, below, faint=True, align=_TOP, lines=True)),
        ]


class Operator(QWidget):
    """A pad and a choice of objects; `chosen` says the number of one in `THINGS`."""

    chosen = Signal(int)

    def __init__(self) -> None:
        super().__init__()
        self.pad, self.told = Pad(), _Told()
        self.pad.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Ignored)
        self.things, self._choice = QButtonGroup(self), QWidget()
        self._choice.setAccessibleName("What touches the skin")
        grid = QGridLayout(self._choice)
        grid.setContentsMargins(0, 0, 0, 0)
        for number, thing in enumerate(THINGS):
            button = QPushButton(thing.title)
            button.setCheckable(True)
            button.setToolTip(thing.tip)
            button.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
            self.things.addButton(button, number)
            grid.addWidget(button, *divmod(number, _COLUMNS))
        self.things.idClicked.connect(guarded(self.chosen.emit))
        beside, row = QVBoxLayout(), QHBoxLayout(self)
        beside.addWidget(self.told, 1)
        beside.addWidget(self._choice)
        row.addWidget(self.pad)
        row.addLayout(beside, 1)
        self._row, self._unit = row, 0.0
        follow_look(self, self._dress)

    def show_unit(self, unit: float) -> None:
        self._unit = unit
        self.setFixedHeight(round(HEIGHT * unit))
        self.pad.setFixedWidth(round(HEIGHT * unit))
        edge = round(12 * unit)
        self._row.setContentsMargins(edge, edge, edge, edge)
        self._row.setSpacing(2 * edge)
        for board in (self.pad, self.told):
            board.show_unit(unit)
        for button in self.things.buttons():
            button.setFont(letters(self.font(), _BUTTON * unit))

    def show_hand(self, hand: Hand | None, refusal: str = "") -> None:
        """What the hand holds, and why the scene is not the one that was asked for last."""
        self.pad.show_hand(hand)
        self.told.show_hand(hand, refusal)

    def show_choice(self, there: bool, number: int) -> None:
        """Which of `THINGS` touches, -1 for none of them; not `there`, none can be chosen."""
        self._choice.setVisible(there)
        checked = self.things.checkedId()
        if number != checked:
            self.things.setExclusive(False)
            for button in self.things.buttons():
                button.setChecked(self.things.id(button) == number)
            self.things.setExclusive(True)

    def _dress(self) -> None:
        theme = current()
        self._choice.setStyleSheet(
            f"QPushButton:checked {{ background: {theme.accent}; color: {theme.base};"
            f" border: 1px solid {theme.accent}; border-radius: 3px; padding: 4px; }}"
        )
