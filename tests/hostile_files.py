"""Files of a few kilobytes that declare far more than they hold, each in another way.

`FILES` has a function for each, by name, that makes its bytes.
"""

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from functools import cache

import numpy as np
import zstandard
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer

from kappaskin import Setup, load_scene
from kappaskin.pipeline import setup_to_text
from kappaskin.recording.cdr import encode
from kappaskin.recording.messages import DEVICE, SETUP, STRING, TOPICS
from kappaskin.sources import sensor_to_json

_CHUNK = 2**26  # bytes, as large as one may be
_MAGIC = b"\x89MCAP0\r\n"
_SETUP = 1 + [topic.name for topic in TOPICS].index(SETUP.name)  # its channel


# NPZ


def _head(*shape: int) -> bytes:
    file = io.BytesIO()
    about = {"descr": "<f8", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, about)
    return file.getvalue()


def _npz(name: str, shape: tuple[int, ...], *, zeros: bool) -> bytes:
    """Readings whose array `name` has a `shape`: so many zeros, or a header and nothing."""
    rng, made = np.random.default_rng(0), io.BytesIO()
    arrays = {
        "size": np.array([0.02, 0.02]),
        "positions": rng.uniform(0.002, 0.018, (30, 2)),
        "curvature": rng.normal(size=(3, 30)),
    }
    np.savez(made, **{own: values for own, values in arrays.items() if own != name})
    with (
        zipfile.ZipFile(made, "a", zipfile.ZIP_DEFLATED) as archive,
        archive.open(f"{name}.npy", "w", force_zip64=True) as member,
    ):
        member.write(_head(*shape))
        for _ in range(int(np.prod(shape)) * 8 // 2**22 if zeros else 0):
            member.write(bytes(2**22))
    return made.getvalue()


def _long_header() -> bytes:
    """An array whose header is said to be 4 GB, of which there are 0.4."""
    made = io.BytesIO()
    with (
        zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("size.npy", "w", force_zip64=True) as member,
    ):
        member.write(b"\x93NUMPY\x02\x00" + struct.pack("<I", 2**32 - 1))
        for _ in range(100):
            member.write(b" " * 2**22)
    return made.getvalue()


# Recordings, record by record


def _record(code: int, body: bytes) -> bytes:
    return struct.pack("<BQ", code, len(body)) + body


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode()


_HEADER = _MAGIC + _record(Opcode.HEADER, _text("") + _text("kappaskin"))


def _definitions() -> bytes:
    """The schemas and channels of our recordings."""
    return b"".join(
        _record(
            Opcode.SCHEMA,
            struct.pack("<H", number)
            + _text(topic.kind.name)
            + _text("ros2msg")
            + struct.pack("<I", len(topic.kind.definition))
            + topic.kind.definition,
        )
        + _record(
            Opcode.CHANNEL,
            struct.pack("<HH", number, number)
            + _text(topic.name)
            + _text("cdr")
            + struct.pack("<I", 0),
        )
        for number, topic in enumerate(TOPICS, 1)
    )


def _chunk(data: bytes) -> bytes:
    packed = zstandard.ZstdCompressor(level=19).compress(data)
    head = struct.pack("<QQQI", 0, 1, len(data), zlib.crc32(data)) + _text("zstd")
    return _record(Opcode.CHUNK, head + struct.pack("<Q", len(packed)) + packed)


@cache
def _small_messages() -> bytes:
    """A chunk of two million messages."""
    body = struct.pack("<HIQQ", _SETUP, 0, 1000, 1000) + b"\0\1\0\0\1\0\0\0\0"
    message = _record(Opcode.MESSAGE, body)
    return _chunk(message * (_CHUNK // len(message)))


def _ended(body: bytes, summary: bytes) -> bytes:
    data = _HEADER + body + _record(Opcode.DATA_END, bytes(4))
    footer = _record(Opcode.FOOTER, struct.pack("<QQI", len(data), 0, 0))
    return data + summary + footer + _MAGIC


def _many_messages() -> bytes:
    return _HEADER + _chunk(_definitions()) + _small_messages() * 10


def _long_names() -> bytes:
    """Schemas, each with a name of a megabyte."""
    schemas = [
        _record(Opcode.SCHEMA, struct.pack("<H", 100 + n) + _text("x" * 10**6) + bytes(8))
        for n in range(60)
    ]
    return _HEADER + _chunk(_definitions()) + _chunk(b"".join(schemas)) * 12


def _one_metadata_often() -> bytes:
    """An index that names one large metadata record three thousand times."""
    pairs = b"".join(_text(f"{n}") + _text("") for n in range(10_000))
    record = _record(Opcode.METADATA, _text("other") + struct.pack("<I", len(pairs)) + pairs)
    where = struct.pack("<QQ", len(_HEADER), len(record)) + _text("other")
    return _ended(record, _record(Opcode.METADATA_INDEX, where) * 3000)


def _one_chunk_often() -> bytes:
    """An index that names one chunk five hundred times."""
    first, chunk = _chunk(_definitions()), _small_messages()

    def index(at: int, data: bytes) -> bytes:
        channels = struct.pack("<IHQQ", 10, _SETUP, 0, 0)
        where = struct.pack("<QQQQ", 0, 10**9, at, len(data)) + channels
        return _record(
            Opcode.CHUNK_INDEX, where + _text("zstd") + struct.pack("<QQ", len(data), _CHUNK)
        )

    at = len(_HEADER)
    indexes = index(at, first) + index(at + len(first), chunk) * 500
    return _ended(first + chunk, _definitions() + indexes)


def _nested_chunks() -> bytes:
    """What looks like three thousand chunks, each within the one before it."""
    packed = zstandard.ZstdCompressor(level=19).compress(bytes(_CHUNK))
    head = 9 + 28 + 8 + 8
    whole = 3000 * head + len(packed)
    heads = [
        struct.pack("<BQ", Opcode.CHUNK, whole - at - 9)
        + struct.pack("<QQQI", 0, 1, _CHUNK, 0)
        + _text("zstd")
        + struct.pack("<Q", whole - at - head)
        for at in range(0, 3000 * head, head)
    ]
    return _HEADER + b"\xff" * 20 + b"".join(heads) + packed


# Recordings of a sensor, with settings that ask for much


def _written(messages: Iterator[tuple[str, bytes]]) -> bytes:
    file = io.BytesIO()
    writer, channels = Writer(file, compression=CompressionType.ZSTD), dict[str, int]()
    writer.start("", "kappaskin")
    for topic in TOPICS:
        schema = writer.register_schema(topic.kind.name, "ros2msg", topic.kind.definition)
        channels[topic.name] = writer.register_channel(topic.name, "cdr", schema)
    for stamp, (topic, data) in enumerate(messages):
        writer.add_message(channels[topic], stamp, data, stamp)
    writer.finish()
    return file.getvalue()


def _set_up(count: int = 1, **settings: object) -> bytes:
    """A recording of one device and `count` setups with these `settings`."""
    text, _ = setup_to_text(Setup())
    setup = encode(STRING, {"data": json.dumps(json.loads(text) | settings)})
    device = encode(STRING, {"data": sensor_to_json(load_scene("centre").sensor())})
    return _written(iter([(DEVICE.name, device), *[(SETUP.name, setup)] * count]))


NPZ: dict[str, Callable[[], bytes]] = {
    "zeros": lambda: _npz("curvature", (10**6, 3, 30), zeros=True),
    "positions": lambda: _npz("positions", (40_000_000, 2), zeros=True),
    "sigma": lambda: _npz("sigma", (10**8,), zeros=True),
    "empty": lambda: _npz("curvature", (10**9, 3, 30), zeros=False),
    "long-header": _long_header,
}
READ: dict[str, Callable[[], bytes]] = {
    "many-messages": _many_messages,
    "long-names": _long_names,
    "one-metadata-often": _one_metadata_often,
    "one-chunk-often": _one_chunk_often,
}
"""Recordings that are refused by whatever reads them."""

REPAIRED: dict[str, Callable[[], bytes]] = {
    name: READ[name] for name in ("many-messages", "long-names", "one-chunk-often")
} | {"nested-chunks": _nested_chunks}
"""Recordings that are refused by repair."""

COMPUTED: dict[str, Callable[[], bytes]] = {
    "points": lambda: _set_up(nx=4096, ny=4096),
    "functions": lambda: _set_up(Ni=4096, Nj=4096, method="bayes"),
    "pairs": lambda: _set_up(Ni=64, Nj=64, method="tracking"),
    "setups": lambda: _set_up(20_000),
}
"""Recordings that are refused by whatever computes their estimates."""
