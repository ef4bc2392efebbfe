"""Estimates and status from the engine's process to another, through shared memory.

One block, owned by the window's process: a status of any kind, then as many slots of equal size
as fit, written cyclically. Neither side ever waits: each value carries a count that the
writer makes odd, or changes, while it writes, and a reader that saw it change reads again.
"""

import errno
import os
import pickle
import secrets
import sys
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from functools import reduce
from multiprocessing import resource_tracker
from multiprocessing.shared_memory import SharedMemory
from operator import attrgetter, getitem
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from kappaskin._files import hold, left_behind
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Estimate
from kappaskin.pipeline import Pipeline, axes_of, stored

_SIZE = 96 * 2**20  # pages that are never written cost no memory
_STATUS_SIZE = 8 * 2**20  # the calibration of a large skin is most of it
_HEADER = 64
_MOST_SLOTS = 64
_TRIES = 100
_MEMORY, _PREFIX = Path("/dev/shm"), "kappaskin-"  # where Linux lists blocks, and ours
_OURS, _OURS_AT = b"kappaskin shared memory\0", 40  # in the header


def slot_type(pipeline: Pipeline) -> np.dtype[np.void]:
    """The record of one estimate: the fields of `Estimate` between two tickets."""
    setup = pipeline.setup
    lengths = axes_of(pipeline.sensor.layout, pipeline.basis.shape, (setup.nx, setup.ny))
    stored = {path: (of.kind, of.shape(lengths)) for path, of in _STORED.items()}
    return np.dtype([("opened", "u8"), *_fields(Estimate, "", stored), ("closed", "u8")])


_STORED = stored()


def _fields(
    value: Any, path: str, types: Mapping[str, tuple[str, tuple[int, ...]]]
) -> list[tuple[Any, ...]]:
    """The fields of a record of a `value`: of each its name and its type, by its path."""
    return [
        (field.name, _fields(field.type, f"{path}{field.name}.", types))
        if is_dataclass(field.type)
        else (field.name, *types[f"{path}{field.name}"])
        for field in fields(value)
    ]


_RECORDS: list[tuple[int, Any]] = [
    (n, field.type) for n, field in enumerate(fields(Estimate)) if is_dataclass(field.type)
]


def _estimate(record: Any) -> Estimate:
    """The estimate in a copied record; its arrays are views of the copy."""
    values = list(record.item()[1:-1])
    for n, kind in _RECORDS:
        values[n] = kind(*values[n])
    return Estimate(*values)


def is_slot(slot: np.dtype[Any]) -> bool:
    """Whether a type is that of the record of an estimate, of arrays of any lengths."""
    types = {path: (of.kind, ()) for path, of in _STORED.items()}
    ours = np.dtype([("opened", "u8"), *_fields(Estimate, "", types), ("closed", "u8")])
    return _leaves(slot) == _leaves(ours)


def _leaves(slot: np.dtype[Any]) -> list[Any]:
    """The names of all fields in order, and the types of their numbers."""
    inner = [(name, slot[name].base) for name in slot.names or ()]
    return [(name, _leaves(each) if each.names else each) for name, each in inner]


_Column = tuple[Callable[[Estimate], Any], Any]


def _columns(slots: Any) -> list[_Column]:
    """For each number or array of an estimate how to get it, and where it goes in all `slots`.

    To look for a field by its name in one slot takes longer than to write it.
    """
    columns: list[_Column] = []
    for name in slots.dtype.names[1:-1]:
        parts = slots[name].dtype.names
        if parts is None:
            columns.append((attrgetter(name), slots[name]))
        else:
            columns += [(attrgetter(f"{name}.{part}"), slots[name][part]) for part in parts]
    return columns


