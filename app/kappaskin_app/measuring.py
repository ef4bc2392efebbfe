"""Measuring between two places of the skin that are clicked, as it is bent now."""

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal

from kappaskin import Estimate, distances
from kappaskin_app.views.membrane import MembraneView
from kappaskin_app.views.ruler import Ruler

Array = NDArray[np.float64]

_FIRST = "Measure: click a place on the skin; Esc ends"
_SECOND = "Measure: click another place; Esc ends"


class Measuring(QObject):
    """Takes clicks while it is `on`; a third one begins anew. `changed` says whether it is on."""

    changed = Signal(bool)

    def __init__(self, membrane: MembraneView) -> None:
        super().__init__(membrane)
        self._membrane, self.ruler = membrane, Ruler(membrane.plotter)
        self.on = False
        self._places: list[tuple[float, float]] = []
        self._skin = membrane.skin

    def turn(self) -> None:
        self.end() if self.on else self._begin()

    def _begin(self) -> None:
        self.on, self._places = True, []
        self.ruler.ask(_FIRST)
        self._membrane.plotter.update()
        self.changed.emit(True)

    def end(self) -> None:
        if self.on:
            self.on = False
            self.ruler.hide()
            self._membrane.plotter.update()
            self.changed.emit(False)

    def take(self, x: float, y: float) -> None:
        """Measure from or to the place (x, y) in m."""
        if len(self._places) == 2:
            self._places = []
        self._places.append((x, y))
        self._skin = self._membrane.skin
        if len(self._places) == 1:
            self.ruler.ask(_SECOND)

    def show(self, estimate: Estimate) -> None:
        """Measure on the skin as it is in `estimate`."""
        skin = self._membrane.skin
        if not self.on or not self._places:
            return
        if skin.patch != self._skin.patch:
            self._begin()  # the places were on another skin
            return
        places = np.array(self._places)
        found = None
        if len(places) == 2:
            found = distances(skin.patch, estimate.surface, *places)
        self.ruler.show(skin, places, 2 * self._membrane.lift, found)
