"""The log, the event log, errors and the report."""

from kappaskin_app.features.log.errors import Errors
from kappaskin_app.features.log.events import EventLog
from kappaskin_app.features.log.panel import LogBuffer, LogPanel
from kappaskin_app.guard import guarded
from kappaskin_app.shell.parts import HELP, SOURCE
from kappaskin_app.shell.window import MainWindow

_EVENTS = "Connections, lost messages and restarts, newest first"

_ABOUT = "Messages and errors since the window opened, newest first"


class LogFeature:
    name = "log"

    def install(self, shell: MainWindow) -> None:
        self._shell, session, display = shell, shell.session, shell.display
        self.log_buffer = LogBuffer()
        self.log, self.event_log = LogPanel(self.log_buffer), EventLog(shell)
        self.errors = Errors(shell, self.event_log)
        shell.docks.put_below("log", "Log", self.log, "Ctrl+Alt+G", _ABOUT)
        display.status_bar.add(self.errors.count)
        session.reported.connect(guarded(self.event_log.follow))
        session.reported.connect(guarded(lambda *_: self.log.look()))
        display.badge.clicked.connect(guarded(self.event_log.open_list))
        self.event_log.notified.connect(guarded(self._notify))
        show = self.event_log.open_list
        # Saved shortcuts know the action by its first name.
        shell.actions_by_name.add("happenings", SOURCE, "E&vent log", show, "F4", _EVENTS)
        self.errors.add_actions(shell.actions_by_name, HELP)
        shell.closing.connect(guarded(self.errors.close))
        shell.closed.connect(guarded(self.log_buffer.close))

    def _notify(self, text: str) -> None:
        """Show the newest events below, unless they are in sight in a panel."""
        if not self._shell.session.in_sight(text):
            self._shell.notify(text)
