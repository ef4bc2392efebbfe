"""Contacts by the shape alone, against truths that owe the library nothing.

A sensor of others that a ball presses, closed forms of an elastic half-space, and a hinged plate
whose rigidity is withheld.
"""

from functools import cache
from itertools import product
from math import sqrt

import numpy as np
import pytest

import half_space
from kappaskin import Frame, ObjectFinder, Patch, Plate, SensorLayout, basis_for, estimator_for
from kappaskin.contact import Contacts, ImprintObjects, contacts_of
from kappaskin.health import HealthMonitor
from kappaskin.sensing import DigitalReadings, Sensor
from measured import measured
from navier import HingedPlate, Load
from rigid import Compliance, ball

pytestmark = pytest.mark.truth

REACH = 1.96
GEL, HEIGHT = measured("ball/ball")
CENTRE = 12.509e-3, 9.66e-3  # m, of what is deeper than half of the deepest in the image
RADIUS = 4e-3  # m, of the ball


def finders(method, layout, edge="hinged", functions=(8, 8)):
    plate = Plate(layout.patch, unknown_material=True)
    basis = basis_for(layout.patch, edge, *functions)
    fit = estimator_for(method, basis, layout)
    return fit, contacts_of(plate, layout, basis, edge), ImprintObjects(plate, fit, edge)


def heights(patch, m, n):
    layout = SensorLayout.regular(patch, m, n)
    return layout.reading(np.arange(len(layout)), "height")


# A ball in a gel, as a camera saw it

METHODS = [
    *(("fast", functions) for functions in ((40, 30), (30, 22), (24, 18), (20, 15), (14, 11))),
    ("bayes", (20, 15)),
]
PLAIN = "least-squares", (30, 22)
COARSE = [("fast", functions) for functions in ((11, 8), (9, 7), (8, 8))]


@cache
def ball_told(method, functions):
    fit, contacts, find = finders(method, GEL, functions=functions)
    shape = fit(HEIGHT)
    contact, second = contacts(HEIGHT, shape)
    assert not second.present
    there = contacts.geometry(shape, contact)
    return contact, there, find(HEIGHT, float(shape.noise), contact)


@pytest.mark.cases("fast-functions1")
@pytest.mark.parametrize("functions", [(40, 30), (30, 22)])
@pytest.mark.parametrize("method", ["fast", "least-squares"])
def test_a_ball_in_a_gel_has_its_shape(method, functions):
    fit, *_ = finders(method, GEL, functions=functions)
    shape = fit(HEIGHT)
    off = GEL.operator(fit.basis) @ shape.coefficients.ravel() - HEIGHT

    assert np.sqrt(np.mean(off**2)) < 0.01 * HEIGHT.max()
    assert abs(off[HEIGHT.argmax()]) < 0.01 * HEIGHT.max()


@pytest.mark.cases("functions0", "functions4", "functions5", "functions6")
@pytest.mark.parametrize(("method", "functions"), [*METHODS, PLAIN])
def test_a_ball_in_a_gel_has_its_place_and_curvature(method, functions):
    contact, there, _ = ball_told(method, functions)

    assert contact.present
    assert contact.single
    assert np.isnan([contact.force, contact.force_sd]).all()
    assert np.hypot(*(contact.position - CENTRE)) < 0.3e-3
    assert there.mean == pytest.approx(-1 / RADIUS, rel=0.2)


@pytest.mark.cases("functions0", "functions3")
@pytest.mark.parametrize(("method", "functions"), METHODS[:4])
def test_a_ball_in_a_gel_is_named_with_its_radius(method, functions):
    contact, _, found = ball_told(method, functions)

    assert found.kind == "sphere"
    low, high = found.radius_95
    assert low <= RADIUS <= high
    assert high - low < 0.6 * RADIUS
    assert np.isnan(found.force)
    assert contact.load_radius_95[0] < 3.2e-3 < contact.load_radius_95[1]  # where it lifts off


@pytest.mark.cases("functions0", "functions4", "functions5", "functions6", "functions9")
@pytest.mark.parametrize(("method", "functions"), [*METHODS, PLAIN, *COARSE])
def test_a_ball_is_told_within_its_errors_or_not_named(method, functions):
    contact, there, found = ball_told(method, functions)

    assert (np.abs(contact.position - CENTRE) <= contact.position_95).all()
    assert abs(contact.displacement - HEIGHT.max()) <= contact.displacement_95
    assert abs(there.mean + 1 / RADIUS) <= REACH * there.mean_sd
    assert not found.kind or found.radius_95[0] <= RADIUS <= found.radius_95[1]


# An elastic half-space

