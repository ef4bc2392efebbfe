"""Files of other programs: lines, tables and messages to rows of a described sensor."""

import importlib
import io
import math
import re
import sqlite3
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from kappaskin._files import Budget, check_memory, open_file
from kappaskin.errors import Refusal, lacking
from kappaskin.frames import Array
from kappaskin.recording.cdr import MessageType, decode
from kappaskin.recording.messages import STRING
from kappaskin.recording.reading import (
    LARGEST,
    MAGIC,
    MESSAGE_HEADER,
    CorruptRecord,
    McapRecord,
    cost,
    parsed,
    record_at,
    records_in,
    summary_of,
    unpacked,
)
from kappaskin.sources import Description

_DIMENSION = MessageType(
    "std_msgs/msg/MultiArrayDimension", "string label\nuint32 size\nuint32 stride"
)
_LAYOUT = MessageType(
    "std_msgs/msg/MultiArrayLayout",
    "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset",
    _DIMENSION,
)
_ARRAYS = {
    kind.name: kind
    for kind in (
        MessageType(
            f"std_msgs/msg/Float{bits}MultiArray",
            f"std_msgs/MultiArrayLayout layout\nfloat{bits}[] data",
            _LAYOUT,
        )
        for bits in (32, 64)
    )
}
_JSON = "json"
_TIME = "time"
_BLOCK = 2**20  # bytes of a table that are read at once
_MEMBER_HEAD = 2**16  # bytes of an array in an NPZ that say what it holds
_QUOTED = re.compile(rb'"([^",;\t]*)"')


class Row(NamedTuple):
    """A row: its record as text or bytes, the numbers of one, or why it is none.

    It is of the `time` in s, NaN where none comes with it; up to it a `share` of the file is read.
    """

    data: bytes | list[float] | str
    time: float
    share: float


def rows_of(file: Path, description: Description, topic: str) -> Iterator[Row]:
    """The rows of a `file`, or of a folder with a bag of ROS 2; of messages those of a `topic`.

    A `Refusal` where it is no file of that kind, or does not fit; other errors as the libraries
    that read it raise them.
    """
    if file.is_dir():
        parts = [part for part in file.iterdir() if part.suffix in _BAGS]
        parts.sort(key=lambda part: (part.suffix, len(part.name), part.name))
        if not parts or len({part.suffix for part in parts}) > 1:
            raise Refusal(
                f"{file}: expected a bag of ROS 2, with .mcap or .db3 files, got "
                f"{', '.join(sorted(part.name for part in file.iterdir())[:5]) or 'nothing'}; "
                "`ros2 bag convert` makes one of others"
            )
        yield from _message_rows(file, parts, description, topic)
        return
    with open_file(file) as opened:
        head = opened.read(len(_SQLITE))
    if head.startswith(b"#ROSBAG"):
        raise Refusal(
            f"{file}: expected a bag of ROS 2, got one of ROS 1; rosbags-convert mends it"
        )
    kind = next((kind for kind in _KINDS if head.startswith(kind)), b"")
    expected = next(
        (kind for kind, suffix in _KINDS.items() if suffix == file.suffix.lower()), kind
    )
    if kind != expected:
        raise Refusal(
            f"{file}: expected {_KINDS[expected]} contents, got "
            f"{_KINDS.get(kind) or f'others, which begin with {head[:8]!r}'}; check the name"
        )
    if topic and kind not in (MAGIC, _SQLITE):
        raise Refusal(f"{file}: expected no --topic, as it has no messages")
    if kind in (MAGIC, _SQLITE):
        yield from _message_rows(file, [file], description, topic)
    elif kind:
        yield from (_npz_rows if kind == _ZIP else _parquet_rows)(file, description)
    else:
        yield from _line_rows(file, description)


# Lines, or binary records


