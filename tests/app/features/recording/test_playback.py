"""The window on a recording: what it shows, obeys, and leaves behind."""

import os
import signal
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QApplication, QFileDialog

from kappaskin import Recording, Tare
from kappaskin_app.shell.window import MainWindow

KEYS = Qt.Key


@pytest.fixture(autouse=True)
def documents(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Nobody's own folder of recordings."""
    monkeypatch.setenv("XDG_DOCUMENTS_DIR", str(tmp_path / "documents"))
    return tmp_path / "documents" / "Kappaskin"


@pytest.fixture
def player(opened: Callable[[str], MainWindow], recording: Path, until) -> MainWindow:
    """The window on the recording, playing."""
    window = opened(f"replay:{recording}")
    until(lambda: window.playback.summary is not None)
    until(lambda: window.display.badge.state.startswith("REPLAY"))
    until(lambda: window.playback.time > 0)
    return window


@pytest.fixture
def standing(player: MainWindow, until) -> MainWindow:
    """The window on the recording, which stands at 0.3 s."""
    player.playback.go(False)
    player.playback.seek(0.1)  # or it may have stood near 0.3 s already
    until(lambda: player.session.status.replay.at == 0.1)
    until(lambda: player.session.estimate.sequence < 20)
    player.playback.seek(0.3)
    until(lambda: player.session.status.replay.at == 0.3)
    until(lambda: 28 < player.session.estimate.sequence < 33)
    return player


def _at(window: MainWindow) -> float:
    return window.session.status.replay.at


@pytest.mark.full
def test_a_recording_is_never_called_live_and_names_its_day(player: MainWindow, until) -> None:
    until(lambda: "Recorded" in player.connection.device.text())
    assert f"{datetime.now():%Y-%m-%d}" in player.connection.device.text()
    assert "Simulated skin" in player.connection.device.text()
    until(lambda: player.windowTitle().startswith("example.mcap, recorded"))
    assert player.transport.isVisible()
    assert not player.timeline.isVisible()


@pytest.mark.full
def test_one_that_stands_is_paused_and_not_stale(standing: MainWindow, qtbot, until) -> None:
    qtbot.wait(700)
    assert standing.display.badge.state == "REPLAY \N{MIDDLE DOT} paused"
    assert not standing.membrane.surface.lost
    until(lambda: standing.readouts.text("contact").endswith(" mm"))


@pytest.mark.full
def test_where_nothing_came_it_is_grey(standing: MainWindow, until) -> None:
    standing.playback.seek(1.4)
    until(lambda: standing.display.badge.state == "REPLAY \N{MIDDLE DOT} gap")
    until(lambda: standing.membrane.surface.lost)
    standing.presenter.enter()
    until(lambda: standing.presenter.view.strip.state == standing.display.badge.state)
    assert "Ctrl+P" in standing.presenter.view.banner.remedy
    assert standing.presenter.view.banner.isVisible()


@pytest.mark.full
def test_the_settings_recorded_are_used_and_can_be_undone(
    window: MainWindow, recording: Path, until
) -> None:
    window.history.change("Other", -1, functions_x=3, method="bayes")
    window.playback.open_file(recording)
    until(lambda: window.display.badge.state.startswith("REPLAY"))
    settings = window.history.settings
    assert (settings.functions_x, settings.functions_y, settings.method) == (8, 8, "least-squares")
    window.history.stack.undo()
    assert window.history.settings.functions_x == 3
    until(lambda: window.session.estimate.coefficients.shape == (3, 8))


@pytest.mark.full
def test_settings_changed_in_the_recording_are_marked_and_may_be_used(
    standing: MainWindow, until
) -> None:
    assert [event.kind for event in standing.playback.events] == ["note", "settings"]
    standing.playback.seek(0.9)
    standing.actions_by_name["replay-settings"].trigger()
    assert standing.history.settings.functions_y == 7
    until(lambda: standing.session.estimate.coefficients.shape == (6, 7))


@pytest.mark.full
def test_other_settings_show_while_it_stands(standing: MainWindow, until) -> None:
    sequence = standing.session.estimate.sequence
    standing.history.change("Fewer", -1, functions_x=4)
    until(lambda: standing.session.estimate.coefficients.shape == (4, 8))
    assert standing.session.estimate.sequence == sequence


@pytest.mark.full
def test_keys_left_over_go_to_the_transport(standing: MainWindow, qtbot, until) -> None:
    view = standing.membrane.plotter
    view.setFocus()
    sequence = standing.session.estimate.sequence
    for key, by in ((KEYS.Key_Period, 1), (KEYS.Key_Comma, 0), (KEYS.Key_Comma, -1)):
        qtbot.keyClick(view, key)
        until(lambda by=by: standing.session.estimate.sequence == sequence + by)
    qtbot.keyClick(view, KEYS.Key_End)
    until(lambda: _at(standing) == standing.session.status.replay.length)
    qtbot.keyClick(view, KEYS.Key_Home)
    until(lambda: _at(standing) == 0.0)
    standing.playback.play_at(0.25)  # or it may be over before anybody looks
    qtbot.keyClick(view, KEYS.Key_Space)
    until(lambda: standing.display.badge.state == "REPLAY" and _at(standing) > 0.1)
    qtbot.keyClick(view, KEYS.Key_Space)
    until(lambda: standing.display.badge.state.endswith("paused"))


def test_every_step_asked_for_is_taken(standing: MainWindow, until) -> None:
    sequence = standing.session.estimate.sequence
    for _ in range(20):
        standing.playback.step(1)
    until(lambda: standing.session.estimate.sequence == sequence + 20)
    for _ in range(5):
        standing.playback.step(-1)
    until(lambda: standing.session.estimate.sequence == sequence + 15)


def test_scrubbing_ends_where_the_mouse_let_go(standing: MainWindow, qtbot, until) -> None:
    course, left = standing.transport.course, Qt.MouseButton.LeftButton

    def place(seconds: float) -> QPoint:
        return QPoint(round(course.at(seconds)), 15)

    qtbot.mousePress(course, left, pos=place(0.2))
    for k in range(40):
        qtbot.mouseMove(course, place(0.2 + 0.015 * k))
    qtbot.mouseRelease(course, left, pos=place(0.8))
    wanted = course.time
    assert 0.6 < wanted < 1.0
    until(lambda: _at(standing) == pytest.approx(wanted, abs=1e-9))
    until(lambda: abs(standing.session.estimate.device_time - wanted) < 0.03)


@pytest.mark.full
def test_it_ends_paused_and_plays_again_from_the_beginning(player: MainWindow, until) -> None:
    player.playback.seek(2.3)
    # It stands at its beginning too, until the settings recorded are in use.
    until(lambda: player.display.badge.state.endswith("paused") and _at(player) > 0)
    assert _at(player) == player.session.status.replay.length
    player.playback.play_at(0.1)  # or it may be over again before anybody looks
    player.actions_by_name["pause"].trigger()
    until(lambda: player.display.badge.state == "REPLAY" and _at(player) < 1.0)


@pytest.mark.full
def test_one_that_loops_begins_anew(player: MainWindow, until) -> None:
    player.actions_by_name["replay-loop"].trigger()
    player.playback.play_at(10.0)
    player.playback.seek(2.0)
    until(lambda: 0 < _at(player) < 1.0)
    assert player.display.badge.state != "REPLAY \N{MIDDLE DOT} paused"


def test_events_are_jumped_to(standing: MainWindow, until) -> None:
    for name, at in (("next", 0.5), ("next", 0.7), ("next", 0.7), ("previous", 0.5)):
        standing.actions_by_name[f"replay-{name}"].trigger()
        assert standing.playback.time == pytest.approx(at, abs=0.02)
        until(lambda at=at: _at(standing) == pytest.approx(at, abs=0.02))


@pytest.mark.full
def test_where_it_is_to_go_is_told_until_a_slow_engine_is_there(
    standing: MainWindow, until, qtbot
) -> None:
    pid = standing.session.engine.pid
    os.kill(pid, signal.SIGSTOP)
    standing.actions_by_name["replay-next"].trigger()
    qtbot.wait(700)
    standing.actions_by_name["replay-next"].trigger()
    assert standing.playback.time == pytest.approx(0.7, abs=0.02)
    os.kill(pid, signal.SIGCONT)
    until(lambda: _at(standing) == pytest.approx(0.7, abs=0.02))


def test_speeds_are_asked_for_by_keys(standing: MainWindow, until) -> None:
    for _ in range(8):
        standing.actions_by_name["replay-slower"].trigger()
    assert standing.playback.speed == 0.1
    standing.playback.go(True)
    until(lambda: standing.session.status.replay.speed == 0.1)
    standing.actions_by_name["replay-faster"].trigger()
    until(lambda: standing.session.status.replay.speed == 0.25)
    assert standing.transport.speed.currentData() == 0.25


@pytest.mark.full
def test_the_simulation_comes_back_without_a_trace(player: MainWindow, until) -> None:
    player.actions_by_name["simulate"].trigger()
    until(lambda: player.display.badge.state == "SIM")
    until(lambda: not player.transport.isVisible())
    until(lambda: player.windowTitle() == "Kappaskin")
    assert not player.actions_by_name["replay-forward"].isEnabled()
    assert player.actions_by_name["record"].isEnabled()
    assert player.session.base is None


@pytest.mark.full
def test_calibration_and_tare_are_the_live_ones_again(
    window: MainWindow, recording: Path, until
) -> None:
    sensor = window.session.status.sensor
    offset = np.zeros(sensor.channels)
    day = datetime.now(UTC)
    mine = Tare(sensor.name, "other", "layout", day, 20.0, 500, 1.0, offset, offset)
    window.history.change("Mine", -1, tare=mine)
    window.playback.open_file(recording)
    until(lambda: window.display.badge.state.startswith("REPLAY"))
    assert window.history.settings.tare is None  # recorded without
    window.actions_by_name["simulate"].trigger()
    assert window.history.settings.tare is mine


def test_nothing_is_recorded_of_a_recording(player: MainWindow, until) -> None:
    until(lambda: not player.actions_by_name["record"].isEnabled())
    assert "copy its file" in player.recording.record.toolTip()
    assert not player.recording.record.isEnabled()


# Opening.


@pytest.mark.full
def test_a_recording_dropped_on_the_window_is_played(
    window: MainWindow, recording: Path, until
) -> None:
    data, some = QMimeData(), Qt.MouseButton.LeftButton
    data.setUrls([QUrl.fromLocalFile(str(recording))])
    copy, none = Qt.DropAction.CopyAction, Qt.KeyboardModifier.NoModifier
    enter = QDragEnterEvent(QPointF(9, 9).toPoint(), copy, data, some, none)
    QApplication.sendEvent(window, enter)
    assert enter.isAccepted()
    QApplication.sendEvent(window, QDropEvent(QPointF(9, 9), copy, data, some, none))
    until(lambda: window.display.badge.state.startswith("REPLAY"))


def test_another_file_dropped_is_not_taken(window: MainWindow, tmp_path: Path) -> None:
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(tmp_path / "notes.txt"))])
    copy, none = Qt.DropAction.CopyAction, Qt.KeyboardModifier.NoModifier
    left = Qt.MouseButton.LeftButton
    enter = QDragEnterEvent(QPointF(9, 9).toPoint(), copy, data, left, none)
    enter.ignore()
    QApplication.sendEvent(window, enter)
    assert not enter.isAccepted()
    assert not window.membrane.plotter.acceptDrops()


