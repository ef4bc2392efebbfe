"""Completed drawings of the whole window, against a bare QtInteractor with the same mesh."""

import json
import subprocess
import sys
from pathlib import Path

_DRAWING = Path(__file__).with_name("drawing.py")


def _run(what: str, seconds: float) -> dict[str, float]:
    command = [sys.executable, str(_DRAWING), what, str(seconds)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def test_the_window_draws_nearly_as_often_as_a_bare_interactor(figure, seconds: float) -> None:
    before, app, after = (_run(what, seconds) for what in ("bare", "app", "bare"))
    bare = (before["drawn"] + after["drawn"]) / 2
    figure(
        f"drawings at 1280 x 800 over {seconds:g} s: {app['drawn']:.1f} per second, "
        f"{app['drawn'] / bare:.2f} of a bare QtInteractor ({bare:.1f}); frame age when drawn "
        f"{app['age_p99_ms']:.1f} ms, reader gap {app['reader_gap_p99_ms']:.1f} ms (both 99th "
        f"percentile); {app['frames']:.0f} frames/s, {app['lost']:.0f} lost"
    )
    assert app["lost"] == 0
    assert app["age_p99_ms"] < 50
    assert app["reader_gap_p99_ms"] < 10
    assert app["drawn"] >= 0.85 * bare
    assert app["drawn"] >= 45
