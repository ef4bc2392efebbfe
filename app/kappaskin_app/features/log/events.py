"""The event log: connections, lost messages, restarts."""

import time
from collections import deque
from collections.abc import Sequence

from PySide6.QtCore import Signal
from PySide6.QtGui import QGuiApplication, QIcon
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QPlainTextEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from kappaskin._text import printable
from kappaskin.frames import Event
from kappaskin.live import Status
from kappaskin_app.widgets.parts import capital

_KEPT = 64
_NOTHING = "No events. Connections, lost messages and restarts are listed here."


class EventLog(QDialog):
    """Lists the last events, newest first; `notified` brings new ones as text."""

    notified = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("event_log")
        self.setWindowTitle("Event log")
        self.resize(720, 320)
        self._seen = 0
        self._lines: deque[str] = deque(maxlen=_KEPT)
        self.list = QPlainTextEdit(readOnly=True, placeholderText=_NOTHING)  # pyright: ignore[reportCallIssue]
        self.list.setLineWrapMode(QPlainTextEdit.LineWrapMode.WidgetWidth)
        self.list.setAccessibleName("Event log, newest first")
        self.list.setToolTip("The last 64 events, each with its time of day.")
        self.copy_button = QPushButton("&Copy all")
        self.copy_button.setToolTip("Copy the list as text.")
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        for button in buttons.buttons():
            button.setIcon(QIcon())  # no other button has one
            button.setToolTip("Close (Esc); F4 opens it again.")
        buttons.addButton(self.copy_button, QDialogButtonBox.ButtonRole.ActionRole)
        buttons.rejected.connect(self.reject)
        self.copy_button.clicked.connect(
            lambda: QGuiApplication.clipboard().setText(self.list.toPlainText())
        )
        layout = QVBoxLayout(self)
        layout.addWidget(self.list)
        layout.addWidget(buttons)

    def follow(self, status: Status) -> None:
        """Add the events since the last status."""
        new = status.events[max(0, len(status.events) - status.event_count + self._seen) :]
        if status.event_count == self._seen or not new:
            return
        self._seen = status.event_count
        self._add(new)
        self.notified.emit("; ".join(dict.fromkeys(capital(event.text) for event in new[-2:])))

    def note(self, kind: str, text: str) -> None:
        """Add an event of the app itself."""
        self._add([Event(time.monotonic(), kind, text)])

    def _add(self, events: Sequence[Event]) -> None:
        self._lines.extendleft(line for line in _lines(events))
        self.list.setPlainText("\n".join(self._lines))

    def open_list(self) -> None:
        self.show()
        self.raise_()
        self.list.setFocus()


def _lines(events: Sequence[Event]) -> list[str]:
    """A line for each event, with its time of day."""
    off = time.time() - time.monotonic()
    return [
        f"{time.strftime('%H:%M:%S', time.localtime(off + event.time))}  {event.kind}:  "
        f"{printable(event.text)}"
        for event in events
    ]
