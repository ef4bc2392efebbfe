"""How processes beside this one are begun, and how one of them comes before others.

Those of one thread each, with the library loaded.
"""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Generator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from multiprocessing.context import ForkServerContext, SpawnContext

_AHEAD = 10  # of 40 steps of priority

Context: TypeAlias = "ForkServerContext | SpawnContext"


@contextmanager
def beginning_processes() -> Generator[Context]:
    """What begins processes that compute in one thread each.

    Where the system can, they come from a process that has loaded the library and does nothing
    else: one begins in 0.1 s instead of 0.8. A plain fork would copy Qt's threads' locks.
    """
    context: Context = multiprocessing.get_context("spawn")
    if "forkserver" in multiprocessing.get_all_start_methods():
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(["kappaskin.live.loop"])
    # Small products lose by threading, and the threads would take the cores from whoever draws.
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
    was = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        if context.get_start_method() == "forkserver":
            _begin_deaf()
        yield context
    finally:
        for name, value in was.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def load_beside() -> None:
    """Begin to load the library in a process beside; an `Engine` that waits for it begins sooner.

    Nothing where the system cannot fork from such a process.
    """
    with beginning_processes():
        pass


def _begin_deaf() -> None:
    """Begin the process that the others come from, deaf to Ctrl+C, as they are then.

    The signal goes to every process of a terminal, and would break that one off while it loads.
    """
    from multiprocessing import forkserver, resource_tracker

    resource_tracker.ensure_running()  # first: it lets the signal through once it is begun
    was = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, was)


class Haste:
    """Lets this process come before others that want a core, where the system allows it.

    Linux alone, and there for whom the limits (`nice` in limits.conf, or root) let ask for it.
    """

    def __init__(self) -> None:
        self._linux = sys.platform.startswith("linux")
        self._usual = os.getpriority(os.PRIO_PROCESS, 0) if self._linux else 0

    def __call__(self, on: bool) -> None:
        """Come before others from now on, or no more."""
        if not self._linux:
            return
        for thread in threading.enumerate():  # each has its own; those that follow inherit it
            with suppress(OSError):
                os.setpriority(
                    os.PRIO_PROCESS, thread.native_id or 0, self._usual - (_AHEAD if on else 0)
                )
