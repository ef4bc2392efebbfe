"""Log files in the user's log folder."""

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

from kappaskin._files import user_folder
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
    """The folder of this user's log files."""
    return user_folder(platformdirs.user_log_path)


class LogFiles:
    """Writes warnings, uncaught exceptions, Qt's messages and crashes into a `folder`."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self._handlers = (
            RotatingFileHandler(
                folder / LOG, maxBytes=_LARGEST, backupCount=_OLDER, encoding="utf-8"
            ),
            logging.StreamHandler(),  # to the terminal, as without log files
        )
        for handler in self._handlers:
            handler.setLevel(logging.WARNING)
            handler.setFormatter(guard.PrintableFormatter(_LINE))
            logging.getLogger().addHandler(handler)
        self._crashes = (folder / CRASHES).open("a", encoding="utf-8")
        self._crashes.write(f"{datetime.now():%Y-%m-%d %H:%M:%S} started, process {os.getpid()}\n")
        self._crashes.flush()
        faulthandler.enable(self._crashes)
        self._hooks = sys.excepthook, threading.excepthook
        sys.excepthook = _log_exception
        threading.excepthook = _log_thread_exception
        self._qt = qInstallMessageHandler(_log_qt_message)

    def close(self) -> None:
        """Stop logging, and restore the handlers of before."""
        qInstallMessageHandler(self._qt)
        sys.excepthook, threading.excepthook = self._hooks
        faulthandler.disable()
        self._crashes.close()
        for handler in self._handlers:
            logging.getLogger().removeHandler(handler)
            handler.close()


def _log_exception(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    if isinstance(error, Exception):
        guard.failed(error, "unguarded code")
    else:
        sys.__excepthook__(kind, error, trace)


def _log_thread_exception(missed: threading.ExceptHookArgs) -> None:
    # Only logged: another thread must not call a window.
    where = missed.thread.name if missed.thread else "a thread"
    error = missed.exc_value
    guard.log.error("in %s", where, exc_info=error if error is not None else False)


def _log_qt_message(kind: QtMsgType, _: QMessageLogContext, text: str) -> None:
    logging.getLogger("qt").log(_LEVELS.get(kind, logging.WARNING), "%s", text)
