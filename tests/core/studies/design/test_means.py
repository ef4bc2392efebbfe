"""Blocks of a study to means, and how far they may be out."""

import math
import pickle

import numpy as np
import pytest
from scipy import stats

from kappaskin import Refusal
from kappaskin.studies.design.results import Mean, Moments, PointResults


@pytest.mark.parametrize("large", [np.inf, 1e200])
def test_an_infinite_error_is_a_failure_not_a_number(large):
    with pytest.raises(Refusal, match="the arithmetic overflowed"):
        Moments.of(np.array([1.0, large]))


def test_means_of_blocks_are_those_of_all_their_frames():
    rng = np.random.default_rng(0)
    values = [rng.normal(3.0, 1.0, count) for count in (5, 9, 9, 2)]

    found = Mean.of([Moments.of(part) for part in values])

    every = np.concatenate(values)
    np.testing.assert_allclose([found.mean, found.sd], [every.mean(), every.std(ddof=1)])
    assert found.count == 25


def test_the_interval_of_equal_blocks_is_students_of_their_means():
    blocks = np.random.default_rng(0).normal(3.0, 1.0, (6, 4))

    found = Mean.of([Moments.of(block) for block in blocks])

    interval = stats.ttest_1samp(blocks.mean(axis=1), 0.0).confidence_interval(0.95)
    np.testing.assert_allclose([found.mean - found.half, found.mean + found.half], interval)


def test_the_order_in_which_blocks_come_changes_no_bit(study_of):
    study = study_of("", ("least = 2\nmost = 4", "least = 50\nmost = 50"))
    means = np.random.default_rng(0).normal(3.0, 1.0, 50).tolist()
    upward, downward = (PointResults(next(study.points()), study) for _ in range(2))

    for block, mean in enumerate(means):
        upward.take(block, {"rms": Moments(1, mean, 0.0)})
    for block, mean in reversed(list(enumerate(means))):
        downward.take(block, {"rms": Moments(1, mean, 0.0)})

    assert upward.mean("rms") == downward.mean("rms")


def test_what_is_held_of_a_point_does_not_grow_with_its_blocks(study_of):
    def held(blocks):
        study = study_of("", ("least = 2\nmost = 4", f"least = {blocks}\nmost = {blocks}"))
        known = PointResults(next(study.points()), study)
        for block in range(blocks):
            known.take(block, {"rms": Moments(1, float(block), 0.0)})
        known.study = None  # the same for all points
        return len(pickle.dumps(known))

    assert held(500) <= held(5) + 20


def test_frames_that_tell_nothing_are_left_out():
    assert Moments.of(np.array([1.0, np.nan, 3.0])) == Moments(2, 2.0, 2.0)
    nothing = Mean.of([Moments.of(np.full(3, np.nan))])
    assert nothing.count == 0
    assert math.isnan(nothing.mean)


def test_all_of_eight_blocks_are_not_all_there_are():
    alike = [Moments.of(np.ones(10))] * 8

    found = Mean.of(alike, share=True)

    # With the share at its end, eight blocks are all alike once in twenty times.
    lowest = stats.binomtest(8, 8, alternative="greater").proportion_ci(0.95).low
    assert found.half == pytest.approx(1 - lowest)
    assert Mean.of(alike).half == 0.0


def test_intervals_hold_the_mean_as_often_as_they_promise():
    rng = np.random.default_rng(0)

    def holds():
        # Blocks that differ from each other more than their frames do: another skin for each.
        blocks = rng.normal(1.0, 1.0, (8, 1)) + rng.normal(0.0, 0.3, (8, 10))
        mean = Mean.of([Moments.of(block) for block in blocks])
        return abs(mean.mean - 1.0) < mean.half

    held = np.mean([holds() for _ in range(800)])

    assert abs(held - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 800)
