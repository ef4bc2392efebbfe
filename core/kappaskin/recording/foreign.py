"""Files of other programs: lines, tables and messages to rows of a described sensor."""

import math
import re
import sqlite3
import struct
import sys
import zipfile
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from functools import cache
from itertools import count, islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from kappaskin._files import ARCHIVE_DAMAGES, Budget, open_file
from kappaskin.errors import Damaged, Refusal, optional
from kappaskin.frames import Array
from kappaskin.recording.cdr import MessageType, decode
from kappaskin.recording.messages import STRING
from kappaskin.recording.reading import (
    LARGEST,
    MAGIC,
    MESSAGE_HEADER,
    CorruptRecord,
    Recording,
    cost,
    parsed,
    record_at,
    records_in,
    unpacked,
)
from kappaskin.sources import Description, Recogniser

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
_STEP = 1000  # rows of a table that are read at once
_FIRST, _LOOKED = 300, 20_000  # rows, and messages, by which an unknown file is known
_HEAD, _MOST = 2**19, 2**26  # bytes of them, of lines and of messages
_QUOTED = re.compile(rb'"([^",;\t]*)"')


class FileRow(NamedTuple):
    """A row: its record as text or bytes, the numbers of one, or why it is none.

    It is of the `time` in s, NaN where none comes with it; up to it a `share` of the file is read.
    """

    data: bytes | list[float] | str
    time: float
    share: float


def rows_of(file: Path, description: Description, topic: str, scratch: Path) -> Iterator[FileRow]:
    """The rows of a `file`, or of a folder with a ROS 2 bag; of messages those of a `topic`.

    Arrays are unpacked in the folder `scratch`. A `Refusal` where it is no file of that kind, or
    does not fit; other errors as the libraries that read it raise them.
    """
    if file.is_dir():
        yield from _message_rows(file, description, topic)
        return
    kind = _kind_of(file)
    if topic and kind not in (MAGIC, _SQLITE):
        raise Refusal(f"{file}: expected no --topic, as it has no messages")
    if kind in (MAGIC, _SQLITE):
        yield from _message_rows(file, description, topic)
    elif kind:
        blocks = _npz_blocks(file, description, scratch)
        made = blocks if kind == _ZIP else _parquet_blocks(file, _STEP)
        yield from _table_rows(file, description, made)
    else:
        yield from _line_rows(file, description)


def _kind_of(file: Path) -> bytes:
    """The first bytes that show what a file is, b"" of lines; a `Refusal` if its name differs."""
    with open_file(file) as opened:
        head = opened.read(len(_SQLITE))
    if head.startswith(b"#ROSBAG"):
        raise Refusal(f"{file}: expected a ROS 2 bag, got one of ROS 1; rosbags-convert mends it")
    kind = next((kind for kind in _KINDS if head.startswith(kind)), b"")
    expected = next(
        (kind for kind, suffix in _KINDS.items() if suffix == file.suffix.lower()), kind
    )
    if kind != expected:
        raise Refusal(
            f"{file}: expected {_KINDS[expected]} contents, got "
            f"{_KINDS.get(kind) or f'others, which begin with {head[:8]!r}'}; check the name"
        )
    return kind


# Lines, or binary records


def _line_rows(file: Path, description: Description) -> Iterator[FileRow]:
    decoder, text = description.decoder(whole=True), description.kind != "binary"
    with open_file(file) as opened:
        size = opened.seek(0, 2)
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
            yield FileRow(data, math.nan, opened.tell() / max(size, 1))
        if (read := opened.tell()) < size:
            raise Refusal(
                f"{file}: expected {size:,} bytes, as at the beginning, got {read:,}, as another "
                "program made it shorter; import it once none writes to it"
            )


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

    def rows(self, values: NDArray[Any], times: Array | None, first: int) -> Iterator[FileRow]:
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
            yield FileRow(row if usable else "time or sequence: no time", time, 0.0)


DAMAGES = (*ARCHIVE_DAMAGES, LookupError, TypeError, SyntaxError, struct.error, sqlite3.Error)
"""What libraries raise of files that are damaged."""

NO_TIME = "give a column of time, or rate = 100, in records per second, in [line]"
"""What to do where a file has no times."""


