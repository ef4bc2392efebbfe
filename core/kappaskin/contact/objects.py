"""Object recognition: the kind and curvature of the object that presses on the skin."""

import math
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import scipy

from kappaskin.contact.elastic_skin import ElasticSkin, SkinOnCap
from kappaskin.contact.hypotheses import (
    INEXACT_BENT,
    Hypotheses,
    Hypothesis,
    Width,
    WidthOnDome,
    fit_hypotheses,
    log_likelihoods,
    oval_likelihood,
)
from kappaskin.frames import Array, Contact
from kappaskin.mechanics import Block, Cylinder, PlacedObject, Plate, RigidObject, Sphere, Wedge
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Cap, Patch

KINDS = ("plane", "cylinder", "sphere", "edge")
"""Kinds of object, equally likely a priori."""

_COARSE = 15  # functions along each side, at first; of a disk or a polygon to the end
_FINE, _FINE_MIXED = 40, 30  # and then: of waves that do not mix, and of those that do
_WELL = 1.2  # times the residual of the fitted shape, or of an oval, that an object may leave
_ENOUGH = 20  # readings at least
_INEXACT = 0.02  # of a curvature: what a ring or arcs leave out of a real contact
_LONG = 2.0  # half waves: on a bent skin, two ends that are nearer may be one
_QUIET = 1e-4  # of the largest reading: no skin is quieter
_SEEN = 2.6  # standard deviations: a width below is only an upper bound, or noise passes for one
_LEAST, _DEEPEST = 1e-12, 10.0  # of a side: displacements beyond show no shape of an object
_SURE = 0.4  # probability below which a kind is not the result
_PLANE = 3.0  # radii of a dome: a ball below would not pass for a plane
_CERTAIN = 0.9  # probability below which a result is not named in words
_VAST = 1.0  # m: a radius beyond is flat to a skin, and as a bound says nothing
_LEVEL = 0.01  # probability that noise leaves as much of the readings unexplained
_ODDS = math.log(9)  # that it touches at two ends, over an oval anywhere: a probability of 0.9


