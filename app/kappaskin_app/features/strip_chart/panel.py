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
from kappaskin_app.widgets.text import ErrorBars

MIME = "application/x-kappaskin-quantities"
"""Kind of what is dragged from a readout: names of quantities, separated by spaces."""
SPANS = {10.0: "10 s", WHOLE: "1 min", 600.0: "10 min", LONG: "1 h"}
"""What may be shown, in s."""
_MINUTES = 300.0  # s, from which on the axis is in minutes
_EMPTY = "No contact in this time."
_NONE = "Select a number above, or drag one here from the top of the window."
_TIP = (
    "{} over time; the band is its error bar ({}). Every frame of the last minute is shown, before "
    "that the smallest and the largest value in each tenth of a second, for an hour."
)
_RECORDED_TIP = (
    "{} over the whole recording; the band is its error bar ({}). Lines mark the present time and "
    "the events. Click to go to another time; the wheel zooms, a double click "
    "shows all."
)
_SPAN_TIP = "Time that is shown."


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


class StripChart(QWidget):
    """Charts of the selected quantities, and check boxes that select them.

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
        top, above = QWidget(), Flow()
        top.setLayout(above)
        for name, quantity in QUANTITIES.items():
            box = self.boxes[name] = QCheckBox(quantity.label)
            box.setToolTip(f"Show {quantity.label.lower()} over time.")
            box.clicked.connect(guarded(lambda *_, name=name: self.toggled.emit(name)))
            above.addWidget(box)
        self.span = QComboBox()
        self.span.setToolTip(_SPAN_TIP)
        self.span.setAccessibleName("Time shown")
        for seconds, text in SPANS.items():
            self.span.addItem(text, seconds)
        self.span.activated.connect(
            guarded(lambda n: self.spanned.emit(float(self.span.itemData(n))))
        )
        above.addWidget(self.span)
        self._around = QVBoxLayout(self)
        self._around.setContentsMargins(8, 4, 8, 6)
        self._around.setSpacing(2)
        self._around.addWidget(top)
        self.hint = Chart(ChartAxis(""), ChartAxis(""), "")
        self.hint.show_series((), _NONE)
        self._around.addWidget(self.hint, 1)

    def show_choice(self, names: Sequence[str], seconds: float, length: float = 0.0) -> None:
        """Show charts of these quantities over so many s up to now, or over a recording's length.

        That is in s too; without one the chart is live.
        """
        names = [name for name in QUANTITIES if name in names]
        for name, box in self.boxes.items():
            box.setChecked(name in names)
        self.span.setCurrentIndex(self.span.findData(seconds))
        self.span.setVisible(not length)
        bars = ErrorBars.now
        if self._shown == (names, seconds, length, bars):
            return
        self._shown, self._length = (names, seconds, length, bars), length
        begin, end = (0.0, length) if length else (-seconds, 0.0)
        unit, self._unit = ("min", 60.0) if end - begin >= _MINUTES else ("s", 1.0)
        when = "Time in the recording" if length else "Time from now"
        for name in [name for name in self.charts if name not in names]:
            self.charts.pop(name).deleteLater()
        self.charts = {name: self.charts.get(name) or self._chart(name) for name in names}
        for name, chart in self.charts.items():
            self._around.removeWidget(chart)
            self._around.addWidget(chart, 1)
            of, tip = QUANTITIES[name], _RECORDED_TIP if length else _TIP
            title, limits = (
                when if name == names[-1] else "",
                (begin / self._unit, end / self._unit),
            )
            axis = ChartAxis(title, unit, limits=limits)
            chart.show_axes(ChartAxis(of.label, of.unit), axis, tip.format(of.label, bars.label))
        self.hint.setVisible(not names)

    def _chart(self, name: str) -> Chart:
        of = QUANTITIES[name]
        chart = Chart(ChartAxis(of.label, of.unit), ChartAxis(""), "")
        chart.clicked_at.connect(guarded(self._seek))
        return chart

    def _seek(self, at: float) -> None:
        if self._length:
            self.sought.emit(min(max(at * self._unit, 0.0), self._length))

    def show_span(
        self, name: str, span: Span, sd: Span | None, zero: float, marks: Mapping[float, str]
    ) -> None:
        """Draw a quantity and its standard deviation, in SI units.

        The times are from `zero` in s on; `marks` are times in s with the colours of lines there.
        """
        scale, chart, each = QUANTITIES[name].scale, self.charts[name], self._unit
        times, values = span.outline
        shown = [Series("", (times - zero) / each, scale * values)]
        if sd is not None:
            ago, mean = (span.times - zero) / each, scale * span.mean
            shown.append(Series("", ago, mean, line="", band=scale * sd.mean))
        lines = [ChartLine((at - zero) / each, ink, upright=True) for at, ink in marks.items()]
        chart.show_series(shown, _EMPTY, lines)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if event.mimeData().hasFormat(MIME):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        names = bytes(event.mimeData().data(MIME).data()).decode(errors="replace").split()
        self.added.emit([name for name in names if name in QUANTITIES])
        event.setDropAction(Qt.DropAction.CopyAction)
        event.accept()
