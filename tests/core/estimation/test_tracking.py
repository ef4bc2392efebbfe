"""The tracking estimator: a textbook's answers, memory, honest error bars, no end to it."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import linalg

from kappaskin import (
    LeastSquares,
    Patch,
    Pipeline,
    RankDeficient,
    Refusal,
    SensorLayout,
    Setup,
    Simulator,
    SineBasis,
    Tracking,
    load_scene,
)
from kappaskin.estimation.bayes import prior_root
from kappaskin.estimation.kalman import ModalKalmanFilter
from kappaskin.estimation.tracking import most_informative
from kappaskin.sensing import SECOND_GENERATION

pytestmark = pytest.mark.slow

SQUARE = Patch(0.1, 0.1)
SIXES = SensorLayout.regular(SQUARE, 6, 6)
FOURS = SineBasis(SQUARE, 4, 4)
NOISE, SIZE = 0.3, 2e-3  # 1/m; m, RMS over the skin of what is drawn


# The filter: independent answers


def transition(rates, seconds):
    """Phi (2F, 2F) and stationary covariance of modes of Matern's class 3/2, by the exponential."""
    F = len(rates)
    drift = np.block([[np.zeros((F, F)), np.eye(F)], [-np.diag(rates**2), -2 * np.diag(rates)]])
    return linalg.expm(drift * seconds), np.diag(np.concatenate([np.ones(F), rates**2]))


def matern(rates, s, t):
    """Covariance of values at times `s` and `t` of each mode."""
    x = rates * abs(s - t)
    return (1 + x) * np.exp(-x)


K_MODES, SPEED, AMPLITUDE = np.array([20.0, 35.0, 80.0]), 0.2, 1.7
RATES = math.sqrt(3) * SPEED * K_MODES
TIMES = np.array([0.0, 0.004, 0.005, 0.02, 0.021, 0.5])


def some_readings(seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(len(TIMES), 4, 3)), rng.normal(0, 3, (len(TIMES), 4))


def filtered(dtype=np.float64):
    A, y = some_readings()
    modes = ModalKalmanFilter(K_MODES, dtype)
    modes.expect(AMPLITUDE, SPEED)
    for n, t in enumerate(TIMES):
        if n:
            modes.advance(t - TIMES[n - 1], AMPLITUDE, SPEED)
        modes.absorb(A[n].astype(dtype), np.zeros(4, dtype), y[n].astype(dtype))
    return modes


def test_the_filter_is_that_of_a_textbook():
    A, y = some_readings()
    _, T = transition(RATES, 0.0)
    x, P = np.zeros(6), AMPLITUDE**2 * T
    for n, t in enumerate(TIMES):
        if n:
            Phi, _ = transition(RATES, t - TIMES[n - 1])
            x, P = Phi @ x, Phi @ P @ Phi.T + AMPLITUDE**2 * (T - Phi @ T @ Phi.T)
        H = np.hstack([A[n], np.zeros((4, 3))])
        gain = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.eye(4))
        x, P = x + gain @ (y[n] - H @ x), P - gain @ H @ P

    modes = filtered()

    scale = np.sqrt(np.diag(T))
    np.testing.assert_allclose(modes.mean.ravel() / scale, x / scale, atol=1e-11)
    got = modes.root.T @ modes.root
    np.testing.assert_allclose(got / np.outer(scale, scale), P / np.outer(scale, scale), atol=1e-11)


def test_the_filter_is_the_regression_of_a_gaussian_process_on_all_readings_at_once():
    A, y = some_readings()
    B = linalg.block_diag(*A)
    prior = np.block([[np.diag(matern(RATES, s, t)) for t in TIMES] for s in TIMES])
    V = AMPLITUDE**2 * B @ prior @ B.T + np.eye(B.shape[0])
    now = AMPLITUDE**2 * prior[-3:] @ B.T

    modes = filtered()

    np.testing.assert_allclose(modes.mean[0], now @ np.linalg.solve(V, y.ravel()), atol=1e-10)
    P = AMPLITUDE**2 * np.eye(3) - now @ np.linalg.solve(V, now.T)
    S1, _ = modes.halves
    np.testing.assert_allclose(S1.T @ S1, P, atol=1e-10)


