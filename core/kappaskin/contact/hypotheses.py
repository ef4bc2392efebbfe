"""Object hypotheses: the best sphere, edge and cylinder for a contact, and their likelihoods."""

import math
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np
import scipy

from kappaskin.contact.elastic_skin import (
    ARC,
    EVEN,
    ROUND,
    ElasticSkin,
    ForceModel,
    Optimum,
    PointForces,
    Prior,
    arcs,
    ends,
    lengthwise,
    optimise,
    oval,
    ring,
)
from kappaskin.frames import Array, Contact, Mask

# On a bent skin, of its curvature and the object's: 0.02 to 0.07 of shells from 0.25 to 2 mm thick,
# but 0.23 where the arcs are narrower than a half wave.
INEXACT_BENT = 0.08
_LEAST = 3e-3  # of a side: as narrow as a ring or an arc is made
_BLUNT = 0.4  # of a half wave: a narrower contact is a point to the functions
_WIDE = 2.0  # half waves: a smaller ring is taken for a circle
_MOST = 0.5  # of the force: between the ends, at most
_NOTHING = 0.01  # of the force: less is not worth the points it takes
_RING_RADII = (0.25, 0.5, 0.7, 0.85, 1.0, 1.15, 1.3, 1.6, 2.0)  # of a ring: circles it may press on
_PLACES = np.vstack([np.zeros((1, 2)), *(r * ROUND[:, :2] for r in _RING_RADII)])
_EVENLY = ROUND[:, 0], np.zeros(len(ROUND)), ROUND[:, 2]  # as a line bears on a plate
_LINE = lengthwise(*_EVENLY)
_TRIAL = 0.2  # of the force: between the ends, to see what it does


@dataclass(frozen=True, slots=True)
class Width:
    """The relation of the object's curvature to q, the squared width of its contact.

    The skin inside a ring or an arc that is e times as wide is bent `bend` less:
    curvature(q) = k0 - bend / 2 ln(q / q0). Of the standard deviation `sd` in m^2 of q the readings
    make `measured`, and the rest is what the relation leaves out.
    """

    q: float
    sd: float
    measured: float
    k0: float
    q0: float
    bend: float

    def curvature(self, q: float) -> float:
        """Curvature in 1/m for `q` in m^2; infinite where the width vanishes."""
        return self.k0 - self.bend / 2 * math.log(q / self.q0) if q > 0 else math.inf

    def of_curvature(self, curvature: Array) -> Array:
        """The q in m^2 of an object of that `curvature` in 1/m."""
        return self.q0 * np.exp(np.minimum(2 * (self.k0 - curvature) / self.bend, 100.0))

    def likelihood(self, q: Array) -> Array:
        """Likelihood of `q` relative to the maximum."""
        return np.exp(-0.5 * ((q - self.q) / self.sd) ** 2)


@dataclass(frozen=True, slots=True)
class WidthOnDome(Width):
    """The same on a dome of the curvature `rest`, whose sheet is compressed as well.

    Its curvatures are known to the share `inexact` of the object's and the skin's, as a standard
    deviation. A layer that gives by t per pressure widens the contact of a force F, `soft` = t F in
    m^3: its pressure is even with a paraboloid of the relative curvature k, with the mean square
    distance 2/3 sqrt(t F / (pi k)) from its middle.
    """

    rest: float
    soft: float
    inexact: float

    def curvature(self, q: float) -> float:
        tried = self.rest * (_RELATIVE - 1)
        return float(np.interp(-q, -self.of_curvature(tried), tried, right=math.inf))

    def of_curvature(self, curvature: Array) -> Array:
        thin = Width.of_curvature(self, curvature)
        if not self.soft:
            return thin
        layer = 2 / 3 * np.sqrt(self.soft / (np.pi * (curvature + self.rest)))
        # It widens less what the bending spreads already: so the contact solver has it, to 5 %.
        return thin + layer / (1 + (thin / (2 * layer)) ** 3)

    def uncertain(self) -> "WidthOnDome":
        """The same with what is `inexact` in its deviation."""
        k = min(max(self.curvature(self.q), 0.0), _RELATIVE[-1] * self.rest)
        low, high = self.of_curvature(k + self.inexact * (self.rest + k) * np.array([-1.0, 1.0]))
        return replace(self, sd=math.hypot(self.sd, float(low - high) / 2))