@pytest.mark.full
def test_one_is_opened_by_the_dialog_and_is_recent_then(
    window: MainWindow, recording: Path, until, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (str(recording), ""))
    window.actions_by_name["open-recording"].trigger()
    until(lambda: window.display.badge.state.startswith("REPLAY"))
    menu = window.actions_by_name["recent"].menu()
    menu.aboutToShow.emit()
    assert [action.text() for action in menu.actions()] == ["example.mcap", "", "&Clear this list"]
    assert window.connection.source() == f"replay:{recording}"


@pytest.mark.full
def test_one_typed_as_a_source_is_played_with_its_settings(
    window: MainWindow, recording: Path, until
) -> None:
    window.history.change("Other", -1, functions_x=3)
    window.connection.sources.setCurrentText(f"replay:{recording}")
    window.connection.connect_button.click()
    until(lambda: window.display.badge.state.startswith("REPLAY"))
    assert window.history.settings.functions_x == 8


@pytest.mark.cases("no recording at all")
@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "expected a recording"),
        (b"no recording at all", "expected a recording"),
        (b"\x89MCAP0\r\n" + bytes(40), "not a valid recording"),
        (None, "cannot be read"),
    ],
)
def test_what_is_no_recording_is_refused_and_the_session_goes_on(
    window: MainWindow, tmp_path: Path, until, content: bytes | None, why: str
) -> None:
    file = tmp_path / "foreign.mcap"
    if content is not None:
        file.write_bytes(content)
    window.playback.open_file(file)
    panel = window.recording
    until(lambda: why in panel.message.text())
    assert "foreign.mcap" in panel.message.text()
    until(lambda: window.display.badge.state == "SIM")
    assert window.session.source == "sim:"


