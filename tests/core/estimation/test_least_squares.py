"""The laws of the estimator, one suite over every setup: curvature to coefficients and error bars.

Coefficients are compared in the scaled unknowns, each times the length of its column of M, in
which every function bends the skin alike and the condition number is that of `fit.condition`.
"""

from functools import cache

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy import stats

from kappaskin import LeastSquares, Patch, RankDeficient, Refusal, SensorLayout, SineBasis

EPS = np.finfo(float).eps
SQUARE = Patch(0.1, 0.1)
TENS = SensorLayout.regular(SQUARE, 10, 10)


def of(layout, Ni, Nj):
    return SineBasis(layout.patch, Ni, Nj), layout


def only(channel, layout=TENS):
    live = np.zeros_like(layout.live)
    live[channel] = True
    return SensorLayout(layout.patch, layout.positions, live, layout.shape)


def scattered(count, copies=0, distance=0.0):
    points = np.random.default_rng(4).uniform(0, 0.1 - distance, (count, 2))
    return SensorLayout.scattered(SQUARE, np.vstack([points, points[:copies] + distance]))


SETUPS = {
    "regular": of(TENS, 8, 8),
    "unequal sides": of(SensorLayout.regular(Patch(0.12, 0.05), 9, 8), 5, 7),
    "as many functions as elements": of(TENS, 10, 10),
    "more functions than elements along x": of(TENS, 12, 10),
    "one element": of(SensorLayout.regular(SQUARE, 1, 1), 1, 1),
    "no reading to spare": of(only(0, SensorLayout.regular(SQUARE, 4, 4)), 4, 4),
    "scattered": of(scattered(60), 6, 5),
    "nearly coincident": of(scattered(40, 40, 1e-9), 5, 5),
    "dead elements": of(TENS.without([0, 11, 12, 57, 99]), 8, 8),
    "dead row": of(TENS.without(range(40, 50)), 8, 8),
    "dead quarter": of(TENS.without(p + 10 * q for p in range(5) for q in range(5)), 5, 5),
    "only xx": of(only(0), 8, 8),
    "only yy": of(only(1), 8, 8),
    "only xy": of(only(2), 8, 8),
    "1:100": of(SensorLayout.regular(Patch(0.01, 1.0), 4, 40), 3, 30),
    "1 mm": of(SensorLayout.regular(Patch(1e-3, 1e-3), 10, 10), 8, 8),
    "1 m": of(SensorLayout.regular(Patch(1.0, 1.0), 10, 10), 8, 8),
    "64 functions on 65 elements": of(SensorLayout.regular(Patch(0.5, 0.02), 65, 3), 64, 2),
}
SPARE = {name: setup for name, setup in SETUPS.items() if name != "no reading to spare"}
every_setup = pytest.mark.parametrize("setup", SETUPS.values(), ids=SETUPS)
every_setup_with_readings_to_spare = pytest.mark.parametrize("setup", SPARE.values(), ids=SPARE)


@cache
def factored(basis, layout):
    return LeastSquares(basis, layout)


def lengths(fit):
    return np.linalg.norm(fit.M[fit.layout.live.ravel()], axis=0).reshape(fit.basis.shape)


def some_shape(fit, seed=0):
    """Coefficients whose every function makes about 1 1/m of curvature."""
    scale = lengths(fit) / np.sqrt(fit.layout.live.sum())
    return np.random.default_rng(seed).normal(size=fit.basis.shape) / scale


def readings(fit, frames=None, noise=0.3, seed=1, shape=None):
    """Curvature (3, P), or (frames, 3, P), of a shape, with Gaussian noise."""
    c = some_shape(fit) if shape is None else shape
    count = () if frames is None else (frames,)
    draws = np.random.default_rng(seed).normal(0, noise, (*count, 3, len(fit.layout)))
    return (fit.M @ c.ravel()).reshape(3, -1) + draws


def some_missing(fit, share=0.1, frames=None, seed=2):
    """Readings with about `share` of them NaN."""
    K = readings(fit, frames)
    K[np.random.default_rng(seed).random(K.shape) < share] = np.nan
    return K


def by_lstsq(fit, K, weight=1.0):
    """The coefficients of one frame by numpy.linalg.lstsq, over the readings that are there."""
    there = np.isfinite(K).ravel() & fit.layout.live.ravel()
    w = np.broadcast_to(weight, K.shape).ravel()[there]
    length = lengths(fit).ravel()
    A, b = fit.M[there] / length * w[:, None], K.ravel()[there] * w
    return (np.linalg.lstsq(A, b)[0] / length).reshape(fit.basis.shape)


