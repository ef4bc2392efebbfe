"""One number of the operator's view: its name, its value with unit, and its error bar."""

from dataclasses import replace

from PySide6.QtGui import QFontMetricsF

from kappaskin_app.features.presenter.board import Board
from kappaskin_app.widgets.lettering import CAPTION, PRIMARY, SECONDARY, Words, width_of

NONE = "\N{EN DASH}"
HEIGHT = 142.0  # units
_GAP = 26.0


class Figure(Board):
    """A name above a large value, and beside it in smaller letters a note."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name, self.value, self.note = name, NONE, ""

    def show_figure(self, value: str, note: str = "", name: str = "") -> None:
        name = name or self.name
        if (name, value, note) != (self.name, self.value, self.note):
            self.name, self.value, self.note = name, value, note
            self.setAccessibleName(f"{name}: {value} {note}".strip())
            self.update()

    def show_unit(self, unit: float) -> None:
        super().show_unit(unit)
        self.fix_height(HEIGHT)

    def words(self) -> list[Words]:
        """The value is never made smaller for the sake of the note."""
        caption, large = self.letters(CAPTION), self.letters(PRIMARY, bold=True)
        wide, base = float(self.width()), self.height() - QFontMetricsF(large).descent()
        value = self.line(self.value, large, 0.0, base, wide)
        name = self.line(self.name, caption, 0.0, CAPTION * self.unit * 1.3, wide)
        shown = [replace(name, faint=True), value]
        at = width_of(value.font, self.value) + _GAP * self.unit
        if self.note and at < wide:
            shown.append(self.line(self.note, self.letters(SECONDARY), at, base, wide - at))
        return shown
