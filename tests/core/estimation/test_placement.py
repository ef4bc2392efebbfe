"""Where elements tell most, and how uncertain a shape is before anything is simulated."""

import numpy as np
import pytest

from kappaskin import LeastSquares, Patch, Refusal, SensorLayout, SineBasis, predicted_sd
from kappaskin.estimation import place_elements, place_for_loads

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


def told_of(places):
    """Of loads on a grid: each element tells more the nearer it is, and which way it lies."""
    x, y = PATCH.grid(9, 7)
    loads = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    away = (loads - places[:, None]) / 0.03
    near = np.exp(-np.sum(away**2, axis=-1))
    rows = np.concatenate([near[..., None], near[..., None] * away], axis=-1)
    errors = np.zeros((2, len(loads), 3, 3))
    errors[0, :, 0, 0] = errors[1, :, 1, 1] = errors[1, :, 2, 2] = 1.0
    return rows[..., None] * rows[..., None, :], 1e-3 * np.eye(3), errors


def error_of_loads(places):
    information, known, errors = told_of(places)
    V = np.linalg.inv(known + information.sum(axis=0))
    return np.sum(errors * V, axis=(1, 2, 3))


def test_elements_placed_for_loads_make_all_their_errors_smaller():
    placed = place_for_loads(GRID, APART, told_of).positions

    away = np.hypot(*(placed[:, None] - placed).T)
    assert away[~np.eye(len(GRID), dtype=bool)].min() > APART - 1e-12
    assert (error_of_loads(placed) < 0.9 * error_of_loads(GRID.positions)).all()


def test_elements_stay_where_no_exchange_gains():
    best = place_for_loads(GRID, APART, told_of)

    assert place_for_loads(best, APART, told_of) is best


def test_no_exchange_of_one_element_makes_loads_better_determined():
    free = SensorLayout.regular(PATCH, 10, 8).positions
    placed = place_for_loads(GRID, APART, told_of).positions
    scale = error_of_loads(GRID.positions)

    def bad(places):
        return np.sum(error_of_loads(places) / scale)

    others = [np.delete(placed, n, axis=0) for n in range(len(placed))]
    least = min(bad(np.vstack([rest, place])) for rest in others for place in free)
    assert least > bad(placed) * (1 - 1e-3)
