"""What takes longer than a moment, wherever it is done: told in one place, and ended from there."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal

from kappaskin import Status

if TYPE_CHECKING:
    from kappaskin_app.window import MainWindow

_MOMENT = 0.3  # s that needs no words
_STOPPED = "Cancelled while it was computed; what was taken is forgotten."


@dataclass(frozen=True, eq=False)
class Work:
    """Something that may take long: in words, whether it goes on, and what ends it, if anything."""

    words: str
    goes_on: Callable[[], bool]
    cancel: Callable[[], object] | None = None


class Doing(QObject):
    """Follows `works`; `told` says what is done for longer than a moment, or nothing.

    Of several it is the one that goes on longest, `work`, which `cancel` ends.
    """

    told = Signal(str)

    def __init__(
        self,
        works: Sequence[Work],
        parent: QObject | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(parent)
        self._works, self._clock = works, clock
        self._since: dict[Work, float] = {}
        self._words = ""
        self.work: Work | None = None

    def follow(self, _: Status) -> None:
        """Look what goes on now."""
        now = self._clock()
        self._since = {w: self._since.get(w, now) for w in self._works if w.goes_on()}
        long = [work for work, since in self._since.items() if now - since > _MOMENT]
        self.work = min(long, key=lambda work: self._since[work], default=None)
        words = ""
        if self.work is not None:
            more = f", and {len(long) - 1} more" if len(long) > 1 else ""
            words = f"{self.work.words}: {now - self._since[self.work]:.0f} s{more}"
        if words != self._words:
            self._words = words
            self.told.emit(words)

    def cancel(self) -> None:
        """End what is told of."""
        if self.work is not None and self.work.cancel is not None:
            self.work.cancel()


def works_of(window: "MainWindow") -> list[Work]:
    """All in a window that may take long."""
    session, dialog, gallery = window.session, window.exports.dialog, window.scene.gallery
    planning, costing, seeing = window.planning, window.costing, window.seeing
    replaying, calibrating = window.replaying, window.calibrating
    return [
        Work("Making the scene; Ctrl+Z takes it back", lambda: session.making),
        Work(
            "Computing the new settings; Ctrl+Z takes them back", lambda: session.status.computing
        ),
        Work("Reading the recording", lambda: replaying.reading, replaying.stop_reading),
        Work("Writing the export", lambda: dialog.writing, dialog.cancel),
        Work(
            "Computing the calibration",
            lambda: calibrating.computing,
            partial(calibrating.cancel, _STOPPED),
        ),
        Work("Sizing and timing effects", lambda: planning.waiting, planning.cancel),
        Work("Measuring what accuracy costs", lambda: costing.running, costing.cancel),
        Work("Computing how shapes are seen", lambda: seeing.computing, seeing.cancel),
        Work("Painting the scenes", lambda: gallery.painting, gallery.rest),
        Work("Learning what objects read like", lambda: window.naming.learning),
    ]
