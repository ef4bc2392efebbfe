"""The badge and the numbers across the whole window, and between them what is recorded."""

from PySide6.QtWidgets import QToolBar

from kappaskin.recording import Written
from kappaskin_app.features.contact.readouts import Readouts
from kappaskin_app.features.recording.recording_mark import RecordingMark
from kappaskin_app.shell.badge import Badge


class Header(QToolBar):
    """Holds `badge`, `mark` and `readouts`."""

    def __init__(self, badge: Badge, mark: RecordingMark, readouts: Readouts) -> None:
        super().__init__("Header")
        self.setObjectName("header")
        self.setMovable(False)
        self.toggleViewAction().setEnabled(False)
        self.addWidget(badge)
        self._mark, self._shown = mark, self.addWidget(mark)
        self._shown.setVisible(False)
        self.addWidget(readouts)

    def show_written(self, written: Written, ended: str) -> None:
        """Show that something is recorded, or that it ended by itself."""
        self._shown.setVisible(written.active or bool(ended))
        self._mark.show_written(written, ended)