def assert_same_shape(fit, c, expected, tolerance=100 * EPS):
    """Equal in the scaled unknowns, within `tolerance` times the condition number."""
    scale = np.abs(expected * lengths(fit)).max()
    np.testing.assert_allclose(
        (c - expected) * lengths(fit) / scale, 0, atol=tolerance * fit.condition
    )


# The answer


@every_setup
def test_exact_curvatures_return_the_coefficients(setup):
    fit = factored(*setup)
    c = some_shape(fit)

    answer = fit(readings(fit, noise=0, shape=c))

    assert_same_shape(fit, answer.coefficients, c)


@every_setup
def test_the_answer_is_that_of_numpy_lstsq(setup):
    fit = factored(*setup)
    K = readings(fit)

    assert_same_shape(fit, fit(K).coefficients, by_lstsq(fit, K))


@every_setup
def test_the_residual_is_what_the_shape_leaves_and_orthogonal_to_every_function(setup):
    fit = factored(*setup)
    K, live = readings(fit), fit.layout.live

    answer = fit(K)

    left = K - (fit.M @ answer.coefficients.ravel()).reshape(K.shape)
    np.testing.assert_array_equal(np.isnan(answer.residual), ~live)
    np.testing.assert_allclose(answer.residual[live], left[live], atol=1e-12)
    shares = fit.M[live.ravel()].T @ answer.residual[live] / lengths(fit).ravel()
    np.testing.assert_allclose(shares, 0, atol=1e-12 * fit.condition * np.linalg.norm(K))


@every_setup
def test_a_batch_is_answered_frame_by_frame(setup):
    fit = factored(*setup)
    K = readings(fit, frames=3)

    batch = fit(K)

    for t in range(3):
        assert_same_answer(fit, batch, t, fit(K[t]))


def assert_same_answer(fit, batch, t, one):
    assert_same_shape(fit, batch.coefficients[t], one.coefficients, 10 * EPS)
    np.testing.assert_allclose(batch.residual[t], one.residual, rtol=0, atol=1e-12)
    np.testing.assert_allclose(batch.noise[t], one.noise, rtol=1e-10)
    np.testing.assert_allclose(batch.sd[t], one.sd, rtol=1e-10)


@given(st.floats(-100, 100), st.floats(-100, 100))
def test_the_answer_is_linear_in_the_readings(alpha, beta):
    fit = factored(*SETUPS["scattered"])
    K, L = readings(fit, seed=1), readings(fit, seed=2)

    together = fit(alpha * K + beta * L).coefficients

    apart = alpha * fit(K).coefficients + beta * fit(L).coefficients
    scale = (1 + abs(alpha) + abs(beta)) * np.abs(fit(K).coefficients).max()
    np.testing.assert_allclose(together, apart, rtol=0, atol=1e-12 * scale)


@given(st.floats(-4, 4))
def test_a_skin_s_times_as_large_bends_s_times_as_far(power):
    s = 10**power
    small = LeastSquares(*of(SensorLayout.regular(Patch(0.1, 0.07), 6, 5), 5, 4))
    large = LeastSquares(*of(SensorLayout.regular(Patch(0.1 * s, 0.07 * s), 6, 5), 5, 4))
    K = readings(small)

    answer, scaled = small(K), large(K / s)

    assert_same_shape(small, scaled.coefficients / s, answer.coefficients)
    np.testing.assert_allclose(scaled.sd / s, answer.sd, rtol=1e-10)
    assert scaled.noise * s == pytest.approx(answer.noise, rel=1e-10)


@given(st.permutations(range(12)))
def test_the_order_of_the_elements_does_not_matter(order):
    layout = scattered(12)
    fit = LeastSquares(*of(layout, 4, 3))
    shuffled = LeastSquares(*of(SensorLayout.scattered(SQUARE, layout.positions[order]), 4, 3))
    K = readings(fit)

    assert_same_shape(fit, shuffled(K[:, order]).coefficients, fit(K).coefficients)


def test_float32_readings_are_fitted():
    fit = factored(*SETUPS["regular"])
    K = readings(fit).astype(np.float32)

    assert_same_shape(fit, fit(K).coefficients, by_lstsq(fit, K.astype(float)))


def test_the_readings_are_left_as_they_came():
    fit = factored(*SETUPS["regular"])
    K = some_missing(fit, frames=3)
    kept = K.copy()

    fit(K)

    np.testing.assert_array_equal(K, kept)


# Missing readings