class _Block(NamedTuple):
    """Some rows of a table of `total` rows, by the names of its columns."""

    total: int
    columns: Mapping[str, NDArray[Any]]


def _table_rows(
    file: Path, description: Description, blocks: Iterable[_Block]
) -> Iterator[FileRow]:
    """The rows of a table, some at a time."""
    placement, first = None, 0
    for total, columns in blocks:
        timed = _TIME in columns
        rest = [name for name in columns if name != _TIME]
        placement = placement or _Placement(description, rest, timed)
        for name, values in columns.items():
            if values.dtype.kind not in ("fiuM" if name == _TIME else "fiu"):
                raise Refusal(f"{file}: expected numbers in {name!r:.60}, got {values.dtype}")
        times = _seconds(columns[_TIME]) if timed else None
        values = np.column_stack([columns[name].astype(float) for name in rest])
        for row in placement.rows(values, times, first):
            yield row._replace(share=first / total)
        first += len(values)


def _seconds(times: NDArray[Any]) -> Array:
    """Times in s, of dates since 1970."""
    if times.dtype.kind == "M":
        missing = np.isnat(times)
        return np.where(missing, math.nan, times.astype("M8[ns]").astype(np.int64) * 1e-9)
    return times.astype(float)


_VALUES = "values"


def _npz_blocks(file: Path, description: Description, scratch: Path) -> Iterator[_Block]:
    own = description.columns
    with open_file(file) as opened, zipfile.ZipFile(opened) as archive:
        there = [name.removesuffix(".npy") for name in archive.namelist()]
        wanted = (_VALUES,) if _VALUES in there else tuple(filter(None, own.names))
        wanted = [
            name for name in dict.fromkeys((*wanted, _TIME)) if f"{name}.npy" in archive.NameToInfo
        ]
        if not {*wanted} - {_TIME}:
            raise Refusal(
                f"{file}: expected arrays values (T, columns) and time (T,), or one for each "
                f"column such as {own.names[own.places[0]]!r}, got "
                f"{', '.join(there)[:200] or 'none'}"
            )
        size = sum(archive.getinfo(f"{name}.npy").file_size for name in wanted)
        Budget(file, opened.seek(0, 2)).take(size, f"its arrays {', '.join(wanted)[:40]}")
        # Mapped, since all of them may be more than the memory; pickles are refused.
        arrays: dict[str, NDArray[Any]] = {
            name: np.load(archive.extract(f"{name}.npy", scratch), mmap_mode="r") for name in wanted
        }
    shapes = {name: array.shape for name, array in arrays.items()}
    if len({shape[:1] for shape in shapes.values()}) > 1 or any(
        len(shape) != 1 + (name == _VALUES) for name, shape in shapes.items()
    ):
        raise Refusal(f"{file}: expected arrays with a row for each time, got shapes {shapes}")
    if _VALUES in arrays:
        values = arrays.pop(_VALUES)
        if values.shape[1] == len(own) and own.time >= 0:
            arrays.clear()  # the time is among the values
        arrays = {f"column {n}": column for n, column in enumerate(values.T)} | arrays
    total = len(next(iter(arrays.values()), ()))
    for first in range(0, total, _STEP):
        yield _Block(total, {name: array[first : first + _STEP] for name, array in arrays.items()})


def _parquet_blocks(file: Path, step: int) -> Generator[_Block]:
    """The columns of a Parquet table, `step` rows at a time."""
    parquet = optional("pyarrow.parquet", "parquet", f"{file}: a .parquet file")
    # Or all of the file would be in memory, not one group of rows.
    streamed = {"pre_buffer": False, "buffer_size": 2**16}
    with open_file(file) as opened, closing(parquet.ParquetFile(opened, **streamed)) as table:
        names: list[str] = table.schema_arrow.names
        total: int = table.metadata.num_rows
        if len(set(names)) < len(names):
            raise Refusal(f"{file}: expected columns of different names, got one twice")
        Budget(file, opened.seek(0, 2)).take(8 * total * len(names), f"{total} rows")
        own = [name for name in names if not name.startswith("__index_level_")]  # those of pandas
        for batch in table.iter_batches(step, columns=own):
            arrays = (column.to_numpy(zero_copy_only=False) for column in batch.columns)
            yield _Block(total, dict(zip(own, arrays, strict=True)))


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


