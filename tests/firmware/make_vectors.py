"""The bytes of `vectors.json`, made from the page alone: `python make_vectors.py > vectors.json`.

It shares no code with either implementation of the wire format, so that the three agree on what
the page says or one of them is wrong.
"""

import json
import struct
import zlib
from typing import Any

MAGIC = b"\x4b\xa7"
KINDS = {"information": 1, "samples": 2, "command": 3, "reply": 4}
NOISE = bytes.fromhex("00ff4ba74b0d0a4ba7014b")


def crc16(data: bytes) -> int:
    """The remainder of `data` by the polynomial 1021, bit after bit."""
    remainder = 0
    for bit in (byte >> n & 1 for byte in data for n in range(7, -1, -1)):
        remainder = (remainder << 1 & 0xFFFF) ^ 0x1021 * (remainder >> 15 ^ bit)
    return remainder


def header(
    kind: int, length: int, sequence: int, time: int, version: int = 1, magic: bytes = MAGIC
) -> bytes:
    bare = magic + struct.pack("<BBIIQ", version, kind, length, sequence, time)
    return bare + struct.pack("<H", crc16(bare))


def message(kind: int, payload: bytes, sequence: int, time: int, version: int = 1) -> bytes:
    data = header(kind, len(payload), sequence, time, version) + payload
    return data + struct.pack("<I", zlib.crc32(data))


def flipped(data: bytes, place: int, bit: int = 0) -> bytes:
    return data[:place] + bytes([data[place] ^ 1 << bit]) + data[place + 1 :]


def runs_bytes(runs: list[list[int]]) -> bytes:
    return bytes([len(runs)]) + b"".join(struct.pack("<HH", *run) for run in runs)


def samples(width: int, runs: list[list[int]], counts: list[int]) -> bytes:
    letter = {2: "h", 4: "i"}[width]
    return bytes([width]) + runs_bytes(runs) + struct.pack(f"<{len(counts)}{letter}", *counts)


# Each of these is a message's name, its kind, its number, its time and its fields.


def information(name: str, sequence: int, time: int, text: str) -> dict[str, Any]:
    whole = message(1, text.encode(), sequence, time)
    return said(name, "information", sequence, time, whole, text=text)


def sampled(
    name: str, sequence: int, time: int, width: int, runs: list[list[int]], counts: list[int]
) -> dict[str, Any]:
    whole = message(2, samples(width, runs, counts), sequence, time)
    fields = {"count_bytes": width, "runs": runs, "counts": counts}
    return said(name, "samples", sequence, time, whole, **fields)


def command(name: str, sequence: int, operation: int, arguments: bytes, **fields: Any) -> Any:
    whole = message(3, bytes([operation]) + arguments, sequence, time := 1000 * sequence)
    return said(name, "command", sequence, time, whole, operation=operation, arguments=fields)


def reply(
    name: str, sequence: int, answers: int, operation: int, status: int, data: bytes, **fields: Any
) -> Any:
    payload = struct.pack("<IBB", answers, operation, status) + data
    whole = message(4, payload, sequence, time := 1000 * sequence + 1)
    told = {"command_sequence": answers, "operation": operation, "status": status}
    return said(name, "reply", sequence, time, whole, **told, data=fields)


def said(name: str, kind: str, sequence: int, time: int, whole: bytes, **fields: Any) -> Any:
    about = {"name": name, "kind": kind, "sequence": sequence, "time": time}
    return about | fields | {"hex": whole.hex()}


def good() -> list[dict[str, Any]]:
    """Messages that are read as it says, and written so."""
    return [*_from_devices(), *_commands(), *_replies(), *_refusals()]


