"""Contacts without mechanics: from the shape of a skin whose material is unknown."""

import math
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np
import scipy

from kappaskin.bases import Basis, held_near
from kappaskin.contact.drift import FittedDrift, level_and_slopes
from kappaskin.contact.geometry import (
    CurvatureFormMap,
    contact_geometry,
    local_geometry,
    surface_geometry,
)
from kappaskin.contact.objects import KINDS, NO_OBJECT, ContactObject, ObjectFinder
from kappaskin.contact.point import NO_CONTACT, orthonormal
from kappaskin.contact.two import Contacts, as_one
from kappaskin.errors import Refusal
from kappaskin.estimation import Estimator, Fit, LeastSquares, PatternCache
from kappaskin.frames import Array, Contact, LocalGeometry, Mask
from kappaskin.mechanics import Plate
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Cap

CHANCE = 1e-6
"""Share of frames without a contact in which one is found by chance."""

_POINTS, _MOST = 3, 121  # of the map for each function along a side, and at most
_SHALLOW = 1 / 3  # of the depth at a dent's peak: where it is less, another one begins
_PART = 0.5  # of the mean concavity of a dent: where it is less, the dent ends
_SETTLED = 0.01  # of that level: so far it settles
_DEEP = 3.0  # standard deviations: a dent is deeper
_SECOND = 0.3  # of depth times concavity: a dent that has as much is another one
_OUTSIDE = 1.5, 3.0  # times the squared radius: around the rim
_COARSE = 2 / 3  # of the functions along each side: another measure
_ISOTROPIC = np.diag([1.0, 1.0, 0.5])  # variances of xx, yy and xy whichever way x points
_RIM = 1 / 15  # of a side: within it, a skin hardly moves


