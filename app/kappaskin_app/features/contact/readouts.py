"""Readouts: frame rate, latency, contact and accuracy as text."""

import math

import numpy as np
from PySide6.QtGui import QFont, QFontInfo, QPalette, QResizeEvent
from PySide6.QtWidgets import QGridLayout, QLabel, QWidget

from kappaskin._text import rounded, with_error
from kappaskin.frames import Contact, Estimate
from kappaskin.pipeline import REPORTED, Reported, readouts_of
from kappaskin_app.theme import FAINT, follow_look
from kappaskin_app.widgets.line import Line
from kappaskin_app.widgets.parts import Label
from kappaskin_app.widgets.text import NONE, Coverage

_NEGLIGIBLE_SD = 0.05  # ms: a smaller error bar is omitted


FIELDS = {
    "rate": ("Frames", "Frames received per second, and pictures drawn of them."),
    "age": (
        "Age",
        "Time from the start of a scan to its drawing, with the error of the device's clock from "
        "pings. Of a device that does not answer pings: time since its bytes were received, a "
        "lower bound.",
    ),
    "lost": (
        "Lost frames",
        "Frames not received; skipped: received but not computed; B: bytes discarded.",
    ),
    "contact": (
        "Contact",
        "Position of the load that fits the readings best, or of two loads where two fit; "
        "distributed: neither fits, as for a line, a large area or several places; near rim: too "
        "close to a held edge to be reliable.",
    ),
}
_WIDTHS = {"contact": 26, "rate": 15, "lost": 19, "age": 15}
"""Usual number of characters of each."""
_NUMBERS = [(each, each.header) for each in REPORTED if each.header is not None]
_BARRED = ["contact", *(header.key for of, header in _NUMBERS if of.sd is not None)]
FIELDS |= {header.key: (of.labels_shown[0], header.tip) for of, header in _NUMBERS}
_WIDTHS |= {header.key: header.width for _, header in _NUMBERS}

_DIGITS = 1.08  # average width of a character in digits, with the space between two fields
_OF_TWO = 1.0  # mm: the places of two contacts are rounded as if their error bar was this at least
_SMALL = 0.85  # size of a name's letters, of those of its number


def _short(count: int) -> str:
    """A count in few digits, so that three fit in a readout."""
    if count < 10_000:
        return str(count)
    return f"{count / 1e3:.0f} k" if count < 999_500 else f"{count / 1e6:.1f} M"


def _contact(contact: Contact, second: Contact) -> str:
    if not contact.present:
        return "none"
    x, y = contact.position * 1e3
    if second.present:
        first, other = (_place(each, _OF_TWO)[0] for each in (contact, second))
        return f"{first}, {other} mm"
    if contact.near_rim:
        return f"\N{ALMOST EQUAL TO} ({x:.0f}, {y:.0f}) mm, near rim"
    if not contact.single:
        return f"\N{ALMOST EQUAL TO} ({x:.0f}, {y:.0f}) mm, distributed"
    place, bar = _place(contact)
    return f"{place} {bar}"


def _place(contact: Contact, least: float = 0.0) -> tuple[str, str]:
    """The position in mm, and the larger of its error bars with the unit, `least` mm or more."""
    sd, half = (1e3 * float(np.max(of)) for of in (contact.position_sd, contact.position_95))
    off = max(Coverage.now.of(sd, half), least)
    (x, bar), (y, _) = (rounded(1e3 * value, off, 1) for value in contact.position.tolist())
    return f"({x}, {y})", f"mm {bar}" if bar == "exact" else f"\N{PLUS-MINUS SIGN} {bar} mm"


def _forces(*contacts: Contact) -> str:
    """The forces of two contacts, without error bars, for which there is no room."""
    off = Coverage.now.of
    texts = [
        of.no_force.partition(":")[0] or rounded(of.force, off(of.force_sd, of.force_95))[0]
        for of in contacts
    ]
    return NONE if NONE in texts else f"{', '.join(texts)} N"


