"""Creep: what a standard linear solid reads, at any pace of frames, and the way back."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from kappaskin import Refusal
from kappaskin.scenes.effects import Creep
from kappaskin.sensing import StandardLinearSolid

SHARE, TAU = 0.2, 3.0
INTERVALS = st.lists(st.floats(0, 20), min_size=1, max_size=30)


def read(path, times, share=SHARE, tau=TAU):
    """What one channel reads (T,) on the way `path` (T,) in 1/m at `times` (T,) in s."""
    running = Creep(share, tau).start((1,), np.random.default_rng(0))
    return np.array(
        [running(np.array([float(x)]), float(t))[0] for x, t in zip(path, times, strict=True)]
    )


def test_a_held_curvature_relaxes_to_the_share_that_stays():
    t = np.linspace(0, 30, 301)
    expected = 50 * (1 - SHARE * (1 - np.exp(-t / TAU)))
    np.testing.assert_allclose(read(np.full(301, 50.0), t), expected, rtol=1e-12)
    assert read(np.full(2, 50.0), [0.0, 1e9])[-1] == pytest.approx(40.0)


@given(INTERVALS)
def test_a_held_curvature_reads_alike_whatever_the_frame_interval(intervals):
    t = np.cumsum([0.0, *intervals])
    expected = 50 * (1 - SHARE * (1 - np.exp(-t / TAU)))
    np.testing.assert_allclose(read(np.full(len(t), 50.0), t), expected, rtol=1e-12)


@given(INTERVALS, st.integers(2, 9))
def test_a_straight_way_reads_alike_whatever_the_frame_interval(intervals, finer):
    t = np.cumsum([0.0, *intervals])
    x = 10 * np.sin(np.arange(len(t)))
    at = np.arange((len(t) - 1) * finer + 1) / finer
    close = (np.interp(at, np.arange(len(t)), both) for both in (x, t))
    np.testing.assert_allclose(read(*close)[::finer], read(x, t), atol=1e-11)


def test_an_integrator_of_differential_equations_agrees():
    rng = np.random.default_rng(4)
    t = np.cumsum(rng.uniform(0.001, 2, 40)) - 0.5
    x = rng.uniform(-80, 80, 40)
    solved = solve_ivp(
        lambda time, s: (np.interp(time, t, x) - s) / TAU, (t[0], t[-1]), [0.0], t_eval=t,
        rtol=1e-9, atol=1e-9, max_step=0.05,
    )  # fmt: skip
    np.testing.assert_allclose(read(x, t), x - SHARE * solved.y[0], atol=1e-5)


@given(
    INTERVALS,
    st.lists(st.floats(0, 0.95), min_size=3, max_size=3),
    st.floats(1e-3, 1e4),
    st.integers(0, 2**32 - 1),
)
def test_the_inverse_gives_any_curvature_back(intervals, shares, tau, seed):
    solid = StandardLinearSolid(np.array(shares), tau)
    relaxing, restoring = solid.start(), solid.start_inverse()
    rng = np.random.default_rng(seed)
    time = 0.0
    for elapsed in intervals:
        time += elapsed
        x = rng.uniform(-80, 80, 3)
        np.testing.assert_allclose(restoring(relaxing(x, time), time), x, atol=1e-10)


def test_a_clock_that_goes_back_or_stands_still_tells_of_no_time():
    relaxing = StandardLinearSolid(np.array([SHARE]), TAU).start()
    x = np.array([50.0])
    before = relaxing(x, 0.0)
    relaxed = relaxing(x, 1.0)

    assert relaxing(x, 1.0) == relaxed
    assert relaxing(x, 0.2) == relaxed
    np.testing.assert_allclose(relaxing(x, 1.2), 50 * (1 - SHARE * (1 - np.exp(-2 / TAU))))
    assert relaxed < before == 50.0


def test_short_frames_lose_no_digits():
    t = np.arange(20_000) * 1e-4  # 2 s at 10,000 frames/s, with a time constant of an hour
    slow = read(np.full(len(t), 50.0), t, tau=3600.0)
    np.testing.assert_allclose(50 - slow, 50 * SHARE * -np.expm1(-t / 3600), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("share", [-0.1, 1.0, math.nan, math.inf])
def test_a_share_that_is_none_is_refused(share):
    with pytest.raises(Refusal, match="shares"):
        Creep(share, 1.0)


@pytest.mark.parametrize("tau", [0.0, -1.0, math.nan, math.inf])
def test_a_time_constant_that_is_none_is_refused(tau):
    with pytest.raises(Refusal, match="time constant above zero"):
        Creep(0.1, tau)
