"""Changes a room of the core in one place at a time, and says which changes no test notices.

    python tests/mutation/mutate.py ROOM [COUNT [SEED]]

COUNT changes (60) are drawn by SEED (0) from all there are. Each meets those tests of the room that
reach its line, the quickest first, in a process forked for it; no file is written. What survives
either lacks a test, or is no change at all and is told why in `explained.toml`. The exit code is 1
where one survives that is not.
"""

import importlib.util
import inspect
import os
import pickle
import random
import resource
import signal
import sys
import tempfile
import threading
import time
import tomllib
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from importlib.machinery import ModuleSpec, SourceFileLoader
from pathlib import Path
from types import CodeType, FrameType

# Loaded once for all forks: most of what a run of a few tests takes.
import hypothesis  # noqa: F401
import psutil  # noqa: F401
import pytest
import scipy.linalg
import scipy.optimize
import scipy.sparse.linalg
import scipy.special  # noqa: F401
from changes import Change, changed, places

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
CORE = ROOT / "core" / "kappaskin"
CALLS = 20  # of a function, whose lines are looked at for a test
MEMORY = 8 * 2**30  # bytes that a change may have a test ask for
_ARGUMENTS = ["-x", "-q", "--assert=plain", "--rootdir", str(ROOT)]

ROOMS = {
    "contact": (
        "contact/point contact/load_detection contact/objects contact/hypotheses "
        "contact/elastic_skin contact/element_grid",
        "contact/contact contact/point_products contact/objects contact/hypotheses "
        "contact/elastic_skin contact/rigid_object_of_a_kind contact/every_skin calibration/tare",
    ),
    "sources": (
        "sources/wire sources/decoder",
        "sources/wire sources/wire_vectors sources/diagnosis sources/interpreter",
    ),
    "estimation": (
        "estimation/estimator estimation/fit estimation/least_squares estimation/__init__ "
        "estimation/fast estimation/bayes estimation/kalman estimation/tracking estimation/robust "
        "estimation/placement",
        "estimation/estimators estimation/least_squares estimation/fast estimation/bayes "
        "estimation/prior estimation/robust estimation/tracking estimation/finite_slope "
        "estimation/placement studies/stability",
    ),
    "scenes": (
        "scenes/* _schema _toml",
        "scenes/stimulus scenes/scene scenes/read scenes/write scenes/schema scenes/plan "
        "scenes/simulator",
    ),
}
"""Room -> its files, and the tests, as room/name, that are to notice a change."""


class _Changed(SourceFileLoader):
    """Loads one module with the change in it."""

    def __init__(self, name: str, made: Change) -> None:
        super().__init__(name, str(made.file))
        self._made = made

    def get_code(self, fullname: str) -> CodeType:
        tree, _ = changed(self._made.file, self._made.index)
        return compile(tree, self.path, "exec", dont_inherit=True)


class _Finder:
    """Finds that module before any other finder does."""

    def __init__(self, made: Change) -> None:
        parts = made.file.relative_to(CORE.parent).with_suffix("").parts
        self._name = ".".join(part for part in parts if part != "__init__")
        self._made = made

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        if name != self._name:
            return None
        loader = _Changed(name, self._made)
        return importlib.util.spec_from_file_location(name, self._made.file, loader=loader)


class Reach:
    """Which tests reach which lines of some files, as a plugin of pytest."""

    def __init__(self, files: list[Path]) -> None:
        self._files, self._test = frozenset(map(str, files)), ""
        self.lines: dict[tuple[str, int], set[str]] = defaultdict(set)
        self.seconds: dict[str, float] = {}
        self.failed: set[str] = set()
        self._calls: Counter[CodeType] = Counter()

    def __call__(self, frame: FrameType, event: str, _: object) -> object:
        if frame.f_code.co_filename not in self._files:
            return None
        if event == "call":
            self._calls[frame.f_code] += 1
            if self._calls[frame.f_code] > CALLS:
                return None
        # What runs when a module is loaded is every test's of that file.
        test = self._test if frame.f_code.co_flags & inspect.CO_OPTIMIZED else ""
        self.lines[frame.f_code.co_filename, frame.f_lineno].add(test)
        return self

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._test, begun = item.nodeid, time.process_time()
        self._calls.clear()
        sys.settrace(self)  # anew: a test that recurses too deep has ended it
        try:
            return (yield)
        finally:
            self.seconds[item.nodeid] = time.process_time() - begun
            self._test = ""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.failed.add(report.nodeid)

    def noticing(self, made: Change) -> list[str]:
        """The tests that reach the change's line; then the others of their files."""
        # Not every line of a long statement is told to have run.
        at = ((str(made.file), line) for line in (made.begun, made.line))
        reached = set[str]().union(*(self.lines.get(line, set()) for line in at))
        if not reached or "" in reached:  # or in none of the calls that were looked at
            all_of_it = [tests for (file, _), tests in self.lines.items() if file == str(made.file)]
            reached = set[str]().union(*all_of_it)
        if not reached & self.seconds.keys():  # of a file that is only loaded: what uses it
            reached = set(self.seconds)
        took: dict[str, float] = defaultdict(float)
        for test in reached & self.seconds.keys():
            took[test.split("::")[0]] += self.seconds[test]

        def order(test: str) -> tuple[float, str, bool, float]:
            # File by file, or what a file's tests share would be made again and again.
            file = test.split("::")[0]
            return took[file], file, test not in reached, self.seconds[test]

        others = {test for test in self.seconds if test.split("::")[0] in took}
        return sorted(others - self.failed, key=order)


