"""MCAP reader, for whole files and for unfinished ones up to where they break off.

Every size is checked against what is there, and what a small file declares in all is limited.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from functools import cached_property
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

import lz4.frame  # pyright: ignore[reportMissingTypeStubs]
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

from kappaskin._files import Budget, open_file
from kappaskin._lazy import Displayed
from kappaskin.errors import Damaged, Refusal
from kappaskin.frames import Array, Event
from kappaskin.pipeline import REVISION
from kappaskin.recording.cdr import decode
from kappaskin.recording.messages import (
    CONTACT,
    CONTACTS,
    DEVICE,
    EVENTS,
    LINES,
    LOG,
    SETUP,
    STRING,
    TOPICS,
    Topic,
    finger_of,
    unpack_line,
)
from kappaskin.recording.writing import FORMAT, HAND_FORMAT, PROGRAM, part_of

MAGIC = b"\x89MCAP0\r\n"
LARGEST = 2**26  # bytes of a record, or of what is in a chunk
_HEAD = struct.Struct("<BQ")
_FOOTER = _HEAD.size + 20
# What work on a record costs, as bytes of a file's budget: each takes some microseconds, and one
# that is parsed some for each entry.
_PER_RECORD, _PARSED = 400, 16
_AT_ONCE = 2000  # contacts
_FAULTS = (
    McapError,
    ValueError,
    OverflowError,
    struct.error,
    RuntimeError,
    zstandard.ZstdError,
    MemoryError,
)


class CorruptRecord(Exception):
    """A record is cut off, or its contents contradict its header."""


class McapRecord(NamedTuple):
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


def record_at(file: Bytes, at: int, size: int) -> McapRecord:
    """The record at the byte `at` of a `file` of `size` bytes."""
    if not 0 <= at <= size:
        raise CorruptRecord("its stated start is beyond the end")
    file.seek(at)
    head = file.read(_HEAD.size)
    if len(head) < _HEAD.size:
        raise CorruptRecord("it is cut off")
    code, length = _HEAD.unpack(head)
    end = at + _HEAD.size + length
    if end > size or length > LARGEST:
        raise CorruptRecord("it is cut off" if end > size else f"it has a record of {length} bytes")
    return McapRecord(at, end, code, file.read(length))


def parsed(kind: type[_Kind], body: bytes) -> _Kind:
    """The record of a `kind` in `body`."""
    try:
        return kind.read(ReadDataStream(BytesIO(body)))  # type: ignore[attr-defined]
    except _FAULTS as error:
        why = str(error)[:80] or "it is cut off"
        raise CorruptRecord(f"a {kind.__name__.lower()} cannot be read ({why})") from error


def unpacked(body: bytes, budget: Budget | None = None) -> bytes:
    """The bytes of the records in the chunk of a record's `body`, checked.

    They are counted in the `budget` of the file, if it is given.
    """
    chunk = parsed(Chunk, body)
    if chunk.uncompressed_size > LARGEST:
        raise CorruptRecord(f"a chunk claims to hold {chunk.uncompressed_size} bytes")
    if budget is not None:
        budget.take(chunk.uncompressed_size, "what is compressed in it")
    data = decompressed(chunk.compression, chunk.data)
    if len(data) != chunk.uncompressed_size or (
        chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc
    ):
        raise CorruptRecord("a chunk is damaged")
    return data


def decompressed(compression: str, data: bytes) -> bytes:
    """The decompressed bytes, at most one more than allowed."""
    try:
        if compression == "zstd":
            with zstandard.ZstdDecompressor().stream_reader(data) as reader:
                return reader.read(LARGEST + 1)
        if compression == "lz4":
            unpacker: Any = lz4.frame.LZ4FrameDecompressor()
            return unpacker.decompress(data, LARGEST + 1)
    except _FAULTS as error:
        raise CorruptRecord(f"a chunk cannot be decompressed ({error!s:.80})") from error
    if compression:
        raise CorruptRecord(f"a chunk is compressed by {compression!r:.20}, which is not supported")
    return data


def cost(code: int, body: bytes) -> int:
    """What work on a record counts, in bytes of a file's budget."""
    return _PER_RECORD if code == Opcode.MESSAGE else _PER_RECORD + _PARSED * len(body)


