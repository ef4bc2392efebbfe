"""What an operator wants, by messages and within limits: laws that hold whatever comes."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kappaskin import Refusal
from kappaskin.hand import (
    HandTarget,
    OperatorLimits,
    TargetFilter,
    TargetMessage,
    TargetReceiver,
    placement,
)
from kappaskin.hand.operation import decoded

LIMITS = OperatorLimits()
numbers = st.floats(-1e6, 1e6)
triples = st.tuples(numbers, numbers, numbers)
angles = st.tuples(*[st.floats(-7, 7) | st.sampled_from([math.pi / 2, -math.pi / 2, math.pi])] * 3)
targets = st.builds(HandTarget, triples, angles, numbers, numbers)
positive = st.floats(1e-3, 10)
limits = st.builds(OperatorLimits, positive, positive, positive, st.tuples(*[positive] * 3))


def rotation(target: HandTarget) -> Rotation:
    return Rotation.from_euler("xyz", target.rotation)


# Limits


@given(
    limits,
    st.lists(st.tuples(st.none() | targets, st.floats(-0.1, 3.0)), min_size=1, max_size=30),
)
@settings(deadline=None)
def test_no_target_ever_exceeds_the_limits(within: OperatorLimits, asked) -> None:
    follower, now = TargetFilter(within, HandTarget()), 0.0
    for wanted, later in asked:
        was, before, now = follower.target, now, now + later
        target = follower.follow(wanted, now)
        seconds = max(now - before, 0.0)  # as the clock has it, whose digits are limited
        assert math.dist(was.position, target.position) <= within.speed * seconds * (1 + 1e-9)
        turn = (rotation(target) * rotation(was).inv()).magnitude()
        assert turn <= within.turn_rate * seconds + 1e-7
        assert all(
            abs(at) <= most * (1 + 1e-12)
            for at, most in zip(target.position, within.reach, strict=True)
        )
        assert 0 <= target.grip <= within.grip
        if wanted is None:
            assert (target.position, target.rotation) == (was.position, was.rotation)


@given(limits, targets)
@settings(deadline=None)
def test_a_target_that_stays_is_reached_as_near_as_the_workspace_allows(within, wanted) -> None:
    follower = TargetFilter(within, HandTarget())
    longest = max(2 * math.hypot(*within.reach) / within.speed, math.pi / within.turn_rate)
    step = 0.05
    if longest / step > 2000:
        within = OperatorLimits(10.0, 10.0, within.grip, within.reach)
        follower.limits = within
    for number in range(2200):
        follower.follow(wanted, step * (number + 1))
    nearest = within.nearest(wanted)
    assert follower.target.position == nearest.position
    assert follower.target.grip == nearest.grip
    assert (rotation(follower.target) * rotation(wanted).inv()).magnitude() < 1e-6


def test_a_pause_allows_no_jump() -> None:
    follower = TargetFilter(LIMITS, HandTarget())
    follower.follow(HandTarget((0.05, 0.0, 0.0)), 1000.0)
    assert follower.target.position[0] == pytest.approx(LIMITS.speed * 0.05)


def test_a_smaller_workspace_is_entered_at_the_speed_allowed_and_a_smaller_grip_at_once() -> None:
    follower = TargetFilter(LIMITS, HandTarget((0.05, 0.0, 0.0), grip=3.0))
    follower.limits = OperatorLimits(grip=1.0, reach=(0.01, 0.01, 0.01))
    assert follower.follow(None, 0.05) == HandTarget((0.05, 0.0, 0.0), grip=1.0, time=0.05)
    follower.follow(HandTarget(), 0.1)
    assert follower.target.position[0] == pytest.approx(0.05 - LIMITS.speed * 0.05)


@pytest.mark.parametrize(
    "wrong",
    [{"speed": 0.0}, {"turn_rate": -1.0}, {"grip": math.nan}, {"reach": (0.1, math.inf, 0.1)}],
)
def test_limits_are_above_nothing(wrong) -> None:
    with pytest.raises(Refusal, match="above 0"):
        OperatorLimits(**wrong)


@given(angles, st.tuples(*[st.floats(-3, 3)] * 3))
def test_a_target_turns_about_axes_that_are_fixed_at_home(three, turn) -> None:
    target = HandTarget((0.01, 0.0, 0.0), three, 1.0).moved((0.0, 0.02, 0.0), turn, 0.5)
    origin = 0.0, 0.0, 0.0
    expected = Rotation.from_rotvec(turn).as_matrix() @ placement(origin, three).rotation
    np.testing.assert_allclose(placement(origin, target.rotation).rotation, expected, atol=3e-7)
    assert (target.position, target.grip) == ((0.01, 0.02, 0.0), 1.5)


# Messages


def message(sequence: int = 0, time: float = 0.0, **changed) -> bytes:
    target = HandTarget((0.01, 0.02, -0.03), (0.1, 0.2, 0.3), 2.0, time)
    made = json.loads(TargetMessage(target, True, 7, sequence).encoded()) | changed
    return json.dumps(made).encode()


@given(triples, st.tuples(*[st.floats(-1e3, 1e3)] * 3), numbers, numbers, st.booleans())
def test_a_message_comes_back_as_it_was(position, turned, grip, time, enabled) -> None:
    sent = TargetMessage(HandTarget(position, turned, grip, time), enabled, 3, 12)
    assert decoded(sent.encoded()) == sent


def test_the_message_is_the_documented_one() -> None:
    sent = TargetMessage(HandTarget((0.01, 0.0, -0.02), (0.0, 0.1, 0.0), 1.5, 12.25), True, 7, 42)
    assert sent.encoded() == (
        b'{"kind":"hand_target","version":1,"session":7,"sequence":42,"time_s":12.25,'
        b'"enabled":true,"position_m":[0.01,0.0,-0.02],"rotation_rad":[0.0,0.1,0.0],"grip_N":1.5}'
    )


WRONG = [
    b"",
    b"\xff\xfe",
    b"[1, 2]",
    b"[" * 5000,
    b"[" * 1500,
    message(kind="contact"),
    message(version=2),
    message(enabled=1),
    message(enabled=None),
    message(position_m=[0.0, 0.0]),
    message(position_m=[0.0, 0.0, 0.0, 0.0]),
    message(position_m={"x": 0.0}),
    message(position_m=[0.0, 0.0, True]),
    message(position_m=[0.0, 0.0, math.nan]),
    message(rotation_rad=[math.inf, 0.0, 0.0]),
    message(rotation_rad=[1e4, 0.0, 0.0]),
    message(grip_N="2"),
    message(grip_N=None),
    message(grip_N=10**400),
    message(time_s=math.nan),
    message(sequence=-1),
    message(sequence=1.5),
    message(session=None),
    message(position_m=[0.0501, 0.0, 0.0]),
    message(grip_N=-0.1),
    message(grip_N=3.1),
]


@pytest.mark.parametrize("wrong", WRONG, ids=range(len(WRONG)))
def test_what_is_wrong_is_counted_and_never_followed(wrong: bytes) -> None:
    receiver = TargetReceiver()
    assert not receiver.take(wrong, "glove", 0.0, LIMITS)
    assert (receiver.received, receiver.late, receiver.refused) == (0, 0, 1)
    assert receiver.refusal.startswith("expected ")
    assert receiver.wanted(0.0) is None


@given(st.binary(max_size=200) | st.text(max_size=200).map(str.encode))
def test_no_bytes_make_it_fail(data: bytes) -> None:
    assert not TargetReceiver().take(data, "glove", 0.0, LIMITS)


def heard(*came: tuple[float, bytes], sender: str = "glove") -> TargetReceiver:
    receiver = TargetReceiver()
    for at, data in came:
        receiver.take(data, sender, at, LIMITS)
    return receiver


def test_the_newest_wins_and_older_ones_are_late() -> None:
    receiver = heard((5.0, message(0, 1.0)), (5.002, message(2, 1.002)), (5.003, message(1, 1.001)))
    assert (receiver.received, receiver.late) == (2, 1)
    assert receiver.wanted(5.003).time == 1.002


def test_the_same_message_twice_is_late_also_when_it_is_stale() -> None:
    receiver = heard((5.0, message(3, 1.0)), (5.001, message(3, 1.0)), (9.0, message(3, 1.0)))
    assert (receiver.received, receiver.late) == (1, 2)
    assert receiver.wanted(9.0) is None


def test_a_sender_whose_time_goes_back_is_late() -> None:
    receiver = heard((5.0, message(0, 1.0)), (5.01, message(1, 0.5)))
    assert (receiver.received, receiver.late) == (1, 1)


def test_messages_that_waited_in_the_network_are_late() -> None:
    receiver = heard((5.0, message(0, 1.0)))
    for number in range(1, 4):  # held up for 0.2 s, then all at once
        receiver.take(message(number, 1.0 + number / 1000), "glove", 5.2, LIMITS)
    assert (receiver.received, receiver.late) == (1, 3)
    assert receiver.take(message(4, 1.199), "glove", 5.2, LIMITS)


def test_clocks_may_differ_and_drift() -> None:
    receiver = TargetReceiver()
    for number in range(2000):
        now = 100.0 + number
        slow = 5.0 + number * (1 - 1e-4)
        assert receiver.take(message(number, slow), "glove", now, LIMITS)


def test_a_target_is_stale_after_a_tenth_of_a_second() -> None:
    receiver = heard((5.0, message()))
    assert receiver.wanted(5.0999).position == (0.01, 0.02, -0.03)
    assert receiver.wanted(5.1001) is None
    assert receiver.state(5.1001) == "stale"


def test_a_released_switch_is_no_target() -> None:
    receiver = heard((5.0, message(0, 1.0)), (5.01, message(1, 1.01, enabled=False)))
    assert receiver.received == 2
    assert receiver.wanted(5.01) is None
    assert receiver.state(5.01) == "released"


def test_another_sender_or_session_is_heard_once_the_target_is_stale() -> None:
    receiver = heard((5.0, message(8, 1.0)))
    for sender, other in (("other", message(9, 1.1)), ("glove", message(9, 1.1, session=8))):
        assert not receiver.take(other, sender, 5.1, LIMITS)
    assert "one sender" in receiver.refusal
    assert receiver.take(message(0, 0.0, session=8), "other", 5.2, LIMITS)
    assert not receiver.take(message(9, 1.2), "glove", 5.21, LIMITS)
