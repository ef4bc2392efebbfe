"""The tracking estimator: a textbook's answers, memory, honest error bars, no end to it."""

import math

import numpy as np
import pytest
from scipy import linalg

from kappaskin import Patch
from kappaskin.fit.kalman import MovingModes

SQUARE = Patch(0.1, 0.1)


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
    modes = MovingModes(K_MODES, dtype)
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
    modes = MovingModes(K_MODES, np.float64)
    modes.expect(AMPLITUDE, SPEED)

    learned = modes.absorb(A[0], np.zeros(4), y[0])

    def log_likelihood(log_scale, variance):
        V = variance * (np.eye(4) + math.exp(log_scale) * AMPLITUDE**2 * A[0] @ A[0].T)
        return -(y[0] @ np.linalg.solve(V, y[0]) + np.linalg.slogdet(V)[1]) / 2

    for variance in (1.0, 4.0):
        slope = (log_likelihood(1e-5, variance) - log_likelihood(-1e-5, variance)) / 2e-5
        assert learned.score(variance) == pytest.approx(slope, rel=1e-6)
