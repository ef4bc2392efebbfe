"""The live process from within: how it begins, and how it ends with the one that began it."""

import gc
import multiprocessing
import os
import signal
import sys
import threading
import time
from multiprocessing.connection import Connection
from pathlib import Path

from kappaskin.live.asker import Asker
from kappaskin.live.loop import Loop
from kappaskin.live.requests import Request
from kappaskin.live.ring import Ring

_SWITCH = 2e-4  # s that one thread may keep the interpreter from another
_GRACE = 0.5  # s for an orderly end once the parent is gone


def serve(
    requests: "Connection[Request, Request]",
    names: tuple[str, str],
    orphans: Path | None,
    patience: float,
) -> None:
    """Do as the `requests` say, and write to the rings of these `names`, until that is over."""
    # The thread that reads the line needs the interpreter three times for 4 KiB: with Python's 5 ms
    # for each, a loop that always computes would starve it below the rate of the line.
    sys.setswitchinterval(_SWITCH)
    gc.freeze()  # what was imported is no garbage: to look through it takes 27 ms each time
    # Ctrl+C and a terminal that closes are the parent's: it says goodbye, or is gone.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    rings = Ring.attach(names[0]), Ring.attach(names[1])
    try:
        loop = Loop(Asker(requests, names, orphans, patience), *rings)
        watcher = threading.Thread(target=_end_with_parent, args=(loop,), name="parent-watcher")
        watcher.daemon = True
        watcher.start()
        loop.run()
    finally:
        parent = multiprocessing.parent_process()
        for ring in rings:
            if parent and parent.is_alive():
                ring.close()
            else:
                ring.destroy()


def _end_with_parent(loop: Loop) -> None:
    """End this process soon after the one that started it, whatever is being computed.

    What was recorded is ended first. What is being recorded, and may be adopted, goes on.
    """
    if parent := multiprocessing.parent_process():
        parent.join()
        time.sleep(_GRACE)
        if not loop.may_be_adopted:
            loop.end_recording()
            os._exit(1)