def test_the_score_is_the_slope_of_the_likelihood():
    A, y = some_readings()
    modes = ModalKalmanFilter(K_MODES, np.float64)
    modes.expect(AMPLITUDE, SPEED)

    learned = modes.absorb(A[0], np.zeros(4), y[0])

    def log_likelihood(log_scale, variance):
        V = variance * (np.eye(4) + math.exp(log_scale) * AMPLITUDE**2 * A[0] @ A[0].T)
        return -(y[0] @ np.linalg.solve(V, y[0]) + np.linalg.slogdet(V)[1]) / 2

    for variance in (1.0, 4.0):
        slope = (log_likelihood(1e-5, variance) - log_likelihood(-1e-5, variance)) / 2e-5
        assert learned.score(variance) == pytest.approx(slope, rel=1e-6)


# The estimator: shapes drawn as the prior says, readings with Gaussian noise


@cache
def modes_of(basis):
    """A root of the prior, and a wave number of each of its columns."""
    return prior_root(basis), np.sqrt(basis.laplacian.ravel())


def still_shape(seed=0, basis=FOURS):
    L, _ = modes_of(basis)
    return SIZE * L @ np.random.default_rng(seed).normal(size=L.shape[1])


class Moving:
    """A shape whose modes are waves in time, finer ones faster, drawn with `seed`."""

    def __init__(self, seed, speed=0.1, basis=FOURS):
        rng = np.random.default_rng(seed)
        self._L, k = modes_of(basis)
        # The spectrum of a process of Matern's class 3/2: Student's t with three degrees.
        self._rates = speed * k[:, None] * rng.standard_t(3, (len(k), 40))
        self._phases = rng.uniform(0, 2 * np.pi, self._rates.shape)

    def __call__(self, times):
        """Coefficients (..., N) at `times` (...)."""
        turned = np.multiply.outer(times, self._rates) + self._phases
        return SIZE * math.sqrt(2 / 40) * np.cos(turned).sum(axis=-1) @ self._L.T


def read(layout, basis, coefficients, rng, noise=NOISE):
    """Curvature (3, P) of `coefficients` (N,), or with those of each channel (3 P, N)."""
    flat = np.vecdot(layout.operator(basis), coefficients)
    return (flat + rng.normal(0, noise, flat.shape)).reshape(3, -1)


def scanned(shape, scan, start, rng, layout=SIXES, basis=FOURS, interval=20e-6):
    """Curvature and times (3, P) of a `scan` of channels begun at `start`; NaN elsewhere."""
    t = np.full(3 * len(layout), np.nan)
    t[scan] = start + interval * np.arange(len(scan))
    K = read(layout, basis, shape(np.nan_to_num(t)), rng).ravel()
    K[np.isnan(t)] = np.nan
    return K.reshape(3, -1), t.reshape(3, -1)


def displacement_rows(basis=FOURS):
    grid = np.linspace(0.01, 0.09, 5)
    return basis.at(np.stack(np.meshgrid(grid, grid), -1).reshape(-1, 2))


def one_frame_sd(rows):
    """The greatest standard deviation of least squares on one frame."""
    return NOISE * LeastSquares(FOURS, SIXES)(np.zeros((3, 36))).uncertainty.sd_of(rows).max()


def test_the_first_frame_is_sound(held_skin):
    basis = held_skin.basis()
    layout = SensorLayout.regular(held_skin.patch, 8, 1 if held_skin.patch.strip else 8)
    rng, L, live = np.random.default_rng(0), prior_root(basis), layout.live.ravel()
    M = layout.operator(basis)[live]
    # Of a cantilever the first function has most: the others are to be seen in one frame too.
    times = 100 if held_skin.edge == "cantilever" else 30
    L = L * times * NOISE / np.sqrt(np.mean(np.sum((M @ L) ** 2, axis=1)))
    tracking, scores = Tracking(basis, layout, NOISE, rim_sd=0.0), []
    for _ in range(20):
        c = L @ rng.normal(size=L.shape[1])
        tracking.restart()

        fit = tracking(read(layout, basis, c, rng))

        error = fit.coefficients.ravel() - c
        P = np.linalg.pinv(fit.covariance, rcond=1e-12)
        scores.append(error @ P @ error / L.shape[1])
    # A mean of chi-squared over its degrees of freedom, five or more in each of 20 draws.
    assert np.mean(scores) == pytest.approx(1.0, abs=0.5)


