"""Observability of the modes of the basis, computed as a background task."""

from dataclasses import dataclass

import numpy as np
from PySide6.QtCore import QObject, Signal

from kappaskin.bases import Basis, basis_for
from kappaskin.estimation import singular_values
from kappaskin.frames import Array
from kappaskin.live import Status
from kappaskin.sensing import Sensor, SensorLayout
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.history import History

MOST = 576
"""Largest number of functions: parts of the computation block the window."""

_EQUAL = 1.005  # ratio of singular values up to which they count as equal


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Singular values (F,) of a basis on a layout, the largest first, and modes (F, Ni, Nj)."""

    basis: Basis
    layout: SensorLayout
    values: Array
    shapes: Array

    @classmethod
    def of(cls, sensor: Sensor, edge: str, functions: tuple[int, int]) -> "Spectrum":
        layout = sensor.layout
        basis = basis_for(layout.patch, edge, *functions)
        return cls(basis, layout, *singular_values(basis, layout))

    @property
    def floor(self) -> float:
        """The rounding level of the singular values, as in least squares."""
        longer = max(int(self.layout.live.sum()), len(self.values))
        return float(self.values[0]) * longer * float(np.finfo(float).eps)

    @property
    def silent(self) -> int:
        """The number of unobservable modes."""
        return int(np.sum(self.values <= self.floor))

    @property
    def uniform(self) -> bool:
        """Whether all modes are equally observable."""
        return not self.silent and bool(self.values[-1] > self.values[0] / _EQUAL)

    def describe(self) -> str:
        """A summary of the singular values."""
        count = len(self.values)
        if not self.values[0] > 0:
            return "No live elements: no mode is observable."
        worst = float(self.values[0] / self.values[count - self.silent - 1])
        others = (
            "all are equally observable"
            if worst < _EQUAL
            else f"the worst has {_times(worst)} times the noise of the best"
        )
        if not self.silent:
            return f"Condition number {_times(worst)}: of {count} modes {others}."
        verb = "are" if self.silent > 1 else "is"
        return (
            f"Condition number infinite: {self.silent} of {count} modes {verb} unobservable and "
            f"can only be determined by a prior. Of the other modes {others}."
        )

    def mode_text(self, number: int) -> str:
        """The observability of the mode `number`, counted from 1."""
        value = float(self.values[number - 1])
        if value <= self.floor:
            return "Unobservable: it moves the skin without changing a reading."
        worse = float(self.values[0]) / value
        return (
            "As observable as the best mode."
            if worse < _EQUAL
            else f"{_times(worse)} times less observable than the best mode."
        )

    def surface(self, number: int, nx: int, ny: int) -> Array:
        """The mode `number` on a grid, (ny, nx), of largest displacement 1; NaN off the skin."""
        x, y = self.layout.patch.grid(nx, ny)
        surface = self.basis.on_grid(x, y)(self.shapes[number - 1])
        flat = np.nan_to_num(surface).ravel()
        largest = flat[np.argmax(np.abs(flat))]
        return surface / largest if largest else surface


def _times(ratio: float) -> str:
    """Two digits."""
    if ratio < 100:
        return f"{ratio:.2g}"
    if ratio < 1e6:
        return f"{float(f'{ratio:.1e}'):,.0f}".replace(",", "\N{THIN SPACE}")
    return f"more than 10^{int(np.log10(ratio))}"


class Observability(QObject):
    """Computes the spectrum while its panel is visible; `changed` reports a new one.

    `spectrum` is None while it is computed, or refused for the reason in `refusal`.
    """

    changed = Signal()

    def __init__(self, history: History, tasks: Tasks, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._history = history
        self.spectrum: Spectrum | None = None
        self.refusal = ""
        self.number = 0
        """The number of the selected mode, from 1; 0 while there is none."""
        self._selected = False
        self.task = BackgroundTask(
            tasks,
            "Computing the observability of the modes",
            self._show,
            self._refuse,
            cancelled="Cancelled; computed again for another basis or boundary condition.",
        )
        self._request: tuple[object, ...] = ()
        self._active = False

    def set_active(self, active: bool) -> None:
        """Compute while the panel is visible, and only then."""
        self._active = active
        self.changed.emit()

    @property
    def visible_spectrum(self) -> Spectrum | None:
        """The spectrum while the panel is visible."""
        return self.spectrum if self._active else None

    def selected(self) -> Spectrum | None:
        """The visible spectrum; if it is uniform, only after a mode was selected."""
        spectrum = self.visible_spectrum
        return None if spectrum is None or (spectrum.uniform and not self._selected) else spectrum

    def follow(self, status: Status) -> None:
        """Compute the spectrum again when sensor, basis or boundary condition change."""
        if not self._active or status.sensor is None:
            return
        s, sensor = self._history.settings, status.sensor
        functions = s.functions_x, 1 if sensor.layout.patch.strip else s.functions_y
        edge = s.fit_edge or sensor.edge
        request = (status.connections, edge, functions)
        if request != self._request:
            self._request = request
            if functions[0] * functions[1] <= MOST:
                self.task.run(Spectrum.of, sensor, edge, functions)
            else:
                self._show(None, f"Shown for up to {MOST} functions.")

    def select(self, number: int) -> None:
        """Select the mode `number`, from 1."""
        if self.spectrum is not None and 1 <= number <= len(self.spectrum.values):
            self.number, self._selected = number, True
            self.changed.emit()

    def _refuse(self, error: Exception) -> None:
        self._show(None, str(error))

    def _show(self, spectrum: Spectrum | None, refusal: str = "") -> None:
        self.spectrum, self.refusal = spectrum, refusal
        self.number = 0 if spectrum is None else len(spectrum.values)
        self._selected = False
        self.changed.emit()
