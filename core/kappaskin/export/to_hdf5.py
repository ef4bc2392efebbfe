"""Rows to an HDF5 file: a data set for each column, its unit and all else as attributes."""

import importlib
import json
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from kappaskin.errors import Refusal
from kappaskin.export.tables import Block, Table


@contextmanager
def _told_plainly() -> Generator[None]:
    """Let what HDF5 cannot write be an `OSError`, as for any other file."""
    try:
        yield
    except RuntimeError as error:
        raise OSError(f"HDF5 could not write: {error!s:.200}") from error


class Hdf5Table(Table):
    """Data sets that grow with the rows."""

    def begin(self, room: Path) -> None:
        try:
            h5py: Any = importlib.import_module("h5py")
        except ImportError as error:
            raise Refusal(
                'expected h5py for a .h5 file; `pip install "kappaskin[hdf5]"` installs it, and an '
                ".npz needs nothing more"
            ) from error
        # Attributes of older versions end at 64 KiB.
        self._file: Any = h5py.File(self.path, "w", libver=("v108", "v108"))
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
        with _told_plainly():
            for name, values in block.items():
                kept = self._file[name]
                kept.resize(len(kept) + len(values), axis=0)
                kept[-len(values) :] = values

    def end(self) -> None:
        with _told_plainly():
            self._file.close()

    def close(self) -> None:
        with suppress(OSError, RuntimeError):  # whatever there was to say of the disk has been said
            self._file.close()
