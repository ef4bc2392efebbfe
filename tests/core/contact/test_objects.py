"""What the object is, against rigid objects pressed into a plate by a contact solver of its own."""

import math
import re
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from scipy import linalg, optimize

from kappaskin import (
    Disk,
    LeastSquares,
    ObjectFinder,
    Patch,
    Pipeline,
    Plate,
    PointContact,
    PointLoad,
    Polygon,
    Refusal,
    SensorLayout,
    Setup,
    Simulator,
    SineBasis,
    basis_for,
    load_scene,
    local_geometry,
)
from kappaskin.mechanics import Block, Cylinder, IndentationSolver, Sphere, Wedge

pytestmark = pytest.mark.slow

NOISE = 0.231
SIDE = 0.1
D = 3.7e-3


@dataclass(frozen=True)
class Rigid:
    """A rigid ball, rod or blade that presses with `force` on a hinged plate, SIDE square."""

    kind: str
    force: float
    x: float
    y: float
    radius: float = 0.0
    angle: float = 0.0
    length: float = 0.0
    tilt: float = 0.0
    foundation: float = 0.0

    def grid(self, reach, step):
        """Places it may touch, along and across its axis."""
        if self.kind == "sphere":
            q = np.arange(-reach, reach + 1e-9, step)
            u, v = (grid.ravel() for grid in np.meshgrid(q, q))
            inside = u**2 + v**2 <= 1.001 * reach**2
            return u[inside], v[inside]
        along = np.linspace(-self.length / 2, self.length / 2, round(self.length / 2e-3) + 1)
        across = np.zeros(1) if self.kind == "edge" else np.arange(-reach, reach + 1e-9, step)
        u, v = np.meshgrid(along, across)
        return u.ravel(), v.ravel()

    def gap(self, u, v):
        """How far its surface lies behind its tip."""
        curved = u**2 + v**2 if self.kind == "sphere" else v**2
        return (curved / (2 * self.radius) if self.radius else 0 * v) + self.tilt * u

    def at(self, u, v):
        axis = np.array([math.cos(self.angle), math.sin(self.angle)])
        return np.array([self.x, self.y]) + np.outer(u, axis) + np.outer(v, [-axis[1], axis[0]])


def sines(points, modes):
    k = np.arange(1, modes + 1) * np.pi / SIDE
    return np.sin(np.outer(points[:, 0], k)), np.sin(np.outer(points[:, 1], k)), k


def compliance(k, foundation):
    return 4 / SIDE**2 / (D * np.add.outer(k**2, k**2) ** 2 + foundation)


def pressed(green, gap, force):
    """Forces >= 0 that push the skin as deep as the object is, wherever it is deeper."""
    n = len(gap)
    L = linalg.cholesky(green + 1e-9 * np.trace(green) / n * np.eye(n), lower=True)

    def at(depth):
        behind = linalg.solve_triangular(L, depth - gap, lower=True)
        return optimize.nnls(L.T, behind, maxiter=100 * n)[0]

    low, high = min(gap.min(), 0.0) - 1e-6, 2e-3
    while at(high).sum() < force:
        high *= 2
    p = at(optimize.brentq(lambda depth: at(depth).sum() - force, low, high, rtol=1e-3))
    return p * force / p.sum()


def contact(rigid, u, v):
    points = rigid.at(u, v)
    X, Y, k = sines(points, 71)
    functions = (X[:, :, None] * Y[:, None, :]).reshape(len(points), -1)
    functions *= np.sqrt(compliance(k, rigid.foundation).ravel())
    green = functions @ functions.T  # of one matrix with itself: BLAS computes half of it
    return points, pressed(green, rigid.gap(u, v), rigid.force)


