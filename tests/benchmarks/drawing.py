"""Draws for some seconds and prints what it managed as JSON.

`python drawing.py WHAT SECONDS SOURCE`: a `bare` QtInteractor, the `app` as it opens, with
`everything` shown that it can show at once, or while it is `measuring` the cost of accuracy. Each
shares the two cores with an engine that reads SOURCE: `sim:FILE`, or the port of a `device` of its
own at 500 frames/s.
"""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np
from bare_window import bare_window
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from kappaskin import Engine
from kappaskin_app.features import FEATURES
from kappaskin_app.shell.arrangement import BOTTOM, LEFT, RIGHT, Layout, Place
from kappaskin_app.shell.settings.shown import COLOURS
from kappaskin_app.shell.window import MainWindow

SETTLE = 3.0
_SHOWN = Layout(
    0,
    (
        *(("settings", Place(LEFT, share=0.25)), ("curvature", Place(RIGHT, share=0.22))),
        *((name, Place(BOTTOM, share=0.3)) for name in ("element", "traces", "numbers")),
    ),
)
_DRAWN = ("directions", "band", "frame", "object", "elements", "truth")


def bare(application: QApplication, source: str, seconds: float) -> dict[str, float]:
    """The same mesh, written in place and drawn as fast as it goes."""
    engine = Engine()
    engine.connect(source)
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


def app(
    application: QApplication,
    source: str,
    seconds: float,
    begin: Callable[[MainWindow], None] | None = None,
) -> dict[str, float]:
    """The whole window at 1280 x 800."""
    window = MainWindow([made() for made in FEATURES], source)
    window.show()
    if begin is not None:  # once it has met the skin
        QTimer.singleShot(round(SETTLE / 2 * 1e3), lambda: begin(window))
    QTimer.singleShot(round((SETTLE + seconds) * 1e3), application.quit)
    application.exec()
    now = time.monotonic()
    ages = [age for when, age in window.features["membrane"].membrane.ages if when > now - seconds]
    status, measured = window.session.status, window.features["accuracy"].measurement
    tried, running = measured.progress[0], measured.running
    window.close()
    return {
        "tried": tried,
        "measuring": running,
        "drawn": len(ages) / seconds,
        "age_p99_ms": float(np.percentile(ages, 99)) * 1e3,
        "reader_gap_p99_ms": status.reader_gap * 1e3,
        "frames": status.rate,
        "lost": status.accounting.lost,
    }


def _show_everything(window: MainWindow) -> None:
    shown = dict.fromkeys((f"show_{name}" for name in _DRAWN), True)
    maps = tuple(name for name, _ in COLOURS)
    window.history.change("Everything", -1, maps=maps, traced=(33, 44, 55), **shown)
    window.features["traces"].selected_element.select(44)
    window.layouts.apply(_SHOWN)


def _measure(window: MainWindow) -> None:
    window.docks["cost"].show()


@contextmanager
def read_from(source: str) -> Iterator[str]:
    """The source to connect to, while it is there."""
    if source != "device":
        yield source
        return
    command = [sys.executable, "-m", "kappaskin", "device", "circle", "--rate", "500"]
    quiet = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, **quiet) as device:
        yield json.loads(device.stdout.readline())["port"]
        device.terminate()


if __name__ == "__main__":
    what, seconds = sys.argv[1], float(sys.argv[2])
    run = {
        "bare": bare,
        "app": app,
        "everything": partial(app, begin=_show_everything),
        "measuring": partial(app, begin=_measure),
    }[what]
    with read_from(sys.argv[3]) as source:
        application = QApplication([])
        application.setStyle("Fusion")
        print(json.dumps(run(application, source, seconds)))
