"""Background tasks: the one way to compute something while the window goes on, and to end it."""

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from PySide6.QtCore import QObject, QTimer, Signal

from kappaskin._processes import BackgroundProcess, items_of
from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin_app.guard import failed, guarded

_MOMENT = 0.3  # s that needs no words
_LOOK = 20  # ms between two looks at what runs
_GRACE = 1.0  # s that threads have to end in when the window closes
_ENGINE = "Computing the new settings; Ctrl+Z takes them back"
_EXPECTED = Refusal, MemoryError, np.linalg.LinAlgError
"""What a computation may end with where nothing is wrong with the program."""

_Item = TypeVar("_Item")


class Cancelled(Refusal):
    """A person has cancelled a task."""


class Work(Protocol):
    """What runs: `poll` returns the items since the last call, or raises what it failed with."""

    @property
    def done(self) -> bool: ...

    def poll(self) -> Sequence[Any]: ...

    def close(self) -> None: ...


class BackgroundThread(threading.Thread):
    """Computes the items of `make(*about)` as a `BackgroundProcess` does, in a thread.

    For what takes less than a second to its next item, where it ends once it is closed. The program
    ends after it: a picture that is being written is whole.
    """

    def __init__(self, make: Callable[..., Any], *about: object) -> None:
        super().__init__(name=make.__name__)
        self.done = self._closed = False
        self._items, self._error = deque[Any](), None
        self._make = partial(items_of, make, *about)
        self.start()

    def run(self) -> None:
        try:
            with closing(self._make()) as items:
                for item in items:
                    if self._closed:
                        return
                    self._items.append(item)
        except Exception as error:  # of whatever kind: `poll` raises it where it can be told
            self._error = error

    def poll(self) -> list[Any]:
        over = not self.is_alive()
        found = [self._items.popleft() for _ in range(len(self._items))]
        self.done = over and (self._error is None or not found)
        if self.done and self._error is not None:
            raise self._error
        return found

    def close(self) -> None:
        self._closed = True


class BackgroundTask(Generic[_Item]):
    """A place for one computation beside the window at a time; what is begun there ends the last.

    Each item that it computes goes to `take` and what it fails with to `refuse`, which tells a
    `Refusal` at the foot of the window where none is given; then it has `ended`. All are called on
    the GUI's thread, and none once it is stopped. `words` tell at the foot of the window what takes
    long, `cancelled` what it is refused with where a person cancels it; without, nobody can.
    """

    def __init__(
        self,
        tasks: "Tasks",
        words: str,
        take: Callable[[_Item], object],
        refuse: Callable[[Exception], object] | None = None,
        ended: Callable[[], object] = lambda: None,
        cancelled: str = "",
    ) -> None:
        self.words, self.cancelled = words, cancelled
        self._tasks, self._work = tasks, None
        self._take, self._ended = guarded(take), guarded(ended)
        self._refuse = guarded(refuse or tasks.refuse)

    @property
    def running(self) -> bool:
        return self._work is not None

    def run(self, make: Callable[..., Any], *about: object) -> None:
        """Compute the items of `make(*about)` in a thread: less than a second for each."""
        self.begin(lambda: BackgroundThread(make, *about))

    def compute(self, make: Callable[..., Any], *about: object) -> None:
        """Compute the items of `make(*about)` in a process, however long each takes."""
        name = f"kappaskin-{make.__name__}"
        self.begin(lambda: BackgroundProcess(name, items_of, make, *about))

    def begin(self, start: Callable[[], Work]) -> None:
        """Run what `start` starts, or refuse it; nothing begins once the window closes."""
        self.stop()
        if not self._tasks.closed:
            try:
                self._work = start()
                self._tasks.follow(self)
            except Refusal as refusal:
                self._fail(refusal)

    def look(self) -> None:
        """Take what was computed since the last look."""
        work = self._work
        if work is None:
            return
        try:
            items = work.poll()
        except Exception as error:  # of whatever kind: it would come again at every look
            self._fail(error)
            return
        for item in items:
            if self._work is work:  # or it was stopped meanwhile
                self._take(item)
        if self._work is work and work.done:
            self.stop()
            self._ended()

    def cancel(self) -> None:
        """End it as a person requests, if it runs."""
        if self.running:
            self._fail(Cancelled(self.cancelled))

    def stop(self) -> None:
        """End it, if it runs, and drop what it has computed."""
        work, self._work = self._work, None
        if work is not None:
            work.close()

    def _fail(self, error: Exception) -> None:
        self.stop()
        if not isinstance(error, _EXPECTED):
            failed(error, self.words or self)
        self._refuse(error)
        self._ended()