@pytest.mark.full
def test_one_of_a_later_version_is_refused(
    window: MainWindow, recording: Path, tmp_path: Path, until
) -> None:
    later = tmp_path / "later.mcap"
    later.write_bytes(
        recording.read_bytes().replace(b"format\x01\0\0\x001", b"format\x01\0\0\x009")
    )
    window.playback.open_file(later)
    until(lambda: "update this program" in window.recording.message.text())
    until(lambda: window.display.badge.state == "SIM")


@pytest.mark.full
def test_one_never_ended_is_played_up_to_where_it_breaks_off(
    window: MainWindow, recording: Path, tmp_path: Path, until
) -> None:
    with Recording(recording) as whole:
        within_the_last = whole.chunks[-1].at + 100
    part = tmp_path / "broken.mcap.part"
    part.write_bytes(recording.read_bytes()[:within_the_last])
    window.playback.open_file(part)
    until(lambda: window.display.badge.state.startswith("REPLAY"))
    assert "is unfinished" in window.recording.message.text()
    assert window.recording.copy_button.isVisibleTo(window.recording)
    until(lambda: "unfinished" in window.connection.device.text())


@pytest.mark.full
def test_one_that_goes_while_it_is_played_leaves_the_session(
    window: MainWindow, recording: Path, tmp_path: Path, until
) -> None:
    copy = tmp_path / "copy.mcap"
    copy.write_bytes(recording.read_bytes())
    window.playback.open_file(copy)
    until(lambda: window.display.badge.state.startswith("REPLAY"))
    os.truncate(copy, 100)
    window.playback.seek(2.2)
    until(lambda: window.display.badge.state == "LOST")
    until(lambda: "copy.mcap" in window.recording.message.text())
    assert window.session.alarm().startswith("LOST ")
    assert not window.transport.isVisible()
    window.actions_by_name["simulate"].trigger()
    until(lambda: window.display.badge.state == "SIM")


@pytest.mark.full
def test_estimates_are_those_recorded_until_they_are_to_be_recomputed(
    standing: MainWindow, until
) -> None:
    panel, recompute = standing.recording, standing.actions_by_name["replay-recompute"]
    until(lambda: standing.playback.made_by.startswith("Estimates as recorded by kappaskin "))
    assert "revision" in standing.playback.made_by
    assert panel.estimates.isVisibleTo(panel)
    assert recompute.text() == "&Recompute estimates"
    recompute.trigger()
    until(lambda: standing.playback.made_by.startswith("Estimates recomputed by kappaskin "))
    assert "; recorded by kappaskin " in standing.playback.made_by
    assert recompute.text() == "Show &recorded estimates"
    recompute.trigger()
    until(lambda: standing.playback.made_by.startswith("Estimates as recorded"))
    standing.history.change("Fewer", -1, functions_x=4)
    until(lambda: standing.playback.made_by.startswith("Estimates recomputed"))
