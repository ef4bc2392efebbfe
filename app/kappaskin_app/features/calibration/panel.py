"""Calibration panels: the calibration in use, and the procedure of a new one."""

from pathlib import Path

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import QFileDialog, QPushButton, QWidget

from kappaskin.calibration import Calibration
from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin.scenes.cylinders import radii_for
from kappaskin_app.features.calibration.controller import CalibrationController, parsed_radii
from kappaskin_app.features.calibration.pages import (
    EQUATION_8,
    CylinderStepPage,
    ResultPage,
    StartPage,
)
from kappaskin_app.features.calibration.weights import FILES
from kappaskin_app.guard import guarded
from kappaskin_app.shell.folders import proposed, recordings_folder
from kappaskin_app.shell.panel import Panel
from kappaskin_app.shell.settings import Settings, calibration_text
from kappaskin_app.widgets.parts import (
    ELLIPSIS,
    button,
    in_a_row,
    sentence,
    text_label,
)


class InUsePanel(Panel):
    """The calibration in use."""

    purpose = (
        "The calibration that converts readings to curvature, and its match with the connected "
        "sensor."
    )
    guide_page = "calibrate"

    def __init__(self) -> None:
        super().__init__("In use")
        self.what = text_label()
        self.load = button(f"Load{ELLIPSIS}", "load", "Use a calibration from a file.")
        self.stop = button("Stop using", "stop", "Return to nominal readings (Ctrl+Z undoes).")
        self.body.addWidget(self.what)
        self.body.addLayout(in_a_row(self.load, self.stop))
        self._calibration: Calibration | None = None
        self._status, self._in_progress, self._file_refused = Status(), False, ""

    def connect_to(self, controller: CalibrationController) -> None:
        def load() -> None:
            path, _ = QFileDialog.getOpenFileName(
                self, "Load a calibration", str(recordings_folder()), FILES
            )
            if path:
                controller.load(Path(path))

        self.load.clicked.connect(guarded(lambda *_: load()))
        self.stop.clicked.connect(guarded(lambda *_: controller.stop_using()))
        controller.changed.connect(guarded(lambda: self._note(controller)))

    def _note(self, controller: CalibrationController) -> None:
        self._in_progress = controller.procedure is not None
        self._file_refused = controller.file_refused
        self._show()

    def show_settings(self, settings: Settings) -> None:
        self._calibration = settings.calibration
        self.stop.setEnabled(self._calibration is not None)
        self._show()

    def show_status(self, status: Status, simulating: bool) -> None:
        self._status = status
        self._show()

    def _show(self) -> None:
        found, sensor = self._calibration, self._status.sensor
        alarm = ""
        if found is None:
            text = "None: readings are nominal (Eq. 8)."
        else:
            text = f"{found.name} {found.serial_number},\n{calibration_text(found)}"
            if self._in_progress:
                alarm = "Not in use during a calibration."
            elif sensor is not None:
                alarm = _unfit(found, self._status)
        if text != self.what.text():
            self.what.setText(text)
            self.what.setToolTip(EQUATION_8 if found is None else "")
        if self._file_refused:
            self.show_message(sentence(self._file_refused))
        else:
            self.show_message(alarm, hint=self._in_progress)


def _unfit(calibration: Calibration, status: Status) -> str:
    """Reason why a calibration is not in use with the connected sensor, or empty."""
    if status.sensor is None:
        return ""
    try:
        calibration.check(status.sensor)
    except Refusal as refusal:
        return f"Not in use: {refusal}."
    return ""


class CalibratePanel(Panel):
    """Procedure of a calibration on cylinders, and its result."""

    purpose = (
        "The skin is laid on cylinders one by one, where \u03ba = 1 / R determines the gain and "
        "offset of each channel."
    )
    guide_page = "calibrate"

    def __init__(self) -> None:
        super().__init__("Cylinders of known radius")
        self.start, self.steps, self.result_page = StartPage(), CylinderStepPage(), ResultPage()
        for page in (self.start, self.steps, self.result_page):
            self.body.addWidget(page)
        self._controller: CalibrationController | None = None
        self._status = Status()
        self._connection = 0
        self._phase: QWidget = self.start
        self._show_page()
        for editor in (self.start.seconds, self.start.hold):
            editor.valueChanged.connect(self._plan)
        self.start.radii.textChanged.connect(self._plan)

    def connect_to(self, controller: CalibrationController) -> None:
        """Show the progress of `controller`, and pass the user's requests to it."""
        self._controller = controller
        start, steps, result_page = self.start, self.steps, self.result_page
        controller.changed.connect(guarded(self._show))
        for pressed, request in (
            (start.begin, self._begin),
            (steps.capture, controller.capture),
            (steps.redo, controller.redo),
            (steps.cancel, controller.cancel),
            (steps.all, self._toggle_all),
            (result_page.use, controller.use),
            (result_page.leave, controller.discard),
            (result_page.save, self._save),
        ):
            pressed.clicked.connect(guarded(lambda *_, request=request: request()))

    def show_status(self, status: Status, simulating: bool) -> None:
        self._status = status
        self.steps.all.setVisible(simulating)
        self.start.begin.setEnabled(status.sensor is not None and status.state == "streaming")
        if status.sensor is not None and status.connections != self._connection:
            self._connection = status.connections
            read = () if status.sensor.layout.reads else radii_for(status.sensor)
            radii = ", ".join(f"{1e3 * radius:g}" for radius in read)
            with QSignalBlocker(self.start.radii):
                self.start.radii.setText(radii)
                self.start.radii.setCursorPosition(0)
            self._plan()

    def _plan(self, *_: object) -> None:
        sensor = self._status.sensor
        self.start.show_plan(None if sensor is None else sensor.layout)

    def _begin(self) -> None:
        if self._controller is None:
            return
        try:
            radii = parsed_radii(self.start.radii.text())
        except Refusal as refusal:
            self.show_message(sentence(str(refusal)))
            return
        self._controller.begin(radii, self.start.seconds.value(), self.start.hold.value())

    def _toggle_all(self) -> None:
        if self._controller is not None:
            now = self._controller
            (now.pause if now.automatic else now.capture_all)()

    def _save(self) -> None:
        if self._controller is None or self._controller.result is None:
            return
        found = self._controller.result.report.calibration
        name = f"{found.serial_number}-{found.date.astimezone():%Y%m%d}.calibration.toml"
        path, _ = QFileDialog.getSaveFileName(
            self, "Save the calibration", str(proposed(name)), FILES
        )
        if path:
            self._controller.save(Path(path))

    def _show(self) -> None:
        now = self._controller
        if now is None:
            return
        phase = self.steps if now.procedure else self.result_page if now.result else self.start
        if now.procedure:
            self.steps.show_step(now, now.procedure, now.step)
        elif now.result:
            self.result_page.show_result(now.result)
        self.show_message(sentence(now.message or now.done), hint=not now.message)
        if phase is not self._phase:
            self._phase = phase
            self._show_page()
            if self.isVisible():
                self._first_button().setFocus()

    def _first_button(self) -> QPushButton:
        return {
            self.start: self.start.begin,
            self.steps: self.steps.capture,
            self.result_page: self.result_page.use,
        }[self._phase]

    def _show_page(self) -> None:
        for page in (self.start, self.steps, self.result_page):
            page.setVisible(page is self._phase)