def test_a_still_load_is_averaged_to_the_shape_of_least_squares_with_the_right_error_bars():
    c, rng, rows = still_shape(), np.random.default_rng(1), displacement_rows()
    fit, plain, z, total = Tracking(FOURS, SIXES), LeastSquares(FOURS, SIXES), [], 0.0
    for _ in range(800):
        K = read(SIXES, FOURS, c, rng)
        last, total = fit(K), total + K
        z.append(rows @ (last.coefficients.ravel() - c) / last.sd_of(rows))

    mean, bars = plain(total / 800), last.sd_of(rows)
    apart = rows @ (last.coefficients - mean.coefficients).ravel()
    assert (np.abs(apart) < 4 * bars).all()
    assert (bars < 0.4 * NOISE * mean.uncertainty.sd_of(rows)).all()
    assert 0.9 < np.mean(np.abs(z) < 1.96) <= 1
    assert float(last.noise) == pytest.approx(NOISE, rel=0.05)


@pytest.mark.cases("float32")
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_error_bars_of_a_moving_shape_of_the_functions_cover_it(dtype):
    rows, covered, noise = displacement_rows(), [], []
    for seed in range(6):
        shape, rng, fit = (
            Moving(seed),
            np.random.default_rng(seed),
            Tracking(FOURS, SIXES, dtype=dtype),
        )
        for n in range(150):
            scan = (n * 27 + np.arange(27)) % 108
            K, t = scanned(shape, scan, n * 540e-6, rng)
            last = fit.follow(K, t)
            if n > 20:
                off = rows @ (last.coefficients.ravel() - shape(np.nanmax(t)))
                covered.append(np.abs(off) < 1.96 * last.sd_of(rows))
        noise.append(float(last.noise))
    assert 0.92 < np.mean(covered) < 0.985
    np.testing.assert_allclose(noise, NOISE, rtol=0.06)


def test_tracking_a_moving_shape_beats_fitting_each_frame():
    shape, rng, rows = Moving(3), np.random.default_rng(3), displacement_rows()
    fit, plain, errors = Tracking(FOURS, SIXES), LeastSquares(FOURS, SIXES), []
    for n in range(200):
        K, t = scanned(shape, np.arange(108), n * 2.16e-3, rng)
        now = shape(np.nanmax(t))
        answers = fit.follow(K, t), plain(K)
        if n > 20:
            errors.append([rows @ (a.coefficients.ravel() - now) for a in answers])
    tracked, alone = np.sqrt(np.mean(np.square(errors), axis=(0, 2)))
    assert tracked < 0.7 * alone


@pytest.mark.full
def test_readings_at_their_own_times_beat_one_time_for_all():
    errors = []
    for seed in range(3):
        shape, rng, rows = Moving(seed, 0.4), np.random.default_rng(seed), displacement_rows()
        own, together = Tracking(FOURS, SIXES), Tracking(FOURS, SIXES)
        for n in range(120):
            K, t = scanned(shape, np.arange(108), n * 5.4e-3, rng, interval=50e-6)
            now, at_once = shape(np.nanmax(t)), np.full(t.shape, np.nanmax(t))
            answers = own.follow(K, t), together.follow(K, at_once)
            if n > 20:
                errors.append([rows @ (a.coefficients.ravel() - now) for a in answers])
    exact, rough = np.sqrt(np.mean(np.square(errors), axis=(0, 2)))
    assert exact < 0.6 * rough


def test_a_held_reading_is_told_as_it_would_be_now():
    shape, rng = Moving(1, 0.3), np.random.default_rng(1)
    fit, M = Tracking(FOURS, SIXES, sigma=0.01), SIXES.operator(FOURS)
    stale, held = [], []
    last_read = np.full(108, np.nan)
    for n in range(60):
        scan = (n * 27 + np.arange(27)) % 108
        K, t = scanned(shape, scan, n * 540e-6, rng)
        K = np.where(
            np.isnan(t), np.nan, np.vecdot(M, shape(np.nan_to_num(t.ravel()))).reshape(3, -1)
        )
        last_read[scan] = K.ravel()[scan]
        answer = fit.follow(K, t)
        if n > 20:
            now = M @ shape(np.nanmax(t))
            held.append(answer.readings.ravel() - now)
            stale.append(last_read - now)
    assert np.isfinite(held).all()
    assert np.std(held) < 0.2 * np.std(stale)


