"""A recording to what is wanted of it, written into a folder: step by step, as far as it is."""

import math
import shutil
import time
from collections.abc import Generator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from kappaskin.errors import Refusal
from kappaskin.frames import Frame
from kappaskin.recording.export.about import About, about, another
from kappaskin.recording.export.moment import Moment, Writer
from kappaskin.recording.export.surfaces import StlSurfaces
from kappaskin.recording.export.to_csv import CsvTable
from kappaskin.recording.export.to_hdf5 import Hdf5Table
from kappaskin.recording.export.to_npz import NpzTable
from kappaskin.recording.export.to_vtp import VtpSurfaces
from kappaskin.recording.export.wanted import Wanted
from kappaskin.recording.reading import Message, Recording
from kappaskin.recording.recompute import Retrace
from kappaskin.sensing import Sensor
from kappaskin.sources import sensor_to_json

FORMATS: dict[str, type[Writer]] = {
    ".csv": CsvTable,
    ".npz": NpzTable,
    ".h5": Hdf5Table,
    ".vtp": VtpSurfaces,
    ".pvd": VtpSurfaces,
    ".stl": StlSurfaces,
}
"""What writes files of each suffix: another format is a class more."""

_TOLD = 0.05  # s between two reports


class Exported(NamedTuple):
    """How many frames were `written`.

    `unsettled` frames came before there were settings to work them out with, and of `shapeless`
    ones the readings decide no surface: neither are written. `whole` is whether the recording was
    ended as it should be.
    """

    written: int
    unsettled: int
    shapeless: int
    whole: bool

    @property
    def words(self) -> str:
        """What was written, and what was not."""
        told = [f"{self.written:,} frame{'s' * (self.written != 1)}"]
        if self.unsettled:
            told.append(f"{self.unsettled:,} that came before there were settings are left out")
        if self.shapeless:
            told.append(f"{self.shapeless:,} whose readings decide no shape are left out")
        if not self.whole:
            told.append("the recording broke off, and this is up to there")
        return "; ".join(told)


def exported(wanted: Wanted, room: Path) -> Generator[float | Exported]:
    """Write all that is `wanted` into the folder `room`.

    Now and then the share that is done, and what came of it at the end.
    """
    try:
        with Recording(wanted.recording) as recording:
            yield from _exported(recording, wanted, room)
    except OSError as error:
        raise Refusal(
            f"{wanted.to}: cannot be written ({error.strerror or error}); choose another place"
        ) from error
    except GeneratorExit:  # nobody waits for it any more
        shutil.rmtree(room, ignore_errors=True)
        raise


def _exported(recording: Recording, wanted: Wanted, room: Path) -> Generator[float | Exported]:
    told = about(recording, wanted)
    with closing(FORMATS[wanted.format](room, wanted, told)) as writer:
        work, next_report = _Work(recording, wanted, told, writer), 0.0
        for message in recording.messages():
            if not work.take(message):
                break
            if time.monotonic() >= next_report:
                next_report = time.monotonic() + _TOLD
                yield work.share(message)
        work.check()
        writer.finish()
    yield work.done()


class _Work:
    """Takes the messages as they were written, until all that is wanted is."""

    def __init__(self, recording: Recording, wanted: Wanted, about: About, writer: Writer) -> None:
        self._recording, self._wanted, self._writer = recording, wanted, writer
        self._retrace = Retrace(recording, wanted.setup)
        self._device, self._sensor = sensor_to_json(about.sensor), about.sensor
        self._due = wanted.first  # s since the recording began
        self._last = math.nan  # s, when the last frame that was looked at came
        self._written = self._unsettled = self._shapeless = 0

    def _at(self, message: Message) -> float:
        return (message.stamp - self._recording.first) * 1e-9

    def take(self, message: Message) -> bool:
        """Take one message; whether the next one is wanted too."""
        for frame in self._retrace(message):
            self._last = at = self._at(message)
            if at > self._wanted.end:
                return False
            if at >= self._due:
                self._write(at, frame)
            if self._written and self._wanted.at is not None:
                return False
        return True

    def _write(self, at: float, frame: Frame) -> None:
        self._check_device(at, self._retrace.sensor)
        estimate, pipeline = self._retrace.newest(), self._retrace.pipeline
        if estimate is None or pipeline is None:
            self._unsettled += 1
        elif self._writer.take(Moment(at, frame, estimate, pipeline)):
            self._written += 1
            first, every = self._wanted.first, self._wanted.every
            if every:
                self._due = first + every * (math.floor((at - first) / every) + 1)
        else:
            self._shapeless += 1

    def _check_device(self, at: float, sensor: Sensor | None) -> None:
        """Refuse a frame of another device than the file is of."""
        if sensor is self._sensor or sensor is None:
            return
        if sensor_to_json(sensor) != self._device:
            raise Refusal(f"{self._recording.path}: {another(at)}")
        self._sensor = sensor

    def check(self) -> None:
        """Refuse to end with nothing."""
        if self._written:
            return
        span = f"from {self._wanted.first:g} s on"
        if math.isfinite(self._wanted.end):
            span = f"from {self._wanted.first:g} s until {self._wanted.end:g} s"
        if self._unsettled:
            why = f"those {span} came before there were settings to work them out with"
        elif self._shapeless:
            why = f"the readings {span} decide no shape"
        elif math.isnan(self._last):
            why = "got none that can be used"
        else:
            which = "next" if self._last > self._wanted.end else "last"
            why = f"got none {span}; the {which} one came at {self._last:.6g} s"
        raise Refusal(f"{self._recording.path}: expected frames, {why}; choose another span")

    def share(self, message: Message) -> float:
        """What of the time that is wanted has passed with a message."""
        end = self._wanted.end if self._wanted.at is None else self._wanted.at
        until = min(end, (self._recording.last - self._recording.first) * 1e-9)
        return min(max(self._at(message) / until, 0.0), 1.0) if until > 0 else 0.0

    def done(self) -> Exported:
        whole = self._recording.whole
        return Exported(self._written, self._unsettled, self._shapeless, whole)
