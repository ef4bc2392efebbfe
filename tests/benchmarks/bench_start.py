"""How soon the library and the app are there."""

import statistics
import subprocess
import sys
import time
from pathlib import Path

_FIRST = Path(__file__).with_name("first_picture.py")
_BARE = Path(__file__).with_name("bare_window.py")


def _import(statement: str) -> float:
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", statement], check=True)
    return time.perf_counter() - start


def test_importing_the_library_costs_little_more_than_numpy_and_scipy(figure) -> None:
    ours, theirs = [], []
    for _ in range(9):
        theirs.append(_import("import numpy, scipy.linalg, scipy.fft"))
        ours.append(_import("import kappaskin"))
    ratio = statistics.median(ours) / statistics.median(theirs)
    figure(f"import kappaskin: {ratio:.2f} times import numpy, scipy.linalg, scipy.fft")
    assert ratio <= 1.5


def _drawn(script: Path) -> tuple[float, float]:
    """Seconds from the start of a process until it has drawn, and of processor time until then."""
    command = [sys.executable, str(script), str(time.monotonic())]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    passed, spent = map(float, done.stdout.split())
    return passed, spent


# A name brings the rooms that it needs: the names of the README's example, and the live process.
_BEGUN = {
    "from kappaskin import LeastSquares, Patch, Plate, PointLoad, SensorLayout, SineBasis": 1.5,
    "from kappaskin import Engine": 2.0,
}


def test_the_names_that_one_begins_with_cost_little_more_than_numpy_and_scipy(figure) -> None:
    for names, most in _BEGUN.items():
        ours, theirs = [], []
        for _ in range(9):
            theirs.append(_import("import numpy, scipy.linalg, scipy.fft"))
            ours.append(_import(names))
        taken = statistics.median(ours) / statistics.median(theirs)
        figure(f"{names}: {taken:.2f} times import numpy, scipy.linalg, scipy.fft")
        assert taken <= most


def test_the_first_picture_is_there_within_three_seconds(figure) -> None:
    taken = [_drawn(_FIRST)[0] for _ in range(4)]
    figure(f"first picture of the skin: {min(taken[1:]):.2f} s warm ({taken[0]:.2f} s at first)")
    assert min(taken[1:]) < 3.0


def test_the_first_picture_takes_little_more_than_a_bare_window_does(figure) -> None:
    ours, bare = [], []
    for _ in range(5):
        bare.append(_drawn(_BARE))
        ours.append(_drawn(_FIRST))
    passed, spent = (
        statistics.median(a) / statistics.median(b)
        for a, b in zip(zip(*ours, strict=True), zip(*bare, strict=True), strict=True)
    )
    figure(
        f"first picture of the skin: {passed:.2f} times as late as that of a bare QtInteractor, "
        f"{spent:.2f} times its processor time"
    )
    assert spent <= 2.5  # other processes on the same cores do not change it much