def _from_devices() -> list[dict[str, Any]]:
    last, latest = 2**32 - 1, 2**64 - 1
    many = [[7 * n, 1 + n % 3] for n in range(255)]
    return [
        information("information", 0, 0, '{"name":"Skin"}'),
        information("information that is not ASCII", 1, 2, '{"name":"Größe ≤ 10 µm, 触覚 🖐"}'),
        information("information without a text", 2, 3, ""),
        sampled("samples of one channel", 3, 4, 2, [[0, 1]], [-1]),
        sampled("samples of 16 bits in a run", 4, 5, 2, [[0, 5]], [-(2**15), -1, 0, 1, 2**15 - 1]),
        sampled(
            "samples of 24 bits", 5, 6, 4, [[10, 6]], [-(2**23), 2**23 - 1, -1, 0, 70000, -70000]
        ),
        sampled("samples of 32 bits", 6, 7, 4, [[1, 2]], [-(2**31), 2**31 - 1]),
        sampled("runs in any order", 7, 8, 2, [[200, 2], [0, 1], [100, 3]], [1, 2, 3, -4, -5, -6]),
        sampled("no channels", 8, 9, 2, [], []),
        sampled("the last channel", 9, 10, 2, [[65535, 1]], [7]),
        sampled(
            "as many runs as there may be",
            10,
            11,
            2,
            many,
            [n % 251 - 125 for n in range(sum(length for _, length in many))],
        ),
        sampled("the largest sequence and time", last, latest, 4, [[0, 1]], [123456]),
        sampled("magics in the counts", 11, 12, 2, [[0, 4]], [-22709, -22709, 0x4B00, -22709]),
    ]


def _commands() -> list[dict[str, Any]]:
    runs = [[0, 10], [110, 10], [220, 80]]
    return [
        command("hello", 1, 1, b"\x01\x03", lowest=1, highest=3),
        command("start", 2, 2, b""),
        command("stop", 3, 3, b""),
        command("scan list", 4, 4, runs_bytes(runs), runs=runs),
        command("scan list of all channels", 5, 4, b"\x00", runs=[]),
        command("rate", 6, 5, struct.pack("<I", 123456), rate=123456),
        command("gain", 7, 6, struct.pack("<I", 100000), gain=100000),
        command("identify", 8, 7, b""),
        command("ping", 9, 8, b""),
        command("an operation that this version does not have", 10, 200, b"\x01", bytes="01"),
    ]


def _replies() -> list[dict[str, Any]]:
    ping = struct.pack("<Qh", 2**40 + 5, 2345)
    cold = struct.pack("<Qh", 2**64 - 1, -1250)
    unknown = struct.pack("<Qh", 0, -32768)
    return [
        reply("reply to hello", 11, 1, 1, 0, b"\x01", version=1),
        reply("reply to start", 12, 2, 2, 0, b""),
        reply("reply to stop", 13, 3, 3, 0, b""),
        reply("reply to scan list", 14, 4, 4, 0, b""),
        reply("reply to rate", 15, 6, 5, 0, struct.pack("<I", 123456), rate=123456),
        reply("reply to gain", 16, 7, 6, 0, struct.pack("<I", 100000), gain=100000),
        reply("reply to identify", 17, 8, 7, 0, b""),
        reply("reply to ping", 18, 9, 8, 0, ping, time=2**40 + 5, temperature=2345),
        reply("reply in the cold", 19, 9, 8, 0, cold, time=2**64 - 1, temperature=-1250),
        reply("temperature not known", 20, 2**32 - 1, 8, 0, unknown, time=0, temperature=-32768),
    ]


def _refusals() -> list[dict[str, Any]]:
    reasons = [
        (1, 200, "this device has no operation 200"),
        (2, 5, "expected 4 bytes, got 3"),
        (3, 6, "gain: 1 ≤ 1000"),
        (4, 1, "this device speaks version 1"),
        (5, 2, ""),
        (5, 4, "µ" * 100),
    ]
    return [
        reply(f"refused {status}: {text[:20]}", 21 + n, n, operation, status, text.encode(),
              reason=text)
        for n, (status, operation, text) in enumerate(reasons)
    ]  # fmt: skip


