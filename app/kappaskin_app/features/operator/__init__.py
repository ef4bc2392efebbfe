"""Operator: moves the simulated hand or a robot, and feels what its fingers do."""

from kappaskin.hand import OperatorStatus
from kappaskin_app.features.operator.control import OperatorControl
from kappaskin_app.features.operator.driving import HandDriving
from kappaskin_app.features.operator.feeling import Feeling
from kappaskin_app.features.operator.panel import OperatorPanel
from kappaskin_app.guard import guarded
from kappaskin_app.shell.settings.operation import GAMEPAD
from kappaskin_app.shell.sound import Sound
from kappaskin_app.shell.window import MainWindow

_ABOUT = "Moves a simulated hand or a robot with mouse, keys, a gamepad or a glove by UDP"


class OperatorFeature:
    name = "operator"

    def install(self, shell: MainWindow) -> None:
        self._shell = shell
        self.operator = panel = OperatorPanel()
        self.driving = driving = HandDriving(shell.session, shell.tasks)
        self.control = control = OperatorControl(shell.history, panel.pad, driving.begin)
        self.feeling, self.tones = Feeling(shell.session), Sound(control)
        shell.docks.put_below("operator", "Operator", panel, "Ctrl+Alt+R", _ABOUT, height=0.36)
        shell.panels.join(panel.form)
        shell.settings_shown.connect(guarded(panel.show_settings))
        control.followers.append(driving.follow)
        driving.reported.connect(guarded(panel.show_hand))
        panel.shown.connect(guarded(control.set_visible))
        panel.enabled.connect(guarded(control.switch))
        panel.gripped.connect(guarded(control.set_grip))
        panel.pad.stopped.connect(guarded(lambda: control.switch(False)))
        control.switched.connect(guarded(panel.show_enabled))
        control.reported.connect(guarded(self._follow))
        control.refused.connect(guarded(shell.notify))
        control.ended.connect(guarded(self._rest))
        self.feeling.felt.connect(guarded(self._feel))
        self.tones.ended.connect(guarded(self._report_no_sound))
        shell.closing.connect(guarded(control.close))
        shell.closing.connect(guarded(driving.close))

    def _follow(self, status: OperatorStatus) -> None:
        self.operator.show_status(status)
        settings = self._shell.history.settings
        rumbles = settings.operator_rumble and settings.operator_input == GAMEPAD
        self.feeling.set_active(settings.operator_tones or rumbles, settings.felt_at_most)
        if settings.operator_tones != self.tones.on:
            self._report_no_sound(self.tones.toggle())

    def _feel(self, shares: list[float]) -> None:
        self.tones.set_levels(*shares)
        rumbles = self._shell.history.settings.operator_rumble
        self.control.rumble = max(shares, default=0.0) if rumbles else 0.0

    def _rest(self) -> None:
        """Feel nothing more."""
        self.feeling.set_active(False, self._shell.history.settings.felt_at_most)
        self.tones.close()

    def _report_no_sound(self, why: str) -> None:
        """Report why there is no sound, and try no more."""
        if why:
            self._shell.notify(why)
            self._shell.requests.set("operator_tones", False)
