"""Strip chart: numbers of the contact over time, one chart below the other."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QCheckBox, QComboBox, QVBoxLayout, QWidget

from kappaskin.frames import Array
from kappaskin.pipeline import REPORTED
from kappaskin_app.features.strip_chart.history import LONG, WHOLE, Span
from kappaskin_app.guard import guarded
from kappaskin_app.widgets.chart import Chart, ChartAxis, ChartLine, Series
from kappaskin_app.widgets.layout import Flow
from kappaskin_app.widgets.parts import Label
from kappaskin_app.widgets.text import Coverage

MIME = "application/x-kappaskin-quantities"
"""Kind of what is dragged from a readout: names of quantities, separated by spaces."""
SPANS = {10.0: "10 s", WHOLE: "1 min", 600.0: "10 min", LONG: "1 h"}
"""What may be shown, in s."""
_MINUTES = 300.0  # s, from which on the axis is in minutes
_EMPTY = "No contact in this time."
_NONE = "Select a number above, or drag one here from the top of the window or from a heatmap."
_TIP = (
    "{} over time; the band is its error bar ({}). Every frame of the last minute is shown, before "
    "that the smallest and the largest value in each tenth of a second, for an hour. "
    "Drag over a part to zoom into all charts; a double click shows all."
)
_RECORDED_TIP = (
    "{} over the whole recording; the band is its error bar ({}). Lines mark the present time and "
    "the events. Click to go to another time. Drag over a part to zoom into all charts; a double "
    "click shows all."
)
_ELEMENT, _DIGITS = "element-", 6
_SPAN_TIP = "Time that is shown."
_ALL_TIP = (
    "A curve of each finger of the hand, on the clock of this computer. The band is the error bar "
    "of the finger that is shown, of which elements and the object are too."
)


def _principal(form: Array) -> Array:
    """Principal curvatures (T, 2) of curvature forms (T, 2, 2), the larger first."""
    xx, xy, _, yy = form.reshape(len(form), 4).T
    mean, off = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    return np.stack([mean + off, mean - off], axis=-1)


# Of numbers that an estimate does not store: the field that they follow from, and how.
_FOLLOWING: Mapping[str, tuple[str, Callable[[Array], Array]]] = {
    "contact.load_radius": ("contact.size", np.sqrt),
    "geometry.principal": ("geometry.curvature_form", _principal),
}


@dataclass(frozen=True)
class StripQuantity:
    """A number that can be drawn over time: as many times what is computed `by` its field (T, ...).

    That is at the `path`; the number is part `part`, and has a standard deviation at the path `sd`,
    if there is one.
    """

    label: str
    unit: str
    scale: float
    path: str = ""
    part: int = 0
    sd: str = ""
    by: Callable[[Array], Array] = np.asarray

    def of(self, values: Array) -> Array:
        """The number (T,) of a field (T, ...), or of its standard deviation."""
        return values.reshape(len(values), -1)[:, self.part]


def _quantities() -> dict[str, StripQuantity]:
    found = dict[str, StripQuantity]()
    for of in REPORTED:
        if of.group != "contact" or not isinstance(of.value, str) or not of.labels_shown:
            continue
        path, by = _FOLLOWING.get(of.value, (of.value, np.asarray))
        sd = of.sd if path == of.value and isinstance(of.sd, str) else ""
        unit, scale, _ = of.shown
        suffixes = of.labels({}) or ("",)
        for part, (suffix, label) in enumerate(zip(suffixes, of.labels_shown, strict=True)):
            found[of.name + suffix] = StripQuantity(label, unit, scale, path, part, sd, by)
    return found


RADIUS = "object_radius"
"""The radius of the object in contact: not of each frame, but as it is recognised."""
QUANTITIES: Mapping[str, StripQuantity] = {
    **_quantities(),
    RADIUS: StripQuantity("Object radius", "mm", 1e3),
}
"""What can be drawn, by name."""


def element_name(element: int) -> str:
    """Name of the readings of an element."""
    return f"{_ELEMENT}{element}"


def element_of(name: str) -> int:
    """The element whose readings are called `name`; -1 for any other name."""
    number = name.removeprefix(_ELEMENT)
    known = name.startswith(_ELEMENT) and number.isascii() and number.isdigit()
    return int(number[:_DIGITS]) if known else -1


def label_of(name: str) -> str:
    """The label of a quantity, or of the readings of an element."""
    element = element_of(name)
    return QUANTITIES[name].label if element < 0 else f"Element {element}"


@dataclass(frozen=True)
class StripMark:
    """A line at a `time` in s, in the colour of its `kind`, a key of `MARKS`, with a text."""

    time: float
    kind: str
    text: str = ""


NOW = "now"
MARKS = {
    NOW: ("", "accent"),
    "note": ("Note", "text"),
    "tare": ("Tare", "good"),
    "event": ("Loss or other event", "warning"),
}
"""Name and colour of each kind of mark."""


class StripChart(QWidget):
    """Charts of the selected quantities and elements, and check boxes that select them.

    `toggled` asks for a quantity to be shown or hidden, `added` for those dragged here, `spanned`
    for another span in s, `sought` for another time in s in a recording.
    """

    toggled = Signal(str)
    added = Signal(list)
    spanned = Signal(float)
    sought = Signal(float)

    def __init__(self) -> None:
        super().__init__()
        self.setAcceptDrops(True)
        self.charts: dict[str, Chart] = {}
        self.boxes: dict[str, QCheckBox] = {}
        self._shown: tuple[object, ...] = ()
        self._length, self._unit = 0.0, 1.0
        self._kinds, self._scales, self._unit_read = ("",), np.ones(1), ""
        self.part: tuple[float, float] | None = None
        """The part of the time that is shown in s, None for all of it."""
        top, self._above = QWidget(), Flow()
        top.setLayout(self._above)
        self.span = QComboBox()
        self.span.setToolTip(_SPAN_TIP)
        self.span.setAccessibleName("Time shown")
        for seconds, text in SPANS.items():
            self.span.addItem(text, seconds)
        self.span.activated.connect(
            guarded(lambda n: self.spanned.emit(float(self.span.itemData(n))))
        )
        self.when = Label()
        self._above.addWidget(self.when)
        self._above.addWidget(self.span)
        self.of_hand = False
        self.all_fingers = QCheckBox("All fingers")
        self.all_fingers.setToolTip(_ALL_TIP)
        self.all_fingers.setChecked(True)
        self._above.addWidget(self.all_fingers)
        for name in QUANTITIES:
            self._add_box(name)
        self._around = QVBoxLayout(self)
        self._around.setContentsMargins(8, 4, 8, 6)
        self._around.setSpacing(2)
        self._around.addWidget(top)
        self.hint = Chart(ChartAxis(""), ChartAxis(""), "")
        self.hint.show_series((), _NONE)
        self._around.addWidget(self.hint, 1)

    def _add_box(self, name: str) -> None:
        box = self.boxes[name] = QCheckBox(label_of(name))
        box.setToolTip(f"Show {label_of(name)} over time.")
        box.clicked.connect(guarded(lambda *_: self.toggled.emit(name)))
        self._above.addWidget(box)

    def show_readings(self, kinds: Sequence[str], scales: Array, unit: str) -> None:
        """Name and scale (k,) what each element reads, in a `unit`."""
        self._kinds, self._scales, self._unit_read = tuple(kinds), scales, unit
        self._shown = ()

    def show_choice(
        self, names: Sequence[str], seconds: float, length: float = 0.0, element: int = -1
    ) -> None:
        """Show charts of these quantities over so many s up to now, or over a recording's length.

        That is in s too; without one the chart is live. The readings of `element` can be selected.
        """
        elements = [name for name in names if element_of(name) >= 0]
        names = [*(name for name in QUANTITIES if name in names), *elements]
        offered = [*QUANTITIES, *elements, *[element_name(element)] * (element >= 0)]
        for name in [name for name in self.boxes if name not in offered]:
            self.boxes.pop(name).deleteLater()
        for name in [name for name in offered if name not in self.boxes]:
            self._add_box(name)
        for name, box in self.boxes.items():
            box.setChecked(name in names)
        self.span.setCurrentIndex(self.span.findData(seconds))
        self.span.setVisible(not length)
        self.all_fingers.setVisible(self.of_hand and not length)
        bars = Coverage.now
        if self._shown == (names, seconds, length, bars):
            return
        self._shown, self._length, self.part = (names, seconds, length, bars), length, None
        begin, end = (0.0, length) if length else (-seconds, 0.0)
        unit, self._unit = ("min", 60.0) if end - begin >= _MINUTES else ("s", 1.0)
        when = "Time in the recording" if length else "Time from now"
        last = "" if length else "; the last"
        self.when.setText(f"{when} in {unit}{last}")
        for name in [name for name in self.charts if name not in names]:
            self.charts.pop(name).deleteLater()
        self.charts = {name: self.charts.get(name) or self._chart() for name in names}
        limits, tip = (begin / self._unit, end / self._unit), _RECORDED_TIP if length else _TIP
        for name, chart in self.charts.items():
            self._around.removeWidget(chart)
            self._around.addWidget(chart, 1)
            shows = "numbers" if name == names[-1] else ""
            axis = ChartAxis(when, unit, limits=limits, shows=shows)
            label = label_of(name)
            of = self._unit_read if name not in QUANTITIES else QUANTITIES[name].unit
            chart.show_axes(ChartAxis(label, of), axis, tip.format(label, bars.label))
        self.hint.setVisible(not names)

    def _chart(self) -> Chart:
        chart = Chart(ChartAxis(""), ChartAxis(""), "", brushes=True)
        chart.clicked_at.connect(guarded(self._seek))
        chart.zoomed.connect(guarded(lambda part: self._zoom(chart, part)))
        return chart

    def _zoom(self, zoomed: Chart, part: tuple[float, float] | None) -> None:
        """Show the same part of the time in every chart."""
        for chart in self.charts.values():
            if chart is not zoomed:
                chart.show_part(part)
        self.part = part and (self._unit * part[0], self._unit * part[1])

    def _seek(self, at: float) -> None:
        if self._length:
            self.sought.emit(min(max(at * self._unit, 0.0), self._length))

    def show_span(
        self, name: str, span: Span, sd: Span | None, zero: float, marks: Sequence[StripMark]
    ) -> None:
        """Draw a quantity and its standard deviation, in SI units.

        The times are from `zero` in s on.
        """
        self._draw(name, self._series(name, "", 0, span, sd, zero), zero, marks)

    def show_fingers(
        self,
        name: str,
        spans: Mapping[str, tuple[Span, float]],
        shown: str,
        sd: Span | None,
        marks: Sequence[StripMark],
    ) -> None:
        """Draw a quantity of each finger, each with the time from which its times are.

        The standard deviation and the marks are those of the finger that is `shown`.
        """
        series: list[Series] = []
        for number, (finger, (span, zero)) in enumerate(spans.items()):
            of = sd if finger == shown else None
            series += self._series(name, finger, number, span, of, zero)
        self._draw(name, series, spans[shown][1], marks)

    def _series(
        self, name: str, label: str, colour: int, span: Span, sd: Span | None, zero: float
    ) -> list[Series]:
        """The curve of a quantity, and the band of its standard deviation, at times from `zero`."""
        scale, each = QUANTITIES[name].scale, self._unit
        times, values = span.outline
        found = [Series(label, (times - zero) / each, scale * values, colour)]
        if sd is not None:
            ago, mean = (span.times - zero) / each, scale * span.mean
            found.append(Series("", ago, mean, colour, line="", band=scale * sd.mean))
        return found

    def show_element(
        self, name: str, spans: Sequence[Span], zero: float, marks: Sequence[StripMark]
    ) -> None:
        """Draw what an element reads, each in SI units, at times from `zero` in s on."""
        shown: list[Series] = []
        for n, (kind, scale) in enumerate(zip(self._kinds, self._scales.tolist(), strict=True)):
            times, values = spans[n].outline
            shown.append(Series(kind, (times - zero) / self._unit, scale * values, n))
        self._draw(name, shown, zero, marks)

    def _draw(
        self, name: str, shown: list[Series], zero: float, marks: Sequence[StripMark]
    ) -> None:
        """Draw series and marks; the texts of marks are at the bottom of their lines."""
        lines: list[ChartLine] = []
        for kind, (label, colour) in MARKS.items():
            of = [mark for mark in marks if mark.kind == kind]
            at = np.array([(mark.time - zero) / self._unit for mark in of])
            lines += [ChartLine(x, colour, upright=True) for x in at.tolist()]
            texts = [mark.text for mark in of]
            if any(texts):
                shown.append(Series(label, at, 0 * at, colour, "", "t1", tips=texts))
        self.charts[name].show_series(shown, _EMPTY, lines)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if event.mimeData().hasFormat(MIME):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        names = bytes(event.mimeData().data(MIME).data()).decode(errors="replace").split()
        self.added.emit([n for n in names if n in QUANTITIES or element_of(n) >= 0])
        event.setDropAction(Qt.DropAction.CopyAction)
        event.accept()
