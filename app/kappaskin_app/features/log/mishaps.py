"""What goes wrong inside: counted at the window's foot, listed, and reported if a person likes."""

from typing import TYPE_CHECKING

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QToolButton

from kappaskin_app import guard
from kappaskin_app.features.log.events import Happenings
from kappaskin_app.features.log.reporting import ReportDialog, Told
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import Actions
from kappaskin_app.shell.logbook import log_folder
from kappaskin_app.shell.settings_text import settings_text
from kappaskin_app.theme import Theme

if TYPE_CHECKING:
    from kappaskin_app.shell.window import MainWindow

REPORT_TIP = "Save what helps to find out what went wrong, in one file"
_TIP = (
    "Things that went wrong inside, while the rest goes on. Click to read them in the Log; "
    "Help > Report saves what helps to find out why."
)


class Mishaps(QObject):
    """Counts what a `window` caught: `count` shows it, `report` saves what helps to mend it."""

    def __init__(self, window: "MainWindow", events: Happenings) -> None:
        super().__init__(window)
        self._window, self.events = window, events
        self.failures = 0
        self.count = QToolButton()
        self.count.setToolTip(_TIP)
        self.count.setAccessibleName("No failures")
        self.count.clicked.connect(guarded(lambda *_: window.docks.reveal("log")))
        self.count.hide()
        self.report = ReportDialog(self._tell, log_folder(), window)
        guard.on_failure(self._take)

    def add_actions(self, actions: Actions, menu: str) -> None:
        """Register what a person can do."""
        actions.add(
            "report", menu, "&Report\N{HORIZONTAL ELLIPSIS}", self.report.ask, "", REPORT_TIP
        )

    def _take(self, words: str) -> None:
        self.failures += 1
        self.count.setText(f"{self.failures} failure{'s' if self.failures > 1 else ''}")
        self.count.setAccessibleName(f"{self.count.text()}: read them")
        self.count.show()
        self.events.note("failure", words)
        self._window.tell(words)

    def _tell(self, with_readings: bool) -> Told:
        window, session = self._window, self._window.session
        sensor = session.status.sensor
        state = {
            "state": session.badge(),
            "source": session.source,
            "sensor": f"{sensor.name}, firmware {sensor.firmware}" if sensor else "none",
            "frames": f"{session.status.rate:.0f}/s, {session.status.accounting.lost} lost",
            "failures": self.failures,
        }
        texts = {
            "settings.json": settings_text(window.history.settings),
            "happened.txt": self.events.list.toPlainText(),
            "state.txt": "".join(f"{name}: {value}\n" for name, value in state.items()),
        }
        return Told(texts, session.estimate if with_readings else None)

    def show_theme(self, theme: Theme) -> None:
        self.count.setStyleSheet(f"color: {theme.alert};")

    def close(self) -> None:
        guard.forget(self._take)
        self.report.close()
