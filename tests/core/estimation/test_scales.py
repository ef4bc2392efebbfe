"""Numbers at the edge: every method gives an answer that scales with the readings, or refuses."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from kappaskin import Patch, Refusal, SensorLayout, SineBasis, basis_for, estimator_for
from kappaskin.estimation import METHODS
from kappaskin.estimation.fit import power_of_two

SQUARE = Patch(0.1, 0.1)
TENS = SensorLayout.regular(SQUARE, 10, 10)
EIGHT = SineBasis(SQUARE, 8, 8)
NOISE = 0.231

NONLINEAR = {"finite-slope"}
"""Methods to which a shape twice as high is another one, but where slopes are next to nothing."""
LEAST = {"tracking": -405}
"""The power of two of readings that a method refuses as too small."""

every_method = pytest.mark.parametrize("method", METHODS)


def frame(seed=0, missing=()):
    i, j = np.arange(1, 9)[:, None], np.arange(1, 9)
    rng = np.random.default_rng(seed)
    shape = 0.016 * rng.normal(size=(8, 8)) / (i**2 + j**2) ** 2
    K = (TENS.operator(EIGHT) @ shape.ravel()).reshape(3, -1)
    K += rng.normal(0, NOISE, K.shape)
    K[1, list(missing)] = np.nan
    return K


def fitted(method, curvature, basis=EIGHT, **more):
    """The fit, and why there is none."""
    try:
        return estimator_for(method, basis, TENS, **more)(curvature), ""
    except Refusal as refusal:
        return None, str(refusal)


def numbers_of(fit):
    """All that has the unit of the readings, with the error bars."""
    point = np.array([[0.03, 0.06]])
    named = {
        "coefficients": fit.coefficients,
        "noise": fit.noise,
        "sd": fit.sd,
        "residual": fit.residual,
        "surface_sd": fit.surface_sd(point),
    }
    fit.jet(0.03, 0.06)
    fit.covariance_of(EIGHT.at(point))
    return named


def assert_scaled(found, expected, k, off=1e-9):
    """`found` is `expected` times 2^k, up to rounding."""
    for name, value in expected.items():
        known = np.isfinite(value)
        np.testing.assert_array_equal(np.isfinite(found[name]), known, name)
        back = np.ldexp(np.ldexp(np.where(known, found[name], 0.0), -(k // 2)), k // 2 - k)
        size = np.max(np.abs(value), where=known, initial=0.0)
        np.testing.assert_allclose(back, np.where(known, value, 0.0), 0, off * size, err_msg=name)


@pytest.mark.cases("whole-tracking", "missing-fast", "missing-bayes", "whole-finite-slope")
@every_method
@pytest.mark.parametrize("missing", [(), (4, 5, 6)], ids=["whole", "missing"])
@settings(max_examples=25, deadline=None)
@given(k=st.integers(-1074, 1010))
@example(k=-1074)
@example(k=-1022)
@example(k=-900)
@example(k=-600)
@example(k=-530)
@example(k=-300)
@example(k=200)
@example(k=252)
@example(k=256)
@example(k=260)
@example(k=1000)
def test_readings_times_a_power_of_two_give_that_answer_or_a_refusal(method, missing, k):
    K = frame(missing=missing)
    scaled = np.ldexp(K, k)

    fit, why = fitted(method, scaled)

    if why:
        assert "expected" in why
        assert k > 245 or k < LEAST.get(method, -np.inf)
        return

    found = numbers_of(fit)
    if np.nanmax(np.abs(scaled)) < 1e-292:  # too few digits for a shape
        assert not fit.coefficients.any()
    elif method not in NONLINEAR:
        assert fit.converged
        assert_scaled(found, numbers_of(estimator_for(method, EIGHT, TENS)(K)), k)
    elif k < -60:
        assert_scaled(found, numbers_of(estimator_for("least-squares", EIGHT, TENS)(K)), k)
    else:
        assert np.isfinite(fit.coefficients).all()
        assert np.isfinite(fit.sd).all()


@every_method
@settings(max_examples=15, deadline=None)
@given(k=st.integers(-300, 300))
@example(k=-198)
@example(k=198)
def test_readings_and_sigma_scale_together(method, k):
    K = frame()

    fit, why = fitted(method, np.ldexp(K, k), sigma=np.ldexp(NOISE, k))

    if why:
        assert "expected every sigma from" in why
        assert abs(k) > 200
        return

    assert fit.noise == 1
    if method in NONLINEAR:
        assert (fit.sd > 0).all()
        return
    expected = estimator_for(method, EIGHT, TENS, sigma=NOISE)(K)
    for name in ("coefficients", "sd"):
        assert_scaled({name: getattr(fit, name)}, {name: getattr(expected, name)}, k)


@every_method
@pytest.mark.parametrize(
    "sigma", [5e-324, 1e-310, 1e-300, 1e-160, 1e-61, 1e-30, 1e30, 1e61, 1e160, 1e300, 1.7e308]
)
def test_any_sigma_gives_error_bars_in_proportion_or_a_refusal(method, sigma):
    fit, why = fitted(method, frame(), sigma=sigma)

    if why:
        assert "expected every sigma from" in why
        assert not 1e-62 < sigma < 1e62
        return

    found = numbers_of(fit)
    assert all(np.isfinite(value).all() for value in found.values())
    assert (fit.sd > 0).all()


@every_method
@settings(max_examples=10, deadline=None)
@given(span=st.integers(1, 250), seed=st.integers(0, 9))
def test_sigmas_of_every_size_in_one_frame_give_numbers_or_a_refusal(method, span, seed):
    powers = np.random.default_rng(seed).integers(-span, span, (3, 100))

    fit, why = fitted(method, frame(), sigma=np.ldexp(NOISE, powers))

    if not why:
        assert np.isfinite(fit.coefficients).all()
        # The normal equations leave no digit of some variances, which are NaN then.
        assert np.isfinite(fit.sd).all() or method == "as-printed"


@every_method
@pytest.mark.parametrize("rim_sd", [0.0, 5e-324, 1e-300, 1e-160, 1e-3, 1e50, 1e60, 1e200, 1.7e308])
def test_any_movement_of_an_elastic_rim_gives_error_bars_or_a_refusal(method, rim_sd):
    basis = basis_for(SQUARE, "elastic", 4, 4)

    fit, why = fitted(method, frame(), basis, rim_sd=rim_sd)

    if why:
        assert method in ("fast", "as-printed") or ("expected a rim_sd" in why and rim_sd > 1e60)
        return

    assert np.isfinite(fit.sd).all()
    assert np.isfinite(fit.covariance).all()
    assert np.isfinite(fit.jet(0.03, 0.06)[1]).all()
    assert (fit.surface_sd(np.array([[0.0, 0.05]])) >= rim_sd / 10).all()


@pytest.mark.cases("3]", "77", "308", "6]")
@pytest.mark.parametrize("power", [3, 6, 12, 20, 40, 60, 70, 76, 77, 78, 100, 200, 300, 308])
def test_a_spike_of_any_size_is_left_out_by_the_robust_method(power):
    spiked, missing = frame(), frame()
    spiked[1, 33], missing[:, 33] = 10.0**power, np.nan

    fit = estimator_for("robust", EIGHT, TENS)(spiked)

    expected = estimator_for("robust", EIGHT, TENS)(missing)
    close = 1e-12 if power <= 76 else 0.05  # beyond, the one reading is missing, not the element
    size = np.abs(expected.coefficients).max()
    np.testing.assert_allclose(fit.coefficients, expected.coefficients, 0, close * size)


@pytest.mark.parametrize("k", [-900, -520, -200, 0, 200, 240])
def test_outliers_are_told_at_every_scale(k):
    K = frame()
    K[:, 12] += 8.0
    K[0, 57] -= 30.0

    fit = estimator_for("robust", EIGHT, TENS)(np.ldexp(K, k))

    assert np.flatnonzero(fit.suspect).tolist() == [12, 57]


@every_method
def test_frames_of_many_scales_in_one_call_are_those_alone(method):
    powers = (0, -1040, -700, 0, 100, -200)
    frames = np.stack([np.ldexp(frame(), k) for k in powers])
    if method in ("tracking", "robust"):  # these have a memory
        frames = frames[[0, 3]]
    fit = estimator_for(method, EIGHT, TENS)

    together = fit(frames)

    for n, one in enumerate(frames):
        alone = estimator_for(method, EIGHT, TENS)(one)
        if method != "tracking":
            size = np.abs(alone.coefficients).max()
            off = np.abs(together.coefficients[n] - alone.coefficients).max()
            assert off <= 1e-12 * size
            assert together.noise[n] == pytest.approx(float(alone.noise), rel=1e-12, abs=0)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_power_of_two_is_in_the_largest_number(dtype):
    numbers = np.finfo(dtype)
    largest = np.array([numbers.max, numbers.tiny, 3.0, -5.0, 0.0, numbers.smallest_subnormal])
    rows = np.stack([0 * largest, largest], axis=1).astype(dtype)

    unit = power_of_two(rows)

    assert unit.dtype == dtype
    ratio = np.abs(rows[:, 1:] / unit)
    assert ((ratio >= 1) & (ratio < 2) | (ratio == 0)).all()
