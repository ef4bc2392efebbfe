"""Files to MCAP records, with every size held against what is there.

No file takes more memory than a few times `LARGEST`.
"""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

import lz4.frame  # pyright: ignore[reportMissingTypeStubs]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk, Footer

from kappaskin.errors import Refusal
from kappaskin.recording.disk import is_there

MAGIC = b"\x89MCAP0\r\n"
LARGEST = 2**26  # bytes of a record, or of what is in a chunk
_HEAD = struct.Struct("<BQ")
_FOOTER = _HEAD.size + 20
_FAULTS = (
    McapError,
    ValueError,
    OverflowError,
    struct.error,
    RuntimeError,
    zstandard.ZstdError,
    MemoryError,
)


class Spoilt(Exception):
    """A record is cut off, or is not what it says it is."""


class Record(NamedTuple):
    """A record at the byte `at` of a file, whose next record begins at `end`."""

    at: int
    end: int
    code: int
    body: bytes


class Bytes(Protocol):
    """A file, or what is in memory like one."""

    def seek(self, pos: int, /) -> object: ...

    def read(self, n: int = -1, /) -> bytes: ...


_Kind = TypeVar("_Kind")


def record_at(file: Bytes, at: int, size: int) -> Record:
    """The record at the byte `at` of a `file` of `size` bytes."""
    if not 0 <= at <= size:
        raise Spoilt("it is said to begin beyond the end")
    file.seek(at)
    head = file.read(_HEAD.size)
    if len(head) < _HEAD.size:
        raise Spoilt("it is cut off")
    code, length = _HEAD.unpack(head)
    end = at + _HEAD.size + length
    if end > size or length > LARGEST:
        raise Spoilt("it is cut off" if end > size else f"it has a record of {length} bytes")
    return Record(at, end, code, file.read(length))


def parsed(kind: type[_Kind], body: bytes) -> _Kind:
    """The record of a `kind` in `body`."""
    try:
        return kind.read(ReadDataStream(BytesIO(body)))  # type: ignore[attr-defined]
    except _FAULTS as error:
        why = str(error)[:80] or "it is cut off"
        raise Spoilt(f"a {kind.__name__.lower()} cannot be read ({why})") from error


def unpacked(body: bytes) -> bytes:
    """What is in the chunk of a record's `body`: the bytes of its records, checked."""
    chunk = parsed(Chunk, body)
    if chunk.uncompressed_size > LARGEST:
        raise Spoilt(f"a chunk says that it holds {chunk.uncompressed_size} bytes")
    data = decompressed(chunk.compression, chunk.data)
    if len(data) != chunk.uncompressed_size or (
        chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc
    ):
        raise Spoilt("a chunk is damaged")
    return data


def decompressed(compression: str, data: bytes) -> bytes:
    """The bytes as far as they are there, at most one more than are allowed."""
    try:
        if compression == "zstd":
            with zstandard.ZstdDecompressor().stream_reader(data) as reader:
                return reader.read(LARGEST + 1)
        if compression == "lz4":
            unpacker: Any = lz4.frame.LZ4FrameDecompressor()
            return unpacker.decompress(data, LARGEST + 1)
    except _FAULTS as error:
        raise Spoilt(f"a chunk cannot be decompressed ({error!s:.80})") from error
    if compression:
        raise Spoilt(f"a chunk is compressed by {compression!r:.20}, which nobody here knows")
    return data


def records_in(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Code and body of the records in a chunk; a `Spoilt` at the first that is cut off."""
    at = 0
    while at < len(data):
        if at + _HEAD.size > len(data):
            raise Spoilt("a chunk ends within a record")
        code, length = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        if at + length > len(data):
            raise Spoilt("a chunk ends within a record")
        yield code, data[at : at + length]
        at += length


def summary_of(file: Bytes, size: int) -> Iterator[Record]:
    """The records at the end of a `file` of `size` bytes that say what is in it.

    None where it has no such end; a `Spoilt` where that is damaged.
    """
    end = size - len(MAGIC)
    file.seek(max(end, 0))
    if file.read(len(MAGIC)) != MAGIC or end < _FOOTER:
        return
    footer = record_at(file, end - _FOOTER, end)
    at = parsed(Footer, footer.body).summary_start
    if footer.code != Opcode.FOOTER or at < len(MAGIC):
        return
    while at < footer.at:
        record = record_at(file, at, footer.at)
        yield record
        at = record.end


def check_file(path: Path) -> None:
    """Refuse what is there but is no file, as a pipe that nobody writes to: opening it may wait."""
    if is_there(path) and not path.is_file():
        raise Refusal(f"{path}: cannot be read; expected a file")