def _line_rows(file: Path, description: Description) -> Iterator[Row]:
    decoder, text = description.decoder(whole=True), description.kind != "binary"
    with open_file(file) as opened:
        size = max(opened.seek(0, 2), 1)
        opened.seek(0)
        if opened.read(2) in (b"\xff\xfe", b"\xfe\xff"):
            raise Refusal(f"{file}: expected text in UTF-8, got UTF-16; save it as UTF-8")
        opened.seek(0)
        if text and opened.read(3) != b"\xef\xbb\xbf":
            opened.seek(0)
        while line := decoder.next_of(opened):
            data: bytes | str = line
            if text and not line.endswith(b"\n"):
                data, more = line + b"\n", decoder.next_of(opened)
                if more:
                    data = "too long"
                while more and not more.endswith(b"\n"):
                    more = decoder.next_of(opened)
            if description.kind == "text" and isinstance(data, bytes) and b'"' in data:
                data = _QUOTED.sub(rb"\1", data)
            yield Row(data, math.nan, opened.tell() / size)


# Tables


class _Placement:
    """Where the numbers of tables stand in a record, by the `names` of their columns or in order.

    A table that is `timed` has times in s beside them. A `Refusal` where they do not fit.
    """

    def __init__(self, description: Description, names: Sequence[str], timed: bool) -> None:
        self._columns, self._rate = description.columns, description.rate
        own, readings = self._columns.names, self._columns.places.tolist()
        every = [n for n in range(len(own)) if not (timed and n == self._columns.time)]
        if all(own[place] in names for place in readings):
            self._places = [place for place in every if own[place] in names]
            self._among = [names.index(own[place]) for place in self._places]
        else:
            fitting = (places for places in (every, readings) if len(places) == len(names))
            if (found := next(fitting, None)) is None:
                raise Refusal(
                    f"expected {len(readings)} columns, one for each reading, or {len(every)}, for "
                    f"all columns of the description, got {len(names)}"
                )
            self._places, self._among = found, list(range(len(found)))
        self._needs_time = self._columns.time not in self._places
        if self._needs_time and not (timed or self._rate):
            raise Refusal(f"expected times in s in {_TIME!r}, got none; {NO_TIME}")

    def rows(self, values: NDArray[Any], times: Array | None, first: int) -> Iterator[Row]:
        """Those of `values` (n, K) at `times` (n,) in s, of which the first has a number."""
        columns, count = self._columns, len(values)
        numbers = np.zeros((count, len(columns)))
        numbers[:, self._places] = values[:, self._among]
        if times is None:
            times = np.arange(first, first + count) / (self._rate or math.nan)
        if self._needs_time and columns.time >= 0:
            numbers[:, columns.time] = times / columns.time_unit
        if columns.sequence >= 0 and columns.sequence not in self._places:
            numbers[:, columns.sequence] = np.arange(first, first + count)
        for row, time in zip(numbers.tolist(), times.tolist(), strict=True):
            usable = math.isfinite(time) or not self._needs_time
            yield Row(row if usable else "time or sequence: no time", time, 0.0)


NO_TIME = "give a column of time, or rate = 100, in records per second, in [line]"
"""What to do where a file has no times."""


def _table_rows(
    file: Path,
    description: Description,
    names: Sequence[str],
    total: int,
    blocks: Iterator[Mapping[str, NDArray[Any]]],
) -> Iterator[Row]:
    """The rows of a table of `total` rows with columns of these names, some at a time."""
    timed = _TIME in names
    rest = [name for name in names if name != _TIME]
    placement, first = _Placement(description, rest, timed), 0
    for block in blocks:
        for name, values in block.items():
            if values.dtype.kind not in ("fiuM" if name == _TIME else "fiu"):
                raise Refusal(f"{file}: expected numbers in {name!r:.60}, got {values.dtype}")
        times = _seconds(block[_TIME]) if timed else None
        values = np.column_stack([block[name].astype(float) for name in rest])
        for row in placement.rows(values, times, first):
            yield row._replace(share=first / max(total, 1))
        first += len(values)


def _seconds(times: NDArray[Any]) -> Array:
    """Times in s, of dates since 1970."""
    if times.dtype.kind == "M":
        missing = np.isnat(times)
        return np.where(missing, math.nan, times.astype("M8[ns]").astype(np.int64) * 1e-9)
    return times.astype(float)


