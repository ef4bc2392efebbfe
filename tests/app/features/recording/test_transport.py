"""A real row on a (virtual) display: what it shows of a recording, and what it asks for."""

from collections.abc import Iterator
from itertools import pairwise

import pytest
from PySide6.QtCore import QEvent, QPoint, Qt
from PySide6.QtGui import QHelpEvent, QTextDocument
from PySide6.QtWidgets import QApplication, QToolTip

from kappaskin import Event
from kappaskin.recording import Replay
from kappaskin_app.features.recording.transport import SPEEDS, Transport, minutes
from kappaskin_app.theme import DARK, LIGHT, apply_look
from kappaskin_app.widgets.timeline import GLYPHS, icon

LEFT, KEYS = Qt.MouseButton.LeftButton, Qt.Key
EVENTS = (Event(2.0, "note", "here"), Event(2.01, "tare", "taken"), Event(8.0, "gap", "back"))
REPLAY = Replay(0.0, 10.0, 1.0, False, ((4.0, 5.5),), EVENTS, 1.7e9, True)


@pytest.fixture
def row(qtbot) -> Iterator[Transport]:
    """A row on a recording of 10 s, and what it asked for."""
    row = Transport()
    qtbot.addWidget(row)
    row.resize(900, 30)
    row.asked = []
    row.sought.connect(lambda at: row.asked.append(("seek", at)))
    row.step_wanted.connect(lambda n: row.asked.append(("step", n)))
    row.jump_wanted.connect(lambda n: row.asked.append(("jump", n)))
    row.play_wanted.connect(lambda on: row.asked.append(("play", on)))
    row.speed_wanted.connect(lambda speed: row.asked.append(("speed", speed)))
    row.loop_wanted.connect(lambda on: row.asked.append(("loop", on)))
    row.show_recording(REPLAY, EVENTS)
    row.show_speed(1.0, False)
    yield row
    row.close()


def place(row: Transport, seconds: float) -> QPoint:
    return QPoint(round(row.course.at(seconds)), 15)


def test_it_is_there_for_a_recording_alone(row: Transport) -> None:
    assert row.isVisible()
    row.show_recording(None)
    assert not row.isVisible()


def test_times_are_minutes_seconds_and_milliseconds() -> None:
    assert minutes(0.0) == "0:00.000"
    assert minutes(59.9996) == "1:00.000"
    assert minutes(3671.25) == "61:11.250"


def test_what_is_shown_is_not_asked_for(row: Transport) -> None:
    row.show_time(3.25, True)
    row.show_speed(0.1, True)
    assert row.clock.text == "0:03.250 of 0:10.000"
    assert row.speed.currentData() == 0.1
    assert row.loop.isChecked()
    assert not row.asked


@pytest.mark.parametrize(
    ("key", "asked"),
    [
        (KEYS.Key_Left, ("step", -1)),
        (KEYS.Key_Comma, ("step", -1)),
        (KEYS.Key_Right, ("step", 1)),
        (KEYS.Key_Period, ("step", 1)),
        (KEYS.Key_PageUp, ("seek", pytest.approx(4.0))),
        (KEYS.Key_PageDown, ("seek", pytest.approx(2.0))),
        (KEYS.Key_Home, ("seek", 0.0)),
        (KEYS.Key_End, ("seek", 10.0)),
        (KEYS.Key_Space, ("play", False)),
    ],
)
def test_keys_ask_for_what_the_buttons_do(row: Transport, qtbot, key, asked) -> None:
    row.show_time(3.0, True)
    qtbot.keyClick(row.course, key)
    assert row.asked == [asked]


def test_other_keys_are_left_to_others(row: Transport, qtbot) -> None:
    for key in (KEYS.Key_A, KEYS.Key_Up):
        qtbot.keyClick(row.course, key)
    qtbot.keyClick(row.course, KEYS.Key_Home, Qt.KeyboardModifier.ControlModifier)
    assert not row.asked


def test_every_button_asks_for_what_it_says(row: Transport, qtbot) -> None:
    row.show_time(1.0, False)
    for name in ("previous", "back", "play", "forward", "next", "loop"):
        assert row.buttons[name].toolTip()
        qtbot.mouseClick(row.buttons[name], LEFT)
    assert row.asked == [
        ("jump", -1),
        ("step", -1),
        ("play", True),
        ("step", 1),
        ("jump", 1),
        ("loop", True),
    ]
    assert row.play.accessibleName() == "Play"


