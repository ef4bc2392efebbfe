"""Prints as JSON for how many ms each action holds the window, in each of its uses.

A watchdog takes the time of the action itself and, in processor time, of every turn of the event
loop after it: without a graphics card a turn waits for software to draw, action or not. What an
action opens is closed again after it. A click on the list of devices, and a dock whose chart gets
its points, are used as actions are.
`python blocking.py TURNS`
"""

import json
import sys
import time

from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QDialog, QFileDialog

from kappaskin_app.features.connection.panel import SourceBox
from kappaskin_app.launch import opened
from kappaskin_app.shell.window import MainWindow

_SPARED = ("quit",)
_DEVICES = "list of devices"
_AFTER = 0.3  # s that are watched after an action: what it opens is drawn by then


def _longest_turn(application: QApplication, seconds: float) -> float:
    """The longest turn of the event loop in s of processor time, while it runs for so many."""
    longest, end = 0.0, time.perf_counter() + seconds
    while time.perf_counter() < end:
        start = time.thread_time()
        application.processEvents()
        longest = max(longest, time.thread_time() - start)
        time.sleep(0.001)
    return longest


def _list_devices(window: MainWindow) -> None:
    box = window.findChild(SourceBox)
    QTest.mouseClick(box.line, Qt.MouseButton.LeftButton)


def _held(application: QApplication, window: MainWindow, name: str) -> tuple[float, float]:
    """How long in ms an action takes itself, and the longest turn after it; then all is closed."""
    start = time.perf_counter()
    _list_devices(window) if name == _DEVICES else window.actions_by_name[name].trigger()
    taken = time.perf_counter() - start
    after = _longest_turn(application, _AFTER)
    for dialog in window.findChildren(QDialog):
        dialog.reject()
    if (popup := QApplication.activePopupWidget()) is not None:
        popup.close()
    return 1e3 * taken, 1e3 * after


def main(turns: int) -> None:
    application, window = opened("sim:")
    for ask in ("getOpenFileName", "getSaveFileName"):
        setattr(QFileDialog, ask, lambda *_: ("", ""))
    _longest_turn(application, 4.0)
    idle = 1e3 * _longest_turn(application, 4.0)
    names = [name for name in window.actions_by_name.entries if name not in _SPARED]
    names.append(_DEVICES)
    uses: dict[str, list[tuple[float, float]]] = {name: [] for name in names}
    for _ in range(turns):
        for name in names:
            uses[name].append(_held(application, window, name))
        window.layouts.leave_full_screen()
    window.close()
    print(json.dumps({"idle": idle, "uses": uses}))


if __name__ == "__main__":
    main(int(sys.argv[1]))