@cache
def curvature(rigid):
    """Curvature (3, 100) of 201 x 201 modes at the elements, under the object."""
    u, v = rigid.grid(0.03, 2e-3) if rigid.kind == "sphere" else rigid.grid(0.013, 8e-4)
    points, p = contact(rigid, u, v)
    if rigid.kind == "sphere":  # it touches where the skin slopes as it does: look closer there
        u0, v0 = p @ u / p.sum(), p @ v / p.sum()
        size = max(2.2 * math.sqrt(p @ ((u - u0) ** 2 + (v - v0) ** 2) / p.sum()), 4e-3)
        u, v = rigid.grid(size, max(size / 12, 4e-4))
        points, p = contact(rigid, u + u0, v + v0)
    X, Y, k = sines(points, 201)
    c = compliance(k, rigid.foundation) * ((X * p[:, None]).T @ Y)
    x = (np.arange(10) + 0.5) * SIDE / 10
    S, C = np.sin(np.outer(x, k)), np.cos(np.outer(x, k)) * k
    return np.array([(X @ c @ Y.T).T.ravel() for X, Y in ((-S * k**2, S), (S, -S * k**2), (C, C))])


class Skin:
    def __init__(self, patch=Patch(SIDE, SIDE), plate=None, elements=10):  # noqa: B008
        plate = plate or Plate(patch)
        self.layout = SensorLayout.regular(patch, elements, elements)
        self.fit = LeastSquares(basis_for(patch, "hinged", 8, 8), self.layout)
        self.contact = PointContact(plate, self.layout)
        self.finder = ObjectFinder(plate, self.layout)

    def find(self, readings):
        fit = self.fit(readings)
        return self.finder(readings, float(fit.noise), self.contact(readings, fit))

    def finds(self, readings, draws, seed=0, noise=NOISE):
        rng = np.random.default_rng(seed)
        return [self.find(readings + rng.normal(0, noise, readings.shape)) for _ in range(draws)]


PAPER = Skin()
FOAM = 1e5

BALLS = [
    Rigid("sphere", 0.22, 0.043, 0.052, 0.11),
    Rigid("sphere", 0.24, 0.057, 0.046, 0.13),
    Rigid("sphere", 0.18, 0.060, 0.040, 0.17),  # on an oval, longest towards the corners
]
RODS = [
    Rigid("cylinder", 0.30, 0.052, 0.047, 0.10, 0.4, 0.03),
    Rigid("cylinder", 0.28, 0.046, 0.051, 0.12, 1.9, 0.04, 0.02),
    Rigid("cylinder", 0.30, 0.055, 0.055, 0.11, 2.7, 0.035),
]
BLADES = [
    Rigid("edge", 0.30, 0.052, 0.047, 0.0, 0.4, 0.03),
    Rigid("edge", 0.28, 0.046, 0.051, 0.0, 1.9, 0.04, 0.02),
    Rigid("edge", 0.30, 0.053, 0.055, 0.0, 2.7, 0.024),
]


@pytest.mark.cases("rigid1", "rigid4")
@pytest.mark.parametrize("rigid", BALLS + RODS)
def test_pressed_hard_enough_the_right_kind_wins(rigid):
    found = PAPER.finds(curvature(rigid), 10)

    assert sum(one.kind == rigid.kind for one in found) >= 9
    assert np.mean([one.probability[rigid.kind] for one in found]) > 0.85


@pytest.mark.parametrize("rigid", BLADES)
def test_a_blade_is_an_edge_or_a_rod_too_thin_to_tell(rigid):
    found = PAPER.finds(curvature(rigid), 10)

    assert all(one.probability["edge"] + one.probability["cylinder"] > 0.98 for one in found)
    assert sum(one.kind == "cylinder" and not math.isnan(one.radius) for one in found) <= 1
    assert sum(one.kind == "edge" for one in found) >= 7


@pytest.mark.full
def test_the_intervals_of_the_radius_cover_it():
    covered = [
        one.radius_95[0] <= rigid.radius <= one.radius_95[1]
        for rigid in BALLS + RODS
        for one in PAPER.finds(curvature(rigid), 14, seed=1)
        if one.kind == rigid.kind
    ]

    assert len(covered) > 75
    assert np.mean(covered) > 0.9


def test_the_radius_itself_is_close():
    rigid = BALLS[0]

    found = PAPER.find(curvature(rigid))

    assert found.radius == pytest.approx(rigid.radius, rel=0.02)


@pytest.mark.parametrize("rigid", [*RODS, *BLADES])
def test_axis_and_length_are_those_of_the_object(rigid):
    found = PAPER.find(curvature(rigid))

    assert math.remainder(found.axis - rigid.angle, math.pi) == pytest.approx(0, abs=0.05)
    assert found.length == pytest.approx(rigid.length, abs=0.5e-3)