_RELATIVE = np.geomspace(0.05, 1e3, 400)  # curvatures of objects over a dome's own, plus one


@dataclass(frozen=True, slots=True)
class WidthOfCylinder(WidthOnDome):
    """The same of a cylinder that bears along the length 2 `half` in m.

    Forces even in angle around an ellipse with the half axes A and B leave the skin inside less
    bent by (F / 4 pi D) (ln((A + B) / 2) -+ (B - A) / (2 (A + B))) along and across it. Along a
    cylinder it is as straight as that. The layer has a pressure as a parabola across.
    """

    half: float

    def of_curvature(self, curvature: Array) -> Array:
        narrow = np.maximum(self.bend - curvature, 0.0) / np.maximum(self.bend + curvature, 1e-300)
        across = 1.5 * self.soft / (2 * self.half * (curvature + self.rest))
        return (self.half * np.minimum(narrow, 1.0)) ** 2 + 2 / 5 * across ** (2 / 3)


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """The best object of a kind, with its `width` if it has one.

    `between` (2,) in m is the vector from one end to the other, `slopes` (2,) the change of slope.
    On a dome a straight object bears on the square `length2` in m^2 of a length, with the standard
    deviation `length2_sd`, whatever its own length is.
    """

    best: Optimum
    width: Width | None = None
    between: Array = field(default_factory=lambda: np.zeros(2))
    slopes: Array = field(default_factory=lambda: np.zeros(2))
    length2: float = math.nan
    length2_sd: float = math.nan

    def axis(self, radius: float) -> float:
        """Angle in rad of the axis for that `radius` in m.

        Where the skin slopes, a cylinder touches beside its axis by slope times radius.
        """
        x, y = self.between + radius * self.slopes
        return math.atan2(y, x)


def least_width(skin: ElasticSkin) -> float:
    """The smallest q in m^2 of a ring or an arc."""
    return (_LEAST * skin.side) ** 2


def _resolved(skin: ElasticSkin, optimum: Optimum) -> Array:
    """The parameters, with at least the width that the functions resolve."""
    return np.append(optimum.parameters[:-1], max(optimum.parameters[-1], skin.half_wave**2))


def _rise(skin: ElasticSkin, forces: PointForces, centres: Array, points: Array) -> Array:
    """Displacement along the force in m at each of `centres` (m, 2), less that at (m, k, 2)."""
    places = np.concatenate([centres[:, None], points], axis=1)
    gives = skin.gives(forces, places.reshape(-1, 2)).reshape(len(places), -1)
    return math.copysign(1.0, forces.weights.sum()) * (gives[:, :1] - gives[:, 1:])


def _inside_ring(skin: ElasticSkin, forces: PointForces) -> tuple[float, Array]:
    """Curvature in 1/m of an object that presses on a ring, and its tilt (2,)."""
    centre = np.abs(forces.weights) @ forces.points / np.abs(forces.weights).sum()
    out = forces.points - centre
    rise = _rise(skin, forces, centre[None], forces.points[None])[0]
    # A bent skin is bent back by its own curvature too.
    rise -= skin.sag(out)
    columns = np.column_stack([np.sum(out**2, axis=1) / 2, -out])
    weight = np.sqrt(np.abs(forces.weights))[:, None]
    solved = cast("Array", np.linalg.lstsq(weight * columns, weight[:, 0] * rise)[0])
    return float(solved[0]), solved[1:]


def ring_pattern(skin: ElasticSkin, sphere: Optimum) -> Array:
    """The force pattern (k, 3) of a sphere of the curvature so far: x, y, share; radius one.

    A contact problem, solved by non-negative least squares: forces >= 0 on a grid of points, such
    that no point is pressed in less deep than the sphere is.
    """
    q = sphere.parameters[-1]
    narrow = skin.half_wave if skin.is_dome and skin.is_even else 0.0
    if q < (narrow if skin.form.any() else _WIDE * skin.half_wave) ** 2:
        return ROUND
    p = _resolved(skin, sphere)
    curvature, tilt = _inside_ring(skin, sphere.contact(p))
    out = math.sqrt(p[-1]) * _PLACES
    gap = curvature / 2 * np.sum(out**2, axis=1) + skin.sag(out)
    share = skin.pressed(p[:2] + out, gap - out @ tilt, abs(p[2])) / abs(p[2])
    on = share > _NOTHING / 10
    share, unit = share[on] / share[on].sum(), _PLACES[on]
    unit = unit - share @ unit
    size = math.sqrt(share @ np.sum(unit**2, axis=1))
    return np.column_stack([unit / size, share]) if size else ROUND


