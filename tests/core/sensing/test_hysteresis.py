"""Hysteresis: the laws of plays, the inverse, and the loops of the two prototypes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Refusal
from kappaskin.scenes.effects import FIRST_GENERATION_LOOPS, SECOND_GENERATION_LOOPS, Hysteresis
from kappaskin.sensing import PrandtlIshlinskii

CURVATURES = st.lists(st.floats(-90, 90), min_size=1, max_size=40)


@st.composite
def operators(draw, channels=2):
    """Any operator: rising thresholds, weights from none to most of the slope, any stretch."""
    J = draw(st.integers(1, 5))
    steps = draw(st.lists(st.floats(0.05, 20), min_size=J * channels, max_size=J * channels))
    p = draw(st.lists(st.floats(0, 2), min_size=J * channels, max_size=J * channels))
    q = draw(st.lists(st.floats(0.2, 2), min_size=channels, max_size=channels))
    a = draw(st.lists(st.floats(0.25, 4), min_size=channels, max_size=channels))
    r = np.cumsum(np.reshape(steps, (J, channels)), axis=0)
    return PrandtlIshlinskii(r, np.reshape(p, (J, channels)), np.array(q), np.array(a))


def read(operator, path):
    """What both channels read (T, 2) on the way `path` (T,) from rest."""
    plays = operator.start()
    return np.array([plays(np.full(2, float(x))) for x in path])


def by_hand(thresholds, weights, asymmetry, path):
    """The definition, play by play in plain numbers; no code of the library."""
    w = [0.0] * len(thresholds)
    out = []
    for x in path:
        u = x / asymmetry if x > 0 else x
        for j, r in enumerate(thresholds):
            if u - w[j] > r:
                w[j] = u - r
            if w[j] - u > r:
                w[j] = u + r
        z = (1 - sum(weights)) * u + sum(p * v for p, v in zip(weights, w, strict=True))
        out.append(z * asymmetry if z > 0 else z)
    return out


def swept(most, count=801):
    """From rest to `most`, back, to minus it and back, (4, count)."""
    up = np.linspace(0, most, count)
    return np.array([up, up[::-1], -up, -up[::-1]])


def gaps(hysteresis, most):
    """Widest difference between the ways on positive and on negative curvature, once swept."""
    running = hysteresis.start((1,), np.random.default_rng(0))
    way = np.concatenate([swept(most), swept(most)]).ravel()
    read = np.array([running(np.array([x]), 0.0)[0] for x in way]).reshape(8, -1)
    there, back, down, up = read[4:]
    outside = swept(most)[0] > 10  # of where the loop crosses from one side to the other
    return np.abs(back[::-1] - there).max(), np.abs(up[::-1] - down)[outside].max()


@given(operators(), CURVATURES)
def test_the_inverse_gives_any_curvature_back(operator, path):
    found = read_both(operator, operator.inverse, path)
    scale = 1 + np.abs(path).max()
    np.testing.assert_allclose(found, np.column_stack([path, path]), atol=1e-11 * scale)


@given(operators(), CURVATURES)
def test_the_operator_gives_back_what_its_inverse_was_given(operator, path):
    found = read_both(operator.inverse, operator, path)
    scale = 1 + np.abs(path).max() * 100
    np.testing.assert_allclose(found, np.column_stack([path, path]), atol=1e-11 * scale)


def read_both(first, second, path):
    one, two = first.start(), second.start()
    return np.array([two(one(np.full(2, float(x)))) for x in path])


@given(operators(), CURVATURES)
def test_the_inverse_of_the_inverse_is_the_operator(operator, path):
    scale = 1 + np.abs(path).max() * 100
    np.testing.assert_allclose(
        read(operator.inverse.inverse, path), read(operator, path), atol=1e-9 * scale
    )


@given(operators(), CURVATURES, st.integers(2, 7))
def test_only_the_way_counts_and_not_its_pace(operator, path, finer):
    nodes = np.concatenate([[0.0], path])
    at = np.arange(len(nodes) * finer - finer + 1) / finer
    slow = np.interp(at, np.arange(len(nodes)), nodes)
    np.testing.assert_allclose(
        read(operator, slow)[finer::finer], read(operator, path), atol=1e-9 * 200
    )


@given(operators(), st.lists(st.floats(-50, 50), min_size=1, max_size=20), st.floats(-49, 49))
def test_a_larger_swing_wipes_out_what_smaller_ones_left(operator, small, last):
    swing = [60.0, -60.0, 60.0, last]
    np.testing.assert_allclose(
        read(operator, [*small, *swing])[-1], read(operator, swing)[-1], atol=1e-9
    )


@given(operators(), CURVATURES, st.lists(st.floats(0, 30), min_size=40, max_size=40))
def test_more_curvature_never_reads_less(operator, path, more):
    higher = np.array(path) + more[: len(path)]
    assert (read(operator, higher) - read(operator, path) >= -1e-9).all()


@given(operators(), st.lists(st.floats(20, 60), min_size=1, max_size=10))
def test_loops_between_the_same_ends_are_alike_wherever_they_came_from(operator, before):
    loop = [20.0, 60.0, 45.0, 31.0, 20.0]
    lower, higher = read(operator, [0.0, *loop]), read(operator, [*before, 90.0, *loop])
    np.testing.assert_allclose(np.diff(lower[-4:], axis=0), np.diff(higher[-4:], axis=0), atol=1e-9)


@given(CURVATURES, st.floats(0.3, 3.0))
def test_it_is_what_the_definition_says(path, asymmetry):
    thresholds, weights = (1.5, 4.0, 13.0), (0.1, 0.05, 0.2)
    hysteresis = Hysteresis(thresholds, weights, asymmetry)
    running = hysteresis.start((1,), np.random.default_rng(0))
    np.testing.assert_allclose(
        [running(np.array([x]), 0.0)[0] for x in path],
        by_hand(thresholds, weights, asymmetry, path),
        atol=1e-12 * 90,
    )


def test_one_play_makes_a_loop_of_twice_its_weighted_threshold():
    there, back, down, up = swept(50)
    one = Hysteresis((6.0,), (0.25,))
    running = one.start((1,), np.random.default_rng(0))
    y = [running(np.array([x]), 0.0)[0] for x in np.concatenate([there, back, down, up, there])]
    again, back_again = np.array(y[-801:]), np.array(y[801:1602])[::-1]

    middle = (there > 6) & (there < 38)
    np.testing.assert_allclose((back_again - again)[middle], 2 * 0.25 * 6.0)


def test_the_slope_of_a_long_way_is_one_on_both_sides():
    running = SECOND_GENERATION_LOOPS.start((1,), np.random.default_rng(0))
    y = [running(np.array([x]), 0.0)[0] for x in (0.0, 50.0, 60.0, -60.0, -70.0)]
    assert [y[2] - y[1], y[4] - y[3]] == pytest.approx([10.0, -10.0])


def test_the_second_prototypes_loop_is_7_wide_on_positive_curvature_and_less_on_negative():
    positive, negative = gaps(SECOND_GENERATION_LOOPS, 80.0)
    assert positive == pytest.approx(7.0, abs=0.01)
    assert negative == pytest.approx(7.0 / 1.6, abs=0.01)


def test_the_first_prototypes_loops_are_three_times_wider():
    np.testing.assert_allclose(
        gaps(FIRST_GENERATION_LOOPS, 80.0), 3 * np.array(gaps(SECOND_GENERATION_LOOPS, 80.0))
    )


def test_without_weights_nothing_is_changed():
    way = swept(80.0, 50).ravel()
    running = Hysteresis((5.0,), (0.0,)).start((50 * 4,), np.random.default_rng(0))
    np.testing.assert_array_equal(running(way, 0.0), way)
    np.testing.assert_array_equal(Hysteresis((), ()).start((200,), None)(way, 0.0), way)


def test_thirty_thousand_frames_leave_no_drift():
    operator = FIRST_GENERATION_LOOPS.operator(2)
    rng = np.random.default_rng(3)
    path = 60 * np.sin(np.cumsum(rng.normal(0, 0.3, 30_000)))
    found = read_both(operator, operator.inverse, path)
    assert np.abs(found[-100:, 0] - path[-100:]).max() < 1e-12


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (((1.0, 2.0), (0.1,)), "one weight of at least 0 for each threshold, got 1 for 2"),
        (((1.0,), (-0.1,)), "one weight of at least 0"),
        (((1.0,), (math.nan,)), "one weight of at least 0"),
        (((1.0, 2.0), (0.5, 0.5)), "sum is below 1, got 1"),
        (((2.0, 1.0), (0.1, 0.1)), "increasing thresholds above zero"),
        (((0.0,), (0.1,)), "increasing thresholds above zero"),
        (((math.inf,), (0.1,)), "expected finite thresholds"),
        (((1.0,), (0.1,), 0.0), "the reading always increases"),
        (((1.0,), (0.1,), -1.0), "the reading always increases"),
        (((1.0,), (0.1,), math.nan), "expected finite"),
    ],
)
def test_loops_that_are_none_are_refused(arguments, reason):
    with pytest.raises(Refusal, match=reason):
        Hysteresis(*arguments)


def test_an_operator_of_mixed_shapes_or_that_falls_is_refused():
    one = np.ones((1, 3))
    with pytest.raises(Refusal, match=r"got shapes \(1, 3\), \(1, 3\), \(2,\), \(3,\)"):
        PrandtlIshlinskii(one, one, np.ones(2), np.ones(3))
    with pytest.raises(Refusal, match="the reading always increases"):
        PrandtlIshlinskii(one, -one, np.ones(3), np.ones(3))