def test_the_intervals_of_axis_and_length_cover_them():
    pairs = [(r, one) for r in BLADES for one in PAPER.finds(curvature(r), 14, seed=1)]

    turned = [abs(math.remainder(o.axis - r.angle, math.pi)) < o.axis_95 for r, o in pairs]
    longer = [abs(o.length - r.length) < o.length_95 for r, o in pairs]
    assert np.mean(turned) > 0.87
    assert np.mean(longer) > 0.87


@pytest.mark.full
def test_the_intervals_of_the_force_cover_it():
    pairs = [(r, one) for r in BALLS + RODS + BLADES for one in PAPER.finds(curvature(r), 10)]

    covered = [abs(one.force - rigid.force) < one.force_95 for rigid, one in pairs]
    assert 0.9 < np.mean(covered) <= 1.0
    assert max(one.force_95 / rigid.force for rigid, one in pairs) < 0.03


def random_object(rng):
    kind = ("sphere", "cylinder", "edge")[rng.integers(3)]
    return Rigid(
        kind,
        float(np.exp(rng.uniform(np.log(0.04), np.log(0.3)))),
        *rng.uniform(0.035, 0.065, 2),
        0.0 if kind == "edge" else float(np.exp(rng.uniform(np.log(0.03), np.log(0.15)))),
        rng.uniform(0, math.pi),
        0.0 if kind == "sphere" else rng.uniform(0.015, 0.045),
    )


@pytest.mark.full
def test_the_probabilities_are_how_often_they_are_right():
    rng = np.random.default_rng(3)
    objects = [random_object(rng) for _ in range(21)]
    pairs = [(o, f) for o in objects for f in PAPER.finds(curvature(o), 4, seed=2)]

    told = np.array([f.probability[kind] for _, f in pairs for kind in f.probability])
    right = np.array([kind == o.kind for o, f in pairs for kind in f.probability])

    for low, high in ((0.0, 0.05), (0.05, 0.35), (0.35, 0.7), (0.7, 0.95), (0.95, 1.01)):
        these = (told >= low) & (told < high)
        # Four draws of one object err together.
        spread = 2 * math.sqrt(max(these.sum(), 1) * 0.25 / max(these.sum() ** 2 / 4, 1))
        if these.sum() > 8:
            assert abs(told[these].mean() - right[these].mean()) < min(spread, 0.2), (low, high)


def test_a_ball_too_small_to_tell_has_an_upper_bound_only():
    found = PAPER.finds(curvature(Rigid("sphere", 0.15, 0.043, 0.052, 0.02)), 20)

    told = [one for one in found if one.kind == "sphere"]
    assert len(told) >= 18
    bounds = [one for one in told if one.radius_95[0] == 0]
    assert len(bounds) >= 18
    for one in bounds:
        assert math.isnan(one.radius)
        assert 0.02 < one.radius_95[1] < 0.2
        assert re.fullmatch(
            r"shape unknown \(a ball would be under \d+(\.\d+)? mm in radius\)", one.describe()
        )


def test_noise_alone_is_no_object_in_2000_frames():
    draws = np.random.default_rng(0).normal(0, NOISE, (2000, 3, 100))

    assert not any(PAPER.find(frame).probability for frame in draws)


def test_nothing_touches_without_a_contact():
    found = PAPER.find(np.zeros((3, 100)))

    assert found.describe() == "no contact"
    assert found.kind == ""
    assert np.isnan([*found.position, found.force, found.radius, found.axis]).all()


def test_what_fits_no_single_object_is_not_named():
    basis, plate = SineBasis(Patch(SIDE, SIDE), 40, 40), Plate(Patch(SIDE, SIDE))
    corners = [PointLoad(x, y, 0.15) for x, y in ((0.03, 0.03), (0.07, 0.04), (0.04, 0.075))]
    K = PAPER.layout.operator(basis) @ plate.deflection(corners, basis).ravel()

    for one in PAPER.finds(K.reshape(3, -1), 5):
        assert one.kind == ""
        assert one.describe() == "shape unknown: no object fits"


