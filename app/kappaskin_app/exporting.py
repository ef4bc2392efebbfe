"""A recording to a file that other programs read, asked for in a dialog and written beside it."""

import math
from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QDoubleSpinBox,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from kappaskin import Exported, Exporting, Refusal, Setup, Wanted
from kappaskin_app.guard import guarded

_POLL = 100  # ms
_LONGEST = 1e6  # s
_RECORDINGS = "Recording (*.mcap)"
_FORMATS = (
    "Table, every program reads it (*.csv);;Table for NumPy (*.npz);;Table in HDF5 (*.h5);;"
    "Surface for ParaView, PyVista (*.vtp);;Series of surfaces for ParaView (*.pvd);;"
    "Surface for CAD (*.stl)"
)


class ExportDialog(QDialog):
    """Asks what of a recording is to be written where, and writes it."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("export")
        self.setWindowTitle("Export a recording")
        self.setMinimumWidth(560)
        self.recording, self.to = QLineEdit(), QLineEdit()
        self.settings = QComboBox()
        self.settings.addItems(["As they were recorded", "As they are now"])
        self.begin, self.until = _seconds("the beginning"), _seconds("the end")
        self.every, self.at = _seconds("every frame"), _seconds("")
        self.bar, self.words = QProgressBar(), QLabel()
        self.bar.setRange(0, 1000)
        self.words.setWordWrap(True)
        self.export_button, self.cancel_button = QPushButton("&Export"), QPushButton("&Cancel")
        self.choose_recording = _choosing(self._choose_recording)
        self.choose_file = _choosing(self._choose_file)
        for button in (self.choose_recording, self.choose_file, self.cancel_button):
            button.setAutoDefault(False)  # or Enter in a line would press the first of them
        self._setup = Setup()
        self._exporting: Exporting | None = None
        self._timer = QTimer(self)
        self._timer.setInterval(_POLL)
        self._lay_out()
        self._timer.timeout.connect(guarded(self._follow))
        self.export_button.clicked.connect(guarded(lambda *_: self._begin()))
        self.cancel_button.clicked.connect(guarded(lambda *_: self.cancel()))
        self.to.textChanged.connect(guarded(lambda *_: self._allow()))
        self.recording.textChanged.connect(guarded(lambda *_: self._allow()))
        self.every.valueChanged.connect(guarded(lambda *_: self._allow()))
        self._allow()

    def _lay_out(self) -> None:
        form, layout = QFormLayout(), QVBoxLayout(self)
        for words, line, button in (
            ("&Recording", self.recording, self.choose_recording),
            ("&File", self.to, self.choose_file),
        ):
            form.addRow(_named(words, line), _beside(line, button))
        form.addRow("&Settings", self.settings)
        form.addRow("Fr&om", self.begin)
        form.addRow("&Until", self.until)
        form.addRow("E&very", self.every)
        form.addRow("&At", self.at)
        buttons = QHBoxLayout()
        buttons.addStretch()
        buttons.addWidget(self.export_button)
        buttons.addWidget(self.cancel_button)
        layout.addLayout(form)
        layout.addWidget(self.bar)
        layout.addWidget(self.words)
        layout.addLayout(buttons)

    def ask(self, source: str, at: float, setup: Setup) -> None:
        """Ask what of the recording that is replayed, if one is, `at` s of it, is to be written."""
        if self._exporting is None:
            self._setup = setup
            if source.startswith("replay:"):
                self.recording.setText(source.removeprefix("replay:"))
                self.at.setValue(at)
            self.words.clear()
            self.bar.reset()
        self.show()
        self.raise_()
        (self.to if self.recording.text() else self.recording).setFocus()

    def _choose_recording(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, "Export a recording", "", _RECORDINGS)
        if name:
            self.recording.setText(name)

    def _choose_file(self) -> None:
        name, kind = QFileDialog.getSaveFileName(self, "Export to", "", _FORMATS)
        if name:
            path = Path(name)
            self.to.setText(str(path if path.suffix else path.with_suffix(kind[-5:-1])))

    @property
    def _at_once(self) -> bool:
        """Whether one moment is wanted, and not a span."""
        suffix = Path(self.to.text()).suffix.lower()
        return suffix == ".vtp" or (suffix == ".stl" and not self.every.value())

    def _allow(self) -> None:
        """Ask only for what makes sense."""
        busy = self._exporting is not None
        one, suffix = self._at_once, Path(self.to.text()).suffix.lower()
        for widget in (self.begin, self.until):
            widget.setEnabled(not busy and not one)
        self.every.setEnabled(not busy and suffix != ".vtp")
        self.at.setEnabled(not busy and one)
        choose = self.choose_recording, self.choose_file
        for widget in (self.recording, self.to, self.settings, *choose):
            widget.setEnabled(not busy)
        named = bool(self.recording.text().strip() and self.to.text().strip())
        self.export_button.setEnabled(named and not busy)
        self.cancel_button.setText("&Cancel" if busy else "C&lose")

    @property
    def wanted(self) -> Wanted:
        """What is asked for; a `Refusal` where that makes no file."""
        setup = self._setup if self.settings.currentIndex() else None
        files = Path(self.recording.text().strip()), Path(self.to.text().strip())
        if self._at_once:
            return Wanted(*files, at=self.at.value(), setup=setup)
        until = self.until.value() or math.inf
        return Wanted(*files, self.begin.value(), until, self.every.value(), setup=setup)

    def _begin(self) -> None:
        self.bar.reset()
        try:
            self._exporting = Exporting(self.wanted)
        except Refusal as refusal:
            self._end(str(refusal))
            return
        self.words.setText("Writing\N{HORIZONTAL ELLIPSIS}")
        self.bar.setValue(0)
        self._timer.start()
        self._allow()

    def _follow(self) -> None:
        if self._exporting is None:
            return
        try:
            for told in self._exporting.poll():
                if isinstance(told, Exported):
                    self.bar.setValue(self.bar.maximum())
                    files = ", ".join(map(str, self._exporting.files))
                    self._end(f"Written: {files} ({told.words})")
                    return
                self.bar.setValue(round(self.bar.maximum() * told))
        except Refusal as refusal:
            self.bar.reset()
            self._end(str(refusal))

    @property
    def writing(self) -> bool:
        return self._exporting is not None

    def cancel(self) -> None:
        """End what is written, or close."""
        if self._exporting is None:
            self.reject()
        else:
            self.bar.reset()
            self._end("Cancelled; nothing was written.")

    def _end(self, words: str) -> None:
        """Be done, in `words`."""
        self._timer.stop()
        if self._exporting is not None:
            self._exporting.close()
            self._exporting = None
        self.words.setText(words)
        high = self.heightForWidth(self.width())
        self.resize(self.width(), max(self.height(), high))  # or the fields would be pressed flat
        self._allow()

    def done(self, result: int) -> None:
        if self._exporting is not None:
            self.cancel()
        super().done(result)


def _seconds(nothing: str) -> QDoubleSpinBox:
    """A field for s, whose least value is called `nothing`."""
    field = QDoubleSpinBox()
    field.setRange(0.0, _LONGEST)
    field.setDecimals(3)
    field.setSuffix(" s")
    field.setSpecialValueText(nothing)
    return field


def _named(words: str, line: QLineEdit) -> QLabel:
    label = QLabel(words)
    label.setBuddy(line)
    return label


def _choosing(choose: Callable[[], None]) -> QPushButton:
    button = QPushButton("Choose\N{HORIZONTAL ELLIPSIS}")
    button.clicked.connect(guarded(lambda *_: choose()))
    return button


def _beside(line: QLineEdit, button: QPushButton) -> QHBoxLayout:
    layout = QHBoxLayout()
    layout.addWidget(line, 1)
    layout.addWidget(button)
    return layout
