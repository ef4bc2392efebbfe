"""The vectors beside the page: as made from it, and as the C code reads, writes and refuses."""

import json
import random
import runpy
from pathlib import Path

import pytest

HERE = Path(__file__).parent
WIRE = HERE.parents[1] / "resources" / "kappaskin_resources" / "wire"
VECTORS = json.loads((WIRE / "vectors.json").read_text("utf-8"))
MAKE = runpy.run_path(str(HERE / "make_vectors.py"))
READ = runpy.run_path(str(HERE / "reader.py"))["read"]
KINDS = {"information": 1, "samples": 2, "command": 3, "reply": 4}
FRAMING = ("magic", "header check", "checksum", "length", "version", "kind")
CAPACITY = 2**18 + 26
COMMAND = 1048  # bytes that a device holds of what a host sends


def line(message: bytes) -> str:
    """What the driver prints of a whole message."""
    kind, sequence = message[3], int.from_bytes(message[8:12], "little")
    time = int.from_bytes(message[12:20], "little")
    return f"{kind} {sequence} {time} {message[22:-4].hex()}"


def said(messages: list[bytes], waiting: int) -> list[str]:
    return [*map(line, messages), f"waiting {waiting}"]


# The file


def test_the_checked_in_vectors_are_those_made_from_the_page() -> None:
    assert (WIRE / "vectors.json").read_text("utf-8") == MAKE["text"]()


def test_the_header_check_is_the_one_that_the_page_names() -> None:
    assert MAKE["crc16"](b"123456789") == 0x31C3  # the known check of CRC-16/XMODEM


def test_a_reader_of_the_page_finds_what_the_vectors_say() -> None:
    for vector in VECTORS["good"]:
        assert READ(bytes.fromhex(vector["hex"])) == ([bytes.fromhex(vector["hex"])], 0)
    for vector in VECTORS["bad"]:
        found, _ = READ(bytes.fromhex(vector["hex"]))
        assert bool(found) == (vector["reason"] == "payload"), vector["name"]
    for vector in VECTORS["streams"]:
        whole = [bytes.fromhex(message) for message in vector["messages"]]
        assert READ(bytes.fromhex("".join(vector["chunks"]))) == (whole, vector["waiting_bytes"])
        assert sum(map(len, whole)) == vector["good_bytes"]


# The C code


def test_good_messages_are_read(wire) -> None:
    stream = "".join(f"{vector['hex']}\n" for vector in VECTORS["good"])

    told = wire("lines", CAPACITY, data=stream.encode()).splitlines()

    whole = [bytes.fromhex(vector["hex"]) for vector in VECTORS["good"]]
    assert told == [printed for message in whole for printed in said([message], 0)]


def test_good_messages_are_written_byte_by_byte_the_same(wire) -> None:
    for vector in VECTORS["good"]:
        whole = bytes.fromhex(vector["hex"])
        said_again = wire(
            "seal", KINDS[vector["kind"]], vector["sequence"], vector["time"], data=whole[22:-4]
        )
        assert said_again == f"{vector['hex']}\n1\n", vector["name"]


def test_runs_are_read_and_written_and_refused(wire) -> None:
    for vector in VECTORS["good"]:
        if runs := vector.get("runs"):
            told = bytes.fromhex(vector["hex"])[23 : 24 + 4 * len(runs)]
            expected = [*(f"{first} {length}" for first, length in runs), told.hex(), len(runs)]
            assert wire("runs", data=told).splitlines() == list(map(str, expected))
    for wrong in (b"", b"\1", b"\1\0\0\1", b"\0\0", b"\2" + bytes(4)):
        assert wire("runs", data=wrong) == "\n-1\n"


def test_bad_messages_are_refused_and_the_next_is_read(wire) -> None:
    fine = bytes.fromhex(VECTORS["good"][0]["hex"])
    bad = [vector for vector in VECTORS["bad"] if vector["reason"] in FRAMING]
    stream = "".join(f"{vector['hex']} {fine.hex()}\n" for vector in bad)

    assert len(bad) > 40
    assert wire("lines", CAPACITY, data=stream.encode()).splitlines() == said([fine], 0) * len(bad)


def test_streams_give_their_messages_and_nothing_else(wire) -> None:
    for vector in VECTORS["streams"]:
        whole = [bytes.fromhex(message) for message in vector["messages"]]
        stream = " ".join(vector["chunks"]) + "\n"
        told = wire("lines", CAPACITY, data=stream.encode()).splitlines()
        assert told == said(whole, vector["waiting_bytes"]), vector["name"]


def test_a_stream_may_be_cut_anywhere(wire) -> None:
    sessions, expected = list[str](), list[str]()
    for vector in VECTORS["streams"]:
        data, whole = "".join(vector["chunks"]), map(bytes.fromhex, vector["messages"])
        told = said(list(whole), vector["waiting_bytes"])
        for cut in range(0, len(data), 2):
            sessions.append(f"{data[:cut]} {data[cut:]}\n")
            expected += told

    assert wire("lines", CAPACITY, data="".join(sessions).encode()).splitlines() == expected


# Anything at all


def mutated(source: random.Random, size: int) -> bytes:
    """`size` bytes and more of messages, whole, spoilt, cut and with garbage between them."""
    good = [bytes.fromhex(vector["hex"]) for vector in VECTORS["good"]]
    made = bytearray()
    while len(made) < size:
        message = bytearray(source.choice(good))
        match source.randrange(6):
            case 0:
                message[source.randrange(len(message))] ^= 1 << source.randrange(8)
            case 1:
                del message[source.randrange(len(message)) :]
            case 2:
                made += source.randbytes(source.randrange(60))
            case 3:
                place = source.randrange(len(message))
                message[place:place] = source.choice(good)
            case _:
                pass
        made += message
    return bytes(made)


@pytest.mark.parametrize("capacity", [COMMAND, CAPACITY, 26])
@pytest.mark.parametrize("chunk", [1, 61, 4096])
def test_mutated_messages_give_what_a_reader_of_the_page_finds(wire, capacity, chunk) -> None:
    data = mutated(random.Random(capacity + chunk), 150_000)

    told = wire("decode", capacity, chunk, data=data).splitlines()

    whole, waiting = READ(data, capacity)
    assert told == said(whole, waiting)
    assert (len(whole) > 500) == (capacity > 26)


def test_no_message_comes_out_of_garbage(wire) -> None:
    source = random.Random(1)
    magics = source.randbytes(3_000_000).replace(b"\x4b", MAKE["MAGIC"])

    assert wire("decode", COMMAND, 4096, data=magics).count("\n") == 1


def test_headers_that_promise_much_cost_little(wire) -> None:
    promise = MAKE["header"](3, COMMAND - 26, 0, 0)
    data = promise * 20_000

    assert wire("decode", COMMAND, 512, data=data).startswith("waiting")


def test_the_longest_message_is_read_and_a_longer_one_is_not(wire) -> None:
    longest = MAKE["message"](1, b" " * 2**18, 3, 4)
    longer = MAKE["message"](1, b" " * (2**18 + 1), 3, 4)

    assert wire("decode", CAPACITY, 65536, data=longest).splitlines() == said([longest], 0)
    assert wire("decode", CAPACITY + 1, 65536, data=longer).splitlines() == ["waiting 0"]
