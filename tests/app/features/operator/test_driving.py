"""A simulated hand that the operator moves: where its object goes, and what its skins feel."""

import numpy as np
import pytest

from kappaskin.hand import HandTarget, hand_file, load_hand, placement
from kappaskin.live import Fingers
from kappaskin_app.features.operator.driving import Home, home_of, pose_of

HOME = Home(placement((0.0, 0.0, 0.01), (0.1, -0.2, 0.3)), 0.35)
TARGET = HandTarget((0.004, -0.002, 0.001), (0.2, 0.1, -0.3), 0.5)


def test_at_home_the_object_is_where_the_course_begins() -> None:
    hand = load_hand(hand_file("hold")).simulated
    home = home_of(hand)
    first = hand.course.keyframes[0]
    assert home.grip == first.grip
    for held in (True, False):
        pose = pose_of(HandTarget(), home, held)
        np.testing.assert_allclose(pose.position, first.position, atol=1e-12)
        np.testing.assert_allclose(pose.rotation, np.eye(3), atol=1e-12)


def test_a_held_object_is_moved_and_turned_as_the_target_says() -> None:
    pose = pose_of(TARGET, HOME, held=True)
    np.testing.assert_allclose(pose.position, [0.004, -0.002, 0.011])
    turn = placement((0.0, 0.0, 0.0), TARGET.rotation).rotation
    np.testing.assert_allclose(pose.rotation, turn @ HOME.where.rotation)


def test_over_a_standing_object_the_hand_is_moved() -> None:
    pose = pose_of(TARGET, HOME, held=False)
    hand = placement(TARGET.position, TARGET.rotation)
    again = hand.of(pose)  # the object seen from where the hand was
    np.testing.assert_allclose(again.position, HOME.where.position, atol=1e-15)
    np.testing.assert_allclose(again.rotation, HOME.where.rotation, atol=1e-12)


@pytest.mark.slow
def test_the_operator_grips_and_every_finger_feels_it(opened, until) -> None:
    hand = load_hand(hand_file("hold"))
    sources = {finger.name: finger.source for finger in hand.fingers}
    fingers = Fingers(sources)
    fingers.connect(sources)
    window = opened("sim:", fingers)
    window.session.begin_fingers(sources, hand)
    window.docks.reveal("operator")
    until(lambda: window.control.status.target.time)
    assert window.control.status.target.grip == pytest.approx(0.22)

    def forces() -> list[float]:
        found = []
        for finger, status in fingers.status().items():
            estimate = fingers.engines[finger].latest(status)
            found.append(0.0 if estimate is None else estimate.contact.force)
        return found

    until(lambda: min(forces()) > 0.1)
    window.operator.enable.click()
    window.operator.grip.setValue(50)
    until(lambda: window.control.status.target.grip == pytest.approx(0.75))
    until(lambda: min(forces()) > 0.6)
    np.testing.assert_allclose(hand.simulated.state.pose.position, [0, 0, 0.01], atol=1e-12)

    window.operator.grip.setValue(1)
    until(lambda: "slips" in window.operator.message.text())
    window.operator.grip.setValue(60)
    until(lambda: "slips" not in window.operator.message.text())
