"""The badge and the numbers across the whole window, and between them what is recorded."""

from PySide6.QtWidgets import QToolBar

from kappaskin.recording import RecordingStatus
from kappaskin_app.views.badge import Badge
from kappaskin_app.views.readouts import Readouts
from kappaskin_app.views.recording_mark import RecordingMark


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

    def show_written(self, written: RecordingStatus, ended: str) -> None:
        """Show that something is recorded, or that it ended by itself."""
        self._shown.setVisible(written.active or bool(ended))
        self._mark.show_written(written, ended)
