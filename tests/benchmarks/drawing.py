"""Draws for some seconds and prints what it managed as JSON: a `bare` QtInteractor, or the `app`.

Both share the two cores with a device and an engine at 500 frames/s.
"""

import json
import subprocess
import sys
import time

import numpy as np
from bare_window import bare_window
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from kappaskin import Engine
from kappaskin_app.window import MainWindow

SETTLE = 3.0


def bare(application: QApplication, port: str, seconds: float) -> dict[str, float]:
    """The same mesh, written in place and drawn as fast as it goes."""
    engine = Engine()
    engine.connect(port)
    widget, mesh, shape = bare_window()
    widget.show()
    done: list[float] = []
    widget.renderer.AddObserver("EndEvent", lambda *_: done.append(time.monotonic()))

    def step() -> None:
        height = shape * np.sin(time.monotonic())
        mesh.points[:, 2] = 20 * height.ravel()
        mesh.point_data["value"][:] = height.ravel()
        widget.update()

    timer = QTimer()
    timer.timeout.connect(step)
    timer.start(0)
    QTimer.singleShot(round((SETTLE + seconds) * 1e3), application.quit)
    application.exec()
    timer.stop()
    widget.close()
    engine.close()
    return {"drawn": sum(t > done[-1] - seconds for t in done) / seconds}


def app(application: QApplication, port: str, seconds: float) -> dict[str, float]:
    """The whole window at 1280 x 800 on the device's port."""
    window = MainWindow(port)
    window.show()
    QTimer.singleShot(round((SETTLE + seconds) * 1e3), application.quit)
    application.exec()
    now = time.monotonic()
    ages = [age for when, age in window.membrane.ages if when > now - seconds]
    status = window.session.status
    window.close()
    return {
        "drawn": len(ages) / seconds,
        "age_p99_ms": float(np.percentile(ages, 99)) * 1e3,
        "reader_gap_p99_ms": status.reader_gap * 1e3,
        "frames": status.rate,
        "lost": status.accounting.lost,
    }


if __name__ == "__main__":
    what, seconds = sys.argv[1], float(sys.argv[2])
    device = subprocess.Popen(
        [sys.executable, "-m", "kappaskin", "device", "circle", "--rate", "500"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    try:
        port = json.loads(device.stdout.readline())["port"]
        application = QApplication([])
        application.setStyle("Fusion")
        run = {"bare": bare, "app": app}[what]
        print(json.dumps(run(application, port, seconds)))
    finally:
        device.terminate()
        device.wait()
