"""The plate's prior: what it reaches on the paper's cases, and whether its bands hold its truths.

Whether they hold plates that are no draws from it: `tests/truths/test_coverage.py`.
"""

import numpy as np
import pytest
from scipy import stats

from kappaskin import Bayes, LeastSquares, Patch, Refusal, SensorLayout, SineBasis, load_scene
from kappaskin.estimation.bayes import prior_root

pytestmark = pytest.mark.slow

SQUARE = Patch(0.1, 0.1)
TENS = SensorLayout.regular(SQUARE, 10, 10)
FIFTEEN = SineBasis(SQUARE, 15, 15)
GRID = SQUARE.grid(101, 101)


class Case:
    """One of Table 1's load cases."""

    def __init__(self, name):
        scene = load_scene(name)
        self.truth = scene.plate.deflection(scene.loads, FIFTEEN)
        self.K = (TENS.operator(FIFTEEN) @ self.truth.ravel()).reshape(3, -1)

    def rms(self, answer):
        """RMS over 101 x 101 points in mm."""
        w = FIFTEEN.on_grid(*GRID)(answer.coefficients - self.truth)
        return 1e3 * np.sqrt(np.mean(w**2, axis=(-2, -1)))

    def noisy(self, draws=200):
        return self.K + np.random.default_rng(0).uniform(-0.4, 0.4, (draws, *self.K.shape))


# What the issue of accuracy asks for; PHYSICS tells 0.0006 / 0.0011 / 0.0004 without noise.
@pytest.mark.parametrize(
    ("name", "most"), [("centre", 0.001), ("off-centre", 0.0015), ("line", 0.0006)]
)
def test_table_1s_shapes_of_15_by_15_functions_come_back_but_for_the_prior(name, most):
    case, fit = Case(name), Bayes(FIFTEEN, TENS)

    assert case.rms(fit(case.K)) <= most


@pytest.mark.parametrize("name", ["centre", "off-centre", "line"])
@pytest.mark.parametrize("sigma", [None, 0.231])
def test_with_the_papers_noise_the_shape_is_known_to_21_um(name, sigma):
    case = Case(name)
    answer = Bayes(FIFTEEN, TENS, sigma)(case.noisy())

    assert case.rms(answer).mean() <= 0.021
    if sigma is None:
        assert answer.noise.mean() == pytest.approx(0.231, rel=0.07)


def from_the_prior(frames, noise, seed=0, height=3e-3):
    """Draws (frames, 15, 15) of the prior, of `height` in m by RMS, and readings with noise.

    The posterior is exact for these alone; a plate's shape is none: tests/truths has that.
    """
    rng = np.random.default_rng(seed)
    c = height * rng.normal(size=(frames, 225)) @ prior_root(FIFTEEN).T
    K = (c @ TENS.operator(FIFTEEN).T).reshape(frames, 3, 100)
    return c.reshape(frames, 15, 15), K + rng.normal(0, noise, K.shape)


@pytest.mark.cases("0.231-True")
@pytest.mark.parametrize(
    ("noise", "told"), [(0.01, False), (0.231, False), (2.31, False), (0.231, True)]
)
def test_95_percent_of_draws_of_the_prior_lie_in_the_posteriors_bands(noise, told):
    truth, K = from_the_prior(2000, noise)
    fit = Bayes(FIFTEEN, TENS, noise if told else None)
    x, y = SQUARE.grid(23, 23)
    points = np.stack(np.meshgrid(x[1:-1], y[1:-1]), -1).reshape(-1, 2)

    answer = fit(K)

    off = (answer.coefficients - truth).reshape(2000, -1) @ FIFTEEN.at(points).T
    assert 0.93 <= np.mean(np.abs(off) < 1.96 * answer.surface_sd(points)) <= 0.97


def test_so_do_95_percent_of_their_curvatures():
    truth, K = from_the_prior(500, 0.231)
    rows = TENS.operator(FIFTEEN)[::7]

    answer = Bayes(FIFTEEN, TENS)(K)

    off = (answer.coefficients - truth).reshape(500, -1) @ rows.T
    assert 0.93 <= np.mean(np.abs(off) < 1.96 * answer.sd_of(rows)) <= 0.97


