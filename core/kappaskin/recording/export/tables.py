"""Exported tables, a row for each frame: CSV, HDF5 and NPZ."""

import importlib
import io
import json
import shutil
import zipfile
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import IO, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import lacking
from kappaskin.frames import COMPONENTS, Array, Estimate
from kappaskin.recording.export.request import ExportedFrame, ExportRequest, RecordingInfo


class Column(NamedTuple):
    """A number, or an array of some `shape`, of each frame; `labels` name those in it, flattened.

    Of a `unit`, which is empty for a plain number, and of the NumPy type `kind`.
    """

    name: str
    unit: str
    kind: str
    shape: tuple[int, ...]
    labels: tuple[str, ...]
    said: str
    of: Callable[[ExportedFrame], Any]

    def heads(self) -> list[str]:
        """What its numbers are called one by one, with their unit."""
        unit = f" [{self.unit}]" if self.unit else ""
        return [f"{self.name}{label}{unit}" for label in self.labels or ("",)]

    def row(self, moment: ExportedFrame) -> "NDArray[Any]":
        return np.asarray(self.of(moment), self.kind).reshape(self.shape)


def _number(
    name: str, unit: str, said: str, of: Callable[[ExportedFrame], Any], kind: str = "<f8"
) -> Column:
    return Column(name, unit, kind, (), (), said, of)


def _flag(name: str, said: str, of: Callable[[Estimate], bool]) -> Column:
    return _number(name, "", said, lambda moment: of(moment.estimate), "?")


def _several(
    name: str, unit: str, said: str, labels: Iterable[str], of: Callable[[Estimate], Array]
) -> Column:
    told = tuple(f"_{label}" for label in labels)

    def value(moment: ExportedFrame) -> Array:
        return of(moment.estimate)

    return Column(name, unit, "<f8", (len(told),), told, said, value)


def _matrix(
    name: str, unit: str, said: str, labels: tuple[str, str], of: Callable[[Estimate], Array]
) -> Column:
    """Of rows and columns that are labelled by characters."""
    value = _several(name, unit, said, (), of).of
    return Column(name, unit, "<f8", (len(labels[0]), len(labels[1])), _pairs(*labels), said, value)


def _pairs(rows: Iterable[str], across: Iterable[str]) -> tuple[str, ...]:
    columns = tuple(across)
    return tuple(f"_{row}_{column}" for row in rows for column in columns)


def _covariance(moment: ExportedFrame) -> Array:
    return moment.estimate.geometry.covariance


_ONE, _OF_SKIN = "Student's t, half width of the 95 % interval", "of the skin at the contact"

_WHEN = (
    _number("time", "s", "when it came, since the recording began", lambda m: m.at),
    _number("sequence", "", "number of the frame", lambda m: m.frame.sequence, "<i8"),
    _number("setup", "", "number of the settings", lambda m: m.estimate.generation, "<i8"),
    _number("device_time", "s", "on the device's clock", lambda m: m.frame.device_time),
    _number("host_time", "s", "when it came, monotonic clock", lambda m: m.frame.host_time),
    _number("taken", "s", "when it was taken, monotonic clock", lambda m: m.frame.taken),
    _number("taken_sd", "s", "standard deviation of taken", lambda m: m.frame.taken_sd),
)
_CONTACT = (
    _number("noise", "1/m", "standard deviation of a reading", lambda m: m.estimate.noise),
    _flag("converged", "whether the fit did", lambda e: e.converged),
    _flag("present", "whether there is a contact", lambda e: e.touch.present),
    _flag("single", "whether one point load explains the readings", lambda e: e.touch.single),
    _flag("near_rim", "whether it is too near a held edge", lambda e: e.touch.near_rim),
    _number("spare", "", "readings more than needed", lambda m: m.estimate.touch.spare, kind="<i8"),
    _several("position", "m", "of the contact", "xy", lambda e: e.touch.position),
    _several("position_sd", "m", "standard deviation", "xy", lambda e: e.touch.position_sd),
    _several("position_95", "m", _ONE, "xy", lambda e: e.touch.position_95),
    _number("force", "N", "of the contact", lambda m: m.estimate.touch.force),
    _number("force_sd", "N", "standard deviation", lambda m: m.estimate.touch.force_sd),
    _number("force_95", "N", _ONE, lambda m: m.estimate.touch.force_95),
    _number("displacement", "m", _OF_SKIN, lambda m: m.estimate.touch.displacement),
    _number(
        "displacement_sd", "m", "standard deviation", lambda m: m.estimate.touch.displacement_sd
    ),
)
_GEOMETRY = (
    _several("point", "m", "the contact in space", "xyz", lambda e: e.geometry.position),
    _matrix(
        "frame",
        "",
        "unit vectors, row by row: along x (t), across it (s), outward normal (n)",
        ("tsn", "xyz"),
        lambda e: e.geometry.frame,
    ),
    _matrix(
        "metric",
        "",
        "what a step along x, y is along the frame",
        ("ts", "xy"),
        lambda e: e.geometry.metric,
    ),
    _matrix(
        "curvature_form",
        "1/m",
        f"{_OF_SKIN}, along the frame",
        ("ts", "ts"),
        lambda e: e.geometry.curvature_form,
    ),
    _several("torsion_form", "1/m", _OF_SKIN, "ts", lambda e: e.geometry.torsion_form),
    Column(
        "covariance",
        "1/m^2",
        "<f8",
        (3, 3),
        _pairs(COMPONENTS, COMPONENTS),
        "of xx, yy, xy of the curvature form",
        _covariance,
    ),
    _several("principal", "1/m", "principal curvatures", "12", lambda e: e.geometry.principal),
    _several("principal_sd", "1/m", "standard deviation", "12", lambda e: e.geometry.principal_sd),
    _number(
        "angle",
        "rad",
        "from x to the first principal curvature",
        lambda m: m.estimate.geometry.angle,
    ),
)


