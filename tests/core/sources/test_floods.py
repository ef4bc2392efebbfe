"""Floods: whatever comes, the work for each byte and the time of each read are bounded."""

import itertools
import json
import random
import threading
import time
import tracemalloc
import zlib
from binascii import crc_hqx
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing

import numpy as np
import pytest

from kappaskin import SourceError, load_scene
from kappaskin.sources import Decoder, SerialSource, decoder, information, ports, wire
from kappaskin.sources.serial_source import _SLOW
from kappaskin.sources.wire import (
    HEAD,
    LONGEST,
    Command,
    Fault,
    MessageKind,
    Operation,
    encode,
    encode_information,
    encode_reply,
    encode_samples,
)

MOST_SUMMED = 600
"""Bytes that a checksum may go over for each byte that comes."""


def header(length: int, sequence: int = 0, kind: int = MessageKind.SAMPLES) -> bytes:
    """A valid header of a message that does not follow."""
    fields = wire.MAGIC, wire.VERSION, kind, length, sequence, 0
    checked = wire.HEADER.pack(*fields, 0)[: wire.CHECKED]
    return wire.HEADER.pack(*fields, crc_hqx(checked, 0))


def scan(sequence: int, channels: int = 4) -> bytes:
    counts = np.arange(channels, dtype=np.int32)
    return encode_samples(sequence, 0.0, np.arange(channels), counts, 2)


def headers(length_of: Callable[[int], int], count: int = 30_000) -> bytes:
    return b"".join(header(length_of(q), q) for q in range(count))


def nested(depth: int) -> bytes:
    """Headers each of which announces all that follows."""
    return b"".join(header((depth - q) * HEAD, q) for q in range(depth))


DRAW = random.Random(5)