def test_the_posterior_is_that_of_textbook_regression():
    # N(m, C) with C = (L^-T L^-1 / tau^2 + M'M / sigma^2)^-1, m = C M'K / sigma^2.
    basis, layout = SineBasis(SQUARE, 3, 2), SensorLayout.regular(SQUARE, 4, 3)
    K = np.random.default_rng(2).normal(size=(3, 12))
    fit = Bayes(basis, layout, 0.5)
    M, L = layout.operator(basis), prior_root(basis)

    answer = fit(K)

    # The scale is the one that makes the readings most likely.
    def surprise(tau):
        S = 0.25 * np.eye(36) + tau**2 * M @ L @ L.T @ M.T
        likelihood = K.ravel() @ np.linalg.solve(S, K.ravel()) + np.linalg.slogdet(S)[1]
        return likelihood - 2 * np.log(tau)  # which keeps the scale from zero

    taus = np.geomspace(1e-6, 1e-1, 4001)
    tau = taus[np.argmin([surprise(t) for t in taus])]
    C = np.linalg.inv(np.linalg.inv(tau**2 * L @ L.T) + M.T @ M / 0.25)
    m = C @ M.T @ K.ravel() / 0.25
    np.testing.assert_allclose(answer.coefficients.ravel(), m, rtol=0.02, atol=1e-3 * abs(m).max())
    np.testing.assert_allclose(answer.covariance, C, rtol=0.02, atol=1e-3 * C.max())


def test_no_basis_is_too_large_and_what_nothing_decides_has_wide_bars():
    basis = SineBasis(SQUARE, 12, 12)
    truth, K = from_the_prior(50, 0.01)
    with pytest.raises(Refusal, match="140 of the 144"):
        LeastSquares(basis, TENS)

    answer = Bayes(basis, TENS)(K)

    assert np.isfinite(answer.sd).all()
    # Of two functions that look alike at the elements, neither is told better than the prior.
    points = np.random.default_rng(1).uniform(0.01, 0.09, (60, 2))
    off = answer.coefficients.reshape(50, -1) @ basis.at(points).T
    off -= truth.reshape(50, -1) @ FIFTEEN.at(points).T
    assert np.mean(np.abs(off) < 1.96 * answer.surface_sd(points)) > 0.93


def test_half_of_the_readings_gone_leave_a_shape_whose_bars_hold():
    truth, K = from_the_prior(300, 0.231)
    gone = np.random.default_rng(7).random((3, 100)) < 0.5
    K[:, gone] = np.nan
    points = np.random.default_rng(1).uniform(0.01, 0.09, (60, 2))

    answer = Bayes(FIFTEEN, TENS)(K)

    off = (answer.coefficients - truth).reshape(300, -1) @ FIFTEEN.at(points).T
    assert 0.93 <= np.mean(np.abs(off) < 1.96 * answer.surface_sd(points)) <= 0.97


@pytest.mark.parametrize("name", ["centre", "off-centre", "line"])
def test_bands_hold_table_1s_shapes_where_noise_hides_them(name):
    case = Case(name)
    sd = 10 * np.sqrt(np.mean(case.K**2))
    K = case.K + np.random.default_rng(0).normal(0, sd, (300, *case.K.shape))
    points = np.random.default_rng(1).uniform(0.01, 0.09, (60, 2))

    answer = Bayes(FIFTEEN, TENS)(K)

    off = (answer.coefficients - case.truth).reshape(300, -1) @ FIFTEEN.at(points).T
    assert 0.92 <= np.mean(np.abs(off) < 1.96 * answer.surface_sd(points)) <= 0.98


def test_noise_alone_is_told_as_noise():
    K = np.random.default_rng(0).normal(0, 0.3, (200, 3, 100))

    answer = Bayes(FIFTEEN, TENS)(K)

    assert answer.noise.mean() == pytest.approx(0.3, rel=0.03)
    height = 1e3 * np.sqrt(np.mean(FIFTEEN.on_grid(*GRID)(answer.coefficients) ** 2))
    assert height < 0.02


@pytest.mark.where(which=lambda held: held.edge != "elastic")
def test_every_skin_has_a_prior_that_draws_truths_its_bands_cover(held_skin):
    basis = held_skin.basis(5, 5)
    m, n = (14, 1) if held_skin.patch.strip else (8, 8)
    layout = SensorLayout.regular(held_skin.patch, m, n)
    M, rng = layout.operator(basis), np.random.default_rng(0)
    c = rng.normal(size=(300, prior_root(basis).shape[1])) @ prior_root(basis).T
    K = c @ M.T
    sd = 0.05 * np.sqrt(np.mean(K[:, layout.live.ravel()] ** 2))

    answer = Bayes(basis, layout)((K + rng.normal(0, sd, K.shape)).reshape(300, 3, -1))

    points, _ = basis.quadrature()
    rows = basis.at(points[:: max(1, len(points) // 80)])
    bar = answer.sd_of(rows)
    seen = bar.max(axis=0) > 1e-6 * bar.max()
    reach = stats.t.ppf(0.975, answer.spare)[:, None]  # a strip has few readings to tell noise
    covered = np.abs(answer.coefficients.reshape(300, -1) @ rows.T - c @ rows.T) < reach * bar
    assert 0.92 <= covered[:, seen].mean() <= 0.98