def test_what_was_never_read_or_long_ago_is_missing_and_the_shape_goes_on():
    rng, c = np.random.default_rng(0), still_shape()
    fit = Tracking(FOURS, SIXES)
    K = read(SIXES, FOURS, c, rng)
    half = np.where(np.arange(108).reshape(3, -1) % 2, K, np.nan)
    none = np.full((3, 36), np.nan)

    first = fit.follow(half, np.where(np.isnan(half), np.nan, 1.0))
    soon = fit.follow(none, np.where(np.isnan(half), np.nan, 1.05))
    failed = fit.follow(half, np.where(np.isnan(half), np.nan, 1.06))
    late = fit.follow(none, np.full((3, 36), 1.3))

    np.testing.assert_array_equal(np.isnan(first.readings), np.isnan(half))
    assert np.isnan(soon.readings).all()  # they were read again, and failed
    np.testing.assert_array_equal(np.isnan(failed.readings), np.isnan(half))
    assert np.isnan(late.readings).all()
    assert np.isfinite(late.coefficients).all()
    assert (late.sd > failed.sd).all()


def test_an_earlier_answer_stays_as_it_was():
    rng, fit, rows = np.random.default_rng(0), Tracking(FOURS, SIXES), displacement_rows()
    K = read(SIXES, FOURS, still_shape(), rng)
    first, twin = fit(K), Tracking(FOURS, SIXES)(K)

    for _ in range(5):
        fit(read(SIXES, FOURS, still_shape(3), rng))

    np.testing.assert_array_equal(first.coefficients, twin.coefficients)
    np.testing.assert_array_equal(first.sd_of(rows), twin.sd_of(rows))
    np.testing.assert_array_equal(first.residual, twin.residual)


def test_several_frames_are_followed_one_after_the_other():
    rng = np.random.default_rng(0)
    frames = np.array([read(SIXES, FOURS, still_shape(), rng) for _ in range(4)])
    frames[1, 0, :5] = np.nan
    one_by_one = Tracking(FOURS, SIXES)

    batch = Tracking(FOURS, SIXES)(frames)

    for n, K in enumerate(frames):
        alone = one_by_one(K)
        np.testing.assert_array_equal(batch.coefficients[n], alone.coefficients)
        np.testing.assert_array_equal(batch.sd[n], alone.sd)
        np.testing.assert_array_equal(batch.readings[n], alone.readings)
        assert (batch.noise[n], batch.spare[n]) == (alone.noise, alone.spare)


# Starts, ends, gaps


def test_a_touch_and_its_end_are_followed_at_once():
    rng, c, rows = np.random.default_rng(0), still_shape(), displacement_rows()
    fit = Tracking(FOURS, SIXES)
    sd = one_frame_sd(rows)

    for shape in [0 * c, c, 0 * c, -2 * c] * 3:
        for n in range(30):
            answer = fit(read(SIXES, FOURS, shape, rng))
            assert np.abs(rows @ (answer.coefficients.ravel() - shape)).max() < 5 * sd, n


def test_with_no_load_there_is_no_shape_and_the_noise_is_found():
    rng, fit, rows = np.random.default_rng(0), Tracking(FOURS, SIXES), displacement_rows()
    z = []
    for n in range(300):
        answer = fit(rng.normal(0, NOISE, (3, 36)))
        if n > 10:
            z.append(rows @ answer.coefficients.ravel() / answer.sd_of(rows))
    assert float(answer.noise) == pytest.approx(NOISE, rel=0.05)
    assert np.mean(np.abs(z) < 1.96) > 0.93


def test_a_device_that_starts_anew_is_followed_anew():
    rng, c = np.random.default_rng(0), still_shape()
    K, t = read(SIXES, FOURS, c, rng), np.full((3, 36), 5.0)
    fit = Tracking(FOURS, SIXES)
    for n in range(5):
        fit.follow(read(SIXES, FOURS, -c, rng), t + n)

    again = fit.follow(K, np.full((3, 36), 0.0))

    np.testing.assert_array_equal(again.coefficients, Tracking(FOURS, SIXES)(K).coefficients)


