"""Leftovers: all processes ended by force, and what the next start removes."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from tempfile import mkdtemp

import psutil
import pytest

from kappaskin.live.ring import Ring

MEMORY = Path("/dev/shm")
pytestmark = pytest.mark.skipif(
    not MEMORY.exists(), reason="the system does not list shared memory"
)

MOMENTS = (0.2, 0.4, 0.6, 0.8, 1.0, 1.3, 2.0)
"""Seconds after its start at which a program is killed: some before it has all its processes."""


@pytest.fixture
def temporary(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of temporary files and folders, with a name short enough for a socket."""
    folder = Path(mkdtemp())
    monkeypatch.setenv("TMPDIR", str(folder))
    yield folder
    shutil.rmtree(folder)


def blocks() -> set[str]:
    return {path.name for path in MEMORY.glob("kappaskin-*")}


def program(*arguments: str) -> subprocess.Popen[bytes]:
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([sys.executable, "-m", "kappaskin", *arguments], **quiet)


def kill_all(process: "subprocess.Popen[bytes]") -> None:
    """Kill a program and all that it began, none of which has time for anything."""
    family = [process.pid]
    with suppress(psutil.NoSuchProcess):
        family += [child.pid for child in psutil.Process(process.pid).children(recursive=True)]
    for number in (signal.SIGSTOP, signal.SIGKILL):
        for pid in family:
            with suppress(ProcessLookupError):
                os.kill(pid, number)
    process.wait()
    wait_for(lambda: not any(map(is_running, family)))


def is_running(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def wait_for(holds: Callable[[], object], within: float = 30.0) -> None:
    end = time.monotonic() + within
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


STARTS: dict[str, Callable[[Path], tuple[str, ...]]] = {
    "record": lambda folder: ("record", "sim:", str(folder / "next.mcap"), "--seconds", "0.5"),
    "app": lambda _: ("app", "--seconds", "2"),
}


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("moment", MOMENTS)
@pytest.mark.parametrize("killed", ["record", "app"])
def test_the_next_start_removes_what_the_dead_left(
    killed: str, moment: float, start: str, temporary: Path, tmp_path: Path
) -> None:
    before = blocks()
    recorded = tmp_path / "a.mcap"
    first = ("record", "sim:", str(recorded)) if killed == "record" else ("app",)
    process = program(*first)
    time.sleep(moment)
    kill_all(process)
    parts = {path: path.read_bytes() for path in tmp_path.glob("*.part")}

    assert program(*STARTS[start](tmp_path)).wait(60) == 0

    assert blocks() <= before
    assert list(temporary.iterdir()) == []
    assert {path: path.read_bytes() for path in tmp_path.glob("*.part")} == parts


def test_all_processes_of_a_recording_leave_something_to_remove(
    temporary: Path, tmp_path: Path
) -> None:
    before = blocks()
    process = program("record", "sim:", str(tmp_path / "a.mcap"))
    wait_for((tmp_path / "a.mcap.part").exists)
    kill_all(process)
    left = blocks() - before
    assert len(left) == 2
    assert len(list(temporary.iterdir())) == 1
    assert program(*STARTS["record"](tmp_path)).wait(60) == 0
    assert not blocks() & left
    assert list(temporary.iterdir()) == []


def test_what_is_in_use_or_foreign_stays(temporary: Path, tmp_path: Path) -> None:
    recorded = tmp_path / "alive.mcap"
    with ExitStack() as made:
        alive = program("record", "sim:", str(recorded))
        made.callback(kill_all, alive)
        wait_for(recorded.with_name("alive.mcap.part").exists)
        used, folders = blocks(), set(temporary.iterdir())
        ring = Ring.create()
        made.callback(ring.destroy)
        foreign = SharedMemory("kappaskin-0123456789abcdef", create=True, size=4096)
        made.callback(foreign.unlink)
        made.callback(foreign.close)
        link = MEMORY / "kappaskin-a-link"
        link.symlink_to(MEMORY / ring.name)
        made.callback(link.unlink)
        others = temporary / "pymp-others"
        others.mkdir()

        assert program(*STARTS["record"](tmp_path)).wait(60) == 0

        assert blocks() >= used | {ring.name, foreign.name, link.name}
        assert set(temporary.iterdir()) == folders | {others}
        assert alive.poll() is None
        size = recorded.with_name("alive.mcap.part").stat().st_size
        wait_for(lambda: recorded.with_name("alive.mcap.part").stat().st_size > size)


def test_many_starts_at_once_remove_the_same_and_disturb_none(
    temporary: Path, tmp_path: Path
) -> None:
    before = blocks()
    for _ in range(3):
        process = program("record", "sim:", str(tmp_path / "a.mcap"))
        wait_for((tmp_path / "a.mcap.part").exists)
        kill_all(process)
        (tmp_path / "a.mcap.part").unlink()
    starts = []
    for n in range(4):
        (tmp_path / str(n)).mkdir()
        starts.append(program(*STARTS["record"](tmp_path / str(n))))
    assert [process.wait(120) for process in starts] == [0] * 4
    assert blocks() <= before
    assert list(temporary.iterdir()) == []
