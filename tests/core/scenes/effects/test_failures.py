"""Failures: dead, stuck and intermittent elements, dropped and corrupted frames."""

import math

import numpy as np
import pytest

from kappaskin import Patch, Refusal, SensorLayout
from kappaskin.scenes.effects import (
    EFFECTS,
    CorruptedFrames,
    DeadElements,
    DroppedFrames,
    IntermittentElements,
    StuckElements,
)

P = 5
FAILING = [DeadElements, StuckElements, IntermittentElements]


def frames(count):
    """(T, 3, P)."""
    return np.random.default_rng(0).uniform(1, 50, (count, 3, P))


def played(effect, curvature, rate=50.0, seed=0):
    running = effect.start(curvature.shape[1:], np.random.default_rng(seed))
    return np.array([running(x, n / rate) for n, x in enumerate(curvature)])


def test_the_failures_are_those_that_an_author_decides_on():
    authored = {name for name, effect in EFFECTS.items() if effect.authored}
    assert authored == {"dead", "stuck", "intermittent", "dropped-frames", "corrupted-frames"}


def test_dead_elements_are_dead_in_the_layout():
    layout = SensorLayout.regular(Patch(0.1, 0.1), 5, 1).without([0])
    assert DeadElements((2,)).of(layout).live.all(axis=0).tolist() == [0, 1, 0, 1, 1]
    with pytest.raises(Refusal, match=r"between 0 and 4, got \[5\]"):
        DeadElements((5,)).of(layout)


def test_stuck_elements_keep_what_they_read_first_from_then_on():
    x = frames(30)

    spoilt = played(StuckElements((1, 4), since=0.19), x)

    np.testing.assert_array_equal(spoilt[:10], x[:10])
    np.testing.assert_array_equal(spoilt[10:, :, [0, 2, 3]], x[10:, :, [0, 2, 3]])
    np.testing.assert_array_equal(spoilt[10:, :, [1, 4]], np.tile(x[10, :, [1, 4]].T, (20, 1, 1)))


def test_intermittent_elements_drop_to_zero_with_all_channels_and_come_back_true():
    x = frames(400)

    spoilt = played(IntermittentElements((1, 4), on=0.1, off=0.1), x)

    np.testing.assert_array_equal(spoilt[:, :, [0, 2, 3]], x[:, :, [0, 2, 3]])
    gone = spoilt == 0
    assert (gone.all(axis=1) == gone.any(axis=1)).all()
    np.testing.assert_array_equal(spoilt[~gone], x[~gone])
    assert (gone[:, 0, 1] != gone[:, 0, 4]).any()


@pytest.mark.parametrize("rate", [20.0, 500.0])
def test_they_are_there_and_away_for_as_long_as_was_told_at_any_rate(rate):
    E, seconds, on, off = 3000, 40.0, 2.0, 0.5
    running = IntermittentElements(tuple(range(E)), on, off).start((3, E), np.random.default_rng(1))
    x, count = np.ones((3, E)), int(seconds * min(rate, 20.0))
    times = np.arange(count) * seconds / count
    there = np.array([running(x, t)[0] for t in times]) > 0

    # Stationary from the first frame on; a pair of frames agrees as the chain's autocovariance.
    share, lag = on / (on + off), seconds / count
    error = math.sqrt(share * (1 - share) / E)
    np.testing.assert_allclose(there.mean(axis=1), share, atol=5 * error)
    both = (there[1:] & there[:-1]).mean()
    expected = share * (share + (1 - share) * math.exp(-lag * (1 / on + 1 / off)))
    assert both == pytest.approx(expected, abs=3e-3)


def test_bursts_last_as_long_as_was_told_when_frames_come_fast():
    E, rate, on, off = 2000, 200.0, 0.5, 0.2
    running = IntermittentElements(tuple(range(E)), on, off).start((3, E), np.random.default_rng(2))
    there = np.array([running(np.ones((3, E)), n / rate)[0] for n in range(2000)]) > 0

    ends = np.count_nonzero(there[1:] & ~there[:-1])
    assert np.count_nonzero(~there) / ends / rate == pytest.approx(off, rel=0.05)
    assert np.count_nonzero(there) / ends / rate == pytest.approx(on, rel=0.05)


def test_a_clock_that_stands_still_or_goes_back_changes_no_element():
    running = IntermittentElements(tuple(range(P)), 1e-3, 1e-3).start(
        (3, P), np.random.default_rng(3)
    )
    first = running(np.ones((3, P)), 1.0)
    for time in (1.0, 0.5, 0.5):
        np.testing.assert_array_equal(running(np.ones((3, P)), time), first)


@pytest.mark.parametrize("kind", FAILING)
@pytest.mark.parametrize("elements", [(1, 1), (-1,), (0.5,), (True,), [1], 3, "12", None])
def test_elements_that_are_none_are_refused(kind, elements):
    with pytest.raises(Refusal, match="a tuple of different elements, counted from 0"):
        kind(elements)


@pytest.mark.parametrize("kind", [StuckElements, IntermittentElements])
def test_elements_that_the_skin_has_not_are_refused(kind):
    with pytest.raises(Refusal, match=rf"{kind.name} with elements from 0 to 4, got \[5, 9\]"):
        kind((1, 5, 9)).start((3, P), np.random.default_rng(0))


# The link


@pytest.mark.parametrize("kind", [DroppedFrames, CorruptedFrames])
def test_a_link_hits_the_share_of_frames_that_was_told(kind):
    hit = kind(0.1).start(np.random.default_rng(4))
    hits = np.array([hit(n) for n in range(20_000)])

    assert hits.mean() == pytest.approx(0.1, abs=5 * math.sqrt(0.09 / 20_000))
    # Each for itself: two in a row as often as by chance.
    assert (hits[1:] & hits[:-1]).mean() == pytest.approx(0.01, abs=5 * math.sqrt(0.01 / 20_000))


def test_a_frame_is_hit_or_not_whenever_it_is_asked_for():
    forth = DroppedFrames(0.3).start(np.random.default_rng(5))
    back = DroppedFrames(0.3).start(np.random.default_rng(5))
    other = DroppedFrames(0.3).start(np.random.default_rng(6))

    numbers = [*range(200), 2**32, 2**40]
    hits = [forth(n) for n in numbers]

    assert [back(n) for n in reversed(numbers)][::-1] == hits
    assert [forth(n) for n in numbers] == hits
    assert [other(n) for n in numbers] != hits


@pytest.mark.parametrize(("share", "expected"), [(0.0, False), (1.0, True)])
def test_none_or_all_of_the_frames_are_hit(share, expected):
    hit = CorruptedFrames(share).start(np.random.default_rng(7))
    assert {hit(n) for n in range(500)} == {expected}
