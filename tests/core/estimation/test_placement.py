"""Where elements tell most, and how uncertain a shape is before anything is simulated."""

import numpy as np
import pytest

from kappaskin import LeastSquares, Patch, Refusal, SensorLayout, SineBasis, predicted_sd
from kappaskin.estimation import place_elements

PATCH = Patch(0.1, 0.08)
BASIS = SineBasis(PATCH, 4, 3)
GRID = SensorLayout.regular(PATCH, 4, 4)
APART = 0.01


QUADRATURE = BASIS.quadrature()
SHAPES = BASIS.at(QUADRATURE[0])


def volume(M):
    """The volume of what is uncertain of the coefficients, as a logarithm: the less, the better."""
    return -np.linalg.slogdet(M.T @ M)[1]


def variance(M):
    """The mean variance of the displacement over the skin for unit noise."""
    weights = QUADRATURE[1]
    sd2 = np.vecdot(SHAPES @ np.linalg.inv(M.T @ M), SHAPES)
    return weights @ sd2 / weights.sum()


def operator(layout):
    return layout.operator(BASIS)


CRITERIA = pytest.mark.parametrize(("by", "bad"), [("D", volume), ("A", variance)])


@CRITERIA
def test_placed_elements_tell_more_than_a_grid(by, bad):
    placed = place_elements(GRID, BASIS, by, APART)

    assert len(placed) == len(GRID)
    assert bad(operator(placed)) < bad(operator(GRID))


@CRITERIA
def test_no_exchange_of_one_element_gains_anything_more(by, bad):
    everywhere = SensorLayout.regular(PATCH, 10, 8)
    rows = operator(everywhere).reshape(3, 80, -1)
    placed = place_elements(GRID, BASIS, by, APART).positions
    chosen = {int(np.hypot(*(everywhere.positions - place).T).argmin()) for place in placed}

    def told(numbers):
        return bad(rows[:, sorted(numbers)].reshape(3 * len(GRID), -1))

    least = min(told(chosen - {n} | {m}) for n in chosen for m in set(range(80)) - chosen)

    assert len(chosen) == len(GRID)
    assert least > told(chosen) - 1e-4 * abs(told(chosen))


@CRITERIA
def test_placed_elements_stand_apart(by, bad):
    places = place_elements(GRID, BASIS, by, APART).positions

    away = np.hypot(*(places[:, None] - places).T)
    assert away[~np.eye(len(places), dtype=bool)].min() > APART - 1e-12


def test_each_criterion_is_best_at_what_it_asks_for():
    D, A = (place_elements(GRID, BASIS, by, APART) for by in ("D", "A"))

    assert volume(operator(D)) < volume(operator(A))
    assert variance(operator(A)) < variance(operator(D))


def test_clustered_elements_are_the_same_ones_nearer_to_the_middle():
    middle = np.array([PATCH.a, PATCH.b]) / 2

    clustered = place_elements(GRID, BASIS, "clustered", APART).positions - middle

    grid = GRID.positions - middle
    assert (np.abs(clustered) < np.abs(grid)).all()
    assert (np.sign(clustered) == np.sign(grid)).all()


def test_elements_stay_where_the_scene_has_them():
    assert place_elements(GRID, BASIS, "scene", APART) is GRID


def test_what_is_predicted_is_the_spread_of_many_draws():
    fit, rng = LeastSquares(BASIS, GRID), np.random.default_rng(0)
    points = np.array([[0.05, 0.04], [0.02, 0.07], [0.099, 0.001]])
    draws = rng.normal(0.0, 0.3, (4000, 3, len(GRID)))

    drawn = fit(draws).coefficients.reshape(4000, -1) @ BASIS.at(points).T

    np.testing.assert_allclose(predicted_sd(fit, 0.3, points), drawn.std(axis=0), rtol=0.05)


@pytest.mark.parametrize("apart", [0.03, 0.0005])
def test_too_few_or_too_many_places_are_refused(apart):
    with pytest.raises(Refusal, match="expected a spacing that leaves more than 16 places"):
        place_elements(GRID, BASIS, "D", apart)
