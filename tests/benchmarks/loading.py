"""The whole window on a port for some seconds; prints what was held as JSON."""

import json
import sys
import time

import numpy as np
import psutil
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from kappaskin_app.features import FEATURES
from kappaskin_app.shell.window import MainWindow

SETTLE = 8.0


def held(application: QApplication, port: str, seconds: float) -> dict[str, float]:
    """Drawings and frames per second, losses, worst gaps, and how much memory grew."""
    window = MainWindow([made() for made in FEATURES], port)
    window.show()
    gaps: list[float] = []
    memory: list[list[int]] = []
    own, begun = psutil.Process(), time.monotonic()

    def look() -> None:
        if time.monotonic() - begun > SETTLE:
            gaps.append(window.session.status.reader_gap)
            children = [process.memory_info().rss for process in own.children(recursive=True)]
            memory.append([own.memory_info().rss, max(children, default=0)])

    timer = QTimer()
    timer.timeout.connect(look)
    timer.start(1000)
    first: list[object] = []
    QTimer.singleShot(round(SETTLE * 1e3), lambda: first.append(window.session.status))
    QTimer.singleShot(round((SETTLE + seconds) * 1e3), application.quit)
    application.exec()
    now, status, before = time.monotonic(), window.session.status, first[0]
    timer.stop()
    came = status.accounting.accepted - before.accounting.accepted
    lasted, watched = now - begun - SETTLE, min(seconds, 60.0)
    drawn = sum(when > now - watched for when, _ in window.features["membrane"].membrane.ages)
    window.close()
    quarter = max(1, len(memory) // 4)
    grown = np.subtract(*(np.mean(part, axis=0) for part in (memory[-quarter:], memory[:quarter])))
    return {
        "drawn": drawn / watched,
        "frames": came / lasted,
        "computed": 1 - (status.skipped - before.skipped) / max(1, came),
        "lost": status.accounting.lost,
        "discarded": status.accounting.bytes_discarded,
        "reader_gap_p99_ms": float(np.nanmedian(gaps)) * 1e3,
        "window_grown_mb": float(grown[0]) / 1e6,
        "engine_grown_mb": float(grown[1]) / 1e6,
    }


if __name__ == "__main__":
    application = QApplication([])
    application.setStyle("Fusion")
    print(json.dumps(held(application, sys.argv[1], float(sys.argv[2]))))
