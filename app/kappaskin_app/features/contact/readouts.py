"""The numbers in words: how live it is, where the contact is and how wrong the shape is."""

import math

import numpy as np
from PySide6.QtGui import QFont, QFontInfo, QResizeEvent
from PySide6.QtWidgets import QGridLayout, QLabel, QWidget

from kappaskin.frames import Contact, Estimate
from kappaskin.pipeline import REPORTED, Readout, Reported, readouts_of
from kappaskin_app.theme import FAINT, follow_look
from kappaskin_app.widgets.line import Line
from kappaskin_app.widgets.parts import with_error
from kappaskin_app.widgets.text import NONE

_FINE = 0.02  # mm of error bar, below which a hundredth is too coarse
_TINY = 0.05  # ms of error bar, below which it would be shown as none


FIELDS = {
    "rate": ("Frames", "Frames that come per second, and pictures drawn of them."),
    "age": (
        "Age",
        "How old what you see was when it was drawn: since its scan began, with the standard "
        "deviation that the device's clock is known to by pings. At least so old, where a line "
        "answers none: then since its bytes came.",
    ),
    "lost": (
        "Lost frames",
        "Frames that never came; skipped: too many to compute; B: bytes that made no sense.",
    ),
    "contact": (
        "Contact",
        "Where one point load explains the readings best; spread: they are not of one; near rim: "
        "too near a held edge for place and force to be trusted.",
    ),
}
_WIDTHS = {"contact": 22, "rate": 15, "lost": 19, "age": 10}
"""Characters of each, as many as it mostly has."""
_NUMBERS = [(each, each.header) for each in REPORTED if each.header is not None]
FIELDS |= {header.key: (of.labels_shown[0], header.tip) for of, header in _NUMBERS}
_WIDTHS |= {header.key: header.width for _, header in _NUMBERS}

_DIGITS = 1.14  # as wide as a character on average, the space between two fields with it
_SMALL = 0.85  # of a number's letters are those of its name


def _told(found: Readout, sign: str) -> str:
    """A number of the table with its error bar."""
    _, value, sd, _, unit, digits = found
    if unit == "mN" and abs(value) >= 1e3:
        return with_error(1e-3 * value, 1e-3 * sd, 3, "N", sign)
    if unit == "mm" and sd >= _FINE:
        digits -= 1
    return with_error(value, sd, digits, unit, sign)


def _short(count: int) -> str:
    """A count in few digits, so that three of them fit beside each other."""
    if count < 10_000:
        return str(count)
    return f"{count / 1e3:.0f} k" if count < 999_500 else f"{count / 1e6:.1f} M"


def _contact(contact: Contact) -> str:
    if not contact.present:
        return "none"
    x, y = contact.position * 1e3
    if contact.near_rim:
        return f"\N{ALMOST EQUAL TO} ({x:.0f}, {y:.0f}) mm, near rim"
    if not contact.single:
        return f"\N{ALMOST EQUAL TO} ({x:.0f}, {y:.0f}) mm, spread"
    sd = float(np.max(contact.position_sd)) * 1e3
    return f"({x:.1f}, {y:.1f}) \N{PLUS-MINUS SIGN} {sd:.2f} mm"


def _age(age: float, sd: float) -> str:
    """An age in ms with its error bar, unless that is too small to be seen."""
    if not math.isfinite(age):
        return NONE
    if not math.isfinite(sd):
        return f"\N{GREATER-THAN OR EQUAL TO} {age:.0f} ms"
    return f"{age:.0f} ms" if sd < _TINY else with_error(age, sd, 0 if sd >= 1 else 1, "ms")


class Readouts(QWidget):
    """Names above numbers, each of a fixed width so that nothing jitters.

    In two rows where the letters are too large for one.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(6, 2, 6, 2)
        self._grid.setHorizontalSpacing(6)
        self._grid.setVerticalSpacing(0)
        self._names: list[QLabel] = []
        self._numbers: dict[str, Line] = {}
        for key, (name, tip) in FIELDS.items():
            above, below = QLabel(name), Line(NONE)
            bold = below.font()
            bold.setWeight(QFont.Weight.DemiBold)
            below.setFont(bold)
            for widget in (above, below):
                widget.setToolTip(tip)
            above.setForegroundRole(FAINT)
            self._names.append(above)
            self._numbers[key] = below
        self._columns = 0
        self._lay_out(len(FIELDS))
        follow_look(self, self._shrink)

    def _lay_out(self, columns: int) -> None:
        """Put so many fields beside each other."""
        if columns == self._columns:
            return
        self._columns = columns
        for column in range(len(FIELDS)):
            self._grid.setColumnStretch(column, 0)
        fields = zip(self._names, self._numbers.items(), strict=True)
        for number, (above, (key, below)) in enumerate(fields):
            row, column = divmod(number, columns)
            self._grid.addWidget(above, 2 * row, column)
            self._grid.addWidget(below, 2 * row + 1, column)
            stretch = max(self._grid.columnStretch(column), _WIDTHS[key])
            self._grid.setColumnStretch(column, stretch)

    def _fit(self) -> None:
        digit = self._numbers["rate"].fontMetrics().horizontalAdvance("0")
        room = self.width() >= _DIGITS * digit * sum(_WIDTHS.values())
        self._lay_out(len(FIELDS) if room else len(FIELDS) // 2)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _shrink(self) -> None:
        """Have the names in smaller letters than the numbers."""
        font = self.font()
        font.setPixelSize(round(_SMALL * QFontInfo(font).pixelSize()))
        for label in self._names:
            label.setFont(font)
        self._fit()

    def text(self, key: str) -> str:
        return self._numbers[key].text()

    @property
    def parts(self) -> dict[str, list[QWidget]]:
        """Each number with what stands above it, by name."""
        return {
            key: [number, name]
            for (key, number), name in zip(self._numbers.items(), self._names, strict=True)
        }

    def show_health(
        self,
        rate: float,
        drawn: float,
        age: float,
        age_sd: float,
        *,
        lost: int = 0,
        discarded: int = 0,
        skipped: int = 0,
    ) -> None:
        """Show how live the view is: `rate` in frames/s, `drawn` in pictures/s, `age` in s.

        `age_sd` in s is the standard deviation of the age, infinite where it is only the least;
        the others count frames, and bytes discarded.
        """
        self._write("rate", f"{rate:.0f}/s, {drawn:.0f} drawn")
        self._write("age", _age(1e3 * age, 1e3 * age_sd))
        also = ((skipped, "skipped"), (discarded, "B"))
        told = [_short(lost), *(f"{_short(count)} {what}" for count, what in also if count)]
        self._write("lost", ", ".join(told))

    def show_estimate(self, estimate: Estimate | None) -> None:
        if estimate is None:
            for key in ("contact", *(header.key for _, header in _NUMBERS)):
                self._write(key, NONE)
            return
        self._write("contact", _contact(estimate.contact))
        reported = Reported(estimate)
        for quantity, header in _NUMBERS:
            (found,) = readouts_of(quantity, reported)
            self._write(header.key, _told(found, "+" if header.signed else ""))

    def _write(self, key: str, text: str) -> None:
        self._numbers[key].show_text(text)