def bad() -> list[dict[str, Any]]:
    """Bytes of which no message comes, and what is wrong with them."""
    fine = message(2, samples(2, [[0, 3]], [1, 2, 3]), 5, 6)
    found = [
        ("the first byte of the magic", "magic", flipped(fine, 0)),
        ("the second byte of the magic", "magic", flipped(fine, 1)),
        *((f"byte {n} turned over", "header check", flipped(fine, n, n % 8)) for n in range(2, 22)),
        *((f"byte {n} turned over", "checksum", flipped(fine, n)) for n in range(22, len(fine))),
        ("header check of the initial value FFFF", "header check", _otherwise_checked(fine)),
        ("checksum with its bytes reversed", "checksum", fine[:-4] + fine[:-5:-1]),
        ("checksum of the payload alone", "checksum", _payload_checked(fine)),
        ("longer than may be", "length", header(2, 2**18 + 1, 5, 6)),
        ("the longest that can be said", "length", header(1, 2**32 - 1, 5, 6)),
        ("version 0", "version", message(2, b"\x02\x00", 5, 6, version=0)),
        ("version 2", "version", message(2, b"\x02\x00", 5, 6, version=2)),
        ("version 255", "version", message(9, b"any", 5, 6, version=255)),
        ("kind 0", "kind", message(0, b"", 5, 6)),
        ("kind 5", "kind", message(5, b"\x02\x00", 5, 6)),
        *((name, "payload", message(kind, data, 5, 6)) for name, kind, data in _unreadable()),
    ]
    return [{"name": name, "reason": reason, "hex": data.hex()} for name, reason, data in found]


def _otherwise_checked(fine: bytes) -> bytes:
    # CRC is linear: another initial value adds what it gives for as many zeros.
    remainder = 0xFFFF
    for _ in range(20 * 8):
        remainder = (remainder << 1 & 0xFFFF) ^ 0x1021 * (remainder >> 15)
    (check,) = struct.unpack("<H", fine[20:22])
    data = fine[:20] + struct.pack("<H", check ^ remainder) + fine[22:-4]
    return data + struct.pack("<I", zlib.crc32(data))


def _payload_checked(fine: bytes) -> bytes:
    return fine[:-4] + struct.pack("<I", zlib.crc32(fine[22:-4]))


def _unreadable() -> list[tuple[str, int, bytes]]:
    return [
        ("information that is no UTF-8", 1, b'{"name":"\xff"}'),
        ("information that ends inside a character", 1, "µ".encode()[:1]),
        ("samples without a width", 2, b""),
        ("samples without a number of runs", 2, b"\x02"),
        ("counts of no byte", 2, b"\x00" + runs_bytes([[0, 1]])),
        ("counts of 1 byte", 2, b"\x01" + runs_bytes([[0, 1]]) + b"\x00"),
        ("counts of 3 bytes", 2, b"\x03" + runs_bytes([[0, 1]]) + bytes(3)),
        ("more runs said than sent", 2, b"\x02\x02" + struct.pack("<HH", 0, 1)),
        ("a count too few", 2, samples(2, [[0, 3]], [1, 2])),
        ("a count too many", 2, samples(2, [[0, 3]], [1, 2, 3, 4])),
        ("half a count", 2, samples(2, [[0, 2]], [1, 2])[:-1]),
        ("a command without an operation", 3, b""),
        ("a reply that is cut", 4, struct.pack("<IB", 1, 2)),
    ]


def streams() -> list[dict[str, Any]]:
    """Bytes as they come, and the messages that come out of them in order."""
    return [*_whole(), *_spoilt(), *_passed_over(), *_ended(), *_from_host()]


def _messages() -> list[bytes]:
    counts_with_magics = [-22709, 5, -22709, 6]
    return [
        message(4, struct.pack("<IBB", 1, 2, 0), 1, 1000),
        message(2, samples(2, [[0, 4]], counts_with_magics), 2, 2000),
        message(1, '{"name":"µ"}'.encode(), 3, 3000),
        message(2, samples(4, [[7, 1], [3, 2]], [1, -2, 3]), 4, 4000),
    ]