class Ring:
    """The block of memory: one process writes, another reads and owns it."""

    def __init__(self, memory: SharedMemory) -> None:
        self._memory = memory
        self._held = hold(getattr(memory, "_fd", -1))
        buffer = cast("memoryview", memory.buf)
        self._header: NDArray[np.uint64] = np.frombuffer(buffer, np.uint64, _HEADER // 8)
        self._status: NDArray[np.uint8] = np.frombuffer(
            buffer, np.uint8, _STATUS_SIZE, offset=_HEADER
        )
        self._area: NDArray[np.uint8] = np.frombuffer(
            buffer, np.uint8, offset=_HEADER + _STATUS_SIZE
        )
        self._slots: Any = None
        self._opened: Any = None
        self._closed: Any = None
        self._columns: list[_Column] = []
        self._generation = self._reserved = 0

    # The header: status count and length, generation of the slots, slots written, how many; whose.
    _COUNT, _LENGTH, _GENERATION, _WRITTEN, _SLOTS = range(5)

    @classmethod
    def create(cls) -> "Ring":
        """A new block; a `Refusal` where the system has no shared memory for it."""
        try:
            if 0 < _largest_file() < _SIZE:  # or Python's tracker of memory would print a traceback
                raise OSError(errno.EFBIG, "files may not be so large, see ulimit -f")
            name = _PREFIX + secrets.token_hex(8)
            made = cls(SharedMemory(name, create=True, size=_SIZE))
        except OSError as error:
            raise _no_memory(_SIZE, error) from error
        try:
            made._reserve(0, _HEADER)
        except Refusal:
            made.destroy()
            raise
        if made._held:
            made._header[_OURS_AT // 8 :] = np.frombuffer(_OURS, np.uint64)
        return made

    @classmethod
    def pair(cls) -> "tuple[Ring, Ring]":
        """Two new blocks; none where there is memory for one only.

        Blocks that processes left behind when they were ended by force are removed first.
        """
        _remove_left_behind(_MEMORY)
        first = cls.create()
        try:
            return first, cls.create()
        except Refusal:
            first.destroy()
            raise

    @classmethod
    def attach(cls, name: str) -> "Ring":
        return cls(SharedMemory(name))

    @classmethod
    def borrow(cls, name: str) -> "Ring":
        """A block that is given back by a process that began neither this one nor from it."""
        memory = SharedMemory(name)
        if os.name == "posix":
            # Attached, it counts as this process's own, which would be given back with it.
            resource_tracker.unregister(f"/{name}", "shared_memory")
        return cls(memory)

    @property
    def name(self) -> str:
        return self._memory.name

    def write_status(self, status: object) -> None:
        data = pickle.dumps(status)
        if len(data) > _STATUS_SIZE:
            raise Refusal(f"expected a status of at most {_STATUS_SIZE} bytes, got {len(data)}")
        if len(data) > self._reserved:
            self._reserve(_HEADER, len(data))
            self._reserved = len(data)
        # Odd already when a writer was killed in the middle: |= sets it right, += would not.
        self._header[self._COUNT] |= 1
        self._status[: len(data)] = np.frombuffer(data, np.uint8)
        self._header[self._LENGTH] = len(data)
        self._header[self._COUNT] += 1

    def read_status(self) -> Any:
        """The status last written whole, None before the first or while one is written."""

        def copied() -> bytes | None:
            count = int(self._header[self._COUNT])
            data = bytes(self._status[: int(self._header[self._LENGTH])])
            unchanged = count == int(self._header[self._COUNT])
            return data if count and not count % 2 and unchanged else None

        data = _tried(copied)
        # Written by our own engine into memory that only this user may open.
        return pickle.loads(data) if data else None

    def _reserve(self, begin: int, size: int) -> None:
        """Have the system back these bytes: to write to what it cannot back ends the process."""
        if sys.platform == "linux":
            try:
                os.posix_fallocate(self._memory._fd, begin, size)  # pyright: ignore  # noqa: SLF001
            except OSError as error:
                raise _no_memory(size, error) from error

    def _slots_for(self, slot: np.dtype[np.void]) -> int:
        """How many slots there is memory for."""
        count = min(_MOST_SLOTS, len(self._area) // slot.itemsize)
        if count < 2:
            raise Refusal(f"an estimate of {slot.itemsize} bytes is too large; use a smaller basis")
        while True:
            try:
                self._reserve(_HEADER + _STATUS_SIZE, count * slot.itemsize)
            except Refusal:
                if count == 2:
                    raise
                count = max(2, count // 2)
            else:
                return count

    def _map(self, slot: np.dtype[np.void]) -> None:
        size = int(self._header[self._SLOTS]) * slot.itemsize
        self._slots = self._area[:size].view(slot)

    def lay_out(self, generation: int, slot: np.dtype[np.void]) -> None:
        """Writer: begin anew with slots for estimates of `generation` (above zero)."""
        self._header[self._GENERATION] = 0
        self._header[self._SLOTS] = self._slots_for(slot)
        self._map(slot)
        self._opened, self._closed = self._slots["opened"], self._slots["closed"]
        self._columns = _columns(self._slots)
        self._opened[:] = self._closed[:] = 0
        self._header[self._WRITTEN] = 0
        self._header[self._GENERATION] = generation

    def write(self, estimate: Estimate) -> None:
        """Writer: put one estimate into the next slot."""
        with self._writing() as place:
            for value_of, column in self._columns:
                column[place] = value_of(estimate)

    def write_record(self, record: Any) -> None:
        """Writer: put the record of an estimate, as `newest` has it, into the next slot."""
        with self._writing() as place:
            for name in self._slots.dtype.names[1:-1]:
                self._slots[name][place] = record[name]

    @contextmanager
    def _writing(self) -> Generator[int]:
        """The place of the next slot, which counts as written at the end."""
        written = int(self._header[self._WRITTEN])
        place = written % len(self._slots)
        self._opened[place] = written + 1
        yield place
        self._closed[place] = written + 1
        self._header[self._WRITTEN] = written + 1

    def read(
        self, generation: int, slot: np.dtype[np.void], sequence: int | None = None
    ) -> Estimate | None:
        """Reader: the latest estimate of `generation`, or of the frame with this `sequence`.

        None when there is none yet, or no more.
        """
        found = self.newest(generation, slot, sequence)
        return _estimate(found[1]) if found is not None else None

    def newest(
        self, generation: int, slot: np.dtype[np.void], sequence: int | None = None
    ) -> tuple[int, Any] | None:
        """Reader: the same as the number of the estimate, counted from 1, and its record."""
        if not self._mapped(generation, slot):
            return None

        def copied() -> Any:
            written = int(self._header[self._WRITTEN])
            if not written:
                return None
            ticket = written if sequence is None else self._ticket_of(sequence)
            if not ticket:
                return None
            here = self._slots[(ticket - 1) % len(self._slots)]
            closed, record = here["closed"], here.copy()
            # The tickets in the order opposite to the writer's, or a half may pass for a whole.
            whole = closed == here["opened"] == ticket
            same = self._header[self._GENERATION] == generation
            return (ticket, record) if whole and same else None

        return _tried(copied)

    def recent(
        self, generation: int, slot: np.dtype[np.void], after: int, paths: Sequence[str]
    ) -> tuple[Array, list[Array], int]:
        """Reader: times (T,) in s and fields (T, ...) of all after the one numbered `after`.

        The fields are those at `paths` of `stored()`; none without `generation`. As many of it as
        are still there, and the number of the last, counted from 1.
        """
        written = int(self._header[self._WRITTEN])
        if not self._mapped(generation, slot):
            return np.empty(0), [], written
        tickets = np.arange(max(after, written - len(self._slots)), written) + 1
        here = (tickets - 1) % len(self._slots)
        closed = self._slots["closed"][here]
        times = self._slots["device_time"][here]
        values = [reduce(getitem, path.split("."), self._slots)[here] for path in paths]
        # The tickets in the order opposite to the writer's, as above.
        whole = (closed == tickets) & (self._slots["opened"][here] == tickets)
        if self._header[self._GENERATION] != generation:
            whole[:] = False
        return times[whole], [value[whole] for value in values], written

    def _mapped(self, generation: int, slot: np.dtype[np.void]) -> bool:
        """Reader: whether the slots are those of `generation`, as they are laid out."""
        if self._header[self._GENERATION] != generation:
            return False
        if generation != self._generation or slot != self._slots.dtype:
            self._map(slot)
            self._generation = generation
        return True

    def _ticket_of(self, sequence: int) -> int:
        """Which estimate was written of that frame last, counted from 1; 0 where none is there."""
        tickets = np.where(self._slots["sequence"] == sequence, self._slots["closed"], 0)
        return int(tickets.max())

    def close(self) -> None:
        """Let go of the memory."""
        del self._header, self._status, self._area, self._slots
        del self._opened, self._closed, self._columns
        self._memory.close()

    def destroy(self) -> None:
        """Owner: let go of the memory and give it back."""
        self.close()
        self._memory.unlink()


def _remove_left_behind(folder: Path) -> None:
    for path in folder.glob(f"{_PREFIX}*"):
        with left_behind(path, _OURS, _OURS_AT) as left:
            if left:
                path.unlink(missing_ok=True)


def _largest_file() -> int:
    """Bytes that a file of this process may have, shared memory among them; below 0: any."""
    if sys.platform == "win32":
        return -1
    import resource

    return resource.getrlimit(resource.RLIMIT_FSIZE)[0]


def _no_memory(size: int, error: OSError) -> Refusal:
    return Refusal(
        f"expected {size:,} bytes of shared memory, got none ({error.strerror or error}); free "
        "some, or allow more (in a container --shm-size=256m)"
    )


def _tried(copied: Callable[[], Any]) -> Any:
    """The first value that was copied whole, None when a writer was always in the way."""
    return next((value for _ in range(_TRIES) if (value := copied()) is not None), None)
