"""How soon the library and the app are there."""

import statistics
import subprocess
import sys
import time
from pathlib import Path

_FIRST = Path(__file__).with_name("first_picture.py")


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


def test_the_first_picture_is_there_within_three_seconds(figure) -> None:
    taken = []
    for _ in range(4):
        command = [sys.executable, str(_FIRST), str(time.monotonic())]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        taken.append(float(done.stdout))
    figure(f"first picture of the skin: {min(taken[1:]):.2f} s warm ({taken[0]:.2f} s at first)")
    assert min(taken[1:]) < 3.0
