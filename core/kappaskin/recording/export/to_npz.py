"""Rows to an NPZ file: an array for each column, and `about` as JSON."""

import shutil
import zipfile
from pathlib import Path
from typing import IO

import numpy as np

from kappaskin.recording.export.tables import Block, Table


class NpzTable(Table):
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
