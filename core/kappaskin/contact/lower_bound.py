"""Lower bounds of force: contacts on a skin that may stretch more than its force accounts for."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from kappaskin.bases import basis_for
from kappaskin.frames import Contact
from kappaskin.mechanics import USUAL_THICKNESS, Plate, PointLoad, Stretching
from kappaskin.skin import Patch

_FUNCTIONS = 9  # along a side


class LowerBound:
    """Marks a contact whose force would change by more than its error bar if the skin stretched.

    The force F is that of a plate that does not stretch where that is flat and of unknown
    thickness, or a disk or polygon. One 0.25 mm thick, or as thick as was given, needs
        F (1 + beta (w/h)^2)
    for the displacement w at the contact. beta is fitted once: what stretching adds to the force in
    the middle, in the shape that a point load makes of a plate that does not stretch, pressed in by
    h; a disk or polygon counts as the rectangle around it. Of a hinged square that is held, the
    change is right to 20 % up to w = h, also at a fifth of its sides, and 1.4 times too much at
    w = 2.6 h. Where known weights showed no stiffening down to a displacement `seen` in m, none is
    marked that is no deeper.
    """

    def __init__(self, plate: Plate, edge: str, seen: float = 0.0) -> None:
        self._seen = seen
        # A bent skin's force accounts for its stretch; a drum head's modulus is unknown.
        accounted = plate.stretches or plate.patch.arc_curvature or not plate.rigidity
        self._h = plate.thickness or USUAL_THICKNESS
        self._beta = 0.0 if accounted else _stiffening(replace(plate, thickness=self._h), edge)

    def __call__(self, contact: Contact) -> Contact:
        """The contact, marked if its force is a lower bound."""
        if abs(contact.displacement) <= self._seen:
            return contact
        change = self._beta * (contact.displacement / self._h) ** 2 * abs(contact.force)
        return replace(contact, force_is_lower_bound=True) if change > contact.force_sd else contact


@lru_cache(8)  # asked for again whenever a setting changes
def _stiffening(plate: Plate, edge: str) -> float:
    """What stretching adds to the force in the middle of `plate` pressed in by its thickness."""
    patch, h = plate.patch, plate.thickness or USUAL_THICKNESS
    around = Patch(patch.a, patch.b, strip=patch.strip)
    plate = replace(plate, patch=around)
    basis = basis_for(around, edge, _FUNCTIONS, 1 if around.strip else _FUNCTIONS)
    modal = PointLoad(around.a / 2, around.b / 2).modal(basis)
    shape = plate.compliance(basis)(modal)
    gives = float(np.vdot(modal, shape))
    w = shape * (h / gives)
    return float(np.vdot(w, Stretching(plate, basis).force(w))) * gives / h**2
