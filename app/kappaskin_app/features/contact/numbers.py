"""Tables of the contact and of every element."""

import csv
import io
import math
from collections.abc import Collection, Sequence

from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QVBoxLayout, QWidget

from kappaskin._text import rounded
from kappaskin.estimation import FAULTS
from kappaskin.frames import Estimate
from kappaskin.pipeline import REPORTED, Reported, readouts
from kappaskin.sensing import Sensor
from kappaskin_app.guard import guarded
from kappaskin_app.theme import grown
from kappaskin_app.widgets.lettering import LEFT
from kappaskin_app.widgets.table import Table
from kappaskin_app.widgets.text import ERROR_BARS, Coverage

FACTS = ("Quantity", "Value", "Standard deviation", "Unit")
"""The head of the table of the contact as CSV, with standard deviations."""
_READ = tuple(quantity for quantity in REPORTED if quantity.traced)
_HEADS = (f"{of.name.replace('_', ' ')} [{each.unit}]" for each in _READ for of in each.colours)
ELEMENTS = ("Element", "x [mm]", "y [mm]", *_HEADS, "Fault")
_OTHERS = {"m": 7, "m/m": 6, "1/m": 2}  # digits of readings, in SI units

Rows = list[tuple[str, ...]]


def facts_of(estimate: Estimate, object_: str, bars: Coverage) -> Rows:
    """Rows of the contact, the `object_` in words, and the accuracy of the shape."""
    rows = Rows()
    for each in readouts(estimate):
        off = bars.of(each.sd, each.half_width)
        number = (*rounded(each.value, off, each.digits), each.unit)
        rows.append((each.label, *((each.words, "", "") if each.words else number)))
    return [*rows, ("Object", object_ or "unknown", "", "")]


def head_of(sensor: Sensor | None) -> tuple[str, ...]:
    """The heads of the table of all elements."""
    layout = sensor.layout if sensor else None
    if layout is None or not layout.reads:
        return ELEMENTS
    read = zip(layout.kind_names, layout.kind_units, strict=True)
    return (*ELEMENTS[:3], *(f"{name} [{unit}]" for name, unit in read), ELEMENTS[-1])


def elements_of(estimate: Estimate, sensor: Sensor) -> Rows:
    """Rows of every element: position, readings, and fault if it is excluded."""
    layout = sensor.layout
    places = 1e3 * layout.positions
    if estimate.curvature.shape != layout.frame_shape:
        return []  # of the previous sensor
    reported = Reported(estimate)
    read = [(each.forms[0][2](reported), each.shown[2]) for each in _READ]
    if layout.reads:
        rows = zip(layout.by_kind(estimate.curvature), layout.kind_units, strict=True)
        read = [(row[None], _OTHERS[unit]) for row, unit in rows]
    return [
        (
            str(number),
            *(rounded(value, math.nan, 1)[0] for value in place),
            *(
                rounded(value, math.nan, digits)[0]
                for values, digits in read
                for value in values[:, number]
            ),
            FAULTS[estimate.suspect[number]],
        )
        for number, place in enumerate(places)
    ]


def csv_of(*tables: tuple[Sequence[str], Rows]) -> str:
    """Tables of a head and rows each as CSV, separated by empty lines."""
    text = io.StringIO()
    for number, (head, rows) in enumerate(tables):
        text.write("\n" if number else "")
        csv.writer(text, lineterminator="\n").writerows([head, *rows])
    return text.getvalue().translate({0x2212: "-", 0x2013: ""})  # for programs


_MARGIN = 14  # px, margins of a column's head
_WIDEST = 480  # px of a table that is not scrolled sideways
_LINES = 6  # visible of a table at least


class NumbersPanel(QWidget):
    """Tables of the contact and of every element, with a button to copy them as CSV."""

    def __init__(self) -> None:
        super().__init__()
        self.facts = _table("contact", "Contact and object", FACTS, (1, 2))
        texts = ELEMENTS.index("Fault")
        self.elements = _table("elements", "Readings of every element", ELEMENTS, range(texts))
        self.copy = QPushButton("&Copy as CSV")
        self.copy.setToolTip("Copy both tables, for a spreadsheet.")
        self.copy.clicked.connect(guarded(lambda *_: self._copy()))
        self._facts, self._elements, self._head = Rows(), Rows(), ELEMENTS
        left, around = QVBoxLayout(), QHBoxLayout(self)
        left.addWidget(self.facts)
        left.addWidget(self.copy)
        around.addLayout(left, 1)
        around.addWidget(self.elements, 1)

    def show_estimate(self, estimate: Estimate | None, sensor: Sensor | None, what: str) -> None:
        """Show an estimate; empty tables without one."""
        if not self.isVisible():
            return
        self._facts, self._elements = [], []
        if estimate is not None and sensor is not None:
            self._facts = facts_of(estimate, what, ERROR_BARS["sigma"])
            self._elements = elements_of(estimate, sensor)
        bars = Coverage.now
        shown = facts_of(estimate, what, bars) if self._facts and estimate is not None else []
        heads = (*FACTS[:2], f"Error bar ({bars.label})", FACTS[3])
        self.facts.setHorizontalHeaderLabels(list(heads))
        _fill(self.facts, heads, shown)
        if head_of(sensor) != self._head:
            self._head = head_of(sensor)
            texts = len(self._head) - 1
            self.elements.show_head(self._head, range(texts), range(1, texts + 1))
        _fill(self.elements, self._head, self._elements)
        if self._facts:
            last, text = len(self._facts) - 1, self._facts[-1][1]
            self.facts.setSpan(last, 1, 1, len(FACTS) - 1)
            self.facts.write(last, 1, text, text).setTextAlignment(LEFT)  # that of the object

    def _copy(self) -> None:
        text = csv_of((FACTS, self._facts), (self._head, self._elements))
        QGuiApplication.clipboard().setText(text)


def _table(name: str, title: str, head: Sequence[str], right: Collection[int]) -> Table:
    table = Table(name, title, head, right=right, stretched=range(1, len(head)))
    table.setWordWrap(False)
    return table


def _fill(table: Table, head: Sequence[str], rows: Rows) -> None:
    """Show the rows under a head that is legible in the present font."""
    table.show_rows(rows)
    widest = max(map(table.fontMetrics().horizontalAdvance, head))
    table.horizontalHeader().setMinimumSectionSize(widest + _MARGIN)
    wide = len(head) * (widest + _MARGIN) + table.verticalScrollBar().sizeHint().width()
    table.setMinimumWidth(min(wide, grown(_WIDEST)))
    table.setMinimumHeight((_LINES + 1) * table.verticalHeader().defaultSectionSize())
