"""The pad with what stands beside it: what the hand does, and what it may hold."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QButtonGroup,
    QGridLayout,
    QHBoxLayout,
    QPushButton,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from kappaskin_app.features.presenter.board import Board
from kappaskin_app.features.presenter.objects import THINGS
from kappaskin_app.features.presenter.pad import Hand, Pad
from kappaskin_app.guard import guarded
from kappaskin_app.theme import Theme
from kappaskin_app.widgets.lettering import CAPTION, Words, letters, shrunk

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

    def show_theme(self, theme: Theme) -> None:
        for board in (self.pad, self.told):
            board.show_theme(theme)
        self._choice.setStyleSheet(
            f"QPushButton:checked {{ background: {theme.accent}; color: {theme.base};"
            f" border: 1px solid {theme.accent}; border-radius: 3px; padding: 4px; }}"
        )
