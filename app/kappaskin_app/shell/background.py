"""Background tasks: what takes longer than a moment, shown in one place and ended from there."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtCore import QObject, QTimer, Signal

from kappaskin.live import Status
from kappaskin_app.guard import guarded

_MOMENT = 0.3  # s that needs no words


@dataclass(frozen=True, eq=False)
class Task:
    """Something that may take long: in words, whether it goes on, and what ends it, if anything."""

    words: str
    goes_on: Callable[[], bool]
    cancel: Callable[[], object] | None = None


class Tasks(QObject):
    """Follows the tasks that were added; `told` says what goes on for longer than a moment.

    Of several it is the one that goes on longest, `task`, which `cancel` ends.
    """

    told = Signal(str)

    def __init__(
        self, parent: QObject | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__(parent)
        self._tasks: list[Task] = []
        self._clock = clock
        self._since: dict[Task, float] = {}
        self._words = ""
        self.task: Task | None = None

    def add(
        self, words: str, goes_on: Callable[[], bool], cancel: Callable[[], object] | None = None
    ) -> None:
        """Follow something that may take long."""
        self._tasks.append(Task(words, goes_on, cancel))

    def follow(self, _: Status) -> None:
        """Look what goes on now."""
        now = self._clock()
        self._since = {w: self._since.get(w, now) for w in self._tasks if w.goes_on()}
        long = [task for task, since in self._since.items() if now - since > _MOMENT]
        self.task = min(long, key=lambda task: self._since[task], default=None)
        words = ""
        if self.task is not None:
            more = f", and {len(long) - 1} more" if len(long) > 1 else ""
            words = f"{self.task.words}: {now - self._since[self.task]:.0f} s{more}"
        if words != self._words:
            self._words = words
            self.told.emit(words)

    @property
    def may_cancel(self) -> bool:
        return self.task is not None and self.task.cancel is not None

    def cancel(self) -> None:
        """End what is told of."""
        if self.task is not None and self.task.cancel is not None:
            self.task.cancel()


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
