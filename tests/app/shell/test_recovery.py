import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from kappaskin_app.shell.recovery import LastSession, OpenWindow, Recovery, crashed, settings_text
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.shell.window_file import WindowFile

LAST = LastSession(Settings(functions_x=5), "sim:circle", "there.mcap")


def leave(folder: Path, last: LastSession = LAST) -> None:
    """As a window does that dies."""
    folder.mkdir(exist_ok=True)
    said = {"settings": json.loads(settings_text(last.settings)), "source": last.source}
    file = folder / "window-123456.json"
    file.write_text(json.dumps({**said, "recording": last.recording}))


@pytest.mark.full
def test_a_window_that_is_killed_leaves_what_it_was_at_once(tmp_path: Path) -> None:
    lines = (
        "import os, pathlib; from kappaskin_app.shell.recovery import *;"
        f"OpenWindow(pathlib.Path({str(tmp_path)!r})).keep(LastSession(Settings(functions_x=5),"
        " 'sim:circle', 'there.mcap')); os.kill(os.getpid(), 9)"
    )
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    killed = subprocess.run([sys.executable, "-c", lines], env=env, timeout=60)
    assert killed.returncode < 0
    assert crashed(tmp_path) == LAST
    assert crashed(tmp_path) is None
    assert not list(tmp_path.glob("*.json"))


def test_a_window_that_is_open_or_was_closed_has_not_crashed(tmp_path: Path) -> None:
    running = OpenWindow(tmp_path)
    running.keep(LAST)
    assert crashed(tmp_path) is None
    running.close()
    assert crashed(tmp_path) is None
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_read_is_forgotten(tmp_path: Path) -> None:
    (tmp_path / "window-1.json").write_text("{")
    assert crashed(tmp_path) is None
    assert list(tmp_path.iterdir()) == []


@pytest.mark.full
def test_after_a_crash_its_settings_are_offered_and_can_be_undone(
    window: MainWindow, tmp_path: Path, until
) -> None:
    leave(tmp_path)
    recovering = Recovery(window, tmp_path)
    assert window.display.banner.isVisible()
    texts = [button.text().replace("&", "") for button in window.display.banner.buttons]
    assert texts == ["Its settings", "Report\N{HORIZONTAL ELLIPSIS}"]  # the recording is gone
    window.display.banner.buttons[0].click()
    assert not window.display.banner.isVisible()
    assert window.history.settings.functions_x == 5
    window.history.stack.undo()
    assert window.history.settings.functions_x == 8
    until(lambda: any(tmp_path.glob("window-*.json")))  # what this one is at
    recovering.close()


@pytest.mark.full
def test_after_an_orderly_end_nothing_is_offered(window: MainWindow, tmp_path: Path) -> None:
    recovering = Recovery(window, tmp_path)
    assert not window.display.banner.isVisible()
    recovering.close()


@pytest.mark.cases(".part")
@pytest.mark.parametrize("suffix", ["", ".part"])
def test_a_recording_that_is_left_is_offered(
    window: MainWindow, tmp_path: Path, recording: Path, suffix: str, until
) -> None:
    there = tmp_path / "there.mcap"
    Path(f"{there}{suffix}").write_bytes(recording.read_bytes())
    leave(tmp_path / "open", LastSession(Settings(), "", str(there)))
    recovering = Recovery(window, tmp_path / "open")
    take = next(
        b for b in window.display.banner.buttons if "recording" in b.text().replace("&", "")
    )
    take.click()
    until(lambda: window.display.badge.state.startswith("REPLAY"))
    recovering.close()


@pytest.mark.full
def test_a_disk_that_hangs_leaves_the_window_live(
    window: MainWindow, tmp_path: Path, until, monkeypatch: pytest.MonkeyPatch
) -> None:
    hangs, waiting = threading.Event(), threading.Semaphore(0)
    monkeypatch.setattr(os, "fsync", lambda _: waiting.release() or hangs.wait(60))
    window.saver.begin(tmp_path / "window.toml")
    recovering = Recovery(window, tmp_path / "open")
    try:
        window.requests.set("theme", "light")
        window.layouts.save("Mine")
        until(lambda: waiting.acquire(blocking=False))
        until(lambda: waiting.acquire(blocking=False))
        drawn = window.session.estimate.sequence
        until(lambda: window.session.estimate.sequence > drawn + 100)
        assert not (tmp_path / "window.toml").exists()
    finally:
        hangs.set()
    recovering.close()
    window.close()
    assert WindowFile(tmp_path / "window.toml").read()[0].theme == "light"
    assert not list((tmp_path / "open").iterdir())


@pytest.mark.full
def test_where_the_state_cannot_be_saved_it_is_said_once(
    window: MainWindow, tmp_path: Path, until
) -> None:
    texts: list[str] = []
    window.session.reported.connect(lambda _: texts.append(window.statusBar().currentMessage()))
    recovering = Recovery(window, tmp_path / "open")
    (tmp_path / "open").rename(tmp_path / "gone")
    window.requests.set("functions_x", 5)
    until(lambda: any("the settings of this window could not be restored" in t for t in texts))
    recovering.close()
