"""Lines of devices with formats of their own: text, JSON and binary records to samples."""

import binascii
import json
import math
import re
import struct
import zlib
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from types import NoneType
from typing import Any, BinaryIO, cast

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Indices
from kappaskin.sensing import DigitalReadings
from kappaskin.sources.decoder import SEQUENCES, Accounting, SequenceCounter
from kappaskin.sources.wire import Samples

TIMES = {"time": 1.0, "time_ms": 1e-3, "time_us": 1e-6}
"""Columns of time, with their unit in s."""

SEPARATORS = (",", ";", "\t", " ")
"""Separators that are recognised, in this order; a space stands for any number of them."""

_LONGEST, _NUMBER = 2**16, 32  # bytes of a line, and for each number where there are many
_SHOWN = 60  # characters of a line that was discarded
_COMMA = re.compile(rb"\d,\d+\s*[;\t]")


@dataclass(frozen=True, eq=False)
class Columns:
    """What the numbers of a record are: each of `names`, and the readings among them.

    The number at `places` (n,) is the reading of `channels` (n,), scale times it plus offset, in
    its unit; a frame has it as one of `readings`. `time` and `sequence` are the places of these, -1
    without; a time is in `time_unit` s.
    """

    names: tuple[str, ...]
    places: Indices
    channels: Indices
    scale: Array
    offset: Array
    readings: DigitalReadings
    time: int = -1
    time_unit: float = 1.0
    sequence: int = -1

    def __len__(self) -> int:
        return len(self.names)

    def numbers(self, sequence: int, time: float, readings: Array) -> Array:
        """The numbers of a record at `time` in s, of all `readings` (C,); 0 if ignored."""
        numbers = np.zeros(len(self))
        numbers[self.places] = (readings[self.channels] - self.offset) / self.scale
        if self.time >= 0:
            numbers[self.time] = time / self.time_unit
        if self.sequence >= 0:
            numbers[self.sequence] = sequence
        return numbers


class LineDecoder(ABC):
    """Finds records in bytes as they arrive, as `Decoder` does messages of our own; never raises.

    Bytes before the first whole record, of a wrong number of columns, that are no numbers, or that
    fail their checksum are discarded and counted by reason; `last` is the last one discarded.
    """

    def __init__(self, columns: Columns) -> None:
        self.sequence = SequenceCounter()
        self.last = ""
        self.by_datagrams = False
        """Whether each `feed` is of a datagram, whose records do not go on in the next."""
        self._columns = columns
        self._bytes_in = self._bytes_good = self._number = 0
        self._sequences = SEQUENCES  # numbers after which the device's begin again
        self._discarded: Counter[str] = Counter()
        self._buffer = b""

    def feed(self, data: bytes) -> list[Samples]:
        """The new frames in order, duplicates left out."""
        self._bytes_in += len(data)
        self._buffer += self._of_datagram(data) if self.by_datagrams else data
        return [samples for samples in self._records() if self._is_new(samples.sequence)]

    def _is_new(self, sequence: int) -> bool:
        """Count a record; whether it is no duplicate. All are new of a device without numbers."""
        return self.sequence.take(self.sequence.good if sequence < 0 else sequence)

    @abstractmethod
    def encoded(self, sequence: int, time: float, readings: Array) -> bytes:
        """The record that a device would send at `time` in s, of all `readings` (C,)."""

    @abstractmethod
    def record(self, numbers: Sequence[float]) -> bytes:
        """The record of these numbers, one for each column, to the last bit.

        A `ValueError` where no record has them.
        """

    @abstractmethod
    def _records(self) -> Iterator[Samples]:
        """The records in the buffer, which are taken off it."""

    @abstractmethod
    def next_of(self, file: BinaryIO) -> bytes:
        """The next bytes of a file, with one record at most; none at its end."""

    @abstractmethod
    def _of_datagram(self, datagram: bytes) -> bytes:
        """The records of a `datagram`, the last of which ends with it."""

    @property
    def timed(self) -> bool:
        """Whether records tell the time."""
        return self._columns.time >= 0

    @property
    def held(self) -> bytes:
        """The bytes that another decoder needs to go on from here."""
        return self._buffer

    def line_ended(self) -> None:
        """Count what is buffered as cut off: the rest of it will not arrive."""
        self._discard("cut off", self._buffer, tell=False)
        self._buffer = b""

    def accounting(self, overrun: int = 0) -> Accounting:
        """The balance so far, with `overrun` bytes that came but were never fed."""
        discarded, buffered = self._discarded + Counter(overrun=overrun), len(self._buffer)
        return self.sequence.accounting(
            self._bytes_in + overrun, self._bytes_good, discarded, buffered
        )

    def _discard(self, reason: str, data: bytes, tell: bool = True) -> None:
        if data:
            self._discarded[reason] += len(data)
            if tell:
                self.last = f"{reason}: {data[:_SHOWN].decode(errors='replace').strip()!r}"

    def _samples(self, numbers: Array, size: int) -> Samples:
        """The samples of a record of `size` bytes with these `numbers`, one for each column."""
        columns, self._bytes_good = self._columns, self._bytes_good + size
        time = math.nan if columns.time < 0 else float(numbers[columns.time]) * columns.time_unit
        sequence = -1 if columns.sequence < 0 else self._unwrapped(int(numbers[columns.sequence]))
        values = columns.scale * numbers[columns.places] + columns.offset
        return Samples(sequence, time, columns.channels, columns.readings.counts(values))

    def _unwrapped(self, number: int) -> int:
        """A sequence number of 32 bits, which goes on where the device's begins again."""
        if self.sequence.good:
            half = self._sequences // 2
            number = self._number + (number - self._number + half) % self._sequences - half
        self._number = number
        return number % SEQUENCES

    def _usable(self, numbers: Array) -> bool:
        """Whether time and sequence are numbers that a frame may have."""
        columns = self._columns
        needed = [place for place in (columns.time, columns.sequence) if place >= 0]
        return bool(np.all((numbers[needed] >= 0) & (numbers[needed] < 2.0**63)))


