"""What takes longer than a moment, wherever it is done: told in one place, and ended from there."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal

from kappaskin.live import Status

if TYPE_CHECKING:
    from kappaskin_app.shell.window import MainWindow

_MOMENT = 0.3  # s that needs no words
_STOPPED = "Cancelled while it was computed; what was taken is forgotten."


@dataclass(frozen=True, eq=False)
class Task:
    """Something that may take long: in words, whether it goes on, and what ends it, if anything."""

    words: str
    goes_on: Callable[[], bool]
    cancel: Callable[[], object] | None = None


class Doing(QObject):
    """Follows `tasks`; `told` says what is done for longer than a moment, or nothing.

    Of several it is the one that goes on longest, `task`, which `cancel` ends.
    """

    told = Signal(str)

    def __init__(
        self,
        tasks: Sequence[Task],
        parent: QObject | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(parent)
        self._tasks, self._clock = tasks, clock
        self._since: dict[Task, float] = {}
        self._words = ""
        self.task: Task | None = None

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


def tasks_of(window: "MainWindow") -> list[Task]:
    """All in a window that may take long."""
    session, gallery = window.session, window.scene.gallery
    export, repair = window.exports.dialog, window.taping.repairs
    planning, costing, seeing = window.planning, window.costing, window.seeing
    replaying, calibrating = window.replaying, window.calibrating
    designing = window.designing
    return [
        Task("Making the scene; Ctrl+Z takes it back", lambda: session.making),
        Task(
            "Computing the new settings; Ctrl+Z takes them back", lambda: session.status.computing
        ),
        Task("Reading the recording", lambda: replaying.reading, replaying.stop_reading),
        Task("Writing the export", lambda: export.busy, export.cancel),
        Task("Repairing the recording", lambda: repair.busy, repair.cancel),
        Task(
            "Computing the calibration",
            lambda: calibrating.computing,
            partial(calibrating.cancel, _STOPPED),
        ),
        Task("Sizing and timing effects", lambda: planning.waiting, planning.cancel),
        Task("Measuring what accuracy costs", lambda: costing.running, costing.cancel),
        Task("Computing how shapes are seen", lambda: seeing.computing, seeing.cancel),
        Task("Placing the design's elements", lambda: designing.predicting, designing.cancel),
        Task("Simulating the design", lambda: designing.checking, designing.cancel),
        Task("Painting the scenes", lambda: gallery.painting, gallery.rest),
        Task("Learning what objects read like", lambda: window.naming.learning),
    ]
