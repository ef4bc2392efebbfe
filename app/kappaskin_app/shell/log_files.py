"""What goes wrong, to files in the user's log folder that a report takes along."""

import faulthandler
import logging
import os
import sys
import threading
from datetime import datetime
from logging.handlers import RotatingFileHandler
from pathlib import Path
from types import TracebackType

import platformdirs
from PySide6.QtCore import QMessageLogContext, QtMsgType, qInstallMessageHandler

from kappaskin_app import guard

LOG, CRASHES = "kappaskin.log", "crashes.log"
_LARGEST, _OLDER = 1_000_000, 3  # bytes of one file, and how many older ones are kept
_LINE = "%(asctime)s %(process)d %(levelname)s %(name)s: %(message)s"
_LEVELS = {
    QtMsgType.QtDebugMsg: logging.DEBUG,
    QtMsgType.QtInfoMsg: logging.INFO,
    QtMsgType.QtWarningMsg: logging.WARNING,
    QtMsgType.QtCriticalMsg: logging.ERROR,
    QtMsgType.QtFatalMsg: logging.CRITICAL,
}


def log_folder() -> Path:
    """Where this user's log files are."""
    return platformdirs.user_log_path("kappaskin", appauthor=False)


class Logbook:
    """Writes warnings, exceptions that nobody caught, Qt's messages and crashes into a `folder`."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self._handlers = (
            RotatingFileHandler(
                folder / LOG, maxBytes=_LARGEST, backupCount=_OLDER, encoding="utf-8"
            ),
            logging.StreamHandler(),  # as without a log
        )
        for handler in self._handlers:
            handler.setLevel(logging.WARNING)
            handler.setFormatter(logging.Formatter(_LINE))
            logging.getLogger().addHandler(handler)
        self._crashes = (folder / CRASHES).open("a", encoding="utf-8")
        self._crashes.write(f"{datetime.now():%Y-%m-%d %H:%M:%S} begun as {os.getpid()}\n")
        self._crashes.flush()
        faulthandler.enable(self._crashes)
        self._hooks = sys.excepthook, threading.excepthook
        sys.excepthook = _missed
        threading.excepthook = _missed_in_thread
        self._qt = qInstallMessageHandler(_said_by_qt)

    def close(self) -> None:
        """Write no more, and leave everything as it was."""
        qInstallMessageHandler(self._qt)
        sys.excepthook, threading.excepthook = self._hooks
        faulthandler.disable()
        self._crashes.close()
        for handler in self._handlers:
            logging.getLogger().removeHandler(handler)
            handler.close()


def _missed(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    if isinstance(error, Exception):
        guard.failed(error, "what nothing guards")
    else:
        sys.__excepthook__(kind, error, trace)


def _missed_in_thread(missed: threading.ExceptHookArgs) -> None:
    # Only logged: a window is told of nothing from another thread.
    where = missed.thread.name if missed.thread else "a thread"
    error = missed.exc_value
    guard.log.error("in %s", where, exc_info=error if error is not None else False)


def _said_by_qt(kind: QtMsgType, _: QMessageLogContext, text: str) -> None:
    logging.getLogger("qt").log(_LEVELS.get(kind, logging.WARNING), "%s", text)