@every_setup_with_readings_to_spare
def test_missing_readings_are_left_out(setup):
    fit = factored(*setup)
    K = some_missing(fit, share=0.02)

    answer = fit(K)

    gone = np.isnan(K) | ~fit.layout.live
    assert_same_shape(fit, answer.coefficients, by_lstsq(fit, K), 1e5 * EPS)
    np.testing.assert_array_equal(np.isnan(answer.residual), gone)


@every_setup_with_readings_to_spare
def test_an_update_equals_an_estimator_made_for_the_readings_left(setup):
    fit = factored(*setup)
    K = some_missing(fit, share=0.02)
    sigma = np.where(np.isnan(K), np.inf, 1.0)
    made = LeastSquares(*setup, sigma)

    updated, fresh = fit(K), made(np.nan_to_num(K))

    assert_same_shape(fit, updated.coefficients, fresh.coefficients, 1e5 * EPS)
    np.testing.assert_allclose(updated.sd, updated.noise * fresh.sd, rtol=1e-9)


def a_pair(distance, middle):
    """Four elements, then two at `distance` either side of x = `middle`."""
    far = [(0.02, 0.02), (0.08, 0.02), (0.02, 0.08), (0.08, 0.08)]
    return SensorLayout.scattered(
        SQUARE, [*far, (middle - distance, 0.05), (middle + distance, 0.05)]
    )


@given(st.floats(-17, -2), st.sampled_from([0.03, 0.05]))
@example(-7.0, 0.05)
@example(-4.5, 0.05)
@example(-12.0, 0.03)
def test_readings_that_hardly_decide_a_shape_give_it_or_are_refused(power, middle):
    # xx of the pair tells the first two sines apart only by the distance. About the middle of the
    # skin, 0.05, it hardly sees the second one; scaling the columns mends that and not the other.
    fit = LeastSquares(*of(a_pair(10**power, middle), 2, 1))
    c = some_shape(fit)
    K = readings(fit, noise=0, shape=c)
    K[:, :4] = K[1:] = np.nan
    condition = np.linalg.cond(fit.M[[4, 5]] / lengths(fit).ravel())

    try:
        answer = fit(K).coefficients
    except RankDeficient:
        assert condition > 1e13
    else:
        # An update may lose six digits; beyond that the rest is factored anew.
        assert condition < 1e16
        assert_same_shape(fit, answer, c, 1e-9 + 100 * EPS * condition)


@given(st.sets(st.integers(0, 47), min_size=25, max_size=40))
def test_any_set_of_missing_readings_gives_the_shape_of_the_rest_or_is_refused(gone):
    fit = LeastSquares(*of(SensorLayout.regular(SQUARE, 4, 4), 3, 3))
    K = readings(fit)
    K.ravel()[list(gone)] = np.nan
    left = fit.M[np.isfinite(K).ravel()] / lengths(fit).ravel()
    s = np.linalg.svd(left, compute_uv=False)
    determined = len(left) >= 9 and s[-1] > 1e-12 * s[0]

    if determined:
        assert_same_shape(
            fit, fit(K).coefficients, by_lstsq(fit, K), 1e3 * EPS * (s[0] / s[-1]) ** 2
        )
    else:
        with pytest.raises(
            RankDeficient, match=r"readings determine (at most )?\d of the 9 coefficients"
        ):
            fit(K)


def test_as_many_readings_as_functions_leave_no_noise_to_tell():
    fit = factored(*SETUPS["no reading to spare"])
    c = some_shape(fit)

    answer = fit(readings(fit, noise=0, shape=c))

    assert np.isnan(answer.noise)
    assert np.isnan(answer.sd).all()
    assert_same_shape(fit, answer.coefficients, c)


def test_each_frame_of_a_batch_may_miss_other_readings():
    fit = factored(*SETUPS["dead elements"])
    K = some_missing(fit, frames=25)
    K[[3, 11]] = readings(fit, frames=2)
    K[[7, 19]] = K[2]

    batch = fit(K)

    for t in range(25):
        assert_same_answer(fit, batch, t, fit(K[t]))


def test_the_order_of_frames_that_miss_readings_does_not_matter():
    fit = factored(*SETUPS["regular"])
    K = some_missing(fit, frames=20)

    first, again = fit(K), fit(K[::-1])

    np.testing.assert_array_equal(first.coefficients, again.coefficients[::-1])


