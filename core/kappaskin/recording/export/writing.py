"""Export of a recording: frames recomputed and written, by a process of its own."""

import math
import shutil
import tempfile
import time
from collections.abc import Generator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from kappaskin._background import Beside
from kappaskin.errors import Refusal
from kappaskin.frames import Frame
from kappaskin.recording.export.request import (
    ExportedFrame,
    ExportRequest,
    ExportWriter,
    RecordingInfo,
    another,
    recording_info,
)
from kappaskin.recording.export.surfaces import StlSurfaces, VtpSurfaces
from kappaskin.recording.export.tables import CsvTable, Hdf5Table, NpzTable
from kappaskin.recording.reading import RecordedMessage, Recording
from kappaskin.recording.recompute import Recomputation
from kappaskin.sensing import Sensor
from kappaskin.sources import to_json

FORMATS: dict[str, type[ExportWriter]] = {
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


def export_steps(wanted: ExportRequest, room: Path) -> Generator[float | Exported]:
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


def _exported(
    recording: Recording, wanted: ExportRequest, room: Path
) -> Generator[float | Exported]:
    told = recording_info(recording, wanted)
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

    def __init__(
        self,
        recording: Recording,
        wanted: ExportRequest,
        about: RecordingInfo,
        writer: ExportWriter,
    ) -> None:
        self._recording, self._wanted, self._writer = recording, wanted, writer
        self._retrace = Recomputation(recording, wanted.setup)
        self._device, self._sensor = to_json(about.sensor), about.sensor
        self._due = wanted.first  # s since the recording began
        self._last = math.nan  # s, when the last frame that was looked at came
        self._written = self._unsettled = self._shapeless = 0

    def _at(self, message: RecordedMessage) -> float:
        return (message.stamp - self._recording.first) * 1e-9

    def take(self, message: RecordedMessage) -> bool:
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
        elif self._writer.take(ExportedFrame(at, frame, estimate, pipeline)):
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
        if to_json(sensor) != self._device:
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

    def share(self, message: RecordedMessage) -> float:
        """What of the time that is wanted has passed with a message."""
        end = self._wanted.end if self._wanted.at is None else self._wanted.at
        until = min(end, (self._recording.last - self._recording.first) * 1e-9)
        return min(max(self._at(message) / until, 0.0), 1.0) if until > 0 else 0.0

    def done(self) -> Exported:
        whole = self._recording.whole
        return Exported(self._written, self._unsettled, self._shapeless, whole)


class ExportTask:
    """Writes what is `wanted`, beside its place until it is whole; no call but `wait` waits.

    Refused where there is no place. It ends when it is done, when `close` is called, which leaves
    nothing of what is not whole, or when the process that started it is gone.
    """

    def __init__(self, wanted: ExportRequest) -> None:
        self.wanted = wanted
        try:
            room = tempfile.mkdtemp(prefix=f".{wanted.to.name}.", dir=wanted.to.parent)
        except OSError as error:
            raise _unwritable(wanted.to, error) from error
        self._room = Path(room)
        try:
            self._beside = Beside[float | Exported](
                "kappaskin-export", export_steps, wanted, self._room
            )
        except BaseException:  # Ctrl+C, while it begins
            shutil.rmtree(self._room, ignore_errors=True)
            raise

    @property
    def done(self) -> bool:
        return self._beside.done

    def poll(self) -> list[float | Exported]:
        """The shares that are done since the last call, and in the end what came of it.

        A `Refusal` where that is nothing.
        """
        over, told = self.done, self._beside.poll()
        if self.done and not over:
            self._give()
        return told

    def wait(self) -> Generator[float | Exported]:
        """Each share as soon as it is done, and in the end what came of it."""
        for told in self._beside.wait():
            if isinstance(told, Exported):
                self._give()
            yield told

    @property
    def files(self) -> tuple[Path, ...]:
        """What is there when it is done: files, and the folder of a series."""
        return self.wanted.files

    def _give(self) -> None:
        """Give what is whole its place; nothing, where one is taken."""
        given: list[tuple[Path, Path]] = []
        try:
            for place in self.files:
                if place.exists():
                    raise FileExistsError(17, "it has appeared meanwhile")
                made = self._room / place.name
                made.rename(place)
                given.append((place, made))
        except OSError as error:
            for place, made in given:
                place.rename(made)
            raise _unwritable(self.wanted.to, error) from error

    def close(self) -> None:
        """End it, done or not."""
        self._beside.close()
        shutil.rmtree(self._room, ignore_errors=True)

    def __enter__(self) -> "ExportTask":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _unwritable(path: Path, error: OSError) -> Refusal:
    return Refusal(f"{path}: cannot be written ({error.strerror or error}); choose another place")
