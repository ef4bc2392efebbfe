"""Completed drawings of the whole window, against a bare QtInteractor with the same mesh."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

_DRAWING = Path(__file__).with_name("drawing.py")
_TURNS = 3


def _run(what: str, seconds: float, source: str = "device") -> dict[str, float]:
    command = [sys.executable, str(_DRAWING), what, str(seconds), source]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def test_the_window_draws_nearly_as_often_as_a_bare_interactor(
    figure, ratio, seconds: float
) -> None:
    before, app, after = (_run(what, seconds) for what in ("bare", "app", "bare"))
    bare = (before["drawn"] + after["drawn"]) / 2
    figure(
        f"drawings at 1280 x 800 over {seconds:g} s: {app['drawn']:.1f} per second, "
        f"{app['drawn'] / bare:.2f} of a bare QtInteractor ({bare:.1f}); frame age when drawn "
        f"{app['age_p99_ms']:.1f} ms, reader gap {app['reader_gap_p99_ms']:.1f} ms (both 99th "
        f"percentile); {app['frames']:.0f} frames/s, {app['lost']:.0f} lost"
    )
    assert app["lost"] == 0
    ratio("drawings, against a bare QtInteractor", app["drawn"] / bare, at_least=0.85)
    ratio("drawings, of the 45 a second asked", app["drawn"] / 45, at_least=1)
    ratio("gap of a reader, of the 10 ms allowed", app["reader_gap_p99_ms"] / 10, at_most=1)


@pytest.mark.parametrize("shown", ["app", "everything"])
def test_with_a_thousand_frames_a_second_it_draws_nearly_as_often_as_a_bare_interactor(
    figure, ratio, seconds: float, thousand: str, shown: str
) -> None:
    turns = [
        (_run("bare", seconds, thousand), _run(shown, seconds, thousand)) for _ in range(_TURNS)
    ]
    bare, drawn = (
        float(np.mean([run["drawn"] for run in runs])) for runs in zip(*turns, strict=True)
    )
    frames = min(run["frames"] for _, run in turns)
    age = float(np.median([run["age_p99_ms"] for _, run in turns]))
    figure(
        f"{shown} at 1280 x 800 with {frames:.0f} frames/s, {_TURNS} turns of {seconds:g} s: "
        f"{drawn:.1f} drawings/s, {drawn / bare:.2f} of a bare QtInteractor ({bare:.1f}); frame "
        f"age when drawn {age:.1f} ms (99th percentile, median of the turns)"
    )
    assert frames > 950
    ratio(f"age of a frame drawn by {shown}, of the 40 ms allowed", age / 40, at_most=1)
    ratio(
        f"drawings of {shown} at 1,000 frames/s, against a bare QtInteractor",
        drawn / bare,
        at_least=0.85 if shown == "app" else None,
    )


def test_measuring_the_cost_of_accuracy_does_not_stop_the_drawing(figure, ratio, seconds) -> None:
    idle, measuring = (_run(what, seconds) for what in ("app", "measuring"))
    figure(
        f"drawings at 1280 x 800 while the cost of accuracy is measured: {measuring['drawn']:.1f} "
        f"per second ({idle['drawn']:.1f} without it); {measuring['tried']:.0f} settings measured"
    )
    assert measuring["tried"] > 0
    ratio(
        "drawings while the cost is measured, of the 15 a second asked",
        measuring["drawn"] / 15,
        at_least=1,
    )