class _Member:
    """An array in an NPZ, read from its first row on."""

    def __init__(self, archive: zipfile.ZipFile, name: str) -> None:
        with archive.open(f"{name}.npy") as member:
            head = io.BytesIO(member.read(_MEMBER_HEAD))
        first = np.lib.format.read_magic(head) == (1, 0)
        read = (
            np.lib.format.read_array_header_1_0 if first else (np.lib.format.read_array_header_2_0)
        )
        self.shape: tuple[int, ...]
        self.shape, columnwise, self.kind = read(head)
        if self.kind.hasobject or not self.kind.itemsize:
            raise Refusal(f"expected numbers in {name!r:.60}, got {self.kind}, which is never read")
        self.size = math.prod(self.shape) * self.kind.itemsize
        self._file, self._whole = archive.open(f"{name}.npy"), None
        self._file.read(head.tell())
        if columnwise and len(self.shape) > 1:
            check_memory(self.size, f"{name} in Fortran order")
            self._whole = self._read(self.size).reshape(self.shape, order="F")
        self._at = 0

    def _read(self, size: int) -> NDArray[Any]:
        data = self._file.read(size)
        if len(data) < size:
            raise EOFError("it is cut off")
        return np.frombuffer(data, self.kind)

    def next_rows(self, count: int) -> NDArray[Any]:
        """The next `count` rows."""
        self._at += count
        if self._whole is not None:
            return self._whole[self._at - count : self._at]
        each = self.shape[1:]
        return self._read(count * math.prod(each) * self.kind.itemsize).reshape(count, *each)


_VALUES = "values"


def _npz_rows(file: Path, description: Description) -> Iterator[Row]:
    columns = description.columns
    with open_file(file) as opened, zipfile.ZipFile(opened) as archive:
        there = [name.removesuffix(".npy") for name in archive.namelist()]
        wanted = (_VALUES,) if _VALUES in there else tuple(filter(None, columns.names))
        wanted = (*(name for name in dict.fromkeys((*wanted, _TIME)) if name in there),)
        if not set(wanted) - {_TIME}:
            raise Refusal(
                f"{file}: expected arrays values (T, columns) and time (T,), or one for each "
                f"column such as {columns.names[columns.places[0]]!r}, got "
                f"{', '.join(there)[:200] or 'none'}"
            )
        members = {name: _Member(archive, name) for name in wanted}
        budget = Budget(file, opened.seek(0, 2))
        for name, member in members.items():
            budget.take(member.size, f"{name} of shape {member.shape}")
        shapes = {name: member.shape for name, member in members.items()}
        total = next(iter(shapes.values()))[:1]
        if any(
            len(shape) != 1 + (name == _VALUES) or shape[:1] != total
            for name, shape in shapes.items()
        ):
            raise Refusal(f"{file}: expected arrays with a row for each time, got shapes {shapes}")
        yield from _npz_table(file, description, members, total[0])


