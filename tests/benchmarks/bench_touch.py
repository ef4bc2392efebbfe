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
from kappaskin.contact import contact_geometry
from kappaskin.contact.point import _Dense

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


def test_contact_and_geometry_take_a_tenth_of_scipys_contact(medians, figure, ratio) -> None:
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
    ratio("scipy's contact, against contact and geometry", scipys / both, at_least=10)


def by_whole_matrices(monkeypatch):
    """The same contact from M (300 x 225) and M'M, as on skins that are no grid of sines."""
    with monkeypatch.context() as patched:
        patched.setattr("kappaskin.contact.point.load_responses", _Dense)
        dense = lambda layout, basis, C, M: lambda K: K @ M  # noqa: E731
        patched.setattr("kappaskin.contact.point.modal_projection", dense)
        contact = PointContact(PLATE, LAYOUT)
        K, fit = next(frames())
        contact(K, fit)
    return contact


def test_a_contact_by_waves_takes_three_quarters_of_one_by_whole_matrices(
    medians, spaced, figure, ratio, monkeypatch
) -> None:
    by_waves, whole = PointContact(PLATE, LAYOUT), by_whole_matrices(monkeypatch)
    ours, theirs = frames(), frames()
    K, fit = next(frames())
    np.testing.assert_allclose(by_waves(K, fit).position, whole(K, fit).position, rtol=1e-9)

    both = lambda: by_waves(*next(ours)), lambda: whole(*next(theirs))
    (ours_warm, theirs_warm), (ours_cold, theirs_cold) = medians(*both), spaced(*both)
    figure(
        f"contact by waves: {ours_warm * 1e6:.0f} us warm, {ours_cold * 1e6:.0f} us when calls are "
        f"1 ms apart; by whole matrices {theirs_warm / ours_warm:.2f} and "
        f"{theirs_cold / ours_cold:.2f} times as long"
    )
    ratio("contact by waves, against whole matrices", ours_warm / theirs_warm, at_most=0.75)
    ratio(
        "contact by waves, against whole matrices, 1 ms apart",
        ours_cold / theirs_cold,
        at_most=0.75,
    )


def test_the_object_takes_as_long_as_scipys_contact(medians, figure, ratio) -> None:
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
    ratio("what the object is, against scipy's contact", object_ / scipys, at_most=10)
