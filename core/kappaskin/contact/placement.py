"""What was found to touch the skin to a rigid object that stands there."""

import math

from kappaskin.contact.objects import ContactObject
from kappaskin.frames import Array
from kappaskin.mechanics import Block, Cylinder, Placed, RigidObject, Sphere, Wedge

_FLAT = 100.0  # times the size: a rounder object is not told from a flat one
_SHORTEST = 0.02  # of the size: an object as short as that is drawn at least so long
_SHARP = math.radians(70)  # between the flanks of an edge, which the readings do not tell


def placed(found: ContactObject, place: Array, size: float) -> Placed | None:
    """The object that was `found`, standing at `place` (2,) in m; None where no kind is named.

    What the readings do not tell of it, as how large a plane is, is of the skin's `size` in m; of
    a radius that has an upper bound only, it is that.
    """
    rigid = _rigid(found, size)
    turn = found.axis if math.isfinite(found.axis) else 0.0
    return None if rigid is None else Placed(rigid, place, turn)


def _rigid(found: ContactObject, size: float) -> RigidObject | None:
    radius = found.radius if math.isfinite(found.radius) else found.radius_95[1]
    length = max(found.length, _SHORTEST * size) if math.isfinite(found.length) else size
    if found.kind == "edge":
        return Wedge(_SHARP, length, size)
    if found.kind == "plane" or (found.kind and not radius < _FLAT * size):
        return Block(size, size)
    if found.kind == "cylinder":
        return Cylinder(radius, length)
    return Sphere(radius) if found.kind == "sphere" else None