# Where the skin is most concave lies in the contact, whatever the skin is made of: M = -D lap w of
# a plate obeys lap M = -q for the pressure q, so that M has no peak where nothing presses; that of
# a membrane is the pressure; and an elastomer follows the object, and turns over at the rim. Where
# a peak is sharp, as on a plate, powers of the concavity come near it; where it is flat, as under a
# ball in an elastomer, they have its middle. By how much two powers differ is what is not resolved.
class Imprints:
    """The contact on a skin, by its shape alone; without a force.

    A contact is found where the shape explains more of the readings than noise does in one frame of
    a million, and more than a level and slopes of each quantity do. It is the dent that is deepest
    and most concave, m = -(K_xx + K_yy) / 2 with what the curvature form K has changed by. It
    lies in the mean of places weighted by m^4, in the region where m is at least half of its mean;
    its area is that of an even ellipse of the same mean squares, and the curvature form at the
    contact the mean over it. Standard deviations have besides the noise what weights of m, an
    ellipse of half the area and two thirds of the functions differ by.

    Where a plate of any rigidity under one load or two explains the readings of a curvature sensor
    to the noise, it tells place, depth and size better, and they are its.
    """

    def __init__(self, plate: Plate, layout: SensorLayout, basis: Basis, edge: str) -> None:
        patch, (Ni, Nj) = plate.patch, basis.shape
        self._basis, self._layout = basis, layout
        self._plate = None if layout.reads else Contacts(plate, layout, edge)
        x, y = patch.grid(*(min(_POINTS * count + 1, _MOST) for count in (Ni, Nj)))
        self._form, self._depth = CurvatureFormMap(basis, x, y), basis.on_grid(x, y)
        self._rest = self._form.at_rest
        self._places = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
        self._half_wave = patch.a / Ni if patch.strip else math.sqrt(patch.a * patch.b / (Ni * Nj))
        self._cell = math.sqrt((x[1] - x[0]) * (y[1] - y[0]))
        self._coarse = np.zeros(basis.shape)
        self._coarse[: math.ceil(_COARSE * Ni), : math.ceil(_COARSE * Nj)] = 1.0
        self._smooth, self._weight = PatternCache[Array](), np.empty(0)
        self._there: LocalGeometry | None = None
        self.drift: FittedDrift | None = None
        """The drift beside the last contacts; None where there is none."""
        self.chance = 1.0
        """Probability that noise alone explains as much of the last readings."""
        self.loads: tuple[Contact, Contact] | None = None
        """The last contacts with forces by the plate's nominal rigidity, where a plate fits."""

    def __call__(self, readings: Array, fit: Fit) -> tuple[Contact, Contact]:
        """The contacts for the `readings` of one frame, NaN where missing, and the `fit` to them.

        The second one is there only where a plate fits.
        """
        self._there = self.drift = self.loads = None
        if self._plate is not None:
            found = self._plate(readings, fit)
            self.drift = self._plate.drift
            if self.drift or found[0].single or found[1].present:
                self.loads = found
                return without_force(found[0]), without_force(found[1])
        self.chance = self._by_chance(readings, fit)
        if not self.chance < CHANCE:
            return NO_CONTACT, NO_CONTACT
        form = self._form(fit.coefficients)
        if (dent := self._dent(form, self._depth(fit.coefficients))) is None:
            return NO_CONTACT, NO_CONTACT
        self._there, contact = self._measured(dent, form, fit)
        return contact, NO_CONTACT

    def geometry(self, fit: Fit, contact: Contact) -> LocalGeometry:
        """Geometry of the skin at the last first contact; NaN where there is none."""
        if self._there is not None or not contact.present:
            return self._there or contact_geometry(fit, contact)
        there = local_geometry(fit, contact.position)
        c = self._coarse * fit.coefficients
        fewer = surface_geometry(self._basis, c, contact.position, fit.covariance_of)
        K = there.curvature_form
        away = np.square(self._places - contact.position).sum(axis=1) / self._half_wave**2
        around, _ = self._form_over(self._form(fit.coefficients), away)
        unresolved = np.mean((K - fewer.curvature_form) ** 2)
        unresolved += np.mean((K[[0, 1, 0], [0, 1, 1]] - around) ** 2)
        return replace(there, covariance=there.covariance + unresolved * _ISOTROPIC)

    def _by_chance(self, readings: Array, fit: Fit) -> float:
        """Probability that noise explains as much of the readings as the shape does, by F."""
        weight, used = fit.estimator.weight, np.isfinite(readings.ravel())
        if weight is not self._weight:
            self._smooth, self._weight = PatternCache[Array](), weight
        Q = self._smooth(used, lambda used: self._spread(used, weight))
        K = np.where(used, readings.ravel() * weight, 0.0)
        along, left = Q @ K, np.nan_to_num(fit.residual.ravel()) * weight
        explained = float(K.dot(K) - along.dot(along) - left.dot(left))
        spare = float(cast("float", fit.spare))
        unknowns = float(used.sum()) - spare
        if not explained > 0 or not unknowns > 0:
            return 1.0
        if not (variance := float(fit.noise) ** 2):
            return 0.0
        if fit.estimator.sigma is not None:
            return float(scipy.special.chdtrc(unknowns, explained / variance))
        return float(scipy.special.fdtrc(unknowns, spare, explained / unknowns / variance))

    def _spread(self, used: Mask, weight: Array) -> Array:
        """Orthonormal directions (d, R) of weighted readings that a level and slopes may have."""
        return orthonormal(np.where(used, weight * level_and_slopes(self._layout), 0.0))

    def _dent(self, form: Array, depth: Array) -> "_Dent | None":
        """The dent that is deepest and most concave; None where the skin bulges more.

        By the curvature `form` (3, ny, nx) in 1/m and the `depth` (ny, nx) in m.
        """
        change = form - self._rest
        m = -(change[0] + change[1]) / 2
        inward = (depth > 0) & (m > 0)
        if not inward.any():
            return None
        pressed = np.where(inward, m * depth, 0.0)
        peak = int(pressed.argmax())
        if not depth.flat[peak] > -np.nanmin(depth):
            return None
        dents = cast("Array", scipy.ndimage.label(depth > _SHALLOW * depth.flat[peak])[0])
        inward &= dents == dents.flat[peak]
        before, level = math.inf, _PART * float(m.flat[peak])
        region = inward & (m > level)
        while not math.isclose(level, before, rel_tol=_SETTLED):
            before, level = level, _PART * float(m[region].mean())
            region = inward & (m > level)
        place, size, away = self._centred(m, region, 4)
        other, coarse, _ = self._centred(m, region, 1)
        others = pressed.ravel()[~inward.ravel() & (away > 1)].max(initial=0.0)
        single = bool(others < _SECOND * pressed.flat[peak])
        xx, yy, _ = self._form_over(change, 2 * away)[0].tolist()
        single = single and -(xx + yy) / 2 > level
        outside = m.ravel()[(away > _OUTSIDE[0]) & (away < _OUTSIDE[1])]
        turns = float(np.nansum(outside)) < 0
        concave, moved = float(m[region].mean()), math.dist(place, other)
        return _Dent(place, size, away, concave, moved, abs(size - coarse), turns, single)

    def _centred(self, m: Array, region: Mask, power: int) -> tuple[Array, float, Array]:
        """Place, squared radius and distances by `power` of the concavity m in 1/m (`_Dent`)."""
        inside = region.ravel()
        share = (m[region] / m[region].max()) ** power
        share /= share.sum()
        place = share @ self._places[inside]
        off = self._places - place
        if self._basis.patch.strip:
            off = off[:, :1]
        squares = (off[inside] * share[:, None]).T @ off[inside]
        squares += self._cell**2 / 12 * np.eye(len(squares))
        scaled = cast("Array", off @ np.linalg.inv(squares))
        away = np.vecdot(scaled, off) / 4
        det: Array = np.linalg.det(squares)
        size = 4 * det.item() ** (1 / len(squares))
        if slopes := self._basis.patch.base(*place.tolist()).slopes:
            (xx, xy), (yx, yy) = slopes
            size /= xx * yy - xy * yx  # of areas: a cap's coordinates are wider around than it is
        return place, size, away

    def _form_over(self, form: Array, away: Array) -> tuple[Array, float]:
        """Mean (3,) of the curvature `form` (3, ny, nx) where `away` (G,) is below 1; its scatter.

        Places near the rim weigh less. The scatter, of xx and yy by RMS, is that about the mean.
        """
        of_all = form.reshape(3, -1)
        share = np.maximum(1 - away, 0.0)
        share[np.isnan(of_all[0])] = 0.0
        inside = np.flatnonzero(share)
        share, inner = share[inside] / share[inside].sum(), of_all[:, inside]
        mean = inner @ share
        squares = np.square(inner[:2] - mean[:2, None]) @ share
        return mean, math.sqrt(float(squares.mean()))

    def _measured(self, dent: "_Dent", form: Array, fit: Fit) -> tuple[LocalGeometry, Contact]:
        strip = self._basis.patch.strip
        there = local_geometry(fit, dent.place)
        mean, scatter = self._form_over(form, dent.away)
        other, _ = self._form_over(form, 2 * dent.away)
        point = there.curvature_form[[0, 1, 0], [0, 1, 1]]
        K, other = (mean, other) if dent.turns else (point, mean)
        fewer, _ = self._form_over(self._form(self._coarse * fit.coefficients), dent.away)
        across = math.sqrt(dent.size) / self._half_wave
        cells = max(2 * across if strip else math.pi * across**2, 1.0)
        unresolved = float(np.mean((K - other) ** 2) + np.mean((mean - fewer) ** 2))
        unresolved += scatter**2 / cells
        # A dent no wider than a wave of the functions has the curvature that these give it.
        unresolved += np.mean(K**2) * (min(1.0, 1 / across**2) ** 2 / 2) ** 2
        covariance = there.covariance / (cells if dent.turns else 1) + unresolved * _ISOTROPIC
        K_xx, K_yy, K_xy = K.tolist()
        there = replace(
            there,
            curvature_form=np.array([[K_xx, K_xy], [K_xy, K_yy]]),
            covariance=covariance,
        )
        # By m^4, an error dm moves the place by the mean of 4 dm / m times the distance from it.
        noise = 2 * there.mean_sd / dent.concave * math.sqrt(dent.size / cells)
        place_sd = math.hypot(noise, dent.moved)
        x, y = dent.place.tolist()
        (w, *slopes), covariance = fit.jet(x, y)[0][:3].tolist(), fit.jet(x, y)[1]
        fine = self._depth((1 - self._coarse) * fit.coefficients).ravel()[dent.away < 1]
        fine_sd = math.sqrt(float(np.nanmean(fine**2)))
        # So much a wave just too short for the functions would add to a dent of this curvature.
        fine_sd = math.hypot(fine_sd, abs(K_xx + K_yy) / 2 * (self._half_wave / math.pi) ** 2)
        w_sd = math.sqrt(max(covariance[0, 0], 0.0))
        contact = Contact(
            dent.place,
            np.array([place_sd, 0.0 if strip else place_sd]),
            math.nan,
            math.nan,
            w,
            math.hypot(w_sd, fine_sd, math.hypot(*slopes) * math.sqrt(2) * place_sd),
            int(cast("float", fit.spare)),
            dent.single,
            bool(held_near(self._basis, x, y, _RIM)),
            dent.size,
            math.hypot(
                dent.resized if dent.turns else dent.size, math.sqrt(dent.size) * self._half_wave
            ),
        )
        return there, contact if w > _DEEP * w_sd else NO_CONTACT