class _Lines(LineDecoder):
    """Records that are lines of text."""

    def __init__(self, columns: Columns, whole: bool = False) -> None:
        super().__init__(columns)
        # Of the first line the beginning may be missing, and what is left of it look like a line.
        self._whole = self._begins_whole = whole
        self._longest = max(_LONGEST, _NUMBER * len(columns))

    @abstractmethod
    def _numbers(self, line: bytes) -> Array | str:
        """The numbers of a `line`, NaN for a missing one; or why there are none."""

    def _records(self) -> Iterator[Samples]:
        *lines, self._buffer = self._buffer.split(b"\n")
        if len(self._buffer) > self._longest:
            self._discard("too long", self._buffer)
            self._buffer, self._whole = b"", False
        for line in lines:
            size = len(line) + 1
            if not self._whole:
                self._whole = True
                if line:
                    self._discard("half a line", line + b"\n", tell=False)
                else:  # the end of a line before, as `held` begins
                    self._bytes_good += 1
                continue
            found = self._numbers(line)
            if isinstance(found, str):
                self._discard(found, line + b"\n")
            elif not self._usable(found):
                self._discard("time or sequence", line + b"\n")
            else:
                yield self._samples(found, size)

    def next_of(self, file: BinaryIO) -> bytes:
        return file.readline(self._longest)

    def _of_datagram(self, datagram: bytes) -> bytes:
        if datagram.endswith(b"\n"):
            return datagram
        self._bytes_in += 1
        return datagram + b"\n"

    @property
    def held(self) -> bytes:
        return b"\n" + self._buffer if self._whole else self._buffer

    def line_ended(self) -> None:
        super().line_ended()
        self._whole = self._begins_whole


