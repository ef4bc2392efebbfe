"""What every test shares: none may leave a thread, a process or a block of memory behind."""

import gc
import multiprocessing
import os
import re
import runpy
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from multiprocessing import forkserver, resource_tracker
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from typing import Protocol

import psutil
import pytest
from hypothesis import settings
from xdist.remote import Producer
from xdist.scheduler import LoadFileScheduling

# Steady: a first run on a fresh machine tests what every run tests. To look for more, run
# `pytest --hypothesis-profile=explore`.
settings.register_profile("steady", deadline=None, derandomize=True, database=None)
settings.register_profile("explore", deadline=None, max_examples=2000, database=None)
settings.load_profile("steady")

# As in the engine, and before NumPy is loaded: two threads that spin for two busy cores took 15 to
# 80 s for what one does in 10. Processes that tests start inherit it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# What is imported and collected stays, eight thousand tests: to look through it for garbage again
# and again took half of the time it took.
gc.disable()

# A background job begins with Ctrl+C ignored, and so would every process that a test starts.
signal.signal(signal.SIGINT, signal.default_int_handler)

# With the resource tracker: they stay, and are nobody's leak.
if "forkserver" in multiprocessing.get_all_start_methods():
    multiprocessing.set_forkserver_preload(["kappaskin.live.loop", "scipy.spatial"])
    forkserver.ensure_running()
else:
    resource_tracker.ensure_running()

# Windows that share a keyboard take it from each other: each of several processes has its own.
_OWN_DISPLAYS = sys.platform.startswith("linux") and shutil.which("Xvfb") is not None
_display = ExitStack()
if _OWN_DISPLAYS and ("PYTEST_XDIST_WORKER" in os.environ or not os.environ.get("DISPLAY")):
    _start = runpy.run_path(str(Path(__file__).parents[1] / "packaging" / "start.py"))
    os.environ |= _display.enter_context(_start["virtual_display"](dict(os.environ)))


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--without", default="", help="the app's tests without this feature")


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.enable()


def pytest_unconfigure() -> None:
    _display.close()


_PATIENCE = 30.0  # s that what was told to end may take, however busy the machine is

_PARENT = """
import sys, time
from pathlib import Path
from kappaskin import Setup
from kappaskin.live import Engine

folder, file, patience, window_state = sys.argv[1:]
engine = Engine(Setup(6, 7), Path(folder), float(patience))
engine.store_window_state(bytes.fromhex(window_state))
if file:
    engine.record(Path(file))
engine.connect("sim:centre")
while engine.latest(status := engine.status()) is None or (file and not status.recording.messages):
    time.sleep(0.01)
print(engine.pid, engine._ring.name, engine._compared_ring.name, status.generation, flush=True)
time.sleep(60)
"""


