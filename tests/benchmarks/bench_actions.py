"""For how long what a person does holds the window."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

_BLOCKING = Path(__file__).with_name("blocking.py")
_TOLD = 5  # of the slowest
_FIRST, _MOST = 30.0, 50.0  # ms

Uses = dict[str, list[tuple[float, float]]]


def _slowest(
    uses: Uses, time_of: Callable[[list[tuple[float, float]]], float]
) -> tuple[float, str]:
    """The longest time in ms, and the slowest actions with theirs."""
    times = {name: time_of(of_action) for name, of_action in uses.items()}
    slowest = sorted(times, key=times.__getitem__, reverse=True)[:_TOLD]
    return times[slowest[0]], ", ".join(f"{name} {times[name]:.0f}" for name in slowest)


def test_no_action_holds_the_window(figure, ratio, seconds: float, tmp_path: Path) -> None:
    command = [sys.executable, str(_BLOCKING), "6" if seconds > 10 else "3"]
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path)
    found = json.loads(done.stdout.splitlines()[-1])
    uses: Uses = found["uses"]
    first, of_first = _slowest(uses, lambda of_action: of_action[0][0])
    opened, of_opened = _slowest(uses, lambda of_action: max(of_action[0]))
    later, of_later = _slowest(uses, lambda of_action: min(map(max, of_action[1:])))
    figure(
        f"{len(uses)} actions hold the window, in ms, when first used: {of_first}; with the "
        f"longest turn of the event loop after it, in processor time: {of_opened}; the least of "
        f"later uses: {of_later}; no action: {found['idle']:.0f}"
    )
    ratio("first use of an action, of the 30 ms allowed", first / _FIRST, at_most=1)
    ratio("what an action first opens, of the 50 ms allowed", opened / _MOST, at_most=1)
    ratio("what an action opens later, of the 50 ms allowed", later / _MOST, at_most=1)
