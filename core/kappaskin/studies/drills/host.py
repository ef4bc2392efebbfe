"""Fault drills of the machine: its disk and its processes."""

import errno
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from contextlib import closing, contextmanager, suppress
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np

from kappaskin._files import TemporaryFolder
from kappaskin.calibration import Calibration
from kappaskin.errors import Refusal
from kappaskin.live import LOST, STREAMING, Engine
from kappaskin.recording import Recorder, Recording, RecordingStatus, ReservedFile
from kappaskin.sources import Accounting
from kappaskin.studies.drills.stand import Drill, DrillOutcome, Stand

_CHANNELS = 300


def _calibration(name: str) -> Calibration:
    ones, date = np.ones(_CHANNELS), datetime(2026, 1, 1, tzinfo=UTC)
    return Calibration(name, "drill", "1", "none", date, ones, 0 * ones, 0 * ones, 0 * ones)


@contextmanager
def _room(size: int) -> Generator[None]:
    """Let no file of this process grow beyond `size` bytes."""
    was = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, was[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, was)


def _spoilt(room: int, _: Stand) -> DrillOutcome:
    """Replace a file on a full disk: the old one stays intact, and the error is reported."""
    with TemporaryFolder() as folder:
        path = Path(folder) / "skin.toml"
        _calibration("before").save(path)
        before, files, refusal = path.read_bytes(), set(Path(folder).iterdir()), ""
        with _room(room):
            try:
                _calibration("after").save(path)
            except Refusal as reason:
                refusal = str(reason)
        claims = [
            ("cannot be written" in refusal, "that the disk was full is not reported"),
            (path.read_bytes() == before, "the existing file is damaged"),
            (set(Path(folder).iterdir()) == files, "half a file is left behind"),
        ]
    return DrillOutcome(failures=tuple(text for holds, text in claims if not holds))


CALIBRATION_DRILLS = [
    Drill("disk ends", "no room in the middle of a calibration", partial(_spoilt, 512)),
    Drill("disk full", "no room for a calibration", partial(_spoilt, 0)),
]


_WITHIN = 1.0  # s
_BLOCKED = 0.3  # s that a read may take on a busy machine
_SLOW = 0.5  # s that one write takes
_ROOM = 2**16  # bytes of a file, until the disk is full except for the reserve


class _SlowDisk(ReservedFile):
    """A disk on which every write is slow."""

    def put(self, data: bytes) -> None:
        time.sleep(_SLOW)
        super().put(data)


class _FullDisk(ReservedFile):
    """A disk with little room in addition to the reserve."""

    def put(self, data: bytes) -> None:
        room = _ROOM - self.tell()
        if not self.trouble and len(data) > room:
            super().put(data[:room])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        super().put(data)


class _Listener(Recorder):
    """A recorder that counts the bytes it receives."""

    total = 0

    def received(self, host_time: float, data: bytes) -> None:
        self.total += len(data)
        super().received(host_time, data)


def _recorded(disk: Callable[[Path], ReservedFile], full: bool, stand: Stand) -> DrillOutcome:
    """Record to a bad disk: reads continue, the file is whole, and the trouble is reported."""
    stand.settle()
    with TemporaryFolder() as folder:
        path = Path(folder) / "drill.mcap"
        with closing(_Listener(path, stand.clock(), disk)) as recorder:
            stand.source.record(recorder)
            slowest = stand.longest_read(10.0 if stand.long else 2.0)
            stand.recover(_WITHIN)
            stand.source.record(None)
        claims = _claims(path, recorder.written, recorder.total, full)
    stand.drain()
    lost = stand.source.accounting().lost
    return stand.outcome(
        (slowest < _BLOCKED, f"a read took {slowest:.2f} s"),
        (lost == 0, f"{lost} messages lost"),
        *claims,
    )


def _claims(
    path: Path, written: RecordingStatus, received: int, full: bool
) -> list[tuple[bool, str]]:
    """Whether the file is as expected, given the bytes that the recorder received."""
    try:
        with Recording(path) as recording:
            whole = recording.whole
            lines = list(recording.lines())
    except Refusal as refusal:
        return [(False, str(refusal))]
    kept = sum(len(data) for _, sent, data in lines if not sent)
    if full:
        room = "complete up to that time" in written.trouble and 0 < kept < received
        return [(whole, "the file is incomplete"), (room, "that the disk was full is not reported")]
    untroubled = not written.trouble and not written.lost
    return [
        (whole and untroubled, f"the file is not whole: {written.trouble or written.lost}"),
        (kept == received, f"of {received} bytes {kept} were recorded"),
    ]


