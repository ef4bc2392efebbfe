"""What hours of use leave behind: memory while settings change, and what is started and ended."""

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil

_SOAKING, _CYCLING = (Path(__file__).with_name(f"{name}.py") for name in ("soaking", "cycling"))
_TIMES = 20
_WARM = 8  # starts after which Qt, VTK and the allocator keep no more
_GRACE = 10.0  # s in which what a program began ends after it; a busy machine takes over 2
_MEMORY = 20.0  # MB that may be added, in a run or from the eighth start to the twentieth


def test_memory_is_flat_while_frames_are_recorded_and_settings_change(
    figure, ratio, lasting: float, thousand: str, tmp_path: Path
) -> None:
    command = [sys.executable, str(_SOAKING), thousand, str(lasting), str(tmp_path)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    held = json.loads(done.stdout)
    grown = {name: lasting * held[f"{name}_mb_s"] for name in ("window", "engine")}
    figure(
        f"recording and changing settings for {lasting:g} s at {held['frames']:.0f} frames/s, "
        f"{held['lost']:.0f} lost: memory of the window {grown['window']:+.1f} MB, of the engine "
        f"{grown['engine']:+.1f} MB, by a line through all of them"
    )
    assert held["frames"] > 0.9 * 1000
    for name, megabytes in grown.items():
        ratio(f"memory the {name} grows by, of 20 MB allowed", megabytes / _MEMORY, at_most=1)
    assert held["more_threads"] <= 0
    assert held["more_descriptors"] <= 0


def test_twenty_windows_of_a_process_leave_nothing_behind(figure, ratio) -> None:
    command = [sys.executable, str(_CYCLING), str(_TIMES)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    held = json.loads(done.stdout)
    memory = np.array([each["memory"] for each in held]) / 1e6
    figure(
        f"{_TIMES} windows one after the other: {memory[0]:.0f} MB after the first, "
        f"{memory[_WARM - 1]:.0f} after {_WARM}, {memory[-1]:.0f} after all"
    )
    more = memory[-1] - memory[_WARM - 1]
    ratio("memory twelve more windows leave, of 20 MB allowed", more / _MEMORY, at_most=1)
    for what in ("threads", "descriptors", "processes", "blocks"):
        assert held[-1][what] == held[0][what]
    assert held[-1]["blocks"] == 0


def test_twenty_runs_of_the_app_leave_nothing_behind() -> None:
    for _ in range(_TIMES):
        blocks = set[str]()
        command = [sys.executable, "-m", "kappaskin", "app", "--seconds", "1"]
        with subprocess.Popen(command, start_new_session=True) as run:
            while run.poll() is None:
                blocks.update(*map(_blocks_of, _processes_of(run.pid)))
                time.sleep(0.05)
        assert run.returncode == 0
        end = time.monotonic() + _GRACE
        while left := _processes_of(run.pid):
            assert time.monotonic() < end, left
            time.sleep(0.02)
        assert blocks
        assert not [block for block in blocks if Path(block).exists()]


def _processes_of(session: int) -> list[int]:
    return [pid for pid in psutil.pids() if _session_of(pid) == session]


def _blocks_of(pid: int) -> list[str]:
    """Paths of the shared memory of a process; other programs make and remove theirs meanwhile."""
    try:
        return re.findall(r"/dev/shm/\S+", Path(f"/proc/{pid}/maps").read_text())
    except OSError:  # it has ended
        return []


def _session_of(pid: int) -> int:
    try:
        return os.getsid(pid)
    except ProcessLookupError:
        return -1
