"""Comparison of the setup in use with a second one on the same frames."""

from dataclasses import dataclass, replace

from PySide6.QtCore import QObject, Signal

from kappaskin.frames import Array, Estimate
from kappaskin.live import PipelineStatus, Status
from kappaskin.pipeline import REPORTED, Readout, Setup, readouts
from kappaskin_app.shell.history import History
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import ComparedSettings, EstimatorSettings, Settings
from kappaskin_app.shell.settings.form_fields import settings_from, setup_values


@dataclass(frozen=True, eq=False)
class Pair:
    """One frame computed with both setups."""

    a: Estimate
    b: Estimate

    @property
    def difference(self) -> Array | None:
        """The surface of B minus that of A, (ny, nx) in m; None on different grids."""
        if self.a.surface.shape != self.b.surface.shape:
            return None
        return self.b.surface - self.a.surface

    def figures(self) -> list[tuple[Readout, Readout]]:
        """The contact readouts that have an error bar, of A and of B."""
        pairs = zip(readouts(self.a), readouts(self.b), strict=True)
        return [(a, b) for a, b in pairs if a.label in _COMPARED]


_COMPARED = {label for each in REPORTED if each.sd is not None for label in each.labels_shown}
"""Readouts that have a standard deviation, against which a difference is judged."""


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

    `status` is the pipeline status of B, None while the panel is hidden.
    """

    compared = Signal(Pair)

    def __init__(self, history: History, session: Session, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._history, self._session = history, session
        self._active = False
        self._shown: tuple[int, ...] = ()

    def set_active(self, active: bool) -> None:
        """Start or stop computing with B."""
        if active != self._active and not self._session.closed:
            self._active = active
            self._shown = ()
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
        if self._active and (pair := self._read(status)) is not None:
            shown = pair.a.generation, pair.b.generation, pair.a.sequence
            if shown != self._shown:
                self._shown = shown
                self.compared.emit(pair)

    def _read(self, status: Status) -> Pair | None:
        """The newest frame that was computed with both setups."""
        engine = self._session.engine
        b = engine.compared(status)
        a = None if b is None else engine.latest(status, b.sequence)
        return None if a is None or b is None else Pair(a, b)

    @property
    def status(self) -> PipelineStatus | None:
        return self._session.status.compared if self._active else None
