"""Recording from the window: what is asked, shown, refused, and found afterwards."""

import os
import shlex
import signal
import sys
from contextlib import closing
from datetime import datetime
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QCloseEvent, QGuiApplication
from PySide6.QtWidgets import QFileDialog, QInputDialog, QLineEdit, QMessageBox

from kappaskin import Recording
from kappaskin.live import LONGEST_NOTE
from kappaskin.recording import RecordingStatus
from kappaskin.recording.writing import RecordingFile
from kappaskin_app.features.recording.recorder import RecordingMark, duration_of, size_of
from kappaskin_app.shell.folders import newest, proposed, recordings_folder, unfinished
from kappaskin_app.shell.window import MainWindow


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Nobody's own folder of recordings."""
    monkeypatch.setenv("XDG_DOCUMENTS_DIR", str(tmp_path / "documents"))
    assert recordings_folder().is_relative_to(tmp_path)
    return recordings_folder()


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """What was proposed where a recording was to go, which is taken."""
    proposals: list[Path] = []

    def ask(*arguments: object) -> tuple[str, str]:
        proposals.append(Path(str(arguments[2])))
        return str(proposals[-1]), ""

    monkeypatch.setattr(QFileDialog, "getSaveFileName", ask)
    return proposals


def _mark(window: MainWindow) -> RecordingMark:
    return window.mark


@pytest.mark.full
def test_a_recording_is_begun_shown_and_ended(
    window: MainWindow, asked: list[Path], until, folder: Path
) -> None:
    action = window.actions_by_name["record"]
    assert not _mark(window).isVisible()
    action.trigger()
    until(lambda: window.recorder.recording)
    assert asked[0].parent == folder
    until(lambda: _mark(window).isVisible() and _mark(window).head.startswith("REC 0:0"))
    until(lambda: action.text() == "&Stop recording")
    assert window.recording.record.text() == "Stop"
    action.trigger()
    until(lambda: not _mark(window).isVisible())
    assert window.recording.what.text().endswith(asked[0].name)
    assert window.statusBar().currentMessage().startswith(f"Recorded {asked[0]}")
    with Recording(asked[0]) as recorded:
        assert recorded.whole


@pytest.mark.full
def test_it_goes_on_when_the_source_changes(window: MainWindow, asked: list[Path], until) -> None:
    window.actions_by_name["record"].trigger()
    until(lambda: window.recorder.written.messages > 0)
    window.actions_by_name["disconnect"].trigger()
    until(lambda: window.display.badge.state == "OFF")
    assert window.recorder.recording
    window.actions_by_name["simulate"].trigger()
    until(lambda: window.display.badge.state == "SIM")
    messages = window.recorder.written.messages
    until(lambda: window.recorder.written.messages > messages + 50)
    assert _mark(window).isVisible()


@pytest.mark.full
def test_a_note_goes_into_the_recording_and_the_list(
    window: MainWindow, asked: list[Path], until
) -> None:
    window.actions_by_name["record"].trigger()
    until(lambda: window.recorder.recording)
    window.actions_by_name["note"].trigger()
    (dialog,) = window.findChildren(QInputDialog)
    assert dialog.findChild(QLineEdit).maxLength() == LONGEST_NOTE
    dialog.setTextValue("  another object  ")
    dialog.accept()
    until(lambda: "note:  another object" in window.event_log.list.toPlainText())
    window.recorder.write_down("   ")
    window.actions_by_name["record"].trigger()
    until(lambda: not window.recorder.recording)
    window.playback.open_file(asked[0])
    until(lambda: window.display.badge.state.startswith("REPLAY"))
    assert [event.text for event in window.playback.events] == ["another object"]


@pytest.mark.full
def test_one_that_ends_by_itself_says_so_until_it_is_seen(
    window: MainWindow, asked: list[Path], until
) -> None:
    window.actions_by_name["record"].trigger()
    until(lambda: window.recorder.written.messages > 0)
    Path(f"{asked[0]}.part").rename(f"{asked[0]}.elsewhere")
    until(lambda: bool(window.recorder.ended))
    assert "moved or removed" in window.recording.message.text()
    assert _mark(window).isVisible()
    assert _mark(window).head == "REC ended"
    until(lambda: window.display.badge.state == "SIM")  # what is live goes on
    _mark(window).clicked.emit()
    until(lambda: not _mark(window).isVisible())


