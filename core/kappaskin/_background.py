"""What a function tells, one item after the other, computed in a process of its own."""

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any, Generic, TypeVar, cast

from kappaskin._processes import beginning_processes
from kappaskin.errors import Refusal

_Item = TypeVar("_Item")
_GRACE = 1.0  # s to clear up in once the one that asked is gone


def end_with_parent() -> None:
    """End this process soon after the one that started it, whatever is being computed."""
    threading.Thread(target=_watch_parent, name="parent-watcher", daemon=True).start()


def _watch_parent() -> None:
    if parent := multiprocessing.parent_process():
        parent.join()
        time.sleep(_GRACE)
        os._exit(1)


def _tell(
    pipe: "Connection[Any, None]", make: Callable[..., Iterable[Any]], about: tuple[Any, ...]
) -> None:
    """What the child process does: each item in a tuple, a refusal, and None at the end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C is the parent's; it closes the pipe
    end_with_parent()
    with suppress(OSError):  # who asked has gone
        try:
            for item in make(*about):
                pipe.send((item,))
            pipe.send(None)
        except Refusal as refusal:
            pipe.send(refusal)


class Beside(Generic[_Item]):
    """Computes the items of `make(*about)` in a process, called `name`, of one thread.

    No call here but `wait` waits. It ends when it is done, when `close` is called, or when the
    process that started it is gone.
    """

    def __init__(self, name: str, make: Callable[..., Iterable[_Item]], *about: object) -> None:
        self.done, self._refused = False, cast("Refusal | None", None)
        ours, theirs = multiprocessing.Pipe(duplex=False)
        self._pipe = cast("Connection[None, tuple[_Item] | Refusal | None]", ours)
        with beginning_processes() as context:
            self._process = context.Process(
                target=_tell, args=(theirs, make, about), name=name, daemon=True
            )
            self._process.start()
        theirs.close()

    def poll(self) -> list[_Item]:
        """What has been told since the last call.

        Raises a `Refusal` when that is what came of it or when the process has died, once all that
        came before is told.
        """
        found: list[_Item] = []
        while not self.done and self._pipe.poll():
            try:
                found += self._next()
            except Refusal as refusal:
                if not found:
                    raise
                self._refused, self.done = refusal, False  # the next call tells
                break
        return found

    def wait(self) -> Generator[_Item]:
        """Each item as soon as it is told, to the end."""
        while not self.done:
            yield from self._next()

    def _next(self) -> list[_Item]:
        """The next item, none at the end."""
        if self._refused is not None:
            self.done = True
            raise self._refused
        try:
            told = self._pipe.recv()
        except (EOFError, OSError):
            self.done = True
            raise Refusal("the process that works on it ended unexpectedly; ask again") from None
        if isinstance(told, Refusal):
            self.done = True
            raise told
        self.done = told is None
        return [] if told is None else [told[0]]

    def close(self) -> None:
        """Stop and end the process."""
        self.done = True
        self._pipe.close()
        self._process.kill()
        self._process.join()
        self._process.close()

    def __enter__(self) -> "Beside[_Item]":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
