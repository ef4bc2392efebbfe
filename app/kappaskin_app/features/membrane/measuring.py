"""Measuring between two places of the skin that are clicked, as it is bent now."""

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal

from kappaskin.frames import Estimate
from kappaskin.skin import Patch, distances
from kappaskin_app.features.membrane.annotations import Ruler
from kappaskin_app.features.membrane.membrane import MembraneView

Array = NDArray[np.float64]
Places = tuple[tuple[float, float], ...] | None

_FIRST = "Measure: click a place on the skin; Esc ends"
_SECOND = "Measure: click another place; Esc ends"

_NEARER = 1 - 1e-9  # to the middle, so that a place on the rim is not beside it
_ASKED = (_FIRST, _SECOND)  # by how many places there are


class Measuring(QObject):
    """Takes clicks while it is `on`; a third one begins anew. `changed` says whether it is on.

    `stepped` tells what a person did, in words, and the `places` before and after: up to two, each
    (x, y) in m, or None while nothing is measured.
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

    def turn(self) -> None:
        if self.on:
            self.end()
        else:
            self._step("measure", ())

    def end(self) -> None:
        if self.on:
            self._step("end measuring", None)

    def take(self, x: float, y: float) -> None:
        """Measure from or to the place (x, y) in m."""
        before = self.places if self.places is not None and len(self.places) < 2 else ()
        self._step("measure to here" if before else "measure from here", (*before, (x, y)))

    def _step(self, words: str, after: Places) -> None:
        self.stepped.emit(words, self.places, after)

    def have(self, places: Places) -> None:
        """Measure between these."""
        was, self._skin = self.on, self._membrane.skin
        if places and not _lie_on(self._skin.patch, places):
            places = ()  # undo brought them back, and there is another skin by now
        self.places = places
        self.ruler.ask(_ASKED[len(places)] if places is not None and len(places) < 2 else "")
        self._membrane.plotter.update()
        if was != self.on:
            self.changed.emit(self.on)

    def show(self, estimate: Estimate) -> None:
        """Measure on the skin as it is in `estimate`."""
        skin = self._membrane.skin
        self.ruler.fit()  # into a picture that may have another size
        if not self.places:
            return
        if skin.patch != self._skin.patch:
            self.have(())  # the places were on another skin
            return
        places = np.array(self.places)
        found = None
        if len(places) == 2:
            found = distances(skin.patch, estimate.surface, *places)
        self.ruler.show(skin, places, 2 * self._membrane.lift, found)


def _lie_on(patch: Patch, places: tuple[tuple[float, float], ...]) -> bool:
    """Whether all `places` in m are on a patch, its rim included however they are rounded."""
    middle = np.array([patch.a, patch.b]) / 2
    return bool(patch.contains(middle + _NEARER * (np.array(places) - middle)).all())
