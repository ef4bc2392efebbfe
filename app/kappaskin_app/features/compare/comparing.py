"""What the engine computes of the same frames with other settings, held against what is in use."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal

from kappaskin.frames import Estimate
from kappaskin.live import PipelineStatus, Status
from kappaskin.pipeline import REPORTED, Readout, Setup, readouts
from kappaskin_app.shell.history import History
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import ComparedSettings, EstimatorSettings, Settings
from kappaskin_app.shell.settings.form_fields import settings_from, setup_values

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pair:
    """One frame computed with both setups."""

    a: Estimate
    b: Estimate

    @property
    def difference(self) -> Array | None:
        """The surface of B less that of A, (ny, nx) in m; None where they are of other points."""
        if self.a.surface.shape != self.b.surface.shape:
            return None
        return self.b.surface - self.a.surface

    def figures(self) -> list[tuple[Readout, Readout]]:
        """What both say of the contact: A and B of each number that has an error bar."""
        pairs = zip(readouts(self.a), readouts(self.b), strict=True)
        return [(a, b) for a, b in pairs if a.label in _COMPARED]


_COMPARED = {label for each in REPORTED if each.sd is not None for label in each.labels_shown}
"""Readouts that have a standard deviation, against which a difference is judged."""


def other_setup(settings: Settings, setup: Setup) -> Setup:
    """B: the `setup` in use, but for what `settings` say of it."""
    return replace(
        setup,
        **setup_values(settings, ComparedSettings),
        calibration=setup.calibration if settings.other_calibrated else None,
        tare=setup.tare if settings.other_tared else None,
    )


class Comparing(QObject):
    """Has the engine compute with B while somebody looks; `compared` brings each new pair.

    `told` is how B is doing, None while nobody looks.
    """

    compared = Signal(Pair)

    def __init__(self, history: History, session: Session, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._history, self._session = history, session
        self._asked: Setup | None = None
        self._watched = False
        self._shown: tuple[int, ...] = ()

    def watch(self, watched: bool) -> None:
        """Compute with B from now on, or no more."""
        if watched != self._watched and not self._session.closed:
            self._watched = watched
            self._shown = ()
            self._ask()

    def swap(self) -> None:
        """Let what is in use and B change places, as one change."""
        s = self._history.settings
        a, b = setup_values(s, EstimatorSettings), setup_values(s, ComparedSettings)
        swapped = settings_from(b, EstimatorSettings) | settings_from(a, ComparedSettings)
        self._history.change("Swap A and B", -1, **swapped)

    def _ask(self) -> None:
        wanted = None
        if self._watched:
            wanted = other_setup(self._history.settings, self._session.asked)
        if wanted != self._asked:
            self._asked = wanted
            self._session.engine.compare(wanted)

    def follow(self, status: Status) -> None:
        """Ask for what is wanted by now, and bring what came of it."""
        self._ask()
        if self._watched and (pair := self._read(status)) is not None:
            shown = pair.a.generation, pair.b.generation, pair.a.sequence
            if shown != self._shown:
                self._shown = shown
                self.compared.emit(pair)

    def _read(self, status: Status) -> Pair | None:
        """The newest frame that was computed with both."""
        engine = self._session.engine
        b = engine.compared(status)
        a = None if b is None else engine.latest(status, b.sequence)
        return None if a is None or b is None else Pair(a, b)

    @property
    def told(self) -> PipelineStatus | None:
        return self._session.status.compared if self._watched else None
