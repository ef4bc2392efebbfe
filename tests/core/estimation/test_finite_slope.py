"""Gages on a slope: the true normal curvature, and the shape that explains it."""

import numpy as np
import pytest

from kappaskin import (
    Disk,
    LeastSquares,
    Patch,
    Refusal,
    SensorLayout,
    SineBasis,
    basis_for,
    load_scene,
    local_geometry,
)
from kappaskin.estimation import FiniteSlopeLeastSquares

SQUARE = Patch(0.1, 0.1)
TENS = SensorLayout.regular(SQUARE, 10, 10)
EIGHT = SineBasis(SQUARE, 8, 8)


def on_a_slope(basis, c, layout=TENS):
    """The true normal curvature (3, P) along the gages, written out once more (PHYSICS 3)."""
    f = {order: basis.at(layout.positions, *order) @ c.ravel() for order in
         [(1, 0), (0, 1), (2, 0), (0, 2), (1, 1)]}  # fmt: skip
    fx, fy = f[1, 0], f[0, 1]
    W = np.sqrt(1 + fx**2 + fy**2)
    return np.stack(
        [
            f[2, 0] / (W * (1 + fx**2)),
            f[0, 2] / (W * (1 + fy**2)),
            f[1, 1] / (W * np.sqrt((1 + fx**2) * (1 + fy**2))),
        ]
    )


class Case:
    """One of Table 1's load cases, whose gages sense the bent surface's curvature."""

    def __init__(self, name):
        scene = load_scene(name)
        self.basis, self.load = scene.basis, scene.loads[0].centre()
        self.truth = scene.plate.deflection(scene.loads, scene.basis)
        self.K = on_a_slope(scene.basis, self.truth)

    def errors(self, answer):
        """E at the load and RMS in mm."""
        grid, at = SQUARE.grid(101, 101), self.load[None]
        w = EIGHT.on_grid(*grid)(answer.coefficients) - self.basis.on_grid(*grid)(self.truth)
        e = (
            EIGHT.at(at)[0] @ answer.coefficients.ravel()
            - self.basis.at(at)[0] @ self.truth.ravel()
        )
        return 1e3 * e, 1e3 * np.sqrt(np.mean(w**2))


@pytest.mark.parametrize(
    ("name", "linear", "finite"),
    [
        ("centre", (-0.076, 0.0143), (-0.0482, 0.0042)),
        ("off-centre", (-0.257, 0.0499), (-0.1186, 0.0102)),
        ("line", (-0.031, 0.0180), (-0.0000, 0.0008)),
    ],
)
def test_four_steps_take_away_what_slopes_cost(name, linear, finite):
    case = Case(name)

    answer = FiniteSlopeLeastSquares(EIGHT, TENS)(case.K)

    assert case.errors(LeastSquares(EIGHT, TENS)(case.K)) == pytest.approx(linear, abs=6e-4)
    assert case.errors(answer) == pytest.approx(finite, abs=6e-5)
    assert answer.converged
    assert answer.steps <= 4


def test_the_prediction_is_the_true_normal_curvature():
    answer = LeastSquares(EIGHT, TENS)(Case("off-centre").K)

    predicted = FiniteSlopeLeastSquares(EIGHT, TENS).predicted(answer.coefficients)

    np.testing.assert_allclose(predicted, on_a_slope(EIGHT, answer.coefficients), rtol=1e-12)
    # The Gauss frame's first vector is along x: an independent way to kappa_xx.
    form = local_geometry(answer, TENS.positions).curvature_form
    np.testing.assert_allclose(predicted[0], form[:, 0, 0], rtol=1e-9, atol=1e-9)


def test_flat_enough_it_is_least_squares():
    K = 1e-4 * Case("centre").K

    answer, plain = FiniteSlopeLeastSquares(EIGHT, TENS)(K), LeastSquares(EIGHT, TENS)(K)

    scale = np.abs(plain.coefficients).max()
    np.testing.assert_allclose(answer.coefficients, plain.coefficients, rtol=0, atol=1e-7 * scale)


@pytest.mark.parametrize("steepness", [1, 2, 3, 4, 6, 10, 30])
def test_steep_skins_are_solved_or_the_linear_answer_is_given_and_said_to_be(steepness):
    basis = SineBasis(SQUARE, 4, 4)
    c = np.zeros((4, 4))
    c[0, 0], c[1, 2] = 4.7e-3 * steepness, 1e-3 * steepness
    K = on_a_slope(basis, c)

    answer, plain = FiniteSlopeLeastSquares(basis, TENS)(K), LeastSquares(basis, TENS)(K)

    off = np.abs(answer.coefficients - c).max() / np.abs(c).max()
    if answer.converged:
        assert off < 0.02
    else:
        np.testing.assert_array_equal(answer.coefficients, plain.coefficients)
        assert steepness >= 4


def test_noise_ten_times_the_signal_does_not_run_away():
    rng = np.random.default_rng(0)
    K = Case("centre").K + rng.normal(0, 22.0, (200, 3, 100))

    answer, plain = FiniteSlopeLeastSquares(EIGHT, TENS)(K), LeastSquares(EIGHT, TENS)(K)

    assert np.abs(answer.coefficients).max() < 2 * np.abs(plain.coefficients).max()
    gave_up = ~answer.converged
    np.testing.assert_array_equal(answer.coefficients[gave_up], plain.coefficients[gave_up])


def test_it_works_on_any_flat_outline():
    disk = Disk(0.05)
    basis, layout = basis_for(disk, "clamped", 5, 5), SensorLayout.regular(disk, 10, 10)
    c = np.zeros((5, 5))
    c[0, 0] = 3e-3
    K = on_a_slope(basis, c, layout)

    answer, plain = FiniteSlopeLeastSquares(basis, layout)(K), LeastSquares(basis, layout)(K)

    assert np.abs(answer.coefficients - c).max() < 0.01 * np.abs(plain.coefficients - c).max()


def test_bent_skins_are_refused_with_the_reason():
    patch = Patch(0.04, 0.03, 12.9e-3)
    with pytest.raises(Refusal, match=r"expected a flat skin .*tangential.* use least-squares"):
        FiniteSlopeLeastSquares(SineBasis(patch, 4, 4), SensorLayout.regular(patch, 8, 8))
