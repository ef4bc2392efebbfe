"""Operator: moves the simulated hand or a robot, and feels what its fingers do."""

from kappaskin_app.features.operator.control import OperatorControl
from kappaskin_app.features.operator.panel import OperatorPanel
from kappaskin_app.guard import guarded
from kappaskin_app.shell.settings.operation import PAD
from kappaskin_app.shell.window import MainWindow

_ABOUT = "Moves a simulated hand or a robot with mouse, keys, a gamepad or a glove by UDP"


class OperatorFeature:
    name = "operator"

    def install(self, shell: MainWindow) -> None:
        self.operator = panel = OperatorPanel()
        self.control = control = OperatorControl(shell.history, {PAD: panel.pad})
        shell.docks.put_below("operator", "Operator", panel, "Ctrl+Alt+O", _ABOUT, height=0.36)
        shell.panels.join(panel.form)
        shell.settings_shown.connect(guarded(panel.show_settings))
        panel.shown.connect(guarded(control.set_visible))
        panel.enabled.connect(guarded(control.switch))
        panel.gripped.connect(guarded(control.set_grip))
        panel.pad.stopped.connect(guarded(lambda: control.switch(False)))
        control.switched.connect(guarded(panel.show_enabled))
        control.reported.connect(guarded(lambda s: panel.show_status(s, control.trouble)))
        control.refused.connect(guarded(shell.notify))
        shell.closing.connect(guarded(control.close))