PAD = Patch(0.04, 0.04)
FEW, MANY = 40, 400
frames = pytest.mark.parametrize("frames", [FEW, pytest.param(MANY, marks=pytest.mark.full)])


def share(frames):
    """What of a share of 90 % two standard errors leave."""
    return 0.9 - 2 * sqrt(0.9 * 0.1 / frames)


@cache
def pressed(kind, reads, functions, frames):
    """Shares covered of x, y, depth, size, curvature and radius; named a sphere, other; a force."""
    rng, layout = np.random.default_rng(0), heights(PAD, 40, 40)
    noise, read = 2e-6, lambda surface, places: surface(places)  # m
    if reads == "slope":
        noise, read = 1e-3, half_space.slopes
        each = np.arange(1600)
        layout = layout.reading(np.tile(each, 2), "slope", np.repeat([0, np.pi / 2], 1600))
    method = "fast" if reads == "height" else "least-squares"
    fit, contacts, find = finders(method, layout, functions=(functions, functions))
    found = []
    for _ in range(frames):
        x, y, a, R = rng.uniform((0.013, 0.013, 2.5e-3, 8e-3), (0.027, 0.027, 5e-3, 0.03))
        deepest = 0.15 * np.pi / 2 * a if kind == "cone" else a**2 / R
        by = {"sphere": R, "punch": deepest, "cone": 0.15}[kind]

        def surface(places, x=x, y=y, a=a, by=by):
            return getattr(half_space, kind)(np.hypot(*(places - (x, y)).T), a, by)

        readings = read(surface, layout.positions)
        readings = readings + rng.normal(0, noise, readings.shape)
        shape = fit(readings)
        contact, _ = contacts(readings, shape)
        there = contacts.geometry(shape, contact)
        what = find(readings, float(shape.noise), contact)
        found.append(
            (
                *(np.abs(contact.position - (x, y)) <= contact.position_95),
                abs(contact.displacement - deepest) <= contact.displacement_95,
                contact.load_radius_95[0] <= a <= contact.load_radius_95[1],
                abs(there.mean + 1 / R) <= REACH * there.mean_sd,
                what.kind == "" or what.radius_95[0] <= R <= what.radius_95[1],
                what.kind == "sphere",
                what.kind not in ("", "sphere"),
                np.isfinite(contact.force),
            )
        )
    return np.array(found, float).mean(axis=0)


SKINS = [("height", 16), ("height", 24), ("height", 36), ("slope", 18)]


@pytest.mark.cases("height-24", "slope-18")
@pytest.mark.parametrize(("reads", "functions"), SKINS)
@frames
def test_errors_cover_a_ball_in_an_elastomer(reads, functions, frames):
    x, y, depth, *covered, _, other, forces = pressed("sphere", reads, functions, frames)
    if reads == "height":  # the half-space moves at the rim too, which no slope tells
        covered.append(depth)

    assert min(x, y, *covered) >= share(frames)
    assert other == forces == 0


@pytest.mark.full
def test_healthy_heights_are_not_accused_under_an_imprint():
    accused = looks = 0
    for across, kind in product((20, 40), ("sphere", "punch", "cone")):
        layout, rate, rng = heights(PAD, across, across), 32, np.random.default_rng(1)
        chain, plate = DigitalReadings(), Plate(PAD, unknown_material=True)
        gel = Sensor(layout, chain, plate, "hinged", np.inf, "gel", "1", "", simulated=False)
        monitor = HealthMonitor(gel)
        for n in range(12 * 4 * rate):  # held for 3 of 4 s, at another place each time
            if n % (4 * rate) == 0:
                # Half as wide as the elements lie at least: what one alone reads is a fault.
                low, high = (0.01, 0.01, 0.02 / across, 8e-3), (0.03, 0.03, 5e-3, 0.03)
                x, y, a, R = rng.uniform(low, high)
                by = {"sphere": R, "punch": a**2 / R, "cone": 0.15}[kind]
                away = np.hypot(*(layout.positions - (x, y)).T)
                depth = getattr(half_space, kind)(away, a, by)
            held = depth if n % (4 * rate) < 3 * rate else 0.0
            counts = chain.counts(held + rng.normal(0, 2e-6, len(layout)))
            looks += monitor(Frame(n, n / rate, n / rate, np.arange(len(layout)), counts))
            accused += monitor.kinds.any()

    assert looks > 900
    assert accused < 0.01 * 12 * 4 * rate * 6


@frames
def test_a_ball_that_is_resolved_is_mostly_named(frames):
    assert pressed("sphere", "height", 36, frames)[6] > 0.7


