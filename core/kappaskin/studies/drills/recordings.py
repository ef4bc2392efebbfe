"""Drills on the disk under a recording: it is slow, or full; what is live must not notice."""

import errno
import os
import time
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from kappaskin.errors import Refusal
from kappaskin.recording import Recorder, Recording, RecordingStatus, ReservedFile
from kappaskin.recording import messages as m
from kappaskin.studies.drills.drill import Drill
from kappaskin.studies.drills.outcome import Outcome
from kappaskin.studies.drills.stand import Stand

_WITHIN = 1.0  # s
_BLOCKED = 0.3  # s that a read may take on a busy machine
_SLOW = 0.5  # s that one write takes
_ROOM = 2**16  # bytes of a file, until the disk is full but for what is kept in reserve


class _SlowDisk(ReservedFile):
    """One on which every write takes its time."""

    def put(self, data: bytes) -> None:
        time.sleep(_SLOW)
        super().put(data)


class _FullDisk(ReservedFile):
    """One with little room beside what is kept in reserve."""

    def put(self, data: bytes) -> None:
        room = _ROOM - self.tell()
        if not self.trouble and len(data) > room:
            super().put(data[:room])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        super().put(data)


class _Listener(Recorder):
    """A recorder that counts the bytes it is told of."""

    told = 0

    def came(self, host_time: float, data: bytes) -> None:
        self.told += len(data)
        super().came(host_time, data)


def _recorded(disk: Callable[[Path], ReservedFile], full: bool, stand: Stand) -> Outcome:
    """Record for a while to a bad disk: reads go on, the file is whole, and it is told."""
    stand.settle()
    with TemporaryDirectory(prefix="kappaskin-drill-") as folder:
        path = Path(folder) / "drill.mcap"
        with closing(_Listener(path, stand.clock(), disk)) as recorder:
            stand.source.record(recorder)
            slowest = stand.longest_read(10.0 if stand.long else 2.0)
            stand.recover(_WITHIN)
            stand.source.record(None)
        claims = _claims(path, recorder.written, recorder.told, full)
    stand.drain()
    lost = stand.source.accounting().lost
    return stand.outcome(
        (slowest < _BLOCKED, f"a read took {slowest:.2f} s"),
        (lost == 0, f"{lost} messages lost"),
        *claims,
    )


def _claims(path: Path, written: RecordingStatus, told: int, full: bool) -> list[tuple[bool, str]]:
    """Whether the file is what it should be, of so many bytes that the recorder was told of."""
    try:
        with Recording(path) as recording:
            whole = recording.whole
            lines = [m.unpack_line(got.data) for got in recording.messages_on(m.LINES)]
    except Refusal as refusal:
        return [(False, str(refusal))]
    kept = sum(len(data) for _, sent, data in lines if not sent)
    if full:
        room = "whole up to then" in written.trouble and 0 < kept < told
        return [(whole, "the file is not whole"), (room, "that the disk was full is not told")]
    said = not written.trouble and not written.lost
    return [
        (whole and said, f"the file is not whole: {written.trouble or written.lost}"),
        (kept == told, f"of {told} bytes {kept} were recorded"),
    ]


DRILLS = [
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
