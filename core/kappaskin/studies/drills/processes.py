"""Drills on the live process and on the one that shows: killed, or suspended."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from kappaskin.live import LOST, STREAMING, Engine
from kappaskin.sources import Accounting
from kappaskin.studies.drills.stand import Drill, DrillOutcome, Stand

_START = 20.0  # s that a process may take until it computes
_NOTICED = 1.0  # s
_RESTARTED = 10.0  # s for a new process to compute, on a busy machine
_WITHIN = 1.0  # s
_DRAINED = 20.0  # s
_SAME = 5  # reports in a row
_MEMORY = "/dev/shm"
_PARENT = "kappaskin.studies.drills.processes"


def _pumped(stand: Stand, done: Callable[[], object], within: float) -> bool:
    """Let the relay work until `done`; whether it was within so many s."""
    end = time.monotonic() + within
    while not done() and time.monotonic() < end:
        stand.relay.pump()
        time.sleep(0.002)
    return bool(done())


def _shows(engine: Engine, after: int) -> bool:
    """Whether the newest estimate is of the message `after` or of one after it."""
    status = engine.status()
    estimate = engine.latest(status) if status.state == STREAMING else None
    return estimate is not None and estimate.sequence >= after


def _recovery(stand: Stand, engine: Engine, within: float) -> float:
    """How long it took in s until a frame sent from now on is shown, infinite if it never was."""
    began, first = time.monotonic(), stand.relay.sequence
    shown = _pumped(stand, lambda: _shows(engine, first), within)
    return time.monotonic() - began if shown else float("inf")


def _drained(stand: Stand, engine: Engine) -> Accounting:
    """The engine's accounting of everything that was sent, once it no longer changes."""
    seen, reported, same, end = Accounting(), 0.0, 0, time.monotonic() + _DRAINED
    while same < _SAME and time.monotonic() < end:
        stand.relay.forget()
        stand.relay.flush()
        time.sleep(0.01)
        status = engine.status()
        if status.reported != reported:
            same = same + 1 if status.accounting == seen and stand.relay.empty else 0
            seen, reported = status.accounting, status.reported
    return seen


def _outcome(
    stand: Stand, engine: Engine, recovered: float, *claims: tuple[bool, str]
) -> DrillOutcome:
    seen = _drained(stand, engine)
    laws = ((seen.balanced, "the accounting does not balance"), *claims)
    failures = tuple(text for holds, text in laws if not holds)
    return DrillOutcome(
        stand.relay.spent, seen.accepted, seen.lost, seen.bytes_discarded, 0, recovered, failures
    )


def _streaming(stand: Stand, engine: Engine) -> bool:
    engine.connect(stand.relay.port)
    return _pumped(stand, lambda: _shows(engine, 0), _START)


def _suspend(stand: Stand) -> DrillOutcome:
    """Stop the live process for a while, and let it go on."""
    with Engine() as engine:
        streaming = _streaming(stand, engine)
        span = _drained(stand, engine).span - stand.relay.spent  # some were sent before it listened
        _kill(engine.pid, signal.SIGSTOP)
        try:
            _pumped(stand, lambda: False, 5.0 if stand.long else 1.0)
        finally:
            _kill(engine.pid, signal.SIGCONT)
        recovered = _recovery(stand, engine, _WITHIN)
        missing = stand.relay.spent + span - _drained(stand, engine).span
        return _outcome(
            stand,
            engine,
            recovered,
            (streaming, "no frames came"),
            (missing == 0, f"{missing} messages are not accounted for"),
        )


def _killed(stand: Stand) -> DrillOutcome:
    """Kill the live process: another takes over, and an event reports it."""
    with Engine() as engine:
        streaming, was = _streaming(stand, engine), engine.pid
        _kill(was, signal.SIGKILL)
        noticed = _pumped(stand, lambda: engine.status().state == LOST, _NOTICED)
        _pumped(stand, lambda: engine.revive() or engine.pid != was, _START)
        recovered = _recovery(stand, engine, _RESTARTED)
        reported = any(event.kind == "engine" for event in engine.status().events)
        return _outcome(
            stand,
            engine,
            recovered,
            (streaming, "no frames came"),
            (noticed, "that it ended was not noticed within 1 s"),
            (engine.pid != was, "no other process was started"),
            (reported, "that it was restarted is not reported"),
        )


def _orphaned(stand: Stand) -> DrillOutcome:
    """Kill the process that shows: the live one ends, and leaves no memory."""
    command = [sys.executable, "-m", _PARENT, stand.relay.port]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as parent:
        pid = int(parent.stdout.readline() if parent.stdout else 0)
        blocks = _blocks_of(pid)
        streaming = _pumped(stand, lambda: stand.relay.empty and stand.relay.spent > 50, _START)
        parent.kill()
        began = time.monotonic()
        ended = _pumped(stand, lambda: _gone(pid), _WITHIN)
        took = time.monotonic() - began
        clean = _pumped(stand, lambda: not any(block.exists() for block in blocks), _WITHIN)
    failures = [
        (streaming, "no frames came"),
        (ended, f"the live process is still there after {took:.1f} s"),
        (clean, f"left in {_MEMORY}: {', '.join(block.name for block in blocks)}"),
    ]
    return DrillOutcome(
        sent=stand.relay.spent,
        recovered=took,
        failures=tuple(text for holds, text in failures if not holds),
    )


def _kill(pid: int | None, number: int) -> None:
    if pid is not None:
        os.kill(pid, number)


def _gone(pid: int) -> bool:
    """Whether a process ended, be it that nobody asked for its exit code yet."""
    with suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def _blocks_of(pid: int) -> list[Path]:
    """The shared memory that a process has, where the system lists it."""
    with suppress(OSError):
        lines = Path(f"/proc/{pid}/maps").read_text().splitlines()
        return sorted({Path(line.split()[-1]) for line in lines if f"{_MEMORY}/psm_" in line})
    return []


PROCESS_DRILLS = [
    Drill("engine suspended", "the live process stands still and goes on", _suspend, _WITHIN),
    Drill("engine killed", "kill -9 of the live process: another takes over", _killed, _RESTARTED),
    Drill("app killed", "kill -9 of what shows: the live process ends too", _orphaned, _WITHIN),
]


if __name__ == "__main__":
    with Engine() as engine:
        engine.connect(sys.argv[1])
        print(engine.pid, flush=True)
        while engine.alive:
            time.sleep(0.1)