def _mcap_messages(path: Path) -> Iterator[_Message]:
    """All of an MCAP file, in its order, up to where it is damaged."""
    schemas, topics, at = dict[int, str](), dict[int, _Topic](), len(MAGIC)
    with open_file(path) as file:
        size = file.seek(0, 2)
        budget = Budget(path, size)
        try:
            while at < size:
                record = record_at(file, at, size)
                if record.code in (Opcode.DATA_END, Opcode.FOOTER):
                    return
                inside = iter([(record.code, record.body)])
                if record.code == Opcode.CHUNK:
                    inside = records_in(unpacked(record.body, budget))
                for code, body in inside:
                    budget.take(cost(code, body), "the number of its records")
                    if code == Opcode.SCHEMA:
                        schema = parsed(Schema, body)
                        schemas[schema.id] = schema.name
                    elif code == Opcode.CHANNEL:
                        own = parsed(Channel, body)
                        kind = schemas.get(own.schema_id, "")
                        topics[own.id] = _Topic(own.topic, kind, own.message_encoding)
                    elif code == Opcode.MESSAGE and len(body) >= MESSAGE_HEADER.size:
                        channel, _, time, _ = MESSAGE_HEADER.unpack_from(body)
                        if topic := topics.get(channel):
                            yield _Message(topic, time, body[MESSAGE_HEADER.size :], at / size)
                at = record.end
        except CorruptRecord as fault:
            why = f"damaged from here on: {fault}; `kappaskin repair` saves the intact messages"
            yield _Message(_Topic("", "", ""), 0, b"", 1.0, why)


def _sqlite_messages(path: Path) -> Iterator[_Message]:
    """All of a .db3 file of ROS 2, and of its write-ahead log; nothing is written beside them."""
    log, index = (Path(f"{path.resolve()}{end}") for end in ("-wal", "-shm"))
    logged, used = log.exists() and log.stat().st_size > 0, index.exists()
    # A program that still writes has an index of the log, with its locks. Where there is none, only
    # a reader that has the file to itself makes none.
    how = "cache=private" if used else f"vfs={'win32' if sys.platform == 'win32' else 'unix'}-none"
    uri = f"{path.absolute().as_uri()}?mode=ro&{how if logged else 'immutable=1'}"
    with closing(sqlite3.connect(uri, uri=True)) as database:
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST)
        database.execute(f"PRAGMA locking_mode = {'NORMAL' if used else 'EXCLUSIVE'}")
        tables = "SELECT name FROM sqlite_master WHERE type = 'table'"  # a view may never end
        if not {"topics", "messages"} <= {name for (name,) in database.execute(tables)}:
            raise Refusal("expected tables topics and messages, as in a ROS 2 bag, got others")
        found = database.execute("SELECT id, name, type, serialization_format FROM topics")
        topics = {n: _Topic(*map(str, rest)) for n, *rest in found}
        ((total,),) = database.execute("SELECT count(*) FROM messages")
        found = database.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id")
        for n, (topic, time, data) in enumerate(found):
            if topic in topics and isinstance(time, int) and isinstance(data, bytes):
                yield _Message(topics[topic], time, data, n / max(total, 1))


def _messages(file: Path) -> Iterator[_Message]:
    """All of a file, or of a folder whose files follow one another."""
    parts = _parts_of(file) if file.is_dir() else [file]
    if not parts or len({part.suffix for part in parts}) > 1:
        raise Refusal(
            f"{file}: expected a ROS 2 bag, with .mcap or .db3 files, got "
            f"{', '.join(sorted(part.name for part in file.iterdir())[:5]) or 'nothing'}; "
            "`ros2 bag convert` makes one of others"
        )
    for n, part in enumerate(parts):
        for message in _BAGS[_kind_of(part)](part):
            yield message._replace(share=(n + message.share) / len(parts))


def _parts_of(folder: Path) -> list[Path]:
    """The files of a bag in a folder, in their order."""
    parts = [part for part in folder.iterdir() if part.suffix in map(_KINDS.get, _BAGS)]
    return sorted(parts, key=lambda part: (part.suffix, len(part.name), part.name))