def same(ours, theirs):
    assert ours.kind == theirs.kind
    for kind, chance in ours.probability.items():
        assert theirs.probability[kind] == pytest.approx(chance, abs=0.02)


def noisy(rigid, seed=5):
    return curvature(rigid) + np.random.default_rng(seed).normal(0, NOISE, (3, 100))


def test_a_mirrored_object_is_found_mirrored():
    K = noisy(RODS[1])
    mirrored = K.reshape(3, 10, 10)[:, :, ::-1].reshape(3, 100) * np.array([[1], [1], [-1]])

    here, there = PAPER.find(K), PAPER.find(mirrored)

    same(here, there)
    assert there.axis == pytest.approx(math.pi - here.axis, abs=2e-3)
    assert there.radius_95 == pytest.approx(here.radius_95, rel=5e-3)
    np.testing.assert_allclose(there.position, [0.1, 0] + here.position * [-1, 1], atol=2e-5)


def test_a_pull_shows_the_object_behind_the_skin():
    K = noisy(BALLS[0])

    push, pull = PAPER.find(K), PAPER.find(-K)

    same(push, pull)
    assert pull.force == pytest.approx(-push.force, rel=1e-3)
    assert pull.radius == pytest.approx(push.radius, rel=1e-3)


def test_on_a_skin_of_a_fifth_of_the_size_the_object_is_a_fifth_of_the_size():
    K, small = noisy(RODS[0]), Skin(Patch(SIDE / 5, SIDE / 5))

    large, found = PAPER.find(K), small.find(5 * K)

    same(large, found)
    assert found.radius == pytest.approx(large.radius / 5, rel=2e-3)
    assert found.length == pytest.approx(large.length / 5, rel=2e-3)


def test_readings_that_are_missing_make_the_interval_wider():
    K = noisy(BALLS[1])
    gone = K.copy()
    gone[:, [34, 45, 56]] = np.nan

    whole, part = PAPER.find(K), PAPER.find(gone)

    assert part.kind == "sphere"
    assert np.ptp(part.radius_95) > 1.02 * np.ptp(whole.radius_95)
    assert part.radius_95[0] <= BALLS[1].radius <= part.radius_95[1]


def test_a_few_readings_tell_nothing():
    K = np.full((3, 100), np.nan)
    K[:, 44:50] = noisy(BALLS[0])[:, 44:50]
    fit = LeastSquares(SineBasis(Patch(SIDE, SIDE), 2, 2), PAPER.layout)(K)

    found = PAPER.finder(K, float(fit.noise), PAPER.contact(K, fit))

    assert not found.probability


def test_where_the_skin_follows_the_object_its_own_curvature_says_the_same():
    ball = Rigid("sphere", 0.30, 0.05, 0.05, 0.125)  # touches on a ring 20 mm across
    K = curvature(ball)

    found, skin = PAPER.find(K), local_geometry(PAPER.fit(K), np.array([0.05, 0.05]))

    np.testing.assert_allclose(-skin.principal, 1 / ball.radius, rtol=0.06)
    assert 1 / found.radius == pytest.approx(-skin.mean, rel=0.06)


@pytest.mark.parametrize(
    "rigid",
    [
        Rigid("sphere", 0.8, 0.043, 0.052, 0.05, foundation=FOAM),
        Rigid("cylinder", 0.9, 0.052, 0.047, 0.05, 0.4, 0.02, foundation=FOAM),
    ],
)
def test_over_foam_too_the_radius_is_found(rigid):
    foam = Skin(plate=Plate(Patch(SIDE, SIDE), foundation=FOAM))

    found = foam.finds(curvature(rigid), 5)

    for one in found:
        assert one.kind == rigid.kind
        assert one.radius == pytest.approx(rigid.radius, rel=0.15)