def _arcs(forces: PointForces) -> Array:
    """The points (2, k, 2) of the two arcs."""
    return forces.points[: 2 * ARC].reshape(2, ARC, 2)


def _inside_arcs(skin: ElasticSkin, forces: PointForces) -> Array:
    """The skin's curvature (2,) in 1/m along each of the two arcs."""
    points = _arcs(forces)
    middles = points.mean(axis=1)
    rise = _rise(skin, forces, middles, points)
    return 2 * rise.sum(axis=1) / np.sum((points - middles[:, None]) ** 2, axis=(1, 2))


def middle(skin: ElasticSkin, edge: Optimum) -> float:
    """Share of the force between the ends that keeps the skin from rising into the edge."""
    gaps: list[float] = []
    for share in (0.0, _TRIAL):
        forces = ends(share)(edge.parameters[:6])
        first, second = forces.points[:2]
        halfway = (first + second) / 2
        rise = _rise(skin, forces, halfway[None], np.stack([first, second])[None])
        gaps.append(float(rise.mean()))
    lifted, pressed = gaps
    gained = pressed - lifted  # none where both ends and the middle are one place
    share = min(-lifted / gained * _TRIAL, _MOST) if lifted < 0 < gained else 0.0
    return share if share > _NOTHING else 0.0


def _slopes(skin: ElasticSkin, forces: PointForces, places: Array) -> Array:
    """Slope (m, 2) of the skin at `places` (m, 2) in m, downward along the force."""
    step = skin.half_wave / 4
    around = step * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    fall = _rise(skin, forces, places, places[:, None] + around)
    return (fall[:, 1::2] - fall[:, ::2]) / (2 * step)


def arc_widths(skin: ElasticSkin, cylinder: Optimum, middle: float) -> tuple[float, float]:
    """Relative widths of the two arcs, one at the stronger end, for one curvature on both."""
    parameters = _resolved(skin, cylinder)
    curvatures = _inside_arcs(skin, arcs(EVEN, middle)(parameters))
    force, share = abs(parameters[2]), parameters[5]
    strong = 0 if share > 0 else 1
    weaker = force * (1 - middle) * (0.5 - abs(share))
    short = max(float(curvatures[strong] - curvatures[1 - strong]), 0.0)
    width = max(math.exp(-short / (skin.bend * weaker)), 0.02)
    return (1.0, width) if strong == 0 else (width, 1.0)


def _measured_width(skin: ElasticSkin, optimum: Optimum) -> tuple[float, float, float]:
    """q in m^2, what of it the functions resolve, and its standard deviation."""
    # On its bound, q is where the readings would have it.
    low = least_width(skin)
    q = float(optimum.parameters[-1])
    q += float(optimum.prevented[-1]) if q <= low * 1.001 else 0.0
    sd = math.hypot(math.sqrt(optimum.covariance[-1, -1]), (_BLUNT * skin.half_wave) ** 2)
    return q, float(_resolved(skin, optimum)[-1]), sd


def _width(skin: ElasticSkin, optimum: Optimum, curvature: float, force: float) -> Width:
    q, q0, sd = _measured_width(skin, optimum)
    if not skin.is_dome:
        return Width(q, sd, sd, curvature, q0, skin.bend * abs(force))
    of_skin = float(skin.form[:2].sum()) / 2, skin.layer * abs(force), 1.25 * INEXACT_BENT
    return WidthOnDome(q, sd, sd, curvature, q0, skin.bend * abs(force), *of_skin).uncertain()


def fitted_sphere(skin: ElasticSkin, sphere: Optimum) -> Hypothesis:
    """The sphere, with the curvature of the skin inside its ring."""
    parameters = _resolved(skin, sphere)
    curvature, _ = _inside_ring(skin, sphere.contact(parameters))
    return Hypothesis(sphere, _width(skin, sphere, curvature, parameters[2]))


