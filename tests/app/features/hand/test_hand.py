"""The hand in the window: a map of each finger, and the finger that the window shows."""

import multiprocessing
import os
import signal
import socket
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

import kappaskin_app.features.hand as features_hand
from kappaskin.hand import Finger, HandDescription
from kappaskin.live import Fingers
from kappaskin.recording import Recording

SOURCES = {"thumb": "sim:", "index": "sim:fingertip-cap"}


HAND = HandDescription(
    "Two",
    (
        Finger("thumb", SOURCES["thumb"], (-0.12, 0.0, 0.0), (0.0, 0.3, 0.0)),
        Finger("index", SOURCES["index"], (0.04, 0.0, 0.0), (0.0, -0.3, 0.0)),
    ),
)


@pytest.fixture
def hand(opened, until):
    fingers = Fingers(SOURCES)
    fingers.connect(SOURCES)
    window = opened("sim:", fingers)
    window.session.begin_fingers(SOURCES, HAND)
    until(lambda: all(" N" in text for text in words(window)))
    return window


def hand_of(window):
    return window.features["hand"].panel.views


def words(window):
    views = hand_of(window).values()
    return [f"{view.map.words.text()}: {view.force.text()}" for view in views]


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


def test_the_hand_is_drawn_and_a_click_on_a_finger_shows_it(hand, until):
    view = hand.features["hand"].panel.hand_view
    until(lambda: set(view.fingers) == set(SOURCES))
    index = view.fingers["index"]
    middle = (index.where @ [*index.skin.at_rest(np.array([[0.0105, 0.0105]]))[0][0], 1.0])[:3]
    at = view.place_of(middle)
    assert view.finger_at(at) == "index"
    QTest.mouseClick(view, Qt.MouseButton.LeftButton, pos=at.toPoint())
    assert hand.session.finger == "index"


def test_what_is_held_is_told_with_the_sum_of_forces(hand, until):
    texts = hand.features["hand"].panel.texts
    until(lambda: texts["Sum of forces"].text().endswith(" N"))
    assert texts["Held"].text().startswith("Held: ")
    assert texts["Sum of moments"].text().endswith(" N mm")


def test_without_a_description_the_window_says_what_to_open(hand, until):
    panel = hand.features["hand"].panel
    hand.session.hand = None
    until(lambda: "kappaskin app hand.toml" in panel.texts["Held"].text())
    assert not panel.hand_view.isVisible()
    assert not panel.texts["Sum of forces"].isVisible()


def test_the_strip_chart_has_a_curve_of_each_finger_that_goes_on_when_another_is_shown(hand, until):
    hand.actions_by_name["dock-strip_chart"].trigger()
    panel = hand.features["strip_chart"].strips.panel

    def curves():
        return {each.name: each.x for each in panel.charts["force"].series if each.name}

    until(lambda: set(curves()) == set(SOURCES))
    until(lambda: all(len(x) > 20 for x in curves().values()))
    ends = [x[-1] for x in curves().values()]
    assert max(ends) - min(ends) < 5.0  # where the processor is busy, a finger is late

    kept = {name: len(x) for name, x in curves().items()}
    choose(hand, "index")
    until(lambda: hand.session.estimate is not None)
    until(lambda: all(len(x) >= kept[name] for name, x in curves().items()))

    panel.all_fingers.click()
    assert curves() == {}


def test_a_recording_starts_in_the_background_and_may_be_ended_before(hand, until, tmp_path):
    session, path = hand.session, tmp_path / "hand.mcap"
    session.record(path)
    assert not session.fingers.recording.active  # its process is not waited for
    session.record(None)
    until(path.exists)
    until(lambda: session.fingers.recording.path == str(path))
    until(lambda: not session.fingers.recording.active)


def test_a_hand_cannot_be_recorded_to_a_file_that_exists(hand, until, tmp_path):
    path = tmp_path / "hand.mcap"
    path.touch()
    hand.session.record(path)
    until(lambda: "hand.mcap" in hand.statusBar().currentMessage())
    assert not hand.session.status.recording.active


def test_the_scenes_of_all_fingers_are_computed_before_one_is_chosen(hand, until):
    until(lambda: not any("_answers" in each.name for each in multiprocessing.active_children()))
    choose(hand, "index")
    assert not hand.session.making
    assert hand.session.scene.name == "fingertip-cap"


def test_angles_that_no_longer_come_are_told(hand, until, monkeypatch):
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as robot:
        robot.bind(("127.0.0.1", 0))
        address = robot.getsockname()
        robot.close()
        panel = hand.features["hand"].panel
        hand.session.hand = replace(HAND, angles_from="udp://{}:{}".format(*address))
        until(lambda: panel._joints is not None)  # noqa: SLF001
        until(panel.hand_view.isVisible)
        monkeypatch.setattr(features_hand, "_OLD_ANGLES", 0.3)
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as robot:
        robot.sendto(b"{}", address)
    until(lambda: "last joint angles came to udp://" in panel.texts["Held"].text())
    assert not panel.hand_view.isVisible()
