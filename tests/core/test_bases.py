"""The sine basis: values and derivatives, at points and on grids."""

from itertools import product

import numpy as np
import pytest

from kappaskin import Patch, Refusal, SineBasis

BASIS = SineBasis(Patch(0.12, 0.05), 5, 4)
ORDERS = list(product(range(3), repeat=2))


def positions(count=20):
    return np.random.default_rng(0).uniform((0, 0), (0.12, 0.05), (count, 2))


def test_a_function_is_the_product_of_its_two_sines():
    x, y = positions(1)[0]

    value = BASIS.at(np.array([[x, y]])).reshape(BASIS.shape)[2, 1]

    assert value == pytest.approx(np.sin(3 * np.pi * x / 0.12) * np.sin(2 * np.pi * y / 0.05))


@pytest.mark.parametrize(("dx", "dy"), [order for order in ORDERS if sum(order)])
def test_derivatives_agree_with_central_differences(dx, dy):
    lower, step = ((dx - 1, dy), [1e-6, 0]) if dx else ((dx, dy - 1), [0, 1e-6])
    p = positions()

    difference = (BASIS.at(p + step, *lower) - BASIS.at(p - step, *lower)) / 2e-6

    largest = (5 * np.pi / 0.12) ** dx * (4 * np.pi / 0.05) ** dy
    np.testing.assert_allclose(BASIS.at(p, dx, dy), difference, rtol=0, atol=1e-7 * largest)


@pytest.mark.parametrize("dx", [-1, -2])
@pytest.mark.parametrize("dy", [0, 2])
def test_integrals_along_x_have_the_next_order_as_their_derivative(dx, dy):
    p, step = positions(), [1e-6, 0]

    difference = (BASIS.at(p + step, dx, dy) - BASIS.at(p - step, dx, dy)) / 2e-6

    atol = 1e-7 * (4 * np.pi / 0.05) ** dy
    np.testing.assert_allclose(BASIS.at(p, dx + 1, dy), difference, rtol=0, atol=atol)


def test_integrals_along_x_are_zero_on_average_at_the_ends_and_between_them():
    y = 0.02
    once = BASIS.at(np.array([[0.0, y], [0.12, y]]), -1)
    x, weights = np.polynomial.legendre.leggauss(40)

    twice = BASIS.at(np.column_stack([(x + 1) * 0.06, np.full(40, y)]), -2)

    np.testing.assert_allclose(once.sum(axis=0), 0, atol=1e-16)
    np.testing.assert_allclose(weights @ twice, 0, atol=1e-16)


def test_every_function_is_an_eigenfunction_of_the_laplacian():
    p = positions()

    laplacian = BASIS.at(p, 2, 0) + BASIS.at(p, 0, 2)

    expected = -BASIS.laplacian.ravel() * BASIS.at(p)
    np.testing.assert_allclose(laplacian, expected, rtol=1e-12, atol=1e-9)


def test_every_function_vanishes_along_the_edges():
    x, y = np.linspace(0, 0.12, 9), np.linspace(0, 0.05, 9)
    edges = [np.column_stack(np.broadcast_arrays(*side)) for side in
             ((x, 0.0), (x, 0.05), (0.0, y), (0.12, y))]  # fmt: skip

    values = BASIS.at(np.vstack(edges))

    np.testing.assert_allclose(values, 0, atol=1e-14)


@pytest.mark.parametrize(("dx", "dy"), ORDERS)
def test_the_grid_map_equals_evaluation_point_by_point(dx, dy):
    x, y = np.linspace(0, 0.12, 7), np.linspace(0, 0.05, 11)
    c = np.random.default_rng(1).normal(size=BASIS.shape)

    values = BASIS.on_grid(x, y, dx, dy)(c)

    points = np.column_stack([np.tile(x, 11), np.repeat(y, 7)])
    pointwise = (BASIS.at(points, dx, dy) @ c.ravel()).reshape(11, 7)
    np.testing.assert_allclose(values, pointwise, rtol=0, atol=1e-13 * np.abs(pointwise).max())


def test_the_grid_map_takes_batches():
    grid = BASIS.on_grid(np.linspace(0, 0.12, 7), np.linspace(0, 0.05, 11))
    c = np.random.default_rng(2).normal(size=(3, 2, *BASIS.shape))

    values = grid(c)

    assert values.shape == (3, 2, 11, 7)
    np.testing.assert_allclose(values[2, 1], grid(c[2, 1]), rtol=1e-14, atol=1e-14)


def test_a_third_derivative_is_refused():
    with pytest.raises(Refusal, match="order -2 to 2, got 3"):
        BASIS.at(positions(), dx=3)


@pytest.mark.parametrize(("Ni", "Nj"), [(0, 4), (4, 0), (-1, 4)])
def test_an_empty_basis_is_refused(Ni, Nj):
    with pytest.raises(Refusal, match=f"at least 1 x 1 functions, got {Ni} x {Nj}"):
        SineBasis(Patch(0.1, 0.1), Ni, Nj)
