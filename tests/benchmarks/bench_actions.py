"""For how long what a person does blocks the window."""

import json
import subprocess
import sys
from pathlib import Path

_BLOCKING = Path(__file__).with_name("blocking.py")
_TOLD = 3  # of the slowest
_MOST = 50.0  # ms


def test_no_action_blocks_the_window(figure, ratio, seconds: float, tmp_path: Path) -> None:
    command = [sys.executable, str(_BLOCKING), "6" if seconds > 10 else "3"]
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path)
    times = json.loads(done.stdout.splitlines()[-1])
    slowest = sorted(times, key=times.__getitem__, reverse=True)[:_TOLD]
    told = ", ".join(f"{name} {times[name]:.0f} ms" for name in slowest)
    figure(f"{len(times)} actions block the window for at most {told}")
    ratio("slowest action, of the 50 ms allowed", times[slowest[0]] / _MOST, at_most=1)
