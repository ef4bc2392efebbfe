import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest
from PySide6.QtGui import QImage

from kappaskin import Cap
from kappaskin.cli import main
from kappaskin_app.shell.badge import SIM, STALE, WAITING, colour_of
from kappaskin_app.shell.simulation import scene_of, settings_for
from kappaskin_app.shell.window_file import WindowFile, WindowState
from kappaskin_app.theme import DARK


def run(*arguments: str, **more: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "kappaskin", "app", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, **more)


def test_the_app_opens_takes_its_picture_and_closes(tmp_path: Path) -> None:
    picture, config = tmp_path / "window.png", {"XDG_CONFIG_HOME": str(tmp_path)}
    WindowFile(tmp_path / "kappaskin" / "window.toml").write(WindowState(theme="light"))
    asked = ("--source", "sim:line", "--seconds", "4", "--screenshot", str(picture))
    done = run(*asked, env=os.environ | config)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert QImage(str(picture)).size().toTuple() == (1280, 800)
    # The same for everybody, whatever theme is kept: beside the menus is the first theme's ground.
    assert QImage(str(picture)).pixelColor(800, 10).name() == DARK.window


def _forks(process: psutil.Process) -> bool:
    with suppress(psutil.NoSuchProcess):  # one that looks for a library, as it is loaded
        return "forkserver" in " ".join(process.cmdline())
    return False


def _lives(process: psutil.Process) -> bool:
    with suppress(psutil.NoSuchProcess):
        return process.status() != psutil.STATUS_ZOMBIE  # which is the system's
    return False


@pytest.mark.cases("15-loading")
@pytest.mark.parametrize("pause", [0.0, 3.0], ids=["loading", "shown"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_closes_the_app_and_leaves_nothing(number: int, pause: float) -> None:
    command = [sys.executable, "-m", "kappaskin", "app", "--seconds", "120"]
    app = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    parent = psutil.Process(app.pid)
    end = time.monotonic() + 30
    while time.monotonic() < end and not any(map(_forks, parent.children())):
        time.sleep(0.05)
    time.sleep(pause)
    children = parent.children(recursive=True)
    app.send_signal(number)
    told = app.communicate(timeout=100)
    assert (app.returncode, *told) == (0, "", "")
    end = time.monotonic() + 30
    while (left := [one for one in children if _lives(one)]) and time.monotonic() < end:
        time.sleep(0.02)
    assert left == []


@pytest.mark.full
def test_a_picture_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    done = run("--seconds", "1", "--screenshot", str(tmp_path / "nowhere" / "a.png"))
    assert done.returncode == 2
    assert "cannot be written" in done.stderr


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="it has a display of its own")
def test_a_display_that_does_not_answer_is_named() -> None:
    gone = {name: value for name, value in os.environ.items() if name != "WAYLAND_DISPLAY"}
    done = run("--seconds", "1", env=gone | {"DISPLAY": ":9123"})
    assert done.returncode == 2
    assert done.stderr.startswith("kappaskin: expected a display at :9123 (DISPLAY), got no conn")
    assert done.stderr.count("\n") == 1


def test_without_a_display_the_remedy_is_named() -> None:
    bare = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = run("--seconds", "1", env=bare)
    assert done.returncode == 2
    assert "`xvfb-run kappaskin app`" in done.stderr  # where there is no project's folder
    assert "packaging/start.py" in done.stderr
    assert "Traceback" not in done.stderr


def test_the_help_names_the_sources_of_the_window() -> None:
    text = run("--help").stdout
    assert all(source in text for source in ("sim:SCENE", "replay:FILE", "engine:HOST", "a port"))


def test_asking_for_help_loads_no_qt() -> None:
    code = "import sys, kappaskin_app.command; print('PySide6' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.strip() == "False"


def demo(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "kappaskin", "demo", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.full
def test_the_demonstration_opens_fills_the_picture_and_closes(tmp_path: Path) -> None:
    picture = tmp_path / "demo.png"
    done = demo("--seconds", "4", "--screenshot", str(picture))
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    shown = QImage(str(picture))
    row = shown.height() // 25  # of the badge, where else the menus are
    strip = {shown.pixelColor(x, row).name() for x in range(shown.width() // 8)}
    assert strip & {colour_of(state, DARK) for state in (SIM, STALE, WAITING)}


@pytest.mark.parametrize(
    "bad", [("--seconds", "0"), ("--seconds", "nan"), ("--seconds", "1e300"), ("--source", "sim:")]
)
def test_a_demonstration_that_cannot_be_is_refused(bad: tuple[str, ...]) -> None:
    done = demo(*bad)
    assert done.returncode == 2
    assert done.stderr.startswith("kappaskin: ")
    assert "Traceback" not in done.stderr


_OPENED = """
import gc, sys, threading, time
from kappaskin_app.launch import opened

class Noted:
    thread = None
    def find_spec(self, name, path=None, target=None):
        if name == "pyqtgraph":
            Noted.thread = threading.current_thread()

def main():
    application, window = opened("sim:")
    sys.meta_path.insert(0, Noted())
    assert "pyqtgraph" not in sys.modules
    assert not gc.isenabled()
    end = time.monotonic() + 60
    while Noted.thread is None or Noted.thread.is_alive():
        application.processEvents()
        assert time.monotonic() < end
    assert Noted.thread is not threading.main_thread()
    assert "pyqtgraph" in sys.modules
    window.close()
    assert gc.isenabled()

if __name__ == "__main__":
    main()
"""


@pytest.mark.full
def test_a_window_loads_what_charts_need_in_another_thread_and_collects_garbage_in_its_own(
    tmp_path: Path,
) -> None:
    program = tmp_path / "opened.py"
    program.write_text(_OPENED)
    done = subprocess.run([sys.executable, str(program)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_app_opens_on_a_fingertip_without_a_source(monkeypatch) -> None:
    started: list[str] = []
    monkeypatch.setattr(
        "kappaskin_app.launch.launch", lambda sources, *_: started.extend(sources.values())
    )
    assert main(["app"]) == 0
    settings = settings_for(*started)
    scene = scene_of(settings)
    assert isinstance(scene.plate.patch, Cap)
    assert (scene.plate.patch.radii, len(scene.layout)) == ((0.008, 0.008), 60)
