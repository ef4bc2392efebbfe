"""Functions on caps: orthogonal polynomials of the chart that meet the rim."""

import math

import numpy as np
import pytest

from kappaskin import Cap, Disk, Refusal, basis_for
from kappaskin.bases import ORDERS, CurvatureMap, curvature_at, edges_of
from kappaskin.frames import COMPONENTS

CAP = Cap(8e-3, 1.3, 1.2)
A = CAP.rim_radius


@pytest.mark.parametrize("edge", ["hinged", "clamped"])
def test_derivatives_around_the_pole_are_those_along_a_meridian_also_at_the_pole(edge):
    basis, r = basis_for(CAP, edge, 6, 9), np.array([0.0, 1e-5, 0.1, 0.5, 1.0])
    f, f1, f2 = basis.along(r)
    m, at = np.arange(5)[:, None], r[:, None, None]

    polar = basis.around_pole(r)

    with np.errstate(all="ignore"):  # at the pole itself
        expected = f, f1, m * f / at, f2, m * (f1 - f / at) / at, (f1 - m**2 * f / at) / at
    for found, divided in zip(polar, expected, strict=True):
        scale = np.abs(found).max()
        np.testing.assert_allclose(found[2:], divided[2:], rtol=0, atol=1e-12 * scale)
        np.testing.assert_allclose(found[0], found[1], rtol=0, atol=1e-3 * scale)


@pytest.mark.parametrize("edge", ["hinged", "clamped"])
def test_functions_are_orthogonal_in_their_coordinates_and_a_quarter_in_mean_square(edge):
    basis = basis_for(CAP, edge, 9, 12)
    points, weights = basis.quadrature()
    s = np.hypot(*(points - A).T)
    f, flat = basis.at(points), weights * s / CAP.meridian(s).radius

    products = (f.T * flat) @ f / (math.pi * A**2)

    np.testing.assert_allclose(products, np.eye(basis.size) / 4, atol=1e-12)
    rings = CAP.meridian((np.arange(20000) + 0.5) * A / 20000).radius * A / 20000
    np.testing.assert_allclose(weights.sum(), 2 * math.pi * rings.sum(), rtol=1e-8)


@pytest.mark.parametrize("edge", ["hinged", "clamped"])
def test_derivatives_are_those_of_the_values(edge):
    basis, h = basis_for(CAP, edge, 6, 7), 1e-5 * A
    at = A + A * np.array([[0.0, 0.0], [1e-9, 0.0], [0.3, 0.5], [-0.7, 0.1], [0.05, -0.9]])
    for dx, dy in ((0, 0), (1, 0), (0, 1)):
        for axis, order in (([h, 0], (dx + 1, dy)), ([0, h], (dx, dy + 1))):
            found = basis.at(at, *order)
            ahead, behind = (basis.at(at + sign * np.array(axis), dx, dy) for sign in (1, -1))
            scale = np.abs(found).max()
            np.testing.assert_allclose(found, (ahead - behind) / (2 * h), atol=1e-7 * scale)
    for x, y in at:
        jet = np.stack([basis.at(np.array([[x, y]]), *order)[0] for order in ORDERS])
        np.testing.assert_allclose(basis.jet(x, y), jet, rtol=1e-9, atol=1e-9 * np.abs(jet).max())


@pytest.mark.parametrize("edge", ["hinged", "clamped"])
def test_the_rim_is_held(edge):
    basis = basis_for(CAP, edge, 5, 9)
    angle = np.linspace(0, 6, 40)
    rim = A + A * np.column_stack([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(basis.at(rim), 0, atol=1e-12)
    slope = A * np.abs(basis.at(rim, 1, 0)).max()
    assert slope < 1e-9 if edge == "clamped" else slope > 1


def test_many_functions_stay_exact():
    basis = basis_for(CAP, "hinged", 20, 51)
    points, weights = basis.quadrature()
    s = np.hypot(*(points - A).T)
    f = basis.at(points)
    products = (f.T * (weights * s / CAP.meridian(s).radius)) @ f / (math.pi * A**2)
    np.testing.assert_allclose(products, np.eye(basis.size) / 4, atol=1e-10)


def test_a_turned_shape_is_one_of_the_same_functions():
    basis, turn = basis_for(CAP, "clamped", 4, 7), 0.8
    rng = np.random.default_rng(2)
    at, c = A + 0.6 * A * rng.uniform(-1, 1, (60, 2)), rng.normal(size=28)
    there = (at - A) @ np.array(
        [[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]]
    )
    shape = basis.at(A + there) @ c
    turned, *_ = np.linalg.lstsq(basis.at(at), shape)
    np.testing.assert_allclose(basis.at(at) @ turned, shape, atol=1e-12)


def test_maps_of_curvature_are_what_the_functions_have_there():
    basis = basis_for(CAP, "hinged", 4, 5)
    x, y = CAP.grid(9, 7)
    c = np.random.default_rng(3).normal(size=(4, 5))
    points = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    expected = (curvature_at(basis, points) @ c.ravel()).reshape(3, 7, 9)
    for name, values in zip(COMPONENTS, expected, strict=True):
        found = CurvatureMap(basis, name, x, y)(c)
        np.testing.assert_allclose(found, values, rtol=1e-5, atol=1e-5 * np.nanmax(abs(values)))
    assert np.isnan(expected[0, 0, 0])
    assert np.isfinite(expected[0, 3, 4])


def test_a_cap_may_be_hinged_or_clamped():
    assert edges_of(CAP) == ("hinged", "clamped")
    with pytest.raises(Refusal, match="among hinged, clamped"):
        basis_for(CAP, "sliding", 4, 5)
    assert edges_of(Disk(0.05)) == edges_of(CAP)


def test_on_a_hemisphere_the_fit_is_free_of_what_moves_it_as_a_whole():
    cap = Cap(8e-3)
    basis = basis_for(cap, "hinged", 6, 7)
    points, weights = basis.quadrature()
    moved = cap.at_rest(points)[1][:, 2]  # along the axis
    c, *_ = np.linalg.lstsq(basis.at(points), moved)

    assert np.abs(curvature_at(basis, points) @ c).max() < 1e-5 / 8e-3**2
    assert basis.free.shape == (42, 41)
    np.testing.assert_allclose((weights * moved) @ basis.at(points) @ basis.free, 0, atol=1e-18)
    bent = np.linalg.svd(curvature_at(basis, points).reshape(-1, 42) @ basis.free)[1]
    assert bent[0] / bent[-1] < 1000
    assert basis_for(cap, "clamped", 6, 7).free.shape == (42, 41)
    assert basis_for(CAP, "hinged", 6, 7).free is None
    assert basis_for(Cap(8e-3, 1.2), "hinged", 6, 7).free is None
