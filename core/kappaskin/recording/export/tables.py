"""Moments to rows of a table, many at once."""

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kappaskin.recording.export.about import About
from kappaskin.recording.export.columns import columns
from kappaskin.recording.export.moment import Moment
from kappaskin.recording.export.wanted import Wanted

Block = dict[str, NDArray[Any]]

_BLOCK = 2**22  # bytes of rows that are written at once, about


class Table(ABC):
    """A table, of which a kind of file need only say how some rows (n, ...) are written."""

    def __init__(self, room: Path, wanted: Wanted, about: About) -> None:
        self.path, self.about, self.columns = room / wanted.to.name, about, columns(about)
        sizes = (np.dtype(c.kind).itemsize * int(np.prod(c.shape)) for c in self.columns)
        self.rows_at_once = max(_BLOCK // sum(sizes), 1)
        self._rows: list[list[NDArray[Any]]] = []
        self.begin(room)

    @abstractmethod
    def begin(self, room: Path) -> None: ...

    @abstractmethod
    def write(self, block: Block) -> None: ...

    def take(self, moment: Moment) -> bool:
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