def _whole() -> list[dict[str, Any]]:
    a, b, c, d = every = _messages()
    together = b"".join(every)
    return [
        _stream("nothing", [b""], []),
        _stream("one after the other", [together], every),
        _stream("byte by byte", _cut(together, 1), every),
        _stream("in pieces of 23", _cut(together, 23), every),
        _stream("noise between", [NOISE, a, NOISE, b + NOISE, c, NOISE + d], every),
        _stream("noise between, byte by byte", _cut(NOISE + a + NOISE + b, 1), [a, b]),
        _stream("magics without a header", [MAGIC * 20 + a + MAGIC * 20 + b + c], [a, b, c]),
        _stream("a first byte of the magic before", [b"\x4b" + a + b"\x4b\x4b" + b], [a, b]),
    ]


def _spoilt() -> list[dict[str, Any]]:
    a, b, c, d = every = _messages()
    too_long, promised = header(2, 2**18 + 1, 9, 9), header(2, 60, 9, 9)
    around = message(1, b + c, 9, 9)
    return [
        *(_stream(f"cut after {n}", [b[:n] + a + b + c], [a, b, c]) for n in (1, 3, 11, 22, 30)),
        _stream("a byte missing in the middle", [a + b[:26] + b[27:] + c + d], [a, c, d]),
        _stream("a byte too many in the middle", [a + b[:26] + b"\x4b" + b[26:] + c], [a, c]),
        _stream("a good message in a broken one", [a, flipped(around, len(around) - 1), d], every),
        _stream("a broken header before a good message", [flipped(b, 4) + c], [c]),
        _stream("a length that is too long", [a + too_long + b], [a, b]),
        _stream("a true header without its message", [promised + a + b + c], [a, b, c]),
        _stream("a header in a message's place", [header(2, 22, 9, 9) * 4 + a + c], [a, c]),
    ]


def _passed_over() -> list[dict[str, Any]]:
    a, b, c, _ = _messages()
    newer = message(2, b, 9, 9, version=2)
    outer = message(4, bytes(6) + a + b, 2, 5)
    return [
        _stream("a good message in a good one", [a, outer, c], [a, outer, c]),
        _stream("another version, whole", [a, newer, c], [a, c]),
        _stream("another version, broken", [a, flipped(newer, len(newer) - 1), c], [a, b, c]),
        _stream("an unknown kind with a message in it", [message(77, b, 9, 9), c], [c]),
    ]


def _ended() -> list[dict[str, Any]]:
    a, b, *_ = _messages()
    return [
        _stream("an end in the magic", [a, b"\x4b"], [a], 1),
        _stream("an end in a header", [a + b[:21]], [a], 21),
        _stream("an end in a payload", [a + NOISE + b[:-5]], [a], len(b) - 5),
        _stream("an end before the last byte", [a + b[:-1]], [a], len(b) - 1),
    ]


def _from_host() -> list[dict[str, Any]]:
    ping, stop = message(3, b"\x08", 1, 1000), message(3, b"\x03", 2, 2000)
    listed = message(3, b"\x04" + runs_bytes([[5, 5]]), 3, 3000)
    host = "host"
    return [
        _stream("commands", [ping, stop, listed], [ping, stop, listed], sender=host),
        _stream("commands in noise", [NOISE + ping + NOISE + stop[:9] + listed], [ping, listed],
                sender=host),
    ]  # fmt: skip


def _cut(data: bytes, size: int) -> list[bytes]:
    return [data[n : n + size] for n in range(0, len(data), size)]


def _stream(
    name: str, chunks: list[bytes], out: list[bytes], waiting: int = 0, sender: str = "device"
) -> dict[str, Any]:
    return {
        "name": name,
        "from": sender,
        "chunks": [chunk.hex() for chunk in chunks],
        "messages": [data.hex() for data in out],
        "good_bytes": sum(map(len, out)),
        "waiting_bytes": waiting,
    }


def _lines(entries: list[dict[str, Any]]) -> str:
    return ",\n".join(f"  {json.dumps(entry, ensure_ascii=False)}" for entry in entries)


def text() -> str:
    """The whole file: JSON with an entry a line."""
    parts = {"good": good(), "bad": bad(), "streams": streams()}
    told = ",\n".join(f' "{name}": [\n{_lines(entries)}\n ]' for name, entries in parts.items())
    return f"{{\n{told}\n}}\n"


if __name__ == "__main__":
    print(text(), end="")
