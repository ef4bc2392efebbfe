"""Element panel: facts, history and spectrum of one element; traces of several."""

from collections.abc import Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QVBoxLayout, QWidget

from kappaskin.frames import COMPONENTS, Array
from kappaskin.pipeline import REPORTED
from kappaskin_app.widgets.parts import Label
from kappaskin_app.widgets.plots import Curve, CurvePlot

TRACED = tuple(quantity for quantity in REPORTED if quantity.traced)
_NONE = "Click an element, on the skin or in a heatmap."
_NONE_PLOTTED = "Click an element, then Plot in its panel (Ctrl+Alt+E)."
_TRACE = "{} over the last 10 s, in every computed frame, up to 500 per second."
_SPECTRUM = (
    "Amplitude of the sine that fits the last 10 s best at each frequency, by least squares "
    "(Lomb-Scargle), up to half the frame rate. Mains hum is a line."
)


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
        self.histories = [
            CurvePlot(of.traced, of.unit, True, _TRACE.format(f"{of.traced} (xx, yy, xy)"))
            for of in TRACED
        ]
        self.spectrum = CurvePlot("Amplitude", TRACED[0].unit, False, _SPECTRUM)
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

    def show_facts(self, title: str, facts: str) -> None:
        """Write the title and facts of the element; empty for none."""
        for label, text in ((self.title, title or _NONE), (self.facts, facts)):
            if text != label.text():
                label.setText(text)
        self.button.setEnabled(bool(title))

    def show_plotted(self, plotted: bool) -> None:
        self.button.setText("Stop plo&tting" if plotted else "Plo&t")

    def show_history(self, times: Array, values: Array, seconds: float) -> None:
        """Draw `values` (T, 3 k) of k quantities at `times` (T,) in s up to now."""
        for number, plot in enumerate(self.histories):
            curves = [
                Curve(name, n, values[:, 3 * number + n]) for n, name in enumerate(COMPONENTS)
            ]
            plot.show_curves(times, curves, (-seconds, 0.0), "s")

    def show_spectrum(self, frequencies: Array, amplitudes: Array) -> None:
        """Draw `amplitudes` (3, F) in 1/m at `frequencies` (F,) in Hz, or a note without any."""
        curves = [Curve(name, n, amplitudes[n]) for n, name in enumerate(COMPONENTS)]
        if not len(frequencies):
            self.spectrum.show_curves(frequencies, (), (0.0, 1.0), "Hz", "Not enough readings yet.")
            return
        span = (0.0, float(frequencies[-1]))
        self.spectrum.show_curves(frequencies, curves, span, "Hz")


class Traces(QWidget):
    """A plot for each component with a curve for each element; `pointed` emits the element."""

    pointed = Signal(int)

    def __init__(self) -> None:
        super().__init__()
        titles = [(f"{of.traced} {name}", of.unit) for of in TRACED for name in COMPONENTS]
        self.plots = [CurvePlot(title, unit, True, _TRACE.format(title)) for title, unit in titles]
        around = QHBoxLayout(self)
        around.setContentsMargins(8, 4, 8, 6)
        for plot in self.plots:
            around.addWidget(plot)
            plot.pointed.connect(self.pointed)

    def show_history(
        self, elements: Sequence[int], times: Array, values: Array, seconds: float
    ) -> None:
        """Draw `values` (T, plots, k) of k `elements` at `times` (T,) in s up to now."""
        for row, plot in enumerate(self.plots):
            curves = [
                Curve(str(element), n, values[:, row, n], element)
                for n, element in enumerate(elements)
            ]
            plot.show_curves(times, curves, (-seconds, 0.0), "s", _NONE_PLOTTED)

    def mark(self, element: int) -> None:
        for plot in self.plots:
            plot.mark(element)
