"""How well the elements see each shape of the basis, computed in the background."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal

from kappaskin.bases import Basis, basis_for
from kappaskin.estimation import singular_values
from kappaskin.live import Status
from kappaskin.sensing import Sensor, SensorLayout
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.history import History

Array = NDArray[np.float64]

MOST = 576
"""Functions up to which it is computed: the window waits for parts of it, and longer for more."""

_ALIKE = 1.005  # times as much noise, or less, is as much


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Singular values (F,) of a basis on a layout, the best seen first, and shapes (F, Ni, Nj)."""

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
        """Below it a value is nothing but rounding, as least squares counts."""
        longer = max(int(self.layout.live.sum()), len(self.values))
        return float(self.values[0]) * longer * float(np.finfo(float).eps)

    @property
    def silent(self) -> int:
        """How many shapes change no reading."""
        return int(np.sum(self.values <= self.floor))

    @property
    def alike(self) -> bool:
        """Whether all shapes are seen equally well, so that none of them is telling."""
        return not self.silent and bool(self.values[-1] > self.values[0] / _ALIKE)

    def describe(self) -> str:
        """What the values mean, in words."""
        count = len(self.values)
        if not self.values[0] > 0:
            return "Nothing is read: no shape is seen."
        worst = float(self.values[0] / self.values[count - self.silent - 1])
        seen = (
            "all are seen alike"
            if worst < _ALIKE
            else f"the worst takes {_times(worst)} times the noise of the best"
        )
        if not self.silent:
            return f"Condition number {_times(worst)}: of {count} shapes {seen}."
        what = f"{self.silent} of {count} shapes" if self.silent > 1 else f"one of {count} shapes"
        verb = "change" if self.silent > 1 else "changes"
        return (
            f"Condition number infinite: {what} {verb} no reading, and only a prior could decide "
            f"{'them' if self.silent > 1 else 'it'}. Of the others {seen}."
        )

    def told(self, number: int) -> str:
        """How well the shape `number`, counted from 1, is seen."""
        value = float(self.values[number - 1])
        if value <= self.floor:
            return "It moves the skin and changes no reading."
        worse = float(self.values[0]) / value
        return (
            "Seen as well as the best."
            if worse < _ALIKE
            else f"Seen {_times(worse)} times less than the best."
        )

    def surface(self, number: int, nx: int, ny: int) -> Array:
        """The shape `number` on a grid, (ny, nx), its largest displacement 1; NaN off the skin."""
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


class Seeing(QObject):
    """Follows what is asked for while somebody looks; `changed` tells when it is another spectrum.

    `spectrum` is None while `refusal` says why there is none, or while it is computed.
    """

    changed = Signal()

    def __init__(self, history: History, tasks: Tasks, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._history = history
        self.spectrum: Spectrum | None = None
        self.refusal = ""
        self.chosen = 0
        """The number of the shape that is looked at, from 1; 0 while there is none."""
        self._picked = False
        self.task = BackgroundTask(
            tasks,
            "Computing how shapes are seen",
            self._show,
            self._refuse,
            cancelled="Cancelled; another basis or edge is computed again.",
        )
        self._asked: tuple[object, ...] = ()
        self._watched = False

    def watch(self, watched: bool) -> None:
        """Compute what is asked for only while somebody looks."""
        self._watched = watched
        self.changed.emit()

    @property
    def seen(self) -> Spectrum | None:
        """The spectrum while somebody looks at it."""
        return self.spectrum if self._watched else None

    def telling(self) -> Spectrum | None:
        """The spectrum while somebody looks at a shape that tells something, or chose it."""
        spectrum = self.seen
        return None if spectrum is None or (spectrum.alike and not self._picked) else spectrum

    def follow(self, status: Status) -> None:
        """Begin anew when something else is asked for."""
        if not self._watched or status.sensor is None:
            return
        s, sensor = self._history.settings, status.sensor
        functions = s.functions_x, 1 if sensor.layout.patch.strip else s.functions_y
        edge = s.fit_edge or sensor.edge
        asked = (status.connections, edge, functions)
        if asked != self._asked:
            self._asked = asked
            if functions[0] * functions[1] <= MOST:
                self.task.run(Spectrum.of, sensor, edge, functions)
            else:
                self._show(None, f"Shown for up to {MOST} functions.")

    def choose(self, number: int) -> None:
        """Look at the shape `number`, from 1."""
        if self.spectrum is not None and 1 <= number <= len(self.spectrum.values):
            self.chosen, self._picked = number, True
            self.changed.emit()

    def _refuse(self, error: Exception) -> None:
        self._show(None, str(error))

    def _show(self, spectrum: Spectrum | None, refusal: str = "") -> None:
        self.spectrum, self.refusal = spectrum, refusal
        self.chosen = 0 if spectrum is None else len(spectrum.values)
        self._picked = False
        self.changed.emit()
