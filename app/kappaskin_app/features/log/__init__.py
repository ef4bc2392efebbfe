"""Log, events on the line, errors and the report."""

from kappaskin_app.features.log.errors import Mishaps
from kappaskin_app.features.log.events import Happenings
from kappaskin_app.features.log.panel import Logged, LogPanel
from kappaskin_app.guard import guarded
from kappaskin_app.shell.parts import HELP, SOURCE
from kappaskin_app.shell.window import MainWindow


class LogFeature:
    name = "log"

    def install(self, shell: MainWindow) -> None:
        session, display = shell.session, shell.display
        self.logged = Logged()
        self.log, self.happenings = LogPanel(self.logged), Happenings(shell)
        self.mishaps = Mishaps(shell, self.happenings)
        shell.docks.put_below("log", "Log", self.log, "Ctrl+Alt+G")
        display.foot.add(self.mishaps.count)
        session.reported.connect(guarded(self.happenings.follow))
        session.reported.connect(guarded(lambda *_: self.log.look()))
        display.badge.clicked.connect(guarded(self.happenings.open_list))
        self.happenings.told.connect(guarded(shell.tell))
        for part in (self.log, self.mishaps):
            shell.theme_changed.connect(guarded(part.show_theme))
        show = self.happenings.open_list
        shell.actions_by_name.add("happenings", SOURCE, "E&vent log", show, "F4")
        self.mishaps.add_actions(shell.actions_by_name, HELP)
        shell.closing.connect(guarded(self.mishaps.close))
        shell.closed.connect(guarded(self.logged.close))