def contacts_of(
    plate: Plate, layout: SensorLayout, basis: Basis, edge: str, sigma: Array | None = None
) -> Contacts | Imprints:
    """What finds the contacts on a skin: by its mechanics, if its material is known.

    Readings that differ in unit are weighed by their `sigma` (R,).
    """
    if plate.unknown_material:
        return Imprints(plate, layout, basis, edge)
    return Contacts(plate, layout, edge, sigma)


def object_finder(
    plate: Plate, layout: SensorLayout, edge: str, estimator: Estimator
) -> "ObjectFinder | ImprintObjects":
    """What recognises the object on a skin, as `contacts_of` finds the contacts."""
    if plate.unknown_material or layout.reads:
        return ImprintObjects(plate, estimator, edge)
    return ObjectFinder(plate, layout, edge)


class ImprintObjects:
    """Recognises the object on a skin whose material is unknown, as `ObjectFinder` does on others.

    Where a plate of any rigidity explains the contact, by that plate; else by the shape alone. Both
    without a force. The shape is that of the `estimator`.
    """

    def __init__(self, plate: Plate, estimator: Estimator, edge: str) -> None:
        layout = estimator.layout
        self._fit, self._plate = estimator, None
        if estimator.has_memory:
            self._fit = LeastSquares(estimator.basis, layout, estimator.sigma)
        if not (layout.reads or isinstance(plate.patch, Cap)):
            self._plate = ObjectFinder(plate, layout, edge)
        elif plate.patch.strip:
            raise Refusal("object recognition needs a 2-D skin; this one is a strip")
        self._imprints = Imprints(plate, layout, estimator.basis, edge)

    def __call__(self, readings: Array, noise: float, contact: Contact) -> ContactObject:
        """The object for the `readings` of one frame, NaN where missing, and the contact."""
        if not contact.present:
            return NO_OBJECT
        fit = self._fit(readings)
        found, _ = self._imprints(readings, fit)
        if self._plate is not None and (loads := self._imprints.loads) is not None:
            what = self._plate(readings, noise, as_one(*loads))
            return replace(what, force=math.nan, force_95=math.nan)
        return imprinted_object(found, self._imprints.geometry(fit, found))


