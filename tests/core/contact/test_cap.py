"""Contacts on caps: where a load is and how strong, and what the table of loads is made of."""

import math
from functools import cache

import numpy as np
import pytest

from kappaskin import (
    Bayes,
    Cap,
    DiscLoad,
    LeastSquares,
    Plate,
    PointContact,
    SensorLayout,
    basis_for,
)
from kappaskin.contact.influence import influence_of
from kappaskin.mechanics import CapWaves

R = 8e-3
CAPS = {"hemisphere": (Cap(R), "clamped"), "egg": (Cap(R, 1.4, 1.3), "hinged")}


def elements(cap, count=60):
    """On a spiral, each with as much of the skin around it."""
    i = np.arange(count) + 0.5
    away = 0.97 * cap.rim_radius / cap.angle * np.arccos(1 - (1 - math.cos(cap.angle)) * i / count)
    turn = i * math.pi * (3 - math.sqrt(5))
    places = cap.rim_radius + away[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    return SensorLayout.scattered(cap, places)


@cache
def skin(name):
    """The cap, its layout, its plate, and what a basis of many functions reads of unit forces."""
    (cap, edge) = CAPS[name]
    layout, plate = elements(cap), Plate(cap)
    basis = basis_for(cap, edge, 24, 71)
    return (
        cap,
        edge,
        layout,
        plate,
        basis,
        plate.compliance(basis).after(layout.operator(basis, plate)),
    )


def readings(name, load):
    _, _, _, _, basis, M = skin(name)
    return M @ load.modal(basis).ravel()


@pytest.mark.parametrize("name", CAPS)
def test_a_disc_feels_of_a_wave_what_bessel_has(name):
    cap, edge = CAPS[name]
    basis = basis_for(cap, edge, 12, 25)
    waves = CapWaves(basis)
    place, r = cap.rim_radius + np.array([3e-3, 1e-3]), 1e-3
    m = np.arange(1, 13)

    def by_wave(modal):
        cos, sin = np.zeros((2, 13, 12))
        cos[0], cos[m], sin[m] = modal[:, 0], modal[:, 2 * m - 1].T, modal[:, 2 * m].T
        return (np.stack([cos, sin])[:, :, None] @ waves.shares)[:, :, 0]

    cos, sin = by_wave(DiscLoad(*place, r).modal(basis))
    # Rows on the waves of the mean are those of the middle times 2 J1(k r) / (k r).
    at = by_wave(basis.at(place[None]).reshape(basis.shape))
    felt = waves.k * r
    low = felt < 1.5
    share = 1 - felt**2 / 8 + felt**4 / 192
    assert low.sum() > 20
    for of_disc, of_point in ((cos, at[0]), (sin, at[1])):
        scale = np.abs(of_point[low]).max()
        np.testing.assert_allclose(of_disc[low], (share * of_point)[low], atol=0.02 * scale)


@pytest.mark.cases("0.001-0.05-hemisphere", "0.002-0.07-egg")
@pytest.mark.parametrize("name", CAPS)
@pytest.mark.parametrize(("radius", "share"), [(1e-3, 0.05), (2e-3, 0.07)])
def test_the_table_has_what_many_functions_read_of_a_disc(name, radius, share):
    cap, edge, layout, plate, _, _ = skin(name)
    out = np.zeros((4, layout.channels))
    influence = influence_of(plate, layout, edge, 15, out)
    for x, y in [(0, 0), (3e-3, 0), (-4e-3, 5e-3), (1e-3, -7e-3)]:
        place = cap.rim_radius + np.array([x, y])
        expected = readings(name, DiscLoad(*place, radius))

        influence.at(*place, radius**2)

        # Most of it from elements under the load, where the many functions differ among themselves.
        off = out[0] / influence.unit - expected
        assert np.linalg.norm(off) < share * np.linalg.norm(expected)


@pytest.mark.parametrize("name", CAPS)
def test_the_slopes_of_the_table_are_those_of_its_readings(name):
    cap, edge, layout, plate, _, _ = skin(name)
    out = np.zeros((4, layout.channels))
    influence = influence_of(plate, layout, edge, 15, out)
    x, y, s, h = cap.rim_radius + 3.1e-3, cap.rim_radius - 2.3e-3, 1.7e-6, 1e-6

    def read(*place):
        influence.at(*place)
        return out.copy()

    slopes = read(x, y, s)[1:]
    for k, step in enumerate([(h, 0, 0), (0, h, 0), (0, 0, h * 1e-3)]):
        ahead, behind = (read(*np.add((x, y, s), sign * np.array(step)))[0] for sign in (1, -1))
        expected = (ahead - behind) / (2 * sum(step))
        np.testing.assert_allclose(slopes[k], expected, atol=2e-3 * np.abs(expected).max())


@pytest.mark.cases("hemisphere")
@pytest.mark.slow
@pytest.mark.parametrize("name", CAPS)
def test_discs_of_any_size_are_found_and_weighed(name):
    cap, edge, layout, plate, _, _ = skin(name)
    find, rng = PointContact(plate, layout, edge), np.random.default_rng(3)
    fit, off, forces = LeastSquares(basis_for(cap, edge, 6, 7), layout), [], []
    for radius in (1e-3, 2e-3, 3e-3):
        for _ in range(8):
            turn = 2 * math.pi * rng.random()
            away = 0.7 * cap.rim_radius * math.sqrt(rng.random())
            place = cap.rim_radius + away * np.array([math.cos(turn), math.sin(turn)])
            K = 0.2 * readings(name, DiscLoad(*place, radius))
            K += np.abs(K).max() / 50 * rng.normal(size=len(K))

            contact = find(K.reshape(3, -1), fit(K.reshape(3, -1)))

            assert np.hypot(*(contact.position - place)) < 0.4e-3
            forces.append(contact.force / 0.2)
            off += [*(contact.position - place) / contact.position_sd]
            off.append((contact.force - 0.2) / contact.force_sd)
    assert np.median(forces) == pytest.approx(1.0, abs=0.03)
    assert (np.abs(off) < 1.96).mean() > 0.85


def test_a_point_gives_as_the_compliance_has_it():
    cap, edge, layout, plate, basis, _ = skin("hemisphere")
    influence = influence_of(plate, layout, edge, 15, np.zeros((4, layout.channels)))
    x, y = cap.rim_radius + 4e-3, cap.rim_radius + 1e-3
    f = basis.at(np.array([[x, y]]))
    expected = (plate.compliance(basis).after(f) @ f.T).item()
    assert influence.gives(x, y) == pytest.approx(expected, rel=0.02)


def test_directions_are_read_off_the_same_table():
    cap, edge, layout, plate, _, _ = skin("hemisphere")
    turned = layout.reading_each(["curvature@30", "twist"])
    x, y, s = cap.rim_radius + 2e-3, cap.rim_radius, 1e-6
    found, plain = np.zeros((4, turned.channels)), np.zeros((4, layout.channels))
    influence_of(plate, turned, edge, 15, found)
    of_turned = influence_of(plate, turned, edge, 15, found)
    of_turned.at(x, y, s)
    influence_of(plate, layout, edge, 15, plain).at(x, y, s)
    xx, yy, xy = plain[0].reshape(3, -1)
    along = 0.75 * xx + 0.25 * yy + 2 * math.sin(math.pi / 6) * math.cos(math.pi / 6) * xy
    np.testing.assert_allclose(found[0], [*along, *xy], rtol=1e-6, atol=1e-9)
    places, read = of_turned.nodes
    assert read.shape == (len(places), turned.channels)


@pytest.mark.parametrize("estimator", [Bayes, LeastSquares])
def test_the_fitted_shape_is_near_what_many_functions_are(estimator):
    cap, edge, layout, plate, basis, M = skin("hemisphere")
    load = DiscLoad(cap.rim_radius + 2e-3, cap.rim_radius + 1e-3, 2e-3)
    felt = load.modal(basis).ravel()
    few = basis_for(cap, edge, 6, 7)
    fit = estimator(few, layout)((M @ felt).reshape(3, -1))
    places, area = few.quadrature()
    truth = basis.at(places) @ plate.compliance(basis).after(felt[None])[0]
    off = few.at(places) @ fit.coefficients.ravel() - truth
    assert math.sqrt(area @ off**2 / area.sum()) < 0.12 * truth.max()