def forked(work: Callable[[], int], seconds: float) -> int:
    """What `work` returned in a process of its own; below zero where it took longer."""
    sys.stdout.flush()
    if child := os.fork():
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    code = 1
    try:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        signal.setitimer(signal.ITIMER_PROF, seconds)  # of work: other processes do not count
        signal.alarm(60 + int(10 * seconds))
        quiet = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(quiet, stream)
        code = work()
    finally:
        os._exit(code)


def reach(files: list[Path], tests: list[str]) -> Reach:
    """Which tests reach what, from a run of all of them."""
    with tempfile.NamedTemporaryFile() as kept:

        def work() -> int:
            found = Reach(files)
            threading.settrace(found)
            sys.settrace(found)
            code = pytest.main([*_ARGUMENTS[1:], *tests], plugins=[found])
            sys.settrace(None)
            kept.write(pickle.dumps((found.lines, found.seconds, found.failed)))
            kept.flush()
            return code

        code = forked(work, 3600.0)
        found = Reach(files)
        if not (text := Path(kept.name).read_bytes()):
            raise SystemExit(f"expected a run of {tests}, got exit code {code}: run it by itself")
        found.lines, found.seconds, found.failed = pickle.loads(text)
    return found


def survives(made: Change, tests: list[str], seconds: float) -> bool:
    """Whether all tests pass with the change."""

    def work() -> int:
        sys.meta_path.insert(0, _Finder(made))
        return pytest.main([*_ARGUMENTS, *tests])

    return forked(work, 10 + 3 * seconds) == 0


def main(room: str = "", count: int = 60, seed: int = 0) -> int:
    """How many changes survived without an explanation; each is printed."""
    if room not in ROOMS:
        raise SystemExit(f"expected one of {', '.join(ROOMS)}, got {room!r}")
    patterns, names = (words.split() for words in ROOMS[room])
    files = sorted(file for pattern in patterns for file in CORE.glob(f"{pattern}.py"))
    explained = tomllib.loads((HERE / "explained.toml").read_text("utf-8"))
    every = [place for file in files for place in places(file)]
    drawn = [changed(*at)[1] for at in random.Random(seed).sample(every, min(count, len(every)))]
    found = reach(files, [f"tests/core/{name.replace('/', '/test_')}.py" for name in names])
    print(f"{room}: {len(drawn)} of {len(every)} changes, {len(found.seconds)} tests", flush=True)
    if found.failed:
        print(f"left out, for they fail as it is: {', '.join(sorted(found.failed))}", flush=True)
    told = new = 0
    for made in drawn:
        tests = found.noticing(made)
        if tests and not survives(made, tests, sum(found.seconds[test] for test in tests)):
            continue
        file = made.file.relative_to(CORE)
        if made.said in explained.get(str(file), {}):
            told += 1
            continue
        new += 1
        print(f"{file}:{made.line} survives {len(tests)} tests\n    {made.said}", flush=True)
    noticed = len(drawn) - told - new
    print(f"{room}: {noticed} noticed, {told} survive for the reason explained, {new} survive")
    return new


if __name__ == "__main__":
    os.chdir(ROOT)
    os.environ.setdefault("DISPLAY", ":none")  # None of these tests has a window.
    sys.exit(min(1, main(*sys.argv[1:2], *map(int, sys.argv[2:4]))))
