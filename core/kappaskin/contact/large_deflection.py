"""Large deflection: contacts on a skin that is stiffer or softer than their force accounts for."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from kappaskin.bases import Basis, basis_for, overlaps
from kappaskin.frames import Array, Contact
from kappaskin.mechanics import USUAL_THICKNESS, DiscLoad, Plate, PointLoad, Stretching
from kappaskin.skin import Patch

_FUNCTIONS = 9  # along a side
_NODES = 33  # along a side, at which it is known how far a curved skin gives
_SOFTER = (0.25, 0.5, 0.75, 1, 1.25, 1.5, 2, 2.5, 3, 3.5, 4, 5, 6, 8)  # depths in thicknesses
_STIFFER = (0.25, 0.5, 1, 2, 4, 8)
_DENT = 7.0  # sqrt(R h): what a dent in a dome feels of it on either side is half as wide
_SHALLOW = 1000.0  # thicknesses: a dome of this radius is shallow as wide as a dent
_RADII = np.geomspace(1e-3, 0.2, 40)  # of the shorter side: of the discs that a load may seem


class LargeDeflection:
    """Marks a contact whose force would change by more than its error bar by large deflection.

    The force F is that of a plate that does not stretch where that is flat and of unknown
    thickness, or a disk or polygon. One 0.25 mm thick, or as thick as was given, needs
        F (1 + beta (w/h)^2)
    for the displacement w at the contact. beta is fitted once: what stretching adds to the force in
    the middle, in the shape that a point load makes of a plate that does not stretch, pressed in by
    h; a disk or polygon counts as the rectangle around it. Of a hinged square that is held, the
    change is right to 20 % up to w = h, also at a fifth of its sides, and 1.4 times too much at
    w = 2.6 h. Where known weights showed no stiffening down to a displacement `seen` in m, none is
    marked that is no deeper.

    Of a dome, saddle or trough the force is that of a linear shell. What it leaves out is part of
    its error bar here (`_CurvedSkin`), and where the skin snaps through there is no force.
    """

    def __init__(self, plate: Plate, edge: str, seen: float = 0.0) -> None:
        self._seen, patch = seen, plate.patch
        bent, curved = patch.arc_curvature, any(patch.curvatures)
        self._curved = None
        if curved and not bent and plate.rigidity and not plate.unknown_material:
            self._curved = _curved(plate, edge)
        # A cylinder skin's force accounts for its stretch; a drum head's modulus is unknown.
        accounted = plate.stretches or curved or not plate.rigidity
        self._h = plate.thickness or USUAL_THICKNESS
        self._beta = 0.0 if accounted else _stiffening(replace(plate, thickness=self._h), edge)

    def __call__(self, contact: Contact) -> Contact:
        """The contact, marked where its force leaves out too much."""
        if abs(contact.displacement) <= self._seen:
            return contact
        if self._curved is not None:
            return self._curved(contact)
        change = self._beta * (contact.displacement / self._h) ** 2 * abs(contact.force)
        return replace(contact, force_is_lower_bound=True) if change > contact.force_sd else contact


# A dome that is pressed in softens: w_x^2 / 2 takes back what -w / R stretches (`Stretching`). The
# shape under a load in the middle is followed from depth to depth until the skin snaps through. The
# force F of the disc under which the curvatures of the linear shell are nearest to its own is what
# is reported, in place of the true force T. T / F - 1 depends on w / h, with the depth w that the
# linear shell has under F, and hardly on the place; in the middle it is largest, and the skin snaps
# through first. In a dome that is wide for its radius only a dent of a few sqrt(R h) matters.
# Lengths k times as long and radii k^2 times as large change nothing but what the skin gives, k^2
# times as much: computed is a dome as wide as the dent and as shallow as the theory needs. A cap
# counts as what it is at its pole.
class _CurvedSkin:
    """What large deflection changes of the force on a dome, saddle or trough.

    The change is added to the force's variance; where the skin snaps through the force is NaN.
    """

    def __init__(self, plate: Plate, edge: str) -> None:
        self._patch = plate.patch
        plate, edge, grown = _dent(plate, edge)
        patch, h = plate.patch, plate.sheet_thickness or USUAL_THICKNESS
        basis = basis_for(patch, edge, _FUNCTIONS, _FUNCTIONS)
        C = plate.compliance(basis).after(np.eye(basis.size))
        points = basis.at(np.stack(np.meshgrid(*patch.grid(_NODES, _NODES)), -1).reshape(-1, 2))
        gives = np.vecdot(points @ C, points).reshape(_NODES, _NODES) / h
        middle = float(gives[_NODES // 2, _NODES // 2])
        # Depths in thicknesses per N, at nodes of the box around the skin.
        whole = patch is self._patch
        self._gives = gives if whole else np.full_like(gives, middle / grown)
        modal = PointLoad(patch.a / 2, patch.b / 2).modal(basis)
        stretching, reported = Stretching(plate, basis), _reported_force(basis, C)
        self._ends, table = list[float](), dict[float, float]()
        for sign in (-1, 1):
            depths = _SOFTER if sign * sum(patch.curvatures) >= 0 else _STIFFER
            side = [(0.0, 0.0)]
            for true, shape in stretching.path(modal, [sign * h * depth for depth in depths]):
                force = reported(shape)
                side.append((middle * force, true / force - 1))
            self._ends.append(sign * math.inf if len(side) > len(depths) else side[-1][0])
            table |= dict(side)
        self._depths = np.array(sorted(table))
        self._changes = np.array([table[depth] for depth in sorted(table)])

    def __call__(self, contact: Contact) -> Contact:
        """The contact, with the error of a linear shell in its force's error bar."""
        if not contact.present:
            return contact
        x, y = contact.position.item(0), contact.position.item(1)
        last = _NODES - 1
        node = round(last * y / self._patch.b), round(last * x / self._patch.a)
        depth: float = self._gives.item(*node) * contact.force
        outward, inward = self._ends
        if depth < outward or depth > inward:
            return replace(contact, force=math.nan, force_sd=math.nan, snaps_through=True)
        change = float(np.interp(depth, self._depths, self._changes))
        error = abs(change * contact.force)
        passed = error > contact.force_sd
        return replace(
            contact,
            force_sd=math.hypot(contact.force_sd, error),
            force_is_lower_bound=passed and change > 0,
            force_is_upper_bound=passed and change < 0,
        )


