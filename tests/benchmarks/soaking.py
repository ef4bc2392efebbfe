"""The whole window for some seconds, recording while its settings change; prints JSON.

`python soaking.py SOURCE SECONDS FOLDER`
"""

import itertools
import json
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from kappaskin_app import guard
from kappaskin_app.features import FEATURES
from kappaskin_app.shell.window import MainWindow

SETTLE = 70.0  # s: by then each change was made four times, and each panel shown
_EVERY = 1.0  # s between two changes of a setting
_FILE = 30.0  # s that each recording lasts
_CHANGES: tuple[dict[str, Any], ...] = (
    {"functions_x": 6},
    {"method": "robust"},
    {"colour_by": "first"},
    {"maps": ("xx", "mean", "residual_xy")},
    {"show_band": True, "show_directions": True},
    {"x": 0.03},
    {"method": "least-squares", "functions_x": 8},
    {"theme": "light"},
    {"maps": ("xx", "yy", "xy"), "colour_by": "displacement"},
    {"show_band": False, "show_directions": False},
    {"noise_rms": 0.4},
    {"theme": "dark"},
)


def _held() -> list[float]:
    """Resident MB, threads and descriptors of the window, and the same of the engine."""
    own = psutil.Process()
    children = own.children(recursive=True)
    engine = max(children, key=lambda process: process.memory_info().rss, default=own)
    return [
        value
        for process in (own, engine)
        for value in (
            process.memory_info().rss / 1e6,
            process.num_threads(),
            process.num_fds(),
        )
    ]


def _changing(window: MainWindow) -> Iterator[None]:
    for turn in itertools.count():
        for change in _CHANGES:
            window.history.change("Soak", -1, **change)
            yield
        for _ in range(3):
            window.history.stack.undo()
            yield
        window.docks.reveal(("element", "traces", "numbers", "health")[turn % 4])
        window.features["traces"].selected_element.select(turn % 100)
        yield


def _recording(window: MainWindow, folder: Path) -> Iterator[None]:
    for number in itertools.count():
        window.session.engine.record(folder / f"{number}.mcap")
        (folder / f"{number - 2}.mcap").unlink(missing_ok=True)
        yield


def soaked(
    application: QApplication, source: str, seconds: float, folder: Path
) -> dict[str, float]:
    window = MainWindow([made() for made in FEATURES], source)
    window.show()
    begun, seen = time.monotonic(), []
    accepted: list[int] = []

    def look() -> None:
        if time.monotonic() - begun > SETTLE:
            seen.append([time.monotonic() - begun, *_held()])
            accepted.append(window.session.status.accounting.accepted)

    steps: list[tuple[float, Callable[[], object]]] = [(1.0, look)]
    for every, going in ((_EVERY, _changing(window)), (_FILE, _recording(window, folder))):
        next(going)
        steps.append((every, lambda going=going: next(going)))
    failures: list[str] = []
    guard.on_failure(failures.append)  # where a slot that raised would be heard of no more
    timers = []
    for every, step in steps:
        timers.append(QTimer(interval=round(1e3 * every)))
        timers[-1].timeout.connect(guard.guarded(step))
        timers[-1].start()
    QTimer.singleShot(round((SETTLE + seconds) * 1e3), application.quit)
    application.exec()
    for timer in timers:
        timer.stop()
    lost = window.session.status.accounting.lost
    window.close()
    if failures:
        raise RuntimeError(f"expected nothing to fail, got {len(failures)} times {failures[0]!r}")
    at, *held = np.array(seen).T
    lasted = at[-1] - at[0]
    window_mb, _, _, engine_mb, _, _ = (float(np.polyfit(at, each, 1)[0]) for each in held)
    quarter = max(1, len(at) // 4)
    more = [float(np.median(each[-quarter:]) - np.median(each[:quarter])) for each in held]
    return {
        "frames": (accepted[-1] - accepted[0]) / lasted,
        "lost": lost,
        "window_mb_s": window_mb,
        "engine_mb_s": engine_mb,
        "more_threads": max(more[1], more[4]),
        "more_descriptors": max(more[2], more[5]),
    }


if __name__ == "__main__":
    application = QApplication([])
    application.setStyle("Fusion")
    print(json.dumps(soaked(application, sys.argv[1], float(sys.argv[2]), Path(sys.argv[3]))))
