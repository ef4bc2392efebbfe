"""A quantity of every element as one cell, not interpolated, with its scale and its value."""

import math

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QVBoxLayout, QWidget

from kappaskin.estimation import FAULTS
from kappaskin.sensing import SensorLayout
from kappaskin_app.features.heatmaps.flat_cells import FlatCells
from kappaskin_app.shell.shades import SHADES
from kappaskin_app.theme import Theme
from kappaskin_app.widgets.colour_bar import ColourBar, LockButton
from kappaskin_app.widgets.line import Line
from kappaskin_app.widgets.tint import Tint

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_LEGEND = (
    "One cell for each element. Grey: no reading. Violet: on a rail, the end of the converter's "
    "range, beyond which nothing is known. "
    "Crossed: bent beyond 1 % strain, where the gage is not elastic any more. Dotted: chosen to be "
    "in every frame. A letter: left out, and why: D dead, S stuck, N noisy, "
    "R on a rail, X swapped, T drifting, O off by the same, P a spike. Framed: to be pressed now."
)


class Heatmap(QWidget):
    """One quantity, element by element; says which element is pointed at.

    `picked` says which one is to be told all about.
    """

    pointed = Signal(int)
    chosen = Signal(int)
    lock_wanted = Signal(float)

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.name, self._shade = name, SHADES[name]
        self._title = QLabel(f"<b>{self._shade.symbol}</b>")
        self._title.setToolTip(self._shade.tip)
        self.value = Line()
        self.value.setToolTip("The element under the mouse, else the largest reading.")
        self.lock = LockButton()
        self.lock.wanted.connect(self._ask_lock)
        self.lock.setVisible(name != "health")  # whose colours are no range
        self.lock.setEnabled(name != "health")
        self.cells, self.bar = FlatCells(), ColourBar()
        self.cells.setToolTip(_LEGEND)
        self.cells.setAccessibleName(f"Heatmap of {name.replace('_', ' ')}")
        self.cells.pointed.connect(self.pointed)
        self.cells.chosen.connect(self.chosen)
        self._tint, self._layout, self._element = self._shade.tint(1.0), None, -1
        self._missing = "#888888"
        self._kinds: dict[int, str] = {}
        top = QHBoxLayout()
        top.addWidget(self._title)
        top.addWidget(self.value, 1)
        top.addWidget(self.lock)
        middle = QHBoxLayout()
        middle.addWidget(self.cells, 1)
        middle.addWidget(self.bar)
        around = QVBoxLayout(self)
        around.setContentsMargins(6, 4, 4, 4)
        around.setSpacing(3)
        around.addLayout(top)
        around.addLayout(middle, 1)

    def show_lock(self, locked: bool) -> None:
        self.lock.show_locked(locked)

    def show_layout(self, layout: SensorLayout) -> None:
        self._layout = layout
        self._element = -1
        self.cells.show_layout(layout)

    def show_element(self, element: int) -> None:
        """Point at an element here because it is pointed at elsewhere; -1 at none."""
        self._element = element
        self.cells.point_at(element)

    @property
    def limit(self) -> float:
        """How far the colours reach, in SI units."""
        return self._tint.limit / self._shade.scale

    def _ask_lock(self, locked: bool) -> None:
        self.lock_wanted.emit(self.limit * locked)

    def show_values(self, values: Array, tint: Tint, railed: Mask | None = None) -> None:
        """Colour `values` (P,) on the screen's scale by `tint`, but those that are `railed`."""
        self._tint = tint
        self.cells.show_cells(tint.rgb(values, self._missing, railed))
        self.bar.show_tint(tint, tint.legend(values, self._missing, railed))

    def show_marks(self, crossed: Mask, dotted: Mask, kinds: NDArray[np.uint8]) -> None:
        """Cross out elements (P,) bent too far, dot those chosen to scan, ring those left out.

        Of these `kinds` (P,) say why, by number in `FAULTS`.
        """
        self._kinds = {int(p): FAULTS[kinds[p]] for p in np.flatnonzero(kinds)}
        self.cells.show_marks(np.flatnonzero(crossed), np.flatnonzero(dotted), self._kinds)

    def show_wanted(self, element: int) -> None:
        """Frame the element that is to be pressed; -1 for none."""
        self.cells.show_wanted(element)

    def show_lost(self, lost: bool) -> None:
        """Fade the cells while what they show is not coming in any more."""
        self.cells.show_faded(lost)

    def show_reading(self, values: Array) -> None:
        """Write the value of the element pointed at, else the largest."""
        if self._layout is None or len(values) != len(self._layout):
            self.value.show_text("")
        elif self._element >= 0:
            self.value.show_text(self._of_one(self._element, values[self._element], self._layout))
        else:
            self.value.show_text(self._of_all(values), "peak ")

    def _of_one(self, element: int, value: float, layout: SensorLayout) -> str:
        x, y = layout.positions[element] * 1e3
        what = self._shade.written(value) if math.isfinite(value) else "no reading"
        why = f", {self._kinds[element]}" if element in self._kinds and self.bar.scaled else ""
        return f"{what} at ({x:.0f}, {y:.0f}) mm{why}"

    def _of_all(self, values: Array) -> str:
        finite = values[np.isfinite(values)]
        if not self.bar.scaled:
            ill = int(np.count_nonzero(finite))
            return f"{ill} not well" if ill else "all well"
        peak = finite[np.argmax(np.abs(finite))] if len(finite) else math.nan
        missing = len(values) - len(finite)
        told = [f"peak {self._shade.written(peak)}"] if len(finite) else []
        return ", ".join(told + [f"{missing} missing"] * bool(missing))

    def show_theme(self, theme: Theme) -> None:
        self._missing = theme.missing
        self.cells.show_line(theme.line)
