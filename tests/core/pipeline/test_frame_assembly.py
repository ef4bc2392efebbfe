"""Readings of channels that a frame leaves out: held for a while, then missing, never invented."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Frame, Pipeline, Refusal, Setup, Simulator, load_scene
from kappaskin.pipeline.pipeline import FrameAssembly

P = 4
EVERY = np.arange(3 * P)


def frame_at(time, channels=EVERY):
    channels = np.asarray(channels, np.intp)
    return Frame(0, time, 0.0, channels, np.zeros(len(channels), np.int32))


def seen(frame, value):
    """Curvature (3, P) of a frame whose readings are all `value`."""
    flat = np.full(3 * P, np.nan)
    flat[frame.channels] = value
    return flat.reshape(3, P)


def taken(hold, time, channels, value):
    frame = frame_at(time, channels)
    curvature, fresh = hold(frame, seen(frame, value))
    return curvature.ravel(), fresh.ravel()


def test_a_channel_left_out_keeps_its_last_reading():
    hold = FrameAssembly(3 * P, 0.1)
    taken(hold, 0.0, EVERY, 1.0)
    taken(hold, 0.01, [2, 3], 2.0)

    curvature, fresh = taken(hold, 0.02, [3, 7], 3.0)

    assert curvature.tolist() == [1, 1, 2, 3, 1, 1, 1, 3, 1, 1, 1, 1]
    assert np.flatnonzero(fresh).tolist() == [3, 7]


def test_a_reading_as_old_as_the_limit_is_missing():
    hold = FrameAssembly(3 * P, 0.1)
    taken(hold, 1.0, EVERY, 1.0)

    young, _ = taken(hold, 1.0999, [0], 2.0)
    old, fresh = taken(hold, 1.1001, [0], 2.0)

    assert np.isfinite(young).all()
    assert np.flatnonzero(np.isfinite(old)).tolist() == [0]
    assert np.flatnonzero(fresh).tolist() == [0]


def test_what_was_never_scanned_is_missing():
    curvature, fresh = taken(FrameAssembly(3 * P, 0.1), 0.0, [5], 1.0)

    assert np.flatnonzero(np.isfinite(curvature)).tolist() == [5]
    assert fresh.sum() == 1


def test_a_limit_of_zero_holds_nothing_even_at_one_and_the_same_time():
    hold = FrameAssembly(3 * P, 0.0)
    taken(hold, 0.0, EVERY, 1.0)

    curvature, _ = taken(hold, 0.0, [1], 2.0)

    assert np.flatnonzero(np.isfinite(curvature)).tolist() == [1]


def test_a_reading_on_a_rail_is_not_covered_by_the_last_good_one():
    hold = FrameAssembly(3 * P, 0.1)
    taken(hold, 0.0, EVERY, 1.0)

    railed, fresh = taken(hold, 0.01, [4, 5], np.nan)
    after, _ = taken(hold, 0.02, [0], 1.0)

    assert np.flatnonzero(np.isnan(railed)).tolist() == [4, 5]
    assert not fresh.any()
    assert np.flatnonzero(np.isnan(after)).tolist() == [4, 5]  # the rail is what was read last


def test_a_device_that_restarted_holds_nothing_from_before():
    hold = FrameAssembly(3 * P, 0.1)
    taken(hold, 50.0, EVERY, 1.0)

    curvature, _ = taken(hold, 0.0, [1, 2], 2.0)
    on, _ = taken(hold, 0.01, [3], 3.0)

    assert np.flatnonzero(np.isfinite(curvature)).tolist() == [1, 2]
    assert np.flatnonzero(np.isfinite(on)).tolist() == [1, 2, 3]


def test_what_is_from_before_a_restart_is_not_held_when_the_clock_comes_there_again():
    hold = FrameAssembly(3 * P, 0.1)
    taken(hold, 50.0, EVERY, 1.0)
    for time in (0.0, 49.99, 50.01):
        curvature, _ = taken(hold, time, [1, 2], 2.0)

    assert np.flatnonzero(np.isfinite(curvature)).tolist() == [1, 2]


def test_a_channel_that_a_device_sends_twice_is_taken_once():
    curvature, fresh = taken(FrameAssembly(3 * P, 0.1), 0.0, [5, 5, 6], 1.0)

    assert np.flatnonzero(np.isfinite(curvature)).tolist() == [5, 6]
    assert fresh.sum() == 2


def test_an_empty_frame_brings_nothing_and_shows_what_is_held():
    hold = FrameAssembly(3 * P, 0.1)
    taken(hold, 0.0, EVERY, 1.0)

    curvature, fresh = taken(hold, 0.05, [], 0.0)

    assert (curvature == 1).all()
    assert not fresh.any()


def test_a_whole_frame_passes_unchanged_and_is_not_written_to_later():
    hold = FrameAssembly(3 * P, 0.1)
    curvature, fresh = taken(hold, 0.0, EVERY, 1.0)
    taken(hold, 0.01, EVERY, 2.0)

    assert (curvature == 1).all()
    assert fresh.all()


@given(
    st.lists(
        st.tuples(st.floats(-0.05, 0.08), st.sets(st.integers(0, 3 * P - 1))),
        min_size=1,
        max_size=12,
    )
)
def test_every_value_is_the_last_one_scanned_and_younger_than_the_limit(steps):
    hold, last, time = FrameAssembly(3 * P, 0.1), {}, 1.0
    for value, (step, channels) in enumerate(steps):
        time += step
        curvature, fresh = taken(hold, time, sorted(channels), float(value))
        last |= dict.fromkeys(channels, (time, float(value)))
        for channel in range(3 * P):
            when, expected = last.get(channel, (-math.inf, math.nan))
            there = channel in channels or 0 <= time - when < 0.1
            assert fresh[channel] == (channel in channels)
            np.testing.assert_equal(curvature[channel], expected if there else math.nan)


@pytest.mark.parametrize("age", [-1e-3, math.nan, math.inf])
def test_an_impossible_age_is_refused(age):
    with pytest.raises(Refusal, match=f"held for at least 0 s, got {age}"):
        FrameAssembly(12, age)


# In the pipeline

SCENE = load_scene("off-centre")
FRAME = Simulator(SCENE).frame(0, lambda: 0.0)


def only_these(channels, time):
    return replace(FRAME, channels=channels, counts=FRAME.counts[channels], device_time=time)


def test_a_partial_frame_after_a_whole_one_is_answered_like_the_whole():
    pipeline = Pipeline(SCENE.sensor(), Setup(nx=9, ny=9))
    whole = pipeline(FRAME)

    part = pipeline(only_these(np.arange(30, 60), 0.05))

    np.testing.assert_array_equal(part.curvature, whole.curvature)
    np.testing.assert_array_equal(part.surface, whole.surface)
    assert whole.fresh.all()
    assert np.flatnonzero(part.fresh.ravel()).tolist() == list(range(30, 60))


def test_a_frame_whose_hold_has_expired_is_answered_as_if_nothing_was_held():
    channels = np.random.default_rng(0).permutation(300)[:200]
    used, new = (Pipeline(SCENE.sensor(), Setup(nx=9, ny=9)) for _ in range(2))
    used(FRAME)

    expired, alone = (pipeline(only_these(channels, 0.2)) for pipeline in (used, new))

    np.testing.assert_array_equal(expired.curvature, alone.curvature)
    np.testing.assert_array_equal(expired.surface, alone.surface)
    np.testing.assert_array_equal(expired.contact.position, alone.contact.position)


def test_patterns_of_missing_readings_that_change_each_frame_stay_exact():
    pipeline, rng = Pipeline(SCENE.sensor(), Setup(nx=9, ny=9, hold=0)), np.random.default_rng(1)
    M = pipeline.fit.M
    for n in range(25):  # more than any that are remembered
        channels = np.sort(rng.permutation(300)[: rng.integers(120, 290)])
        estimate = pipeline(only_these(channels, 0.01 * n))
        c = np.linalg.lstsq(M[channels], estimate.curvature.ravel()[channels])[0]
        np.testing.assert_allclose(
            estimate.coefficients.ravel(), c, rtol=0, atol=1e-8 * np.abs(c).max()
        )


def test_readings_that_hardly_decide_the_shape_give_none():
    # All elements within 35 mm of a point aside: full rank, but 8000 times the error bars.
    near = np.flatnonzero(np.hypot(*(SCENE.layout.positions - [0.03, 0.035]).T) <= 0.035)
    channels = (np.arange(3)[:, None] * 100 + near).ravel()
    pipeline = Pipeline(SCENE.sensor(), Setup(nx=9, ny=9))

    estimate = pipeline(only_these(channels, 0.0))

    assert len(channels) > 64
    assert np.linalg.matrix_rank(pipeline.fit.M[channels]) == 64
    assert np.isnan(estimate.surface).all()
    assert not estimate.contact.present


def test_a_frame_passed_over_is_held_all_the_same():
    pipeline = Pipeline(SCENE.sensor(), Setup(nx=9, ny=9))
    pipeline.pass_over(FRAME)

    estimate = pipeline(only_these(np.arange(10), 0.01))

    assert np.isfinite(estimate.curvature).all()
    assert estimate.fresh.sum() == 10


@pytest.mark.parametrize("method", ["least-squares", "tracking"])
def test_frames_passed_over_are_held_in_their_order_whole_or_not(method):
    setup = Setup(nx=9, ny=9, method=method)
    passing, computing = Pipeline(SCENE.sensor(), setup), Pipeline(SCENE.sensor(), setup)
    rng = np.random.default_rng(2)
    for n in range(40):
        few = rng.permutation(300)[: rng.integers(1, 301) if n % 5 else 300]
        frame = replace(only_these(few, 1e-3 * n), counts=rng.integers(-900, 900, len(few), "i4"))
        wanted = computing(frame)
        if rng.random() < 0.8:
            passing.pass_over(frame)
        else:
            assert np.array_equal(passing(frame).curvature, wanted.curvature, equal_nan=True)


def test_dead_channels_are_never_fresh():
    scene = replace(SCENE, layout=SCENE.layout.without([7]))

    estimate = Pipeline(scene.sensor(), Setup(nx=9, ny=9))(FRAME)

    assert not estimate.fresh[:, 7].any()
    assert estimate.fresh.sum() == 297


@pytest.mark.parametrize("hold", [-0.1, math.nan])
def test_a_setup_with_an_impossible_hold_is_refused(hold):
    with pytest.raises(Refusal, match="held for at least 0 s"):
        Pipeline(SCENE.sensor(), Setup(hold=hold))