@dataclass(frozen=True, slots=True, eq=False)
class ContactObject:
    """The object that touches the skin, recognised from the readings of one frame.

    `kind` is one of `KINDS`, or empty when undecided, as where the skin is moved by less than
    1e-12 of its side or by more than ten times that, with nothing else known; `probability` has all
    of them, and is empty without a contact. `position` (2,) in m and `force` in N have 95 % half
    widths. `radius` in m has the 95 % interval `radius_95`: from 0 when only an upper bound is
    known, up to infinity when it may be flat. `axis` is the angle in rad from x of a cylinder's
    axis or of an edge, `length` its length in m, both with 95 % half widths. What does not apply is
    NaN. `fits` is false where the readings differ from those of the likeliest kind by more than
    noise does.

    Other objects read the same: a flat face `face` in m wide with the 95 % interval `face_95`,
    round for a sphere and a bar for a cylinder, that bears at its rim; where the interval begins at
    0, any tip for a sphere, and any two ends for an edge or a cylinder, that are as narrow. A
    cylinder whose radius is in `radius_95` of an edge reads as that edge. On a dome straight
    objects bear in their middle, whatever their `length`.
    """

    kind: str
    probability: dict[str, float]
    position: Array
    position_95: Array
    force: float
    force_95: float
    radius: float
    radius_95: tuple[float, float]
    axis: float
    axis_95: float
    length: float
    length_95: float
    face: float = math.nan
    face_95: tuple[float, float] = (math.nan, math.nan)
    fits: bool = True

    @property
    def ranked(self) -> list[tuple[str, float]]:
        """Kinds and their probabilities, the most likely first."""
        return sorted(self.probability.items(), key=lambda item: -item[1])

    @property
    def likeliest(self) -> str:
        """The most likely kind, however unsure; empty without a contact."""
        return self.ranked[0][0] if self.probability else ""

    @property
    def sure(self) -> bool:
        """Whether the kind is known: likely enough, and no size of it is a mere bound.

        A thin cylinder reads as an edge, and counts for it.
        """
        if not self.kind:
            return False
        likely = sum(self.probability[kind] for kind in self._named) >= _CERTAIN
        bounded = self.radius_95[0] > 0 and self.radius_95[1] < math.inf
        on_dome = math.isnan(self.length)
        long = self.radius_95[1] < math.inf if on_dome else self.length > self.length_95
        sized = {"plane": True, "edge": long}
        return likely and sized.get(self.kind, bounded)

    @property
    def _named(self) -> set[str]:
        return {self.kind, "cylinder"} if self.kind == "edge" else {self.kind}

    def describe(self) -> str:
        """One line in millimetres and degrees: the kind only where it is `sure`."""
        if not self.probability:
            return "no contact"
        if not self.sure:
            return f"shape unknown{self._bounds()}"
        second, chance = next(one for one in self.ranked if one[0] not in self._named)
        parts = [self.kind]
        if self.kind in ("cylinder", "sphere"):
            low, high = map(_millimetres, self.radius_95)
            parts.append(f"radius {_millimetres(self.radius)} mm (95 %: {low} to {high})")
        if self.kind in ("cylinder", "edge"):
            long = f"{1e3 * self.length:.0f} mm long, " if math.isfinite(self.length) else ""
            parts.append(f"{long}axis {math.degrees(self.axis):.0f} deg")
        parts += self._alike()
        return f"{', '.join(parts)}; second guess {second} {100 * chance:.0f} %"

    def _alike(self) -> list[str]:
        """What else would read the same."""
        low, high = self.face_95
        thin = [f"or a cylinder of radius below {_millimetres(self.radius_95[1])} mm"]
        thin *= self.kind == "edge"
        if self.kind == "plane" or not high < math.inf:
            return thin
        if low:
            return [f"or a flat face {_millimetres(self.face)} mm wide"]
        other = "any tip" if self.kind == "sphere" else "any two ends"
        return [*thin, f"or {other} less than {_millimetres(high)} mm wide"]

    def _bounds(self) -> str:
        """What is known in spite of an unknown shape."""
        low, high = self.radius_95
        if not self.fits:
            return ": no object fits"
        if low >= _VAST:
            return " (flat, or nearly so)"
        if not low and not high < _VAST:  # the contact is a point
            return " (press harder)"
        if self.likeliest == "plane":
            return ""
        far = f"over {_millimetres(low)}" if low else f"under {_millimetres(high)}"
        if low and high < _VAST:
            far = f"{_millimetres(low)} to {_millimetres(high)}"
        what = "ball" if self.likeliest == "sphere" else "cylinder"
        return f" (a {what} would be {far} mm in radius)"


def _millimetres(length: float) -> str:
    """Three digits, and whatever more a number from 1000 on has before the point."""
    value = 1e3 * length
    return f"{value:.3g}" if value < 999.5 else f"{value:.0f}"


NO_OBJECT = ContactObject(
    "",
    {},
    np.full(2, np.nan),
    np.full(2, np.nan),
    math.nan,
    math.nan,
    math.nan,
    (math.nan, math.nan),
    math.nan,
    math.nan,
    math.nan,
    math.nan,
)


