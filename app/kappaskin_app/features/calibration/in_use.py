"""Says which calibration the readings are corrected by."""

from pathlib import Path

from PySide6.QtWidgets import QFileDialog, QWidget

from kappaskin.calibration import Calibration
from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin_app.features.calibration.calibrating import Calibrating
from kappaskin_app.guard import guarded
from kappaskin_app.shell.panel import Panel
from kappaskin_app.shell.settings import Settings
from kappaskin_app.widgets.parts import (
    ELLIPSIS,
    EQUATION_8,
    FILES,
    button,
    in_a_row,
    said,
    sentence,
    text_label,
)


class InUsePanel(Panel):
    """Says which calibration the readings are corrected by."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("In use", parent)
        self.what = text_label()
        self.load = button(f"Load{ELLIPSIS}", "load", "Use a calibration from a file.")
        self.stop = button(
            "Stop using", "stop", "Show nominal curvature again (Ctrl+Z takes it back)."
        )
        self.body.addWidget(self.what)
        self.body.addLayout(in_a_row(self.load, self.stop))
        self._calibration: Calibration | None = None
        self._status, self._calibrating, self._file_refused = Status(), False, ""

    def attend(self, calibrating: Calibrating) -> None:
        def load() -> None:
            path, _ = QFileDialog.getOpenFileName(self, "Load a calibration", "", FILES)
            if path:
                calibrating.load(Path(path))

        self.load.clicked.connect(guarded(lambda *_: load()))
        self.stop.clicked.connect(guarded(lambda *_: calibrating.stop_using()))
        calibrating.changed.connect(guarded(lambda: self._note(calibrating)))

    def _note(self, calibrating: Calibrating) -> None:
        self._calibrating = calibrating.procedure is not None
        self._file_refused = calibrating.file_refused
        self._tell()

    def show_settings(self, settings: Settings) -> None:
        self._calibration = settings.calibration
        self.stop.setEnabled(self._calibration is not None)
        self._tell()

    def show_status(self, status: Status, simulating: bool) -> None:
        self._status = status
        self._tell()

    def _tell(self) -> None:
        found, sensor = self._calibration, self._status.sensor
        alarm = ""
        if found is None:
            text = "Nothing: readings are nominal curvature (Eq. 8)."
        else:
            text = f"{found.name} {found.serial_number},\n{said(found)}"
            if self._calibrating:
                alarm = "Not while calibrating."
            elif sensor is not None:
                alarm = _unfit(found, self._status)
        if text != self.what.text():
            self.what.setText(text)
            self.what.setToolTip(EQUATION_8 if found is None else "")
        if self._file_refused:
            self.show_message(sentence(self._file_refused))
        else:
            self.show_message(alarm, hint=self._calibrating)


def _unfit(calibration: Calibration, status: Status) -> str:
    """Why a calibration is not in use with the sensor that is connected, or nothing."""
    if status.sensor is None:
        return ""
    try:
        calibration.check(status.sensor)
    except Refusal as refusal:
        return f"Not in use: {refusal}."
    return ""