@pytest.mark.parametrize("gap", [1e-9, 0.1, 10.0, 1e9, 1e300])
def test_after_a_gap_less_is_certain_and_the_next_frame_counts(gap):
    rng, c, rows = np.random.default_rng(0), still_shape(), displacement_rows()
    fit, t = Tracking(FOURS, SIXES), np.full((3, 36), 0.0)
    for n in range(20):
        before = fit.follow(read(SIXES, FOURS, c, rng), t + 6e-3 * n)
    late = t + 6e-3 * 19 + gap

    blind = fit.follow(np.full((3, 36), np.nan), late)
    after = fit.follow(read(SIXES, FOURS, -c, rng), late)

    assert (blind.sd_of(rows) >= before.sd_of(rows) * (1 - 1e-9)).all()
    sd = one_frame_sd(rows)
    assert np.abs(rows @ (after.coefficients.ravel() + c)).max() < 5 * sd


def test_a_frame_that_is_repeated_at_its_time_only_sharpens_the_answer():
    rng, fit = np.random.default_rng(0), Tracking(FOURS, SIXES)
    K, t = read(SIXES, FOURS, still_shape(), rng), np.zeros((3, 36))

    first, again = fit.follow(K, t), fit.follow(K, t)

    assert (again.unit_sd <= first.unit_sd).all()
    assert np.isfinite(again.sd).all()


def test_nothing_is_not_the_end():
    fit, rng = Tracking(FOURS, SIXES), np.random.default_rng(0)

    quiet = [fit(np.zeros((3, 36))) for _ in range(3)]
    touched = [fit(read(SIXES, FOURS, still_shape(), rng)) for _ in range(30)]
    silent = [fit(np.zeros((3, 36))) for _ in range(300)]

    assert all((f.coefficients == 0).all() and f.noise == 0 for f in quiet)
    error = touched[-1].coefficients.ravel() - still_shape()
    assert (np.abs(error) < 5 * touched[-1].sd.ravel()).all()
    assert np.isfinite(silent[-1].sd).all()
    assert np.abs(silent[-1].coefficients).max() < 1e-5


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_readings_without_noise_are_followed_to_rounding(dtype):
    c, rng = still_shape(basis=SineBasis(SQUARE, 8, 8)), np.random.default_rng(0)
    fit = Tracking(SineBasis(SQUARE, 8, 8), SIXES, dtype=dtype)  # 64 functions, 36 elements
    for size in (1.0, 1.0, 1.0, 0.5, 0.5):
        answer = fit(read(SIXES, fit.basis, size * c, rng, 0))

    error = np.abs(answer.coefficients.ravel() - 0.5 * c)
    assert error.max() < 1e-2 * np.abs(c).max()  # where the prior decides
    assert (error < 6 * answer.sd.ravel() + 1e-7 * np.abs(c).max()).all()


# Laws


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_ten_times_the_curvature_is_ten_times_everything(dtype):
    shape, rng = Moving(0), np.random.default_rng(0)
    one, ten = Tracking(FOURS, SIXES, dtype=dtype), Tracking(FOURS, SIXES, dtype=dtype)
    tolerance = 1e-9 if dtype is np.float64 else 2e-2
    for n in range(30):
        K, t = scanned(shape, (n * 27 + np.arange(27)) % 108, n * 540e-6, rng)
        a, b = one.follow(K, t), ten.follow(10 * K, t)
    size = np.abs(a.coefficients).max()
    np.testing.assert_allclose(b.coefficients, 10 * a.coefficients, atol=10 * tolerance * size)
    np.testing.assert_allclose(b.sd, 10 * a.sd, rtol=max(tolerance, 1e-6))
    assert a.coefficients.dtype == dtype


def test_a_sigma_that_was_told_is_the_noise():
    c, rng, rows = still_shape(), np.random.default_rng(0), displacement_rows()
    sigma = np.full((3, 36), NOISE)
    sigma[0] = 10 * NOISE
    fit = Tracking(FOURS, SIXES, sigma)
    for _ in range(100):
        K = read(SIXES, FOURS, c, rng, 0) + rng.normal(0, 1, (3, 36)) * sigma
        answer = fit(K)
    scores = rows @ (answer.coefficients.ravel() - c) / answer.sd_of(rows)
    assert answer.noise == 1
    assert np.sqrt(np.mean(scores**2)) < 2
    assert np.abs(scores).max() < 4


