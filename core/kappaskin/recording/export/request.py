"""Export requests, and the facts that exported files state of their recording."""

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from kappaskin.calibration import Calibration, Tare
from kappaskin.errors import Refusal
from kappaskin.frames import Estimate, Frame
from kappaskin.pipeline import REVISION, Pipeline, Reported, Setup, setup_from_text
from kappaskin.recording.disk import is_there
from kappaskin.recording.reading import Recording
from kappaskin.recording.writing import PROGRAM
from kappaskin.sensing import Sensor, SensorLayout
from kappaskin.sources import sensor_from_json

TABLES = (".parquet", ".csv", ".npz", ".h5")
"""Suffixes of files with a row for each frame."""

SURFACES = (".vtp", ".stl", ".pvd", ".glb")
"""Suffixes of files of the skin's surface."""

VIEWS = (".rrd",)
"""Suffixes of files of all that a viewer shows over time."""

DATA_SETS = (".lerobot",)
"""Suffixes of folders with a row at regular times."""


class ExportPreset(NamedTuple):
    """The `columns` of a table, by their names; without any all of them.

    A selection has its numbers, but for times, in single precision: 7 digits.
    """

    title: str
    columns: tuple[str, ...] = ()


PRESETS = {
    "contact": ExportPreset(
        "Contact and force",
        (
            *("time", "present", "single", "near_rim", "position", "position_sd"),
            *("force", "force_sd", "displacement", "displacement_sd"),
        ),
    ),
    "readings": ExportPreset(
        "Readings", ("time", "sequence", "device_time", "counts", "curvature", "reading")
    ),
    "everything": ExportPreset("Everything"),
}
"""What a table may have of each frame; the first is the default."""


@dataclass(frozen=True)
class ExportRequest:
    """The file `to` of a `recording`, in the format that its suffix names.

    Times are in s since the recording began: from `begin` until `end`, one frame each `every` s, or
    all where that is 0; or the first frame from `at` on alone. Rows of a data set are `every` s
    apart, or at the frames' median rate. Frames are worked out with the settings that were
    recorded, or with `setup`. A table has the columns of the `preset`, one of `PRESETS`. It is of
    one `finger` of a hand. A `Refusal` where that makes no file.
    """

    recording: Path
    to: Path
    begin: float = 0.0
    end: float = math.inf
    every: float = 0.0
    at: float | None = None
    setup: Setup | None = None
    preset: str = "contact"
    finger: str | None = None

    def __post_init__(self) -> None:
        if self.preset not in PRESETS:
            raise Refusal(f"expected a preset, one of {', '.join(PRESETS)}; got {self.preset!r}")
        self._check_times()
        self._check_format()
        self._check_place()

    @property
    def format(self) -> str:
        return self.to.suffix.lower()

    @property
    def folder(self) -> Path | None:
        """Where the files of a series are; None for one file."""
        series = self.format == ".pvd" or (self.format == ".stl" and self.at is None)
        return self.to.with_suffix("") if series else None

    @property
    def metadata_file(self) -> Path | None:
        """The JSON file for an STL file, with what STL cannot hold."""
        return self.to.with_suffix(".json") if self.format == ".stl" else None

    @property
    def thinned(self) -> float:
        """Least time in s between two frames for the file; a data set picks from all."""
        return 0.0 if self.format in DATA_SETS else self.every

    @property
    def files(self) -> tuple[Path, ...]:
        """All outputs: files, and the folder of a series."""
        alone = self.format == ".stl" and self.folder is not None
        places = (None if alone else self.to, self.folder, self.metadata_file)
        return tuple(place for place in places if place is not None)

    @property
    def first(self) -> float:
        """Start of the exported span in s since the beginning."""
        return self.begin if self.at is None else self.at

    def _check_times(self) -> None:
        at = self.first
        if not (math.isfinite(at) and self.end >= at >= 0 and 0 <= self.every < math.inf):
            raise Refusal(
                f"expected times in s from 0 on, in order, got from {at:g} until {self.end:g}, "
                f"every {self.every:g}"
            )
        if self.at is not None and (self.begin, self.end, self.every) != (0.0, math.inf, 0.0):
            raise Refusal("expected one moment or a span of time, got both; omit one of them")

    def _check_format(self) -> None:
        known = TABLES + SURFACES + VIEWS + DATA_SETS
        if self.format not in known:
            raise Refusal(f"{self.to}: expected a file that ends in one of {', '.join(known)}")
        rate = 1 / (self.every or 1)
        whole = 0.5 < rate < 1e5 and abs(rate / round(rate) - 1) < 1e-6
        if self.format in DATA_SETS and not whole:
            raise Refusal(
                f"a {self.format} has a whole number of rows a second, below 100,000; got one "
                f"every {self.every:g} s: give 1 s, or a part of it as 0.1 s or 0.05 s"
            )
        if self.format not in SURFACES and self.at is not None:
            raise Refusal(
                f"a {self.format} has a row for each frame: give a span of time instead of a moment"
            )
        if self.format == ".vtp" and self.at is None:
            raise Refusal(
                "a .vtp is the skin at one moment: give it (at, in s), or export a series to a "
                ".pvd, with the time between two surfaces (every, in s)"
            )
        if self.format == ".pvd" and not self.every:
            raise Refusal(
                "a .pvd is a series of surfaces: give the time between two surfaces (every, in s)"
            )
        if self.format == ".stl" and self.at is None and not self.every:
            raise Refusal(
                "an .stl is the skin at one moment, or a series: give the moment (at, in s), or "
                "the time between two surfaces (every, in s)"
            )

    def _check_place(self) -> None:
        for place in self.files:
            if is_there(place):
                raise Refusal(f"{place}: already exists; choose another name")


