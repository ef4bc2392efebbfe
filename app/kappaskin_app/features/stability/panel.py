"""Panel of the observability of the modes, with hard cases to try."""

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QGridLayout,
    QHBoxLayout,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from kappaskin.live import Status
from kappaskin_app.features.stability.demonstrations import DEMONSTRATIONS
from kappaskin_app.features.stability.observability import Observability
from kappaskin_app.features.stability.plots import ModeMap, SpectrumPlot
from kappaskin_app.guard import guarded
from kappaskin_app.shell.badge import in_use
from kappaskin_app.shell.settings import Settings
from kappaskin_app.theme import ALERT, FAINT, follow_look, grown
from kappaskin_app.widgets.parts import ELLIPSIS, Label, button, sentence, text_label

_COLUMNS = 3
_MODE_WIDTH = 210  # px
_GRID = 65  # points of a map along each side
_REAL = "The hard cases need the simulated skin (Ctrl+M)."
_TRY = "Hard cases to try; Back undoes the last one."


class StabilityPanel(QWidget):
    """The singular values, the selected mode, and the hard cases.

    `demonstrated` requests a hard case, `back` requests undo, and `shown` reports another mode,
    or none.
    """

    demonstrated = Signal(object)
    back = Signal()
    shown = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.plot, self.map = SpectrumPlot(), ModeMap()
        self.words, self.explanation, self.refused = text_label(), text_label(), text_label()
        self.number = QSpinBox()
        self.number.setObjectName("shape-number")
        self.number.setKeyboardTracking(False)
        self.number.setToolTip("Number of the mode, the most observable one first.")
        self.of, self.mode_text = Label(), text_label()
        self.on_skin = QCheckBox("Show on the skin")
        self.on_skin.setChecked(True)
        self.on_skin.setToolTip(
            "Colour the skin by this mode instead of the measurement, while this panel is visible. "
            "If all modes are equally observable, only after one was selected."
        )
        self.buttons = [
            button(demonstration.title, f"demonstration-{number}", demonstration.text)
            for number, demonstration in enumerate(DEMONSTRATIONS)
        ]
        self.undo = button("Back", "back", "Undo the last hard case (Ctrl+Z).")
        self._observability: Observability | None = None
        self._text, self._simulating = _TRY, True
        self._lay_out()
        self._wire()
        self.refused.setForegroundRole(ALERT)
        self.explanation.setForegroundRole(FAINT)
        follow_look(self, lambda: self._shape.setFixedWidth(grown(_MODE_WIDTH)))

    def _lay_out(self) -> None:
        selection = QHBoxLayout()
        label = Label("M&ode")
        label.setBuddy(self.number)
        for widget in (label, self.number, self.of):
            selection.addWidget(widget)
        selection.addStretch(1)
        middle = QVBoxLayout()
        middle.setSpacing(3)
        middle.addLayout(selection)
        middle.addWidget(self.map, 1)
        middle.addWidget(self.mode_text)
        middle.addWidget(self.on_skin)
        shape = QWidget()
        middle.setContentsMargins(0, 0, 0, 0)
        shape.setLayout(middle)
        self._shape = shape
        grid = QGridLayout()
        grid.setSpacing(4)
        for number, widget in enumerate(self.buttons):
            grid.addWidget(widget, *divmod(number, _COLUMNS))
        right = QVBoxLayout()
        right.setSpacing(4)
        right.addWidget(self.words)
        right.addWidget(self.refused)
        right.addStretch(1)
        right.addLayout(grid)
        bottom = QHBoxLayout()
        bottom.addWidget(self.explanation, 1)
        bottom.addWidget(self.undo, 0, Qt.AlignmentFlag.AlignTop)
        right.addLayout(bottom)
        around = QHBoxLayout(self)
        around.setContentsMargins(8, 4, 8, 6)
        around.addWidget(self.plot, 3)
        around.addWidget(shape)
        around.addLayout(right, 5)

    def _wire(self) -> None:
        for widget, demonstration in zip(self.buttons, DEMONSTRATIONS, strict=True):
            widget.clicked.connect(
                guarded(lambda *_, case=demonstration: self.demonstrated.emit(case))
            )
        self.undo.clicked.connect(guarded(lambda *_: self.back.emit()))
        self.on_skin.toggled.connect(guarded(lambda *_: self.shown.emit()))

    def connect_to(self, observability: Observability) -> None:
        """Show the results of `observability`, and pass on the mode that the user selects."""
        self._observability = observability
        observability.changed.connect(guarded(self._show))
        self.plot.chosen.connect(guarded(observability.select))
        self.number.valueChanged.connect(guarded(observability.select))

    def show_settings(self, settings: Settings) -> None:
        case = next((case for case in DEMONSTRATIONS if case.holds(settings)), None)
        self._text = _TRY if case is None else case.text
        self._show_explanation()

    def show_undo(self, possible: bool) -> None:
        """Enable Back where the last step is a hard case."""
        self.undo.setEnabled(possible)

    def show_status(self, status: Status, simulating: bool) -> None:
        if self._simulating != simulating:
            self._simulating = simulating
            for widget in self.buttons:
                widget.setEnabled(simulating)
            self._show_explanation()
        text = in_use(status)
        if text != self.refused.text():
            self.refused.setText(text)
            self.refused.setVisible(bool(text))

    def _show_explanation(self) -> None:
        self.explanation.setText(self._text if self._simulating else _REAL)

    def _show(self) -> None:
        now = self._observability
        if now is None:
            return
        spectrum, number = now.spectrum, now.number
        empty = sentence(now.refusal) or f"Computing{ELLIPSIS}"
        self.plot.show_spectrum(spectrum, number, empty)
        self.words.setText("" if spectrum is None else spectrum.describe())
        self.number.setEnabled(spectrum is not None)
        with QSignalBlocker(self.number):
            self.number.setRange(1, 1 if spectrum is None else len(spectrum.values))
            self.number.setValue(max(number, 1))
        self.of.setText("" if spectrum is None else f"of {len(spectrum.values)}")
        self.mode_text.setText("" if spectrum is None else spectrum.mode_text(number))
        surface = None if spectrum is None else spectrum.surface(number, _GRID, _GRID)
        self.map.show_surface(surface, None if spectrum is None else spectrum.layout)
        self.shown.emit()
