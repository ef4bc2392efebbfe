"""Export of a recording in a background process."""

import math
import shutil
import time
from collections.abc import Callable, Generator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple, TypeVar

from kappaskin.errors import Refusal
from kappaskin.estimation import slope_warning
from kappaskin.frames import Frame
from kappaskin.recording.disk import ScratchTask
from kappaskin.recording.export.lerobot import LeRobotFolder
from kappaskin.recording.export.request import (
    ExportedFrame,
    ExportRequest,
    ExportWriter,
    RecordingInfo,
    another,
    recording_info,
)
from kappaskin.recording.export.rerun_stream import RrdFile
from kappaskin.recording.export.surfaces import GlbSurfaces, StlSurfaces, VtpSurfaces
from kappaskin.recording.export.tables import CsvTable, Hdf5Table, NpzTable, ParquetTable
from kappaskin.recording.reading import RecordedMessage, Recording
from kappaskin.recording.recompute import Recomputation
from kappaskin.sensing import Sensor
from kappaskin.sources import sensor_to_json

FORMATS: dict[str, type[ExportWriter]] = {
    ".parquet": ParquetTable,
    ".csv": CsvTable,
    ".npz": NpzTable,
    ".h5": Hdf5Table,
    ".vtp": VtpSurfaces,
    ".pvd": VtpSurfaces,
    ".stl": StlSurfaces,
    ".glb": GlbSurfaces,
    ".rrd": RrdFile,
    ".lerobot": LeRobotFolder,
}
"""Writers by suffix: a new format is one more class."""

_REPORT = 0.05  # s between two reports
_EARLY = 1e-6  # share of a period by which a frame may come early: times are rounded
_SAMPLE = 0.2  # s of a core for writing what a forecast is made from


class Exported(NamedTuple):
    """How many frames were `written`.

    `unsettled` frames were recorded before the first settings, and of `shapeless` ones the readings
    determine no surface: neither are written. `whole` is whether the recording was ended properly,
    `slope` the largest that was neglected though it matters (`Fit.neglected_slope`).
    """

    written: int
    unsettled: int
    shapeless: int
    whole: bool
    slope: float

    @property
    def words(self) -> str:
        """Counts of frames written and left out, as text."""
        parts = [f"{self.written:,} frame{'s' * (self.written != 1)}"]
        if self.unsettled:
            parts.append(f"{self.unsettled:,} omitted: recorded before the first settings")
        if self.shapeless:
            parts.append(f"{self.shapeless:,} omitted: readings determine no shape")
        if not self.whole:
            parts.append("the recording is incomplete; this is all up to its end")
        if self.slope:
            parts.append(slope_warning(self.slope))
        return "; ".join(parts)


class Forecast(NamedTuple):
    """How many `frames` an export will have, its `size` in bytes and `seconds` it takes, about."""

    frames: int
    size: int
    seconds: float


_Result = TypeVar("_Result")


def export_steps(request: ExportRequest, scratch: Path) -> Generator[float | Exported]:
    """Write all requested files into the folder `scratch`.

    Now and then the share that is done, and what came of it at the end.
    """
    return _steps(request, scratch, math.inf, _ExportWork.done)


def forecast_steps(request: ExportRequest, scratch: Path) -> Generator[float | Forecast]:
    """The forecast of an export, from what is written of it in a moment into `scratch`."""
    return _steps(request, scratch, _SAMPLE, lambda work: work.forecast(scratch))


def _steps(
    request: ExportRequest,
    scratch: Path,
    seconds: float,
    result: "Callable[[_ExportWork], _Result]",
) -> Generator[float | _Result]:
    """Write for so many `seconds` of the processor: shares, and the `result`."""
    try:
        with Recording(request.recording, request.finger) as recording:
            info = recording_info(recording, request)
            with closing(FORMATS[request.format](scratch, request, info)) as writer:
                work, next_report = _ExportWork(recording, request, info, writer), 0.0
                for message in recording.messages():
                    if not work.take(message) or time.process_time() - work.since > seconds:
                        break
                    if time.monotonic() >= next_report:
                        next_report = time.monotonic() + _REPORT
                        yield work.share(message)
                work.check()
                writer.finish()
            yield result(work)
    except OSError as error:
        raise Refusal(
            f"{request.to}: cannot be written ({error.strerror or error}); choose another place"
        ) from error
    except GeneratorExit:  # nobody waits for it any more
        shutil.rmtree(scratch, ignore_errors=True)
        raise