class _Dent(NamedTuple):
    """A dent around `place` (2,) in m, of the squared radius `size` in m^2.

    It is an even ellipse with the mean squares of the dent about its middle: `away` (G,) from it
    are places of the map, by the square, 1 at its rim. It is `concave` in 1/m in the mean. By
    another power of the concavity the place is `moved` in m and the size `resized` in m^2. It
    `turns` over around its rim, and is `single` if it is filled and no other dent is as deep.
    """

    place: Array
    size: float
    away: Array
    concave: float
    moved: float
    resized: float
    turns: bool
    single: bool


def without_force(contact: Contact) -> Contact:
    """A contact on a skin whose material is unknown."""
    return replace(contact, force=math.nan, force_sd=math.nan)


_SURE = 0.9  # probability below which no kind is named
_LEVEL = 0.01  # probability that an object of the kind differs as much from the shape
_STEPS, _TURNS = 400, 64  # of the curvatures and axes tried
_OVALS = 0.25, 0.5, 0.75  # of its larger curvature: the smaller one of an oval
_ROUNDEST, _FLATTEST = 0.1, 100.0  # radii tried, in radii of the contact
_REACH = 1.96


def imprinted_object(contact: Contact, geometry: LocalGeometry) -> ContactObject:
    """The object that a skin of unknown material follows, by the curvature form at a contact.

    A sphere, a cylinder or a plane: -K is its own curvature in the contact, and its errors are
    Gaussian with the `covariance`. Named is one nine times as likely as the others together, and no
    less than an oval, from which K does not differ by more than its errors, where the contact's
    size is resolved: how a smaller object looks is the skin's doing. An edge is never named.
    """
    if not contact.present or not np.isfinite(geometry.covariance).all():
        return NO_OBJECT
    (xx, xy), (_, yy) = -geometry.curvature_form
    C = geometry.covariance
    radius = contact.load_radius
    curvatures = np.geomspace(1 / (_FLATTEST * radius), 1 / (_ROUNDEST * radius), _STEPS)
    turns = np.arange(_TURNS) * math.pi / _TURNS
    c, s = np.cos(turns), np.sin(turns)
    # Across a cylinder's axis along (c, s) the curvature is k, along it zero.
    shapes = {
        "plane": np.zeros((1, 3)),
        "sphere": np.multiply.outer(curvatures, [1.0, 1.0, 0.0]),
        "cylinder": np.multiply.outer(curvatures, _along(-s, c)),
    }
    off = {kind: _squares([xx, yy, xy] - shape, C) for kind, shape in shapes.items()}
    likelihood = {kind: float(np.exp(-each / 2).mean()) for kind, each in off.items()}
    total = sum(likelihood.values())
    probability = {
        kind: likelihood.get(kind, 0.0) / total if total else 1 / len(KINDS) for kind in KINDS
    }
    kind = max(probability, key=probability.__getitem__)
    free = {"plane": 3, "sphere": 2, "cylinder": 1}[kind]
    # An oval curves less along than across; it is none of these, and is not named.
    oval = _along(-s, c) + np.multiply.outer(_OVALS, _along(c, s))
    oval = np.multiply.outer(curvatures, oval)
    others = float(np.exp(-_squares([xx, yy, xy] - oval, C) / 2).mean())
    least = float(off[kind].min())
    fits = bool(cast("float", scipy.special.chdtrc(free, least)) >= _LEVEL)
    fits = fits and likelihood[kind] >= others
    resolved = bool(contact.load_radius_95[0] > 0)
    sure = resolved and fits and probability[kind] >= _SURE
    found = replace(
        NO_OBJECT,
        kind=kind if sure else "",
        probability=probability,
        position=contact.position,
        position_95=contact.position_95,
        fits=fits,
    )
    if kind == "plane":
        return found
    direction = np.array([1.0, 1.0, 0.0])
    if kind == "cylinder":
        best = int(off[kind].min(axis=0).argmin())
        direction = shapes[kind][0, best] / curvatures[0]
        found = replace(found, axis=float(turns[best]), axis_95=_REACH * _turn_sd(xx, yy, xy, C))
    weighted = np.linalg.solve(C, direction)
    k = float(weighted @ [xx, yy, xy] / (weighted @ direction))
    reach = _REACH / math.sqrt(float(weighted @ direction))
    return replace(found, radius=_inverse(k), radius_95=(_inverse(k + reach), _inverse(k - reach)))


def _along(c: Array, s: Array) -> Array:
    """xx, yy and xy (n, 3) of what curves by 1 along (c, s) (n,) alone."""
    return np.stack([c * c, s * s, c * s], -1)


def _squares(rest: Array, C: Array) -> Array:
    """Squares (...) of `rest` (..., 3), in units of its covariance `C` (3, 3)."""
    return np.vecdot(rest @ np.linalg.inv(C), rest)


def _turn_sd(xx: float, yy: float, xy: float, C: Array) -> float:
    """Standard deviation in rad of the axes of a curvature form."""
    d = (xx - yy) / 2
    gradient = np.array([-xy / 2, xy / 2, d])
    return math.sqrt(float(gradient @ C @ gradient)) / (2 * (d * d + xy * xy))


def _inverse(k: float) -> float:
    return 1 / k if k > 0 else math.inf
