"""Files that declare far more than they hold: refused with little memory, in little time."""

import re
import runpy
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

_HOSTILE = runpy.run_path(str(Path(__file__).parents[1] / "hostile_files.py"))
SECONDS, MEMORY = 5.0, 500e6  # s, and bytes of all processes of a command
CASES = [
    *(("reconstruct", kind, "NPZ", ".npz") for kind in _HOSTILE["NPZ"]),
    *(("info", kind, "READ", ".mcap") for kind in _HOSTILE["READ"]),
    *(("repair", kind, "REPAIRED", ".mcap") for kind in _HOSTILE["REPAIRED"]),
    *(
        (command, kind, group, ".mcap")
        for command in ("verify", "export")
        for group in ("READ", "COMPUTED")
        for kind in _HOSTILE[group]
    ),
]


@pytest.mark.parametrize(("command", "kind", "group", "suffix"), CASES)
def test_it_is_refused(command: str, kind: str, group: str, suffix: str, tmp_path: Path) -> None:
    file = tmp_path / f"{kind}{suffix}"
    file.write_bytes(_HOSTILE[group][kind]())
    out = {"verify": [], "info": [], "export": ["--to", str(tmp_path / "out.csv")]}
    outputs = out.get(command, ["--out", str(tmp_path / f"out{suffix}")])

    code, said, seconds, memory = _run([command, str(file), *outputs])

    assert code == 2
    too_much = r"expected .*to take at most .* would take [\d.,]+ [kMG]B.*`--limit`"
    assert re.search("EOF" if kind == "long-header" else too_much, said), said
    assert seconds < SECONDS
    assert memory < MEMORY
    assert list(tmp_path.iterdir()) == [file]


def _run(arguments: list[str]) -> tuple[int, str, float, float]:
    """Exit code and standard error of a command, its time in s and its peak memory in bytes."""
    command, began, peak = [sys.executable, "-m", "kappaskin", *arguments], time.monotonic(), 0.0
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        watched = psutil.Process(process.pid)
        while process.poll() is None:
            peak = max(peak, _memory(watched))
            if time.monotonic() - began > 4 * SECONDS:
                process.kill()
            time.sleep(0.01)
        assert process.stderr
        return process.returncode, process.stderr.read(), time.monotonic() - began, peak


def _memory(process: psutil.Process) -> float:
    try:
        of_all = (process, *process.children(recursive=True))
        return sum(one.memory_info().rss for one in of_all)
    except psutil.Error:
        return 0.0
