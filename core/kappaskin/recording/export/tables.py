"""Exported tables, a row for each frame: Parquet, CSV, HDF5 and NPZ."""

import importlib
import io
import json
import shutil
import zipfile
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from operator import attrgetter
from pathlib import Path
from typing import IO, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from kappaskin._text import json_cells
from kappaskin.errors import optional
from kappaskin.pipeline import REPORTED, Axes, Getter, axes_of
from kappaskin.recording.export.request import (
    PRESETS,
    ExportedFrame,
    ExportRequest,
    RecordingInfo,
)
from kappaskin.sensing import Sensor, SensorLayout


class Column(NamedTuple):
    """A number, or an array of some `shape`, of each frame; `labels` name those in it, flattened.

    Of a `unit`, which is empty for a plain number, and of the NumPy type `kind`; `text` says what
    it is, and `value` gets it. `axes` are what is along each dimension, and the names there.
    """

    name: str
    unit: str
    kind: str
    shape: tuple[int, ...]
    labels: tuple[str, ...]
    text: str
    value: Callable[[ExportedFrame], Any]
    units: tuple[str, ...] = ()
    axes: tuple[tuple[str, tuple[str, ...]], ...] = ()

    def heads(self) -> list[str]:
        """Names of its numbers, each with the unit: its own of `units`, or that of all."""
        labels = self.labels or ("",)
        each = zip(labels, self.units or [self.unit] * len(labels), strict=True)
        return [f"{self.name}{label}{f' [{unit}]' if unit else ''}" for label, unit in each]

    def row(self, exported: ExportedFrame) -> "NDArray[Any]":
        """The value of one frame; NaN where it has fewer numbers than the column."""
        found = np.asarray(self.value(exported), self.kind)
        if found.ndim == len(self.shape) and found.shape != self.shape:
            missing = np.subtract(self.shape, found.shape)
            found = np.pad(found, [(0, count) for count in missing], constant_values=np.nan)
        return found.reshape(self.shape)


def columns(info: RecordingInfo, names: tuple[str, ...]) -> tuple[Column, ...]:
    """Those of the `names`, or all; the frame's before those of its estimate."""
    found = _all_columns(info)
    single = [c._replace(kind="<f4") if c.kind == "<f8" and c.unit != "s" else c for c in found]
    return tuple(c for c in single if c.name in names) if names else found


def _all_columns(info: RecordingInfo) -> tuple[Column, ...]:
    """All of them, for P elements and Ni x Nj functions: of the frame, then of its estimate."""
    layout = info.sensor.layout
    lengths = axes_of(layout, info.functions, (0, 0))

    def counts(exported: ExportedFrame) -> "NDArray[np.float64]":
        found = np.full(layout.channels, np.nan)
        found[exported.frame.channels] = exported.frame.counts
        return found.reshape(layout.frame_shape)

    nominal = next(quantity for quantity in REPORTED if quantity.name == "nominal")
    groups = ("frame", "fit", "contact", "second")
    made = {group: _columns(group, lengths, info.sensor) for group in groups}
    return (
        Column(
            "time", "s", "<f8", (), (), "arrival time since the recording began", attrgetter("at")
        ),
        *made["frame"],
        Column(
            "counts",
            "",
            "<f8",
            layout.frame_shape,
            nominal.labels(lengths),
            "NaN where not scanned",
            counts,
            axes=tuple(nominal.named_axes(lengths)),
        ),
        *made["fit"],
        *made["contact"],
        *made["second"],
    )


def _columns(group: str, lengths: Axes, sensor: Sensor) -> list[Column]:
    """The columns of the quantities of one group; `curvature` only where that is what is read."""
    return [
        Column(
            f"{_name(quantity.name, sensor.layout)}{suffix}",
            quantity.unit_of(sensor),
            quantity.kind,
            quantity.shape(lengths),
            quantity.labels(lengths) if quantity.parts else (),
            text,
            _value(getter),
            quantity.units_of(sensor.layout),
            tuple(quantity.named_axes(lengths)),
        )
        for quantity in REPORTED
        for suffix, text, getter in quantity.forms
        if quantity.group == group and suffix in quantity.columns
    ]