def _age(age: float, sd: float) -> str:
    """An age in ms with its error bar, unless that is negligible."""
    if not math.isfinite(age):
        return NONE
    if not math.isfinite(sd):
        return f"\N{GREATER-THAN OR EQUAL TO} {age:.0f} ms"
    return f"{age:.0f} ms" if sd < _NEGLIGIBLE_SD else with_error(age, Coverage.now.of(sd), "ms")


class Readouts(QWidget):
    """Names above numbers of fixed widths, in two rows where they do not fit in one."""

    def __init__(self) -> None:
        super().__init__()
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(6, 2, 6, 2)
        self._grid.setHorizontalSpacing(6)
        self._grid.setVerticalSpacing(0)
        self._names: list[QLabel] = []
        self._numbers: dict[str, Line] = {}
        for key, (name, tip) in FIELDS.items():
            above, below = Label(name), Line(NONE)
            bold = below.font()
            bold.setWeight(QFont.Weight.DemiBold)
            below.setFont(bold)
            for widget in (above, below):
                widget.setToolTip(tip)
            above.setForegroundRole(FAINT)
            self._names.append(above)
            self._numbers[key] = below
        self._columns = 0
        self._arrange(len(FIELDS))
        follow_look(self, self._fit_names)

    def _arrange(self, columns: int) -> None:
        """Arrange the fields in so many columns."""
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
        self._arrange(len(FIELDS) if room else len(FIELDS) // 2)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit_names(self) -> None:
        """Set the names in smaller letters than the numbers."""
        font = self.font()
        font.setPixelSize(round(_SMALL * QFontInfo(font).pixelSize()))
        for label in self._names:
            label.setFont(font)
        self._fit()

    def show_bars(self, bars: Coverage) -> None:
        """Name the error bars of the numbers that have them."""
        for (key, (name, tip)), label in zip(FIELDS.items(), self._names, strict=True):
            if key in _BARRED:
                label.setText(f"{name} ({bars.label})")
            if key in (*_BARRED, "age"):
                for widget in (label, self._numbers[key]):
                    widget.setToolTip(f"{tip} Error bar: {bars.title}.")

    def text(self, key: str) -> str:
        return self._numbers[key].text()

    @property
    def parts(self) -> dict[str, list[QWidget]]:
        """Each number with its name above, by key."""
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
        """Show `rate` in frames/s, `drawn` in pictures/s, and `age` in s.

        `age_sd` is its standard deviation in s, infinite where `age` is a lower bound; the others
        count frames, and bytes discarded.
        """
        self._write("rate", f"{rate:.0f}/s, {drawn:.0f} drawn")
        self._write("age", _age(1e3 * age, 1e3 * age_sd))
        also = ((skipped, "skipped"), (discarded, "B"))
        parts = [_short(lost), *(f"{_short(count)} {what}" for count, what in also if count)]
        self._write("lost", ", ".join(parts))

    def show_estimate(self, estimate: Estimate | None) -> None:
        if estimate is None:
            for key in ("contact", *(header.key for _, header in _NUMBERS)):
                self._write(key, NONE)
            return
        self._write("contact", _contact(estimate.contact, estimate.second))
        role = FAINT if estimate.contact.near_rim else QPalette.ColorRole.WindowText
        self._numbers["contact"].setForegroundRole(role)
        reported = Reported(estimate)
        for quantity, header in _NUMBERS:
            (found,) = readouts_of(quantity, reported)
            sign = "+" if header.signed else ""
            off = Coverage.now.of(found.sd, found.half_width)
            words = with_error(found.value, off, found.unit, found.digits, sign)
            if header.key == "force" and estimate.second.present:
                words = _forces(estimate.contact, estimate.second)
            if header.key == "force":
                words = estimate.contact.force_bound + words
            self._write(header.key, found.words or words)

    def _write(self, key: str, text: str) -> None:
        self._numbers[key].show_text(text)
