"""The app under faults: stopped, without its engine, display, disk, recording or device."""

import json
import math
import os
import re
import runpy
import select
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import psutil
import pytest

from kappaskin.recording import Recording
from kappaskin.recording.writing import part_of

pytestmark = [
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="it stops processes by Linux"),
    pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no virtual display to take away"),
]

_START = runpy.run_path(str(Path(__file__).parents[2] / "packaging" / "start.py"))
_REPLY = 60.0  # s that an answer of the window may take, on a busy machine
_STOPPED = 10.0  # s that a process is stopped

_DRIVEN = """
import json, queue, sys, threading, traceback
from pathlib import Path
from kappaskin.cli import main
from kappaskin_app import launch

asked, opened = queue.SimpleQueue(), launch.opened

def read():
    for line in sys.stdin:
        asked.put(json.loads(line))

def driven(*about, **how):
    from PySide6.QtCore import QTimer
    application, window = opened(*about, **how)
    parts = {name: part for each in window.features.values() for name, part in vars(each).items()}
    names = {**parts, "window": window, "session": window.session, "Path": Path}
    def answer():
        while not asked.empty():
            try:
                said = eval(asked.get(), names)
            except Exception:
                said = traceback.format_exc()
            print(json.dumps(said, default=str), flush=True)
    timer = QTimer(window, interval=10)
    timer.timeout.connect(answer)
    timer.start()
    threading.Thread(target=read, daemon=True).start()
    return application, window

launch.opened = driven
sys.exit(main(sys.argv[1:]))
"""


