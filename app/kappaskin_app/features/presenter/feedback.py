"""An estimate, and what was found to touch the skin, to the few numbers that an operator feels."""

import math
from dataclasses import dataclass

import numpy as np

from kappaskin.contact import ContactObject
from kappaskin.frames import Contact, Estimate

_95 = 1.96  # standard deviations that a 95 % interval reaches
_ROUND = ("sphere", "cylinder")  # the kinds that have a radius
_MOST = 10.0  # times the force of the point load that explains it best that an object may bear


@dataclass(frozen=True)
class Found:
    """What was found to touch the skin a moment ago, and the `contact` there was then."""

    what: ContactObject
    contact: Contact


@dataclass(frozen=True)
class Roundness:
    """The radius in m of `what` touches, or of the "skin", with its 95 % interval `between`.

    The interval is from zero where only the upper end is known, and up to infinity where it may be
    flat; then the radius may be NaN.
    """

    what: str
    radius: float
    between: tuple[float, float]


@dataclass(frozen=True)
class Cue:
    """What comes back to the operator: numbers in SI units, each with its 95 % half width.

    NaN where it is not known.
    """

    force: float
    force_95: float
    displacement: float
    displacement_95: float
    position: tuple[float, float]
    position_95: float
    kind: str
    length: float
    roundness: Roundness | None
    near_rim: bool


def cue_of(estimate: Estimate, found: Found | None = None) -> Cue | None:
    """What is felt in `estimate`; None where nothing touches.

    A point load explains a small contact. Of a large one it bears too little, and of a pipe it
    lies at one of the ends. An object explains both, but is found a few times a second only: how
    much more than a point load it bore a moment ago corrects the point load of now.
    """
    contact = estimate.contact
    if not contact.present:
        return None
    force, force_95 = contact.force, contact.force_95
    place, place_95 = contact.position, float(np.max(contact.position_95))
    if found is not None and 0 < found.what.force / found.contact.force < _MOST:
        more = contact.force / found.contact.force
        force, force_95 = more * found.what.force, abs(more) * found.what.force_95
        if not contact.single:
            place, place_95 = found.what.position, float(np.max(found.what.position_95))
    elif not contact.single:
        force_95 = place_95 = math.nan
    displacement, displacement_95 = contact.displacement, contact.displacement_95
    if not contact.single:
        displacement, displacement_95 = float(np.nanmax(np.abs(estimate.surface))), math.nan
    x, y = (float(value) for value in place)
    kind, length = (found.what.kind, found.what.length) if found is not None else ("", math.nan)
    return Cue(
        *(force, force_95, displacement, displacement_95, (x, y), place_95),
        *(kind, length, _roundness(estimate, found), contact.near_rim),
    )


def _roundness(estimate: Estimate, found: Found | None) -> Roundness | None:
    """That of the object if it has one, else of the skin where it curves most; None of an edge."""
    if found is not None and found.what.kind in _ROUND:
        return Roundness(found.what.kind, found.what.radius, found.what.radius_95)
    if found is not None and found.what.kind:
        return None
    geometry = estimate.geometry
    sharper = int(np.argmax(np.abs(geometry.principal)))
    k = abs(float(geometry.principal[sharper]))
    off = _95 * float(geometry.principal_sd[sharper])
    low, high = max(k - off, 0.0), k + off
    if not high > 0:
        return None
    return Roundness("skin", 1 / k if k else math.inf, (1 / high, 1 / low if low > 0 else math.inf))
