"""Background tasks: computing in threads and processes, with progress and cancelling."""

import gc
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from PySide6.QtCore import QObject, QProcess, QTimer, Signal

from kappaskin._processes import BackgroundProcess, items_of
from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin_app.guard import failed, guarded

_MOMENT = 0.3  # s before a task is shown
_LOOK = 20  # ms between two polls of running tasks
_GARBAGE = 100  # ms between two collections of garbage
_GRACE = 1.0  # s that threads have to end in when the window closes
_ENGINE = "Computing the new settings; Ctrl+Z undoes them"
_EXPECTED = Refusal, MemoryError, np.linalg.LinAlgError
"""Errors of a computation that are no failures of the program."""

_Item = TypeVar("_Item")


def collect_garbage_here(parent: QObject) -> None:
    """Collect garbage in this thread alone, until `gc.enable()`.

    Otherwise it is collected in any thread that allocates, and an object of Qt that is deleted
    outside the GUI thread crashes the program later.
    """
    gc.disable()
    timer = QTimer(parent, interval=_GARBAGE)  # pyright: ignore[reportCallIssue]
    timer.timeout.connect(guarded(_collect))
    timer.start()


def _collect() -> None:
    counts, thresholds = gc.get_count(), gc.get_threshold()
    due = [n for n in range(3) if counts[n] > thresholds[n]]
    if due:
        gc.collect(due[-1])


class Cancelled(Refusal):
    """The user has cancelled a task."""


class Work(Protocol):
    """Running work: `poll` returns the items since the last call, or raises its error."""

    @property
    def done(self) -> bool: ...

    def poll(self) -> Sequence[Any]: ...

    def close(self) -> None: ...


class BackgroundThread(threading.Thread):
    """Computes the items of `make(*about)` as a `BackgroundProcess` does, in a thread.

    For work with less than a second between items, where it ends once it is closed. The program
    waits for it: a picture that is being written is whole.
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
        except Exception as error:  # of whatever kind: `poll` raises it in the GUI thread
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
    """One computation in the background at a time; starting another ends it.

    Each item goes to `take` and an error to `refuse`, by default to the status bar; then `ended` is
    called. All are called in the GUI thread, and none once it is stopped. `words` name a long task
    in the status bar, `cancelled` is the message when the user cancels it; without one it cannot
    be cancelled.
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
        """Run the work that `start` returns, or refuse it; none starts once the window closes."""
        self.stop()
        if not self._tasks.closed:
            try:
                self._work = start()
                self._tasks.follow(self)
            except Refusal as refusal:
                self._fail(refusal)

    def look(self) -> None:
        """Take the items since the last poll."""
        work = self._work
        if work is None:
            return
        try:
            items = work.poll()
        except Exception as error:  # of whatever kind: it would come again at every poll
            self._fail(error)
            return
        for item in items:
            if self._work is work:  # or it was stopped meanwhile
                self._take(item)
        if self._work is work and work.done:
            self.stop()
            self._ended()

    def cancel(self) -> None:
        """Cancel it on request of the user, if it runs."""
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
    """The running tasks; `notified` brings the text of a long one, `refused` that of an error.

    Of several it is the longest, `task`, which `cancel` ends.
    """

    notified = Signal(str)
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
        """Poll a running task until it ends."""
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
        """Report an error in the status bar."""
        if isinstance(error, _EXPECTED):
            self.refused.emit(str(error))

    def report(self, status: Status) -> None:
        """Report tasks that take long, here or in the engine."""
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
            self.notified.emit(words)

    @property
    def may_cancel(self) -> bool:
        return self.task is not None and bool(self.task.cancelled)

    def cancel(self) -> None:
        """Cancel the task that is shown."""
        if self.task is not None and self.may_cancel:
            self.task.cancel()

    def close(self) -> None:
        """End all within a second, and let no other start."""
        self.closed = True
        self._timer.stop()
        for task in self._running:
            task.stop()
        end = time.monotonic() + _GRACE
        for thread in threading.enumerate():  # also those that were stopped before
            if isinstance(thread, BackgroundThread):
                thread.join(max(0.0, end - time.monotonic()))


class BackgroundSave(Generic[_Item]):
    """Saves the newest state of something in a thread, one after the other: a disk may be slow.

    `save` writes a state and returns an error text, which goes to `report` where it changes.
    """

    def __init__(
        self, tasks: Tasks, save: Callable[[_Item], str], report: Callable[[str], object]
    ) -> None:
        self._save, self._report, self._reported = save, report, ""
        self._newest: deque[_Item] = deque(maxlen=1)
        self._writing = threading.Lock()
        self._task = BackgroundTask(tasks, "", self._take, ended=self._go_on)

    def __call__(self, state: _Item) -> None:
        """Save `state` soon."""
        self._newest.append(state)
        self._go_on()

    def finish(self) -> None:
        """Save what is not saved yet, before this returns."""
        self._take(self._write())

    def _go_on(self) -> None:
        if self._newest and not self._task.running:
            self._task.run(self._write)

    def _write(self) -> str:
        with self._writing:
            return self._save(self._newest.popleft()) if self._newest else self._reported

    def _take(self, wrong: str) -> None:
        was, self._reported = self._reported, wrong
        if wrong and wrong != was:
            self._report(wrong)


_EVERY = 40  # ms between two


class Newest(QObject):
    """Rate limit: calls the newest function given, at most 25 times a second."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._waiting: Callable[[], None] | None = None
        self._timer = QTimer(self, singleShot=True, interval=_EVERY)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(self._go_on))

    def __call__(self, act: Callable[[], None]) -> None:
        """Call `act` when the rate allows, unless a newer one comes before."""
        self._waiting = act
        if not self._timer.isActive():
            self._go_on()

    def _go_on(self) -> None:
        act, self._waiting = self._waiting, None
        if act is not None:
            self._timer.start()
            act()

    def forget(self) -> None:
        """Drop the waiting call."""
        self._waiting = None
        self._timer.stop()


def open_another_window(*arguments: str) -> None:
    """Start the app again with these `arguments`, as a program that outlives this one."""
    QProcess.startDetached(sys.executable, ["-m", "kappaskin", "app", *arguments])