@pytest.mark.cases("height-16-punch", "height-36-cone", "slope-18-punch")
@pytest.mark.parametrize("kind", ["punch", "cone"])
@pytest.mark.parametrize(("reads", "functions"), SKINS)
@frames
def test_what_is_no_ball_is_not_named(kind, reads, functions, frames):
    x, y, *_, sphere, other, _ = pressed(kind, reads, functions, frames)

    assert min(x, y) >= share(frames)
    assert sphere + other <= 0.05


# A hinged plate whose rigidity is withheld

SQUARE = Patch(0.1, 0.1)
TRUTH = HingedPlate()


@cache
def on_plate(reads, radius, frames):
    rng, layout = np.random.default_rng(0), SensorLayout.regular(SQUARE, 10, 10)
    fit, contacts, _ = finders("least-squares", layout)
    if reads == "height":
        layout = heights(SQUARE, 20, 20)
        fit, contacts, _ = finders("least-squares", layout, functions=(12, 12))
    places, found = layout.positions, []
    for x, y, force in rng.uniform((0.02, 0.02, 0.1), (0.08, 0.08, 1.0), (frames, 3)):
        c = TRUTH.coefficients(Load(x, y, force, radius))
        read, noise = (TRUTH.surface, 1e-5) if reads == "height" else (TRUTH.curvature, 0.231)
        readings = read(c, places)
        readings = readings + rng.normal(0, noise, readings.shape)
        contact, _ = contacts(readings, fit(readings))
        deep = TRUTH.surface(c, np.array([[x, y]]))[0]
        found.append(
            (
                *(np.abs(contact.position - (x, y)) <= contact.position_95),
                abs(contact.displacement - deep) <= contact.displacement_95,
                np.isfinite(contact.force),
            )
        )
    return np.array(found, float).mean(axis=0)


@pytest.mark.cases("0.0001-height", "0.003-curvature", "0.01-height")
@pytest.mark.parametrize("reads", ["height", "curvature"])
@pytest.mark.parametrize("radius", [1e-4, 3e-3, 1e-2])
@frames
def test_errors_cover_a_load_on_a_plate_of_unknown_rigidity(reads, radius, frames):
    *covered, forces = on_plate(reads, radius, frames)

    assert min(covered) >= share(frames)
    assert forces == 0


@pytest.mark.cases("height-0.2", "curvature-0.3")
@pytest.mark.parametrize("radius", [0.2, 0.3])
@pytest.mark.parametrize("reads", ["height", "curvature"])
def test_errors_cover_the_curvature_of_a_ball_on_a_plate(reads, radius):
    layout, functions = heights(SQUARE, 20, 20), (12, 12)
    if reads == "curvature":
        layout, functions = SensorLayout.regular(SQUARE, 10, 10), (8, 8)
    fit, contacts, find = finders("least-squares", layout, functions=functions)
    press = Compliance(TRUTH, 0.05, 0.05, 1.5e-3, 25).press(ball(radius), 3e-3)
    bearing = np.flatnonzero(press.forces)
    c = sum(
        TRUTH.coefficients(Load(*press.places[i], press.forces[i], press.radius)) for i in bearing
    )
    covered, named = [], 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        readings = (
            TRUTH.curvature(c, layout.positions) + rng.normal(0, 0.231, (3, 100))
            if reads == "curvature"
            else TRUTH.surface(c, layout.positions) + rng.normal(0, 1e-5, 400)
        )
        shape = fit(readings)
        contact, _ = contacts(readings, shape)
        there, what = contacts.geometry(shape, contact), find(readings, shape.noise, contact)
        covered.append(abs(there.mean + 1 / radius) <= REACH * there.mean_sd)
        named += bool(what.kind) and not what.radius_95[0] <= radius <= what.radius_95[1]

    assert np.mean(covered) >= 0.9
    assert named <= 1


# What the plate's model does not explain


def test_what_is_no_plate_is_not_named_by_a_plate():
    rng, layout = np.random.default_rng(0), SensorLayout.regular(PAD, 16, 16)
    plate = Plate(PAD)
    fit = estimator_for("least-squares", basis_for(PAD, "hinged", 12, 12), layout)
    contacts, find = Contacts(plate, layout), ObjectFinder(plate, layout)
    named = 0
    for _ in range(20):
        x, y, a, R = rng.uniform((0.013, 0.013, 3e-3, 8e-3), (0.027, 0.027, 5e-3, 0.03))
        readings = half_space.curvature(
            lambda places, x=x, y=y, a=a, R=R: half_space.sphere(
                np.hypot(*(places - (x, y)).T), a, R
            ),
            layout.positions,
        ) + rng.normal(0, 0.5, (3, 256))
        shape = fit(readings)
        contact, _ = contacts(readings, shape)
        found = find(readings, float(shape.noise), contact)
        named += bool(found.kind)
        assert not contact.single

    assert named == 0