RECORDING_DRILLS = [
    Drill(
        "recording, slow disk",
        "every write of a recording takes half a second",
        partial(_recorded, _SlowDisk, False),
        _WITHIN,
    ),
    Drill(
        "recording, full disk",
        "no room in the middle of a recording",
        partial(_recorded, _FullDisk, True),
        _WITHIN,
    ),
]


# Drills on the live process and on the one that shows: killed, or suspended

_START = 20.0  # s that a process may take until it computes
_NOTICED = 1.0  # s
_RESTARTED = 10.0  # s for a new process to compute, on a busy machine
_DRAINED = 20.0  # s
_SAME = 5  # reports in a row
_MEMORY = "/dev/shm"


def _shows(engine: Engine, after: int) -> bool:
    """Whether the newest estimate is of the message `after` or of one after it."""
    status = engine.status()
    estimate = engine.latest(status) if status.state == STREAMING else None
    return estimate is not None and estimate.sequence >= after


def _recovery(stand: Stand, engine: Engine, within: float) -> float:
    """How long it took in s until a frame sent from now on is shown, infinite if it never was."""
    began, first = time.monotonic(), stand.relay.sequence
    shown = stand.until(lambda: _shows(engine, first), within, stand.pump)
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
    return stand.until(lambda: _shows(engine, 0), _START, stand.pump)


def _suspend(stand: Stand) -> DrillOutcome:
    """Suspend the live process for a while, and resume it."""
    with Engine() as engine:
        streaming = _streaming(stand, engine)
        span = _drained(stand, engine).span - stand.relay.spent  # some were sent before it listened
        _kill(engine.pid, signal.SIGSTOP)
        try:
            stand.until(lambda: False, 5.0 if stand.long else 1.0, stand.pump)
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
        noticed = stand.until(lambda: engine.status().state == LOST, _NOTICED, stand.pump)
        stand.until(lambda: engine.revive() or engine.pid != was, _START, stand.pump)
        recovered = _recovery(stand, engine, _RESTARTED)
        reported = any(event.kind == "engine" for event in engine.status().events)
        return _outcome(
            stand,
            engine,
            recovered,
            (streaming, "no frames came"),
            (noticed, "its end was not detected within 1 s"),
            (engine.pid != was, "no new process was started"),
            (reported, "its restart is not reported"),
        )


def _orphaned(stand: Stand) -> DrillOutcome:
    """Kill the process that shows: the live one ends, and leaves no memory."""
    command = [sys.executable, "-m", __name__, stand.relay.port]  # a bundle knows no -c
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as parent:
        pid = int(parent.stdout.readline() if parent.stdout else 0)
        blocks = _blocks_of(pid)
        streaming = stand.until(
            lambda: stand.relay.empty and stand.relay.spent > 50, _START, stand.pump
        )
        parent.kill()
        began = time.monotonic()
        ended = stand.until(lambda: _gone(pid), _WITHIN, stand.pump)
        took = time.monotonic() - began
        clean = stand.until(
            lambda: not any(block.exists() for block in blocks), _WITHIN, stand.pump
        )
    failures = [
        (streaming, "no frames came"),
        (ended, f"the live process still runs after {took:.1f} s"),
        (clean, f"left in {_MEMORY}: {', '.join(block.name for block in blocks)}"),
    ]
    return DrillOutcome(
        sent=stand.relay.spent,
        recovered=took,
        failures=tuple(text for holds, text in failures if not holds),
    )


def show_stream(port: str) -> None:
    """Be a process that shows what comes over `port`: print the live one's number, and wait."""
    with Engine() as engine:
        engine.connect(port)
        print(engine.pid, flush=True)
        while engine.alive:
            time.sleep(0.1)


def _kill(pid: int | None, number: int) -> None:
    if pid is not None:
        os.kill(pid, number)


def _gone(pid: int) -> bool:
    """Whether a process ended, even if its exit code was not read yet."""
    with suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def _blocks_of(pid: int) -> list[Path]:
    """The shared memory of a process, where the system lists it."""
    with suppress(OSError):
        lines = Path(f"/proc/{pid}/maps").read_text().splitlines()
        return sorted({Path(line.split()[-1]) for line in lines if f"{_MEMORY}/kappaskin-" in line})
    return []


PROCESS_DRILLS = [
    Drill("engine suspended", "the live process is suspended and resumes", _suspend, _WITHIN),
    Drill("engine killed", "kill -9 of the live process: a new one starts", _killed, _RESTARTED),
    Drill(
        "app killed",
        "kill -9 of the window's process: the live process ends too",
        _orphaned,
        _WITHIN,
    ),
]


if __name__ == "__main__":
    show_stream(sys.argv[1])