def _dent(plate: Plate, edge: str) -> tuple[Plate, str, float]:
    """The skin to compute, its edge, and how many times as much it gives."""
    patch, h = plate.patch, plate.sheet_thickness or USUAL_THICKNESS
    Rx, Ry = patch.radii
    wide = [_DENT * math.sqrt(abs(R) * h) for R in (Rx, Ry)]
    sides = [min(pair) for pair in zip(wide, (patch.a, patch.b), strict=True)]
    cut = 0 < Rx * Ry < math.inf and sides != [patch.a, patch.b]
    if patch.is_shallow and not cut:
        return plate, edge, 1.0
    grown = max(1.0, _SHALLOW * h / min(abs(Rx), abs(Ry)))
    a, b = (math.sqrt(grown) * side for side in sides)
    below = {"foundation": plate.foundation / grown**2, "tension": plate.tension / grown}
    around = Patch(a, b, (grown * Rx, grown * Ry))
    plate = replace(plate, patch=around, **below, fluid=False, inplane="")
    return plate, "hinged" if cut else edge, grown


def _reported_force(basis: Basis, C: Array) -> Callable[[Array], float]:
    """A function of a shape (Ni, Nj) in m: the force in N of the disc that fits it best.

    By the curvatures under a disc in the middle of a linear skin with the compliance `C` (N, N).
    """
    patch, overlap = basis.patch, overlaps(basis)
    weights = sum(overlap(order, order) for order in ((2, 0), (0, 2), (1, 1)))
    x, y, side = patch.a / 2, patch.b / 2, min(patch.a, patch.b)
    loads = [DiscLoad(x, y, radius * side).modal(basis).ravel() for radius in _RADII]
    shapes = np.stack(loads) @ C
    rows = shapes @ weights
    squares = np.vecdot(rows, shapes)

    def force(shape: Array) -> float:
        along = rows @ shape.ravel()
        best = int(np.argmax(along**2 / squares))
        return float(along[best] / squares[best])

    return force


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


_curved = lru_cache(8)(_CurvedSkin)  # likewise