class Tasks(QObject):
    """The tasks that run; `told` says what goes on for longer than a moment, `refused` why not.

    Of several it is the one that goes on longest, `task`, which `cancel` ends.
    """

    told = Signal(str)
    refused = Signal(str)

    def __init__(
        self, parent: QObject | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__(parent)
        self._running: list[BackgroundTask[Any]] = []
        self._clock, self._since = clock, dict[str, float]()
        self._words = ""
        self.task: BackgroundTask[Any] | None = None
        self.closed = False
        self._timer = QTimer(self, interval=_LOOK)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(self._look))

    def follow(self, task: BackgroundTask[Any]) -> None:
        """Look after a task that runs, to its end."""
        if task not in self._running:
            self._running.append(task)
        if not self._timer.isActive():
            self._timer.start()

    def _look(self) -> None:
        for task in list(self._running):
            task.look()
        self._running = [task for task in self._running if task.running]
        if not self._running:
            self._timer.stop()

    def refuse(self, error: Exception) -> None:
        """Tell of a refusal that no task has a better place for."""
        if isinstance(error, _EXPECTED):
            self.refused.emit(str(error))

    def tell(self, status: Status) -> None:
        """Tell what takes longer than a moment, here or in the engine."""
        now, engine = self._clock(), [_ENGINE] * status.computing
        going = {task.words: task for task in self._running if task.words and task.running}
        self._since = {words: self._since.get(words, now) for words in (*going, *engine)}
        long = [words for words, since in self._since.items() if now - since > _MOMENT]
        longest = min(long, key=lambda words: self._since[words], default="")
        self.task, words = going.get(longest), ""
        if longest:
            more = f", and {len(long) - 1} more" if len(long) > 1 else ""
            words = f"{longest}: {now - self._since[longest]:.0f} s{more}"
        if words != self._words:
            self._words = words
            self.told.emit(words)

    @property
    def may_cancel(self) -> bool:
        return self.task is not None and bool(self.task.cancelled)

    def cancel(self) -> None:
        """End what is told of."""
        if self.task is not None and self.may_cancel:
            self.task.cancel()

    def close(self) -> None:
        """End all within a second, and let nothing begin any more."""
        self.closed = True
        self._timer.stop()
        for task in self._running:
            task.stop()
        end = time.monotonic() + _GRACE
        for thread in threading.enumerate():  # of those that were stopped before, too
            if isinstance(thread, BackgroundThread):
                thread.join(max(0.0, end - time.monotonic()))


_EVERY = 40  # ms between two


class Newest(QObject):
    """Does what it is given at once, and what follows at most 25 times a second."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._waiting: Callable[[], None] | None = None
        self._timer = QTimer(self, singleShot=True, interval=_EVERY)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(self._go_on))

    def __call__(self, act: Callable[[], None]) -> None:
        """Do this, unless something newer comes before it may be done."""
        self._waiting = act
        if not self._timer.isActive():
            self._go_on()

    def _go_on(self) -> None:
        act, self._waiting = self._waiting, None
        if act is not None:
            self._timer.start()
            act()

    def forget(self) -> None:
        """Do no more of what was given."""
        self._waiting = None
        self._timer.stop()
