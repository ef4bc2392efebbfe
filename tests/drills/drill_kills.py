"""Kills: commands that record, and their engines, ended by force."""

import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
import pytest

from kappaskin.recording import Recording
from kappaskin.recording.writing import part_of

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no such signal here")

_MOMENTS = (0.0, 0.05, 0.3, 1.0, 2.5)  # s after the first bytes
_SECOND = 1.0  # s in which an engine ends whose command was killed
_LOST = 0.5  # s of readings at most


def _run(*arguments: object) -> tuple[int, str]:
    """The exit code of a command, and all that it printed."""
    command = [sys.executable, "-m", "kappaskin", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    return done.returncode, done.stdout + done.stderr


def _until(holds: Callable[[], bool], within: float = 60.0) -> None:
    end = time.monotonic() + within
    while not holds():
        assert time.monotonic() < end, "it never came to hold"
        time.sleep(0.005)


def _engine_of(process: subprocess.Popen[str]) -> psutil.Process | None:
    for child in psutil.Process(process.pid).children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            if child.ppid() != process.pid:  # it is the fork server's
                return child
    return None


@contextmanager
def _recording(path: Path) -> Iterator[tuple[subprocess.Popen[str], psutil.Process]]:
    """A command that records to `path` for about a second already, and its engine."""
    command = [sys.executable, "-m", "kappaskin", "record", "sim:circle", str(path)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        _until(lambda: part_of(path).exists() and part_of(path).stat().st_size > 2_000_000)
        engine = _engine_of(process)
        assert engine is not None
        yield process, engine
    with suppress(psutil.NoSuchProcess):
        engine.kill()


def _blocks(engine: psutil.Process) -> set[Path]:
    """The blocks of shared memory of an engine, where the system lists them."""
    maps = Path(f"/proc/{engine.pid}/maps")
    text = maps.read_text("utf-8") if maps.exists() else ""
    return {Path(name) for name in re.findall(r"/dev/shm/kappaskin-[\w-]+", text)}


def _lost(path: Path, killed: float) -> float:
    """How many s before it was `killed` the last message is that can be read."""
    with Recording(path) as recording:
        return killed - 1e-9 * recording.last


@pytest.mark.parametrize("after", _MOMENTS)
def test_a_command_that_is_killed_leaves_a_whole_file_within_a_second(
    tmp_path: Path, after: float
) -> None:
    path = tmp_path / "x.mcap"
    with _recording(path) as (process, engine):
        time.sleep(after)
        blocks = _blocks(engine)
        process.kill()
        killed, began = time.time(), time.monotonic()
        _until(path.exists)
        assert time.monotonic() - began < _SECOND
        assert _lost(path, killed) < _LOST
        psutil.wait_procs([engine], 5.0)
    assert _run("verify", path)[0] == 0
    assert list(tmp_path.iterdir()) == [path]
    _until(lambda: not any(block.exists() for block in blocks), 10.0)


@pytest.mark.parametrize("after", _MOMENTS)
def test_an_engine_that_is_killed_ends_its_command_with_a_whole_file(
    tmp_path: Path, after: float
) -> None:
    path = tmp_path / "x.mcap"
    with _recording(path) as (process, engine):
        time.sleep(after)
        engine.kill()
        killed = time.time()
        _, said = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "the engine process ended unexpectedly; saved up to then" in said
    assert _lost(path, killed) < _LOST
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("after", _MOMENTS)
def test_of_both_killed_at_once_the_rest_is_named_refused_and_repaired(
    tmp_path: Path, after: float
) -> None:
    path, copy = tmp_path / "x.mcap", tmp_path / "copy.mcap"
    with _recording(path) as (process, engine):
        time.sleep(after)
        blocks = _blocks(engine)
        killed = time.time()
        process.kill()
        engine.kill()
    part = part_of(path)
    assert _lost(part, killed) < _LOST
    code, said = _run("record", "sim:", path, "--seconds", 1)
    assert code == 2
    assert f"see `kappaskin repair {part}`" in said
    code, said = _run("info", part)
    assert code == 0
    assert "unfinished: see `kappaskin repair`" in said
    assert _run("repair", part, "--out", path)[0] == 0
    code, said = _run("repair", path, "--out", copy)
    assert code == 0
    assert "nothing was lost" in said
    with Recording(path) as repaired, Recording(copy) as copied:
        assert repaired.whole
        assert copied.whole
        assert repaired.counts == copied.counts
    _until(lambda: not any(block.exists() for block in blocks), 10.0)


def test_an_engine_that_hangs_is_ended_with_its_command(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with _recording(path) as (process, engine):
        engine.suspend()
        _, said = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "the engine process did not respond and was ended; saved up to then" in said
    assert _run("verify", path)[0] == 0


def test_stopped_together_with_its_engine_a_command_goes_on_where_it_was(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with _recording(path) as (process, engine):
        held = [psutil.Process(process.pid), engine]
        for one in held:
            one.suspend()
        time.sleep(12.0)  # longer than an engine alone may be silent
        for one in held:
            one.resume()
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        told, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert f"{path}: " in told
    assert _run("verify", path)[0] == 0