def fitted_cylinder(skin: ElasticSkin, cylinder: Optimum) -> Hypothesis:
    """The cylinder, with the curvature of the skin along the stronger of its two arcs."""
    parameters, contact = _resolved(skin, cylinder), cylinder.contact
    inside = _inside_arcs(skin, contact(parameters))
    base = 2 * float(skin.sag(np.array([math.sin(parameters[3]), math.cos(parameters[3])])))
    forces = contact(cylinder.parameters)
    of_ends = [float(forces.weights[part].sum()) for part in (slice(ARC), slice(ARC, 2 * ARC))]
    strong = int(abs(of_ends[1]) > abs(of_ends[0]))
    width = _width(skin, cylinder, float(inside[strong]) - base, of_ends[strong])
    two_ends = _arcs(forces).mean(axis=1)
    first, second = _slopes(skin, forces, two_ends)
    return Hypothesis(cylinder, width, two_ends[0] - two_ends[1], first - second)


SHARE = 0.2
"""Prior standard deviation of the difference between the forces on two ends."""
_ANGLE = 0.9  # rad, of an axis that is not known

_INEXACT = 0.02  # of a reading: that closely does a skin behave like a plate at best
_START = 0.025  # of a side: as wide as it is at first
_NEAR = 25  # places of the grid near a contact
_EXACT = 1e-12  # chi-squared: less is left of exact readings
_ALIKE = 1e-3  # of a column of unit length: what is left of one that others explain
_SHORT = 0.25  # of a side: an object as long may lie across what looks like its axis
_WORSE = 1.25  # times the cost of a ring, that one a little further on never has
_BETTER = 6.0  # chi-squared that another axis must gain


@dataclass(frozen=True, slots=True, eq=False)
class Hypotheses:
    """The best object of each kind for a contact; `noise` in 1/m is what the best one leaves."""

    sphere: Hypothesis
    edge: Hypothesis
    cylinder: Hypothesis
    noise: float
    readings: int
    weighted: "WeightedReadings"

    @property
    def plane(self) -> Hypothesis:
        """What a plane presses as: on a dome as a sphere, on others as a cylinder."""
        return self.sphere if self.weighted.skin.is_dome else self.cylinder


def fit_hypotheses(
    coarse: ElasticSkin,
    skin: ElasticSkin,
    readings: Array,
    used: Mask,
    noise: float,
    contact: Contact,
) -> Hypotheses:
    """The best objects for `readings` (R,) in 1/m, zero where not `used`, at the contact `contact`.

    First on the `coarse` skin: a reading grows without bound as a force comes close, and with many
    functions a force would stay on the side of an element where it started.
    """
    frame = WeightedReadings(coarse, readings, used)
    place = skin.local(contact.position)
    pair, forces = coarse.best_pair(place, readings, used)
    frame.trust(noise, _at(place[None], np.array([contact.force])), _at(pair, forces))
    sphere, edge = frame.sphere(place, contact.force), frame.edge(pair, forces)
    cylinder = frame.cylinder(edge)
    tried = (sphere, edge, cylinder)
    noise *= frame.spread(tried)
    frame = WeightedReadings(skin, readings, used)
    frame.trust(noise, *(o.contact(o.parameters) for o in tried))
    sphere = frame.shaped(sphere)
    if skin.is_dome:
        return _fitted_on_dome(frame, sphere, edge, cylinder, noise)
    edge = min((frame.edged(edge), frame.edged(cylinder)), key=_cost)
    between = middle(skin, edge)
    cylinder = frame.rounded(cylinder, between)
    if cylinder.cost > edge.cost:  # of which an edge is the narrowest
        cylinder = min(cylinder, frame.rounded(frame.next_to(edge), between), key=_cost)
    noise *= frame.spread((sphere, edge, cylinder))
    return Hypotheses(
        fitted_sphere(skin, sphere),
        Hypothesis(edge),
        fitted_cylinder(skin, cylinder),
        noise,
        int(used.sum()),
        frame,
    )


def _fitted_on_dome(
    frame: "WeightedReadings", sphere: Optimum, edge: Optimum, cylinder: Optimum, noise: float
) -> Hypotheses:
    """The best objects on a dome, where one that is straight bears in its middle."""
    skin = frame.skin
    near = min((edge, cylinder), key=_cost)
    along, share, length = bearing_length(skin, near.parameters)
    edge = frame.again(near, lengthwise(along, np.zeros_like(along), share), 6)
    beside = np.sqrt(np.maximum(1 - along**2, 0.0))
    of_arcs = lengthwise(np.tile(along, 2), np.append(beside, -beside), np.tile(share / 2, 2))
    cylinder = frame.again(near if near is cylinder else frame.widened(edge), of_arcs, 7)
    noise *= frame.spread((sphere, edge, cylinder))
    return Hypotheses(
        fitted_sphere(skin, sphere),
        _straight(skin, edge, length),
        _straight(skin, cylinder, length),
        noise,
        frame.count,
        frame,
    )


