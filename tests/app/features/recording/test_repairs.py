"""A damaged recording in the window: a repair is offered, and writes a whole one beside it."""

import os
from contextlib import closing
from pathlib import Path

import pytest

from kappaskin import Event, Recording
from kappaskin.recording import Recorder
from kappaskin_app.features.recording.recorder import RepairDialog
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.window import MainWindow


@pytest.fixture(autouse=True)
def documents(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody's own folder of recordings."""
    monkeypatch.setenv("XDG_DOCUMENTS_DIR", str(tmp_path / "documents"))


@pytest.fixture
def broken(recording: Path, tmp_path: Path) -> Path:
    """One that breaks off within its last chunk, as a killed process leaves it."""
    with Recording(recording) as whole:
        within_the_last = whole.chunks[-1].at + 100
    path = tmp_path / "broken.mcap.part"
    path.write_bytes(recording.read_bytes()[:within_the_last])
    return path


@pytest.fixture
def dialog(qapp, qtbot) -> RepairDialog:
    dialog = RepairDialog(Tasks(qapp))
    qtbot.addWidget(dialog)
    return dialog


@pytest.mark.full
def test_one_that_breaks_off_is_repaired_beside_it_and_played(
    window: MainWindow, broken: Path, until
) -> None:
    was, panel = broken.read_bytes(), window.recording
    window.panels.turn(1)
    window.playback.open_file(broken)
    until(panel.repair.isVisible)  # on its page
    panel.repair.click()
    dialog = window.recorder.repairs
    assert dialog.to.text() == str(broken.with_name("broken-repaired.mcap"))
    dialog.begin_button.click()
    until(lambda: window.windowTitle().startswith("broken-repaired.mcap"))
    with Recording(broken.with_name("broken-repaired.mcap")) as saved:
        assert saved.whole
        assert f"{sum(saved.counts.values()):,} messages" in dialog.words.text()
    assert broken.read_bytes() == was
    until(lambda: not panel.offer.isVisible())
    dialog.close()


@pytest.mark.full
def test_damage_found_while_it_is_played_is_offered_to_be_repaired(
    window: MainWindow, recording: Path, tmp_path: Path, until
) -> None:
    copy, panel = tmp_path / "copy.mcap", window.recording
    copy.write_bytes(recording.read_bytes())
    window.playback.open_file(copy)
    until(lambda: window.display.badge.state.startswith("REPLAY"))
    assert not panel.offer.isVisibleTo(panel)
    with Recording(copy) as whole:
        third = whole.chunks[2].at
    os.truncate(copy, third + 50)
    window.playback.seek(2.2)
    until(panel.repair.isVisible)
    assert "is damaged at byte" in panel.message.text()


@pytest.mark.full
def test_a_file_of_another_kind_is_not_offered(window: MainWindow, tmp_path: Path, until) -> None:
    path, panel = tmp_path / "picture.mcap", window.recording
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(500))
    window.playback.open_file(path)
    until(lambda: "expected a recording" in panel.message.text())
    assert not panel.offer.isVisibleTo(panel)


@pytest.mark.full
def test_one_without_readings_is_not_offered(window: MainWindow, tmp_path: Path, until) -> None:
    path, panel, settings = tmp_path / "empty.mcap", window.recording, window.history.settings
    with closing(Recorder(path, 0.0)) as recorder:
        recorder.add_event(Event(0.0, "note", "nothing else"))
    window.playback.open_file(path)
    reason = window.connection.message
    until(lambda: "expected a recording with bytes of a device" in reason.text())
    assert "The simulation stays connected." in reason.text()
    assert "is not played" in window.statusBar().currentMessage()
    assert window.playback.summary is None
    assert window.history.settings == settings
    assert not panel.offer.isVisibleTo(panel)


def test_one_given_up_leaves_the_damaged_one_alone(dialog: RepairDialog, broken: Path) -> None:
    dialog.ask_of(broken)
    dialog.begin_button.click()
    assert not dialog.to.isEnabled()
    dialog.cancel_button.click()
    assert "nothing was written" in dialog.words.text()
    assert [path.name for path in broken.parent.glob("broken*")] == [broken.name]


def test_no_file_is_written_over(dialog: RepairDialog, broken: Path) -> None:
    there = broken.with_name("broken-repaired.mcap")
    there.write_bytes(b"mine")
    dialog.ask_of(broken)
    assert dialog.to.text() == str(broken.with_name("broken-repaired-2.mcap"))
    dialog.to.setText(str(there))
    dialog.begin_button.click()
    assert "already exists" in dialog.words.text()
    assert there.read_bytes() == b"mine"


def test_where_nothing_is_whole_nothing_is_written(
    dialog: RepairDialog, broken: Path, until
) -> None:
    broken.write_bytes(broken.read_bytes()[:60])
    dialog.ask_of(broken)
    dialog.begin_button.click()
    until(lambda: not dialog.busy)
    assert dialog.words.text().startswith("Nothing was written: no message could be saved")