FLOODS = {
    "headers of the longest messages": headers(lambda _: LONGEST),
    "headers of any length": headers(lambda _: DRAW.randrange(LONGEST + 1)),
    "headers at two blocks": headers(lambda q: 2 * 2048 - 26 + q % 2),
    "headers just above one block": headers(lambda _: 2048 - 25),
    "headers just below one block": headers(lambda _: 2048 - 26),
    "nested headers": nested(10_000) + bytes(HEAD),
    "headers of half a message": header(LONGEST) + bytes(LONGEST // 2),
    "valid messages between headers": b"".join(header(LONGEST) + scan(q) for q in range(8000)),
    "empty messages": b"".join(encode(MessageKind.SAMPLES, q, 0.0, b"") for q in range(8000)),
    "scans of no channel": b"".join(scan(q, 0) for q in range(8000)),
    "replies": b"".join(
        encode_reply(q, 0.0, Command(q, Operation.PING, b""), data=b"\0" * 10) for q in range(8000)
    ),
    "descriptions": b"".join(encode_information(q, 0.0, "{}") for q in range(8000)),
    "first bytes": wire.MAGIC * 100_000,
    "half of the first bytes": wire.MAGIC[:1] * 200_000,
    "text without a line's end": b"hello world " * 20_000,
    "zeros": bytes(300_000),
    "noise": DRAW.randbytes(300_000),
}


@pytest.fixture
def summed(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of bytes that checksums were computed of."""
    spent: list[int] = []
    for name, real in (("crc32", zlib.crc32), ("crc_hqx", crc_hqx)):

        def counting(data: bytes, value: int = 0, real: Callable[..., int] = real) -> int:
            spent.append(len(data))
            return real(data, value)

        monkeypatch.setattr(decoder, name, counting)
    return spent


@pytest.mark.parametrize("flood", FLOODS)
def test_no_byte_is_summed_more_than_so_many_times(flood: str, summed: list[int]) -> None:
    stream, one = FLOODS[flood], Decoder()
    for at in range(0, len(stream), 1000):
        one.feed(stream[at : at + 1000])
        assert sum(summed) <= MOST_SUMMED * (at + 1000)
        assert one.accounting().buffered <= LONGEST + HEAD + 4 + 1000
    assert one.accounting().balanced


@pytest.mark.parametrize("size", [1, 7, HEAD])
def test_what_is_held_is_not_copied_at_every_small_read(size: int) -> None:
    one = Decoder()
    one.feed(headers(lambda _: LONGEST, LONGEST // HEAD))
    more = headers(lambda _: LONGEST, 200_000 // HEAD)
    began = time.process_time()
    for at in range(0, len(more), size):
        one.feed(more[at : at + size])
    assert time.process_time() - began < 0.1 + 20e-6 * len(more) / min(size, HEAD)


def test_a_list_of_more_channels_than_a_payload_has_is_not_expanded(monkeypatch) -> None:
    expanded: list[int] = []
    real = np.repeat
    monkeypatch.setattr(np, "repeat", lambda a, n: expanded.append(int(np.sum(n))) or real(a, n))
    one = Decoder()
    for q in range(100):
        payload = b"\2\2" + q.to_bytes(2, "little") + b"\xff\xff\0\0\xff\xff"
        assert one.feed(encode(MessageKind.SAMPLES, q, 0.0, payload)) == []
    assert dict(one.accounting().discarded) == {"content": one.accounting().bytes_in}
    assert expanded == []


def found_one_by_one(stream: bytes) -> list[int]:
    """The sequence numbers of the messages in `stream`, each checksum computed anew."""
    at, found = 0, list[int]()
    while at + HEAD <= len(stream):
        length, sequence = wire.HEADER.unpack_from(stream, at)[3:5]
        stop = at + HEAD + length + 4
        if not stream.startswith(header(length, sequence), at) or length > LONGEST:
            at += 1
        elif stop > len(stream):
            break
        elif zlib.crc32(stream[at : stop - 4]) != int.from_bytes(stream[stop - 4 : stop], "little"):
            at += 1
        else:
            found.append(sequence)
            at = stop
    return found


def pieces(stream: bytes, draw: random.Random) -> Iterable[bytes]:
    at = 0
    while at < len(stream):
        size = draw.choice([1, 22, 512, 4096, 65536])
        yield stream[at : at + size]
        at += size


@pytest.mark.cases("5]", "8]", "11]")
@pytest.mark.parametrize("seed", range(12))
def test_the_true_messages_in_a_flood_are_those_that_summing_each_anew_finds(seed: int) -> None:
    draw, parts = random.Random(seed), list[bytes]()
    for q in range(200):
        n = draw.choice([0, 4, 300, 1013, 1014, 1015, 5000])
        parts.append(draw.choice([scan(q, n), scan(q, n)[:-1], header(draw.randrange(30_000), q)]))
    stream = b"".join(parts) + bytes(30_100)

    one, found = Decoder(), list[int]()
    for piece in pieces(stream, draw):
        found += [message.sequence for message in one.feed(piece)]
        assert one.accounting().balanced

    assert len(found) > 20
    assert found == found_one_by_one(stream)


# The source


SENSOR = load_scene("centre").sensor()
DESCRIBED = json.loads(information.sensor_to_json(SENSOR))


def described(number: int) -> bytes:
    """The description of a device of this firmware."""
    return encode_information(number, 0.0, json.dumps(DESCRIBED | {"firmware": str(number)}))


def refused(number: int) -> bytes:
    command = Command(number, Operation.RATE, b"")
    return encode_reply(number, 0.0, command, Fault.NOT_NOW, b"not now, %d" % number)


class FakePort:
    """A port on which the device sends `pieces`, as fast as they are read."""

    baudrate = in_waiting = 4096

    def __init__(self, pieces: Iterator[bytes]) -> None:
        self._pieces = pieces

    def read(self, _: int) -> bytes:
        time.sleep(1e-5)
        return next(self._pieces)

    def write(self, data: bytes) -> int:
        return len(data)

    def close(self) -> None:
        self._pieces = iter(lambda: b"", None)


def endless(message: Callable[[int], bytes], first: bytes = b"") -> Iterator[bytes]:
    yield first
    for q in itertools.count(1):
        yield b"".join(map(message, range(q * 20, q * 20 + 20)))


SENT = {
    "headers": lambda q: header(LONGEST, q),
    "descriptions": described,
    "refusals": refused,
    "scans": lambda q: scan(q, SENSOR.channels),
    "scans of no channel": lambda q: scan(q, 0),
    "restarts": lambda q: scan(q * 2**20 if q % 2 else 0, 1),
}


@pytest.mark.parametrize("sent", SENT)
def test_no_read_of_a_flood_takes_long_or_leaves_more_than_a_backlog(
    sent: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ports, "_BACKLOG", 2**20)
    port = FakePort(endless(SENT[sent], described(0)))
    monkeypatch.setattr(ports, "open_port", lambda *_: port)
    spent, events = list[float](), 0
    tracemalloc.start()
    with closing(SerialSource("a port")) as source:
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            began = time.thread_time()
            source.read(0.01)
            spent.append(time.thread_time() - began)
            events += len(source.events())
        counts = source.accounting()
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()

    assert counts.balanced
    assert counts.bytes_in > 1000
    assert max(spent) < 0.5
    assert most < 2**26
    assert events < 400


def test_descriptions_that_change_all_the_time_are_taken_twice_a_second(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ports, "open_port", lambda *_: FakePort(endless(described)))
    seen = set[int]()
    with closing(SerialSource("a port")) as source:
        end = time.monotonic() + 1.3
        while time.monotonic() < end:
            source.read(0.01)
            seen.add(id(source.sensor))
    assert 2 <= len(seen - {id(None)}) <= 4


# A port that takes long to open


@pytest.fixture
def door(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Ports open once this is set, and are refused where its `refusal` is."""
    door = threading.Event()
    door.refusal = ""  # pyright: ignore[reportAttributeAccessIssue]

    def opened(*_: object) -> FakePort:
        door.wait(20.0)
        if door.refusal:  # pyright: ignore[reportAttributeAccessIssue]
            raise SourceError(door.refusal)  # pyright: ignore[reportAttributeAccessIssue]
        return FakePort(endless(lambda q: scan(q, SENSOR.channels), described(0)))

    monkeypatch.setattr(ports, "open_port", opened)
    yield door
    door.set()


def test_a_port_that_takes_long_to_open_holds_nobody_up(door: threading.Event) -> None:
    late = 0.0
    began = time.monotonic()
    with closing(SerialSource("a port", lambda: time.monotonic() + late)) as source:
        assert source.read(0.01) == []
        assert source.trouble == ""
        late = _SLOW
        assert "not open after 8 s" in source.trouble
        assert time.monotonic() - began < 2.0
        door.set()
        end = time.monotonic() + 10.0
        while not source.read(0.02):
            assert time.monotonic() < end
        assert source.trouble == ""


@pytest.mark.full
def test_a_port_that_is_refused_late_is_tried_again(door, monkeypatch) -> None:
    with closing(SerialSource("a port")) as source:
        door.refusal = "a port: no server listens at this address"
        door.set()
        end = time.monotonic() + 10.0
        while not source.trouble:
            source.read(0.02)
            assert time.monotonic() < end
        assert source.trouble == "a port: no server listens at this address; retrying"
        assert source.events() == []
        door.clear()
        for _ in range(3):
            source.read(0.3)
            assert source.trouble == "a port: no server listens at this address; retrying"
        door.refusal = ""
        door.set()
        while not source.read(0.02):
            assert time.monotonic() < end


def test_a_port_that_opens_after_it_was_closed_is_closed(door, monkeypatch) -> None:
    closed = threading.Event()
    monkeypatch.setattr(FakePort, "close", lambda _: closed.set())
    began = time.monotonic()
    SerialSource("a port").close()
    assert time.monotonic() - began < 2.0
    door.set()
    assert closed.wait(10.0)
