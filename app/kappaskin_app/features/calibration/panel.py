"""The calibration panels: which calibration is in use, and the way to a new one."""

from pathlib import Path

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import QFileDialog, QPushButton, QWidget

from kappaskin.calibration import Calibration
from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin.scenes.cylinders import radii_for
from kappaskin_app.features.calibration.controller import Calibrating, parsed_radii
from kappaskin_app.features.calibration.pages import Outcome, Start, Steps
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

    purpose = (
        "The calibration that turns readings into curvatures now, if there is one, and how well it "
        "fits this sensor."
    )
    guide_page = "calibrate"

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


class CalibratePanel(Panel):
    """Guides through a calibration on cylinders, and shows what came of it."""

    purpose = (
        "Lays the skin on cylinders one after the other: there \u03ba = 1 / R, so that each "
        "channel's gain and offset follow."
    )
    guide_page = "calibrate"

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Cylinders of known radius", parent)
        self.start, self.steps, self.outcome = Start(), Steps(), Outcome()
        for page in (self.start, self.steps, self.outcome):
            self.body.addWidget(page)
        self._calibrating: Calibrating | None = None
        self._status = Status()
        self._meeting = 0
        self._phase: QWidget = self.start
        self._show_page()
        for editor in (self.start.seconds, self.start.hold):
            editor.valueChanged.connect(self._plan)
        self.start.radii.textChanged.connect(self._plan)

    def attend(self, calibrating: Calibrating) -> None:
        """Show how `calibrating` goes, and pass on what the user requests."""
        self._calibrating = calibrating
        start, steps, outcome = self.start, self.steps, self.outcome
        calibrating.changed.connect(guarded(self._show))
        for pressed, wish in (
            (start.begin, self._begin),
            (steps.take, calibrating.take),
            (steps.redo, calibrating.redo),
            (steps.cancel, calibrating.cancel),
            (steps.all, self._take_all),
            (outcome.use, calibrating.use),
            (outcome.leave, calibrating.leave),
            (outcome.save, self._save),
        ):
            pressed.clicked.connect(guarded(lambda *_, wish=wish: wish()))

    def show_status(self, status: Status, simulating: bool) -> None:
        self._status = status
        self.steps.all.setVisible(simulating)
        self.start.begin.setEnabled(status.sensor is not None and status.state == "streaming")
        if status.sensor is not None and status.meetings != self._meeting:
            self._meeting = status.meetings
            radii = ", ".join(f"{1e3 * radius:g}" for radius in radii_for(status.sensor))
            with QSignalBlocker(self.start.radii):
                self.start.radii.setText(radii)
                self.start.radii.setCursorPosition(0)
            self._plan()

    def _plan(self, *_: object) -> None:
        sensor = self._status.sensor
        self.start.show_plan(sensor is not None and sensor.layout.patch.strip)

    def _begin(self) -> None:
        if self._calibrating is None:
            return
        try:
            radii = parsed_radii(self.start.radii.text())
        except Refusal as refusal:
            self.show_message(sentence(str(refusal)))
            return
        self._calibrating.begin(radii, self.start.seconds.value(), self.start.hold.value())

    def _take_all(self) -> None:
        if self._calibrating is not None:
            now = self._calibrating
            (now.pause if now.unattended else now.take_all)()

    def _save(self) -> None:
        if self._calibrating is None or self._calibrating.result is None:
            return
        found = self._calibrating.result.report.calibration
        name = f"{found.serial_number}-{found.date.astimezone():%Y%m%d}.calibration.toml"
        path, _ = QFileDialog.getSaveFileName(self, "Save the calibration", name, FILES)
        if path:
            self._calibrating.save(Path(path))

    def _show(self) -> None:
        now = self._calibrating
        if now is None:
            return
        phase = self.steps if now.procedure else self.outcome if now.result else self.start
        if now.procedure:
            self.steps.show_step(now, now.procedure, now.step)
        elif now.result:
            self.outcome.show_result(now.result)
        self.show_message(sentence(now.message or now.done), hint=not now.message)
        if phase is not self._phase:
            self._phase = phase
            self._show_page()
            if self.isVisible():
                self._firstbutton().setFocus()

    def _firstbutton(self) -> QPushButton:
        return {
            self.start: self.start.begin,
            self.steps: self.steps.take,
            self.outcome: self.outcome.use,
        }[self._phase]

    def _show_page(self) -> None:
        for page in (self.start, self.steps, self.outcome):
            page.setVisible(page is self._phase)