def test_dead_channels_tell_nothing_and_are_never_chosen():
    rng, c = np.random.default_rng(0), still_shape()
    layout = SIXES.without([0, 7, 8, 20])
    K = read(layout, FOURS, c, rng)
    spoilt = np.where(layout.live, K, 1e6)
    fit, clean = Tracking(FOURS, layout), Tracking(FOURS, layout)

    answer = fit(spoilt)

    np.testing.assert_array_equal(answer.coefficients, clean(K).coefficients)
    np.testing.assert_array_equal(np.isnan(answer.readings), ~layout.live)
    chosen = fit.choose(1000, np.array([0.05, 0.05]), 1e-3)
    assert set(chosen.tolist()) == set(np.flatnonzero(layout.live.ravel()).tolist())


def test_more_functions_than_readings_have_wide_error_bars_and_no_refusal():
    basis, rows = SineBasis(SQUARE, 8, 8), displacement_rows(SineBasis(SQUARE, 8, 8))
    layout, rng = SensorLayout.regular(SQUARE, 3, 3), np.random.default_rng(0)
    with pytest.raises(RankDeficient):
        LeastSquares(basis, layout)
    scores = []
    for seed in range(30):
        c = still_shape(seed, basis)
        answer = Tracking(basis, layout)(read(layout, basis, c, rng))
        scores.append(rows @ (answer.coefficients.ravel() - c) / answer.sd_of(rows))
    assert 0.85 < np.mean(np.abs(scores) < 1.96) <= 1


@pytest.mark.full
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_twenty_thousand_steps_leave_the_covariance_definite_and_where_it_was(dtype):
    rng = np.random.default_rng(0)
    A = rng.normal(size=(9, 1, 6)).astype(dtype)  # one reading at a time, in turn
    k, lag = np.linspace(20, 200, 6), np.zeros(1, dtype)
    modes = ModalKalmanFilter(k, dtype)
    modes.expect(1e4, SPEED)
    seen = []
    for n in range(20_001):
        modes.advance(1e-4, 1e4, SPEED)
        modes.absorb(A[n % 9], lag, rng.normal(size=1).astype(dtype))
        if n % 900 == 0 and n:
            S1, _ = modes.halves
            seen.append(np.linalg.svd(S1.astype(float), compute_uv=False))
    tolerance = 1e-9 if dtype is np.float64 else 1e-3
    assert np.min(seen) > 0
    np.testing.assert_allclose(seen[-1], seen[1], rtol=tolerance)


# The next channels


def test_the_readings_chosen_are_those_that_tell_most_eight_by_eight():
    rng = np.random.default_rng(0)
    B, rows, worth = rng.normal(size=(14, 5)), rng.normal(size=(2, 5)), rng.uniform(0.5, 1, 14)
    P = np.cov(rng.normal(size=(5, 20)))

    chosen = most_informative(B, P, rows, worth, 11).tolist()

    left = list(range(14))
    for first in (0, 8):
        some = chosen[first : first + 8]
        told = [worth[j] * np.sum((rows @ P @ B[j]) ** 2) / (1 + B[j] @ P @ B[j]) for j in left]
        assert some == [left[j] for j in np.argsort(told)[::-1][: len(some)]]
        for k in some:  # the textbook's covariance after each reading
            P = P - np.outer(P @ B[k], P @ B[k]) / (1 + B[k] @ P @ B[k])
            left.remove(k)


def test_channels_are_chosen_near_the_contact_and_again_only_once_they_are_old():
    scene = load_scene("centre")
    fit = Tracking(SineBasis(SQUARE, 8, 8), scene.layout)
    frame = Simulator(scene).frame(0, lambda: 0.0)
    fit.follow(scene.sensor().nominal(frame).reshape(3, -1), np.zeros((3, 100)))
    contact = np.array([0.05, 0.05])

    def distance(channels):
        return np.hypot(*(scene.layout.positions[channels % 100] - contact).T)

    first = fit.choose(60, contact, 1e-3)
    anywhere = fit.choose(60, np.full(2, np.nan), 1e-3)

    assert len(set(first.tolist())) == 60
    assert (np.diff(first) > 0).all()
    assert distance(first).mean() < 0.8 * distance(np.arange(300)).mean()
    assert distance(anywhere).mean() > distance(first).mean()
    nothing, times = np.full(300, np.nan), np.full(300, np.nan)
    nothing[first], times[first] = 0.0, 1e-3
    fit.follow(nothing.reshape(3, -1), times.reshape(3, -1))
    assert len(set(fit.choose(60, contact, 1e-6).tolist()) & set(first.tolist())) < 30