def test_speeds_go_from_a_tenth_to_ten_times(row: Transport, qtbot) -> None:
    assert (SPEEDS[0], SPEEDS[-1]) == (0.1, 10.0)
    row.speed.setFocus()
    qtbot.keyClick(row.speed, KEYS.Key_Down)
    assert row.asked == [("speed", 2.0)]


def test_the_handle_follows_the_mouse_and_not_the_replay_while_it_is_held(
    row: Transport, qtbot
) -> None:
    qtbot.mousePress(row.course, LEFT, pos=place(row, 6.0))
    row.show_time(1.0, True)
    qtbot.mouseMove(row.course, place(row, 7.0))
    assert row.course.time == pytest.approx(7.0, abs=0.02)
    assert row.clock.text.startswith("0:0")
    qtbot.mouseRelease(row.course, LEFT, pos=place(row, 7.0))
    row.show_time(1.0, True)
    assert row.course.time == 1.0
    assert [kind for kind, _ in row.asked] == ["seek", "seek"]


def test_flags_and_gaps_say_what_they_are(row: Transport) -> None:
    course = row.course
    assert course.tip_at(course.at(2.0)) == "0:02.000  note: here\n0:02.010  tare: taken"
    assert course.tip_at(course.at(4.7)) == "Gap of 1.50 s from 0:04.000."
    assert course.tip_at(course.at(9.0)).startswith("0:09.000")


def test_a_thousand_events_at_once_are_drawn_and_told_of_in_few_words(row: Transport) -> None:
    many = tuple(Event(3.0 + k * 1e-6, "note", str(k)) for k in range(1000))
    row.show_recording(REPLAY, many)
    assert row.course.tip_at(row.course.at(3.0)).endswith("and 997 more")
    assert not row.course.grab().isNull()


def test_it_is_drawn_in_the_colours_of_the_theme(row: Transport) -> None:
    pictures = []
    for theme in (LIGHT, DARK, LIGHT):
        apply_look(theme)
        pictures.append(row.course.grab().toImage())
    assert pictures[0] == pictures[2] != pictures[1]


def test_a_recording_without_events_offers_no_way_to_them(row: Transport) -> None:
    assert row.buttons["next"].isEnabled()
    row.show_recording(REPLAY, ())
    assert not row.buttons["next"].isEnabled()


@pytest.mark.parametrize("name", GLYPHS)
def test_every_sign_is_drawn(qapp, name: str) -> None:
    picture = icon(name).pixmap(64, 64).toImage()
    alphas = {picture.pixelColor(x, y).alpha() > 0 for x in range(64) for y in range(0, 64, 4)}
    assert alphas == {False, True}


def test_an_empty_recording_has_a_handle_that_stays(row: Transport, qtbot) -> None:
    empty = Replay(0.0, 0.0, 1.0, False, (), (), 1.7e9, False)
    row.show_recording(empty, ())
    qtbot.keyClick(row.course, KEYS.Key_End)
    assert row.asked == [("seek", 0.0)]


def test_a_note_is_read_as_it_was_written(row: Transport, until) -> None:
    row.show_recording(REPLAY, (Event(2.0, "note", "from <b> to <i> & back"),))
    at = place(row, 2.0)

    QApplication.sendEvent(
        row.course, QHelpEvent(QEvent.Type.ToolTip, at, row.course.mapToGlobal(at))
    )

    shown = QTextDocument()
    shown.setHtml(QToolTip.text())
    assert shown.toPlainText() == "0:02.000  note: from <b> to <i> & back"
    QToolTip.hideText()
    until(lambda: not QToolTip.isVisible())


def test_a_narrow_row_drops_the_duration_and_nothing_overlaps(row: Transport) -> None:
    row.resize(row.minimumSizeHint().width(), 30)
    QApplication.processEvents()
    row.show_time(3.25, True)
    parts = [row.course, row.clock, row.speed, *row.buttons.values()]
    places = sorted((part.geometry() for part in parts), key=lambda place: place.left())
    assert all(one.right() < other.left() for one, other in pairwise(places))
    assert row.width() <= 382  # beside the panels of a window of 1024 px
    assert row.clock.width() < row.clock.sizeHint().width()