def columns(about: RecordingInfo) -> tuple[Column, ...]:
    """All of them, for P elements and Ni x Nj functions."""
    P, N = len(about.sensor.layout), about.functions
    elements = _pairs(COMPONENTS, map(str, range(P)))
    functions = _pairs(map(str, range(N[0])), map(str, range(N[1])))

    def readings(
        name: str, unit: str, said: str, of: Callable[[ExportedFrame], Any], kind: str
    ) -> Column:
        return Column(name, unit, kind, (3, P), elements, said, of)

    def coefficients(moment: ExportedFrame) -> Array:
        found = np.full(N, np.nan)
        Ni, Nj = moment.estimate.coefficients.shape
        found[:Ni, :Nj] = moment.estimate.coefficients
        return found

    def suspect(moment: ExportedFrame) -> "NDArray[np.uint8]":
        return moment.estimate.suspect

    def counts(moment: ExportedFrame) -> Array:
        found = np.full(3 * P, np.nan)
        found[moment.frame.channels] = moment.frame.counts
        return found

    reading, shape = "NaN where missing", "of the functions; NaN where the settings have fewer"
    return (
        *_WHEN,
        readings("counts", "", "NaN where not scanned", counts, "<f8"),
        readings("nominal", "1/m", f"Eq. 8; {reading}", lambda m: m.estimate.nominal, "<f8"),
        readings("curvature", "1/m", reading, lambda m: m.estimate.curvature, "<f8"),
        readings("fresh", "", "whether the frame brought it", lambda m: m.estimate.fresh, "?"),
        readings("residual", "1/m", "reading less fit", lambda m: m.estimate.residual, "<f8"),
        Column(
            "suspect",
            "",
            "|u1",
            (P,),
            tuple(f"_{n}" for n in range(P)),
            "why an element is left out, 0 if it is not",
            suspect,
        ),
        Column("coefficients", "m", "<f8", N, functions, shape, coefficients),
        *_CONTACT,
        *_GEOMETRY,
    )


Block = dict[str, NDArray[Any]]

_BLOCK = 2**22  # bytes of rows that are written at once, about