class Finger:
    """A bent skin, pressed through its own compliance: the contact alone is independent.

    Of more functions than any that recognises the object.
    """

    def __init__(self, thickness=None):
        self.R, self.patch = 0.03, Patch(0.04, 0.04, 0.03)
        plate = Plate(self.patch, thickness=thickness)
        self.skin = Skin(self.patch, plate)
        self.basis = basis_for(self.patch, "hinged", 40, 40)
        self.compliance = plate.compliance(self.basis)
        self.M = self.skin.layout.operator(self.basis, plate)

        self.curvature = cache(self._curvature)  # several tests press alike
        self._reached = cache(self._response)

    def _curvature(self, rigid):
        u, v = rigid.grid(8e-3, 6e-4)
        on, away, functions, green = self._reached(replace(rigid, force=0.0, radius=0.0))
        p = pressed(green, rigid.gap(u, v)[on] + away**2 / (2 * self.R), rigid.force)
        return (self.M @ self.compliance.after(p[None] @ functions)[0]).reshape(3, -1)

    def _response(self, rigid):
        """Where it may touch, how far from its middle, the functions there, and the give."""
        points = rigid.at(*rigid.grid(8e-3, 6e-4))
        on = (points.min(axis=1) > 1e-3) & (points.max(axis=1) < 0.039)
        functions = self.basis.at(points[on])
        green = self.compliance.after(functions) @ functions.T
        return on, points[on, 0] - rigid.x, functions, green


@pytest.fixture(scope="module")
def finger():
    return Finger(thickness=2e-3)


@pytest.fixture(scope="module")
def sheet():
    """The same rigidity, but thinner, so that it hardly stretches: a dent is narrower."""
    return Finger()


ALONG = {"angle": math.pi / 2, "length": 0.016}


@pytest.mark.full
def test_a_plane_flattens_a_fingertip(finger):
    plane = Rigid("cylinder", 4.0, 0.021, 0.019, **ALONG)

    found = finger.skin.finds(finger.curvature(plane), 5)

    assert all(one.kind == "plane" for one in found)
    assert all(one.describe().startswith("plane; second guess") for one in found)


@pytest.mark.parametrize("kind", ["cylinder", "sphere"])
def test_a_rod_and_a_ball_dent_a_fingertip_further(finger, kind):
    shape = ALONG if kind == "cylinder" else {}
    rigid = Rigid(kind, 4.0, 0.021, 0.019, 0.06, **shape)

    found = finger.skin.finds(finger.curvature(rigid), 5)

    for one in found:
        assert one.kind == kind
        assert one.radius == pytest.approx(0.06, rel=0.15)
        assert one.radius_95[0] < 0.06 < one.radius_95[1]


@pytest.mark.cases("cylinder-8.0", "sphere-3.0")
@pytest.mark.parametrize(
    ("kind", "force"), [("plane", 4.0), *product(("cylinder", "sphere"), (3.0, 4.0, 6.0, 8.0))]
)
def test_on_a_bent_sheet_too_objects_are_told_apart(sheet, kind, force):
    shape = {} if kind == "sphere" else ALONG
    radius = 0.0 if kind == "plane" else 0.06
    shape_of = "cylinder" if kind == "plane" else kind
    rigid = Rigid(shape_of, force, 0.021, 0.019, radius, **shape)

    for one in sheet.skin.finds(sheet.curvature(rigid), 5):
        assert one.kind == kind
        if radius:
            assert math.isnan(one.radius) or one.radius == pytest.approx(radius, rel=0.3)
            assert one.radius_95[0] < radius < one.radius_95[1]


def test_a_shape_that_no_object_explains_is_not_named(sheet):
    plane = Rigid("cylinder", 8.0, 0.021, 0.019, **ALONG)

    for one in sheet.skin.finds(sheet.curvature(plane), 5):
        assert not one.sure
        assert one.describe().startswith("shape unknown")
        assert not one.fits or one.radius_95[1] == math.inf  # as large a ball as a plane


@pytest.mark.full
@pytest.mark.parametrize("radius", [0.03, 0.06, 0.12])
def test_the_intervals_of_a_radius_on_a_bent_skin_cover_it(finger, sheet, radius):
    kinds = ("cylinder", ALONG), ("sphere", {})
    covered = [
        one.radius_95[0] < radius < one.radius_95[1]
        for skin, (kind, shape), force in product((finger, sheet), kinds, (2.0, 4.0, 8.0))
        for one in skin.skin.finds(
            skin.curvature(Rigid(kind, force, 0.021, 0.019, radius, **shape)), 5
        )
        if one.kind == kind
    ]

    assert len(covered) > 40
    assert np.mean(covered) > 0.9


