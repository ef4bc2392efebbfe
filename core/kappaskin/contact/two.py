"""Two contacts: told as two where neither one load nor a line fits the readings as well."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, cast

import numpy as np

from kappaskin.bases import held_near
from kappaskin.contact.drift import FittedDrift, SmoothDrift
from kappaskin.contact.geometry import contact_geometry
from kappaskin.contact.influence import BY_PROFILE, Single, influence_of, read_of_modes, sizes_on
from kappaskin.contact.point import NO_CONTACT, PointContact, left_by_chance
from kappaskin.estimation import Fit, PatternCache
from kappaskin.frames import Array, Contact, LocalGeometry, Mask
from kappaskin.mechanics import Plate
from kappaskin.sensing import SensorLayout

# Shares of single loads that leave more, by chance, than a quantile of F.
_LOOKED_AT = 0.25  # beyond it, two loads are tried
_MISFIT = 1e-3  # beyond it, whatever presses is no load on a small area
_LEFT = 0.01  # of pairs: beyond it, two loads do not explain the readings either
# -2 ln of likelihood ratios.
_HINT = 12.0  # that a second load promises in first order: below it, none is tried
_SPREAD = 25.0  # by which two loads must be better than one, for the load to be distributed
_DISTINCT = 32.0  # and to be told as two
_THIRD = 0.1  # of what a second load takes off: where a third would, it is no sum of two
_NO_LINE = 12.0  # and by which they must be better than a line

_SEARCHED = 17  # points searched along each side
_FUNCTIONS = 15  # along each side, of the loads searched for
_COVERED = 1e-3  # of the squares of a load's readings: what another one leaves of them is none
_STEPS = 25  # of Levenberg and Marquardt at most
_WORTH = 0.05  # a step that makes -2 ln of the likelihood no smaller than by this is the last one
_HOPE = 3.0  # times what a step promises: more is not to be gained by all that follow
_DAMPING, _EASED, _RAISED, _MOST = 1e-3, 0.2, 10.0, 1e6
_FURTHEST = 0.05  # of a side, in one step
_RIM = 1 / 15  # of a side: within it, a load moves the skin too little to be told
_LOUDEST = 1e12  # times the noise: beyond it, no load fits to rounding
_RIDGE = 1e-9  # keeps what the readings do not determine solvable
_NODES, _SHARES = np.polynomial.legendre.leggauss(5)  # of a line, from -1 to 1


class Contacts:
    """The contacts on a skin: one, or two where the readings tell them apart.

    Where the single load that fits best leaves more than the shape does, as one in four at most
    does by chance, or a second one beside it would take more off what it leaves than noise offers,
    two loads are fitted together, each of its own place, force and size. They are told as two if
    they are better than one by a likelihood ratio that hardly any single load reaches, better than
    a line, clear of one another and of the rim, push to the same side, leave no more than noise
    does, and a third load would take far less off that than the second did. Otherwise, what one
    load does not explain is distributed: not
    `single`. Where one is told or none, a `drift` of all readings may be told beside it
    (`SmoothDrift`). No two are told on a flat skin of known thickness, whose readings are no sums
    of those of its loads.

    Readings in different units are weighted by `sigma` (R,); no drift is estimated from them.
    """

    def __init__(
        self,
        plate: Plate,
        layout: SensorLayout,
        edge: str = "hinged",
        sigma: Array | None = None,
    ) -> None:
        self._one = PointContact(plate, layout, edge, sigma)
        self._drift = None if sigma is not None else SmoothDrift(plate, layout, edge)
        self.drift: FittedDrift | None = None
        """The drift beside the last contacts; None where there is none."""
        self._scale = None if sigma is None else 1 / sigma
        weighted = replace(layout, scale=self._scale)
        self._pairs = None if plate.stretches else _Pairs(plate, weighted, edge)

    def __call__(self, curvature: Array, fit: Fit) -> tuple[Contact, Contact]:
        """The stronger contact and the weaker one; without it `NO_CONTACT`.

        For `curvature` (3, P) in 1/m, NaN where missing, and the `fit` to it.
        """
        found = self._pressed(curvature, fit)
        if self._drift is None:
            return found
        rest = self._one.rest
        left = float(rest.dot(rest))
        if found[1].present and self._pairs is not None:
            left = self._pairs.left
        self.drift = self._drift(curvature, fit, found, rest, left)
        return self.drift.contacts if self.drift else found

    def geometry(self, fit: Fit, contact: Contact) -> LocalGeometry:
        """Geometry of the skin at a contact; NaN where there is none."""
        return contact_geometry(fit, contact)

    def _pressed(self, curvature: Array, fit: Fit) -> tuple[Contact, Contact]:
        """The contacts where nothing drifts."""
        contact, misfit = self._one(curvature, fit), self._one.misfit
        if not contact.present:
            return contact, NO_CONTACT
        noise = float(fit.noise) * min(math.sqrt(misfit), 1.0)
        if misfit <= left_by_chance(_LOOKED_AT, contact.spare, fit.spare) and (
            self._pairs is None or self._pairs.hint(self._one.rest / (noise or 1.0)) < _HINT
        ):
            return contact, NO_CONTACT
        single = misfit <= left_by_chance(_MISFIT, contact.spare, fit.spare)
        contact = replace(contact, single=single)
        with np.errstate(all="ignore"):
            readings = curvature.ravel() / noise
            if self._scale is not None:
                readings *= self._scale
            if self._pairs is None or not np.nanmax(np.abs(readings)) < _LOUDEST:
                return contact, NO_CONTACT
        return self._pairs(readings, fit, contact, noise)


def as_one(first: Contact, second: Contact) -> Contact:
    """One contact in place of two, as an object has that touches in two places.

    It lies between them and has the force of both; in the middle where forces are unknown.
    """
    if not second.present:
        return first
    force = first.force + second.force
    share = first.force / force if math.isfinite(force) else 0.5
    return replace(
        first,
        position=share * first.position + (1 - share) * second.position,
        position_sd=np.hypot(share * first.position_sd, (1 - share) * second.position_sd),
        force=force,
        force_sd=math.hypot(first.force_sd, second.force_sd),
    )


class _Readings(NamedTuple):
    """Readings `K` (C,) in units of their noise, zero where not `used` (C,)."""

    K: Array
    used: Mask


class _Model(NamedTuple):
    """What elements read of loads: `T` (C,), its derivatives `J` (U, C) by the U unknowns.

    The variance of a reading is 1 + `doubt` (C,).
    """

    T: Array
    J: Array
    doubt: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Tried:
    """Loads `p` (L, U), -2 ln of their likelihood, and the rest of the readings.

    With its derivatives and weights.
    """

    p: Array
    cost: float
    rest: Array
    J: Array
    weights: Array

    @property
    def left(self) -> float:
        """Weighted sum of squares that the loads leave of the readings."""
        return float((self.weights * self.rest).dot(self.rest))

    def worse(self, than: "_Tried", variance: float) -> float:
        """-2 ln of the likelihood ratio to other loads, which leave a `variance` of readings."""
        logarithms = (self.cost - self.left) - (than.cost - than.left)
        return (self.left - than.left) / variance + logarithms

    def normal(self) -> tuple[Array, Array]:
        """The normal matrix (U, U) scaled to a diagonal of 1, and the scale (U,), 0 if not felt."""
        H = (self.J * self.weights).dot(self.J.T)
        scale = np.sqrt(H.diagonal())
        outer = np.multiply.outer(scale, scale)
        return np.divide(H, outer, out=np.eye(len(H)), where=outer > 0), scale

    def covariance(self) -> Array:
        """Covariance (U, U) of the unknowns for unit noise."""
        H, scale = self.normal()
        H.flat[:: len(H) + 1] += _RIDGE
        per = np.divide(1, scale, out=np.zeros_like(scale), where=scale > 0)
        return np.multiply(np.linalg.inv(H), np.multiply.outer(per, per), dtype=np.float64)


class _Loads:
    """What the elements of a skin read of several loads, and of one along a line."""

    def __init__(self, plate: Plate, layout: SensorLayout, edge: str) -> None:
        self.patch, C, self._element = plate.patch, layout.channels, layout.element
        self._rows = np.zeros((4, C))
        self.influence = influence_of(plate, layout, edge, _FUNCTIONS, self._rows)
        self.start, self._least, self._largest = sizes_on(self.patch)
        self._reach = _FURTHEST * np.array([self.patch.a, self.patch.b])

    def at(self, x: float, y: float, s: float) -> Array:
        """Readings and derivatives (4, C) of a load at (x, y) in m of the squared radius `s`."""
        self.influence.at(x, y, s)
        return self._rows

    def _doubt(self, s: float, force: float) -> Array | float:
        trust = self.influence.trust(s, (BY_PROFILE * force) ** 2)
        profile = self.influence.profile(s)
        around = 0.0 if profile is None else np.square(force * profile[0])
        return around if trust is None else around + (1 / trust - 1)[self._element]

    def several(self, p: Array) -> _Model:
        """Loads (L, 4): x, y and squared radius, and force in units."""
        J = np.empty((len(p), 4, self._rows.shape[1]))
        total, doubt = np.zeros(J.shape[2]), np.zeros(J.shape[2])
        for own, (x, y, s, force) in zip(J, p.tolist(), strict=True):
            rows = self.at(x, y, s)
            np.multiply(rows[1:], force, out=own[:3])
            own[3] = rows[0]
            total += force * rows[0]
            doubt += self._doubt(s, force)
        return _Model(total, J.reshape(-1, J.shape[2]), doubt)

    def line(self, p: Array) -> _Model:
        """One load (1, 5) along a line: its middle, half of what its ends differ by, and force."""
        x, y, u, v, force = p[0].tolist()
        J, doubt = np.zeros((5, self._rows.shape[1])), np.zeros(self._rows.shape[1])
        s = min(max((u * u + v * v) / len(_NODES) ** 2, self._least), self._largest)
        for t, share in zip(_NODES.tolist(), (_SHARES / 2).tolist(), strict=True):
            rows = self.at(*self.patch.inward(x + t * u, y + t * v), s)
            along = (force * share) * rows[1:3]
            J[:2] += along
            J[2:4] += t * along
            J[4] += share * rows[0]
            doubt += self._doubt(s, force * share)
        return _Model(force * J[4], J, doubt)

    def free(self, p: Array, slopes: Array) -> Mask:
        """Which unknowns may move: not a size at its bound outward."""
        free = np.ones(p.shape, bool)
        if p.shape[1] == 4:
            s, up = p[:, 2], slopes.reshape(p.shape)[:, 2]
            free[:, 2] = ~(((s <= self._least) & (up < 0)) | ((s >= self._largest) & (up > 0)))
        return free.ravel()

    def moved(self, p: Array, steps: Array) -> Array:
        """The loads after steps in all unknowns, none too far, and inside the skin."""
        step, new = steps.reshape(p.shape), p.copy()
        new[:, -1] += step[:, -1]
        new[:, :2] += np.clip(step[:, :2], -self._reach, self._reach)
        new[:, :2] = [self.patch.inward(x, y) for x, y in new[:, :2].tolist()]
        if p.shape[1] == 4:
            s, ds = p[:, 2], step[:, 2]
            # A step to a larger size is taken in the radius, as `PointContact` does.
            grown = np.where(ds > 0, s * (1 + np.maximum(ds, 0) / (2 * s)) ** 2, s + ds)
            new[:, 2] = np.clip(grown, self._least, self._largest)
        else:
            new[:, 2:4] += np.clip(step[:, 2:4], -self._reach, self._reach)
        return new


def _tried(model: Callable[[Array], _Model], p: Array, readings: _Readings) -> _Tried:
    K, used = readings
    T, J, doubt = model(p)
    weights, rest = used / (1 + doubt), K - T
    cost = float((weights * rest).dot(rest)) + float(np.log1p(doubt).dot(used))
    return _Tried(p, cost, rest, J, weights)


class _Pairs:
    """One load, two, and a line, fitted to the same readings."""

    def __init__(self, plate: Plate, layout: SensorLayout, edge: str) -> None:
        self.patch, strip = plate.patch, plate.patch.strip
        self._live, self._loads = layout.live.ravel(), _Loads(plate, layout, edge)
        self._basis, self._compliance, M = read_of_modes(plate, layout, edge, _FUNCTIONS)
        x, y = self.patch.grid(_SEARCHED + 2, 3 if strip else _SEARCHED + 2)
        places = np.stack(np.meshgrid(x[1:-1], y[1:-1]), -1).reshape(-1, 2)
        self._places = places[self.patch.moves(places)]
        self._felt = self._basis.at(self._places)
        self._M = M * self._loads.influence.unit
        read = self._felt @ M.T
        read /= np.linalg.norm(read, axis=1, keepdims=True)
        self._alone: Single = read.astype(np.float32)
        self._pairs = PatternCache[tuple[Array, Array, Array]]()
        self.left = math.nan
        """Weighted sum of squares that the last two loads leave of the readings."""

    def hint(self, rest: Array) -> float:
        """What another load takes off the sum of squares of the `rest` (C,) at least."""
        return float(np.square(self._alone @ rest.astype(np.float32)).max())

    def __call__(
        self, K: Array, fit: Fit, contact: Contact, noise: float
    ) -> tuple[Contact, Contact]:
        """The contacts for readings `K` (C,) over their noise, by the single one that fits best."""
        used = self._live & np.isfinite(K)
        readings = _Readings(np.where(used, K, 0.0), used)
        several, unit = self._loads.several, noise * self._loads.influence.unit
        s = contact.size if self._loads.influence.sized else self._loads.start
        alone = np.array([[*contact.position, s, contact.force / unit]])
        single = _tried(several, alone, readings)
        hint, beside = self._beside(single, readings)
        if hint < _HINT:
            return contact, NO_CONTACT
        starts = [np.vstack([alone, beside]), self._found(readings)]
        starts.sort(key=lambda each: _tried(several, each, readings).cost)
        for start in starts if hint > _DISTINCT else starts[:1]:
            two = self._climbed(several, start, readings)
            spare = int(used.sum()) - two.p.size
            variance = two.left / spare
            one = self._climbed(several, alone, readings, two.cost + _DISTINCT * variance)
            better = one.worse(two, variance)
            if better > _DISTINCT and self._explains(two, spare, fit, one.left - two.left):
                break
            contact = replace(contact, single=contact.single and better < _SPREAD)
            if better * variance > hint and two.p[:, 3].min() > 0:  # no other pair is better
                return contact, NO_CONTACT
        else:
            return contact, NO_CONTACT
        if self._is_line(two, variance, readings):
            return replace(contact, single=False), NO_CONTACT
        self.left = two.left * noise**2
        return self._told(two, spare, fit, noise)

    def _explains(self, two: _Tried, spare: int, fit: Fit, gain: float) -> bool:
        """Whether two loads explain the readings, and are clear of one another and of the rim.

        The second takes `gain` off the sum of squares that they leave; a third one would far less.
        """
        variance = two.left / spare
        (x, y, s, force), (X, Y, S, other) = two.p.tolist()
        wide = math.sqrt(s) + math.sqrt(S) if self._loads.influence.sized else 0.0
        return (
            force * other > 0
            and math.hypot(X - x, Y - y) > wide
            and not held_near(self._basis, x, y, _RIM)
            and not held_near(self._basis, X, Y, _RIM)
            and two.left <= spare * left_by_chance(_LEFT, spare, fit.spare)
            and self.hint(two.rest * np.sqrt(two.weights)) < max(_THIRD * gain, _SPREAD * variance)
        )

    def _is_line(self, two: _Tried, variance: float, readings: _Readings) -> bool:
        """Whether a line fits about as well as two loads, which leave this `variance`."""
        ends, least = two.p[:, :2], two.cost + _NO_LINE * variance
        line = np.array([[*ends.mean(axis=0), *(ends[1] - ends[0]) / 2, two.p[:, 3].sum()]])
        return (
            self._climbed(self._loads.line, line, readings, least, least).worse(two, variance)
            < _NO_LINE
        )

    def _found(self, readings: _Readings) -> Array:
        """The two loads (2, 4) on a grid that explain most, and both push inward."""
        K, used = readings
        _, shared, across = self._pairs(used, self._products)
        norm, read = shared.diagonal(), self._felt @ (K @ self._M)
        # Forces of all pairs, times `across`: what the first explains besides the second.
        forces = np.multiply.outer(read, norm) - shared * read
        gain = np.where(
            np.minimum(forces, forces.T) > 0, (forces * read[:, None] + forces.T * read), 0.0
        )
        gain /= across
        first, second = divmod(int(gain.argmax()), len(read))
        pair = [first, second]
        found = forces[pair, pair[::-1]] / across[first, second]
        return np.column_stack([self._places[pair], [self._loads.start] * 2, found])

    def _beside(self, one: _Tried, readings: _Readings) -> tuple[float, Array]:
        """What a second load on the grid takes off -2 ln of the likelihood, in first order.

        The first one gives way to it. And that load (1, 4).
        """
        read = self._pairs(readings.used, self._products)[0]
        Q = np.linalg.qr((one.J * np.sqrt(one.weights)).T)[0]
        own = read @ Q
        norm = np.vecdot(read, read)
        across = norm - np.vecdot(own, own)
        rest = one.rest * np.sqrt(one.weights)
        across[across <= _COVERED * norm] = math.inf
        force = read @ (rest - Q @ (rest @ Q)) / across
        gain = force**2 * np.minimum(across, norm)
        best = int(gain.argmax())
        return float(gain[best]), np.array([[*self._places[best], self._loads.start, force[best]]])

    def _products(self, used: Mask) -> tuple[Array, Array, Array]:
        """What the readings `used` (C,) are of a load at each place (G, C); their products (G, G).

        And the determinants of those of each pair, infinite where one hides the other.
        """
        read = np.where(used, self._felt @ self._M.T, 0.0)
        shared = read @ read.T
        squares = np.multiply.outer(shared.diagonal(), shared.diagonal())
        across = squares - shared**2
        return read, shared, np.where(across > _COVERED * squares, across, math.inf)

    def _climbed(
        self,
        model: Callable[[Array], _Model],
        p: Array,
        readings: _Readings,
        wanted: float = math.inf,
        enough: float = -math.inf,
    ) -> _Tried:
        """The most likely loads near `p`, by the steps of Levenberg and Marquardt.

        Or any of a cost below `enough`, or from which no steps promise to come near the one that is
        `wanted`.
        """
        best, damping = _tried(model, p, readings), _DAMPING
        for _ in range(_STEPS):
            normal, scale = best.normal()
            slopes = best.J.dot(best.weights * best.rest)
            free = np.flatnonzero((scale > 0) & self._loads.free(best.p, slopes))
            H, g = normal[np.ix_(free, free)], slopes[free] / scale[free]
            H.flat[:: len(H) + 1] += damping
            step = cast("Array", np.linalg.solve(H, g))
            if best.cost - _HOPE * float(step.dot(g)) > wanted:
                break
            steps = np.zeros(len(slopes))
            steps[free] = step / scale[free]
            other = _tried(model, self._loads.moved(best.p, steps), readings)
            gain = best.cost - other.cost
            damping *= _EASED if gain > 0 else _RAISED
            best = other if gain > 0 else best
            if 0 < gain < _WORTH or damping > _MOST or best.cost < enough:
                break
        return best

    def _told(self, two: _Tried, spare: int, fit: Fit, noise: float) -> tuple[Contact, Contact]:
        """The two loads as contacts, the stronger one first."""
        unit = self._loads.influence.unit
        variance = two.covariance().diagonal() * (two.left / spare)
        sd = np.sqrt(variance).reshape(2, 4)
        forces, force_sd = two.p[:, 3] * (noise * unit), sd[:, 3] * (noise * unit)
        felt = self._basis.at(two.p[:, :2])
        beside = ((self._compliance.after(felt) @ felt.T)[0, 1] * forces[::-1]).tolist()
        found = [
            Contact(
                two.p[i, :2].copy(),
                sd[i, :2],
                float(forces[i]),
                float(force_sd[i]),
                *self._displacement(fit, two.p[i], float(forces[i]), beside[i]),
                spare,
                False,
                False,
                *self._size(float(two.p[i, 2]), float(sd[i, 2])),
            )
            for i in np.argsort(-np.abs(forces))
        ]
        return found[0], found[1]

    def _size(self, s: float, sd: float) -> tuple[float, float]:
        return (s, sd) if self._loads.influence.sized else (math.nan, math.nan)

    def _displacement(
        self, fit: Fit, load: Array, force: float, beside: float
    ) -> tuple[float, float]:
        """Displacement in m under a load, and its standard deviation, as `PointContact` has them.

        The other load moves the skin there by `beside` in m.
        """
        x, y = load[:2].tolist()
        under = force * self._loads.influence.gives(x, y) + beside
        shape, covariance = fit.jet(x, y)
        fitted, observed = float(shape[0]), float(covariance[0, 0])
        observed = math.sqrt(observed) if observed >= 0 else math.nan
        return fitted, math.hypot(observed, fitted - under)
