"""Recording from the window: what is asked, shown, refused, and found afterwards."""

import os
import re
import shlex
import signal
import sys
from contextlib import closing
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QCloseEvent, QDesktopServices, QGuiApplication
from PySide6.QtWidgets import (
    QFileDialog,
    QInputDialog,
    QLineEdit,
    QMessageBox,
    QPushButton,
    QWidget,
)

from kappaskin import Recording
from kappaskin.live import LONGEST_NOTE
from kappaskin.recording import RecordingStatus
from kappaskin.recording.writing import RecordingFile
from kappaskin_app.shell.badge import Badge
from kappaskin_app.shell.folders import dated, newest, recordings_folder, unfinished
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.widgets.text import elapsed, file_size


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Nobody's own folder of recordings."""
    monkeypatch.setenv("XDG_DOCUMENTS_DIR", str(tmp_path / "documents"))
    assert recordings_folder().is_relative_to(tmp_path)
    return recordings_folder()


@pytest.fixture(autouse=True)
def no_dialog(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Nobody is asked for a file, unless a test says what to answer; the proposals."""
    proposals: list[str] = []

    def ask(*arguments: object) -> tuple[str, str]:
        proposals.append(str(arguments[2]))
        return "", ""

    monkeypatch.setattr(QFileDialog, "getSaveFileName", ask)
    return proposals


CTRL = Qt.KeyboardModifier.ControlModifier
ALT = Qt.KeyboardModifier.AltModifier


def _banner(window: MainWindow) -> tuple[str, list[str]]:
    """The words of the banner and of its buttons, while it is shown."""
    banner = window.display.banner
    if not banner.isVisible():
        return "", []
    return banner.words.text(), [button.text().replace("&", "") for button in banner.buttons]


def _button(window: MainWindow, text: str) -> QPushButton:
    buttons = window.display.banner.buttons
    return next(button for button in buttons if text in button.text().replace("&", ""))


def _places(window: MainWindow) -> list[tuple[QPoint, int, int]]:
    """Where everything in the header is, above its banner."""
    display = window.display
    parts = display.badge.parentWidget().findChildren(QWidget)
    above = [w for w in parts if w is not display.banner and not display.banner.isAncestorOf(w)]
    return [(w.mapTo(window, QPoint()), w.height(), w.x()) for w in above if w.isVisible()]


@pytest.fixture
def done(window: MainWindow, until, qtbot, folder: Path) -> Path:
    """A recording that was begun and ended with Ctrl+R."""
    qtbot.keyClick(window, Qt.Key.Key_R, CTRL)
    until(lambda: window.recorder.written.messages > 0)
    qtbot.keyClick(window, Qt.Key.Key_R, CTRL)
    until(lambda: bool(_banner(window)[1]))
    [path] = folder.iterdir()
    return path


def test_one_key_records_under_a_dated_name_and_no_header_shifts(
    window: MainWindow, until, qtbot, folder: Path, no_dialog: list[str]
) -> None:
    before, badge = _places(window), window.display.badge
    qtbot.keyClick(window, Qt.Key.Key_R, CTRL)
    until(lambda: badge.text().startswith("SIM\nREC 0:0"))
    assert badge.accessibleName() == "SIM, recording"
    assert window.recording.record.text() == "Stop"
    assert window.actions_by_name["record"].text() == "&Stop recording"
    during = _places(window)
    qtbot.keyClick(window, Qt.Key.Key_R, CTRL)
    until(lambda: badge.text() == "SIM")
    assert before == during == _places(window)
    assert no_dialog == []
    [path] = folder.iterdir()
    assert re.fullmatch(r"kappaskin-\d{8}-\d{6}\.mcap", path.name)
    with Recording(path) as recorded:
        assert recorded.whole
    assert window.recording.what.text().endswith(path.stem)


@pytest.mark.full
def test_a_recording_may_be_played_renamed_or_found_once_it_ends(
    window: MainWindow, done: Path
) -> None:
    words, buttons = _banner(window)
    assert re.fullmatch(r"Recorded 0:\d\d, [\d.]+ [kM]B:", words)
    assert buttons == ["Play", "Rename\N{HORIZONTAL ELLIPSIS}", "Show in folder"]


@pytest.mark.full
@pytest.mark.parametrize("keys", [True, False])
def test_play_plays_it_by_mouse_and_keyboard(
    keys: bool, window: MainWindow, done: Path, qtbot, until
) -> None:
    if keys:
        qtbot.keyClick(window, Qt.Key.Key_P, ALT)
    else:
        qtbot.mouseClick(_button(window, "Play"), Qt.MouseButton.LeftButton)
    until(lambda: window.display.badge.state.startswith("REPLAY"))
    assert window.session.source == f"replay:{done}"
    assert _banner(window) == ("", [])


@pytest.mark.full
def test_it_is_renamed_by_keyboard_and_nothing_is_written_over(
    window: MainWindow, done: Path, qtbot, until, folder: Path
) -> None:
    (folder / "there.mcap").write_bytes(b"mine")

    def press(key: Qt.Key) -> None:
        window.activateWindow()  # as a window manager does after a dialog
        until(window.isActiveWindow)
        qtbot.keyClick(window, key, ALT)

    def rename(text: str, key: Qt.Key = Qt.Key.Key_Return) -> str:
        press(Qt.Key.Key_M)
        until(lambda: any(d.isVisible() for d in window.findChildren(QInputDialog)))
        dialog = next(d for d in window.findChildren(QInputDialog) if d.isVisible())
        line = dialog.findChild(QLineEdit)
        line.selectAll()
        qtbot.keyClicks(line, text)
        qtbot.keyClick(line, key)
        until(lambda: bool(_banner(window)[1]))
        return _banner(window)[0]

    assert rename("there") == "there.mcap: already exists; choose another name."
    assert rename("a/b") == "Expected a name without a folder, got 'a/b'; choose another name."
    assert "choose another name" in rename("x", Qt.Key.Key_Escape)  # the banner as it was
    assert done.exists()
    assert (folder / "there.mcap").read_bytes() == b"mine"
    assert rename("press 1") == "Renamed to press 1.mcap:"
    assert sorted(path.name for path in folder.iterdir()) == ["press 1.mcap", "there.mcap"]
    press(Qt.Key.Key_P)
    until(lambda: window.session.source == f"replay:{folder / 'press 1.mcap'}")


@pytest.mark.full
def test_the_folder_is_shown_or_the_path_reported(
    window: MainWindow, done: Path, qtbot, monkeypatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(
        QDesktopServices, "openUrl", lambda url: bool(opened.append(url.toLocalFile()))
    )
    button = _button(window, "Show in folder")
    button.setFocus()
    qtbot.keyClick(button, Qt.Key.Key_Space)
    assert opened == [str(done.parent)]
    assert str(done) in window.statusBar().currentMessage()


@pytest.mark.full
def test_it_goes_on_when_the_source_changes(window: MainWindow, until) -> None:
    window.actions_by_name["record"].trigger()
    until(lambda: window.recorder.written.messages > 0)
    window.actions_by_name["disconnect"].trigger()
    until(lambda: window.display.badge.state == "OFF")
    assert window.recorder.recording
    window.actions_by_name["simulate"].trigger()
    until(lambda: window.display.badge.state == "SIM")
    messages = window.recorder.written.messages
    until(lambda: window.recorder.written.messages > messages + 50)


@pytest.mark.full
def test_a_note_goes_into_the_recording_and_the_list(
    window: MainWindow, until, folder: Path
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
    window.playback.open_file(next(folder.iterdir()))
    until(lambda: window.display.badge.state.startswith("REPLAY"))
    assert [event.text for event in window.playback.events] == ["another object"]


@pytest.mark.full
def test_one_that_ends_by_itself_says_so_until_it_is_seen(
    window: MainWindow, until, qtbot, folder: Path
) -> None:
    qtbot.keyClick(window, Qt.Key.Key_R, CTRL)
    until(lambda: window.recorder.written.messages > 0)
    [part] = folder.iterdir()
    part.rename(folder / "elsewhere")
    until(lambda: "moved or removed" in _banner(window)[0])
    assert "moved or removed" in window.recording.message.text()
    until(lambda: window.display.badge.text() == "SIM")  # what is live goes on
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    assert _banner(window) == ("", [])


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
    words, buttons = _banner(window)
    assert words.startswith("The recording x.mcap broke off: the engine process ended")
    assert buttons == ["Repair\N{HORIZONTAL ELLIPSIS}"]
    _button(window, "Repair").click()
    assert window.recorder.repairs.recording.text() == str(tmp_path / "x.mcap.part")
    window.recorder.repairs.close()
    window.actions_by_name["record"].trigger()
    until(lambda: (tmp_path / "x-2.mcap").exists() and not window.recorder.recording)
    until(lambda: _banner(window)[0].startswith("Recorded"))


@pytest.mark.full
def test_nothing_is_ever_written_over(window: MainWindow, tmp_path: Path, until) -> None:
    there = tmp_path / "there.mcap"
    there.write_bytes(b"mine")
    window.recorder.begin(there)
    until(lambda: "already exists" in window.recording.message.text())
    assert there.read_bytes() == b"mine"
    assert not window.recorder.recording


@pytest.mark.cases("/nowhere/at/all")
@pytest.mark.skipif(os.name != "posix", reason="the names are of a POSIX system")
@pytest.mark.parametrize("place", ["/proc/nowhere/x.mcap", "/nowhere/at/all.mcap"])
def test_a_place_that_cannot_be_written_to_is_refused(
    window: MainWindow, until, place: str
) -> None:
    window.recorder.begin(Path(place))
    until(lambda: "cannot be written" in window.recording.message.text())
    assert "choose another place" in _banner(window)[0]
    until(lambda: window.display.badge.state == "SIM")


@pytest.mark.full
def test_where_the_folder_cannot_be_made_another_place_is_offered(
    window: MainWindow, folder: Path, until, qtbot, no_dialog, monkeypatch, tmp_path: Path
) -> None:
    folder.parent.parent.mkdir(parents=True, exist_ok=True)
    folder.parent.write_bytes(b"a file")
    qtbot.keyClick(window, Qt.Key.Key_R, CTRL)
    until(lambda: "cannot be written (Not a directory); choose" in _banner(window)[0])
    [elsewhere] = window.display.banner.buttons
    qtbot.mouseClick(elsewhere, Qt.MouseButton.LeftButton)
    assert re.fullmatch(r"kappaskin-\d{8}-\d{6}\.mcap", Path(no_dialog[0]).name)
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(tmp_path / "other"), ""))
    window.recorder._record_elsewhere()  # noqa: SLF001 - its button is gone once pressed
    until(lambda: window.recorder.recording)
    qtbot.keyClick(window, Qt.Key.Key_R, CTRL)
    until(lambda: (tmp_path / "other.mcap").exists())


@pytest.mark.full
def test_one_that_a_full_disk_ends_is_whole_up_to_then_and_is_offered(
    window: MainWindow, until, tmp_path: Path
) -> None:
    (tmp_path / "x.mcap").write_bytes(b"complete")
    status = RecordingStatus(str(tmp_path / "x.mcap"), True, 11.0, 9_900_000, 100)
    full = f"{tmp_path / 'x.mcap'}: No space left on device; it is complete up to that time"
    window.session.timer.stop()
    window.recorder.follow(replace(window.session.status, recording=status))
    ended = replace(status, active=False, trouble=full)
    window.recorder.follow(replace(window.session.status, recording=ended))
    words, buttons = _banner(window)
    assert words == f"{full}."
    assert buttons[0] == "Play"
    window.session.timer.start()


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


def test_names_proposed_are_of_nothing_that_is_there(folder: Path) -> None:
    now = datetime(2026, 11, 22, 7, 5, 9)
    names = []
    for suffix in ("", ".part", ""):
        path = dated(now, ".mcap")
        assert path.parent == folder
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
    assert [file_size(n) for n in (0, 999, 3_400, 12_345_678, 7_250_000_000)] == [
        "0 B",
        "999 B",
        "3.4 kB",
        "12.3 MB",
        "7.2 GB",
    ]
    assert [elapsed(s) for s in (0.9, 61.0, 3723.0)] == ["0:00", "1:01", "1:02:03"]


def test_what_is_lost_is_shown_in_the_header(qtbot) -> None:
    badge = Badge()
    qtbot.addWidget(badge)
    badge.show_state("SIM", RecordingStatus("x.mcap", True, 65.0, 5_000_000, 100, 7))
    assert badge.text() == "SIM\nREC 7 lost"
    assert "5.0 MB, 7 lost because of a slow disk" in badge.toolTip()
    badge.show_state("SIM", RecordingStatus("x.mcap", True, 3723.0, 5_000_000, 100, 0))
    assert badge.text() == "SIM\nREC 1:02:03"
