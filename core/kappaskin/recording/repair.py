"""Repair of damaged MCAP files."""

import mmap
import struct
import zlib
from collections import Counter
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Metadata, Schema
from mcap.writer import CompressionType, Writer

from kappaskin._files import Budget, open_file, part_for
from kappaskin._processes import BackgroundProcess
from kappaskin.errors import Refusal
from kappaskin.recording.disk import ReservedFile, is_there
from kappaskin.recording.messages import TOPICS
from kappaskin.recording.reading import (
    LARGEST,
    MAGIC,
    MESSAGE_HEADER,
    CorruptRecord,
    McapRecord,
    cost,
    decompressed,
    parsed,
    record_at,
    records_in,
    summary_of,
    unpacked,
)
from kappaskin.recording.writing import part_of

_COMPRESSION = 9 + 8 + 8 + 8 + 4  # bytes of a chunk before the name of its compression
_NAMES = tuple(struct.pack("<I", len(name)) + name for name in (b"zstd", b"lz4"))
_ENDS = (Opcode.DATA_END, Opcode.FOOTER)
_KNOWN = frozenset(Opcode)
_PRIVATE = 0x80
_CHUNK = 2**20  # bytes
_REPORTS = 200  # at most
_RECORDS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)


@dataclass(frozen=True)
class Repaired:
    """What was saved: `messages` by topic, and `attachments`; `lost` bytes could not be read.

    `ended` says whether the file had its end.
    """

    messages: dict[str, int]
    attachments: int
    lost: int
    ended: bool

    @property
    def total(self) -> int:
        return sum(self.messages.values())

    @property
    def words(self) -> str:
        """Counts of what was saved and lost, as text."""
        lost = f"{self.lost:,} bytes could not be read" if self.lost else "nothing was lost"
        if not (self.total or self.attachments):
            lost = lost if self.lost else "it holds none"
            return f"no message could be saved; {lost}"
        return f"{self.total:,} messages and {self.attachments} attachments; {lost}"

    @staticmethod
    def steps(path: Path, out: Path, part: Path | None = None) -> "Generator[float | Repaired]":
        """Save every whole message of `path` to `out`, with summary and index.

        Yields the share that is done now and then, and what was saved at the end. Nothing is
        written where nothing is saved; until all is, it is in `part`. A `Refusal` where `path`
        cannot be read or is no MCAP file, or `out` cannot be written.
        """
        check_new(out, path)
        try:
            with open_file(path) as file:
                if not path.stat().st_size:
                    raise Refusal(f"{path}: is empty")
                with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                    yield (yield from _Repair(path, data, out, part or part_for(out)).run())
        except OSError as error:
            raise Refusal(f"{path}: cannot be read ({error.strerror or error})") from error


def check_new(out: Path, path: Path) -> None:
    """Refuse an `out` that exists, or that another recording than `path` will be named."""
    part = part_of(out)
    ours = is_there(part) and is_there(path) and part.samefile(path)
    if is_there(out) or (is_there(part) and not ours):
        raise Refusal(f"{out}: already exists; choose another name")