@dataclass(frozen=True)
class RecordingInfo:
    """Subject of the frames: a `sensor`, and at most so many `functions` along x and y.

    `facts` has all of it as JSON values.
    """

    facts: dict[str, Any]
    sensor: Sensor
    functions: tuple[int, int]

    @property
    def program(self) -> str:
        return self.facts["program"]

    def json(self, **more: object) -> str:
        """All of it, and `more`, as JSON."""
        return json.dumps(self.facts | more)


class _StampedText(NamedTuple):
    """The `number`th text on its topic, `at` s after the beginning."""

    number: int
    at: float
    text: str


_PER_COLUMN = 400  # bytes of its heading and texts


def recording_info(recording: Recording, request: ExportRequest) -> RecordingInfo:
    """Facts for files of the requested span; a `Refusal` where there were two devices."""
    path = recording.path
    devices = list(_in_force(recording.devices(), request))
    if not devices:
        raise Refusal(f"{path}: expected a device from {request.first:g} s on, got none")
    for device in devices[1:]:
        if device.text != devices[0].text:
            raise Refusal(f"{path}: {another(device.at)}")
    sensor = sensor_from_json(devices[0].text)
    setups = [_setup_facts(request.setup, sensor)] if request.setup else []
    if request.setup is None:
        for each in _in_force(recording.setups(), request):
            setup = setup_from_text(each.text, recording.attachment)
            number = {"number": each.number, "since": max(each.at, 0.0)}
            setups.append(number | _setup_facts(setup, sensor))
    if not setups:
        until, remedy = "", "record for longer: the first result takes a few seconds"
        if math.isfinite(request.end):
            until, remedy = f" until {request.end:g} s", "export a later span"
        raise Refusal(
            f"{path}: was recorded without settings{until}, so no frame was computed; {remedy}"
        )
    Ni, Nj = (max(setup[name] for setup in setups) for name in ("Ni", "Nj"))
    recording.budget.take(_PER_COLUMN * Ni * Nj, f"a table of {Ni} x {Nj} coefficients")
    return RecordingInfo(_facts(recording, devices[0].text, sensor, setups), sensor, (Ni, Nj))


def another(at: float) -> str:
    """The error for a second device, `at` s after the beginning."""
    before, after = math.ceil(1e3 * at - 1) / 1e3, math.floor(1e3 * at + 1) / 1e3
    return (
        f"another device, or another skin, came at {at:.6g} s; a file holds one only: export the "
        f"time until {before:.3f} s (--until), or from {after:.3f} s on (--from)"
    )


def _in_force(texts: Iterable[tuple[float, str]], request: ExportRequest) -> Iterator[_StampedText]:
    """The texts valid at some time of the span."""
    last = None
    for one in [_StampedText(number, at, text) for number, (at, text) in enumerate(texts)]:
        if one.at > request.end:
            break
        if last is not None and one.at > request.first:
            yield last
        last = one
    if last is not None:
        yield last


def _setup_facts(setup: Setup, sensor: Sensor) -> dict[str, Any]:
    facts = {field.name: getattr(setup, field.name) for field in fields(setup)}
    facts["Nj"] = 1 if sensor.layout.patch.strip else setup.Nj
    facts["edge"] = setup.edge or sensor.edge
    return facts | {"calibration": _dated(setup.calibration), "tare": _dated(setup.tare)}


def _dated(made: Calibration | Tare | None) -> dict[str, str] | None:
    if made is None:
        return None
    return {
        "name": made.name,
        "serial_number": made.serial_number,
        "date": made.date.isoformat(),
        "digest": made.digest,
    }


def _facts(
    recording: Recording, device: str, sensor: Sensor, setups: list[dict[str, Any]]
) -> dict[str, Any]:
    began = datetime.fromtimestamp(recording.first * 1e-9, UTC)
    finger = {"finger": recording.finger} if recording.finger else {}
    return finger | {
        "program": PROGRAM,
        "revision": REVISION,
        "recording": recording.path.name,
        "recorded_by": recording.library,
        "recorded_revision": recording.revision,
        "began": began.isoformat(timespec="milliseconds"),
        "ended_properly": recording.whole,
        "device": json.loads(device),
        "skin": sensor.layout.patch.name,
        "positions": sensor.layout.positions.tolist(),
        "settings": setups,
        "units": f"SI: m, s, N, 1/m; {_read(sensor.layout)}",
    }


def _read(layout: SensorLayout) -> str:
    """What elements read, in words."""
    if not layout.reads:
        return "curvature components xx, yy, xy"
    units = zip(layout.kind_names, layout.kind_units, strict=True)
    return "readings " + ", ".join(f"{name} in {unit}" for name, unit in units)


@dataclass(frozen=True, eq=False)
class ExportedFrame:
    """A `frame`, that came `at` s after the recording began, and what `pipeline` made of it."""

    at: float
    frame: Frame
    estimate: Estimate
    pipeline: Pipeline

    @cached_property
    def reported(self) -> Reported:
        """The estimate and its fit, for the table of quantities."""
        return Reported(self.estimate, self.pipeline.fitted)


class ExportWriter(Protocol):
    """Writes what is requested into the folder `scratch`; an `OSError` where the disk is full."""

    def __init__(self, scratch: Path, request: ExportRequest, info: RecordingInfo) -> None: ...

    def take(self, frame: ExportedFrame) -> bool:
        """Write one frame; whether it contained anything to write."""
        ...

    def finish(self) -> None:
        """Write buffered rows, and finish the file."""
        ...

    def close(self) -> None:
        """Close all files."""
        ...
