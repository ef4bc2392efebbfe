"""The line above the operator's view: the one true word, what is read, and how old it is."""

import math

from PySide6.QtCore import QRectF
from PySide6.QtGui import QPainter

from kappaskin_app.features.presenter.board import Board
from kappaskin_app.shell.badge import OFF, colour_of
from kappaskin_app.widgets.lettering import (
    CENTRE,
    LEFT,
    PRIMARY,
    RIGHT,
    SECONDARY,
    Words,
    shrunk,
    width_of,
)

HEIGHT = 112.0  # units
_PAD = 28.0  # units beside the word


class Strip(Board):
    """Shows the badge's word in its colour, the source's name, and the age of the data."""

    def __init__(self) -> None:
        super().__init__()
        self.state, self.source, self.age = OFF, "", ""
        self.edge = 0.0  # px kept free on both sides

    def show_unit(self, unit: float) -> None:
        super().show_unit(unit)
        self.fix_height(HEIGHT)

    def show_state(self, state: str, source: str, age: str) -> None:
        if (state, source, age) != (self.state, self.source, self.age):
            self.state, self.source, self.age = state, source, age
            self.setAccessibleName(f"{state}, {source}, {age}")
            self.update()

    @property
    def badge(self) -> QRectF:
        """Where the word stands."""
        wide = width_of(self.letters(PRIMARY, bold=True), self.state)
        gap = 8 * self.unit
        return QRectF(self.edge, gap, wide + 2 * _PAD * self.unit, self.height() - 2 * gap)

    def draw(self, painter: QPainter) -> None:
        self.fill(painter, self.badge, colour_of(self.state, self.theme), 10 * self.unit)

    def ink(self, words: Words) -> str:
        return "#ffffff" if words.text == self.state else super().ink(words)

    def words(self) -> list[Words]:
        badge, large = self.badge, self.letters(PRIMARY, bold=True)
        shown = [Words(self.state, large, badge, align=CENTRE)]
        wide = width_of(large, self.age) + 2
        age = QRectF(self.width() - wide - self.edge, 0, wide, self.height())
        shown.append(Words(self.age, large, age, align=RIGHT))
        left = badge.right() + _PAD * self.unit
        place = QRectF(left, 0, max(age.left() - left - _PAD * self.unit, 1.0), self.height())
        shown.append(shrunk(Words(self.source, self.letters(SECONDARY), place, align=LEFT)))
        return shown


def age_in_words(seconds: float, least: bool = False) -> str:
    """An age as it is read at a glance; `least` where it may be more."""
    if not math.isfinite(seconds):
        return ""
    more = "\N{GREATER-THAN OR EQUAL TO}\N{THIN SPACE}" if least else ""
    if seconds < 1:
        return f"{more}{1e3 * seconds:.0f} ms old"
    if seconds < 120:
        return f"{seconds:.0f} s old"
    return f"{seconds / 60:.0f} min old" if seconds < 7200 else f"{seconds / 3600:.0f} h old"
