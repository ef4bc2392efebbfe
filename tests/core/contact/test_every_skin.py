"""A touch on every skin, held in every way: from what its elements read to shape and contact."""

import math
from functools import cache

import numpy as np
import pytest

from kappaskin import LeastSquares, Plate, PointContact, PointLoad, SensorLayout

FUNCTIONS = 8  # along each side, of the skin that is touched; 6 of the shape fitted to it


@pytest.fixture(autouse=True)
def few_functions(monkeypatch):
    """Polygons with the functions a contact is usually sought with take seconds to make."""
    monkeypatch.setattr("kappaskin.contact.point._FUNCTIONS", FUNCTIONS)


@cache
def plate(held_skin):
    return Plate(held_skin.patch)


@cache
def touched(held_skin):
    """The load, the basis of the true shape, and its coefficients and readings (3, P)."""
    patch, basis = held_skin.patch, held_skin.basis(FUNCTIONS, FUNCTIONS)
    load = PointLoad(0.42 * patch.a, 0.3 * patch.b, 0.05)
    c = plate(held_skin).deflection([load], basis)
    M = layout(held_skin).curvature_operator(basis, plate(held_skin))
    return load, basis, c, (M @ c.ravel()).reshape(3, -1)


@cache
def layout(held_skin):
    return SensorLayout.regular(held_skin.patch, 12, 1 if held_skin.patch.strip else 12)


def read(held_skin, basis, c):
    return (layout(held_skin).curvature_operator(basis) @ c.ravel()).reshape(3, -1)


def at_rest(fit, values, positions):
    """The values (P,) less what no reading sees of them: how the whole skin moved."""
    if fit.basis.unobservable is None:
        return values
    rigid = fit.basis.at(positions) @ fit.basis.unobservable
    return values - rigid @ np.linalg.lstsq(rigid, values)[0]


def test_a_shape_of_the_basis_comes_back_to_rounding(held_skin):
    basis = held_skin.basis(6, 6)
    fit = LeastSquares(basis, layout(held_skin))
    c = np.random.default_rng(0).normal(size=basis.size)
    if basis.free is not None:
        c = basis.free @ c[: basis.free.shape[1]]
    c = c.reshape(basis.shape)

    found = fit(read(held_skin, basis, c))

    np.testing.assert_allclose(found.coefficients, c, rtol=0, atol=1e-13 * np.abs(c).max())
    assert (
        np.abs(found.residual[layout(held_skin).live]).max()
        < 1e-9 * np.abs(read(held_skin, basis, c)).max()
    )


@pytest.mark.slow
def test_of_a_finer_shape_little_is_missed(held_skin):
    _, finer, c, K = touched(held_skin)
    fit = LeastSquares(held_skin.basis(6, 6), layout(held_skin))
    points, weights = finer.quadrature()
    truth = at_rest(fit, finer.at(points) @ c.ravel(), points)

    found = at_rest(fit, fit.basis.at(points) @ fit(K).coefficients.ravel(), points)

    missed = math.sqrt(weights @ (found - truth) ** 2 / (weights @ truth**2))
    # A bent sheet gives locally, and its fit takes it as inextensible.
    assert missed < {"long": 0.07, "bent": 0.2}.get(held_skin.name, 0.03)


@pytest.mark.slow
def test_the_contact_is_found_where_the_load_is(held_skin):
    load, _, _, K = touched(held_skin)
    fit = LeastSquares(held_skin.basis(6, 6), layout(held_skin))

    touch = PointContact(plate(held_skin), layout(held_skin), held_skin.edge)(K, fit(K))

    along = slice(0, 1) if held_skin.patch.strip else slice(0, 2)
    np.testing.assert_allclose(touch.position[along], load.centre()[along], atol=1e-7)
    assert touch.force == pytest.approx(load.force, rel=1e-6)
