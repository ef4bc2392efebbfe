"""Prints as JSON for how many ms each registered action blocks the window, the least of its turns.

What an action opens is closed again after it. `python blocking.py TURNS`
"""

import json
import sys
import time

from PySide6.QtWidgets import QApplication, QDialog, QFileDialog

from kappaskin_app.features import FEATURES
from kappaskin_app.shell.window import MainWindow

_SPARED = ("quit",)


def _live(application: QApplication, seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        application.processEvents()
        time.sleep(0.001)


def _blocked(application: QApplication, window: MainWindow, name: str) -> float:
    """How long in s the window does nothing else after an action; then all is as before."""
    start = time.perf_counter()
    window.actions_by_name[name].trigger()
    taken = time.perf_counter() - start
    _live(application, 0.15)
    for dialog in window.findChildren(QDialog):
        dialog.reject()
    return taken


def main(turns: int) -> None:
    application = QApplication([])
    application.setStyle("Fusion")
    for ask in ("getOpenFileName", "getSaveFileName"):
        setattr(QFileDialog, ask, lambda *_: ("", ""))
    window = MainWindow([made() for made in FEATURES], "sim:")
    window.show()
    _live(application, 4.0)
    times: dict[str, float] = {}
    for _ in range(turns):
        for name in window.actions_by_name.entries:
            if name not in _SPARED:
                taken = 1e3 * _blocked(application, window, name)
                times[name] = min(taken, times.get(name, taken))
        window.layouts.leave_full_screen()
    window.close()
    print(json.dumps(times))


if __name__ == "__main__":
    main(int(sys.argv[1]))
