"""The hand in the window: a map of each finger, and the finger that the window shows."""

import os
import signal

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from kappaskin.live import Fingers
from kappaskin.recording import Recording

SOURCES = {"thumb": "sim:", "index": "sim:fingertip-cap"}


@pytest.fixture
def hand(opened, until):
    fingers = Fingers(SOURCES)
    fingers.connect(SOURCES)
    window = opened("sim:", fingers)
    window.session.begin_fingers(SOURCES)
    until(lambda: all(" N" in text for text in words(window)))
    return window


def hand_of(window):
    return window.features["hand"].panel.views


def words(window):
    return [view.map.words.text() for view in hand_of(window).values()]


def choose(window, finger):
    view = hand_of(window)[finger]
    QTest.mouseClick(view.map.map, Qt.MouseButton.LeftButton)
    assert view.button.isChecked()


def test_each_finger_has_a_map_with_its_state_and_force(hand, until):
    until(lambda: all(text.startswith("SIM: ") and " N" in text for text in words(hand)))
    assert hand.docks["hand"].isVisible()


def test_a_finger_that_is_chosen_is_shown_with_its_own_settings(hand, until):
    session, history = hand.session, hand.history
    history.change("Functions", -1, functions_x=5)
    patch = session.status.sensor.layout.patch
    choose(hand, "index")
    until(lambda: session.estimate is not None and session.status.sensor.layout.patch != patch)

    assert (session.finger, session.source) == ("index", "sim:fingertip-cap")
    assert history.settings.functions_x != 5
    assert not history.stack.canUndo()
    until(lambda: hand.windowTitle().startswith("index"))

    choose(hand, "thumb")
    until(lambda: session.estimate is not None and session.status.sensor.layout.patch == patch)
    assert history.settings.functions_x == 5
    assert session.engine.requested.setup.Ni == 5


def test_the_arrow_keys_go_from_finger_to_finger(hand):
    thumb, index = (view.button for view in hand_of(hand).values())
    thumb.setFocus()
    QTest.keyClick(thumb, Qt.Key.Key_Right)
    assert index.isChecked()
    assert hand.session.finger == "index"


def test_a_finger_that_dies_leaves_the_others_alone_and_comes_back(hand, until):
    engines, before = hand.session.fingers.engines, hand.session.status.generation
    dead = engines["index"].pid
    os.kill(dead, signal.SIGKILL)
    until(lambda: engines["index"].pid != dead and words(hand)[1].startswith("SIM: "))

    assert hand.session.status.generation == before
    until(lambda: words(hand)[0].startswith("SIM: "))


def test_one_recording_holds_all_fingers(hand, until, tmp_path):
    hand.session.record(tmp_path / "hand.mcap")
    until(lambda: hand.session.status.recording.messages > 100)
    hand.session.record(None)
    until(lambda: not hand.session.status.recording.active)

    with Recording(tmp_path / "hand.mcap") as recording:
        assert set(recording.fingers) == set(SOURCES)


def test_a_setting_of_all_fingers_reaches_each_engine_and_is_undone(hand):
    scope, fingers = hand.features["hand"].scope, hand.session.fingers
    assert scope.one.text() == "thumb"
    assert not scope.note.isVisible()
    QTest.mouseClick(scope.all, Qt.MouseButton.LeftButton)
    assert scope.note.isVisible()
    hand.requests.set("functions_x", 5)
    hand.requests.set("noise_rms", 2.0)
    assert [each.requested.setup.Ni for each in fingers.engines.values()] == [5, 5]

    hand.history.stack.undo()
    hand.history.stack.undo()
    assert [each.requested.setup.Ni for each in fingers.engines.values()] == [8, 8]

    choose(hand, "index")
    assert scope.one.text() == "index"
    assert scope.all.isChecked()
    QTest.mouseClick(scope.one, Qt.MouseButton.LeftButton)
    hand.requests.set("functions_x", 6)
    assert [each.requested.setup.Ni for each in fingers.engines.values()] == [8, 6]


def test_noise_of_all_fingers_is_simulated_by_each(opened, until):
    sources = {"thumb": "sim:", "index": "sim:line"}
    fingers = Fingers(sources)
    fingers.connect(sources)
    window = opened("sim:", fingers)
    window.session.begin_fingers(sources)
    until(lambda: window.session.estimate is not None)
    window.history.set_of_all(True)
    window.requests.set("noise_rms", 2.0)
    until(
        lambda: all(
            engine.requested.scene is not None
            and any(getattr(effect, "rms", 0) == 2.0 for effect in engine.requested.scene.effects)
            for engine in fingers.engines.values()
        )
    )