@pytest.mark.full
def test_one_that_breaks_off_with_the_engine_is_said_to_while_the_next_goes_on(
    window: MainWindow, until, tmp_path: Path
) -> None:
    texts: list[str] = []
    window.recorder.notified.connect(texts.append)
    window.recorder.begin(tmp_path / "x.mcap")
    until(lambda: window.recorder.written.messages > 0)
    assert window.session.engine.pid is not None
    os.kill(window.session.engine.pid, signal.SIGKILL)
    until(lambda: window.recorder.written.path.endswith("x-2.mcap"))
    assert [text.partition(":")[0] for text in texts] == ["the recording x.mcap broke off"]
    assert window.recorder.message == texts[0]
    assert window.recorder.damaged == tmp_path / "x.mcap.part"
    assert window.recording.offer.isVisibleTo(window.recording)
    window.actions_by_name["record"].trigger()
    until(lambda: (tmp_path / "x-2.mcap").exists() and not window.recorder.recording)
    until(lambda: not _mark(window).isVisible())  # the error was of the one before


@pytest.mark.full
def test_nothing_is_ever_written_over(window: MainWindow, tmp_path: Path, until) -> None:
    there = tmp_path / "there.mcap"
    there.write_bytes(b"mine")
    window.recorder.begin(there)
    until(lambda: "already exists" in window.recording.message.text())
    assert there.read_bytes() == b"mine"
    assert not window.recorder.recording
    assert not _mark(window).isVisible()  # it never began


@pytest.mark.cases("/nowhere/at/all")
@pytest.mark.skipif(os.name != "posix", reason="the names are of a POSIX system")
@pytest.mark.parametrize("place", ["/proc/nowhere/x.mcap", "/nowhere/at/all.mcap"])
def test_a_place_that_cannot_be_written_to_is_refused(
    window: MainWindow, until, place: str
) -> None:
    window.recorder.begin(Path(place))
    until(lambda: "cannot be written" in window.recording.message.text())
    until(lambda: window.display.badge.state == "SIM")


