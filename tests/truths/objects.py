"""Rigid objects of many kinds on a hinged plate, and how often they are named right.

The plate and the objects share no code with the library. An object bears on nodes of a grid of its
own, with some on its rim: coarse at first, then ever finer where it bears, down to 0.5 mm, by the
nonnegative least squares of `rigid.py`.
"""

from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cache
from math import inf, nan, pi

import numpy as np
from scipy.fft import dctn
from scipy.ndimage import map_coordinates, spline_filter
from scipy.optimize import nnls

from kappaskin import LeastSquares, ObjectFinder, Patch, Plate, SensorLayout, basis_for
from kappaskin.contact import Contacts, as_one
from navier import HingedPlate, Load

STEPS = (4e-3, 2e-3, 1e-3, 0.5e-3)  # m, between nodes: each where it bore on those before
_NEAR = 1.6  # of the step before
_MARGIN = 2e-3  # m, of the rim of the plate, where nothing presses
_APART = 1e-9  # of a compliance: keeps nodes apart that nearly coincide


@dataclass(frozen=True, eq=False)
class Shape:
    """An underside of `height` in m of u and v in m, over -`u`..`u` and -`v`..`v` in m.

    `rim` in m is
    the radius of a circle of nodes, outside which a `disc` has none. `kind` is what it is; `radius`
    and `length` in m are its own, where it has them.
    """

    kind: str
    height: Callable
    u: float
    v: float
    rim: float = 0.0
    disc: bool = False
    radius: float = nan
    length: float = nan

    def nodes(self, step):
        """Nodes (n, 2) in m, `step` in m apart, with the rim among them."""
        lines = (np.linspace(-w, w, 2 * max(round(w / step), 1) + 1) for w in (self.u, self.v))
        grid = np.stack(np.meshgrid(*map(np.unique, lines)), -1).reshape(-1, 2)
        if not self.rim:
            return grid
        turn = 2 * pi * np.arange(n := max(round(2 * pi * self.rim / step), 12)) / n
        away = np.hypot(*grid.T)
        off = self.rim - away if self.disc else np.abs(self.rim - away)
        circle = self.rim * np.stack([np.cos(turn), np.sin(turn)], -1)
        return np.vstack([grid[off > 0.6 * step], circle])


class Pressing:
    """A hinged plate that objects press on.

    Its displacement per N under discs at two places is a sum of products of sines, which is that of
    four cosines of what the places differ by, and add to: one table that FFT makes for each radius.
    """

    def __init__(self, plate=None, count=800):
        self.plate, self.count = plate or HingedPlate(), count

    @cache  # noqa: B019
    def _table(self, radius):
        plate, n = self.plate, self.count
        c = np.zeros((n + 1, n + 1))
        modes = plate.mean(Load(0.0, 0.0, radius=radius)) ** 2 / plate.stiffness
        c[1 : plate.modes + 1, 1 : plate.modes + 1] = modes / 16  # DCT-I doubles what is inside
        return spline_filter(dctn(c, type=1), order=3, mode="mirror")

    def compliance(self, places, radius):
        """Displacement (n, n) in m/N at discs of `radius` around `places` (n, 2), all in m."""
        table, (x, y) = self._table(radius), places.T * self.count / self.plate.a
        i, j = np.tril_indices(len(x))
        less, more = (x[i] - x[j], y[i] - y[j]), (x[i] + x[j], y[i] + y[j])

        def at(dx, dy):
            return map_coordinates(table, (dx, dy), order=3, mode="mirror", prefilter=False)

        G = np.empty((len(x), len(x)))
        G[i, j] = at(*less) - at(more[0], less[1]) - at(less[0], more[1]) + at(*more)
        G[j, i] = G[i, j]
        return G

    def forces(self, press):
        """Places (n, 2) in m, forces (n,) in N and radius in m of the discs under a `Press`."""
        bearing, step = np.zeros((1, 2)), inf
        for finer in STEPS:
            nodes = press.shape.nodes(finer)
            away = np.min([np.hypot(*(nodes - b).T) for b in bearing], axis=0)
            nodes = nodes[away < _NEAR * step]
            places = press.places(nodes)
            far = self.plate.a - _MARGIN, self.plate.b - _MARGIN
            within = (places > _MARGIN) & (places < far)
            nodes, places = nodes[within.all(1)], places[within.all(1)]
            step, radius = finer, finer / np.sqrt(pi)
            G = self.compliance(places, radius)
            G[np.diag_indices_from(G)] *= 1 + _APART
            L = np.linalg.cholesky(G)
            bare = press.depth - press.shape.height(*nodes.T) - press.tilt * nodes[:, 0]
            F, _ = nnls(L.T, np.linalg.solve(L, bare), maxiter=100 * len(L))
            bearing = nodes[F > 0]
        return places[F > 0], F[F > 0], radius

    def readings(self, bearing, elements):
        """Curvature (3, P) in 1/m at `elements` (P, 2) in m under what `forces` returns."""
        places, F, radius = bearing
        k, l = self.plate.waves()
        mean = self.plate.mean(Load(0.0, 0.0, radius=radius))
        X, Y = np.sin(np.outer(places[:, 0], k)), np.sin(np.outer(places[:, 1], l))
        return self.plate.curvature(mean * ((X.T * F) @ Y) / self.plate.stiffness, elements)


