"""The library against the vectors beside the wire format's page."""

import json
import re
from importlib.resources import files
from typing import Any

import numpy as np
import pytest

from kappaskin.sources import Decoder
from kappaskin.sources.decoder import FROM_DEVICE, FROM_HOST
from kappaskin.sources.wire import (
    Command,
    Fault,
    Information,
    Message,
    MessageKind,
    Operation,
    Reply,
    Samples,
    encode,
    encode_samples,
    pack_runs,
)

VECTORS = json.loads((files("kappaskin_resources") / "wire" / "vectors.json").read_text("utf-8"))
KINDS = {"device": FROM_DEVICE, "host": FROM_HOST}
UNIT = 1e-6  # s


def named(part: str) -> Any:
    return pytest.mark.parametrize("vector", VECTORS[part], ids=lambda vector: vector["name"])


def read(whole: bytes) -> Message:
    (found,) = Decoder(frozenset(MessageKind)).feed(whole)
    return found


def channels(runs: list[list[int]]) -> list[int]:
    return [first + n for first, length in runs for n in range(length)]


@pytest.mark.parametrize(
    ("numbers", "named"),
    [(Operation, "operation"), (Fault, "status"), (MessageKind, "kind")],
    ids=["operations", "faults", "kinds"],
)
def test_numbers_mean_what_the_firmware_s_header_says(numbers, named: str) -> None:
    header = (files("kappaskin_resources") / "firmware" / "kappaskin_wire.h").read_text("utf-8")
    (said,) = re.findall(rf"enum kappaskin_{named} {{(.*?)}};", header, re.DOTALL)
    listed = dict(re.findall(r"KAPPASKIN_(\w+?)(?:_KIND)? = (\d+)", said))

    ours = {name: int(one) for name, one in numbers.__members__.items() if one}
    assert ours == {name: int(n) for name, n in listed.items() if int(n)}


@named("good")
def test_a_good_message_is_read_as_the_vector_says(vector: dict[str, Any]) -> None:
    found = read(bytes.fromhex(vector["hex"]))

    assert found.sequence == vector["sequence"]
    match found:
        case Information():
            assert found.text == vector["text"]
        case Samples():
            assert found.time == pytest.approx(vector["time"] * UNIT, rel=1e-15)
            assert found.channels.tolist() == channels(vector["runs"])
            assert found.counts.tolist() == vector["counts"]
        case Command():
            assert found.operation == vector["operation"]
        case Reply():
            told = vector["command_sequence"], vector["operation"], vector["status"]
            assert (found.command, found.operation, found.fault) == told
            if found.fault:
                assert found.reason == vector["data"]["reason"]


@named("good")
def test_a_good_message_is_written_as_the_vector_says(vector: dict[str, Any]) -> None:
    whole = bytes.fromhex(vector["hex"])
    if vector["time"] > 2**53:
        pytest.skip("in seconds, a time beyond 2^53 us is not exact")
    kind, sequence, time = whole[3], vector["sequence"], vector["time"] * UNIT

    assert encode(kind, sequence, time, whole[22:-4]) == whole
    if vector["kind"] == "samples" and pack_runs(listed := channels(vector["runs"])) in whole:
        counts = np.array(vector["counts"], np.int32)
        said = np.array(listed, np.intp)
        assert encode_samples(sequence, time, said, counts, vector["count_bytes"]) == whole


@named("bad")
def test_a_bad_message_is_refused_and_the_next_is_read(vector: dict[str, Any]) -> None:
    decoder, fine = Decoder(frozenset(MessageKind)), bytes.fromhex(VECTORS["good"][0]["hex"])

    assert len(decoder.feed(bytes.fromhex(vector["hex"]) + fine)) == 1

    seen = decoder.accounting()
    assert seen.balanced
    assert seen.bytes_good == len(fine)


@named("streams")
def test_a_stream_gives_its_messages_wherever_it_is_cut(vector: dict[str, Any]) -> None:
    expected = [read(bytes.fromhex(message)).sequence for message in vector["messages"]]
    whole = bytes.fromhex("".join(vector["chunks"]))
    for chunks in ([bytes.fromhex(chunk) for chunk in vector["chunks"]], *cuts(whole)):
        decoder = Decoder(KINDS[vector["from"]])

        found = [message.sequence for chunk in chunks for message in decoder.feed(chunk)]

        seen = decoder.accounting()
        assert found == expected
        assert (seen.bytes_good, seen.buffered) == (vector["good_bytes"], vector["waiting_bytes"])


def cuts(data: bytes) -> list[list[bytes]]:
    return [[data[:place], data[place:]] for place in range(len(data))]