def test_a_touch_that_flattens_nothing_is_not_called_a_plane(finger):
    light = Rigid("cylinder", 0.5, 0.021, 0.019, **ALONG)

    assert not any(o.kind == "plane" for o in finger.skin.finds(finger.curvature(light), 5))


class Dome:
    """A dome, pressed by rigid objects through the contact solver."""

    def __init__(self):
        patch = Patch(0.04, 0.03, (0.1, 0.08))
        self.skin, basis = Skin(patch, Plate(patch)), basis_for(patch, "hinged", 48, 48)
        self._press = IndentationSolver(Plate(patch), basis)
        self._M = self.skin.layout.operator(basis)

    def finds(self, rigid, force):
        K = self._M @ self._press(rigid, 0.018, 0.016, 0.3, force=force).coefficients.ravel()
        return self.skin.finds(K.reshape(3, -1), 5)


@pytest.fixture(scope="module")
def dome():
    return Dome()


def test_a_plate_on_a_dome_is_a_plane_and_a_ball_has_its_own_radius(dome):
    for one in dome.finds(Block(0.1, 0.1), 3.0):
        assert one.describe().startswith("plane; second guess")
        assert one.radius_95 == (one.radius_95[0], math.inf)
    for one in dome.finds(Sphere(0.04), 2.0):
        assert one.describe().startswith("sphere, radius")
        assert one.radius == pytest.approx(0.04, rel=0.1)
        assert one.radius_95[0] < 0.04 < one.radius_95[1]
        np.testing.assert_allclose(one.position, [0.018, 0.016], atol=1e-4)


def test_a_rod_and_a_wedge_on_a_dome_bear_in_their_middle(dome):
    for one in dome.finds(Cylinder(0.04, 0.04), 3.0):
        assert {"cylinder", "edge"} >= {one.kind}
        assert one.sure
        assert math.isnan(one.length)
        assert one.radius_95[0] < 0.04 < one.radius_95[1]
        assert one.axis == pytest.approx(0.3, abs=0.05)
    for rigid in (Cylinder(0.01, 0.04), Wedge(1.2, 0.04, 0.04)):
        for one in dome.finds(rigid, 3.0):
            assert one.describe().startswith("edge, axis 17 deg, or a cylinder of radius below ")
            assert one.radius_95[1] > 0.01


def test_a_large_ball_on_a_dome_is_no_sure_plane(dome):
    assert not any(one.sure and one.kind == "plane" for one in dome.finds(Sphere(0.5), 2.0))


@pytest.mark.parametrize("radius", [0.002, 0.01])
def test_a_ball_too_small_for_a_dome_to_show_has_an_upper_bound_and_no_other_name(dome, radius):
    for one in dome.finds(Sphere(radius), 1.5):
        assert not (one.sure and one.kind != "sphere")
        assert one.radius_95[0] == 0
        assert radius < one.radius_95[1]


