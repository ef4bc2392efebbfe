"""Measurement of the distance between two places on the bent skin."""

import numpy as np
from PySide6.QtCore import QObject, Signal

from kappaskin.frames import Estimate
from kappaskin.skin import distances
from kappaskin_app.features.membrane.annotations import Ruler
from kappaskin_app.features.membrane.membrane import MembraneView

Places = tuple[tuple[float, float], ...] | None

_FIRST = "Measure: click a place on the skin; Esc ends"
_SECOND = "Measure: click another place; Esc ends"

_HINTS = (_FIRST, _SECOND)  # by the number of places


class Measurement(QObject):
    """Measurement by clicks while it is `on`; a third click starts again.

    `places` are up to two (x, y) in m, None while off. `changed` emits whether it is on.
    """

    changed = Signal(bool)

    def __init__(self, membrane: MembraneView) -> None:
        super().__init__(membrane)
        self._membrane, self.ruler = membrane, Ruler(membrane.plotter)
        self.places: Places = None
        self._skin = membrane.skin

    @property
    def on(self) -> bool:
        return self.places is not None

    def toggle(self) -> None:
        if self.on:
            self.end()
        else:
            self.set_places(())

    def end(self) -> None:
        if self.on:
            self.set_places(None)

    def add_place(self, x: float, y: float) -> None:
        """Add the place (x, y) in m as the first or second."""
        before = self.places if self.places is not None and len(self.places) < 2 else ()
        self.set_places((*before, (x, y)))

    def set_places(self, places: Places) -> None:
        """Measure between these places; None switches off."""
        was, self._skin = self.on, self._membrane.skin
        self.places = places
        self.ruler.show_hint(_HINTS[len(places)] if places is not None and len(places) < 2 else "")
        self._membrane.plotter.update()
        if was != self.on:
            self.changed.emit(self.on)

    def show(self, estimate: Estimate) -> None:
        """Update the distances on the skin of `estimate`."""
        skin = self._membrane.skin
        self.ruler.fit()  # the view may have another size
        if not self.places:
            return
        if skin.patch != self._skin.patch:
            self.set_places(())  # the places belong to another skin
            return
        places = np.array(self.places)
        found = None
        if len(places) == 2:
            found = distances(skin.patch, estimate.surface, *places)
        self.ruler.show(skin, places, 2 * self._membrane.lift, found)
