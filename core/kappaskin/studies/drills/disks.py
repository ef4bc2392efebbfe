"""Drills on the disk, where files are written: it is full at once, or in the middle of one."""

import resource
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, contextmanager
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from kappaskin.calibration import Calibration, save_calibration
from kappaskin.errors import Refusal
from kappaskin.studies.drills.drill import Drill
from kappaskin.studies.drills.outcome import Outcome
from kappaskin.studies.drills.stand import Stand

_FULL = Path("/dev/full")
_ROOM = 512  # bytes of a file that are written before the disk is full
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
    """Let no file of this process grow beyond `_ROOM`."""
    was = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (_ROOM, was[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, was)


def _spoilt(fault: Callable[[Path], AbstractContextManager[None]], _: Stand) -> Outcome:
    """Replace a file while there is no room: the old one stays whole, and it is said."""
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
            ("cannot be written" in refusal, "that there was no room is not told"),
            (path.read_bytes() == before, "the file that was there is spoilt"),
            (list(Path(folder).iterdir()) == [path], "half a file is left behind"),
        ]
    return Outcome(failures=tuple(text for holds, text in claims if not holds))


DRILLS = [
    Drill("disk ends", "no room in the middle of a calibration", partial(_spoilt, _room)),
    *(
        [Drill("disk full", "no room for a calibration", partial(_spoilt, _device_full))]
        if _FULL.exists()
        else []
    ),
]
