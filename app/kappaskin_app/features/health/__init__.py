"""Health of the channels, and a test of their map."""

from kappaskin_app.features.health.panel import HealthPanel
from kappaskin_app.features.health.press import MapTesting, Resting
from kappaskin_app.guard import guarded
from kappaskin_app.shell.window import MainWindow

_ABOUT = "Which channels are dead, stuck, noisy, swapped or drifting, and what that costs"


class HealthFeature:
    name = "health"

    def install(self, shell: MainWindow) -> None:
        session, selection = shell.session, shell.selection
        self.health, self.testing = HealthPanel(), MapTesting(shell)
        self.resting = Resting(session, self.testing)
        shell.docks.put_below(
            "health", "Health", self.health, "F3", _ABOUT, layouts={"Calibrate": 0.3}
        )
        session.reported.connect(guarded(self.testing.follow))
        session.reported.connect(
            guarded(lambda status: self.health.show_status(status, session.inside))
        )
        session.estimated.connect(guarded(self.testing.receive))
        self.testing.begun.connect(guarded(self.resting.hold))
        session.playing.connect(guarded(lambda *_: self.testing.running and self.resting.hold()))
        self.testing.changed.connect(guarded(self.resting.let_go))
        self.testing.asked.connect(guarded(selection.ask_for))
        self.health.pointed.connect(guarded(selection.point))
        self.health.attend(self.testing)
