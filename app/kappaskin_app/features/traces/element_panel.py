"""Element panel: facts, history and spectrum of one element; traces of several."""

from collections.abc import Sequence

import numpy as np
from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QVBoxLayout, QWidget

from kappaskin.frames import COMPONENTS, Array
from kappaskin.pipeline import REPORTED, ReportedQuantity
from kappaskin.sensing import SHOWN_UNITS, SensorLayout
from kappaskin_app.widgets.chart import Chart, ChartAxis, ChartPoint, Series
from kappaskin_app.widgets.parts import Label

SECONDS = 10.0
"""Length of the history."""
TRACED = tuple(quantity for quantity in REPORTED if quantity.traced)
_AGO = ChartAxis("Time", "s", limits=(-SECONDS, 0.0))
_NONE = "Click an element, on the skin or in a heatmap."
_FREQUENCY = ChartAxis("Frequency", "Hz")
_NONE_PLOTTED = "Click an element, then Plot in its panel (Ctrl+Alt+E)."
_TRACE = "{} over the last 10 s, in every computed frame, up to 500 per second."
_SPECTRUM = (
    "Amplitude of the sine that fits the last 10 s best at each frequency, by least squares "
    "(Lomb-Scargle), up to half the frame rate. Mains hum is a line."
)


def screen_unit(layout: SensorLayout, unit: str) -> str:
    """The unit on the screen of readings in a `unit`; curvature is in 1/m."""
    return SHOWN_UNITS[unit][1] if layout.reads else unit


def scales_of(layout: SensorLayout) -> tuple[Array, str]:
    """The scale (k,) from SI units to the screen's of each kind of reading, and all units."""
    scales = np.array([SHOWN_UNITS[unit][0] for unit in layout.kind_units])
    units = dict.fromkeys(screen_unit(layout, unit) for unit in layout.kind_units)
    return scales, ", ".join(units)


def traced_title(of: ReportedQuantity, layout: SensorLayout) -> str:
    """The title of what is drawn over time of a quantity."""
    return "Reading" if layout.reads and of.name == "curvature" else of.traced


class ElementPanel(QWidget):
    """Facts, history and spectrum of an element; `plot_toggled` requests its trace or removal."""

    plot_toggled = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.title, self.facts = Label(_NONE, rich=True), Label(rich=True)
        for label in (self.title, self.facts):
            label.setWordWrap(True)
            label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.button = QPushButton("Plo&t")
        self.button.setToolTip("Add this element to the traces (Ctrl+Alt+T), or remove it.")
        self.button.clicked.connect(lambda *_: self.plot_toggled.emit())
        self.button.setEnabled(False)
        self._names, self._scales = list(COMPONENTS), np.ones(len(COMPONENTS))
        self.histories = [
            Chart(ChartAxis(of.traced, of.unit), _AGO, _TRACE.format(f"{of.traced} (xx, yy, xy)"))
            for of in TRACED
        ]
        self.spectrum = Chart(ChartAxis("Amplitude", TRACED[0].unit), _FREQUENCY, _SPECTRUM)
        left = QVBoxLayout()
        for widget in (self.title, self.facts):
            left.addWidget(widget)
        left.addWidget(self.button, 0, Qt.AlignmentFlag.AlignLeft)
        left.addStretch(1)
        around = QHBoxLayout(self)
        around.setContentsMargins(8, 4, 8, 6)
        around.addLayout(left, 4)
        for plot in (*self.histories, self.spectrum):
            around.addWidget(plot, 3)

    def show_layout(self, layout: SensorLayout) -> None:
        """Name and scale what the elements of a layout read."""
        self._names, (self._scales, unit) = layout.kind_names, scales_of(layout)
        for of, plot in zip(TRACED, self.histories, strict=True):
            names = f"{traced_title(of, layout)} ({', '.join(self._names)})"
            plot.show_axes(ChartAxis(traced_title(of, layout), unit), _AGO, _TRACE.format(names))
        self.spectrum.show_axes(ChartAxis("Amplitude", unit), _FREQUENCY, _SPECTRUM)

    def show_facts(self, title: str, facts: str) -> None:
        """Write the title and facts of the element; empty for none."""
        for label, text in ((self.title, title or _NONE), (self.facts, facts)):
            if text != label.text():
                label.setText(text)
        self.button.setEnabled(bool(title))

    def show_plotted(self, plotted: bool) -> None:
        self.button.setText("Stop plo&tting" if plotted else "Plo&t")

    def show_history(self, times: Array, values: Array) -> None:
        """Draw `values` (T, n k) of k quantities at `times` (T,) in s up to now."""
        count = len(self._names)
        for number, plot in enumerate(self.histories):
            plot.show_series(
                [
                    Series(name, times, self._scales[n] * values[:, count * number + n], n)
                    for n, name in enumerate(self._names)
                ]
            )

    def show_spectrum(self, frequencies: Array, amplitudes: Array) -> None:
        """Draw `amplitudes` (n, F) in SI units at `frequencies` (F,) in Hz, or a note without."""
        each = zip(self._names, self._scales.tolist(), amplitudes, strict=True)
        self.spectrum.show_series(
            [
                Series(name, frequencies, scale * amplitude, n)
                for n, (name, scale, amplitude) in enumerate(each)
            ],
            "Not enough readings yet.",
        )


class Traces(QWidget):
    """A plot for each quantity read, with a curve for each element; `pointed` emits the element."""

    pointed = Signal(int)

    def __init__(self) -> None:
        super().__init__()
        self._around = QHBoxLayout(self)
        self._around.setContentsMargins(8, 4, 8, 6)
        self.plots: list[Chart] = []
        self._scales = np.ones(len(COMPONENTS) * len(TRACED))
        self._show_plots([(f"{of.traced} {name}", of.unit) for of in TRACED for name in COMPONENTS])

    def _show_plots(self, titles: Sequence[tuple[str, str]]) -> None:
        """Have a plot for each title and unit."""
        for plot in self.plots[len(titles) :]:
            plot.deleteLater()
        del self.plots[len(titles) :]
        for plot, (title, unit) in zip(self.plots, titles, strict=False):
            plot.show_axes(ChartAxis(title, unit), _AGO, _TRACE.format(title))
        for title, unit in titles[len(self.plots) :]:
            plot = Chart(ChartAxis(title, unit), _AGO, _TRACE.format(title))
            self._around.addWidget(plot)
            plot.pointed.connect(self._point)
            self.plots.append(plot)

    def _point(self, point: ChartPoint | None) -> None:
        self.pointed.emit(-1 if point is None else point.series.key)

    def show_layout(self, layout: SensorLayout) -> None:
        """Have a plot for each quantity that the elements of a layout read."""
        scales, _ = scales_of(layout)
        units = [screen_unit(layout, unit) for unit in layout.kind_units]
        kinds = list(zip(layout.kind_names, units, strict=True))
        self._show_plots(
            [(f"{traced_title(of, layout)} {n}", u) for of in TRACED for n, u in kinds]
        )
        self._scales = np.tile(scales, len(TRACED))

    def show_history(self, elements: Sequence[int], times: Array, values: Array) -> None:
        """Draw `values` (T, plots, k) of k `elements` at `times` (T,) in s up to now."""
        for row, plot in enumerate(self.plots):
            curves = [
                Series(str(element), times, self._scales[row] * values[:, row, n], n, key=element)
                for n, element in enumerate(elements)
            ]
            plot.show_series(curves, _NONE_PLOTTED)

    def mark(self, element: int) -> None:
        for plot in self.plots:
            plot.mark(element)
