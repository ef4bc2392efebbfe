"""The laws that every way from curvature to coefficients keeps, one suite over all of them."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kappaskin import Patch, Refusal, SensorLayout, SineBasis, estimator_for
from kappaskin.estimation import METHODS

SQUARE = Patch(0.1, 0.1)
TENS = SensorLayout.regular(SQUARE, 10, 10)
EIGHT = SineBasis(SQUARE, 8, 8)
NOISE = 0.231

HAS_MEMORY = {"tracking"}
"""Methods whose answer depends on the frames before."""
EXACT = ("least-squares", "as-printed", "direct", "fast")
"""Methods that aim at the least-squares answer itself."""

every_method = pytest.mark.parametrize("method", METHODS)
every_exact_method = pytest.mark.parametrize("method", [m for m in EXACT if m in METHODS])
every_frame_alone = pytest.mark.parametrize("method", [m for m in METHODS if m not in HAS_MEMORY])


def made(method, layout=TENS, basis=EIGHT, **more):
    return estimator_for(method, basis, layout, **more)


@cache
def shape():
    """Coefficients of a smooth shape, some 4 mm high."""
    i, j = np.arange(1, 9)[:, None], np.arange(1, 9)
    draws = np.random.default_rng(5).normal(size=(8, 8))
    return 4e-3 * draws / (i**2 + j**2) ** 2 * 4


@cache
def exact():
    return (TENS.operator(EIGHT) @ shape().ravel()).reshape(3, -1)


def noisy(seed=0, frames=None, sd=NOISE):
    count = () if frames is None else (frames,)
    return exact() + np.random.default_rng(seed).normal(0, sd, (*count, 3, 100))


def surface(coefficients):
    """Displacement (..., 21, 21) in mm."""
    return 1e3 * EIGHT.on_grid(*SQUARE.grid(21, 21))(coefficients)


@every_method
def test_a_shape_of_the_functions_comes_back_without_noise(method):
    answer = made(method)(exact())

    # Finite slope knows that gages on a slope read less; tracking and Bayes have a prior.
    tolerance = 0.05 if method == "finite-slope" else 1e-3
    np.testing.assert_allclose(surface(answer.coefficients), surface(shape()), atol=tolerance)


@every_exact_method
def test_exact_methods_agree_to_rounding(method):
    K = noisy()

    answer, reference = made(method)(K), made("least-squares")(K)

    scale = np.abs(reference.coefficients).max()
    np.testing.assert_allclose(
        answer.coefficients, reference.coefficients, rtol=0, atol=1e-12 * scale
    )
    np.testing.assert_allclose(answer.sd, reference.sd, rtol=1e-9)
    assert answer.noise == pytest.approx(float(reference.noise), rel=1e-10)


@every_method
def test_the_residual_is_what_the_prediction_leaves(method):
    fit = made(method)

    answer = fit(noisy())

    left = answer.readings - fit.predicted(answer.coefficients)
    np.testing.assert_array_equal(answer.residual, left)


@every_method
def test_the_noise_is_told(method):
    told = [float(made(method)(noisy(seed)).noise) for seed in range(12)]

    assert np.mean(told) == pytest.approx(NOISE, rel=0.06)


@every_method
def test_error_bars_and_covariance_tell_the_same(method):
    answer = made(method)(noisy())
    rows = EIGHT.at(np.array([[0.05, 0.05], [0.02, 0.03]]))

    covariance = answer.covariance

    np.testing.assert_allclose(covariance, covariance.T, atol=1e-12 * np.abs(covariance).max())
    np.testing.assert_allclose(answer.sd.ravel(), np.sqrt(np.diag(covariance)), rtol=1e-6)
    of_rows = answer.covariance_of(rows)
    np.testing.assert_allclose(of_rows, rows @ covariance @ rows.T, rtol=1e-6)
    np.testing.assert_allclose(answer.sd_of(rows), np.sqrt(np.diag(of_rows)), rtol=1e-9)


@every_frame_alone
def test_the_bands_are_the_spread_of_answers_to_a_shape_of_the_functions(method):
    """What the bands cover of a plate's shape, tests/truths tells."""
    fit, points = made(method), np.random.default_rng(1).uniform(0.01, 0.09, (40, 2))

    answer = fit(noisy(frames=200))

    rows = EIGHT.at(points)
    off = (answer.coefficients - shape()).reshape(200, -1) @ rows.T
    if method == "finite-slope":  # its truth is on a slope
        off -= (fit(exact()).coefficients - shape()).ravel() @ rows.T
    assert 0.93 <= np.mean(np.abs(off) < 1.96 * answer.sd_of(rows)) <= 0.97


