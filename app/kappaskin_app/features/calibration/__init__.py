"""Calibration on cylinders of known radius and with known weights, and tare."""

from functools import partial
from pathlib import Path

from kappaskin.calibration import TareStore, Weighing
from kappaskin.errors import Refusal
from kappaskin.scenes import Scene
from kappaskin_app.features.calibration.controller import CalibrationController, WeightController
from kappaskin_app.features.calibration.panel import CalibratePanel, InUsePanel
from kappaskin_app.features.calibration.tare import TareController, TarePanel
from kappaskin_app.features.calibration.weights import WeightsPanel
from kappaskin_app.guard import guarded
from kappaskin_app.shell.opening import Kind
from kappaskin_app.shell.pages import CALIBRATE, LIVE
from kappaskin_app.shell.parts import SOURCE
from kappaskin_app.shell.window import MainWindow

_CHECKSUM = "sha256"  # a key of calibration files that scene files lack
_HEAD = 4096  # characters of a file that contain the key

_LAYOUT = "Page Calibrate, with Health below the skin"
_TARE = "Set the present readings as zero: \u03ba = reading \u2212 zero"
_CALIBRATE = "Calibration on cylinders of known radius R, where \u03ba = 1 / R"
_CAPTURE = "Capture the mean reading for the present cylinder or weight"


class CalibrationFeature:
    name = "calibration"

    def install(self, shell: MainWindow) -> None:
        self._shell, panels = shell, shell.panels
        self.calibration = CalibrationController(shell.history, shell.tasks, shell)
        self.weighing = WeightController(shell.history, shell.tasks, shell)
        tares = TareStore(TareStore.user_folder())
        self.tare_controller = TareController(shell.history, shell.session, tares, shell)
        self.tare = panels.add(LIVE, TarePanel())
        self.in_use = panels.add(CALIBRATE, InUsePanel())
        self.calibrate = panels.add(CALIBRATE, CalibratePanel())
        self.weights = panels.add(CALIBRATE, WeightsPanel())
        shell.layouts.add("Calibrate", _LAYOUT, CALIBRATE)
        self._wire_calibration(shell)
        self._wire_weights(shell)
        self._wire_tare(shell)
        self._add_actions(shell)

    def _wire_calibration(self, shell: MainWindow) -> None:
        session, controller = shell.session, self.calibration
        controller.step_requested.connect(guarded(session.lay))
        session.reported.connect(guarded(controller.follow))
        session.estimated.connect(guarded(controller.receive))
        self.calibrate.connect_to(controller)
        self.in_use.connect_to(controller)
        controller.used.connect(guarded(shell.opening.note))
        shell.opening.add(
            Kind("calibration", (".toml",), self._use, is_calibration, needs_sensor=True)
        )

    def _wire_weights(self, shell: MainWindow) -> None:
        session, controller = shell.session, self.weighing
        self._bare = session.scene
        controller.step_requested.connect(guarded(self._lay_weight))
        session.reported.connect(guarded(controller.follow))
        session.estimated.connect(guarded(controller.receive))
        session.playing.connect(guarded(self._change_scene))
        self.weights.connect_to(controller)
        controller.used.connect(guarded(shell.opening.note))

    def _change_scene(self, scene: Scene) -> None:
        self._bare = scene
        if self.weighing.procedure and not self.weighing.computing:
            self.weighing.cancel("The scene was changed: start again.")

    def _lay_weight(self, weighing: Weighing | None) -> None:
        """Lay the present weight on a simulated skin; at the end what lay on it before."""
        session = self._shell.session
        if weighing is not None and not weighing.step:
            self._bare = session.scene
        if session.inside:
            session.move(weighing.laid(self._bare) if weighing else self._bare)

    def _wire_tare(self, shell: MainWindow) -> None:
        tare_controller = self.tare_controller
        allow = shell.actions_by_name.allow
        shell.session.reported.connect(guarded(tare_controller.follow))
        tare_controller.changed.connect(guarded(lambda: allow("tare", tare_controller.why_not)))
        for each in (self.calibration, self.weighing):
            each.changed.connect(guarded(self._note_calibrating))
        self.tare.connect_to(tare_controller)
        tare_controller.reported.connect(guarded(shell.notify))

    def _note_calibrating(self) -> None:
        procedures = self.calibration.procedure, self.weighing.procedure
        calibrating = any(each is not None for each in procedures)
        self.tare_controller.set_calibrating(calibrating)
        self._shell.session.set_calibrating(calibrating)

    def _add_actions(self, shell: MainWindow) -> None:
        add = shell.actions_by_name.add
        add("tare", SOURCE, "Ta&re", self.tare_controller.tare, "Ctrl+0", _TARE)
        show = partial(shell.panels.reveal, self.calibrate)
        add("calibrate", SOURCE, "C&alibrate", show, "Ctrl+L", _CALIBRATE)
        words = "Cap&ture a step of the calibration"
        add("take-step", SOURCE, words, self._capture, "Ctrl+Shift+K", _CAPTURE)

    def _capture(self) -> None:
        self.calibration.capture()
        self.weighing.capture()

    def _use(self, file: Path) -> None:
        self.calibration.load(file)
        self._shell.notify(self.calibration.file_refused or f"Using the calibration {file.name}")


def is_calibration(file: Path) -> bool:
    """Whether a TOML file is a calibration; raises Refusal where it cannot be read."""
    try:
        with file.open(encoding="utf-8", errors="replace") as text:
            return any(line.startswith(_CHECKSUM) for line in text.read(_HEAD).splitlines())
    except OSError as error:
        raise Refusal(
            f"{file}: cannot be read ({error.strerror}); check its name and permissions"
        ) from error
