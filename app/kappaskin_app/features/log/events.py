"""What happened on the line: each event in passing, and the last of them in a window."""

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

from kappaskin.frames import Event
from kappaskin.live import Status

_KEPT = 64
_NOTHING = "Nothing yet. Here stands when a device came, went, lost messages or began anew."


class EventLog(QDialog):
    """Lists the last events, newest first; `told` brings each new one in words."""

    told = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("event_log")
        self.setWindowTitle("What happened")
        self.resize(720, 320)
        self._event_count = 0
        self._lines: deque[str] = deque(maxlen=_KEPT)
        self.list = QPlainTextEdit(readOnly=True, placeholderText=_NOTHING)  # pyright: ignore[reportCallIssue]
        self.list.setLineWrapMode(QPlainTextEdit.LineWrapMode.WidgetWidth)
        self.list.setAccessibleName("What happened, newest first")
        self.list.setToolTip("Each with its time of day; the last 64 are kept.")
        self.copy_button = QPushButton("&Copy all")
        self.copy_button.setToolTip("Copy the list as text.")
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        for button in buttons.buttons():
            button.setIcon(QIcon())  # no other button has one
            button.setToolTip("Put this away (Esc); F4 brings it back.")
        buttons.addButton(self.copy_button, QDialogButtonBox.ButtonRole.ActionRole)
        buttons.rejected.connect(self.reject)
        self.copy_button.clicked.connect(
            lambda: QGuiApplication.clipboard().setText(self.list.toPlainText())
        )
        layout = QVBoxLayout(self)
        layout.addWidget(self.list)
        layout.addWidget(buttons)

    def follow(self, status: Status) -> None:
        """Take up what happened since the last time."""
        new = status.events[max(0, len(status.events) - status.event_count + self._event_count) :]
        if status.event_count == self._event_count or not new:
            return
        self._event_count = status.event_count
        self._add(new)
        self.told.emit("; ".join(dict.fromkeys(_sentence(event.text) for event in new[-2:])))

    def note(self, kind: str, text: str) -> None:
        """Take up something that no device told."""
        self._add([Event(time.monotonic(), kind, text)])

    def _add(self, events: Sequence[Event]) -> None:
        self._lines.extendleft(line for line in _lines(events))
        self.list.setPlainText("\n".join(self._lines))

    def open_list(self) -> None:
        self.show()
        self.raise_()
        self.list.setFocus()


def _lines(events: Sequence[Event]) -> list[str]:
    """Each event with the time of day at which it happened."""
    off = time.time() - time.monotonic()
    return [
        f"{time.strftime('%H:%M:%S', time.localtime(off + event.time))}  {event.kind}:  "
        f"{event.text}"
        for event in events
    ]


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]