def records_in(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Code and body of the records in a chunk; a `CorruptRecord` at the first that is cut off."""
    at = 0
    while at < len(data):
        if at + _HEAD.size > len(data):
            raise CorruptRecord("a chunk ends within a record")
        code, length = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        if at + length > len(data):
            raise CorruptRecord("a chunk ends within a record")
        yield code, data[at : at + length]
        at += length


def summary_of(file: Bytes, size: int) -> Iterator[McapRecord]:
    """The summary records at the end of a `file` of `size` bytes.

    None where it has no such end; a `CorruptRecord` where that is damaged.
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


MESSAGE_HEADER = struct.Struct("<HIQQ")
"""Begins a message's record in MCAP: channel, sequence, log time and publish time."""

_DIGITS = 9  # of a version or revision
_KINDS = {topic.name: topic.kind.name for topic in TOPICS}


class RecordedMessage(NamedTuple):
    """One message: when it was logged in ns since 1970, and its bytes."""

    topic: str
    stamp: int
    data: bytes


class ChunkAt(NamedTuple):
    """Where a chunk begins, the first and last time in it, in ns since 1970, and its channels."""

    at: int
    first: int
    last: int
    channels: frozenset[int]


class Recording(Displayed):
    """The recording at `path`, open until `close`; a `Refusal` for any other file.

    `whole` says whether it was ended as it should be; one that was not is read up to where it
    breaks off. `first` and `last` are the times it spans, in ns since 1970, `counts` how many
    messages each topic has, and `chunks` where they are. It was recorded by the program `library`,
    whose estimates have the `revision`; 0 if unknown, as of recordings before there were revisions.

    Of a hand it is the recording of one `finger`, or of that in a `path` FILE#FINGER; else, of
    `any_finger`, of the first of its `fingers`, whose name is empty where there is one without.
    Times are the same for all fingers.
    """

    def __init__(self, path: Path | str, finger: str | None = None) -> None:
        path = Path(path)
        if "#" in path.name and not path.exists():
            name, _, named = path.name.rpartition("#")
            path, finger = path.with_name(name), named if finger is None else finger
        self.path, self.finger, self.any_finger = path, finger or "", finger is None
        self._fingers: dict[str, None] = {}
        try:
            self._file = open_file(path)
            self._size = self._file.seek(0, 2)
            self._file.seek(0)
            magic = self._file.read(len(MAGIC))
        except OSError as error:
            why = f"cannot be read ({error.strerror or error}); expected a recording"
            if isinstance(error, FileNotFoundError) and part_of(path).exists():
                why = f"is not complete; end the recording, or use {part_of(path).name}"
            raise Refusal(f"{path}: {why}") from error
        self.library = ""
        # Where they were lost with the beginning of the file:
        self.format, self.revision = FORMAT, 0
        self.counts: dict[str, int] = {}
        self.chunks: list[ChunkAt] = []
        self._topics: dict[int, str] = {}
        self._schemas: dict[int, str] = {}
        self._attached: dict[str, int] = {}
        self.budget = Budget(path, self._size)
        self._counted: dict[int, int] = {}  # records of chunks that the budget has counted
        try:
            self._check(magic)
            self.whole = self._summarised()
            if not self.whole:
                self._scan()
            self._check_format()
        except BaseException:
            self.close()
            raise

    def _check(self, magic: bytes) -> None:
        if magic != MAGIC:
            raise Refusal(
                f"{self.path}: expected a recording (an MCAP file), got another file; "
                "`kappaskin record` makes one"
            )
        try:
            record = record_at(self._file, len(MAGIC), self._size)
            self.library = parsed(Header, record.body).library
        except CorruptRecord as fault:
            raise Damaged(f"{self.path}: not a valid recording: {fault}") from fault

    @property
    def fingers(self) -> tuple[str, ...]:
        return tuple(self._fingers)

    def _check_format(self) -> None:
        if self.format > HAND_FORMAT:
            raise Refusal(
                f"{self.path}: expected a recording of format {HAND_FORMAT}, got {self.format}, of "
                "a later version; update this program"
            )
        if self._fingers and self.finger not in self._fingers:
            names = ", ".join(self._fingers) or "which have no names"
            raise Refusal(f"{self.path}: expected one of its fingers, {names}; got {self.finger!r}")
        if not self._topics and self.library.startswith("kappaskin"):
            raise Damaged(
                f"{self.path}: expected messages, got none before the damaged part; `kappaskin "
                "repair` saves the intact messages after it"
            )
        if not self._topics:
            raise Refusal(
                f"{self.path}: expected a recording of this program, got an MCAP file of "
                f"{self.library or 'another'!r:.60}; `kappaskin import` makes one of it, with the "
                "description of its sensor"
            )

    # The summary at the end of a file.

    def _summarised(self) -> bool:
        """Read the summary, if the file has one."""
        try:
            for record in list(summary_of(self._file, self._size)):
                self._take(record)
            return bool(self.chunks) and len({chunk.at for chunk in self.chunks}) == len(
                self.chunks
            )
        except CorruptRecord:
            return False

    def _take(self, record: McapRecord) -> None:
        """Take a record of the summary, or one outside of chunks."""
        if record.code != Opcode.CHUNK:
            self.budget.take(cost(record.code, record.body), "its index")
        self._learn(record.code, record.body)
        if record.code == Opcode.STATISTICS:
            found = parsed(Statistics, record.body).channel_message_counts
            known = self._topics.keys() & found.keys()
            self.counts = {self._topics[n]: found[n] for n in known}
        elif record.code == Opcode.CHUNK_INDEX:
            index = parsed(ChunkIndex, record.body)
            self.chunks.append(
                ChunkAt(
                    index.chunk_start_offset,
                    index.message_start_time,
                    index.message_end_time,
                    frozenset(index.message_index_offsets),
                )
            )
        elif record.code == Opcode.ATTACHMENT_INDEX:
            index = parsed(AttachmentIndex, record.body)
            self._attached[index.name] = index.offset
        elif record.code == Opcode.METADATA_INDEX:
            at = parsed(MetadataIndex, record.body).offset
            self._take(record_at(self._file, at, self._size))
        elif record.code == Opcode.METADATA:
            found = parsed(Metadata, record.body)
            if found.name == "kappaskin":
                self.format = _number(found.metadata, "format", FORMAT)
                self.revision = _number(found.metadata, "revision", 0)
        elif record.code == Opcode.ATTACHMENT:
            self._attached[parsed(Attachment, record.body).name] = record.at
        elif record.code == Opcode.CHUNK:
            self._count(record)

    def _count(self, record: McapRecord) -> None:
        """Take a chunk of a file without a summary."""
        chunk, counts = parsed(Chunk, record.body), Counter[str]()
        for message in self._messages_in(record):
            counts[message.topic] += 1
        channels = frozenset(n for n, topic in self._topics.items() if topic in counts)
        self.chunks.append(
            ChunkAt(record.at, chunk.message_start_time, chunk.message_end_time, channels)
        )
        self.counts = dict(Counter(self.counts) + counts)

    def _learn(self, code: int, body: bytes) -> None:
        """Add a channel."""
        if code == Opcode.SCHEMA:
            schema = parsed(Schema, body)
            self._schemas[schema.id] = schema.name
        elif code == Opcode.CHANNEL:
            channel = parsed(Channel, body)
            finger, topic = finger_of(channel.topic)
            kind = _KINDS.get(topic)
            if (kind, channel.message_encoding) == (self._schemas.get(channel.schema_id), "cdr"):
                if self.any_finger and not self._fingers:
                    self.finger = finger
                self._fingers[finger] = None
                if finger == self.finger:
                    self._topics[channel.id] = topic

    # Without a summary.

    def _scan(self) -> None:
        """Scan the file up to where it breaks off."""
        self.counts, self.chunks, at = {}, [], len(MAGIC)
        try:
            while at < self._size:
                record = record_at(self._file, at, self._size)
                if record.code in (Opcode.DATA_END, Opcode.FOOTER):
                    break
                self._take(record)
                at = record.end
        except CorruptRecord:
            return

    # Contents.

    @property
    def made_by(self) -> str:
        """The program that recorded it, and the revision of its estimates."""
        return made_by(self.library, self.revision)

    @cached_property
    def first(self) -> int:
        return min((chunk.first for chunk in self.chunks), default=0)

    @cached_property
    def last(self) -> int:
        return max((chunk.last for chunk in self.chunks), default=0)

    def seconds(self, stamp: int) -> float:
        """The time of a `stamp`, in s since the recording began."""
        return (stamp - self.first) / 1e9

    def devices(self) -> Iterator[tuple[float, str]]:
        """The information texts of devices, each with its time in s since the recording began."""
        return self._texts(DEVICE)

    def setups(self) -> Iterator[tuple[float, str]]:
        """The setups as text, each with its time in s since the recording began."""
        return self._texts(SETUP)

    def _texts(self, topic: Topic) -> Iterator[tuple[float, str]]:
        for message in self.messages_on(topic):
            yield self.seconds(message.stamp), decode(STRING, message.data)["data"]

    def events(self) -> Iterator[Event]:
        """The events, their times in s since the recording began."""
        for message in self.messages_on(EVENTS):
            yield event_of(message, self.seconds(message.stamp))

    def lines(self) -> Iterator[tuple[float, bool, bytes]]:
        """Host time in s of bytes on the line, whether they were sent to the device, and those."""
        for message in self.messages_on(LINES):
            yield unpack_line(message.data)

    def messages(self, chunk: int = 0) -> Iterator[RecordedMessage]:
        """The messages from the chunk of that number on, in the order in which they were written.

        A `Refusal` at the first chunk that is damaged.
        """
        for place in self.chunks[chunk:]:
            yield from self.messages_of(place)

    def messages_on(self, *topics: Topic) -> Iterator[RecordedMessage]:
        """The messages of these topics; chunks without any of them are not read."""
        names = {topic.name for topic in topics}
        channels = {n for n, topic in self._topics.items() if topic in names}
        for chunk in self.chunks:
            if not channels.isdisjoint(chunk.channels):
                yield from (m for m in self.messages_of(chunk) if m.topic in names)

    def last_before(self, topic: Topic, stamp: int) -> RecordedMessage | None:
        """The last message of a topic up to `stamp`."""
        channels = {n for n, name in self._topics.items() if name == topic.name}
        for chunk in reversed(self.chunks):
            if chunk.first <= stamp and not channels.isdisjoint(chunk.channels):
                found = [
                    message
                    for message in self.messages_of(chunk)
                    if message.topic == topic.name and message.stamp <= stamp
                ]
                if found:
                    return found[-1]
        return None

    def messages_of(self, chunk: ChunkAt) -> Iterator[RecordedMessage]:
        """The messages of one chunk."""
        try:
            record = record_at(self._file, chunk.at, self._size)
            if record.code != Opcode.CHUNK:
                raise CorruptRecord("its index is wrong")
            yield from self._messages_in(record)
        except OSError as error:
            raise Refusal(
                f"{self.path}: can no longer be read ({error.strerror or error}); check that it "
                "still exists"
            ) from error
        except CorruptRecord as fault:
            raise Damaged(
                f"{self.path}: is damaged at byte {chunk.at} ({fault}); `kappaskin repair` saves "
                "the intact messages"
            ) from fault

    def _messages_in(self, chunk: McapRecord) -> Iterator[RecordedMessage]:
        """The messages of a chunk; what is read for the first time is counted in the budget."""
        counted = self._counted.get(chunk.at, 0)
        data = unpacked(chunk.body, None if chunk.at in self._counted else self.budget)
        self._counted[chunk.at] = counted
        for number, (code, body) in enumerate(records_in(data)):
            if number >= counted:
                self.budget.take(cost(code, body), "the number of its records")
                self._counted[chunk.at] = number + 1
            if code == Opcode.MESSAGE and len(body) >= MESSAGE_HEADER.size:
                channel, _, stamp, _ = MESSAGE_HEADER.unpack_from(body)
                if topic := self._topics.get(channel):
                    yield RecordedMessage(topic, stamp, body[MESSAGE_HEADER.size :])
            else:
                self._learn(code, body)

    @property
    def attachments(self) -> tuple[str, ...]:
        """The names of the files in it."""
        at = f"{self.finger}/" if self.finger else ""
        return tuple(name.removeprefix(at) for name in self._attached if name.startswith(at))

    def attachment(self, name: str) -> bytes:
        """The file called `name`."""
        try:
            full = f"{self.finger}/{name}" if self.finger else name
            record = record_at(self._file, self._attached[full], self._size)
            if record.code != Opcode.ATTACHMENT:
                raise CorruptRecord("its index is wrong")
            return parsed(Attachment, record.body).data
        except KeyError as error:
            raise Refusal(f"{self.path}: has no attachment {name!r:.80}") from error
        except CorruptRecord as fault:
            raise Refusal(f"{self.path}: {name!r:.80} in it is damaged ({fault})") from fault

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> "Recording":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def made_by(library: str = PROGRAM, revision: int = REVISION) -> str:
    """A program and its `revision` of the estimates, as text; of this one if left out."""
    return f"{library or 'unknown'!s:.60}, revision {revision or 'unknown'}"


def event_of(message: RecordedMessage, time: float) -> Event:
    """The event that a message is, at a `time` in s."""
    fields = decode(LOG, message.data)
    return Event(time, fields["name"], fields["msg"])


def _number(metadata: dict[str, str], name: str, unknown: int) -> int:
    text = metadata.get(name, "")
    return int(text[:_DIGITS]) if text.isascii() and text.isdigit() else unknown


def contacts_in(path: Path) -> Iterator[tuple[float, Array, dict[str, Array]]]:
    """Length of a recording in s, times (T,) in it and the fields (T, ...) of contacts, by name.

    In parts of some thousand contacts, as `CONTACT` has them. A `Refusal` for a file that is no
    recording.
    """
    with Recording(path) as recording:
        messages = recording.messages_on(CONTACTS)
        while True:
            part = list(islice(messages, _AT_ONCE))
            found = [decode(CONTACT, message.data) for message in part]
            names = [name for name in (found[0] if found else ()) if name != "header"]
            fields = {name: np.array([each[name] for each in found]) for name in names}
            times = [recording.seconds(message.stamp) for message in part]
            yield recording.seconds(recording.last), np.array(times), fields
            if len(part) < _AT_ONCE:
                return
