"""Contact, geometry and object, against general-purpose nonlinear least squares."""

import itertools
import time

import numpy as np
from scipy import optimize

from kappaskin import (
    LeastSquares,
    ObjectFinder,
    Patch,
    Plate,
    PointContact,
    PointLoad,
    SensorLayout,
    SineBasis,
)
from kappaskin.geometry import contact_geometry

PATCH = Patch(0.1, 0.1)
PLATE, LAYOUT = Plate(PATCH), SensorLayout.regular(PATCH, 10, 10)
FIT = LeastSquares(SineBasis(PATCH, 8, 8), LAYOUT)


def frames(count=64):
    """Noisy readings of a contact that jumps, with the shapes fitted to them, round and round."""
    rng, basis = np.random.default_rng(0), SineBasis(PATCH, 15, 15)
    M = LAYOUT.curvature_operator(basis)
    loads = [PointLoad(*rng.uniform(0.02, 0.08, 2), 0.15) for _ in range(count)]
    clean = [M @ PLATE.deflection([load], basis).ravel() for load in loads]
    noisy = [(K + rng.normal(0, 0.231, K.shape)).reshape(3, -1) for K in clean]
    return itertools.cycle([(K, FIT(K)) for K in noisy])


def by_scipy(curvature, basis, M):
    """The best of a coarse grid, and from there scipy's least squares with its own slopes."""
    flat = curvature.ravel()

    def readings(x, y):
        return M @ basis.at(np.array([[x, y]]))[0]

    def explained(place):
        T = readings(*place)
        return (T @ flat) ** 2 / (T @ T)

    grid = list(itertools.product(np.linspace(0.01, 0.09, 9), repeat=2))
    x, y = max(grid, key=explained)
    T = readings(x, y)
    found = optimize.least_squares(
        lambda p: p[2] * readings(p[0], p[1]) - flat,
        [x, y, T @ flat / (T @ T)],
        x_scale=[0.1, 0.1, 1],
    )
    return found.x


def test_contact_and_geometry_take_a_tenth_of_scipys_contact(medians, figure) -> None:
    contact, ours, theirs = PointContact(PLATE, LAYOUT), frames(), frames()
    basis = contact.basis
    M = PLATE.compliance(basis).after(LAYOUT.curvature_operator(basis))
    K, fit = next(frames())
    touch = contact(K, fit)
    assert np.allclose([*touch.position, touch.force], by_scipy(K, basis, M), rtol=1e-3)

    def found():
        K, fit = next(ours)
        return contact(K, fit), fit

    touched, both, scipys = medians(
        found,
        lambda: contact_geometry(*reversed(found())),
        lambda: by_scipy(next(theirs)[0], basis, M),
        calls=5,
    )
    figure(
        f"contact that jumps in every frame: {touched * 1e6:.0f} us, with the geometry there "
        f"{both * 1e6:.0f} us, {scipys / both:.0f} times faster than scipy's contact alone "
        f"({scipys * 1e3:.1f} ms)"
    )
    assert scipys / both >= 10


def test_the_object_takes_as_long_as_scipys_contact(medians, figure) -> None:
    contact, finder, all_of = PointContact(PLATE, LAYOUT), ObjectFinder(PLATE, LAYOUT), frames()
    basis = contact.basis
    M = PLATE.compliance(basis).after(LAYOUT.curvature_operator(basis))
    start = time.perf_counter()
    ObjectFinder(PLATE, LAYOUT)
    made = time.perf_counter() - start

    def found():
        K, fit = next(all_of)
        return finder(K, float(fit.noise), contact(K, fit))

    object_, scipys = medians(found, lambda: by_scipy(next(all_of)[0], basis, M), turns=20, calls=2)
    figure(
        f"what the object is: {object_ * 1e3:.1f} ms, {object_ / scipys:.1f} times scipy's "
        f"contact; made once in {made * 1e3:.0f} ms"
    )
    assert object_ < 10 * scipys