_STATIONS = np.linspace(-1.0, 1.0, 33)


def bearing_length(skin: ElasticSkin, parameters: Array) -> tuple[Array, Array, float]:
    """How a long straight edge bears on a dome: places (k,), shares (k,), and its length in m.

    Its force and direction are those of `parameters`; places are in half lengths from its middle.
    """
    force, angle = abs(float(parameters[2])), float(parameters[3])
    way, reach = np.array([math.cos(angle), math.sin(angle)]), skin.side / 2
    share, square, length = _EVENLY[2], 0.0, 0.0
    for _ in range(3):
        out = np.multiply.outer(reach * _STATIONS, way)
        share = skin.pressed(np.add(parameters[:2], out), skin.sag(out), force)
        share = (share + share[::-1]) / (2 * share.sum())  # the middle of the skin is not seen
        square = float(share @ _STATIONS**2)
        length = reach * math.sqrt(8 * square)  # as of shares 1 / sqrt(1 - u^2)
        reach = max(0.75 * length, least_width(skin) ** 0.5)
    if not square:
        return np.array([-1.0, 0.0, 1.0]), np.array([0.25, 0.5, 0.25]), length
    on = share > _NOTHING / 10
    return _STATIONS[on] / math.sqrt(2 * square), share[on] / share[on].sum(), length


def _straight(skin: ElasticSkin, best: Optimum, length: float) -> Hypothesis:
    """An edge or a cylinder on a dome, that alone bears on an edge's `length` in m."""
    force, angle = abs(best.parameters[2]), best.parameters[3]
    bend, half = skin.bend * force, length / 2
    along = np.array([math.cos(angle), math.sin(angle)])
    width, rest, soft = None, 2 * float(skin.sag(along)), skin.layer * force
    inexact = INEXACT_BENT * rest / bend
    if len(best.parameters) > 6:
        q, _, sd = _measured_width(skin, best)
        bears = math.sqrt(best.parameters[4]) / 2
        # Squared, as about as much force acts inside the ellipse instead: to 5 % of what `pressed`
        # finds, up to half lengths of 1.3 times that over which a dent fades.
        bent = bend * _unevenness(skin, best) ** 2
        of_skin = rest, soft, 2 * INEXACT_BENT
        width = WidthOfCylinder(q, sd, sd, 0.0, q, bent, *of_skin, bears).uncertain()
        k = width.curvature(q)
        narrow = bears * max(bent - k, 0.0) / (bent + k)
        for _ in range(20):  # as straight as along the edge
            half = length / 2 * math.exp(narrow / max(half + narrow, 1e-12)) - narrow
            half = max(half, narrow)
    longer = 8 / 3 * math.sqrt(soft * math.sqrt(1 + bend / rest) / (np.pi * rest))  # by the layer
    square = (2 * half) ** 2 + longer / 2
    sd = math.hypot(2 * square * inexact + longer / 2, (_BLUNT * skin.half_wave) ** 2)
    return Hypothesis(best, width, along, length2=square, length2_sd=sd)


def _unevenness(skin: ElasticSkin, best: Optimum) -> float:
    """By how much forces along a line bend a dome more along it than across, of a plate's share."""
    x, y, force, angle = best.parameters[:4]
    forces = _LINE(np.append(best.parameters[:5], 0.0))
    out, near = forces.points - (x, y), skin.half_wave / 2
    far = np.hypot(*out.T) > near
    if not far.any():
        return 1.0
    step = near / 2 * np.array([math.cos(angle), math.sin(angle)])
    around = np.array([step, -step, step[::-1] * (1, -1), step[::-1] * (-1, 1)])
    part = replace(forces, points=forces.points[far], weights=forces.weights[far])
    bent = float(np.dot((1, 1, -1, -1), skin.gives(part, np.add(around, (x, y)))))
    return bent / (near / 2) ** 2 / (skin.bend * force) + float(np.count_nonzero(~far)) / len(far)


