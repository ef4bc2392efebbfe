"""Contact, geometry and object, against general-purpose nonlinear least squares."""

import itertools
import math
import time

import numpy as np
from scipy import optimize

from kappaskin import (
    LeastSquares,
    ObjectFinder,
    Patch,
    Plate,
    PointContact,
    SensorLayout,
    SineBasis,
)
from kappaskin.contact import contact_geometry
from kappaskin.contact.element_grid import modal_projection
from kappaskin.contact.influence import influence_of
from navier import HingedPlate, Load

PATCH = Patch(0.1, 0.1)
PLATE, LAYOUT = Plate(PATCH), SensorLayout.regular(PATCH, 10, 10)
FIT = LeastSquares(SineBasis(PATCH, 8, 8), LAYOUT)


def frames(count=64):
    """Noisy readings of a contact that jumps, with the shapes fitted to them, round and round."""
    rng, plate = np.random.default_rng(0), HingedPlate()
    loads = [Load(*rng.uniform(0.02, 0.08, 2), 0.15, 2e-3) for _ in range(count)]
    clean = [plate.readings(load, LAYOUT.positions) for load in loads]
    noisy = [K + rng.normal(0, 0.231, K.shape) for K in clean]
    return itertools.cycle([(K, FIT(K)) for K in noisy])


def by_scipy(curvature):
    """The best of a coarse grid, and from there scipy's least squares with its own slopes."""
    flat, rows = curvature.ravel(), np.zeros((4, curvature.size))
    influence = influence_of(PLATE, LAYOUT, "hinged", 15, rows)

    def readings(x, y, size):
        influence.at(x, y, size)
        return rows[0]

    def explained(place):
        T = readings(*place, 4e-6)
        return (T @ flat) ** 2 / (T @ T)

    grid = list(itertools.product(np.linspace(0.01, 0.09, 17), repeat=2))
    x, y = max(grid, key=explained)
    T = readings(x, y, 4e-6)
    found = optimize.least_squares(
        lambda p: p[2] * readings(p[0], p[1], math.exp(p[3])) - flat,
        [x, y, T @ flat / (T @ T), math.log(4e-6)],
        x_scale=[1e-3, 1e-3, 1e-3, 1.0],
    )
    return *found.x[:2], found.x[2] * influence.unit


def test_contact_and_geometry_take_a_tenth_of_scipys_contact(medians, figure, ratio) -> None:
    contact, ours, theirs = PointContact(PLATE, LAYOUT), frames(), frames()
    K, fit = next(frames())
    touch = contact(K, fit)
    sd = np.array([*touch.position_sd, touch.force_sd])
    assert (np.abs(np.array([*touch.position, touch.force]) - by_scipy(K)) < sd / 5).all()

    def found():
        K, fit = next(ours)
        return contact(K, fit), fit

    touched, both, scipys = medians(
        found,
        lambda: contact_geometry(*reversed(found())),
        lambda: by_scipy(next(theirs)[0]),
        calls=5,
    )
    figure(
        f"contact that jumps in every frame: {touched * 1e6:.0f} us, with the geometry there "
        f"{both * 1e6:.0f} us, {scipys / both:.0f} times faster than scipy's contact alone "
        f"({scipys * 1e3:.1f} ms)"
    )
    ratio("scipy's contact, against contact and geometry", scipys / both, at_least=10)
    ratio("contact that jumps, of the 150 us allowed", touched / 150e-6, at_most=1)


def test_the_search_by_waves_takes_three_quarters_of_a_whole_matrix(medians, figure, ratio) -> None:
    basis = SineBasis(PATCH, 15, 15)
    compliance = PLATE.compliance(basis)
    M = compliance.after(LAYOUT.operator(basis))
    by_waves = modal_projection(LAYOUT, basis, compliance, M)
    K = next(frames())[0].ravel()
    np.testing.assert_allclose(by_waves(K), K @ M, rtol=1e-9, atol=1e-9 * np.abs(K @ M).max())

    ours, theirs = medians(lambda: by_waves(K), lambda: K @ M)
    figure(f"readings to modes by waves: {ours * 1e6:.1f} us, by a matrix {theirs * 1e6:.1f} us")
    ratio("readings to modes by waves, against a whole matrix", ours / theirs, at_most=0.75)


def test_the_object_takes_as_long_as_scipys_contact(medians, figure, ratio) -> None:
    contact, finder, all_of = PointContact(PLATE, LAYOUT), ObjectFinder(PLATE, LAYOUT), frames()
    start = time.perf_counter()
    ObjectFinder(PLATE, LAYOUT)
    made = time.perf_counter() - start

    def found():
        K, fit = next(all_of)
        return finder(K, float(fit.noise), contact(K, fit))

    object_, scipys = medians(found, lambda: by_scipy(next(all_of)[0]), turns=20, calls=2)
    figure(
        f"what the object is: {object_ * 1e3:.1f} ms, {object_ / scipys:.1f} times scipy's "
        f"contact; made once in {made * 1e3:.0f} ms"
    )
    ratio("what the object is, against scipy's contact", object_ / scipys, at_most=10)
    ratio("what the object is, of the 10 ms allowed", object_ / 10e-3, at_most=1)