def _npz_table(
    file: Path, description: Description, members: dict[str, _Member], total: int
) -> Iterator[Row]:
    wide = members[_VALUES].shape[1] if _VALUES in members else 0
    if wide == len(description.columns) and description.columns.time >= 0:
        members.pop(_TIME, None)  # it is among the values
    names = [f"column {n}" for n in range(wide)] or [name for name in members if name != _TIME]
    names += [_TIME] * (_TIME in members)
    step = max(_BLOCK // (8 * len(names)), 1)

    def blocks() -> Iterator[dict[str, NDArray[Any]]]:
        for first in range(0, total, step):
            count = min(step, total - first)
            block = {name: member.next_rows(count) for name, member in members.items()}
            if (values := block.pop(_VALUES, None)) is not None:
                block |= dict(zip(names, values.T, strict=False))
            yield block

    yield from _table_rows(file, description, names, total, blocks())


def _parquet_rows(file: Path, description: Description) -> Iterator[Row]:
    try:
        parquet: Any = importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        raise lacking("parquet", f"{file}: a .parquet file", error) from error
    with open_file(file) as opened, closing(parquet.ParquetFile(opened)) as table:
        names: list[str] = table.schema_arrow.names
        total: int = table.metadata.num_rows
        if len(set(names)) < len(names):
            raise Refusal(f"{file}: expected columns of different names, got one twice")
        Budget(file, opened.seek(0, 2)).take(8 * total * len(names), f"{total} rows")
        own = [name for name in names if not name.startswith("__index_level_")]  # those of pandas
        step = max(_BLOCK // (8 * max(len(own), 1)), 1)

        def blocks() -> Iterator[dict[str, NDArray[Any]]]:
            for batch in table.iter_batches(step, columns=own):
                arrays = (column.to_numpy(zero_copy_only=False) for column in batch.columns)
                yield dict(zip(own, arrays, strict=True))

        yield from _table_rows(file, description, own, total, blocks())


# Messages


class _Topic(NamedTuple):
    """A topic, the type of its messages, and how they are encoded."""

    name: str
    kind: str
    encoding: str


class _Message(NamedTuple):
    """A message of a topic, logged at `time` in ns since 1970, and its bytes; or only a fault."""

    topic: _Topic
    time: int
    data: bytes
    share: float
    fault: str = ""


class _McapBag:
    """Topics and messages of an MCAP file of any program."""

    def __init__(self, path: Path) -> None:
        self._path, self._file = path, open_file(path)
        self._size = self._file.seek(0, 2)
        self._budget = Budget(path, self._size)
        self._schemas: dict[int, str] = {}
        self._topics: dict[int, _Topic] = {}

    def topics(self) -> set[_Topic]:
        """Those of its summary, or without one of all its parts."""
        try:
            for record in summary_of(self._file, self._size):
                self._learn(record.code, record.body)
        except CorruptRecord:
            self._topics.clear()
        faults = [] if self._topics else [m.fault for m in self.messages() if m.fault]
        if faults and not self._topics:
            raise Refusal(f"{self._path}: is {faults[0]}")
        return set(self._topics.values())

    def _learn(self, code: int, body: bytes) -> None:
        self._budget.take(cost(code, body), "its records")
        if code == Opcode.SCHEMA:
            schema = parsed(Schema, body)
            self._schemas[schema.id] = schema.name
        elif code == Opcode.CHANNEL:
            found = parsed(Channel, body)
            kind = self._schemas.get(found.schema_id, "")
            self._topics[found.id] = _Topic(found.topic, kind, found.message_encoding)

    def messages(self) -> Iterator[_Message]:
        """All in the order of the file, up to where it is damaged."""
        at = len(MAGIC)
        try:
            while at < self._size:
                record = record_at(self._file, at, self._size)
                if record.code in (Opcode.DATA_END, Opcode.FOOTER):
                    return
                yield from self._messages_in(record)
                at = record.end
        except CorruptRecord as fault:
            why = f"damaged from here on: {fault}; `kappaskin repair` saves the intact messages"
            yield _Message(_Topic("", "", ""), 0, b"", 1.0, why)

    def _messages_in(self, record: McapRecord) -> Iterator[_Message]:
        inside: Iterator[tuple[int, bytes]] = iter([(record.code, record.body)])
        if record.code == Opcode.CHUNK:
            inside = records_in(unpacked(record.body, self._budget))
        for code, body in inside:
            if code != Opcode.MESSAGE or len(body) < MESSAGE_HEADER.size:
                self._learn(code, body)
                continue
            channel, _, time, _ = MESSAGE_HEADER.unpack_from(body)
            if topic := self._topics.get(channel):
                data = body[MESSAGE_HEADER.size :]
                yield _Message(topic, time, data, record.at / self._size)

    def close(self) -> None:
        self._file.close()


class _SqliteBag:
    """Topics and messages of a .db3 file of ROS 2."""

    def __init__(self, path: Path) -> None:
        uri = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
        self._database = sqlite3.connect(uri, uri=True)
        self._database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST)
        tables = "SELECT name FROM sqlite_master WHERE type = 'table'"  # a view may never end
        if not {"topics", "messages"} <= {name for (name,) in self._database.execute(tables)}:
            raise Refusal(f"{path}: expected tables topics and messages, as in a bag of ROS 2")
        found = self._database.execute("SELECT id, name, type, serialization_format FROM topics")
        self._topics = {n: _Topic(*map(str, rest)) for n, *rest in found}

    def topics(self) -> set[_Topic]:
        return set(self._topics.values())

    def messages(self) -> Iterator[_Message]:
        ((total,),) = self._database.execute("SELECT count(*) FROM messages")
        found = self._database.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id")
        for n, (topic, time, data) in enumerate(found):
            if topic in self._topics and isinstance(time, int) and isinstance(data, bytes):
                yield _Message(self._topics[topic], time, data, n / total)

    def close(self) -> None:
        self._database.close()


def _message_rows(
    file: Path, parts: Sequence[Path], description: Description, name: str
) -> Iterator[Row]:
    """The rows of one topic of a bag, whose files follow one another."""
    make: type[_McapBag | _SqliteBag] = _BAGS.get(parts[0].suffix, _McapBag)
    topics = set[_Topic]()
    for part in parts:
        with closing(make(part)) as bag:
            topics |= bag.topics()
    topic = _chosen(file, topics, description, name)
    read = _reader(topic, description)
    for n, part in enumerate(parts):
        with closing(make(part)) as bag:
            for message in bag.messages():
                share = (n + message.share) / len(parts)
                if message.fault:
                    yield Row(message.fault, math.nan, share)
                elif message.topic == topic:
                    yield read(message)._replace(share=share)


def _chosen(file: Path, topics: set[_Topic], description: Description, name: str) -> _Topic:
    """The topic called `name`, or the only one that fits."""
    named = [topic for topic in sorted(topics) if name in ("", topic.name)]
    arrays = [topic for topic in named if topic.encoding == "cdr" and topic.kind in _ARRAYS]
    if description.kind == _JSON:
        arrays += [topic for topic in named if topic.encoding == _JSON]
    texts = [t for t in named if t.kind == STRING.name and description.kind != "binary"]
    found = arrays or texts
    if len(found) == 1:
        return found[0]
    there = ", ".join(f"{t.name} ({t.kind or t.encoding})" for t in (found or sorted(topics))[:20])
    kinds = f"{', '.join(_ARRAYS)}, {STRING.name} or JSON"
    if len(found) > 1:
        raise Refusal(f"{file}: expected one topic, got {there}; choose by --topic NAME")
    raise Refusal(
        f"{file}: expected a topic {name + ' ' if name else ''}of {kinds} that fits the "
        f"description, got {there or 'no topic'}"
    )


def _reader(topic: _Topic, description: Description) -> Callable[[_Message], Row]:
    """What makes a row of each message of a topic."""
    kind, numbers = _ARRAYS.get(topic.kind), dict[int, int]()
    placements: dict[int, _Placement | str] = {}

    def row(message: _Message) -> Row:
        time = message.time * 1e-9
        if topic.encoding == _JSON:
            return Row(_one_line(message.data), time, 0.0)
        try:
            found = decode(kind or STRING, message.data)
        except Refusal as refusal:
            return Row(str(refusal), time, 0.0)
        if kind is None:
            return Row(_one_line(found["data"].encode()), time, 0.0)
        values = found["data"][found["layout.data_offset"] :]
        count = len(values)
        if count not in placements:
            timed = count < len(description.columns) or description.columns.time < 0
            try:
                placements[count] = _Placement(description, [""] * count, timed)
            except Refusal as refusal:
                placements[count] = f"wrong number of columns: {refusal}"
        placement = placements[count]
        if isinstance(placement, str):
            return Row(placement, time, 0.0)
        number = numbers[0] = numbers.get(0, -1) + 1
        return next(placement.rows(values[None], np.array([time]), number))

    return row


def _one_line(data: bytes) -> bytes:
    return data.replace(b"\n", b" ") + b"\n"


_ZIP, _SQLITE = b"PK\3\4", b"SQLite format 3\0"
_KINDS = {_ZIP: ".npz", b"PAR1": ".parquet", MAGIC: ".mcap", _SQLITE: ".db3"}
_BAGS = {".mcap": _McapBag, ".db3": _SqliteBag}