class App:
    """The app in a process of its own, which answers expressions of its window's parts."""

    def __init__(
        self, display: dict[str, str], home: Path, *arguments: str, command: str = "app"
    ) -> None:
        plain = {name: value for name, value in display.items() if not name.startswith("XDG_")}
        self._errors = (home / "errors.txt").open("w+")
        self.process = subprocess.Popen(
            [sys.executable, "-c", _DRIVEN, command, *arguments],
            env=plain | {"HOME": str(home)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
        )
        self._pid = psutil.Process(self.process.pid)

    def ask(self, expression: str) -> Any:
        """The value of an expression in the window's process."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        print(json.dumps(expression), file=self.process.stdin, flush=True)
        ready, _, _ = select.select([self.process.stdout], [], [], _REPLY)
        assert ready, f"no answer to {expression}"
        line = self.process.stdout.readline()
        assert line, f"it ended: {self.errors}"
        value = json.loads(line)
        assert not str(value).startswith("Traceback"), value
        return value

    def until(self, expression: str, within: float = _REPLY) -> Any:
        """The first value of an expression that is true."""
        end = time.monotonic() + within
        while not (value := self.ask(expression)):
            assert time.monotonic() < end, f"never true: {expression}"
            time.sleep(0.02)
        return value

    def connected(self, badge: str = "SIM") -> "App":
        self.until(f"window.display.badge.state == {badge!r}")
        return self

    @property
    def badge(self) -> str:
        return self.ask("window.display.badge.state")

    @property
    def message(self) -> str:
        return self.ask("session.status.message")

    @property
    def shows_numbers(self) -> bool:
        return self.ask("window.display.estimate_shown() is not None")

    @property
    def engine(self) -> psutil.Process:
        return psutil.Process(self.ask("session.engine.pid"))

    @property
    def errors(self) -> str:
        self._errors.seek(0)
        return self._errors.read()

    def record(self, path: Path) -> None:
        self.ask(f"recorder.begin(Path({str(path)!r}))")
        self.until("recorder.written.messages > 500")

    def stop_recording(self) -> None:
        self.ask("recorder.toggle()")
        self.until("not recorder.recording")

    def end(self) -> int:
        """Close it as a signal does; its exit code."""
        self.process.terminate()
        return self.process.wait(30)

    def close(self) -> None:
        """End it by force, where it has not ended."""
        if self.process.poll() is None:
            for child in self._pid.children(recursive=True):
                with suppress(psutil.NoSuchProcess):
                    child.resume()
            self.process.kill()
        for pipe in (self.process.stdin, self.process.stdout, self._errors):
            if pipe is not None:
                pipe.close()
        self.process.wait(30)


@pytest.fixture
def display() -> Iterator[dict[str, str]]:
    with _START["virtual_display"](dict(os.environ)) as variables:
        yield variables


@contextmanager
def _opened(
    display: dict[str, str], home: Path, *arguments: str, command: str = "app"
) -> Iterator[App]:
    app = App(display, home, *arguments, command=command)
    try:
        yield app
    finally:
        app.close()


@pytest.fixture
def home() -> Iterator[Path]:
    """A home directory of a short name, as homes have: a socket's path is limited."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


@pytest.fixture
def app(display: dict[str, str], home: Path) -> Iterator[App]:
    """The app on the simulated skin."""
    with _opened(display, home) as opened:
        yield opened.connected()


def _checked(path: Path) -> Recording:
    with Recording(path) as recording:
        assert recording.whole
        assert recording.counts
    return recording


# Without its engine.


def test_an_engine_that_is_killed_is_replaced_and_the_recording_is_said_to_break_off(
    app: App, tmp_path: Path
) -> None:
    app.record(tmp_path / "x.mcap")
    app.engine.kill()
    app.until("recorder.written.path.endswith('x-2.mcap')")
    assert app.ask("recorder.message").startswith("the recording x.mcap broke off: ")
    assert app.ask("str(recorder.damaged)").endswith("x.mcap.part")
    assert "started again" in app.ask("event_log.list.toPlainText()")
    app.connected()
    app.stop_recording()
    _checked(tmp_path / "x-2.mcap")
    out = tmp_path / "whole.mcap"
    line = app.ask("recorder.message").split("`")[1].split()
    assert line[:2] == ["kappaskin", "repair"]
    command = [sys.executable, "-m", *line[:-1], str(out)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
    _checked(out)
    assert app.end() == 0


def test_an_engine_that_dies_again_and_again_is_said_to_and_nothing_looks_live(
    app: App, tmp_path: Path
) -> None:
    app.record(tmp_path / "x.mcap")
    for _ in range(3):
        engine = app.engine
        engine.kill()
        other = f"(session.engine.alive and session.engine.pid != {engine.pid})"
        app.until(f"session.engine.given_up or {other}")
    app.until("'ended 3 times within 10 s' in session.status.message")
    app.until("window.display.badge.state == 'LOST'")
    assert not app.shows_numbers
    assert app.ask("session.status.rate") == 0.0
    assert not app.ask("recorder.recording")
    assert not app.ask("window.display.badge.text().endswith('recording')")
    app.ask("session.request_source('sim:')")
    app.connected()
    assert app.end() == 0


@pytest.mark.parametrize("stopped", ["window", "engine", "both"])
def test_stopped_for_ten_seconds_nothing_old_looks_new_and_the_recording_is_whole(
    app: App, tmp_path: Path, stopped: str
) -> None:
    path = tmp_path / "x.mcap"
    app.record(path)
    engine, window = app.engine, psutil.Process(app.process.pid)
    held = {"window": [window], "engine": [engine], "both": [window, engine]}[stopped]
    for process in held:
        process.suspend()
    end = time.monotonic() + _STOPPED
    if stopped == "engine":
        app.until("window.display.badge.state == 'STALE'", within=2.0)
        assert not app.shows_numbers
        app.until("'has not reported for' in session.status.message", within=5.0)
        assert app.ask("session.status.rate") == 0.0
    time.sleep(max(0.0, end - time.monotonic()))
    for process in held:
        process.resume()
    app.connected()
    app.until("not session.status.message and session.status.rate > 100")
    assert (app.engine.pid, app.ask("recorder.message")) == (engine.pid, "")
    app.stop_recording()
    _checked(path)
    assert app.end() == 0


# Without its display.


def test_without_its_display_it_ends_and_the_next_window_goes_on_with_the_recording(
    home: Path,
    tmp_path: Path,
) -> None:
    path, server = tmp_path / "x.mcap", ExitStack()
    with server, ExitStack() as windows:
        display = server.enter_context(_START["virtual_display"](dict(os.environ)))
        lost = windows.enter_context(_opened(display, home)).connected()
        lost.record(path)
        engine = lost.engine
        server.close()
        assert lost.process.wait(20) != 0
        assert "X11 connection broke" in lost.errors
    size = part_of(path).stat().st_size
    with _START["virtual_display"](dict(os.environ)) as other, _opened(other, home) as app:
        app.connected()
        assert app.engine.pid == engine.pid
        assert "continued for" in app.ask("recorder.message")
        app.until(f"recorder.written.size > {size}")
        app.stop_recording()
        _checked(path)
        assert app.end() == 0


# Killed.


@pytest.mark.parametrize("after", [0.3, 1.0, 2.0, 4.0])
def test_killed_at_any_time_of_its_start_it_leaves_nothing_and_the_next_starts(
    display: dict[str, str], home: Path, after: float
) -> None:
    with _opened(display, home) as app:
        time.sleep(after)
        blocks = _blocks(app.process.pid)
        children = psutil.Process(app.process.pid).children(recursive=True)
        app.process.kill()
    _, alive = psutil.wait_procs(children, 5.0)
    assert not alive
    _until(lambda: not any(block.exists() for block in blocks))
    with _opened(display, home) as app:
        app.connected()
        assert app.end() == 0


def _blocks(pid: int) -> set[Path]:
    """The blocks of shared memory of a process."""
    maps = Path(f"/proc/{pid}/maps").read_text("utf-8")
    return {Path(name) for name in re.findall(r"/dev/shm/kappaskin-[\w-]+", maps)}


def _until(holds: Callable[[], bool], within: float = 10.0) -> None:
    end = time.monotonic() + within
    while not holds():
        assert time.monotonic() < end, "it never came to hold"
        time.sleep(0.02)


def test_killed_with_its_engine_it_loses_half_a_second_and_the_next_window_offers_the_rest(
    display: dict[str, str], home: Path
) -> None:
    path = home / "Documents" / "Kappaskin" / "x.mcap"
    path.parent.mkdir(parents=True)
    with _opened(display, home) as app:
        app.connected().ask("window.history.change('Drill', -1, functions_x=6)")
        app.record(path)
        time.sleep(2.0)  # the settings are saved within a second
        engine, blocks = app.engine, _blocks(app.process.pid)
        assert len(blocks) == 2
        killed = time.time()
        app.process.kill()
        engine.kill()
    with Recording(part_of(path)) as recording:
        assert not recording.whole
        assert killed - 1e-9 * recording.last < 0.5
    _until(lambda: not any(block.exists() for block in blocks))
    with _opened(display, home) as app:
        app.connected()
        texts = app.ask("[b.text().replace('&', '') for b in window.display.banner.buttons]")
        assert texts[:2] == ["Its settings", "Its recording"]
        assert "x.mcap.part is unfinished" in app.ask("recorder.message")
        assert app.ask("str(recorder.damaged)") == str(part_of(path))
        app.ask("window.display.banner.buttons[0].click()")
        assert app.ask("window.history.settings.functions_x") == 6
        assert app.end() == 0


# Without its files.


def test_a_disk_that_fills_ends_the_recording_whole_and_the_window_says_so(
    app: App, tmp_path: Path
) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=6m", "none", str(disk)]
    if subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("nobody may mount a small disk here")
    try:
        app.ask(f"recorder.begin(Path({str(disk / 'x.mcap')!r}))")
        why = app.until("recorder.written.trouble")
        assert "No space left on device; it is complete up to that time" in why
        assert app.ask("recorder.message") == why
        assert app.until("mark.isVisible() and mark.head") == "REC ended"
        assert app.badge == "SIM"
        _checked(disk / "x.mcap")
        (disk / "rest").write_bytes(bytes(shutil.disk_usage(disk).free))
        app.ask(f"recorder.begin(Path({str(disk / 'y.mcap')!r}))")
        app.until("'y.mcap.part: expected room for 1 MiB' in recorder.message")
        assert not (disk / "y.mcap.part").exists()
        assert app.end() == 0
    finally:
        subprocess.run(["umount", "-l", str(disk)], check=True)


def test_a_file_that_may_grow_no_more_ends_the_recording_and_the_rest_can_be_repaired(
    app: App, tmp_path: Path
) -> None:
    app.engine.rlimit(psutil.RLIMIT_FSIZE, (4_000_000, 4_000_000))
    app.ask(f"recorder.begin(Path({str(tmp_path / 'x.mcap')!r}))")
    assert "x.mcap.part: File too large" in app.until("recorder.written.trouble")
    part, out = tmp_path / "x.mcap.part", tmp_path / "x.mcap"
    assert app.ask("str(recorder.damaged)") == str(part)
    assert app.until("mark.isVisible() and mark.head") == "REC ended"
    command = [sys.executable, "-m", "kappaskin", "repair", str(part), "--out", str(out)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
    _checked(out)
    assert app.end() == 0


def test_a_recording_that_goes_while_it_is_scrubbed_is_played_on_or_said_to_be_gone(
    app: App, tmp_path: Path
) -> None:
    path = tmp_path / "x.mcap"
    app.record(path)
    time.sleep(2.0)
    app.stop_recording()
    whole = path.read_bytes()
    for spoil in (path.unlink, lambda: os.truncate(path, 200_000)):
        path.write_bytes(whole)
        app.ask(f"session.request_source('replay:{path}')")
        app.until("window.display.badge.state.startswith('REPLAY')")
        app.until("playback._replay is not None")
        spoil()
        for at in (2.0, 0.2, 1.5, 0.1, 2.2):
            app.ask(f"playback.seek({at})")
            time.sleep(0.1)
        time.sleep(1.0)
        if app.badge == "LOST":
            assert str(path) in app.message
            assert not app.shows_numbers
        else:
            assert app.badge.startswith("REPLAY")
        app.ask("session.simulate()")
        app.connected()
    assert app.end() == 0


def test_a_window_file_that_was_cut_anywhere_is_used_or_put_aside_and_said(
    app: App, tmp_path: Path
) -> None:
    path = tmp_path / "cut" / "window.toml"
    app.ask("window.layouts.save('Mine')")
    app.ask(f"window.saver.begin(Path({str(path)!r}))")
    app.ask("window.saver.finish()")
    whole = path.read_bytes()
    for end in range(0, len(whole), 100):
        path.write_bytes(whole[:end])
        app.ask(f"window.saver.begin(Path({str(path)!r}))")
        if not path.exists():
            said = app.ask("window.statusBar().currentMessage()")
            assert "the window starts with defaults" in said
            assert [aside.read_bytes() for aside in path.parent.glob("*.aside")] == [whole[:end]]
            for aside in path.parent.glob("*.aside"):
                aside.unlink()
    assert app.badge == "SIM"
    assert app.end() == 0


def test_settings_of_a_crash_that_were_cut_anywhere_are_offered_whole_or_not_at_all(
    display: dict[str, str], home: Path
) -> None:
    with _opened(display, home) as app:
        app.connected().ask("window.history.change('Drill', -1, functions_x=6)")
        _until(lambda: any(b'"functions_x": 6' in f.read_bytes() for f in _notes(home)))
        (note,) = _notes(home)
        whole = note.read_bytes()
        assert app.end() == 0
    with _opened(display, home) as app:
        app.connected()
        state = f"Path({str(note.parent)!r})"
        crashed = "__import__('kappaskin_app.shell.recovery', fromlist=['crashed']).crashed"
        own = set(_notes(home))
        for end in [*range(0, len(whole), 100), len(whole)]:
            note.write_bytes(whole[:end])
            found = app.ask(
                f"(lambda last: last and last.settings.functions_x)({crashed}({state}))"
            )
            assert bool(found) == (end == len(whole))
        assert set(_notes(home)) == own
        assert app.end() == 0


def _notes(home: Path) -> list[Path]:
    return list((home / ".local" / "state" / "kappaskin" / "open").rglob("window-*.json"))


# Two of them, and clocks.


def test_of_two_windows_on_one_device_the_second_names_the_first_and_takes_over_from_it(
    display: dict[str, str], home: Path
) -> None:
    command = [sys.executable, "-m", "kappaskin", "device", "circle", "--rate", "100"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as device:
        assert device.stdout is not None
        port = json.loads(device.stdout.readline())["port"]
        try:
            with _opened(display, home, "--source", port) as first:
                first.connected()
                with _opened(display, home, "--source", port) as second:
                    second.until("window.display.badge.state == 'LOST'")
                    assert f"(process {first.engine.pid})" in second.message
                    assert not second.shows_numbers
                    assert first.badge == "SIM"
                    assert first.end() == 0
                    second.connected()
                    assert second.end() == 0
        finally:
            device.terminate()


def test_a_wall_clock_that_jumps_changes_no_age_and_no_badge(app: App, tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    app.record(path)
    real = "__import__('time').__dict__.setdefault('real', __import__('time').time)"
    for jump in (3600.0, -60.0, 0.0):
        app.ask(f"setattr(__import__('time'), 'time', lambda r={real}: r() + {jump})")
        for _ in range(20):
            assert app.badge == "SIM"
            age, _ = app.ask("window.display.age()")
            assert math.isnan(age) or 0 <= age < 1.0  # nothing was drawn for a second
            time.sleep(0.05)
        app.ask(f"session.engine.note('jump of {jump:g}')")
        app.until(f"'jump of {jump:g}' in event_log.list.toPlainText()")
    app.stop_recording()
    _checked(path)
    assert app.end() == 0


# For long.

_WARM, _WORKED, _MEGABYTES = 35, 100, 20.0  # s (by then 500 steps can be undone), s, and MB
_OBJECTS = 500  # that may be added, of some 10,000 frames, draws, events and lines of the log
_HELD = (
    "(__import__('gc').collect(), len(__import__('gc').get_objects()), "
    "__import__('psutil').Process().memory_info().rss / 1e6)[1:]"
)


def test_the_demonstration_with_the_events_of_a_day_adds_no_objects_and_less_than_20_mb(
    display: dict[str, str], home: Path
) -> None:
    """An event and a line of the log each 9 s, a changed setting each 43 s of a day."""
    with _opened(display, home, command="demo") as app:
        app.connected().ask(_HELD)  # what it imports stays
        steps = [
            "[event_log.note('drill', f'event {n}') for n in range(100)] and None",
            "[__import__('logging').getLogger('drill').info('line %d', n) for n in range(100)][0]",
            "[window.history.change('Drill', -1, noise_rms=0.3 + n / 100) for n in range(20)][0]",
        ]
        held: list[tuple[int, float]] = []
        for seconds in (_WARM, _WORKED):
            for _ in range(seconds):
                for step in steps:
                    app.ask(step)
                time.sleep(1.0)
            held.append(app.ask(_HELD))
        (objects, memory), (more_objects, more_memory) = held
        print(f"{more_objects - objects:+d} objects, {more_memory - memory:+.1f} MB")
        assert more_objects - objects < _OBJECTS
        assert more_memory - memory < _MEGABYTES
        assert app.end() == 0
