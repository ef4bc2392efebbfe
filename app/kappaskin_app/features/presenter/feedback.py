"""Feedback to the operator: force, position and radius from the contact and the object."""

import math
from dataclasses import dataclass

import numpy as np

from kappaskin.contact import NO_OBJECT, ContactObject
from kappaskin.frames import Contact, Estimate
from kappaskin_app.widgets.text import ERROR_BARS, Coverage

_ROUND = ("sphere", "cylinder")  # the kinds that have a radius
_MOST = 10.0  # largest ratio of an object's force to that of the best point load


@dataclass(frozen=True)
class Recognised:
    """The object recognised last, and the `contact` in the same estimate."""

    what: ContactObject
    contact: Contact


@dataclass(frozen=True)
class RadiusEstimate:
    """Radius `value` in m of the object `what`, or of the "skin", with its 95 % `interval`.

    The object is empty where its kind is not known.
    The interval begins at zero where only an upper bound is known, and ends at infinity where the
    object may be flat; the value may then be NaN.
    """

    what: str
    value: float
    interval: tuple[float, float]

    @property
    def bar(self) -> tuple[float, float]:
        """Both ends in m of the error bar as all views show it; of a bound the interval."""
        low, high = self.interval
        if not (0 < low <= high < math.inf and math.isfinite(self.value)):
            return self.interval
        k, off = 1 / self.value, Coverage.now.of_half_width  # normal in the curvature
        return 1 / (k + off(1 / low - k)), 1 / (k - off(k - 1 / high))


@dataclass(frozen=True)
class Feedback:
    """Feedback in SI units, each number with its error bar as all views show it; NaN if unknown.

    The force of a contact `near_rim` is not determined, and it has no `radius`. `bound` stands
    before the force where it is one; `no_force` says why there is none.
    """

    force: float
    force_off: float
    displacement: float
    displacement_off: float
    position: tuple[float, float]
    position_off: float
    kind: str
    length: float
    radius: RadiusEstimate | None
    near_rim: bool
    bound: str = ""
    no_force: str = ""


def feedback_of(estimate: Estimate, recognised: Recognised | None = None) -> Feedback | None:
    """Feedback of an `estimate`; None without a contact.

    A point load describes a small contact. For a large one its force is too small, and for a pipe
    it lies at one of the ends. The object describes both, but is recognised only a few times per
    second: the last ratio of its force to that of the point load scales the present point load.
    """
    contact = estimate.contact
    if not contact.present:
        return None
    bars = Coverage.now
    force, force_off = contact.force, bars.of(contact.force_sd, contact.force_95)
    place, reach = contact.position, float(np.max(contact.position_95))
    place_off = bars.of(float(np.max(contact.position_sd)), reach)
    if recognised is not None and 0 < recognised.what.force / recognised.contact.force < _MOST:
        more = contact.force / recognised.contact.force
        what = recognised.what
        force, force_off = more * what.force, bars.of_half_width(abs(more) * what.force_95)
        if not contact.single:
            place, reach = what.position, float(np.max(what.position_95))
            place_off = bars.of_half_width(reach)
    elif not contact.single:
        force_off = place_off = math.nan
    displacement = contact.displacement
    displacement_off = bars.of(contact.displacement_sd, contact.displacement_95)
    if contact.near_rim:
        force = force_off = math.nan
    if not contact.single or contact.near_rim:
        displacement, displacement_off = float(np.nanmax(np.abs(estimate.surface))), math.nan
    x, y = (float(value) for value in place)
    kind, length = (recognised.what.kind, recognised.what.length) if recognised else ("", math.nan)
    return Feedback(
        *(force, force_off, displacement, displacement_off, (x, y), place_off),
        *(kind, length, _radius_estimate(estimate, recognised), contact.near_rim),
        *(contact.force_bound, contact.no_force),
    )


def _radius_estimate(estimate: Estimate, recognised: Recognised | None) -> RadiusEstimate | None:
    """Radius of a round object; of the skin at the contact without one; None of an edge."""
    what = recognised.what if recognised else NO_OBJECT
    if what.kind in _ROUND or (not what.kind and what.likeliest in _ROUND and what.fits):
        return RadiusEstimate(what.kind, what.radius, what.radius_95)
    if what.kind or estimate.contact.near_rim:
        return None
    geometry = estimate.geometry
    sharper = int(np.argmax(np.abs(geometry.principal)))
    k = abs(float(geometry.principal[sharper]))
    off = ERROR_BARS["95"].of(float(geometry.principal_sd[sharper]))
    low, high = max(k - off, 0.0), k + off
    if not high > 0:
        return None
    return RadiusEstimate(
        "skin", 1 / k if k else math.inf, (1 / high, 1 / low if low > 0 else math.inf)
    )