class _Repair:
    """Reads the bytes of one file once."""

    def __init__(self, path: Path, data: mmap.mmap, out: Path, part: Path) -> None:
        self._path, self._data, self._out, self._size = path, data, out, len(data)
        self._part = part
        self._budget = Budget(path, self._size)
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._new: dict[int, int] = {}  # channels as they are called in what is written
        self._new_schemas: dict[int, int] = {}
        self._counts: Counter[str] = Counter()
        self._attached = self._lost = 0
        self._ended = False

    def run(self) -> Generator[float, None, Repaired]:
        disk, next_report = ReservedFile(self._part), 0.0
        try:
            self._writer = Writer(disk.stream, _CHUNK, CompressionType.LZ4)
            self._begin()
            for at in self._through():
                if at >= next_report:
                    next_report = at + self._size / _REPORTS
                    yield at / self._size
            if self._counts or self._attached:
                self._writer.finish()
                disk.sync()
                disk.path.rename(self._out)
        except OSError as error:
            raise Refusal(f"{self._out}: cannot be written ({error.strerror or error})") from error
        finally:
            disk.close()
            disk.path.unlink(missing_ok=True)
        return Repaired(dict(self._counts), self._attached, self._lost, self._ended)

    def _begin(self) -> None:
        """Write the header of the original file."""
        profile, library, fingers = "", "kappaskin", ""
        self._at = len(MAGIC)
        if self._data[: len(MAGIC)] == MAGIC:
            try:
                first = record_at(self._data, len(MAGIC), self._size)
                header = parsed(Header, first.body)
                profile, library = header.profile, header.library
                then = record_at(self._data, first.end, self._size)
                if then.code == Opcode.METADATA:
                    fingers = parsed(Metadata, then.body).metadata.get("fingers", "")
            except CorruptRecord:
                pass
        elif (found := self._next_chunk(0)) < self._size:
            self._at = self._lost = found
        else:
            raise Refusal(f"{self._path}: expected a recording (an MCAP file), got another file")
        self._writer.start(profile, library)
        self._expect(library, fingers.split(","))

    def _expect(self, library: str, fingers: list[str]) -> None:
        """Add the channels of our recordings: the chunk that defines them may be damaged."""
        if library.startswith("kappaskin"):
            topics = (topic.of(finger) for finger in fingers for topic in TOPICS)
            for n, (topic, kind) in enumerate(topics, 1):
                self._schemas[n] = Schema(n, kind.definition, "ros2msg", kind.name)
                self._channels[n] = Channel(n, topic, "cdr", {}, n)
        try:
            for record in summary_of(self._data, self._size):
                if record.code in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self._take(record.code, record.body)
        except CorruptRecord:
            return

    def _through(self) -> Iterator[int]:
        """Save record after record; yields where each begins."""
        while self._at < self._size and not self._ended:
            yield self._at
            if (record := self._record(self._at)) is not None:
                try:
                    self._save(record)
                    self._at = record.end
                    continue
                except CorruptRecord:
                    if self._record(record.end) is not None:
                        self._go_on(record.end)
                        continue
            self._save_part()
            self._go_on(self._next_chunk(self._at + 1))

    def _go_on(self, at: int) -> None:
        """Continue at `at`; the bytes before are lost."""
        self._lost += at - self._at
        self._at = at

    def _record(self, at: int) -> McapRecord | None:
        """The record that begins at `at`, if one does."""
        try:
            record = record_at(self._data, at, self._size)
        except CorruptRecord:
            return None
        return record if record.code in _KNOWN or record.code >= _PRIVATE else None

    def _next_chunk(self, at: int) -> int:
        """Start of the next complete chunk; the end of the file if there is none."""
        while at < self._size:
            places = [self._data.find(name, at + _COMPRESSION) for name in _NAMES]
            found = min((place for place in places if place >= 0), default=-1)
            if found < 0:
                break
            at = found - _COMPRESSION
            try:
                record = record_at(self._data, at, self._size)
                if record.code == Opcode.CHUNK:
                    self._budget.take(len(record.body), "what looks like a chunk in it")
                    unpacked(record.body, self._budget)
                    return at
            except CorruptRecord:
                pass
            at += 1
        return self._size

    def _save(self, record: McapRecord) -> None:
        if record.code == Opcode.CHUNK:
            for code, body in records_in(unpacked(record.body, self._budget)):
                self._take(code, body)
        elif record.code in _RECORDS:
            self._take(record.code, record.body)
        elif record.code == Opcode.ATTACHMENT:
            self._attach(record.body)
        elif record.code == Opcode.METADATA:
            found = parsed(Metadata, record.body)
            self._writer.add_metadata(found.name, found.metadata)
        elif record.code in _ENDS:
            self._ended = True

    def _save_part(self) -> None:
        """Save the complete messages of a chunk that is cut off by the end of the file."""
        body = self._data[self._at + 9 : min(self._size, self._at + 9 + LARGEST)]
        name = next((n for n in _NAMES if body[_COMPRESSION - 9 :].startswith(n)), None)
        cut_off = self._at + 9 + int.from_bytes(self._data[self._at + 1 : self._at + 9], "little")
        if self._data[self._at] != Opcode.CHUNK or name is None or cut_off <= self._size:
            return
        packed = body[_COMPRESSION - 9 + len(name) + 8 :]
        try:
            for code, record in records_in(decompressed(name[4:].decode(), packed)):
                self._take(code, record)
        except CorruptRecord:
            return

    def _take(self, code: int, body: bytes) -> None:
        """Save the messages of a chunk that may be damaged."""
        self._budget.take(cost(code, body), "the number of its records")
        if code == Opcode.SCHEMA:
            schema = parsed(Schema, body)
            self._schemas[schema.id] = schema
        elif code == Opcode.CHANNEL:
            channel = parsed(Channel, body)
            self._channels[channel.id] = channel
        elif code == Opcode.MESSAGE:
            if len(body) < MESSAGE_HEADER.size:
                raise CorruptRecord("a message is too short")
            channel, sequence, logged, published = MESSAGE_HEADER.unpack_from(body)
            if (to := self._channel(channel)) is not None:
                data = body[MESSAGE_HEADER.size :]
                self._writer.add_message(to, logged, data, published, sequence)
                self._counts[self._channels[channel].topic] += 1
            else:
                self._lost += len(body)

    def _channel(self, number: int) -> int | None:
        """The channel's number in the new file; None where its definition is lost."""
        if number in self._new:
            return self._new[number]
        if (channel := self._channels.get(number)) is None:
            return None
        schema = self._schemas.get(channel.schema_id)
        if schema is not None and schema.id not in self._new_schemas:
            to = self._writer.register_schema(schema.name, schema.encoding, schema.data)
            self._new_schemas[schema.id] = to
        self._new[number] = self._writer.register_channel(
            channel.topic,
            channel.message_encoding,
            self._new_schemas.get(channel.schema_id, 0),
            channel.metadata,
        )
        return self._new[number]

    def _attach(self, body: bytes) -> None:
        if zlib.crc32(body[:-4]) != int.from_bytes(body[-4:], "little"):
            raise CorruptRecord("an attachment is damaged")
        found = parsed(Attachment, body)
        self._writer.add_attachment(
            found.create_time, found.log_time, found.name, found.media_type, found.data
        )
        self._attached += 1


class RepairTask:
    """Saves the complete messages of the file `path` to the new file `out`; no call waits.

    A `Refusal` where `out` is there. It ends when it is done, when `close` is called, which leaves
    nothing of what is not whole, or when the process that started it is gone.
    """

    def __init__(self, path: Path, out: Path) -> None:
        check_new(out, path)
        self.part = part_for(out)
        self._task = BackgroundProcess[float | Repaired](
            "kappaskin-repair", Repaired.steps, path, out, self.part
        )

    @property
    def done(self) -> bool:
        return self._task.done

    def poll(self) -> list[float | Repaired]:
        """The shares done since the last call, and at the end the result.

        A `Refusal` where nothing could be.
        """
        return self._task.poll()

    def close(self) -> None:
        """End it, done or not."""
        self._task.close()
        self.part.unlink(missing_ok=True)