def _name(name: str, layout: SensorLayout) -> str:
    return "reading" if layout.reads and name == "curvature" else name


def _value(getter: Getter) -> Callable[[ExportedFrame], Any]:
    return lambda exported: getter(exported.reported)


Block = dict[str, NDArray[Any]]


class TableWriter(ABC):
    """Writer of a table; a format defines how rows (n, ...) are written."""

    block = 2**22
    """Bytes of rows that are written at once, about."""

    names: tuple[str, ...] = ()
    """The columns, where they are not those of the preset."""

    def __init__(self, scratch: Path, request: ExportRequest, info: RecordingInfo) -> None:
        self.path, self.info, self.request = scratch / request.to.name, info, request
        self.columns = columns(info, self.names or PRESETS[request.preset].columns)
        sizes = (np.dtype(c.kind).itemsize * int(np.prod(c.shape)) for c in self.columns)
        self.rows_at_once = max(self.block // sum(sizes), 1)
        self._rows: list[list[NDArray[Any]]] = []
        self.begin(scratch)

    @abstractmethod
    def begin(self, scratch: Path) -> None: ...

    @abstractmethod
    def write(self, block: Block) -> None: ...

    def take(self, frame: ExportedFrame) -> bool:
        self._rows.append([column.row(frame) for column in self.columns])
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
    """Numbers as the shortest text that reads back bit for bit; 0 or 1 for booleans."""

    def begin(self, scratch: Path) -> None:
        self._file = self.path.open("w", encoding="utf-8", newline="\n")
        facts = self.info.facts | {"columns": {c.name: c.text for c in self.columns}}
        heads = [head for column in self.columns for head in column.heads()]
        lines = [f"# {name}: {json_cells(value)}" for name, value in facts.items()]
        try:
            self._file.write("\n".join([*lines, ",".join(heads), ""]))
        except OSError:  # nobody else closes what was not begun
            with suppress(OSError):
                self._file.close()
            raise

    def write(self, block: Block) -> None:
        flat = [values.reshape(len(values), -1) for values in block.values()]
        parts = [_numbers(values) for values in flat]
        for n in range(len(flat[0])):
            row: list[float] = []
            for part in parts:
                row += part[n]
            # A list's own text, in a third of the time that joining the numbers' takes.
            self._file.write(repr(row)[1:-1].replace(" ", "") + "\n")

    def end(self) -> None:
        self._file.flush()

    def close(self) -> None:
        self._file.close()


def _numbers(values: "NDArray[Any]") -> list[list[float]]:
    """Values (n, k) as numbers: 0 or 1 for booleans, 9 digits in single precision."""
    rows = cast("list[list[float]]", (values + 0 if values.dtype == bool else values).tolist())
    single = values.dtype == np.float32
    return [[float(f"{x:.9g}") for x in row] for row in rows] if single else rows


class ParquetTable(TableWriter):
    """Parquet: a column for each number, called as in a CSV; the metadata are those of the file."""

    block = 2**25  # each group of rows describes all columns anew

    def begin(self, scratch: Path) -> None:
        self._arrow = optional("pyarrow", "parquet", "a .parquet file, unlike a .csv,")
        parquet: Any = importlib.import_module("pyarrow.parquet")
        facts = self.info.facts | {"columns": {c.name: c.text for c in self.columns}}
        metadata = {name: v if isinstance(v, str) else json.dumps(v) for name, v in facts.items()}
        kinds = [
            (head, self._arrow.from_numpy_dtype(np.dtype(column.kind)))
            for column in self.columns
            for head in column.heads()
        ]
        self._schema = self._arrow.schema(kinds)
        self._file = self.path.open("xb")
        self._table = parquet.ParquetWriter(
            self._file, self._schema, compression="zstd", store_schema=False
        )
        self._table.add_key_value_metadata(metadata)

    def write(self, block: Block) -> None:
        flat = [each for values in block.values() for each in values.reshape(len(values), -1).T]
        self._table.write_table(self._arrow.table(flat, schema=self._schema))

    def end(self) -> None:
        self._table.close()

    def close(self) -> None:
        self._file.close()


class _File(io.FileIO):
    """A new file that accepts what a full disk does not, or HDF5 would crash; `check` raises."""

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


_README = """{program} exported the recording {recording}.

Each data set has a row for each frame, in the order in which the frames came. Its attributes
unit and description say what it is; no unit is a plain number. The data set time is the scale of
the first dimension of all of them. Scales of further dimensions are names of components or
the numbers of elements and functions. NaN is what is not known. The attributes of
the file are texts or JSON: device, skin, positions of the elements in m, settings, calibration and
tare.

    with h5py.File("{file}") as file:
        force = file["force"]
        print(force.attrs["unit"], force.dims[0]["time"][:], force[:])

"""


class Hdf5Table(TableWriter):
    """HDF5: data sets that grow with the rows, with scales for their dimensions."""

    def begin(self, scratch: Path) -> None:
        self._h5py = optional("h5py", "hdf5", "a .h5 file, unlike an .npz,")
        self._disk = _File(self.path)
        # Attributes of older versions end at 64 KiB.
        self._file: Any = self._h5py.File(self._disk, "w", libver=("v108", "v108"))
        for name, value in self.info.facts.items():
            self._file.attrs[name] = value if isinstance(value, str) else json.dumps(value)
        for column in self.columns:
            made = self._file.create_dataset(
                column.name,
                (0, *column.shape),
                column.kind,
                maxshape=(None, *column.shape),
                chunks=(self.rows_at_once, *column.shape),
            )
            made.attrs["unit"], made.attrs["description"] = column.unit, column.text

    def _scale(self) -> None:
        """Let `time` be the scale of rows, and names or numbers those of further dimensions."""
        self._file["time"].make_scale("time")
        for column in self.columns:
            made = self._file[column.name]
            if column.name != "time":
                made.dims[0].attach_scale(self._file["time"])
            for n, (label, names) in enumerate(column.axes, 1):
                numbers = all(name.isdecimal() for name in names)
                which = "_".join(names) if label == "component" else f"{label}_{len(names)}"
                if which not in self._file:
                    made_of = np.arange(len(names)) if numbers else np.array(names, "S")
                    self._file.create_dataset(which, data=made_of).make_scale(label)
                made.dims[n].label = label
                made.dims[n].attach_scale(self._file[which])

    def write(self, block: Block) -> None:
        for name, values in block.items():
            data = self._file[name]
            data.resize(len(data) + len(values), axis=0)
            data[-len(values) :] = values
        self._disk.check()

    def end(self) -> None:
        self._file.flush()
        self._disk.check()
        try:
            self._describe()
        except OSError:
            self._disk.check()  # has the reason
            raise
        self._file.close()
        self._disk.check()

    def _describe(self) -> None:
        self._scale()
        lines = [f"{c.name} [{c.unit}]: {c.text}" for c in self.columns]
        said = _README.format(file=self.path.name, **self.info.facts) + "\n".join(lines) + "\n"
        self._file.create_dataset("README", data=said, dtype=self._h5py.string_dtype())

    def close(self) -> None:
        self._file.close()
        self._disk.close()


class NpzTable(TableWriter):
    """Columns wait in files of their own, since one archive takes one array after the other."""

    def begin(self, scratch: Path) -> None:
        self._length = 0
        self._waiting: dict[str, IO[bytes]] = {}
        self._folder = scratch / "columns"
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
                texts = {column.name: [column.unit, column.text] for column in self.columns}
                np.lib.format.write_array(member, np.array(self.info.json(columns=texts)))

    def close(self) -> None:
        for file in self._waiting.values():
            file.close()
        shutil.rmtree(self._folder, ignore_errors=True)