class ObjectFinder:
    """Recognises the object on a skin: a plane, a cylinder, a sphere or an edge.

    Each kind has a small family of forces on an elastic skin, fitted to the readings by
    maximum likelihood. The kinds are compared by Laplace's approximation of their marginal
    likelihoods, with unknown noise. The object's curvature is that of the skin between the forces.
    It takes a few tens of milliseconds: for display, not for every frame. On a skin bent to a
    radius of a few elements its probabilities are too confident: a dent there is not much wider
    than what the functions resolve. On a dome or a cap the curvature is that of the object over
    the skin's, and an edge or a cylinder is longer than its contact. Raises a `Refusal` for a strip
    and a drum head.
    """

    def __init__(self, plate: Plate, layout: SensorLayout, edge: str = "hinged") -> None:
        patch = plate.patch
        if isinstance(patch, Cap):
            self._coarse = self._skin = SkinOnCap(plate, layout, edge, 0)
            self._live = layout.live.ravel()
            return
        if type(patch) is not Patch:
            fine = _COARSE
        else:
            fine = _FINE if edge == "hinged" and not plate.mixes_sines else _FINE_MIXED
        self._coarse = ElasticSkin(plate, layout, edge, _COARSE)
        self._skin = self._coarse
        if fine != _COARSE:
            self._skin = ElasticSkin(plate, layout, edge, fine)
        self._live = layout.live.ravel()

    def __call__(self, curvature: Array, noise: float, contact: Contact) -> ContactObject:
        """The object for `curvature` (3, P) in 1/m, NaN where missing, and the contact `contact`.

        `noise` in 1/m is the standard deviation of a reading, as the fit estimates it.
        """
        used = self._live & np.isfinite(curvature).ravel()
        if not contact.present or used.sum() < _ENOUGH:
            return NO_OBJECT
        if not _LEAST < abs(contact.displacement) / self._coarse.patch.a < _DEEPEST:
            return replace(NO_OBJECT, probability=dict.fromkeys(KINDS, 1 / len(KINDS)))
        K = np.where(used, curvature.ravel(), 0.0)
        noise = max(noise, _QUIET * float(np.abs(K).max()))
        skin = self._skin.near(contact.position)
        coarse = skin if self._coarse is self._skin else self._coarse
        return _judged(skin, fit_hypotheses(coarse, skin, K, used, noise, contact), noise)


def _judged(skin: ElasticSkin, all_of: Hypotheses, noise: float) -> ContactObject:
    weights = log_likelihoods(skin, all_of)
    most = max(weights.values())
    total = sum(math.exp(weight - most) for weight in weights.values())
    probability = {kind: math.exp(weights[kind] - most) / total for kind in KINDS}
    kind = max(KINDS, key=probability.__getitem__)
    found = getattr(all_of, kind)
    reach = float(scipy.special.stdtrit(all_of.readings - len(found.best.parameters), 0.975))
    width = found.width or cast("Width", all_of.cylinder.width)
    radius, radius_95 = _radius(skin, width, reach)
    fits = all_of.noise <= _WELL * noise
    known = probability[kind] >= _SURE or (kind == "edge" and skin.is_dome)
    flat = not skin.form.any()
    if flat:
        fits = fits and all_of.weighted.chance(found.best) >= _LEVEL
    if skin.is_dome:
        squares = (one.best.squares for one in (all_of.sphere, all_of.edge, all_of.cylinder))
        fits = fits and found.best.squares <= _WELL**2 * min(squares) and _bears(found, kind, width)
        if kind == "cylinder" and not radius_95[0]:  # which reads as an edge
            kind = "edge"
        elif kind == "plane":
            known = known and radius_95[0] > _PLANE / float(skin.form[:2].max())
    elif found is not all_of.sphere:
        oval = all_of.weighted.oval(all_of.cylinder.best, all_of.edge.best)
        if flat:
            known = known and weights[kind] - oval_likelihood(skin, all_of, oval) >= _ODDS
        else:  # arcs are too rough to be weighed against it, as they leave more than noise
            fits = fits and found.best.squares <= _WELL**2 * oval.squares
            known = known and found.best.parameters[4] > (_LONG * skin.half_wave) ** 2
    known = known and not (kind == "plane" and math.isnan(radius))  # flattened, not just touched
    return ContactObject(
        kind if known and fits else "",
        probability,
        skin.on_patch(found.best.parameters[:2]),
        reach * np.sqrt(np.diag(found.best.covariance)[:2]),
        float(found.best.parameters[2]),
        reach * math.sqrt(found.best.covariance[2, 2]),
        radius,
        radius_95,
        *_axis(found, radius_95, reach),
        *_length(found, reach),
        *_face(skin, "sphere" if found is all_of.sphere else kind, width, reach),
        fits,
    )