def test_a_batch_with_a_frame_that_decides_no_shape_is_refused_with_its_number():
    fit = factored(*SETUPS["regular"])
    K = some_missing(fit, frames=6)
    K[4] = np.nan

    with pytest.raises(RankDeficient, match=r"frame 4: .* no readings are left"):
        fit(K)


def test_a_batch_of_no_frames_has_no_answers():
    fit = factored(*SETUPS["regular"])

    answer = fit(np.empty((0, 3, 100)))

    assert answer.coefficients.shape == (0, 8, 8)


@pytest.mark.parametrize("spike", [np.inf, -np.inf])
def test_infinite_readings_are_missing_readings(spike):
    fit = factored(*SETUPS["regular"])
    K = readings(fit)
    K[1, 42] = np.nan
    expected = fit(K)

    K[1, 42] = spike

    np.testing.assert_array_equal(fit(K).coefficients, expected.coefficients)
    np.testing.assert_array_equal(fit(K).residual, expected.residual)


@pytest.mark.parametrize("place", [(0, 0), (1, 42), (2, 99)])
def test_a_spike_widens_the_error_bars_as_far_as_it_moves_the_shape(place):
    fit = factored(*SETUPS["regular"])
    K = readings(fit)
    K[place] += 1e6

    answer = fit(K)

    z = (answer.coefficients - some_shape(fit)) / answer.sd
    assert 0.3 < np.sqrt(np.mean(z**2)) < 2


# What is refused


def test_12_by_12_functions_on_10_by_10_elements_are_refused_with_the_remedy():
    with pytest.raises(RankDeficient, match=r"determine 140 of .*144 .*use at most 10 x 10 func"):
        LeastSquares(*of(TENS, 12, 12))


def test_12_by_10_functions_on_10_by_10_elements_have_a_condition_of_10():
    assert LeastSquares(*of(TENS, 12, 10)).condition == pytest.approx(10, abs=0.01)


@pytest.mark.parametrize(
    ("m", "n", "Ni", "Nj"), [(10, 10, 8, 8), (10, 10, 10, 10), (65, 3, 64, 2), (4, 40, 3, 39)]
)
def test_functions_up_to_the_elements_have_a_condition_of_1(m, n, Ni, Nj):
    fit = LeastSquares(*of(SensorLayout.regular(Patch(0.1, 0.07), m, n), Ni, Nj))

    assert fit.condition == pytest.approx(1, abs=1e-12)


def test_no_readings_left_are_refused():
    fit = factored(*SETUPS["regular"])

    with pytest.raises(RankDeficient, match="no readings are left; check the connection"):
        fit(np.full((3, 100), np.nan))
    with pytest.raises(RankDeficient, match="no readings are left"):
        LeastSquares(*of(TENS.without(range(100)), 8, 8))


def test_too_few_readings_left_are_refused_with_their_number():
    fit = factored(*SETUPS["regular"])
    K = readings(fit)
    K.ravel()[63:] = np.nan

    with pytest.raises(RankDeficient, match=r"with 63 readings determine .* 237 of 300 readings"):
        fit(K)


@pytest.mark.parametrize("shape", [(3, 99), (100, 3), (300,), (2, 3, 99), (1, 1, 3, 100)])
def test_curvature_of_another_shape_is_refused(shape):
    with pytest.raises(Refusal, match=r"expected readings of shape \(3, 100\).*got \("):
        factored(*SETUPS["regular"])(np.zeros(shape))


@pytest.mark.parametrize(
    ("sigma", "match"),
    [
        (np.ones(3), r"expected sigma to be one number or \(3, 100\), got \(3,\)"),
        (0.0, "every sigma above zero"),
        (np.full((3, 100), -1.0), "every sigma above zero"),
        (np.nan, "every sigma above zero"),
    ],
)
def test_a_sigma_that_is_none_is_refused(sigma, match):
    with pytest.raises(Refusal, match=match):
        LeastSquares(*SETUPS["regular"], sigma)


# Known noise


def test_one_sigma_for_all_changes_the_error_bars_and_not_the_shape():
    plain, told = factored(*SETUPS["regular"]), LeastSquares(*SETUPS["regular"], 0.3)
    K = readings(plain)

    answer = told(K)

    assert answer.noise == 1
    assert_same_shape(plain, answer.coefficients, plain(K).coefficients)
    np.testing.assert_allclose(answer.sd, 0.3 * plain(K).sd / plain(K).noise, rtol=1e-12)