@dataclass(frozen=True, eq=False)
class Press:
    """A shape that is pressed `depth` in m into the skin, lowest at (x, y) in m.

    Its axis u is turned by `angle` in rad from x, along which it rises by `tilt`.
    """

    shape: Shape
    x: float
    y: float
    depth: float
    angle: float = 0.0
    tilt: float = 0.0

    def places(self, nodes):
        """Places (n, 2) on the skin of `nodes` (n, 2) of the shape, in m."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return (self.x, self.y) + nodes @ np.array([[c, s], [-s, c]])


def _circle(r, t):
    """Rise in m of a circle of radius `r` at `t` beside its lowest point, both in m."""
    return r - np.sqrt(np.maximum(r**2 - t**2, 0))


def _flat(u, v):
    return 0 * u


def sphere(r):
    w = min(0.9 * r, 0.04)
    return Shape("sphere", lambda u, v: _circle(r, np.hypot(u, v)), w, w, w, True, radius=r)


def cylinder(r, length):
    w = min(0.9 * r, 0.02)
    return Shape("cylinder", lambda u, v: _circle(r, v), length / 2, w, radius=r, length=length)


def edge(length):
    return Shape("edge", _flat, length / 2, 0.0, radius=0.0, length=length)


def rounded_edge(r, length):
    return replace(cylinder(r, length), kind="rounded edge")


def punch(r):
    return Shape("flat round face", _flat, r, r, r, True)


def block(length, width, kind="flat bar"):
    return Shape(kind, _flat, length / 2, width / 2, length=length)


def cone(slope):
    return Shape("cone", lambda u, v: slope * np.hypot(u, v), 0.01, 0.01)


def ellipsoid(r, ratio):
    s = r * ratio
    u, v = min(0.9 * r, 0.03), min(0.9 * s, 0.04)
    return Shape("ellipsoid", lambda x, y: x**2 / (2 * r) + y**2 / (2 * s), u, v)


def torus(c, r):
    def height(u, v):
        return _circle(r, np.minimum(np.abs(np.hypot(u, v) - c), r))

    return Shape("ring", height, c + r / 2, c + r / 2, c)


def two_tips(apart):
    def height(u, v):
        return 1.0 * (np.abs(u) < 0.499 * apart)

    return Shape("two tips", height, apart / 2, 0.0, length=apart)


def _log(rng, low, high):
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


SHAPES = {
    "sphere": lambda rng: sphere(_log(rng, 5e-3, 0.15)),
    "long cylinder": lambda rng: cylinder(_log(rng, 3e-3, 0.06), rng.uniform(0.04, 0.07)),
    "cylinder": lambda rng: cylinder(_log(rng, 3e-3, 0.06), rng.uniform(0.01, 0.04)),
    "edge": lambda rng: edge(rng.uniform(0.01, 0.06)),
    "rounded edge": lambda rng: rounded_edge(_log(rng, 0.5e-3, 5e-3), rng.uniform(0.01, 0.06)),
    "flat round face": lambda rng: punch(rng.uniform(3e-3, 0.02)),
    "flat square face": lambda rng: block(*[rng.uniform(6e-3, 0.03)] * 2, "flat square face"),
    "flat bar": lambda rng: block(rng.uniform(0.02, 0.05), rng.uniform(3e-3, 0.015)),
    "cone": lambda rng: cone(rng.uniform(0.25, 1.0)),
    "ellipsoid": lambda rng: ellipsoid(_log(rng, 5e-3, 0.06), rng.uniform(2, 4)),
    "ring": lambda rng: torus(rng.uniform(5e-3, 0.02), rng.uniform(1e-3, 5e-3)),
    "two tips": lambda rng: two_tips(rng.uniform(0.012, 0.05)),
}


def drawn(name, rng, side=0.1) -> Press:
    """A press of a shape of that name, anywhere that its corners are inside the plate."""
    shape = SHAPES[name](rng)
    while True:
        x, y = rng.uniform(0.25, 0.75, 2) * side
        depth, angle, tilt = rng.uniform((1.5e-3, 0, -0.02), (6e-3, pi, 0.02))
        press = Press(shape, x, y, depth, angle, tilt)
        if not np.isfinite(shape.length):
            return press
        ends = press.places(np.array([[shape.u, 0], [-shape.u, 0]]))
        if ((ends > 0.06 * side) & (ends < 0.94 * side)).all():
            return press


# What is told of them: by a name, or by what the description says would read the same


@dataclass(frozen=True)
class Naming:
    """Counts of `frames`: `named`, and where `nothing` fits; right by the `kind` alone, and in all.

    `alike` counts names that are right, or where the description says that what is there would
    read the same. `covered` of `radii` intervals hold the radius.
    """

    frames: int = 0
    named: int = 0
    nothing: int = 0
    kind: int = 0
    alike: int = 0
    radii: int = 0
    covered: int = 0

    def __add__(self, other):
        return Naming(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))


_BEARS = 0.002  # of the force, at least, of a place that bears
_SLACK = 0.5e-3, 2e-3  # m, of width and length: the nodes of the truth, and where forces vary


def as_wide(found, bearing):
    """Whether the object bears as wide and as long as the description says."""
    places, F, _ = bearing
    off = places - F @ places / F.sum()
    if found.kind == "sphere":
        return _within(2 * np.sqrt(F @ np.sum(off**2, axis=1) / F.sum()), found.face_95, _SLACK[0])
    along = np.array([np.cos(found.axis), np.sin(found.axis)])
    u, v = off @ along, off @ (-along[1], along[0])
    length = np.ptp(u[F / F.sum() > _BEARS])
    longer = abs(length - found.length) <= max(found.length_95, _SLACK[1])
    return longer and _within(2 * np.sqrt(F @ v**2 / F.sum()), found.face_95, _SLACK[0])


def _within(value, interval, slack=0.0):
    return interval[0] - slack <= value <= interval[1] + slack


KINDS = {"sphere": "sphere", "edge": "edge", "rounded edge": "edge", "cylinder": "cylinder"}


def judged(press, bearing, found) -> Naming:
    """How one of them is told."""
    if not found.kind:
        return Naming(1, nothing=not found.fits)
    shape = press.shape
    same, covered = KINDS.get(shape.kind), _within(shape.radius, found.radius_95)
    # An edge is a thin cylinder, and a cylinder an edge as round as the description says.
    kind = found.kind == same or ({found.kind, same} == {"edge", "cylinder"} and covered)
    has_radius = found.kind == same and shape.radius > 0
    return Naming(
        *(1, 1, 0, kind, kind or as_wide(found, bearing)),
        *(has_radius, has_radius and covered),
    )


on_plate = cache(Pressing)


@cache
def _skin(elements):
    plate = Plate(Patch(0.1, 0.1))
    layout = SensorLayout.regular(plate.patch, elements, elements)
    fit = LeastSquares(basis_for(plate.patch, "hinged", 8, 8), layout)
    return layout.positions, fit, Contacts(plate, layout), ObjectFinder(plate, layout)


@cache
def naming(name, frames, noise=0.231, elements=10, seed=0) -> Naming:
    """How `frames` presses of shapes of that name are told, with `noise` in 1/m RMS."""
    rng = np.random.default_rng([seed, list(SHAPES).index(name)])
    pressing, (places, fit, contacts, find) = on_plate(), _skin(elements)
    told = Naming()
    for _ in range(frames):
        press = drawn(name, rng)
        bearing = pressing.forces(press)
        curvature = pressing.readings(bearing, places)
        curvature = curvature + rng.normal(0, noise, curvature.shape)
        shape = fit(curvature)
        found = find(curvature, float(shape.noise), as_one(*contacts(curvature, shape)))
        told += judged(press, bearing, found)
    return told


SKINS: Sequence[tuple[float, int]] = ((0.231, 10), (0.05, 10), (0.231, 16))  # noise, elements


def objects_table(frames=100):
    """How objects are told, as a table in Markdown."""
    yield "| object | frames | named | no object fits | kind | kind or alike | radius covered |"
    yield "|---|---|---|---|---|---|---|"
    for noise, elements in SKINS:
        total = Naming()
        for name in SHAPES:
            told = naming(name, frames, noise, elements)
            total += told
            if (noise, elements) == SKINS[0]:
                yield _row(name, told)
        yield _row(f"all, {elements} x {elements} elements, noise {noise} 1/m", total)


def _row(name, told):
    shares = (told.named, told.frames), (told.nothing, told.frames), (told.kind, told.named)
    shares = *shares, (told.alike, told.named), (told.covered, told.radii)
    words = (f"{100 * part / whole:.0f} %" if whole else "" for part, whole in shares)
    return f"| {name} | {told.frames} | " + " | ".join(words) + " |"
