"""Opens and closes the whole window so many times; prints what is held after each as JSON.

`python cycling.py TIMES`
"""

import gc
import json
import sys
import time
from dataclasses import asdict
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QApplication

from kappaskin.studies.drills.stand import ProcessResources
from kappaskin_app.features import FEATURES
from kappaskin_app.shell.window import MainWindow

_DRAWN = 5  # pictures of the skin, of each window


def _cycle(application: QApplication) -> None:
    window = MainWindow([made() for made in FEATURES], "sim:")
    window.show()
    while len(window.features["membrane"].membrane.ages) < _DRAWN:
        application.processEvents()
        time.sleep(0.001)
    window.close()
    window.deleteLater()
    del window
    application.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    application.processEvents()
    gc.collect()


def _noting_blocks() -> list[str]:
    """The names, from now on, of all blocks of shared memory that this process makes."""
    names: list[str] = []
    make = SharedMemory.__init__

    def noted(self: SharedMemory, *args: object, **kwargs: object) -> None:
        make(self, *args, **kwargs)  # type: ignore[arg-type]
        names.append(self.name)

    SharedMemory.__init__ = noted  # type: ignore[method-assign]
    return names


def main(times: int) -> None:
    names = _noting_blocks()
    application = QApplication([])
    application.setStyle("Fusion")
    held = []
    for _ in range(times):
        _cycle(application)
        blocks = sum(Path("/dev/shm", name).exists() for name in names)
        held.append({**asdict(ProcessResources.now()), "blocks": blocks})
    print(json.dumps(held))


if __name__ == "__main__":
    main(int(sys.argv[1]))
