"""A real row on a (virtual) display: what it shows of a scene, and what it asks for."""

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QImage

from kappaskin import load_scene
from kappaskin.scenes.cylinders import Presentation
from kappaskin.scenes.stimulus import MotionPath, PressStep, ReleaseStep
from kappaskin_app.features.scene.timeline import Timeline, profile
from kappaskin_app.theme import DARK, LIGHT, apply_look

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def row(qtbot):
    """A row on a scene of 2.25 s, and what it asked for."""
    row = Timeline()
    qtbot.addWidget(row)
    row.resize(600, 30)
    row.show_scene(load_scene("slipping"))
    row.asked, row.wanted = [], []
    row.sought.connect(row.asked.append)
    row.play_wanted.connect(row.wanted.append)
    yield row
    row.close()


def place(row, seconds: float) -> QPoint:
    return QPoint(round(row.track.at(seconds)), 15)


@pytest.mark.parametrize("name", ["centre", "fingertip"])
def test_a_scene_in_which_nothing_moves_has_no_timeline(row, name):
    assert row.isVisible()
    row.show_scene(load_scene(name))
    assert not row.isVisible()
    row.show_scene(load_scene("calibration"))
    assert row.isVisible()
    row.show_scene(None)
    assert not row.isVisible()


def test_a_skin_that_waits_on_one_cylinder_has_no_timeline(row):
    scene = load_scene("calibration")
    row.show_scene(replace(scene, laid=Presentation(scene.laid.steps[:1], 1.0)))
    assert not row.isVisible()


def test_a_scene_of_years_is_shown_as_well(row):
    scene = load_scene("slipping")
    still = replace(scene.stimuli[0], motion=MotionPath((PressStep(1e9), ReleaseStep(1e9))))
    row.show_scene(replace(scene, stimuli=(still,)))
    row.show_time(1.5e9, True)
    assert row.track.time == 1.5e9


def test_the_time_is_told_and_begins_anew(row):
    row.show_time(1.32, True)
    assert row.clock.text == "1.32 s of 2.25 s"
    assert row.track.value() == 1320
    row.show_time(1.32 + 4 * 2.25, True)
    assert row.clock.text == "1.32 s of 2.25 s"
    for unknown in (float("nan"), float("inf")):
        row.show_time(unknown, True)
    assert row.clock.text == "1.32 s of 2.25 s"
    assert not row.asked  # what is shown is not asked for


@pytest.mark.parametrize(
    ("key", "to"),
    [
        (Qt.Key.Key_Left, 1 - 1 / 60),
        (Qt.Key.Key_Right, 1 + 1 / 60),
        (Qt.Key.Key_PageUp, 1.225),
        (Qt.Key.Key_PageDown, 0.775),
        (Qt.Key.Key_Home, 0.0),
        (Qt.Key.Key_End, 2.25 - 1 / 60),
    ],
)
def test_keys_go_to_other_times(row, qtbot, key, to):
    row.show_time(1.0, False)
    qtbot.keyClick(row.track, key)
    assert row.asked == [pytest.approx(to)]
    assert row.track.time == pytest.approx(to)


def test_a_step_is_one_frame_of_a_scene_with_few_of_them(row, qtbot):
    row.show_scene(replace(load_scene("slipping"), rate=10.0))
    qtbot.keyClick(row.track, Qt.Key.Key_Right)
    assert row.asked == [pytest.approx(0.1)]


def test_keys_stay_inside_the_scene(row, qtbot):
    qtbot.keyClick(row.track, Qt.Key.Key_Left)
    qtbot.keyClick(row.track, Qt.Key.Key_End)
    qtbot.keyClick(row.track, Qt.Key.Key_PageUp)
    assert row.asked == pytest.approx([0.0, 2.25 - 1 / 60, 2.25 - 1 / 60])


def test_space_and_the_button_ask_to_play_or_to_pause(row, qtbot):
    row.show_time(0.5, True)
    qtbot.keyClick(row.track, Qt.Key.Key_Space)
    qtbot.mouseClick(row.play, LEFT)
    assert row.wanted == [False, False]  # it is told, and changes nothing itself
    assert row.play.accessibleName() == "Pause"
    row.show_time(0.5, False)
    assert row.play.accessibleName() == "Play"
    row.play.click()
    assert row.wanted[-1] is True


def test_a_press_goes_there_and_a_drag_follows_the_mouse_alone(row, qtbot):
    track = row.track
    qtbot.mousePress(track, LEFT, pos=place(row, 1.0))
    assert row.asked == [pytest.approx(1.0, abs=0.005)]
    qtbot.mouseMove(track, place(row, 1.5))
    assert row.asked[-1] == pytest.approx(1.5, abs=0.005)
    row.show_time(0.2, True)
    assert track.time == pytest.approx(1.5, abs=0.005)
    qtbot.mouseMove(track, QPoint(5000, 15))
    assert row.asked[-1] == pytest.approx(2.25 - 1 / 60)
    qtbot.mouseRelease(track, LEFT, pos=place(row, 1.5))
    row.show_time(0.2, True)
    assert track.time == pytest.approx(0.2)


def test_another_scene_ends_a_drag(row, qtbot):
    qtbot.mousePress(row.track, LEFT, pos=place(row, 1.0))
    row.show_scene(load_scene("tapping"))
    row.show_time(0.3, True)
    assert row.clock.text == "0.30 s of 1.00 s"
    qtbot.mouseRelease(row.track, LEFT)


def test_the_words_keep_their_width(row):
    width = row.clock.width()
    for time in (0.0, 1.11, 2.04):
        row.show_time(time, True)
        assert row.clock.width() == width


def test_the_profile_is_how_hard_the_scene_presses():
    taps = profile(load_scene("tapping"))
    assert (taps.min(), taps.max()) == (0.0, 1.0)
    high = taps > 0.5
    assert np.sum(np.diff(high.astype(int)) == 1) == 3
    assert (profile(load_scene("circle")) == 1).all()
    assert (profile(load_scene("calibration")) == 1).all()


def test_it_is_drawn_in_the_colours_of_the_theme(row):
    def picture(theme) -> QImage:
        apply_look(theme)
        return row.track.grab().toImage()

    light, dark = picture(LIGHT), picture(DARK)
    assert light != dark
    assert light == picture(LIGHT)
    row.show_time(1.0, True)
    assert row.track.grab().toImage() != light
