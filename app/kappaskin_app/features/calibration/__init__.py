"""Calibration on cylinders, and tare."""

from functools import partial
from pathlib import Path

from kappaskin.calibration import TareStore
from kappaskin.errors import Refusal
from kappaskin_app.features.calibration.controller import Calibrating
from kappaskin_app.features.calibration.panel import CalibratePanel, InUsePanel
from kappaskin_app.features.calibration.tare import TarePanel, Taring
from kappaskin_app.guard import guarded
from kappaskin_app.shell.opening import Kind
from kappaskin_app.shell.pages import CALIBRATE, LIVE
from kappaskin_app.shell.parts import SOURCE
from kappaskin_app.shell.window import MainWindow

_CHECKSUM = "sha256"  # the line that a calibration has and a scene has not
_HEAD = 4096  # characters, among which it is

_LAYOUT = "The page Calibrate, and the health of the elements below the skin"
_TARE = "Let what every element reads now be its zero: \u03ba = reading \u2212 zero"
_CALIBRATE = "The page that guides through cylinders of known radius R, where \u03ba = 1 / R"
_TAKE = "Take the mean of what comes in now for the cylinder that is asked for"


class CalibrationFeature:
    name = "calibration"

    def install(self, shell: MainWindow) -> None:
        self._shell, panels = shell, shell.panels
        self.calibrating = Calibrating(shell.history, shell.tasks, shell)
        tares = TareStore(TareStore.user_folder())
        self.taring = Taring(shell.history, shell.session.engine, tares, shell)
        self.tare = panels.add(LIVE, TarePanel())
        self.in_use = panels.add(CALIBRATE, InUsePanel())
        self.calibrate = panels.add(CALIBRATE, CalibratePanel())
        shell.layouts.add("Calibrate", _LAYOUT, CALIBRATE)
        self._wire_calibration(shell)
        self._wire_tare(shell)
        self._add_actions(shell)

    def _wire_calibration(self, shell: MainWindow) -> None:
        session, calibrating = shell.session, self.calibrating
        calibrating.laid.connect(guarded(session.lay))
        session.reported.connect(guarded(calibrating.follow))
        session.estimated.connect(guarded(calibrating.receive))
        self.calibrate.attend(calibrating)
        self.in_use.attend(calibrating)
        calibrating.used.connect(guarded(shell.opening.note))
        shell.opening.add(
            Kind("calibration", (".toml",), self._use, is_calibration, needs_sensor=True)
        )

    def _wire_tare(self, shell: MainWindow) -> None:
        taring, calibrating = self.taring, self.calibrating
        allow = shell.actions_by_name.allow
        shell.session.reported.connect(guarded(taring.follow))
        taring.changed.connect(guarded(lambda: allow("tare", taring.why_not)))
        calibrating.changed.connect(
            guarded(lambda: taring.stand_aside(calibrating.procedure is not None))
        )
        self.tare.attend(taring)
        taring.told.connect(guarded(shell.tell))

    def _add_actions(self, shell: MainWindow) -> None:
        add, take = shell.actions_by_name.add, self.calibrating.take
        add("tare", SOURCE, "Ta&re", self.taring.tare, "Ctrl+0", _TARE)
        show = partial(shell.panels.reveal, self.calibrate)
        add("calibrate", SOURCE, "C&alibrate", show, "Ctrl+L", _CALIBRATE)
        words = "Cap&ture a step of the calibration"
        add("take-step", SOURCE, words, take, "Ctrl+Shift+K", _TAKE)

    def _use(self, file: Path) -> None:
        self.calibrating.load(file)
        self._shell.tell(self.calibrating.file_refused or f"Using the calibration {file.name}")


def is_calibration(file: Path) -> bool:
    """Whether a TOML file is a calibration; refused where it cannot be read."""
    try:
        with file.open(encoding="utf-8", errors="replace") as text:
            return any(line.startswith(_CHECKSUM) for line in text.read(_HEAD).splitlines())
    except OSError as error:
        raise Refusal(
            f"{file}: cannot be read ({error.strerror}); check its name and who may read it"
        ) from error
