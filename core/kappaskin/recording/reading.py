"""MCAP files to the messages in them: whole ones, unfinished ones, and none of what is not one."""

import struct
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

from kappaskin.errors import Damaged, Refusal
from kappaskin.recording.messages import TOPICS, Topic
from kappaskin.recording.records import (
    MAGIC,
    Record,
    Spoilt,
    check_file,
    parsed,
    record_at,
    records_in,
    summary_of,
    unpacked,
)
from kappaskin.recording.writing import FORMAT

_MESSAGE = struct.Struct("<HIQQ")
_DIGITS = 9  # of a version
_KINDS = {topic.name: topic.kind.name for topic in TOPICS}


class Message(NamedTuple):
    """What one message says: when it was logged in ns since 1970, and its bytes."""

    topic: str
    stamp: int
    data: bytes


class ChunkAt(NamedTuple):
    """Where a chunk begins, the first and last time in it, in ns since 1970, and its channels."""

    at: int
    first: int
    last: int
    channels: frozenset[int]


class Recording:
    """The recording at `path`, open until `close`; a `Refusal` when it is none.

    `whole` says whether it was ended as it should be; one that was not is read up to where it
    breaks off. `first` and `last` are the times it spans, in ns since 1970, `counts` how many
    messages each topic has, and `chunks` where they are.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        check_file(path)
        try:
            self._file = path.open("rb")
            self._size = self._file.seek(0, 2)
            self._file.seek(0)
            magic = self._file.read(len(MAGIC))
        except OSError as error:
            raise Refusal(
                f"{path}: cannot be read ({error.strerror or error}); expected a recording"
            ) from error
        self.library = ""
        self.format = FORMAT  # where that was lost with the beginning of the file
        self.counts: dict[str, int] = {}
        self.chunks: list[ChunkAt] = []
        self._topics: dict[int, str] = {}
        self._schemas: dict[int, str] = {}
        self._attached: dict[str, int] = {}
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
                f"{self.path}: expected a recording (an MCAP file), got {magic!r}; "
                "`kappaskin record` makes one"
            )
        try:
            record = record_at(self._file, len(MAGIC), self._size)
            self.library = parsed(Header, record.body).library
        except Spoilt as fault:
            raise Damaged(f"{self.path}: is no recording: {fault}") from fault

    def _check_format(self) -> None:
        if self.format > FORMAT:
            raise Refusal(
                f"{self.path}: expected a recording of format {FORMAT}, got {self.format}, of a "
                "later version; update this program"
            )
        if not self._topics and self.library.startswith("kappaskin"):
            raise Damaged(
                f"{self.path}: expected messages, got none up to where it breaks off; `kappaskin "
                "repair` saves what is whole beyond"
            )
        if not self._topics:
            raise Refusal(
                f"{self.path}: expected a recording of this program, got an MCAP file of "
                f"{self.library or 'another'!r:.60}"
            )

    # What a file says of itself at its end.

    def _summarised(self) -> bool:
        """Take what the end says, if the file has one."""
        try:
            for record in list(summary_of(self._file, self._size)):
                self._take(record)
            return bool(self.chunks)
        except Spoilt:
            return False

    def _take(self, record: Record) -> None:
        """Take in a record of the end, or one of the body outside of its chunks."""
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
                self.format = _format(found.metadata)
        elif record.code == Opcode.ATTACHMENT:
            self._attached[parsed(Attachment, record.body).name] = record.at
        elif record.code == Opcode.CHUNK:
            self._count(record)

    def _count(self, record: Record) -> None:
        """Take in a chunk of a file that does not say at its end what is in it."""
        chunk, counts = parsed(Chunk, record.body), Counter[str]()
        for message in self._messages_in(unpacked(record.body)):
            counts[message.topic] += 1
        channels = frozenset(n for n, topic in self._topics.items() if topic in counts)
        self.chunks.append(
            ChunkAt(record.at, chunk.message_start_time, chunk.message_end_time, channels)
        )
        self.counts = dict(Counter(self.counts) + counts)

    def _learn(self, code: int, body: bytes) -> None:
        """Learn of a channel."""
        if code == Opcode.SCHEMA:
            schema = parsed(Schema, body)
            self._schemas[schema.id] = schema.name
        elif code == Opcode.CHANNEL:
            channel = parsed(Channel, body)
            ours = _KINDS.get(channel.topic) == self._schemas.get(channel.schema_id)
            if ours and channel.message_encoding == "cdr":
                self._topics[channel.id] = channel.topic

    # Without an end.

    def _scan(self) -> None:
        """Go through the file up to where it breaks off."""
        self.counts, self.chunks, at = {}, [], len(MAGIC)
        try:
            while at < self._size:
                record = record_at(self._file, at, self._size)
                if record.code in (Opcode.DATA_END, Opcode.FOOTER):
                    break
                self._take(record)
                at = record.end
        except Spoilt:
            return

    # What is in it.

    @property
    def first(self) -> int:
        return min((chunk.first for chunk in self.chunks), default=0)

    @property
    def last(self) -> int:
        return max((chunk.last for chunk in self.chunks), default=0)

    def messages(self, chunk: int = 0) -> Iterator[Message]:
        """The messages from the chunk of that number on, in the order in which they were written.

        A `Refusal` at the first chunk that is damaged.
        """
        for place in self.chunks[chunk:]:
            yield from self.messages_of(place)

    def messages_on(self, *topics: Topic) -> Iterator[Message]:
        """The messages of these topics, without a look at what has none of them."""
        names = {topic.name for topic in topics}
        channels = {n for n, topic in self._topics.items() if topic in names}
        for chunk in self.chunks:
            if not channels.isdisjoint(chunk.channels):
                yield from (m for m in self.messages_of(chunk) if m.topic in names)

    def last_before(self, topic: Topic, stamp: int) -> Message | None:
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

    def messages_of(self, chunk: ChunkAt) -> Iterator[Message]:
        """The messages of one chunk."""
        try:
            record = record_at(self._file, chunk.at, self._size)
            if record.code != Opcode.CHUNK:
                raise Spoilt("its index is wrong")
            yield from self._messages_in(unpacked(record.body))
        except OSError as error:
            raise Refusal(
                f"{self.path}: cannot be read any more ({error.strerror or error}); is it still "
                "there?"
            ) from error
        except Spoilt as fault:
            raise Damaged(
                f"{self.path}: is damaged at byte {chunk.at} ({fault}); `kappaskin repair` saves "
                "what is whole"
            ) from fault

    def _messages_in(self, data: bytes) -> Iterator[Message]:
        for code, body in records_in(data):
            if code == Opcode.MESSAGE and len(body) >= _MESSAGE.size:
                channel, _, stamp, _ = _MESSAGE.unpack_from(body)
                if topic := self._topics.get(channel):
                    yield Message(topic, stamp, body[_MESSAGE.size :])
            else:
                self._learn(code, body)

    @property
    def attachments(self) -> tuple[str, ...]:
        """The names of the files in it."""
        return tuple(self._attached)

    def attachment(self, name: str) -> bytes:
        """The file called `name`."""
        try:
            record = record_at(self._file, self._attached[name], self._size)
            if record.code != Opcode.ATTACHMENT:
                raise Spoilt("its index is wrong")
            return parsed(Attachment, record.body).data
        except KeyError as error:
            raise Refusal(f"{self.path}: has no attachment {name!r:.80}") from error
        except Spoilt as fault:
            raise Refusal(f"{self.path}: {name!r:.80} in it is damaged ({fault})") from fault

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> "Recording":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _format(said: dict[str, str]) -> int:
    text = said.get("format", "")
    return int(text[:_DIGITS]) if text.isascii() and text.isdigit() else FORMAT