class TableWriter(ABC):
    """A table, of which a kind of file need only say how some rows (n, ...) are written."""

    def __init__(self, room: Path, wanted: ExportRequest, about: RecordingInfo) -> None:
        self.path, self.about, self.columns = room / wanted.to.name, about, columns(about)
        sizes = (np.dtype(c.kind).itemsize * int(np.prod(c.shape)) for c in self.columns)
        self.rows_at_once = max(_BLOCK // sum(sizes), 1)
        self._rows: list[list[NDArray[Any]]] = []
        self.begin(room)

    @abstractmethod
    def begin(self, room: Path) -> None: ...

    @abstractmethod
    def write(self, block: Block) -> None: ...

    def take(self, moment: ExportedFrame) -> bool:
        self._rows.append([column.row(moment) for column in self.columns])
        if len(self._rows) == self.rows_at_once:
            self._flush()
        return True

    def _flush(self) -> None:
        if self._rows:
            by_column = zip(self.columns, zip(*self._rows, strict=True), strict=True)
            self.write({column.name: np.stack(rows) for column, rows in by_column})
            self._rows.clear()

    def finish(self) -> None:
        self._flush()
        self.end()

    @abstractmethod
    def end(self) -> None: ...

    @abstractmethod
    def close(self) -> None: ...


class CsvTable(TableWriter):
    """Numbers as short as they come back bit for bit; 0 or 1 for what is so or not."""

    def begin(self, room: Path) -> None:
        self._file = self.path.open("w", encoding="utf-8", newline="\n")
        said = self.about.said | {"columns": {c.name: c.said for c in self.columns}}
        for name, value in said.items():
            self._file.write(f"# {name}: {json.dumps(value)}\n")
        heads = [head for column in self.columns for head in column.heads()]
        self._file.write(",".join(heads) + "\n")

    def write(self, block: Block) -> None:
        flat = [values.reshape(len(values), -1) for values in block.values()]
        told = [cast("list[list[float]]", (v + 0 if v.dtype == bool else v).tolist()) for v in flat]
        for n in range(len(flat[0])):
            row: list[float] = []
            for part in told:
                row += part[n]
            # A list's own text, in a third of the time that joining the numbers' takes.
            self._file.write(repr(row)[1:-1].replace(" ", "") + "\n")

    def end(self) -> None:
        self._file.flush()

    def close(self) -> None:
        self._file.close()


class _File(io.FileIO):
    """A new file that takes what there is no room for, or HDF5 would crash; `check` tells."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "x+")
        self._trouble: OSError | None = None

    def write(self, data: Any) -> int:
        left = memoryview(data).cast("B")
        try:
            while left and self._trouble is None:
                left = left[super().write(left) :]
        except OSError as error:
            self._trouble = error
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size)
        except OSError as error:
            self._trouble = error
            return size or 0

    def check(self) -> None:
        if self._trouble is not None:
            raise self._trouble


class Hdf5Table(TableWriter):
    """Data sets that grow with the rows."""

    def begin(self, room: Path) -> None:
        try:
            h5py: Any = importlib.import_module("h5py")
        except ImportError as error:
            raise lacking("hdf5", "a .h5 file, unlike an .npz,", error) from error
        self._disk = _File(self.path)
        # Attributes of older versions end at 64 KiB.
        self._file: Any = h5py.File(self._disk, "w", libver=("v108", "v108"))
        for name, value in self.about.said.items():
            self._file.attrs[name] = value if isinstance(value, str) else json.dumps(value)
        for column in self.columns:
            made = self._file.create_dataset(
                column.name,
                (0, *column.shape),
                column.kind,
                maxshape=(None, *column.shape),
                chunks=(self.rows_at_once, *column.shape),
            )
            made.attrs["unit"], made.attrs["description"] = column.unit, column.said

    def write(self, block: Block) -> None:
        for name, values in block.items():
            kept = self._file[name]
            kept.resize(len(kept) + len(values), axis=0)
            kept[-len(values) :] = values
        self._disk.check()

    def end(self) -> None:
        self._file.close()
        self._disk.check()

    def close(self) -> None:
        self._file.close()
        self._disk.close()


class NpzTable(TableWriter):
    """Columns wait in files of their own, since one archive takes one array after the other."""

    def begin(self, room: Path) -> None:
        self._length = 0
        self._waiting: dict[str, IO[bytes]] = {}
        self._folder = room / "columns"
        self._folder.mkdir()
        for column in self.columns:
            self._waiting[column.name] = (self._folder / column.name).open("w+b")

    def write(self, block: Block) -> None:
        for name, values in block.items():
            self._waiting[name].write(values.tobytes())
            self._length += len(values) if name == self.columns[0].name else 0

    def end(self) -> None:
        with zipfile.ZipFile(self.path, "w") as archive:
            for column in self.columns:
                head = {
                    "descr": column.kind,
                    "fortran_order": False,
                    "shape": (self._length, *column.shape),
                }
                waiting = self._waiting[column.name]
                waiting.seek(0)
                with archive.open(f"{column.name}.npy", "w", force_zip64=True) as member:
                    np.lib.format.write_array_header_1_0(member, head)
                    shutil.copyfileobj(waiting, member, 2**20)
                waiting.truncate(0)
            with archive.open("about.npy", "w") as member:
                told = {column.name: [column.unit, column.said] for column in self.columns}
                np.lib.format.write_array(member, np.array(self.about.json(columns=told)))

    def close(self) -> None:
        for file in self._waiting.values():
            file.close()
        shutil.rmtree(self._folder, ignore_errors=True)
