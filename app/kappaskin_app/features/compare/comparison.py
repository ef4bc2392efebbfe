"""Comparison of the setup in use with a second one on the same frames."""

from dataclasses import dataclass, replace

import numpy as np
from PySide6.QtCore import QObject, Signal

from kappaskin.frames import Array, Estimate
from kappaskin.live import (
    PairErrors,
    PipelineStatus,
    Status,
    compared_readouts,
    difference_errors,
)
from kappaskin.pipeline import Readout, Setup
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.history import History
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import ComparedSettings, EstimatorSettings, Settings
from kappaskin_app.shell.settings.form_fields import settings_from, setup_values

_RECENT = 30.0  # s of the device's clock, for which the errors of differences are shown


@dataclass(frozen=True, eq=False)
class Pair:
    """One frame computed with both setups; `errors` (n,) are those of the differences, or NaN."""

    a: Estimate
    b: Estimate
    errors: Array

    @property
    def difference(self) -> Array | None:
        """The surface of B minus that of A, (ny, nx) in m; None on different grids."""
        if self.a.surface.shape != self.b.surface.shape:
            return None
        return self.b.surface - self.a.surface

    def figures(self) -> list[tuple[Readout, Readout, float]]:
        """The contact readouts that have an error bar, of A and of B, and that of B - A."""
        each = map(compared_readouts, (self.a, self.b))
        return list(zip(*each, self.errors.tolist(), strict=True))


def other_setup(settings: Settings, setup: Setup) -> Setup:
    """B: the `setup` in use, changed by the `settings` of B."""
    return replace(
        setup,
        **setup_values(settings, ComparedSettings),
        calibration=setup.calibration if settings.other_calibrated else None,
        tare=setup.tare if settings.other_tared else None,
    )


class SetupComparison(QObject):
    """Computes with A and B while the panel is visible; `compared` sends each new pair.

    `status` is the pipeline status of B, None while the panel is hidden. The errors of differences
    are computed about once a second, in a process of low priority.
    """

    compared = Signal(Pair)

    def __init__(
        self, history: History, session: Session, tasks: Tasks, parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self._history, self._session = history, session
        self._active = False
        self._shown: tuple[int, ...] = ()
        self._task = BackgroundTask(tasks, "", self._take_errors)
        self._rings: tuple[object, ...] = ()
        self._errors: PairErrors | None = None

    def set_active(self, active: bool) -> None:
        """Start or stop computing with B."""
        if active != self._active and not self._session.closed:
            self._active = active
            self._shown, self._rings = (), ()
            self._task.stop()
            self._request()

    def swap(self) -> None:
        """Exchange the setup in use and B, as one change."""
        s = self._history.settings
        a, b = setup_values(s, EstimatorSettings), setup_values(s, ComparedSettings)
        swapped = settings_from(b, EstimatorSettings) | settings_from(a, ComparedSettings)
        self._history.change("Swap A and B", -1, **swapped)

    def _request(self) -> None:
        setup = None
        if self._active:
            setup = other_setup(self._history.settings, self._session.engine.requested.setup)
        if setup != self._session.engine.requested.compared:
            self._session.engine.compare(setup)

    def follow(self, status: Status) -> None:
        """Request the present setups, and send a new pair."""
        self._request()
        engine = self._session.engine
        if self._active and self._rings != engine.rings:
            self._rings = engine.rings
            self._task.compute(difference_errors, *engine.rings)
        if self._active and (pair := engine.pair(status)) is not None:
            a, b = pair
            shown = a.generation, b.generation, a.sequence
            if shown != self._shown:
                self._shown = shown
                self.compared.emit(Pair(a, b, self._errors_of(a, b)))

    def _take_errors(self, errors: PairErrors) -> None:
        """Show the errors with the next pair, or with the one that is shown."""
        self._errors, self._shown = errors, ()

    def _errors_of(self, a: Estimate, b: Estimate) -> Array:
        """The newest errors, if they are of these setups and not of another time."""
        errors, generations = self._errors, (a.generation, b.generation)
        if errors is None or errors.generations != generations:
            return np.full(len(compared_readouts(a)), np.nan)
        recent = abs(errors.device_time - a.device_time) <= _RECENT
        return np.where(recent, errors.sd, np.nan)

    @property
    def status(self) -> PipelineStatus | None:
        return self._session.status.compared if self._active else None
