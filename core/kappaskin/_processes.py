"""Background processes: how they are started, prioritised and ended, each with one thread."""

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, Generic, TypeAlias, TypeVar, cast

from kappaskin._files import mark_folder, remove_folders_left_behind
from kappaskin.errors import Refusal

if TYPE_CHECKING:
    from multiprocessing.context import ForkServerContext, SpawnContext

_RAISED = _LOWERED = 10  # of 40 steps of priority

Context: TypeAlias = "ForkServerContext | SpawnContext"

_Item = TypeVar("_Item")
_GRACE = 1.0  # s to clean up in once the parent has ended


@contextmanager
def process_context() -> Generator[Context]:
    """A context that starts processes which compute in one thread each.

    Where the system can, they are forked from a process that has loaded the library and does
    nothing else: one starts in 0.1 s instead of 0.8. A plain fork would copy Qt's threads' locks.
    """
    # Small products lose by threading, and the threads would take the cores from whoever draws.
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
    was = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield _context()
    finally:
        for name, value in was.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _context() -> Context:
    """The fork server's where there is one: its socket needs a folder for temporary files."""
    if "forkserver" in multiprocessing.get_all_start_methods():
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(["kappaskin.live.loop", "scipy.spatial"])
        with suppress(OSError):
            _start_forkserver()
            return context
    return multiprocessing.get_context("spawn")


@contextmanager
def starting_process() -> Generator[Context]:
    """A `process_context` to start one process in; a `Refusal` where the system starts none."""
    try:
        with process_context() as context:
            yield context
    except (OSError, EOFError) as error:  # at its end, where the fork server could not fork
        why = getattr(error, "strerror", None) or "the fork server ended"
        raise Refusal(
            f"expected to start another process, got none ({why}); end other programs, or allow "
            "more processes and open files (ulimit -u, ulimit -n)"
        ) from error


def preload_library() -> None:
    """Begin to load the library in a background process; an `Engine` started later starts sooner.

    Nothing where the system cannot fork from such a process.
    """
    with process_context():
        pass


def _start_forkserver() -> None:
    """Start the process that the others are forked from; it ignores Ctrl+C, as they do then.

    The signal goes to every process of a terminal, and would stop that one while it loads.
    """
    from multiprocessing import forkserver, resource_tracker

    _mark_temporary_folder()
    resource_tracker.ensure_running()  # first: it lets the signal through once it is begun
    was = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, was)


@cache
def _mark_temporary_folder() -> None:
    """Mark the folder of the fork server's socket, and remove those that were left behind."""
    from multiprocessing import util

    with suppress(OSError):  # the server says it if there is no room
        remove_folders_left_behind()
        if multiprocessing.parent_process() is None:  # or it is the folder of that process
            mark_folder(Path(util.get_temp_dir()))


class ProcessPriority:
    """Raises the priority of this process where the system allows it.

    On Linux alone, for root and those whose limits (`nice` in limits.conf) allow it.
    """

    def __init__(self) -> None:
        self._linux = sys.platform.startswith("linux")
        self._usual = os.getpriority(os.PRIO_PROCESS, 0) if self._linux else 0

    def __call__(self, on: bool) -> None:
        """Raise the priority, or set it back."""
        if not self._linux:
            return
        for thread in threading.enumerate():  # each has its own; those that follow inherit it
            with suppress(OSError):
                os.setpriority(
                    os.PRIO_PROCESS, thread.native_id or 0, self._usual - (_RAISED if on else 0)
                )


def end_with_parent() -> None:
    """End this process soon after the one that started it, whatever is being computed."""
    threading.Thread(target=_watch_parent, name="parent-watcher", daemon=True).start()


def _watch_parent() -> None:
    if parent := multiprocessing.parent_process():
        parent.join()
        time.sleep(_GRACE)
        os._exit(1)


progress: ContextVar[Callable[[float], None]] = ContextVar("progress", default=lambda _: None)
"""What long computations call with the share that is done, from 0 to 1."""


def with_progress(
    begin: float, end: float, compute: Callable[..., _Item], *about: object
) -> Generator[float, None, _Item]:
    """The shares done from `begin` to `end`, as `compute(*about)` reports; returns its value."""
    shares = SimpleQueue[float | None]()

    def computed() -> _Item:
        progress.set(cast("Callable[[float], None]", shares.put))
        try:
            return compute(*about)
        finally:
            shares.put(None)

    with ThreadPoolExecutor(1) as beside:
        task = beside.submit(computed)
        while (share := shares.get()) is not None:
            yield begin + (end - begin) * share
        return task.result()


def items_of(make: Callable[..., Any], *about: object) -> Generator[Any]:
    """What the generator `make(*about)` yields, or the one item that a function returns."""
    made = make(*about)
    if isinstance(made, Generator):
        yield from cast("Generator[Any]", made)
    else:
        yield made


def _send_items(
    pipe: "Connection[Any, None]", make: Callable[..., Iterable[Any]], about: tuple[Any, ...]
) -> None:
    """Send each item in a tuple, or a refusal, and None at the end; runs in the child process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C is the parent's; it closes the pipe
    end_with_parent()
    if hasattr(os, "nice"):
        os.nice(_LOWERED)  # whoever reads and draws comes first
    with suppress(OSError):  # the parent has ended
        try:
            for item in make(*about):
                pipe.send((item,))
            pipe.send(None)
        except Refusal as refusal:
            pipe.send(refusal)


class BackgroundProcess(Generic[_Item]):
    """Computes the items of `make(*about)` in a process, called `name`, of one thread.

    Its priority is low. No call here but `wait` waits. The process ends when it is done, when
    `close` is called, or when the process that started it has ended.
    """

    def __init__(self, name: str, make: Callable[..., Iterable[_Item]], *about: object) -> None:
        self.done, self._refused = False, cast("Refusal | None", None)
        with starting_process() as context:
            ours, theirs = multiprocessing.Pipe(duplex=False)
            self._pipe = cast("Connection[None, tuple[_Item] | Refusal | None]", ours)
            self._process = context.Process(
                target=_send_items, args=(theirs, make, about), name=name, daemon=True
            )
            self._process.start()
        theirs.close()

    def poll(self) -> list[_Item]:
        """The items computed since the last call.

        Raises the `Refusal` of the computation, or one where the process has died, once all items
        before it were returned.
        """
        found: list[_Item] = []
        while not self.done and self._pipe.poll():
            try:
                found += self._next()
            except Refusal as refusal:
                if not found:
                    raise
                self._refused, self.done = refusal, False  # the next call raises it
                break
        return found

    def wait(self) -> Generator[_Item]:
        """Each item as soon as it is computed, to the end."""
        while not self.done:
            yield from self._next()

    def _next(self) -> list[_Item]:
        """The next item, none at the end."""
        if self._refused is not None:
            self.done = True
            raise self._refused
        try:
            received = self._pipe.recv()
        except (EOFError, OSError):
            self.done = True
            raise Refusal("the background process ended unexpectedly; try again") from None
        if isinstance(received, Refusal):
            self.done = True
            raise received
        self.done = received is None
        return [] if received is None else [received[0]]

    def close(self) -> None:
        """Stop and end the process."""
        self.done = True
        self._pipe.close()
        self._process.kill()
        self._process.join()
        self._process.close()

    def __enter__(self) -> "BackgroundProcess[_Item]":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
