"""Runs `kappaskin app` until the skin is drawn.

Prints how long after the time given that was, and what processor time it took here.
"""

import math
import sys
import time
from typing import Any

from kappaskin.cli import main

_LOOK = 1  # ms


def _watched(*arguments: Any) -> Any:
    """The window, which closes as soon as the skin was drawn."""
    from PySide6.QtCore import QTimer  # not before the app does

    application, window = opened(*arguments)

    def look() -> None:
        if any(math.isfinite(age) for _, age in window.features["membrane"].membrane.ages):
            timer.stop()
            print(time.monotonic() - started, time.process_time())
            window.close()

    timer = QTimer(window, interval=_LOOK)
    timer.timeout.connect(look)
    timer.start()
    return application, window


if __name__ == "__main__":
    from kappaskin_app import launch

    started, opened = float(sys.argv[1]), launch.opened
    launch.opened = _watched
    sys.exit(main(["app"]))