def test_one_line_describes_it():
    rod, ball = PAPER.find(noisy(RODS[0])), PAPER.find(noisy(BALLS[0]))

    text = r"{}, radius [\d.]+ mm \(95 %: [\d.]+ to [\d.]+\){}, or a flat face [\d.]+ mm wide; .*"
    narrow = {"face": math.nan, "face_95": (0.0, 0.004), "radius_95": (0.0, 0.03)}
    ends = "or any two ends less than 4 mm wide; second guess"
    sharp = {"edge": 0.7, "cylinder": 0.25, "sphere": 0.05, "plane": 0.0}
    even = {"sphere": 0.8, "cylinder": 0.2}
    span = r"[\d.]+ to [\d.]+ mm in radius"
    edge = r"edge, \d+ mm long, axis \d+ deg, or a cylinder of radius below 30 mm, "
    for found, pattern in (
        (rod, text.format("cylinder", r", \d+ mm long, axis \d+ deg")),
        (ball, text.format("sphere", "")),
        (replace(ball, kind=""), rf"shape unknown \(a ball would be {span}\)"),
        (replace(ball, probability=even), rf"shape unknown \(a ball would be {span}\)"),
        (replace(ball, kind="", fits=False), "shape unknown: no object fits"),
        (replace(rod, kind="edge", probability=sharp, **narrow), edge + ends + r" \w+ \d+ %"),
        (replace(rod, **narrow), r"shape unknown \(a cylinder would be under 30 mm in radius\)"),
        (replace(ball, **narrow), r"shape unknown \(a ball would be under 30 mm in radius\)"),
        (
            replace(ball, radius_95=(0.05, math.inf)),
            r"shape unknown \(a ball would be over 50 mm in radius\)",
        ),
        (replace(ball, radius_95=(0.0, 2.756)), r"shape unknown \(press harder\)"),
        (replace(ball, radius_95=(0.0, math.inf)), r"shape unknown \(press harder\)"),
        (replace(rod, radius_95=(math.inf, math.inf)), r"shape unknown \(flat, or nearly so\)"),
        (
            replace(
                rod,
                kind="edge",
                probability=sharp,
                **{**narrow, "length": 0.001, "length_95": 0.002},
            ),
            r"shape unknown \(a cylinder would be under 30 mm in radius\)",
        ),
    ):
        assert re.fullmatch(pattern, found.describe())


HEXAGON = [(0.025, 0), (0.075, 0), (0.1, 0.0433), (0.075, 0.0866), (0.025, 0.0866), (0, 0.0433)]


@pytest.mark.cases("disk")
@pytest.mark.parametrize("patch", [Disk(0.05), Polygon(HEXAGON)], ids=["disk", "hexagon"])
def test_objects_on_other_outlines_are_told_apart(patch):
    skin, truth = Skin(patch), basis_for(patch, "hinged", 15, 15)
    bent, answer = skin.layout.operator(truth), Plate(patch).compliance(truth)

    def found(*loads):
        modal = answer(sum(load.modal(truth) for load in loads))
        return skin.finds((bent @ modal.ravel()).reshape(3, -1), 3)

    for tip in found(PointLoad(0.04, 0.045, 0.15)):
        assert tip.kind == "sphere"
        np.testing.assert_allclose(tip.position, [0.04, 0.045], atol=1e-3)
    ends = PointLoad(0.03, 0.03, 0.08), PointLoad(0.05, 0.045, 0.08)  # of a rigid blade
    for edge in found(*ends):
        assert edge.probability["edge"] + edge.probability["cylinder"] > 0.9
        assert abs(math.remainder(edge.axis - math.atan2(0.015, 0.02), math.pi)) < 0.1
        assert edge.length == pytest.approx(0.025, abs=2e-3)
    for rim in found(PointLoad(0.0485, 0.002, 0.3)):  # forces beside it would lie off the skin
        assert math.hypot(*(rim.position - [0.0485, 0.002])) < 3e-3


def test_a_weak_press_into_a_corner_is_answered():
    # Of some frames the best edge has its ends and its middle at one place, on the corner.
    scene = load_scene("centre").touched_by(PointLoad(0.095, 0.095, 0.05))
    sensor, simulator = scene.sensor(), Simulator(scene)
    find, pipeline = ObjectFinder(sensor.plate, sensor.layout), Pipeline(sensor, Setup())
    for number in range(3):
        estimate = pipeline(simulator.frame(number, lambda: 0.0))
        found = find(estimate.curvature, estimate.noise, estimate.contact)
        assert found.kind in ("", *found.probability)
        assert np.isfinite(found.position).all()
        assert not (found.kind and found.length < found.length_95)


def test_a_skin_that_cannot_tell_is_refused():
    strip, patch = Patch(0.1, 0.01, strip=True), Patch(SIDE, SIDE)
    drum = Plate(patch, rigidity=0.0, tension=1.0)
    for plate, elements, why in (
        (Plate(strip), (20, 1), "needs a 2-D skin; this one is a strip"),
        (drum, (10, 10), "needs a rigidity above zero; this skin has none"),
        (Plate(patch), (60, 40), "at most 2000 elements, got 2400"),
    ):
        with pytest.raises(Refusal, match=why):
            ObjectFinder(plate, SensorLayout.regular(plate.patch, *elements))
