"""Measurement of the distance between two places on the bent skin."""

import numpy as np
from PySide6.QtCore import QObject, Signal

from kappaskin.frames import Estimate
from kappaskin.skin import Patch, distances
from kappaskin_app.features.membrane.annotations import Ruler
from kappaskin_app.features.membrane.membrane import MembraneView

Places = tuple[tuple[float, float], ...] | None

_FIRST = "Measure: click a place on the skin; Esc ends"
_SECOND = "Measure: click another place; Esc ends"

_INWARD = 1 - 1e-9  # scale towards the middle, so that rounding leaves no place outside the rim
_HINTS = (_FIRST, _SECOND)  # by the number of places


class Measurement(QObject):
    """Measurement by clicks while it is `on`; a third click starts again.

    `changed` emits whether it is on; `stepped` the words of a step and the `places` before and
    after it: up to two (x, y) in m, None while off.
    """

    changed = Signal(bool)
    stepped = Signal(str, object, object)

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
            self._step("measure", ())

    def end(self) -> None:
        if self.on:
            self._step("end measurement", None)

    def add_place(self, x: float, y: float) -> None:
        """Add the place (x, y) in m as the first or second."""
        before = self.places if self.places is not None and len(self.places) < 2 else ()
        self._step("measure to here" if before else "measure from here", (*before, (x, y)))

    def _step(self, words: str, after: Places) -> None:
        self.stepped.emit(words, self.places, after)

    def set_places(self, places: Places) -> None:
        """Measure between these places; None switches off."""
        was, self._skin = self.on, self._membrane.skin
        if places and not _lie_on(self._skin.patch, places):
            places = ()  # restored by undo, but outside the present skin
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


def _lie_on(patch: Patch, places: tuple[tuple[float, float], ...]) -> bool:
    """Whether all `places` in m are on a patch, including its rim despite rounding."""
    middle = np.array([patch.a, patch.b]) / 2
    return bool(patch.contains(middle + _INWARD * (np.array(places) - middle)).all())
