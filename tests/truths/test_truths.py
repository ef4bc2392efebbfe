"""The truths that estimators are tested against, against published numbers and each other."""

import math
from functools import cache

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from navier import HingedPlate, Load

UNIT = HingedPlate(1.0, 1.0, 1.0)


# Navier's plate; numbers of Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells, 1959


@pytest.mark.parametrize(
    ("b", "deflection"),
    [(1.0, 0.01160), (1.2, 0.01353), (1.4, 0.01484), (1.6, 0.01570), (1.8, 0.01620), (2, 0.01651)],
)
def test_a_central_force_moves_a_hinged_plate_as_in_table_23(b, deflection):
    w = HingedPlate(1.0, b, 1.0).displacement(Load(0.5, b / 2), np.array([[0.5, b / 2]]))

    # The table is up to 0.2 % below its own series (Levy's).
    m = np.arange(1, 200, 2)
    t = np.minimum(m * math.pi * b / 2, 300)
    levy = np.sum((np.tanh(t) - t / np.cosh(t) ** 2) / m**3) / (2 * math.pi**3)
    assert w[0] == pytest.approx(levy, rel=2e-5)
    assert levy == pytest.approx(deflection, rel=2.2e-3)


def test_an_even_pressure_moves_a_hinged_plate_as_in_table_8():
    at, weights = leggauss(40)
    grid = np.stack(np.meshgrid(at, at), -1).reshape(-1, 2) / 2 + 0.5

    # By reciprocity the mean displacement under a central force.
    w = UNIT.displacement(Load(0.5, 0.5), grid) @ np.outer(weights, weights).ravel() / 4

    assert w == pytest.approx(0.00406235, rel=1e-5)


@pytest.mark.parametrize("c", [0.03, 0.05])
def test_the_moment_in_a_central_disc_is_that_of_table_24(c):
    xx, yy, _ = UNIT.readings(Load(0.5, 0.5, radius=c), np.array([[0.5, 0.5]]))

    # The factors of a square, -0.565 and 0.135, both leave 0.435 beside the logarithm.
    moment = (1.3 * math.log(2 / (math.pi * c)) + 0.435) / (4 * math.pi)
    assert -(xx + 0.3 * yy)[0] == pytest.approx(moment, rel=2e-3)


@cache
def _disc(count=24):
    """Places (Q, 2) on a disc of radius 1 and weights (Q,) of their mean."""
    (r, weights), turn = leggauss(count), 2 * math.pi * np.arange(count) / count
    r = np.sqrt((r + 1) / 2)
    places = np.stack([np.outer(r, np.cos(turn)), np.outer(r, np.sin(turn))], -1)
    return places.reshape(-1, 2), np.repeat(weights / 2 / count, count)


def test_a_disc_is_the_mean_of_its_points():
    plate, places = HingedPlate(0.1, 0.08), np.array([[0.02, 0.05], [0.055, 0.03], [0.09, 0.01]])
    (steps, weights), middle = _disc(), np.array([0.045, 0.05])

    points = [plate.readings(Load(*p), places) for p in middle + 5e-3 * steps]

    of_disc = plate.readings(Load(*middle, radius=5e-3), places)
    np.testing.assert_allclose(np.tensordot(weights, points, 1), of_disc, rtol=1e-4, atol=1e-6)


def test_a_gaussian_is_the_mean_of_discs():
    # Rayleigh's law: exp(-r^2/2 sd^2) is a mixture of discs whose radius squared has the density
    # t exp(-t) of t = r^2 / (2 sd^2).
    plate, places, sd = HingedPlate(), np.array([[0.04, 0.06], [0.08, 0.02]]), 2e-3
    t = np.linspace(0, 25, 301)
    radii = sd * np.sqrt(2 * (t[1:] + t[:-1]) / 2)
    shares = np.diff(-(1 + t) * np.exp(-t))

    discs = [plate.readings(Load(0.05, 0.045, radius=r), places) for r in radii]

    gaussian = plate.readings(Load(0.05, 0.045, sd=sd), places)
    np.testing.assert_allclose(np.tensordot(shares, discs, 1), gaussian, rtol=1e-4, atol=1e-5)


def _differences(plate, load, place, h=1e-4):
    """Second derivatives (3,) of the displacement by central differences."""
    steps = h * np.array(
        [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1)]
    )
    w, e, o, n, s, ne, so, se, no = plate.displacement(load, np.add(place, steps))
    return np.array([e - 2 * w + o, n - 2 * w + s, (ne + so - se - no) / 4]) / h**2


def test_readings_are_the_second_derivatives_of_the_displacement():
    plate, load, place = HingedPlate(0.1, 0.08), Load(0.03, 0.04, 0.7, radius=4e-3), (0.05, 0.06)

    K = plate.readings(load, np.array([place]))[:, 0]

    np.testing.assert_allclose(K, _differences(plate, load, place), rtol=1e-4, atol=1e-5)


def test_a_gage_reads_the_mean_curvature_along_it():
    plate, load, L = HingedPlate(0.1, 0.08), Load(0.03, 0.04, 0.7, radius=4e-3), 7e-3
    middle, (at, weights) = np.array([0.035, 0.045]), leggauss(30)

    def mean(ex, ey):
        K = plate.readings(load, middle + np.outer(at * L / 2, (ex, ey)))
        return weights / 2 @ (ex**2 * K[0] + ey**2 * K[1] + 2 * ex * ey * K[2])

    d = math.sqrt(0.5)
    expected = [mean(1, 0), mean(0, 1), (mean(d, d) - mean(d, -d)) / 2]
    found = plate.readings(load, middle[None], gage_length=L)[:, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-6)
