"""The log panel: messages by level, to copy and clear."""

import logging
import time
from collections import deque
from dataclasses import dataclass

from PySide6.QtGui import QColor, QGuiApplication
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from kappaskin_app.guard import PrintableFormatter, guarded, log
from kappaskin_app.theme import current, follow_look
from kappaskin_app.widgets.parts import Label
from kappaskin_app.widgets.table import Table

_KEPT = 1000


@dataclass(frozen=True)
class LogLine:
    """A log message: its `time` (s since 1970), its level, its first line and all of it."""

    time: float
    level: int
    text: str
    whole: str

    @property
    def clock(self) -> str:
        return time.strftime("%H:%M:%S", time.localtime(self.time))

    @property
    def word(self) -> str:
        return logging.getLevelName(self.level).lower()


class LogBuffer(logging.Handler):
    """Collects the last `lines`, `count` in all, from any thread, until closed."""

    def __init__(self) -> None:
        super().__init__()
        self.setFormatter(PrintableFormatter("%(message)s"))
        self.lines: deque[LogLine] = deque(maxlen=_KEPT)
        self.count = 0
        self._level = log.level
        log.setLevel(logging.INFO)  # status messages too
        logging.getLogger().addHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        try:
            text, whole = record.getMessage().partition("\n")[0], self.format(record)
        except Exception:  # arguments that do not fit the format; the caller must go on
            self.handleError(record)
            return
        error = record.exc_info[1] if record.exc_info else None
        if error is not None:
            text += f": {type(error).__name__}: {error}".partition("\n")[0]
        self.lines.append(LogLine(record.created, record.levelno, text, whole))
        self.count += 1

    def clear(self) -> None:
        self.lines.clear()
        self.count += 1  # so that the panel notices the change

    def close(self) -> None:
        logging.getLogger().removeHandler(self)
        log.setLevel(self._level)
        super().close()


_HEAD = ("Time", "Level", "Text")
_LEVELS = (
    ("All messages", logging.NOTSET),
    ("Warnings and errors", logging.WARNING),
    ("Errors", logging.ERROR),
)
_NOTHING = "No messages of this level since the window opened."


class LogPanel(QWidget):
    """Lists the messages of a `buffer`, newest first."""

    def __init__(self, buffer: LogBuffer) -> None:
        super().__init__()
        self._buffer, self._seen = buffer, -1
        self._lines: list[LogLine] = []
        self.level, self.nothing = QComboBox(), Label(_NOTHING)
        for words, level in _LEVELS:
            self.level.addItem(words, level)
        self.level.setAccessibleName("Level")
        self.level.setToolTip("Lowest level of the messages listed.")
        self.level.currentIndexChanged.connect(guarded(lambda *_: self._fill()))
        self.copy, self.clear = QPushButton("&Copy list"), QPushButton("C&lear")
        self.copy.setToolTip("Copy the listed messages with all their lines, as text.")
        self.clear.setToolTip("Clear the list; the log file still has these messages.")
        self.copy.clicked.connect(guarded(lambda *_: self._copy()))
        self.clear.clicked.connect(guarded(lambda *_: self._clear()))
        self.table = Table("log", "Log, newest first", _HEAD, stretched=(len(_HEAD) - 1,))
        self.table.setSelectionBehavior(Table.SelectionBehavior.SelectRows)
        self.table.setWordWrap(False)
        row, column = QHBoxLayout(), QVBoxLayout(self)
        for widget in (self.level, self.copy, self.clear):
            row.addWidget(widget)
        row.addStretch(1)
        column.addLayout(row)
        column.addWidget(self.nothing)
        column.addWidget(self.table, 1)
        follow_look(self, self._fill)

    def look(self) -> None:
        """List new messages, while it is visible."""
        if self.isVisible() and self._seen != self._buffer.count:
            self._fill()

    def _fill(self) -> None:
        self._seen = self._buffer.count
        least = self.level.currentData()
        self._lines = [line for line in reversed(list(self._buffer.lines)) if line.level >= least]
        self.table.fit_rows(len(self._lines))
        for row, line in enumerate(self._lines):
            colour = QColor(current().alert if line.level >= logging.WARNING else current().text)
            for column, text in enumerate((line.clock, line.word, line.text)):
                self.table.write(row, column, text, line.whole).setForeground(colour)
        self.table.setVisible(bool(self._lines))
        self.nothing.setVisible(not self._lines)
        for button in (self.copy, self.clear):
            button.setEnabled(bool(self._lines))

    def _copy(self) -> None:
        each = (f"{line.clock} {line.word}: {line.whole}" for line in self._lines)
        QGuiApplication.clipboard().setText("\n".join(each))

    def _clear(self) -> None:
        self._buffer.clear()
        self._fill()