def _message_rows(file: Path, description: Description, name: str) -> Iterator[FileRow]:
    """The rows of one topic of a bag."""
    found = list(dict.fromkeys((m.topic, m.fault) for m in _messages(file)))
    topics = {topic for topic, fault in found if not fault}
    if found and not topics:
        raise Refusal(f"{file}: is {found[0][1]}")
    topic = _chosen(file, topics, description, name)
    read = _reader(topic, description)
    for message in _messages(file):
        if message.fault:
            yield FileRow(message.fault, math.nan, message.share)
        elif message.topic == topic:
            yield read(message)._replace(share=message.share)


def _fitting(topics: Iterable[_Topic], kind: str = "") -> list[_Topic]:
    """Those whose messages may be records of this kind, or of any; texts if there are no others."""
    topics = sorted(topics)
    arrays = [topic for topic in topics if topic.encoding == "cdr" and topic.kind in _ARRAYS]
    if kind in ("", _JSON):
        arrays += [topic for topic in topics if topic.encoding == _JSON]
    return arrays or [t for t in topics if t.kind == STRING.name and kind != "binary"]


def _chosen(file: Path, topics: set[_Topic], description: Description, name: str) -> _Topic:
    """The topic called `name`, or the only one that fits."""
    found = _fitting((topic for topic in topics if name in ("", topic.name)), description.kind)
    if len(found) == 1:
        return found[0]
    if found:
        raise Refusal(f"{file}: expected one topic, got {_named(found)}; choose by --topic NAME")
    raise _no_topic(file, topics, name)


def _no_topic(file: Path, topics: Iterable[_Topic], name: str = "") -> Refusal:
    return Refusal(
        f"{file}: expected a topic {name + ' ' if name else ''}of {', '.join(_ARRAYS)}, "
        f"{STRING.name} or JSON that fits the description, got "
        f"{_named(sorted(topics)) or 'no topic'}"
    )


def _named(topics: Sequence[_Topic]) -> str:
    return ", ".join(f"{topic.name} ({topic.kind or topic.encoding})" for topic in topics[:20])


def _reader(topic: _Topic, description: Description) -> Callable[[_Message], FileRow]:
    """What makes a row of each message of a topic."""
    numbers = count()

    @cache
    def placement(width: int) -> _Placement:
        timed = width < len(description.columns) or description.columns.time < 0
        return _Placement(description, [""] * width, timed)

    def row(message: _Message) -> FileRow:
        time = message.time * 1e-9
        try:
            values = _contents(topic, message.data)
            if isinstance(values, bytes):
                return FileRow(values, time, 0.0)
            return next(placement(len(values)).rows(values[None], np.array([time]), next(numbers)))
        except Refusal as refusal:
            return FileRow(f"no record: {refusal}", time, 0.0)

    return row


def _contents(topic: _Topic, data: bytes) -> bytes | NDArray[Any]:
    """The numbers (K,) of a message, or its text as a line; a `Refusal` where it is none."""
    if topic.encoding == _JSON:
        return _one_line(data)
    found = decode(_ARRAYS.get(topic.kind, STRING), data)
    if topic.kind in _ARRAYS:
        return found["data"][found["layout.data_offset"] :]
    return _one_line(found["data"].encode())


def _one_line(data: bytes) -> bytes:
    return data.replace(b"\n", b" ") + b"\n"


_ZIP, _SQLITE = b"PK\3\4", b"SQLite format 3\0"
_KINDS = {_ZIP: ".npz", b"PAR1": ".parquet", MAGIC: ".mcap", _SQLITE: ".db3"}
_BAGS = {MAGIC: _mcap_messages, _SQLITE: _sqlite_messages}


# What an unknown file is


def is_foreign(file: Path) -> bool:
    """Whether this is a ROS 2 bag, its folder, or an MCAP file of another program."""
    try:
        if file.is_dir():
            return bool(_parts_of(file))
        if not file.is_file():  # a port that is opened may become this program's terminal
            return False
        if (kind := _kind_of(file)) == MAGIC:
            with Recording(file):
                return False
        return kind == _SQLITE
    except Refusal as refusal:
        return not isinstance(refusal, Damaged)
    except OSError:
        return False