@pytest.mark.full
def test_a_folder_that_cannot_be_made_is_told_and_another_asked_for(
    window: MainWindow,
    folder: Path,
    asked: list[Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    folder.parent.parent.mkdir(parents=True, exist_ok=True)
    folder.parent.write_bytes(b"a file")
    window.actions_by_name["record"].trigger()
    assert "cannot be made" in window.statusBar().currentMessage()
    assert asked[0].name == str(asked[0])


@pytest.mark.full
def test_what_was_never_ended_is_offered_to_be_repaired(opened, until, folder: Path) -> None:
    folder.mkdir(parents=True)
    (folder / "it's mine.mcap.part").write_bytes(b"")
    window = opened("sim:")
    until(lambda: window.display.badge.state == "SIM")
    text = window.recording.message.text()
    assert "it's mine.mcap.part is unfinished" in text
    window.recording.copy_button.click()
    command = QGuiApplication.clipboard().text()
    assert command.startswith("kappaskin repair ")
    assert shlex.split(command)[2:] == [
        str(folder / "it's mine.mcap.part"),
        "--out",
        str(folder / "it's mine-repaired.mcap"),
    ]


@pytest.mark.skipif(sys.platform == "win32", reason="nothing there tells who writes a file")
def test_what_another_window_writes_is_not_offered(folder: Path) -> None:
    folder.mkdir(parents=True)
    with closing(RecordingFile(folder / "other.mcap")):
        assert unfinished(folder) == []
    (folder / "left.mcap.part").write_bytes(b"")
    assert unfinished(folder) == [folder / "left.mcap.part"]


# The end.


class _Clicked(QCloseEvent):
    """The window's own cross, clicked."""

    def spontaneous(self) -> bool:
        return True


@pytest.fixture
def taped(window: MainWindow, tmp_path: Path, until) -> MainWindow:
    """The window, recording to `taped.mcap`."""
    window.recorder.begin(tmp_path / "taped.mcap")
    until(lambda: window.recorder.recording)
    return window


def _boxes(window: MainWindow) -> list[QMessageBox]:
    return [box for box in window.findChildren(QMessageBox) if box.isVisible()]


@pytest.mark.full
def test_closing_while_recording_asks_once_by_mouse_and_keyboard(
    taped: MainWindow, qtbot, until
) -> None:
    event = _Clicked()
    taped.closeEvent(event)
    assert not event.isAccepted()
    taped.actions_by_name["quit"].trigger()
    [box] = _boxes(taped)
    assert "taped.mcap is being recorded" in box.text()
    qtbot.keyClick(box, Qt.Key.Key_Escape)
    until(lambda: not _boxes(taped))
    assert taped.isVisible()
    assert taped.recorder.recording
    taped.actions_by_name["quit"].trigger()
    [box] = _boxes(taped)
    qtbot.keyClick(box, Qt.Key.Key_Return)  # nothing is ended by a key that slips
    until(lambda: not _boxes(taped))
    assert taped.isVisible()


@pytest.mark.full
def test_the_answer_to_end_it_closes_and_leaves_a_whole_file(
    taped: MainWindow, tmp_path: Path, qtbot, until
) -> None:
    taped.actions_by_name["quit"].trigger()
    [box] = _boxes(taped)
    qtbot.mouseClick(box.buttons()[0], Qt.MouseButton.LeftButton)
    until(lambda: not taped.isVisible())
    assert not _boxes(taped)
    with Recording(tmp_path / "taped.mcap") as recorded:
        assert recorded.whole


@pytest.mark.full
def test_a_run_that_closes_by_itself_asks_nothing(taped: MainWindow, tmp_path: Path) -> None:
    taped.close()
    assert not _boxes(taped)
    assert not taped.isVisible()
    assert (tmp_path / "taped.mcap").exists()


# The folder.


def test_names_proposed_are_of_nothing_that_is_there(tmp_path: Path) -> None:
    now = datetime(2026, 11, 22, 7, 5, 9)
    names = []
    for suffix in ("", ".part", ""):
        path = proposed(tmp_path, now)
        names.append(path.name)
        path.with_name(path.name + suffix).write_bytes(b"")
    assert names == [f"kappaskin-20261122-070509{n}.mcap" for n in ("", "-2", "-3")]


@pytest.mark.skipif(sys.platform == "win32", reason="every user has a home directory")
def test_without_a_home_directory_recordings_are_proposed_here(monkeypatch) -> None:
    for name in ("HOME", *(name for name in os.environ if name.startswith("XDG_"))):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    assert recordings_folder() == Path.cwd() / "Kappaskin"


def test_the_newest_come_first_and_only_eight(tmp_path: Path) -> None:
    for k in range(12):
        path = tmp_path / f"{k}.mcap"
        path.write_bytes(b"")
        os.utime(path, (k, k))
    (tmp_path / "x.mcap.part").write_bytes(b"")
    assert [path.stem for path in newest(tmp_path)] == [str(k) for k in range(11, 3, -1)]
    assert [path.name for path in unfinished(tmp_path)] == ["x.mcap.part"]
    assert newest(tmp_path / "nowhere") == []


def test_a_link_that_leads_nowhere_hides_no_recording(tmp_path: Path) -> None:
    (tmp_path / "there.mcap").touch()
    (tmp_path / "gone.mcap").symlink_to(tmp_path / "nowhere.mcap")
    assert newest(tmp_path) == [tmp_path / "there.mcap"]


def test_figures_of_a_recording_are_short() -> None:
    assert [size_of(n) for n in (0, 999, 3_400, 12_345_678, 7_250_000_000)] == [
        "0 B",
        "999 B",
        "3.4 kB",
        "12.3 MB",
        "7.2 GB",
    ]
    assert [duration_of(s) for s in (0.9, 61.0, 3723.0)] == ["0:00", "1:01", "1:02:03"]


def test_what_is_lost_is_shown_in_the_header(qtbot) -> None:
    mark = RecordingMark()
    qtbot.addWidget(mark)
    mark.show_written(RecordingStatus("x.mcap", True, 65.0, 5_000_000, 100, 7), "")
    assert (mark.head, mark.below) == ("REC 1:05", "7 lost")
    assert mark.accessibleName() == "REC 1:05, 7 lost"
    assert "5.0 MB, 7 messages lost" in mark.toolTip()
    mark.show_written(RecordingStatus("x.mcap", True, 3723.0, 5_000_000, 100, 0), "")
    assert (mark.head, mark.below) == ("1:02:03", "5.0 MB")
