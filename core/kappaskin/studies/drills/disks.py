"""Drills on the disk: full, or slow, under a calibration or a recording."""

import errno
import os
import resource
import time
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, closing, contextmanager
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from kappaskin.calibration import Calibration, save_calibration
from kappaskin.errors import Refusal
from kappaskin.recording import Recorder, Recording, RecordingStatus, ReservedFile
from kappaskin.recording import messages as m
from kappaskin.studies.drills.stand import Drill, DrillOutcome, Stand

_FULL = Path("/dev/full")
_FILE_ROOM = 512  # bytes of a file that are written before the disk is full
_CHANNELS = 300


def _calibration(name: str) -> Calibration:
    ones, date = np.ones(_CHANNELS), datetime(2026, 1, 1, tzinfo=UTC)
    return Calibration(name, "drill", "1", "none", date, ones, 0 * ones, 0 * ones, 0 * ones)


@contextmanager
def _device_full(part: Path) -> Generator[None]:
    part.symlink_to(_FULL)
    yield


@contextmanager
def _room(_: Path) -> Generator[None]:
    """Let no file of this process grow beyond `_FILE_ROOM`."""
    was = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (_FILE_ROOM, was[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, was)


def _spoilt(fault: Callable[[Path], AbstractContextManager[None]], _: Stand) -> DrillOutcome:
    """Replace a file on a full disk: the old one stays intact, and the error is reported."""
    with TemporaryDirectory(prefix="kappaskin-drill-") as folder:
        path = Path(folder) / "skin.toml"
        save_calibration(_calibration("before"), path)
        before, refusal = path.read_bytes(), ""
        with fault(path.with_name(f".{path.name}.part")):
            try:
                save_calibration(_calibration("after"), path)
            except Refusal as reason:
                refusal = str(reason)
        claims = [
            ("cannot be written" in refusal, "that the disk was full is not reported"),
            (path.read_bytes() == before, "the file that was there is spoilt"),
            (list(Path(folder).iterdir()) == [path], "half a file is left behind"),
        ]
    return DrillOutcome(failures=tuple(text for holds, text in claims if not holds))


CALIBRATION_DRILLS = [
    Drill("disk ends", "no room in the middle of a calibration", partial(_spoilt, _room)),
    *(
        [Drill("disk full", "no room for a calibration", partial(_spoilt, _device_full))]
        if _FULL.exists()
        else []
    ),
]


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
    """A disk with little room apart from the reserve."""

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
    """Record for a while to a bad disk: reads go on, the file is whole, and trouble is reported."""
    stand.settle()
    with TemporaryDirectory(prefix="kappaskin-drill-") as folder:
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
    """Whether the file is what it should be, of so many bytes that the recorder received."""
    try:
        with Recording(path) as recording:
            whole = recording.whole
            lines = [m.unpack_line(got.data) for got in recording.messages_on(m.LINES)]
    except Refusal as refusal:
        return [(False, str(refusal))]
    kept = sum(len(data) for _, sent, data in lines if not sent)
    if full:
        room = "whole up to then" in written.trouble and 0 < kept < received
        return [(whole, "the file is not whole"), (room, "that the disk was full is not reported")]
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