@every_frame_alone
def test_what_remembers_nothing_follows_by_what_is_held(method):
    fit, held = made(method), noisy()

    answer = fit.follow(np.full((3, 100), np.nan), np.full((3, 100), np.nan), held)

    np.testing.assert_array_equal(answer.coefficients, fit(held).coefficients)


@every_frame_alone
def test_a_batch_is_answered_frame_by_frame(method):
    K = noisy(frames=6)
    K[2, :, 40:43] = np.nan
    K[4, 1, 7] = np.inf

    batch = made(method)(K)

    for t in range(6):
        one = made(method)(K[t])
        scale = np.abs(one.coefficients).max()
        np.testing.assert_allclose(
            batch.coefficients[t], one.coefficients, rtol=0, atol=1e-10 * scale
        )
        np.testing.assert_allclose(batch.sd[t], one.sd, rtol=1e-6)
        np.testing.assert_allclose(batch.noise[t], one.noise, rtol=1e-6)
        assert batch.steps[t] == one.steps
        assert batch.converged[t] == one.converged


@every_method
def test_missing_readings_widen_the_error_bars_and_are_marked(method):
    K = noisy()
    K[:, [33, 34, 43, 44]] = np.nan

    answer, whole = made(method)(K), made(method)(noisy())

    np.testing.assert_array_equal(np.isnan(answer.residual), np.isnan(K))
    rows = EIGHT.at(np.array([[0.04, 0.04]]))
    assert answer.sd_of(rows)[0] / answer.noise > whole.sd_of(rows)[0] / whole.noise
    np.testing.assert_allclose(surface(answer.coefficients), surface(shape()), atol=0.15)


@every_method
def test_dead_channels_are_not_read_whatever_they_say(method):
    layout = TENS.without([12, 57])

    answers = []
    for lie in (0.0, 1e9):
        K = noisy()
        K[:, [12, 57]] = lie
        answers.append(made(method, layout)(K))

    np.testing.assert_array_equal(answers[0].coefficients, answers[1].coefficients)
    assert np.isnan(answers[0].residual[:, [12, 57]]).all()


@every_method
@given(power=st.floats(-3, 3), sign=st.sampled_from([-1, 1]))
@settings(max_examples=10, deadline=None)
def test_readings_times_a_number_give_the_shape_times_that(method, power, sign):
    s = sign * 10**power
    if method == "finite-slope":  # is not linear, but odd
        s = sign

    answer, scaled = made(method)(noisy()), made(method)(s * noisy())

    scale = np.abs(answer.coefficients).max()
    np.testing.assert_allclose(
        scaled.coefficients / s, answer.coefficients, rtol=0, atol=1e-6 * scale
    )
    np.testing.assert_allclose(scaled.sd / abs(s), answer.sd, rtol=1e-4)


@every_method
@pytest.mark.parametrize("s", [1e-2, 1.0, 10.0])
def test_a_skin_s_times_as_large_bends_s_times_as_far(method, s):
    patch = Patch(0.1 * s, 0.1 * s)
    large = made(method, SensorLayout.regular(patch, 10, 10), SineBasis(patch, 8, 8))

    answer, scaled = made(method)(noisy()), large(noisy() / s)

    scale = np.abs(answer.coefficients).max()
    np.testing.assert_allclose(
        scaled.coefficients / s, answer.coefficients, rtol=0, atol=1e-6 * scale
    )


@every_method
def test_the_order_of_the_elements_does_not_matter(method):
    order = np.random.default_rng(3).permutation(100)
    shuffled = SensorLayout.scattered(SQUARE, TENS.positions[order])
    K = noisy()

    answer, other = made(method)(K), made(method, shuffled)(K[:, order])

    scale = np.abs(answer.coefficients).max()
    np.testing.assert_allclose(other.coefficients, answer.coefficients, rtol=0, atol=1e-9 * scale)


@every_method
def test_single_precision_answers_to_its_own_rounding(method):
    K = noisy()

    single, double = made(method, dtype=np.float32)(K), made(method)(K)

    assert single.coefficients.dtype == np.float32
    # The normal equations square the condition number, 64 unscaled.
    tolerance = 1e-2 if method == "as-printed" else 1e-4
    np.testing.assert_allclose(
        surface(single.coefficients), surface(double.coefficients), atol=tolerance
    )
    assert single.noise == pytest.approx(float(double.noise), rel=1e-2)


@every_method
def test_a_told_noise_is_believed(method):
    K = noisy()

    answer, twice = made(method, sigma=NOISE)(K), made(method, sigma=2 * NOISE)(K)

    assert float(answer.noise) == 1
    ratio = twice.sd / answer.sd
    assert (ratio > 1).all()
    assert (ratio <= 2 * (1 + 1e-9)).all()