class TextDecoder(_Lines):
    """Lines of numbers with a `separator` between them; without one it is recognised."""

    def __init__(self, columns: Columns, separator: str = "", whole: bool = False) -> None:
        super().__init__(columns, whole)
        self._separator = separator

    def _numbers(self, line: bytes) -> Array | str:
        text = line.strip()
        if not self._separator:
            self._separator = self._recognised(text)
        if not self._separator:
            return "no separator"
        parts = _split(text, self._separator)
        if len(parts) != len(self._columns):
            return "wrong number of columns"
        if b"_" in text:  # which Python reads between digits
            return "no number"
        try:
            return np.array([float(part or "nan") for part in parts])
        except ValueError:
            return "no number"

    def _discard(self, reason: str, data: bytes, tell: bool = True) -> None:
        super()._discard(reason, data, tell)
        if not (tell and data):
            return
        fields, expected = len(fields_of(data.strip())), len(self._columns)
        if _COMMA.search(data):
            self.last += " (numbers have a decimal point, not a comma)"
        elif fields != expected:
            self.last += f" ({fields} fields, expected {expected})"

    def encoded(self, sequence: int, time: float, readings: Array) -> bytes:
        numbers = self._columns.numbers(sequence, time, readings)
        separator = self._separator or SEPARATORS[0]
        return f"{separator.join(f'{number:.12g}' for number in numbers.tolist())}\r\n".encode()

    def record(self, numbers: Sequence[float]) -> bytes:
        return f"{(self._separator or SEPARATORS[0]).join(map(repr, numbers))}\n".encode()

    def _recognised(self, text: bytes) -> str:
        """The separator by which `text` has a number, or nothing, for each column; or none."""
        for separator in SEPARATORS:
            parts = _split(text, separator)
            if len(parts) == len(self._columns) and all(map(_is_number_or_missing, parts)):
                return separator
        return ""


def _split(text: bytes, separator: str) -> list[bytes]:
    """The parts of a line; any number of spaces and tabs is one space."""
    return text.split() if separator == " " else text.split(separator.encode())


def fields_of(line: bytes) -> list[bytes]:
    """The fields of a line, whichever separator it has."""
    return line.split(next((each for each in (b";", b"\t", b",") if each in line), None))


def _is_number_or_missing(part: bytes) -> bool:
    try:
        float(part or "nan")
    except ValueError:
        return False
    return True


class JsonDecoder(_Lines):
    """Lines of JSON, one object each; `paths` are the keys to the numbers of each group of columns.

    The value there is a number, or a list of as many as the group has.
    """

    def __init__(
        self, columns: Columns, paths: Sequence[tuple[tuple[str, ...], int]], whole: bool = False
    ) -> None:
        super().__init__(columns, whole)
        self._paths = paths

    def _numbers(self, line: bytes) -> Array | str:
        try:
            found: Any = json.loads(line, parse_int=float)
        except (ValueError, RecursionError):
            return "no JSON"
        numbers: list[float] = []
        for path, count in self._paths:
            value = found
            for key in path:
                if not isinstance(value, dict) or key not in value:
                    return f"no {'.'.join(path)}"
                value = value[key]  # pyright: ignore[reportUnknownVariableType]
            values: list[Any] = [value]
            if isinstance(value, list):
                values = cast("list[Any]", value)
            if len(values) != count:
                return "wrong number of columns"
            if any(type(each) not in (int, float, NoneType) for each in values):
                return "no number"
            numbers += [math.nan if each is None else float(each) for each in values]
        return np.array(numbers)

    def encoded(self, sequence: int, time: float, readings: Array) -> bytes:
        numbers = self._columns.numbers(sequence, time, readings).tolist()
        return self.record([float(f"{number:.12g}") for number in numbers])

    def record(self, numbers: Sequence[float]) -> bytes:
        values = [number if math.isfinite(number) else None for number in numbers]
        record, at = dict[str, Any](), 0
        for path, count in self._paths:
            *outer, last = path
            inside = record
            for key in outer:
                inside = inside.setdefault(key, {})
            inside[last] = values[at] if count == 1 else values[at : at + count]
            at += count
        return f"{json.dumps(record)}\n".encode()


def _sum8(data: bytes) -> int:
    return sum(data) & 0xFF


def _crc16(data: bytes) -> int:
    return binascii.crc_hqx(data, 0xFFFF)


CHECKSUMS: dict[str, tuple[str, Callable[[bytes], int]]] = {
    "none": ("", lambda data: 0),
    "sum8": ("B", _sum8),
    "crc16-ccitt": ("H", _crc16),
    "crc32": ("I", zlib.crc32),
}
"""Checksums of binary records: the type that holds one, and its function.

`sum8` is the sum of the bytes modulo 256, `crc16-ccitt` has the polynomial 0x1021 and begins with
0xFFFF, `crc32` is that of Ethernet and zip.
"""


