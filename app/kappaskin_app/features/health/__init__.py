"""Health: faulty channels, and the press test of the channel map."""

from kappaskin_app.features.health.panel import HealthPanel
from kappaskin_app.features.health.press import ChannelMapTest, LoadHold
from kappaskin_app.guard import guarded
from kappaskin_app.shell.window import MainWindow

_ABOUT = "Channels that are dead, stuck, noisy, swapped or drifting, and the loss of accuracy"


class HealthFeature:
    name = "health"

    def install(self, shell: MainWindow) -> None:
        session, selection = shell.session, shell.selection
        self.health, self.press_test = HealthPanel(), ChannelMapTest(shell)
        self.load_hold = LoadHold(session, self.press_test)
        shell.docks.put_below(
            "health", "Health", self.health, "F3", _ABOUT, layouts={"Calibrate": 0.3}
        )
        session.reported.connect(guarded(self.press_test.follow))
        session.reported.connect(
            guarded(lambda status: self.health.show_status(status, session.inside))
        )
        session.estimated.connect(guarded(self.press_test.receive))
        self.press_test.started.connect(guarded(self.load_hold.hold))
        session.playing.connect(
            guarded(lambda *_: self.press_test.running and self.load_hold.hold())
        )
        self.press_test.changed.connect(guarded(self.load_hold.release))
        self.press_test.target_changed.connect(guarded(selection.mark_target))
        self.health.pointed.connect(guarded(selection.point))
        self.health.connect_to(self.press_test)