@every_method
def test_a_reading_without_worth_is_left_out(method):
    sigma = np.full((3, 100), NOISE)
    sigma[:, 44] = np.inf
    K = noisy()
    K[:, 44] = np.nan

    told, missing = made(method, sigma=sigma)(noisy()), made(method, sigma=NOISE)(K)

    scale = np.abs(missing.coefficients).max()
    np.testing.assert_allclose(told.coefficients, missing.coefficients, rtol=0, atol=1e-9 * scale)


@every_method
def test_nothing_read_is_no_load(method):
    answer = made(method)(np.zeros((3, 100)))

    assert (answer.coefficients == 0).all()
    assert (answer.sd >= 0).all()


@every_method
def test_the_readings_are_left_as_they_came_and_may_be_written_over(method):
    K = noisy()
    kept = K.copy()

    answer = made(method)(K)
    np.testing.assert_array_equal(K, kept)
    residual = answer.readings - made(method).predicted(answer.coefficients)
    K[:] = 7

    np.testing.assert_array_equal(answer.residual, residual)


@every_method
def test_who_writes_on_error_bars_changes_no_later_ones(method):
    fit, other = made(method), made(method)

    fit(noisy()).unit_sd[:] = 0
    other(noisy())

    np.testing.assert_array_equal(fit(noisy(1)).sd, other(noisy(1)).sd)


@every_method
def test_a_batch_of_no_frames_has_no_answers(method):
    answer = made(method)(np.empty((0, 3, 100)))

    assert answer.coefficients.shape == (0, 8, 8)
    assert answer.sd.shape == (0, 8, 8)
    assert answer.residual.shape == (0, 3, 100)


@every_method
@pytest.mark.parametrize("wrong", [np.zeros((3, 99)), np.zeros(300), np.zeros((1, 1, 3, 100))])
def test_curvature_of_another_shape_is_refused(method, wrong):
    with pytest.raises(Refusal, match=r"expected readings of shape \(3, 100\).*got \("):
        made(method)(wrong)


@every_method
@pytest.mark.parametrize(
    "wrong",
    ["abc", [[1, 2], [1], [2]], np.zeros((3, 100), complex), np.ma.zeros((3, 100)), None],
    ids=["text", "ragged", "complex", "masked", "nothing"],
)
def test_what_is_no_array_of_real_numbers_is_refused(method, wrong):
    with pytest.raises(Refusal, match="expected readings as an array of real numbers"):
        made(method)(wrong)
    if wrong is not None:
        with pytest.raises(Refusal, match="expected sigma as an array of real numbers"):
            made(method, sigma=wrong)


@every_method
@pytest.mark.parametrize(("dtype", "huge"), [("float64", 1e160), ("float32", 1e30)])
def test_a_reading_too_large_to_compute_with_is_missing(method, dtype, huge):
    missing, too_large = noisy(frames=2), noisy(frames=2)
    missing[0, 1, 20], too_large[0, 1, 20] = np.nan, huge

    answer, other = made(method, dtype=dtype)(missing), made(method, dtype=dtype)(too_large)

    np.testing.assert_array_equal(other.coefficients, answer.coefficients)
    np.testing.assert_array_equal(other.residual, answer.residual)


@every_method
@pytest.mark.parametrize(("dtype", "far"), [("float64", 1e61), ("float32", 4e7)])
def test_a_sigma_beyond_all_sense_is_refused_and_one_short_of_it_is_computed(method, dtype, far):
    for sigma in (far, 1 / far):
        answer = made(method, sigma=sigma, dtype=dtype)(noisy())
        assert np.isfinite(answer.coefficients).all()
        assert np.isfinite(answer.sd).all()
        assert (answer.sd > 0).all()
    for sigma in (10 * far, 0.1 / far):
        with pytest.raises(Refusal, match=f"every sigma from .* in {dtype}"):
            made(method, sigma=sigma, dtype=dtype)


@every_method
def test_what_cannot_be_an_estimator_is_refused(method):
    with pytest.raises(Refusal, match="rim_sd of at least zero"):
        made(method, rim_sd=-1.0)
    with pytest.raises(Refusal, match="float64 or float32"):
        made(method, dtype=np.float16)
    with pytest.raises(Refusal, match="every sigma above zero"):
        made(method, sigma=0.0)
    with pytest.raises(Refusal, match="expected sigma to be one number"):
        made(method, sigma=np.ones(4))


def test_a_method_that_there_is_not_is_refused_with_those_there_are():
    with pytest.raises(Refusal, match=r"expected a method among least-squares, .*got 'guess'"):
        estimator_for("guess", EIGHT, TENS)