def _as(code: str, number: float, order: str, wraps: bool) -> int | float:
    """A number as the type `code` of a struct holds it: the nearest, or what a counter shows."""
    if code in "efd":
        return number
    bits = 8 * struct.calcsize(order + code)
    low = -(2 ** (bits - 1)) if code.islower() else 0
    if wraps:
        return (round(number) - low) % 2**bits + low
    return low if math.isnan(number) else min(max(round(number), low), low + 2**bits - 1)


_STRUCT = "expected the format of a struct of Python such as '<H36h'"


class BinaryDecoder(LineDecoder):
    """Binary records: `sync` bytes, a `layout` of `struct`, and a checksum of it.

    Without sync bytes or a checksum nothing tells where a record begins.
    """

    def __init__(self, columns: Columns, layout: str, sync: bytes, checksum: str) -> None:
        super().__init__(columns)
        kind, self._sum = CHECKSUMS[checksum]
        try:
            self._body = struct.Struct(layout)
            values = self._body.unpack(bytes(self._body.size))
        except struct.error as error:
            raise Refusal(f"{_STRUCT}, got {layout!r}: {error}") from error
        if layout[:1] not in ("<", ">") or not all(type(v) in (int, float) for v in values):
            raise Refusal(f"{_STRUCT}, < or > first and then numbers only; got {layout!r}")
        if len(values) != len(columns):
            raise Refusal(
                f"expected columns for the {len(values)} values of the struct {layout!r}, got "
                f"{len(columns)}"
            )
        self._check = struct.Struct(f"{layout[0]}{kind}" if kind else "")
        counted = re.findall(r"(\d*)([a-zA-Z?])", layout)
        self._codes = "".join(code * int(count or 1) for count, code in counted if code != "x")
        if columns.sequence >= 0:
            bits = 8 * struct.calcsize(layout[0] + self._codes[columns.sequence])
            self._sequences = min(2**bits, SEQUENCES)
        self._sync, self._size = sync, len(sync) + self._body.size + self._check.size

    def encoded(self, sequence: int, time: float, readings: Array) -> bytes:
        columns = self._columns
        numbers = columns.numbers(sequence, time, readings).tolist()
        counters = {columns.time, columns.sequence}
        values = [
            _as(code, number, self._body.format[0], wraps=place in counters)
            for place, (code, number) in enumerate(zip(self._codes, numbers, strict=True))
        ]
        return self._packed(values)

    def _packed(self, values: Sequence[float]) -> bytes:
        body = self._body.pack(*values)
        check = self._check.pack(self._sum(body)) if self._check.size else b""
        return self._sync + body + check

    def record(self, numbers: Sequence[float]) -> bytes:
        each = zip(self._codes, numbers, strict=True)
        try:
            record = self._packed([n if code in "efd" else int(n) for code, n in each])
        except (struct.error, OverflowError) as error:
            raise ValueError(str(error)) from error
        held = np.array(self._body.unpack_from(record, len(self._sync)), float)
        if not np.array_equal(held, numbers, equal_nan=True):
            raise ValueError("it would be rounded")
        return record

    def next_of(self, file: BinaryIO) -> bytes:
        return file.read(self._size)

    def _of_datagram(self, datagram: bytes) -> bytes:
        if not len(datagram) % self._size:
            return datagram
        self._discard("no whole number of records", datagram)
        return b""

    def _records(self) -> Iterator[Samples]:
        data, at, sync = self._buffer, 0, self._sync
        while len(data) - at >= self._size:
            found = data.find(sync, at)
            if found != at:  # up to where the next record may begin
                found = found if found >= 0 else max(at, len(data) - len(sync) + 1)
                self._discard("between records", data[at:found])
                at = found
                continue
            body = data[at + len(sync) : at + len(sync) + self._body.size]
            check = data[at + len(sync) + self._body.size : at + self._size]
            numbers = np.array(self._body.unpack(body), float)
            right = not check or self._check.unpack(check)[0] == self._sum(body)
            if right and self._usable(numbers):
                yield self._samples(numbers, self._size)
                at += self._size
            else:
                self._discard("checksum" if not right else "time or sequence", data[at : at + 1])
                at += 1
        self._buffer = data[at:]