def _cost(optimum: Optimum) -> float:
    return optimum.cost


def _at(points: Array, forces: Array) -> PointForces:
    return PointForces(points, forces, np.zeros((0, len(forces), 2)), np.zeros((0, len(forces))))


class WeightedReadings:
    """The readings of one frame, weighted by their noise and by what the models leave out."""

    def __init__(self, skin: ElasticSkin, readings: Array, used: Mask) -> None:
        self.skin, self._readings, self._used = skin, readings, used
        self._least, self._start = least_width(skin), (_START * skin.side) ** 2

    def trust(self, noise: float, *forces: PointForces) -> None:
        """Set the weights from `noise` in 1/m and from unresolved detail close to `forces`."""
        left_out = np.max([self.skin.unresolved(f) for f in forces], axis=0)
        inexact = (_INEXACT * self._readings) ** 2
        self._weight = self._used / np.sqrt(noise**2 + left_out + inexact)

    def spread(self, tried: tuple[Optimum, ...]) -> float:
        """Residual of the best of the optima, in units of the noise of the weights."""
        squares = min(optimum.squares for optimum in tried)
        return math.sqrt(squares / (int(self._used.sum()) - 6))

    def _climb(self, contact: ForceModel, start: Array, steps: int) -> Optimum:
        """Optimise x, y, F; then angle, squared length and share, if there are ends; then q."""
        n = len(start)
        mean, sd = start.copy(), np.full(n, np.inf)
        low, high = np.full(n, -np.inf), np.full(n, np.inf)
        if n >= 6:
            sd[3], sd[5], mean[5] = _ANGLE, SHARE, 0.0
            low[4], low[5], high[5] = self._least, -0.49, 0.49
        if n != 6:
            low[-1] = self._least
        prior = Prior(mean, sd, low, high)
        return optimise(self.skin, contact, start, prior, self._readings, self._weight, steps)

    def again(self, optimum: Optimum, contact: ForceModel, parameters: int) -> Optimum:
        """The optimum of `contact` near another's, as many of its `parameters` as it has."""
        return self._climb(contact, optimum.parameters[:parameters], 4)

    @property
    def count(self) -> int:
        """The number of readings used."""
        return int(self._used.sum())

    def sphere(self, place: Array, force: float) -> Optimum:
        return self._climb(ring(ROUND), np.array([*place, force, self._start]), 4)

    def widened(self, edge: Optimum) -> Optimum:
        """An edge as a cylinder that is narrow."""
        return replace(edge, parameters=np.append(edge.parameters, self._start / 10))

    def edge(self, pair: Array, forces: Array) -> Optimum:
        force, between = float(forces.sum()), pair[0] - pair[1]
        share = float(np.clip(forces[0] / force - 0.5, -0.4, 0.4))
        angle = math.atan2(between[1], between[0])
        start = [*(forces @ pair / force), force, angle, max(between @ between, self._least), share]
        if self.skin.is_dome:
            return self._climb(_LINE, np.array(start), 6)
        return self._climb(ends(0.0), np.array(start), 6)

    def cylinder(self, edge: Optimum) -> Optimum:
        """From the edge, or across it: a short cylinder's arcs may be longer than itself."""
        if self.skin.is_dome:
            return self._climb(oval, np.append(edge.parameters, self._start / 10), 5)
        along = self._climb(arcs(EVEN, 0.0), np.append(edge.parameters, self._start), 5)
        length2 = edge.parameters[4]
        if length2 > (_SHORT * self.skin.side) ** 2:
            return along
        turned = edge.parameters.copy()
        turned[3:6] = turned[3] + math.pi / 2, max(0.3 * length2, self._start), 0.0
        across = self._climb(arcs(EVEN, 0.0), np.append(turned, max(length2 / 4, self._start)), 5)
        return across if across.cost < along.cost - _BETTER else along

    def shaped(self, sphere: Optimum) -> Optimum:
        """The sphere, its ring of forces as the bending of the skin shapes it."""
        pattern = ring_pattern(self.skin, sphere)
        even, sphere = sphere, self.again(sphere, ring(pattern), 4)
        if self.skin.is_dome and pattern is not ROUND:  # which may have tipped over to another
            sphere = min(sphere, self.again(even, ring(ROUND), 4), key=_cost)
        for _ in range(
            2 if self.skin.form.any() and not self.skin.is_even else 1
        ):  # further from a circle
            again = self.again(sphere, ring(ring_pattern(self.skin, sphere)), 4)
            if again.cost > _WORSE * sphere.cost:  # the pattern has tipped over to another
                break
            sphere = again
        return sphere

    def edged(self, near: Optimum) -> Optimum:
        """The edge near another optimum, with the force between its ends that contact demands."""
        share = middle(self.skin, near)
        edge = self.again(near, ends(share), 6)
        return self.again(edge, ends(middle(self.skin, edge)), 6) if share else edge

    def next_to(self, edge: Optimum) -> Optimum:
        """The cylinder next to an edge."""
        return self._climb(arcs(EVEN, 0.0), np.append(edge.parameters, self._start / 10), 4)

    def oval(self, cylinder: Optimum, edge: Optimum) -> Optimum:
        """The oval nearest to the better one of the two."""
        start = np.append(edge.parameters, self._start)
        if cylinder.cost < edge.cost:
            start = cylinder.parameters.copy()
        start[4] *= 2 * (1 - 4 * start[5] ** 2)  # as long by the mean square of its forces
        return self._climb(oval, start, 6)

    def chance(self, optimum: Optimum) -> float:
        """Probability that noise alone leaves as much that other forces than these explain.

        The lower of two, doubled: of an F test of forces on all places of the grid near the
        contact, and of a t test of the one place anywhere that explains most.
        """
        K, slopes = self.skin.readings(optimum.contact(optimum.parameters))
        J = self._weight[:, None] * slopes
        Q, _ = np.linalg.qr(J / np.maximum(np.linalg.norm(J, axis=0), 1e-300))
        left = self._weight * (self._readings - K)
        left -= Q @ (Q.T @ left)
        rows = self._weight * self.skin.under
        rows /= np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-300)
        size = 1 - np.sum((rows @ Q) ** 2, axis=1)  # of what of each the parameters do not explain
        one = float(np.max((rows @ left) ** 2 / np.where(size > _ALIKE**2, size, np.inf)))
        rest, squares = int(self._used.sum()) - Q.shape[1], float(left @ left)
        away = np.hypot(*(self.skin.grid - optimum.parameters[:2]).T)
        near = rows[np.argsort(away)[: min(_NEAR, rest // 2)]]
        near -= near @ Q @ Q.T
        s2, V = np.linalg.eigh(near @ near.T)
        kept = s2 > _ALIKE**2
        explained, k = float(np.sum((V.T @ (near @ left))[kept] ** 2 / s2[kept])), int(kept.sum())
        remains = max(squares - explained, _EXACT) / (rest - k)
        many = cast(
            "float", scipy.special.fdtrc(float(k), float(rest - k), explained / k / remains)
        )
        t = math.sqrt(one / max(squares - one, _EXACT) * (rest - 1))
        single = 2 * len(size) * float(scipy.special.stdtr(float(rest - 1), -t))
        return min(2 * min(many, single), 1.0)

    def rounded(self, cylinder: Optimum, share: float) -> Optimum:
        """The cylinder with one curvature at both ends and that `share` of the force between."""
        return self.again(cylinder, arcs(arc_widths(self.skin, cylinder, share), share), 7)


# Priors, in sides of the skin: a radius between these two, uniform in its logarithm; a uniform
# length of up to one side; any angle; and `SHARE`.
_RADII = (0.02, 5.0)

_ALIGNED = 0.1  # rad between a plane's contact and the axis of a bent skin


def log_likelihoods(skin: ElasticSkin, all_of: Hypotheses) -> dict[str, float]:
    """Logarithms of the marginal likelihoods of all kinds, up to a common constant."""
    sphere, cylinder = cast("Width", all_of.sphere.width), cast("Width", all_of.cylinder.width)
    of_sphere = laplace_integral(all_of.sphere.best, all_of)
    of_sphere += _beyond_bound(all_of.sphere.best, sphere)
    of_cylinder = laplace_integral(all_of.cylinder.best, all_of) + length_prior(
        skin, all_of.cylinder
    )
    of_cylinder += _beyond_bound(all_of.cylinder.best, cylinder) - _unexplained(all_of, cylinder)
    return {
        "sphere": of_sphere + radius_prior(skin, sphere),
        "edge": laplace_integral(all_of.edge.best, all_of) + length_prior(skin, all_of.edge),
        "cylinder": of_cylinder + radius_prior(skin, cylinder),
        "plane": of_sphere + _flat_share(sphere)
        if all_of.plane is all_of.sphere
        else of_cylinder + plane_prior(skin, all_of.cylinder.best, cylinder),
    }


def laplace_integral(best: Optimum, all_of: Hypotheses) -> float:
    """Log of Laplace's integral over all parameters: flat priors, unknown noise."""
    scale = np.sqrt(np.diag(best.covariance))
    correlation = best.covariance / np.multiply.outer(scale, scale)
    volume = np.linalg.slogdet(2 * np.pi * correlation)[1] / 2 + np.log(scale).sum()
    return float(volume) - (all_of.readings - 3) / 2 * math.log(best.squares)


def oval_likelihood(skin: ElasticSkin, all_of: Hypotheses, best: Optimum) -> float:
    """Log of the marginal likelihood of an oval, up to the constant of `log_likelihoods`."""
    q, sd = best.parameters[-1], math.sqrt(best.covariance[-1, -1])
    widths = np.linspace(0, skin.side / 4, 400)
    likely = np.exp(-0.5 * ((widths**2 - q) / sd) ** 2)
    return laplace_integral(best, all_of) + length_prior(skin, Hypothesis(best)) + _line(sd, likely)


def _line(sd: float, likely: Array) -> float:
    """Log of the mean of the likelihood `likely` over a prior, less that of its integral."""
    return math.log(max(float(np.mean(likely)), 1e-300)) - math.log(sd * math.sqrt(2 * math.pi))


def length_prior(skin: ElasticSkin, found: Hypothesis) -> float:
    """Log correction for the priors of angle, length and share."""
    best = found.best
    square, sd = best.parameters[4], math.sqrt(best.covariance[4, 4])
    lengths = np.linspace(0, skin.side, 400)
    likely = np.exp(-0.5 * ((lengths**2 - square) / sd) ** 2)
    if skin.is_dome and math.isfinite(found.length2):
        wide = math.hypot(sd, found.length2_sd)
        likely = sd / wide * np.exp(-0.5 * ((found.length2 - square) / np.array([wide])) ** 2)
    share = -0.5 * (best.parameters[5] / SHARE) ** 2 - math.log(SHARE * math.sqrt(2 * math.pi))
    return share - math.log(math.pi) + _line(sd, likely)


def _beyond_bound(best: Optimum, width: Width) -> float:
    """Rise of the log likelihood from a width on its bound to the unconstrained one."""
    return 0.5 * ((float(best.parameters[-1]) - width.q) / width.sd) ** 2


def _unexplained(all_of: Hypotheses, width: Width) -> float:
    """Gain of a cylinder over an edge in log likelihood that its width does not explain."""
    gain = all_of.edge.best.cost - all_of.cylinder.best.cost
    sd = math.sqrt(all_of.cylinder.best.covariance[-1, -1])  # of the readings alone
    return max(gain - max(width.q / sd, 0.0) ** 2, 0.0) / 2


def radius_prior(skin: ElasticSkin, width: Width) -> float:
    """Log correction for the prior of the radius."""
    low, high = (math.log(share * skin.side) for share in _RADII)
    curvatures = np.exp(-np.linspace(low, high, 400))
    return _line(width.sd, width.likelihood(width.of_curvature(curvatures)))


def plane_prior(skin: ElasticSkin, best: Optimum, width: Width) -> float:
    """Log correction for a plane: a cylinder without curvature along the axis of a bent skin.

    Minus infinity on a flat or hollow skin, where a large plane touches only the edges.
    """
    Hx, Hy = skin.patch.curvatures
    if not max(Hx, Hy) > 0 or min(Hx, Hy) < 0:
        return -math.inf
    turn = math.remainder(best.parameters[3] - (math.pi / 2 if Hx > Hy else 0.0), math.pi)
    aligned = -0.5 * turn**2 / (best.covariance[3, 3] + _ALIGNED**2)
    return aligned + _flat_share(width)


def _flat_share(width: Width) -> float:
    """Log correction for an object without curvature, of that `width`."""
    return _line(width.sd, width.likelihood(width.of_curvature(np.zeros(1))))