def _bears(found: Hypothesis, kind: str, width: Width) -> bool:
    """Whether it bears on a dome as long and no wider than an object of its kind may."""
    if kind in ("edge", "cylinder"):
        sd = math.hypot(math.sqrt(found.best.covariance[4, 4]), found.length2_sd)
        return abs(found.best.parameters[4] - found.length2) <= _SEEN * sd
    return width.q <= float(width.of_curvature(np.zeros(1))[0]) + _SEEN * width.sd


def _axis(found: Hypothesis, radius_95: tuple[float, float], reach: float) -> tuple[float, float]:
    """Angle in rad and its half width, from the noise and from the interval of the radius."""
    if len(found.best.parameters) < 6:
        return math.nan, math.nan
    off = reach * math.sqrt(found.best.covariance[3, 3])
    if found.width is None:
        return float(found.best.parameters[3]) % math.pi, off
    low, high = (found.axis(min(radius, 1e3)) for radius in radius_95)
    spread = abs(math.remainder(high - low, math.pi)) / 2
    return (low + math.remainder(high - low, math.pi) / 2) % math.pi, math.hypot(off, spread)


def _length(found: Hypothesis, reach: float) -> tuple[float, float]:
    """Length in m and its half width."""
    if len(found.best.parameters) < 6 or math.isfinite(found.length2):
        return math.nan, math.nan
    length = math.sqrt(found.best.parameters[4])
    return length, reach * math.sqrt(found.best.covariance[4, 4]) / (2 * length)


def _radius(skin: ElasticSkin, width: Width, reach: float) -> tuple[float, tuple[float, float]]:
    """The radius in m and its interval of `reach` standard deviations."""
    rest, inexact = max(map(abs, skin.patch.curvatures)), INEXACT_BENT
    resolved = not rest or width.q > skin.half_wave**2
    if isinstance(width, WidthOnDome):
        rest, inexact, resolved = width.rest, reach * width.inexact, True
    elif not rest:
        inexact = _INEXACT
    off = reach * width.measured
    low, high = width.q - off, max(width.q, 0.0) + off
    flattest, best = width.curvature(high), width.curvature(width.q)
    if width.q < _SEEN * width.measured or low <= 0 or not resolved:
        return math.nan, (0.0, _inverse(flattest - inexact * (flattest + rest)))
    off = inexact * (best + rest)
    up, down = math.hypot(width.curvature(low) - best, off), math.hypot(best - flattest, off)
    return _inverse(best), (_inverse(best + up), _inverse(best - down))


def _face(
    skin: ElasticSkin, kind: str, width: Width, reach: float
) -> tuple[float, tuple[float, float]]:
    """Width in m of the flat face that presses as wide as the object, and its interval.

    Round for a sphere; a bar's two edges as far from its axis as the force on an arc is by RMS.
    """
    per = 2.0 if kind == "sphere" else math.sqrt(2)
    q = np.array([width.q, width.q - reach * width.measured, max(width.q, 0.0) + reach * width.measured])
    face, low, high = per * np.sqrt(np.maximum(q, 0.0))
    if kind == "edge" and skin.is_dome:  # which its ends do not touch
        return math.nan, (math.nan, math.nan)
    if kind == "edge" or width.q < _SEEN * width.measured or low == 0:
        return math.nan, (0.0, float(high))
    return float(face), (float(low), float(high))


def _inverse(curvature: float) -> float:
    return 1 / curvature if curvature > 0 else math.inf


_FLAT = 100.0  # times the size: a rounder object is not told from a flat one
_SHORTEST = 0.02  # of the size: an object as short as that is drawn at least so long
_SHARP = math.radians(70)  # between the flanks of an edge, which the readings do not tell


def placed_object(found: ContactObject, place: Array, size: float) -> PlacedObject | None:
    """The object `found`, as a rigid object at `place` (2,) in m; None where its kind is unknown.

    Dimensions that the readings do not determine, such as the size of a plane, are `size` in m; a
    radius with an upper bound only is that bound.
    """
    rigid = _rigid(found, size)
    turn = found.axis if math.isfinite(found.axis) else 0.0
    return None if rigid is None else PlacedObject(rigid, place, turn)


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