class _ExportWork:
    """Takes the messages in order, until all requested files are written."""

    def __init__(
        self,
        recording: Recording,
        request: ExportRequest,
        info: RecordingInfo,
        writer: ExportWriter,
    ) -> None:
        self._recording, self._request, self._writer = recording, request, writer
        self._recomputation = Recomputation(recording, request.setup)
        self._device, self._sensor = sensor_to_json(info.sensor), info.sensor
        self._head = len(info.json())  # bytes that a file has once, about
        self._due = request.first  # s since the recording began
        self._last = math.nan  # s, when the last frame that was looked at came
        self._written = self._unsettled = self._shapeless = 0
        self._slope = 0.0
        self.since = math.inf
        """The processor's time when the first frame was written."""
        self._begun = self._wrote = time.monotonic()
        self._first = 0.0  # s since the recording began, when the first frame came

    def take(self, message: RecordedMessage) -> bool:
        """Take one message; whether the next one is needed too."""
        for frame in self._recomputation(message):
            self._last = at = self._recording.seconds(message.stamp)
            if at > self._request.end:
                return False
            if at >= self._due:
                self._write(at, frame)
            if self._written and self._request.at is not None:
                return False
        return True

    def _write(self, at: float, frame: Frame) -> None:
        self._check_device(at, self._recomputation.sensor)
        estimate, pipeline = self._recomputation.newest(), self._recomputation.pipeline
        if estimate is None or pipeline is None:
            self._unsettled += 1
        elif self._writer.take(ExportedFrame(at, frame, estimate, pipeline)):
            if not self._written:
                self.since, self._first = time.process_time(), at
                self._wrote = time.monotonic()
            self._written += 1
            if pipeline.fitted is not None:
                self._slope = max(self._slope, pipeline.fitted.neglected_slope)
            first, every = self._request.first, self._request.thinned
            if every:
                passed = math.floor((at - first) / every + _EARLY)
                self._due = first + every * (passed + 1 - _EARLY)
        else:
            self._shapeless += 1

    def _check_device(self, at: float, sensor: Sensor | None) -> None:
        """Refuse a frame of another device."""
        if sensor is self._sensor or sensor is None:
            return
        if sensor_to_json(sensor) != self._device:
            raise Refusal(f"{self._recording.path}: {another(at)}")
        self._sensor = sensor

    def check(self) -> None:
        """Raise a `Refusal` if nothing was written."""
        if self._written:
            return
        span = f"from {self._request.first:g} s on"
        if math.isfinite(self._request.end):
            span = f"from {self._request.first:g} s until {self._request.end:g} s"
        if self._unsettled:
            why = f"those {span} were recorded before the first settings"
        elif self._shapeless:
            why = f"the readings {span} determine no shape"
        elif math.isnan(self._last):
            why = "got no usable frames"
        else:
            which = "next" if self._last > self._request.end else "last"
            why = f"got none {span}; the {which} one came at {self._last:.6g} s"
        raise Refusal(f"{self._recording.path}: expected frames, {why}; choose another span")

    def share(self, message: RecordedMessage) -> float:
        """The share of the requested time that has passed with a message."""
        at = self._recording.seconds(message.stamp)
        end = self._request.end if self._request.at is None else self._request.at
        until = min(end, self._recording.seconds(self._recording.last))
        return min(max(at / until, 0.0), 1.0) if until > 0 else 0.0

    def forecast(self, scratch: Path) -> Forecast:
        """The forecast from what was written into `scratch`."""
        request, recording = self._request, self._recording
        span = min(request.end, recording.seconds(recording.last)) - self._first
        covered = self._last - self._first
        share = span / covered if request.at is None and covered > 0 else 1.0
        series = request.thinned and covered > 0
        frames = 1 + span // request.thinned if series else self._written * share
        size = sum(file.stat().st_size for file in scratch.rglob("*") if file.is_file())
        seconds = self._wrote - self._begun + share * (time.monotonic() - self._wrote)
        whole = self._head + max(size - self._head, 0) * frames / self._written
        return Forecast(round(frames), round(whole), seconds)

    def done(self) -> Exported:
        whole = self._recording.whole
        return Exported(self._written, self._unsettled, self._shapeless, whole, self._slope)


class ExportTask(ScratchTask[Exported]):
    """Writes the requested files; refused where there is no place."""

    def __init__(self, request: ExportRequest) -> None:
        self.request = request
        super().__init__(
            "kappaskin-export", request.to, request.files, Exported, export_steps, request
        )


class ForecastTask(ScratchTask[Forecast]):
    """Writes a part of the requested files, and removes it again."""

    def __init__(self, request: ExportRequest) -> None:
        super().__init__("kappaskin-forecast", request.to, (), Forecast, forecast_steps, request)
