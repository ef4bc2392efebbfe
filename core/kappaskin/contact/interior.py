"""Curvature of the object: that of the skin between the forces of its contact."""

import math
from dataclasses import dataclass, field
from typing import cast

import numpy as np

from kappaskin.contact.elastic_skin import (
    ARC,
    EVEN,
    ROUND,
    ElasticSkin,
    Optimum,
    PointForces,
    arcs,
    ends,
)
from kappaskin.frames import Array

_LEAST = 3e-3  # of a side: as narrow as a ring or an arc is made
_BLUNT = 0.4  # of a half wave: a narrower contact is a point to the functions
_WIDE = 2.0  # half waves: a smaller ring is taken for a circle
_MOST = 0.5  # of the force: between the ends, at most
_NOTHING = 0.01  # of the force: less is not worth the points it takes
_RADII = (0.25, 0.5, 0.7, 0.85, 1.0, 1.15, 1.3, 1.6, 2.0)  # of a ring: circles it may press on
_PLACES = np.vstack([np.zeros((1, 2)), *(r * ROUND[:, :2] for r in _RADII)])
_TRIAL = 0.2  # of the force: between the ends, to see what it does


@dataclass(frozen=True, slots=True)
class Width:
    """The relation of the object's curvature to q, the squared width of its contact.

    The skin inside a ring or an arc that is e times as wide is bent `bend` less:
    curvature(q) = k0 - bend / 2 ln(q / q0).
    """

    q: float
    sd: float
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


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """The best object of a kind, with its `width` if it has one.

    `between` (2,) in m is the vector from one end to the other, `slopes` (2,) the change of slope.
    """

    best: Optimum
    width: Width | None = None
    between: Array = field(default_factory=lambda: np.zeros(2))
    slopes: Array = field(default_factory=lambda: np.zeros(2))

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


def _rise(skin: ElasticSkin, forces: PointForces, centre: Array, points: Array) -> Array:
    """Displacement along the force in m at `centre` (2,), less that at `points` (k, 2)."""
    gives = skin.gives(forces, np.vstack([centre, points]))
    return math.copysign(1.0, forces.weights.sum()) * (gives[0] - gives[1:])


def _inside_ring(skin: ElasticSkin, forces: PointForces) -> tuple[float, Array]:
    """Curvature in 1/m of an object that presses on a ring, and its tilt (2,)."""
    centre = np.abs(forces.weights) @ forces.points / np.abs(forces.weights).sum()
    out = forces.points - centre
    rise = _rise(skin, forces, centre, forces.points)
    # A bent skin is bent back by its own curvature too.
    rise -= skin.patch.base_curvature / 2 * out[:, 0] ** 2
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
    if q < (_WIDE * skin.half_wave) ** 2 and not skin.patch.base_curvature:
        return ROUND
    p = _resolved(skin, sphere)
    curvature, tilt = _inside_ring(skin, sphere.contact(p))
    out = math.sqrt(p[-1]) * _PLACES
    gap = curvature / 2 * np.sum(out**2, axis=1) + skin.patch.base_curvature / 2 * out[:, 0] ** 2
    share = skin.pressed(p[:2] + out, gap - out @ tilt, abs(p[2])) / abs(p[2])
    on = share > _NOTHING / 10
    share, unit = share[on] / share[on].sum(), _PLACES[on]
    unit = unit - share @ unit
    size = math.sqrt(share @ np.sum(unit**2, axis=1))
    return np.column_stack([unit / size, share]) if size else ROUND


def _parts(forces: PointForces) -> list[Array]:
    """The points of each arc, that in the middle last if there is one."""
    return np.split(forces.points, len(forces.points) // ARC)


def _inside_arcs(skin: ElasticSkin, forces: PointForces) -> tuple[float, float]:
    """The skin's curvature in 1/m along each of the two arcs."""
    found: list[float] = []
    for points in _parts(forces)[:2]:
        middle = points.mean(axis=0)
        rise = _rise(skin, forces, middle, points)
        found.append(2 * float(rise.sum() / np.sum((points - middle) ** 2)))
    return found[0], found[1]


def middle(skin: ElasticSkin, edge: Optimum) -> float:
    """Share of the force between the ends that keeps the skin from rising into the edge."""
    gaps: list[float] = []
    for share in (0.0, _TRIAL):
        forces = ends(share)(edge.parameters[:6])
        first, second = forces.points[:2]
        rise = _rise(skin, forces, (first + second) / 2, np.stack([first, second]))
        gaps.append(float(rise.mean()))
    lifted, pressed = gaps
    gained = pressed - lifted  # none where both ends and the middle are one place
    share = min(-lifted / gained * _TRIAL, _MOST) if lifted < 0 < gained else 0.0
    return share if share > _NOTHING else 0.0


def _slope(skin: ElasticSkin, forces: PointForces, place: Array) -> Array:
    """Slope (2,) of the skin at `place` (2,) in m, downward along the force."""
    step = skin.half_wave / 4
    fall = _rise(skin, forces, place, place + step * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]]))
    return np.array([fall[1] - fall[0], fall[3] - fall[2]]) / (2 * step)


def arc_widths(skin: ElasticSkin, cylinder: Optimum, middle: float) -> tuple[float, float]:
    """Relative widths of the two arcs, one at the stronger end, for one curvature on both."""
    parameters = _resolved(skin, cylinder)
    curvatures = _inside_arcs(skin, arcs(EVEN, middle)(parameters))
    force, share = abs(parameters[2]), parameters[5]
    strong = 0 if share > 0 else 1
    weaker = force * (1 - middle) * (0.5 - abs(share))
    short = max(curvatures[strong] - curvatures[1 - strong], 0.0)
    width = max(math.exp(-short / (skin.bend * weaker)), 0.02)
    return (1.0, width) if strong == 0 else (width, 1.0)


def _width(skin: ElasticSkin, optimum: Optimum, curvature: float, force: float) -> Width:
    # On its bound, q is where the readings would have it.
    low = least_width(skin)
    q = float(optimum.parameters[-1])
    q += float(optimum.ahead[-1]) if q <= low * 1.001 else 0.0
    sd = math.hypot(math.sqrt(optimum.covariance[-1, -1]), (_BLUNT * skin.half_wave) ** 2)
    q0 = float(_resolved(skin, optimum)[-1])
    return Width(q, sd, curvature, q0, skin.bend * abs(force))


def fitted_sphere(skin: ElasticSkin, sphere: Optimum) -> Hypothesis:
    """The sphere, with the curvature of the skin inside its ring."""
    parameters = _resolved(skin, sphere)
    curvature, _ = _inside_ring(skin, sphere.contact(parameters))
    return Hypothesis(sphere, _width(skin, sphere, curvature, parameters[2]))


def fitted_cylinder(skin: ElasticSkin, cylinder: Optimum) -> Hypothesis:
    """The cylinder, with the curvature of the skin along the stronger of its two arcs."""
    parameters, contact = _resolved(skin, cylinder), cylinder.contact
    inside = _inside_arcs(skin, contact(parameters))
    base = skin.patch.base_curvature * math.sin(parameters[3]) ** 2
    forces = contact(cylinder.parameters)
    of_ends = [float(forces.weights[part].sum()) for part in (slice(ARC), slice(ARC, 2 * ARC))]
    strong = int(abs(of_ends[1]) > abs(of_ends[0]))
    width = _width(skin, cylinder, inside[strong] - base, of_ends[strong])
    first, second = (points.mean(axis=0) for points in _parts(forces)[:2])
    slopes = _slope(skin, forces, first) - _slope(skin, forces, second)
    return Hypothesis(cylinder, width, first - second, slopes)