class FileLines:
    """The first lines of a file, as `RawLines` has those of a board.

    Of arrays in an NPZ file and of a Parquet table they are the first rows; of a bag the messages
    of a `topic`, the first of its `topics` that have numbers if left out. It is `timed` where they
    are messages, each with a time.
    """

    baud = 115_200

    def __init__(self, file: Path, topic: str = "") -> None:
        self.url, self.topic, self.trouble = str(file), topic, ""
        self.topics: list[str] = []
        self.timed = False
        self.recogniser = Recogniser(arrived=False)
        try:
            for time, line in self._lines(file):
                self.recogniser.feed(time, line)
        except Refusal as refusal:
            self.trouble = f"{refusal}."
        except DAMAGES as error:
            self.trouble = f"{file}: cannot be read ({getattr(error, 'strerror', None) or error})."

    def poll(self) -> None:
        """Nothing: all has arrived."""

    def close(self) -> None:
        """Nothing is held open."""

    def _lines(self, file: Path) -> Iterator[tuple[float, bytes]]:
        """Lines, each with the time of its message in s."""
        if file.is_dir() or (kind := _kind_of(file)) in _BAGS:
            self.timed = True
            yield from self._message_lines(file)
        elif kind == _ZIP:
            yield 0.0, _npz_head(file)
        elif kind:
            with closing(_parquet_blocks(file, _FIRST)) as blocks:
                for _, columns in islice(blocks, 1):
                    rows = [
                        _seconds(values) if name == _TIME else values.astype(float)
                        for name, values in columns.items()
                    ]
                    yield 0.0, _text_of([*columns], np.column_stack(rows))
        else:
            with open_file(file) as opened:
                head = opened.read(_HEAD)
            yield 0.0, head if len(head) == _HEAD else head + b"\n"

    def _message_lines(self, file: Path) -> Iterator[tuple[float, bytes]]:
        found, size = dict[_Topic, list[_Message]](), 0
        for message in islice(_messages(file), _LOOKED):
            if message.fault and not found:
                raise Refusal(f"{file}: is {message.fault}")
            found.setdefault(message.topic, [])
            if _fitting([message.topic]):
                found[message.topic].append(message)
            if (size := size + len(message.data)) > _MOST:
                break
        fitting = _fitting(found)
        self.topics = [topic.name for topic in fitting]
        chosen = next((topic for topic in fitting if self.topic in ("", topic.name)), None)
        if chosen is None:
            raise _no_topic(file, found, self.topic)
        self.topic = chosen.name
        for message in found[chosen]:
            try:
                values = _contents(chosen, message.data)
            except Refusal:
                continue  # counted when it is imported
            line = values if isinstance(values, bytes) else _text_of([], values[None])
            yield message.time * 1e-9, line


def _npz_head(file: Path) -> bytes:
    """The first rows of arrays, as text below their names."""
    with open_file(file) as opened, zipfile.ZipFile(opened) as archive:
        names = [name for name in (_TIME, _VALUES) if f"{name}.npy" in archive.NameToInfo]
        parts = [_first_of(archive, name) for name in names]
    if not parts:
        raise Refusal(f"{file}: expected arrays values (T, columns) and time (T,), got others")
    heads = [name for name, part in zip(names, parts, strict=True) if part.shape[1] == 1]
    heads += [f"values[{n}]" for n in range(parts[-1].shape[1])] * (parts[-1].shape[1] > 1)
    return _text_of(heads, np.hstack(parts))


def _first_of(archive: zipfile.ZipFile, name: str) -> Array:
    """The first rows (n, K) of an array of numbers in an NPZ file, whatever its size."""
    form = np.lib.format
    with archive.open(f"{name}.npy") as opened:
        old = form.read_magic(opened) == (1, 0)
        read = form.read_array_header_1_0 if old else form.read_array_header_2_0
        shape, by_columns, kind = read(opened)
        if kind.kind not in "fiu" or by_columns or not 1 <= len(shape) <= 2:
            raise ValueError(f"expected numbers in rows in {name}, got {kind} of shape {shape}")
        columns = int(np.prod(shape[1:]))
        data = opened.read(min(_FIRST, shape[0]) * columns * kind.itemsize)
    return np.frombuffer(data, kind).reshape(-1, columns).astype(float)


def _text_of(names: Sequence[str], rows: Array) -> bytes:
    """Rows (n, K) as lines of text, below the names of their columns."""
    lines = [",".join(names)] * bool(names) + [",".join(map(repr, r)) for r in rows.tolist()]
    return "".join(f"{line}\n" for line in lines).encode()
