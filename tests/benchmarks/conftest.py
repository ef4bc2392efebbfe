"""Benchmarks: each figure is a ratio to a named baseline of the same run, or to what is allowed.

They are printed at the end and kept in history.jsonl, a line each; `start.py bench --history`
tells how they went.
"""

import json
import os
import platform
import shutil
import statistics
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from kappaskin import load_scene, write_scene

HISTORY = Path(__file__).with_name("history.jsonl")
_TOLD = 8  # of a figure's values, the newest
_FIRMWARE = Path(__file__).parents[2] / "resources" / "kappaskin_resources" / "firmware"
_CONVERSION = 2e-6  # s: 300 channels in less than a millisecond

Play = Callable[..., str]

Figures = list[str]
_figures: Figures = []
_ratios: list[dict[str, object]] = []


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--long", action="store_true", help="measure for as long as the figures ask")
    parser.addoption("--soak", type=float, help="hold a load for so many s, such as 1800")
    parser.addoption("--history", action="store_true", help="measure nothing, tell how it went")


def pytest_cmdline_main(config: pytest.Config) -> int | None:
    if not config.getoption("--history"):
        return None
    print(told(map(json.loads, HISTORY.read_text("utf-8").splitlines())))
    return 0


def told(lines: Iterable[dict[str, object]]) -> str:
    """Each figure of the history with its newest values, from the oldest of them on."""
    figures: dict[object, list[dict[str, object]]] = {}
    for line in lines:
        figures.setdefault(line["figure"], []).append(line)
    return "\n".join(
        f"{name}: "
        + ", ".join(f"{line['value']} ({line['commit']})" for line in kept[-_TOLD:])
        + f"; {kept[-1]['asked']}"
        for name, kept in figures.items()
    )


def pytest_sessionfinish() -> None:
    if not _ratios:
        return
    say = ["git", "describe", "--always", "--dirty=+", "--exclude=*"]
    commit = subprocess.run(say, cwd=HISTORY.parent, capture_output=True, text=True, check=False)
    run = {
        "date": f"{datetime.now(UTC):%Y-%m-%d %H:%M}",
        "commit": commit.stdout.strip() or "unknown",
        "machine": f"{os.cpu_count()} cores, {platform.machine()}, {platform.system()}, Python "
        f"{platform.python_version()}",
    }
    with HISTORY.open("a", encoding="utf-8") as file:
        file.writelines(json.dumps(run | ratio) + "\n" for ratio in _ratios)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if _figures:
        terminalreporter.section("figures")
    for figure in _figures:
        terminalreporter.write_line(figure)


@pytest.fixture
def figure() -> Callable[[str], None]:
    """Print a line in the summary."""
    return _figures.append


@pytest.fixture
def ratio() -> Callable[..., None]:
    """Keep a figure in the history, and fail where it is not what is asked."""

    def keep(
        figure: str, value: float, *, at_least: float | None = None, at_most: float | None = None
    ) -> None:
        bounds = {"at least": at_least, "at most": at_most}
        asked = [f"{words} {bound:g}" for words, bound in bounds.items() if bound is not None]
        kept = {"figure": figure, "value": float(f"{value:.3g}"), "asked": " ".join(asked)}
        _ratios.append(kept)
        assert at_least is None or value >= at_least, kept
        assert at_most is None or value <= at_most, kept

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
