"""How soon the library and the app are there."""

import statistics
import subprocess
import sys
import time
from pathlib import Path

import pytest

_FIRST = Path(__file__).with_name("first_picture.py")
_BARE = Path(__file__).with_name("bare_window.py")


def _import(statement: str) -> float:
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", statement], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


# Nothing else is loaded by the first; the second are the names of an example of the guide.
@pytest.mark.parametrize(
    "ours",
    [
        "import kappaskin",
        "from kappaskin import LeastSquares, Patch, Plate, PointLoad, SensorLayout, SineBasis",
        "from kappaskin import Engine",
    ],
)
def test_importing_the_library_costs_little_more_than_numpy_and_scipy(figure, ratio, ours) -> None:
    theirs = "import numpy, scipy.linalg, scipy.fft"
    taken = [(_import(ours), _import(theirs)) for _ in range(9)]
    times = statistics.median(own for own, _ in taken) / statistics.median(it for _, it in taken)
    figure(f"{ours}: {times:.2f} times {theirs}")
    asked = 2.0 if "Engine" in ours else 1.5
    ratio(f"{ours}, against NumPy and SciPy", times, at_most=asked)


def test_the_help_of_the_command_costs_little_more_than_numpy(figure, ratio) -> None:
    helped = "from kappaskin.cli import main; main(['--help'])"
    taken = [(_import(helped), _import("import numpy")) for _ in range(9)]
    own, numpy = (statistics.median(times) for times in zip(*taken, strict=True))
    figure(f"kappaskin --help: {own:.2f} s, {own / numpy:.2f} times import numpy")
    # What a person does not notice is allowed on a machine where NumPy is there at once.
    ratio("kappaskin --help, of 2.5 times import numpy or 0.35 s", own / max(2.5 * numpy, 0.35),
          at_most=1)  # fmt: skip


def _drawn(script: Path) -> tuple[float, float]:
    """Seconds from the start of a process until it has drawn, and of processor time until then."""
    command = [sys.executable, str(script), str(time.monotonic())]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    passed, spent = map(float, done.stdout.split())
    return passed, spent


def test_the_first_picture_is_there_within_three_seconds(figure, ratio) -> None:
    taken = [_drawn(_FIRST)[0] for _ in range(4)]
    figure(f"first picture of the skin: {min(taken[1:]):.2f} s warm ({taken[0]:.2f} s at first)")
    ratio("first picture of the skin, of the 3 s allowed", min(taken[1:]) / 3, at_most=1)


def test_the_first_picture_takes_little_more_than_a_bare_window_does(figure, ratio) -> None:
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
    # Other processes on the same cores do not change it much.
    ratio("processor time until a picture, against a bare QtInteractor", spent, at_most=2.5)