@pytest.mark.parametrize("name", ["regular", "dead elements", "scattered"])
def test_readings_weigh_by_their_own_sigma(name):
    basis, layout = SETUPS[name]
    sigma = np.random.default_rng(3).uniform(0.1, 5, (3, len(layout)))
    fit = LeastSquares(basis, layout, sigma)
    K = some_missing(fit, share=0.02)

    assert_same_shape(fit, fit(K).coefficients, by_lstsq(fit, K, 1 / sigma), 1e4 * EPS)


def test_an_infinite_sigma_leaves_a_reading_out_whatever_it_says():
    fit = factored(*SETUPS["regular"])
    K = readings(fit)
    K[0, :7] = np.nan
    sigma = np.where(np.isnan(K), np.inf, 0.3)
    ignoring = LeastSquares(*SETUPS["regular"], sigma)

    for anything in (0.0, 1e6, np.nan):
        told = ignoring(np.where(np.isnan(K), anything, K))
        assert_same_shape(fit, told.coefficients, fit(K).coefficients)
        assert np.isnan(told.residual[0, :7]).all()


# Error bars


def whitened(covariance, error):
    """`error` (T, N) in the units in which `covariance` (N, N) is the identity."""
    return np.linalg.solve(np.linalg.cholesky(covariance), error.T).T


@every_setup
def test_the_covariance_is_the_inverse_of_the_information(setup):
    fit = LeastSquares(*setup, 0.3)
    length = lengths(fit).ravel()
    A = fit.M[fit.layout.live.ravel()] / length / 0.3

    covariance = fit(readings(fit)).covariance * np.outer(length, length)

    expected = np.linalg.inv(A.T @ A)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(
        covariance / scale, expected / scale, rtol=0, atol=1e3 * EPS * fit.condition**2
    )


def test_the_covariance_of_a_batch_is_that_of_each_frame():
    fit = factored(*SETUPS["dead elements"])
    K = some_missing(fit, frames=4)
    K[2] = readings(fit)

    covariance = fit(K).covariance

    assert covariance.shape == (4, 64, 64)
    for t in range(4):
        np.testing.assert_allclose(covariance[t], fit(K[t]).covariance, rtol=1e-9, atol=1e-20)


@every_setup_with_readings_to_spare
def test_the_error_bars_are_the_diagonal_of_the_covariance(setup):
    fit = factored(*setup)

    answer = fit(some_missing(fit, share=0.02))

    np.testing.assert_allclose(answer.sd.ravel() ** 2, np.diag(answer.covariance), rtol=1e-10)


@pytest.mark.parametrize("missing", [0.0, 0.4])
def test_the_covariance_is_what_noise_does(missing):
    fit = LeastSquares(*of(SensorLayout.regular(SQUARE, 6, 5), 4, 3), 0.3)
    gone = np.random.default_rng(5).random((3, 30)) < missing
    K = np.where(gone, np.nan, readings(fit, frames=20_000))

    answer = fit(K)

    error = (answer.coefficients - some_shape(fit)).reshape(20_000, -1)
    z = whitened(answer.uncertainty[0].covariance, error)
    # Each entry of the sample covariance has a standard error of at most sqrt(2 / 20000) = 0.01.
    np.testing.assert_allclose(z.T @ z / 20_000, np.eye(12), atol=0.05)
    np.testing.assert_allclose(z.mean(axis=0), 0, atol=5 / np.sqrt(20_000))


@pytest.mark.parametrize("signal", [1.0, 0.1 * 0.3])
@pytest.mark.parametrize("name", ["regular", "dead row", "scattered", "1:100", "only xx"])
def test_the_error_bars_cover_the_truth_as_often_as_they_should(name, signal):
    fit = factored(*SETUPS[name])
    shape = signal * some_shape(fit)
    answer = fit(readings(fit, frames=1000, shape=shape))
    covered = [np.mean(np.abs(answer.coefficients - shape) < k * answer.sd) for k in (1, 2)]

    # Student's t with these degrees of freedom.
    dof = fit.layout.live.sum() - fit.basis.size
    expected = [2 * stats.t.cdf(k, dof) - 1 for k in (1, 2)]
    np.testing.assert_allclose(covered, expected, atol=0.02)


@pytest.mark.slow
@every_setup_with_readings_to_spare
def test_the_noise_is_estimated_without_bias(setup):
    fit = factored(*setup)
    K = np.where(np.isnan(some_missing(fit, share=0.02)), np.nan, readings(fit, frames=1000))

    variance = fit(K).noise ** 2 / 0.3**2

    dof = np.isfinite(fit(K[0]).residual).sum() - fit.basis.size
    assert variance.mean() == pytest.approx(1, abs=4 * np.sqrt(2 / dof / 1000))
