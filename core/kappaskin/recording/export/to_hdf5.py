"""Rows to an HDF5 file: a data set for each column, its unit and all else as attributes."""

import importlib
import io
import json
from pathlib import Path
from typing import Any

from kappaskin.errors import lacking
from kappaskin.recording.export.tables import Block, Table


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


class Hdf5Table(Table):
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
