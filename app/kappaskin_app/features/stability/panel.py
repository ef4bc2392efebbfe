"""How well the elements see each shape, and hard cases to try at a click."""

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from kappaskin.live import Status
from kappaskin_app.features.stability.demonstrations import DEMONSTRATIONS
from kappaskin_app.features.stability.observability import Seeing
from kappaskin_app.features.stability.plots import ModeMap, SpectrumPlot
from kappaskin_app.guard import guarded
from kappaskin_app.shell.badge import in_use
from kappaskin_app.shell.settings import Settings
from kappaskin_app.theme import ALERT, FAINT, follow_look, grown
from kappaskin_app.widgets.parts import ELLIPSIS, button, sentence, text_label

_COLUMNS = 3
_SHAPE = 210  # px wide
_GRID = 65  # points of a map along each side
_REAL = "The hard cases are for the simulation inside the app (Ctrl+M)."
_TRY = "Hard cases to try; Back undoes each in one step."


class StabilityPanel(QWidget):
    """The singular values, the shape chosen among them, and demonstrations.

    `demonstrated` brings the one asked for, `back` asks to undo, and `shown` says that another
    shape, or none, is to be drawn on the skin.
    """

    demonstrated = Signal(object)
    back = Signal()
    shown = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.plot, self.map = SpectrumPlot(), ModeMap()
        self.words, self.told, self.refused = text_label(), text_label(), text_label()
        self.number = QSpinBox()
        self.number.setObjectName("shape-number")
        self.number.setKeyboardTracking(False)
        self.number.setToolTip("Which shape to look at, the best seen one first.")
        self.of, self.how_seen = QLabel(), text_label()
        self.on_skin = QCheckBox("Show on the skin")
        self.on_skin.setChecked(True)
        self.on_skin.setToolTip(
            "Colour the skin above by this shape instead of what is measured, while this panel is "
            "seen. Where all are seen alike, only by one that you choose."
        )
        self.buttons = [
            button(demonstration.title, f"demonstration-{number}", demonstration.told)
            for number, demonstration in enumerate(DEMONSTRATIONS)
        ]
        self.undo = button("Back", "back", "Undo the hard case that came last (Ctrl+Z).")
        self._seeing: Seeing | None = None
        self._told, self._simulating = _TRY, True
        self._lay_out()
        self._wire()
        self.refused.setForegroundRole(ALERT)
        self.told.setForegroundRole(FAINT)
        follow_look(self, lambda: self._shape.setFixedWidth(grown(_SHAPE)))

    def _lay_out(self) -> None:
        pick = QHBoxLayout()
        label = QLabel("S&hape")
        label.setBuddy(self.number)
        for widget in (label, self.number, self.of):
            pick.addWidget(widget)
        pick.addStretch(1)
        middle = QVBoxLayout()
        middle.setSpacing(3)
        middle.addLayout(pick)
        middle.addWidget(self.map, 1)
        middle.addWidget(self.how_seen)
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
        foot = QHBoxLayout()
        foot.addWidget(self.told, 1)
        foot.addWidget(self.undo, 0, Qt.AlignmentFlag.AlignTop)
        right.addLayout(foot)
        around = QHBoxLayout(self)
        around.setContentsMargins(8, 4, 8, 6)
        around.addWidget(self.plot, 3)
        around.addWidget(shape)
        around.addLayout(right, 5)

    def _wire(self) -> None:
        for widget, demonstration in zip(self.buttons, DEMONSTRATIONS, strict=True):
            widget.clicked.connect(
                guarded(lambda *_, asked=demonstration: self.demonstrated.emit(asked))
            )
        self.undo.clicked.connect(guarded(lambda *_: self.back.emit()))
        self.on_skin.toggled.connect(guarded(lambda *_: self.shown.emit()))

    def attend(self, seeing: Seeing) -> None:
        """Show what `seeing` computes, and pass on which shape the user chooses."""
        self._seeing = seeing
        seeing.changed.connect(guarded(self._show))
        self.plot.chosen.connect(guarded(seeing.choose))
        self.number.valueChanged.connect(guarded(seeing.choose))

    def show_settings(self, settings: Settings) -> None:
        holding = next((case for case in DEMONSTRATIONS if case.holds(settings)), None)
        self._told = _TRY if holding is None else holding.told
        self._show_told()

    def show_undo(self, possible: bool) -> None:
        """Whether there is a step to go back."""
        self.undo.setEnabled(possible)

    def show_status(self, status: Status, simulating: bool) -> None:
        if self._simulating != simulating:
            self._simulating = simulating
            for widget in self.buttons:
                widget.setEnabled(simulating)
            self._show_told()
        text = in_use(status)
        if text != self.refused.text():
            self.refused.setText(text)
            self.refused.setVisible(bool(text))

    def _show_told(self) -> None:
        self.told.setText(self._told if self._simulating else _REAL)

    def _show(self) -> None:
        now = self._seeing
        if now is None:
            return
        spectrum, number = now.spectrum, now.chosen
        empty = sentence(now.refusal) or f"Computing{ELLIPSIS}"
        self.plot.show_spectrum(spectrum, number, empty)
        self.words.setText("" if spectrum is None else spectrum.describe())
        self.number.setEnabled(spectrum is not None)
        with QSignalBlocker(self.number):
            self.number.setRange(1, 1 if spectrum is None else len(spectrum.values))
            self.number.setValue(max(number, 1))
        self.of.setText("" if spectrum is None else f"of {len(spectrum.values)}")
        self.how_seen.setText("" if spectrum is None else spectrum.told(number))
        surface = None if spectrum is None else spectrum.surface(number, _GRID, _GRID)
        self.map.show_surface(surface, None if spectrum is None else spectrum.layout)
        self.shown.emit()