def test_channels_can_be_chosen_before_anything_was_read():
    chosen = Tracking(FOURS, SIXES).choose(60, np.full(2, np.nan), 1e-3)

    assert len(set(chosen.tolist())) == 60


# In a pipeline


CIRCLE = replace(load_scene("circle"), transduction=SECOND_GENERATION, rate=1 / 6e-3)
SENSOR = CIRCLE.sensor()


def live(**changes):
    return Pipeline(SENSOR, replace(Setup(nx=9, ny=9, method="tracking"), **changes))


def test_a_pipeline_tracks_and_what_is_passed_over_counts():
    pipeline, other, simulator = live(), live(), Simulator(CIRCLE)
    frames = [simulator.frame(n, lambda: 0.0) for n in range(20)]

    estimates = [pipeline(frame) for frame in frames]
    for frame in frames[:-1]:
        other.pass_over(frame)
    last = other(frames[-1])

    np.testing.assert_array_equal(last.coefficients, estimates[-1].coefficients)
    assert all(e.contact.present for e in estimates)
    assert 1e3 * estimates[-1].error_rms < 0.03
    assert np.isfinite(estimates[-1].residual).all()


def test_another_surface_goes_on_tracking_and_another_basis_starts_anew():
    before, simulator = live(), Simulator(CIRCLE)
    for n in range(20):
        before(simulator.frame(n, lambda: 0.0))
    frame = simulator.frame(20, lambda: 0.0)
    finer, smaller, fresh = live(nx=17), live(Ni=7), live(Ni=7)

    finer.continue_from(before)
    smaller.continue_from(before)

    assert finer.fit is before.fit
    np.testing.assert_array_equal(smaller(frame).coefficients, fresh(frame).coefficients)


# Refusals


@pytest.mark.parametrize("sigma", [None, 0.05])
def test_readings_that_see_nothing_of_the_modes_spoil_nothing(sigma):
    x = np.linspace(0, 0.1, 6)  # on the rim, hinged modes do not bend
    layout = SensorLayout.scattered(SQUARE, np.column_stack([np.tile(x, 6), np.repeat(x, 6)]))
    track, seen = Tracking(FOURS, layout, sigma), layout.operator(FOURS)
    c = 3e-3 * np.eye(16)[0]
    K = (seen @ c + 0.05 * np.random.default_rng(0).normal(size=len(seen))).reshape(3, -1)
    bent = K + 5.0 * (np.abs(seen).max(axis=1) < 1e-6).reshape(3, -1)
    channels, fits = np.arange(K.size).reshape(K.shape), []
    for number in range(4 * K.size):  # one after the other, the corner at x = y = 0 first
        read, frame = channels == number % K.size, K if number < 3 * K.size else bent
        times = np.where(read, 1e-4 * number, np.nan)
        fits.append(track.follow(np.where(read, frame, np.nan), times))

    np.testing.assert_allclose(fits[3 * K.size - 1].coefficients.ravel(), c, atol=0.05 * c[0])
    assert np.isfinite([[fit.coefficients, fit.sd] for fit in (fits[0], fits[-1])]).all()


def test_a_first_frame_without_a_reading_is_refused_plainly():
    with pytest.raises(RankDeficient, match="no readings are left"):
        Tracking(FOURS, SIXES)(np.full((3, 36), np.nan))
    with pytest.raises(RankDeficient, match="no readings are left"):
        Tracking(FOURS, SIXES.without(range(36)))


@pytest.mark.parametrize(
    ("curvature", "times", "match"),
    [
        (np.zeros((3, 35)), np.zeros((3, 35)), r"shape \(3, 36\) or \(T, 3, 36\), got \(3, 35\)"),
        (np.zeros((3, 36)), np.zeros(3), r"shape \(3, 36\), got \(3, 36\) and \(3,\)"),
        (np.zeros((2, 3, 36)), np.zeros((2, 3, 36)), r"shape \(3, 36\), got \(2, 3, 36\)"),
        (np.zeros((3, 36)), np.full((3, 36), np.nan), "a time in s with every reading"),
        (np.zeros((3, 36)), np.full((3, 36), np.inf), "a time in s with every reading"),
    ],
)
def test_readings_without_places_or_times_are_refused(curvature, times, match):
    with pytest.raises(Refusal, match=match):
        Tracking(FOURS, SIXES).follow(curvature, times)
