"""Starts Qt, shows the window, and ends both in order."""

import signal
import sys
from pathlib import Path

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from kappaskin import Refusal
from kappaskin_app.window import MainWindow


def launch(source: str, seconds: float | None = None, screenshot: Path | None = None) -> None:
    """Show the window on `source`; after `seconds` save `screenshot`, if any, and close."""
    application = QApplication.instance() or QApplication(sys.argv[:1])
    if not isinstance(application, QApplication):
        raise Refusal("expected a Qt application with widgets, got one without")
    application.setApplicationName("Kappaskin")
    application.setStyle("Fusion")
    window = MainWindow(source)
    window.show()
    # The session's timer lets Python see these within milliseconds while Qt has the loop; a
    # handler may run in the middle of a drawing, so the window closes from the loop.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: QTimer.singleShot(0, window.close))
    saved: list[bool] = []

    def end() -> None:
        if screenshot is not None:
            saved.append(window.picture(screenshot))
        window.close()

    if seconds is not None:
        QTimer.singleShot(round(seconds * 1e3), end)
    application.exec()
    if saved == [False]:
        raise Refusal(f"{screenshot}: the picture cannot be written; choose another place")
