"""Benchmarks: each figure is a ratio to a named baseline of the same run, or to what is allowed.

They are printed at the end as one table, kept in history.jsonl, and written to the guide's page
Performance; `start.py bench --history` plots how they went.
"""

import json
import shutil
import statistics
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import history
import pytest
from history import Ratio, Run

from kappaskin import load_scene, write_scene

_FIRMWARE = Path(__file__).parents[2] / "resources" / "kappaskin_resources" / "firmware"
_CONVERSION = 2e-6  # s: 300 channels in less than a millisecond

Play = Callable[..., str]

_runs: dict[str, Run] = {}  # by the name of the test
_BEFORE = pytest.StashKey[list[Run]]()


def _run_of(request: pytest.FixtureRequest) -> Run:
    name = request.node.nodeid.rpartition("/")[2]
    return _runs.setdefault(name, Run(name))


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--long", action="store_true", help="measure for as long as the figures ask")
    parser.addoption("--soak", type=float, help="hold a load for so many s, such as 1800")
    parser.addoption("--history", action="store_true", help="measure nothing, plot how it went")


def pytest_cmdline_main(config: pytest.Config) -> int | None:
    if not config.getoption("--history"):
        return None
    every = history.kept()
    newest = history.newest(every)
    print(history.table(newest, (run for run in every if run not in newest)))
    print(f"Plotted: {history.plot()}")
    return 0


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Keep what was measured; fail where a figure is missed."""
    if not _runs:
        return
    session.config.stash[_BEFORE] = history.kept()
    history.keep(_runs.values())
    history.write_page()
    missed = any(ratio.missed for run in _runs.values() for ratio in run.ratios)
    if missed and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if not _runs:
        return
    terminalreporter.section("figures")
    for run in _runs.values():
        for note in run.notes:
            terminalreporter.write_line(note)
    before = terminalreporter.config.stash[_BEFORE]
    terminalreporter.write_line("\n" + history.table(_runs.values(), before))


@pytest.fixture
def figure(request: pytest.FixtureRequest) -> Callable[[str], None]:
    """Tell a sentence in the summary and on the guide's page."""
    return _run_of(request).notes.append


@pytest.fixture
def ratio(request: pytest.FixtureRequest) -> Callable[..., None]:
    """Keep a figure in the history; the session fails where one is not what is asked."""

    def keep(
        figure: str, value: float, *, at_least: float | None = None, at_most: float | None = None
    ) -> None:
        bounds = {"at least": at_least, "at most": at_most}
        asked = [f"{words} {bound:g}" for words, bound in bounds.items() if bound is not None]
        _run_of(request).ratios.append(Ratio(figure, float(f"{value:.3g}"), " ".join(asked)))

    return keep


@pytest.fixture
def seconds(request: pytest.FixtureRequest) -> float:
    """How long a drawing is watched."""
    return 20.0 if request.config.getoption("--long") else 6.0


@pytest.fixture
def lasting(request: pytest.FixtureRequest) -> float:
    """How long a load is held in s: ten minutes with --long, or as --soak says."""
    soak = request.config.getoption("--soak")
    return float(soak) if soak else 600.0 if request.config.getoption("--long") else 20.0


@pytest.fixture
def thousand(tmp_path: Path) -> str:
    """A source of 1,000 frames/s that the engine simulates."""
    scene = load_scene("circle")
    chain = scene.transduction
    fast = replace(chain, converter=replace(chain.converter, conversion_time=_CONVERSION))
    path = tmp_path / "thousand.toml"
    path.write_text(write_scene(replace(scene, rate=1000.0, transduction=fast)))
    return f"sim:{path}"


@pytest.fixture
def medians() -> Callable[..., list[float]]:
    """Median seconds per call of several functions, measured turn by turn."""

    def measure(
        *functions: Callable[[], object],
        turns: int = 40,
        calls: int = 20,
        clock: Callable[[], float] = time.perf_counter,
    ) -> list[float]:
        taken: list[list[float]] = [[] for _ in functions]
        for _ in range(turns):
            for function, times in zip(functions, taken, strict=True):
                start = clock()
                for _ in range(calls):
                    function()
                times.append((clock() - start) / calls)
        return [statistics.median(times) for times in taken]

    return measure


@pytest.fixture
def spaced() -> Callable[..., list[float]]:
    """The same of single calls 1 ms apart, as frames come: by then the caches have gone cold."""

    def measure(*functions: Callable[[], object], turns: int = 300) -> list[float]:
        taken: list[list[float]] = [[] for _ in functions]
        for _ in range(turns):
            for function, times in zip(functions, taken, strict=True):
                time.sleep(1e-3)
                start = time.perf_counter()
                function()
                times.append(time.perf_counter() - start)
        return [statistics.median(times) for times in taken]

    return measure


@pytest.fixture
def play(tmp_path: Path) -> Iterator[Play]:
    """Starts the firmware as a program of this machine, which costs little; gives its port."""
    if not shutil.which("gcc"):
        pytest.skip("no C compiler: apt-get install -y gcc libc6-dev")
    program, files = tmp_path / "host", [*_FIRMWARE.glob("*.c"), *_FIRMWARE.glob("host/*.c")]
    command = ["gcc", "-std=c99", "-O2", f"-I{_FIRMWARE}", *map(str, files), "-o", str(program)]
    subprocess.run(command, check=True)
    running: list[subprocess.Popen[str]] = []

    def start(*options: object) -> str:
        command = [str(program), *map(str, options)]
        device = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        running.append(device)
        return json.loads(device.stdout.readline())["port"]

    yield start
    for device in running:
        device.terminate()
        device.communicate()