@pytest.fixture(scope="session", autouse=True)
def no_real_folders(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Lets no app that a test starts take over what a real one left, or use what it kept."""
    with pytest.MonkeyPatch.context() as patch:
        for kind in ("cache", "config", "data", "state"):
            patch.setenv(f"XDG_{kind.upper()}_HOME", str(tmp_path_factory.mktemp(kind)))
        patch.setenv("XDG_DOCUMENTS_DIR", str(tmp_path_factory.mktemp("documents")))
        yield


@dataclass(frozen=True)
class Abandoned:
    """An engine whose parent was killed, and its blocks of memory, where the system lists them."""

    pid: int
    blocks: tuple[Path, ...]
    generation: int

    @property
    def gone(self) -> bool:
        """Whether the process ended, be it still a zombie because nobody asked for its code."""
        try:
            return psutil.Process(self.pid).status() == psutil.STATUS_ZOMBIE
        except psutil.NoSuchProcess:
            return True


@pytest.fixture
def abandoned() -> Iterator[Callable[..., Abandoned]]:
    """Kills a process whose engine records `sim:centre`, 6 x 7 functions, to `file` if any."""
    made: list[Abandoned] = []

    def begin(
        orphans: Path, file: Path | None, patience: float = 20.0, window_state: bytes = b""
    ) -> Abandoned:
        said = [str(orphans), str(file or ""), str(patience), window_state.hex()]
        call = [sys.executable, "-c", _PARENT, *said]
        quiet = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        with subprocess.Popen(call, text=True, **quiet) as parent:
            pid, *names, generation = (parent.stdout or sys.stdin).readline().split()
            parent.kill()
        blocks = tuple(Path("/dev/shm", name) for name in names)
        made.append(Abandoned(int(pid), blocks, int(generation)))
        return made[-1]

    yield begin
    for one in made:
        if not one.gone:
            os.kill(one.pid, signal.SIGKILL)


def _children() -> set[int]:
    """The processes this one started, and those that the fork server did.

    Linux lists them, elsewhere psutil looks at all there are.
    """
    if not Path("/proc/self/task").exists():
        return {child.pid for child in psutil.Process().children(recursive=True)}
    own = _children_of(os.getpid())
    return own.union(*map(_children_of, own))


def _children_of(pid: int) -> set[int]:
    found = ""
    with suppress(OSError):  # it ended meanwhile
        for thread in os.listdir(f"/proc/{pid}/task"):
            with open(f"/proc/{pid}/task/{thread}/children") as file:
                found += file.read()
    return {int(child) for child in found.split()}


class OneForWindows(LoadFileScheduling):
    """Keeps a file's tests in one process, and all windows in one: they share a keyboard."""

    def _split_scope(self, nodeid: str) -> str:
        file = super()._split_scope(nodeid)
        return "windows" if file.startswith("tests/app/") else file


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadFileScheduling:
    config.option.loadscopereorder = False  # the order below, not the files of most tests first
    return (LoadFileScheduling if _OWN_DISPLAYS else OneForWindows)(config, log)


def _leave_cases_to_full(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark all cases of a test as `full` but those that its mark `cases` names."""
    found: dict[tuple[str, str], bool] = {}
    for item in items:
        if mark := item.get_closest_marker("cases"):
            test, _, case = item.nodeid.partition("[")
            named = [part for part in mark.args if part in case]
            found |= {
                (test, part): part in named or found.get((test, part), False) for part in mark.args
            }
            if not named:
                item.add_marker("full")
    lost = [f"{test}: {part}" for (test, part), there in found.items() if not there]
    if lost and not any("::" in asked for asked in config.args):
        raise pytest.UsageError(f"expected each mark `cases` to name cases, {lost} are none")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Begin with the files that take long: at the end one process would be alone with them."""
    _leave_cases_to_full(config, items)
    if hasattr(config, "workerinput"):
        long = {item.path for item in items if item.get_closest_marker("slow")}
        long |= {item.path for item in items if item.nodeid.startswith("tests/app/")}
        items.sort(key=lambda item: item.path not in long)


class Written(Protocol):
    """A recording that tells how it is doing, anew at each write."""

    @property
    def written(self) -> object: ...


@pytest.fixture(scope="session")
def written_out() -> Callable[[Written], None]:
    """Waits until all that a recording was told is in its file: what follows is in a new chunk."""

    def wait(recording: Written) -> None:
        end = time.monotonic() + 30.0
        for _ in range(2):  # the first may have begun before
            last = recording.written
            while recording.written is last:
                assert time.monotonic() < end, "nothing is written"
                time.sleep(0.005)

    return wait


@pytest.fixture(scope="session")
def recording(
    tmp_path_factory: pytest.TempPathFactory, written_out: Callable[[Written], None]
) -> Path:
    """A recording of 2.5 s, 100 frames/s: a note at 0.5 s, 6 x 7 functions from 0.7 s on.

    Nothing came from 1 to 1.8 s. It has three chunks at least.
    """
    from kappaskin import Event, Pipeline, Setup, load_scene
    from kappaskin.recording import Recorder
    from kappaskin.sources import SimulatedSource

    path, now = tmp_path_factory.mktemp("recordings") / "example.mcap", [time.monotonic()]
    scene, begun = replace(load_scene("circle"), rate=100.0), now[0]
    recorder = Recorder(path, begun)

    def source() -> SimulatedSource:
        recorder.resume(now[0])
        made = SimulatedSource(scene, lambda: now[0])
        made.record(recorder)
        recorder.set_up(Pipeline(made.sensor, setups[-1]))
        return made

    def play(source: SimulatedSource, until: float) -> None:
        pipeline = Pipeline(source.sensor, setups[-1])
        while now[0] < begun + until:
            now[0] += 0.01
            for frame in source.read(0.0):
                recorder.take(frame, pipeline(frame))

    setups = [Setup()]
    first = source()
    play(first, 0.5)
    written_out(recorder)
    recorder.add_event(Event(now[0], "note", "the object is changed"))
    play(first, 0.7)
    setups.append(Setup(6, 7))
    recorder.set_up(Pipeline(first.sensor, setups[-1]))
    play(first, 1.0)
    recorder.disconnected(now[0])
    written_out(recorder)
    now[0] += 0.8
    play(source(), 2.5)
    recorder.close()
    return path


@pytest.fixture(autouse=True)
def nothing_left_behind(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    blocks: list[str] = []
    make = SharedMemory.__init__

    def noted(self: SharedMemory, *args: object, **kwargs: object) -> None:
        make(self, *args, **kwargs)  # type: ignore[arg-type]
        blocks.append(self.name)

    monkeypatch.setattr(SharedMemory, "__init__", noted)
    threads, processes = set(threading.enumerate()), _children()

    def left() -> list[object]:
        alive: list[object] = [*(set(threading.enumerate()) - threads)]
        alive += [f"process {pid}" for pid in _children() - processes]
        return alive + [name for name in blocks if Path("/dev/shm", name).exists()]

    yield
    end = time.monotonic() + _PATIENCE
    while left() and time.monotonic() < end:
        time.sleep(0.02)
    assert not left(), "the test left these alive"


_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?")


def _last_digit(number: str) -> float:
    digits = len(number.partition(".")[2])
    return 10.0**-digits if digits else 0.0


@pytest.fixture(scope="session")
def same_but_for_the_last_digit() -> Callable[[str, str], bool]:
    """Whether two texts are alike but for white space, and numbers by one in their last digit.

    What follows dots at the end of `said` may be anything. Which way a number half way between
    two roundings falls depends on the processor.
    """

    def same(said: str, printed: str) -> bool:
        told, came = said.split(), printed.split()
        if told[-1:] == ["..."]:
            told, came = told[:-1], came[: len(told) - 1]
        said, printed = " ".join(told), " ".join(came)
        if _NUMBER.sub("#", said) != _NUMBER.sub("#", printed):
            return False
        pairs = zip(_NUMBER.findall(said), _NUMBER.findall(printed), strict=True)
        return all(
            abs(float(one) - float(other)) <= 1.001 * _last_digit(one) for one, other in pairs
        )

    return same
