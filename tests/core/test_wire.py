"""The wire format: bytes cut and spoiled anywhere, and every one of them accounted for."""

import struct
import zlib
from itertools import pairwise

import numpy as np
import pytest
from cobs import cobs
from hypothesis import given, settings
from hypothesis import strategies as st

from kappaskin.errors import Refusal
from kappaskin.sources.wire import (
    LONGEST,
    Accounting,
    Decoder,
    Information,
    Message,
    Samples,
    Sequence,
    cobs_decode,
    cobs_encode,
    encode_information,
    encode_samples,
)

SEQUENCES = st.integers(0, 2**32 - 1)
MICROSECONDS = st.integers(0, 2**53)


def packed(
    kind: int = 2, payload: bytes = b"\2\0", sequence: int = 0, time_us: int = 0, version: int = 1
) -> bytes:
    """A message as the wire format's description has it, made without the code under test."""
    body = struct.pack("<BBIQ", version, kind, sequence, time_us) + payload
    return cobs.encode(body + struct.pack("<I", zlib.crc32(body))) + b"\0"


def scan(sequence: int) -> bytes:
    counts = (np.arange(4) * sequence % 1000).astype(np.int32)
    return encode_samples(sequence, sequence / 500, np.array([0, 1, 7, 8]), counts, 2)


def balanced(decoder: Decoder) -> Accounting:
    """The accounting, after checking that it adds up."""
    seen = decoder.accounting()
    assert seen.bytes_in == seen.bytes_good + sum(dict(seen.discarded).values()) + seen.buffered
    assert seen.bytes_discarded == sum(dict(seen.discarded).values())
    assert seen.good == seen.accepted + seen.duplicate
    assert seen.span == seen.accepted + seen.lost
    return seen


def fed(decoder: Decoder, stream: bytes, cuts: list[int]) -> list[Message]:
    """The messages in `stream`, fed in pieces that end at `cuts`; checks the balance after each."""
    messages: list[Message] = []
    edges = [0, *sorted(cut % (len(stream) + 1) for cut in cuts), len(stream)]
    for start, end in pairwise(edges):
        messages += decoder.feed(stream[start:end])
        balanced(decoder)
    return messages


# Bytes without zeros


# Long runs without a zero are what the blocks of 254 are about, and rare among random bytes.
BYTES = st.lists(st.one_of(st.binary(max_size=40), st.just(b"x" * 127)), max_size=9).map(b"".join)


@given(BYTES)
def test_the_cobs_package_reads_what_is_written_and_writes_what_is_read(data: bytes) -> None:
    assert cobs.decode(cobs_encode(data)) == data
    assert cobs_decode(cobs.encode(data)) == data
    assert 0 not in cobs_encode(data)
    assert len(cobs_encode(data)) <= len(data) + len(data) // 254 + 1


@pytest.mark.parametrize("length", [0, 1, 253, 254, 255, 507, 508, 509, 762])
def test_blocks_that_are_just_full_are_read_back(length: int) -> None:
    for data in (b"x" * length, b"x" * length + b"\0", b"\0" + b"x" * length):
        assert cobs.decode(cobs_encode(data)) == cobs_decode(cobs_encode(data)) == data


@given(st.binary(max_size=600))
def test_whatever_is_unstuffed_is_what_the_cobs_package_makes_of_it_or_refused(data: bytes) -> None:
    try:
        expected = cobs.decode(data)
    except cobs.DecodeError:
        expected = None
    # The package also refuses a zero inside a block; a decoder never sees one.
    if 0 not in data:
        assert cobs_decode(data) == expected
    else:
        cobs_decode(data)


# Messages


@given(
    st.lists(st.integers(0, 65535), max_size=80),
    st.sampled_from([2, 4]),
    SEQUENCES,
    MICROSECONDS,
    st.randoms(use_true_random=False),
)
def test_samples_come_back_as_sent(channels, width, sequence, time_us, random) -> None:
    limit = 2 ** (8 * width - 1)
    counts = np.array([random.randrange(-limit, limit) for _ in channels], np.int32)
    decoder = Decoder()

    (got,) = decoder.feed(
        encode_samples(sequence, time_us * 1e-6, np.array(channels, np.intp), counts, width)
    )

    assert isinstance(got, Samples)
    assert got.sequence == sequence
    assert got.time == pytest.approx(time_us * 1e-6, abs=1e-6, rel=1e-15)
    assert got.channels.tolist() == channels
    assert got.counts.tolist() == counts.tolist()
    assert got.counts.dtype == np.int32
    assert balanced(decoder).bytes_good == balanced(decoder).bytes_in


@given(st.text(max_size=400), SEQUENCES)
def test_information_comes_back_as_sent(text: str, sequence: int) -> None:
    assert Decoder().feed(encode_information(sequence, 1.5, text)) == [Information(sequence, text)]


def test_messages_are_the_bytes_that_the_format_describes() -> None:
    channels, counts = np.array([0, 1, 2, 9]), np.array([0, -1, 300, 7], np.int32)
    payload = bytes([2, 2]) + struct.pack("<4H", 0, 3, 9, 1) + struct.pack("<4h", 0, -1, 300, 7)

    assert encode_samples(5, 2.5, channels, counts, 2) == packed(2, payload, 5, 2_500_000)
    assert encode_information(6, 0.0, "{}") == packed(1, b"{}", 6)


def test_more_runs_of_channels_than_a_byte_counts_are_refused() -> None:
    channels = np.arange(0, 512, 2)
    with pytest.raises(Refusal, match="255 runs"):
        encode_samples(0, 0.0, channels, np.zeros(256, np.int32), 2)


def test_the_longest_message_there_can_be_arrives_in_pieces() -> None:
    channels = np.arange(65535)
    counts = np.full(65535, 0x01010101, np.int32)  # without a zero byte it is longest
    message = encode_samples(0, 0.0, channels, counts, 4)
    decoder = Decoder()

    (got,) = [m for q in range(0, len(message), 900) for m in decoder.feed(message[q : q + 900])]

    assert isinstance(got, Samples)
    assert np.array_equal(got.counts, counts)
    balanced(decoder)


# What spoils a line


@given(st.lists(st.binary(max_size=60), max_size=20))
def test_arbitrary_bytes_are_all_accounted_for(chunks: list[bytes]) -> None:
    decoder = Decoder()
    for chunk in chunks:
        decoder.feed(chunk)
        assert balanced(decoder).good == 0
    assert balanced(decoder).bytes_in == sum(map(len, chunks))


def spoiled(message: bytes, how: str, where: int, noise: bytes) -> bytes:
    at = where % len(message)
    if how == "flip":
        return message[:at] + bytes([message[at] ^ 1 << where % 8]) + message[at + 1 :]
    if how == "delete":
        return message[:at] + message[at + 1 + where % 3 :]
    if how == "insert":
        return message[:at] + noise + message[at:]
    return noise  # instead of the message


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["flip", "delete", "insert", "instead", "", "", ""]),
            st.integers(0, 10_000),
            st.binary(min_size=1, max_size=40),
        ),
        max_size=25,
    ),
    st.lists(st.integers(0, 10_000), max_size=12),
    SEQUENCES,
)
@settings(max_examples=300)
def test_every_good_frame_between_spoiled_ones_arrives_unchanged(damages, cuts, first) -> None:
    stream, sent, intact = b"", {}, []
    for q, (how, where, noise) in enumerate(damages):
        sequence = (first + q) % 2**32
        message = sent[sequence] = scan(sequence)
        stream += spoiled(message, how, where, noise) + b"\0" if how else message
        intact += [] if how else [sequence]
    decoder = Decoder()

    messages = fed(decoder, stream, cuts)

    # A damage may also leave a message whole: garbage put before its first byte, for one.
    assert set(intact) <= {m.sequence for m in messages} <= set(sent)
    assert [m for m in messages if encoded_again(m) != sent[m.sequence]] == []
    seen = decoder.accounting()
    assert seen.accepted == len(messages)
    assert seen.span <= len(damages)
    assert seen.buffered == 0


def encoded_again(message: Message) -> bytes:
    assert isinstance(message, Samples)
    return encode_samples(message.sequence, message.time, message.channels, message.counts, 2)


def test_a_frame_cut_at_every_byte_is_one_frame() -> None:
    message = scan(3)
    for cut in range(len(message) + 1):
        decoder = Decoder()
        assert len(fed(decoder, message, [cut])) == 1
        assert decoder.accounting().bytes_good == len(message)


def test_a_frame_broken_off_at_every_byte_spoils_only_the_next() -> None:
    for end in range(1, len(scan(0))):
        decoder = Decoder()
        messages = fed(decoder, scan(0)[:end] + scan(1) + scan(2), [])
        assert [m.sequence for m in messages] == [2]
        assert decoder.accounting().bytes_discarded == end + len(scan(1))


def test_every_flipped_bit_is_noticed() -> None:
    message = scan(900)
    for bit in range(8 * len(message)):
        data = bytearray(message)
        data[bit // 8] ^= 1 << bit % 8
        decoder = Decoder()
        assert fed(decoder, bytes(data) + b"\0", []) == []
        assert decoder.accounting().bytes_discarded == len(message) + 1


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (b"\0", "empty"),
        (b"\7abc\0", "encoding"),
        (cobs.encode(b"short") + b"\0", "too short"),
        (scan(1)[:-3] + b"\1\1\0", "checksum"),
        (packed(version=2), "version"),
        (packed(kind=3), "unknown kind"),
        (packed(kind=1, payload=b"\xff\xfe"), "content"),
        (packed(payload=b""), "content"),
        (packed(payload=b"\3\0"), "content"),
        (packed(payload=b"\2\1\0"), "content"),
    ],
)
def test_what_is_thrown_away_is_counted_under_its_reason(message: bytes, reason: str) -> None:
    decoder = Decoder()
    assert decoder.feed(message) == []
    assert balanced(decoder).discarded == ((reason, len(message)),)


def test_another_version_is_remembered() -> None:
    decoder = Decoder()
    decoder.feed(packed(version=9) + scan(0))
    assert decoder.accounting().other_version == 9


def runs(*table: tuple[int, int], counts: int, width: int = 2) -> bytes:
    head = bytes([width, len(table)]) + b"".join(struct.pack("<HH", *run) for run in table)
    return packed(payload=head + bytes(width * counts))


@pytest.mark.parametrize(
    "message",
    [
        runs((0, 5), counts=4),
        runs((0, 5), counts=6),
        runs((0, 65535), (0, 2), counts=1),  # 65,537 wraps to 1 in 16 bits
        runs(*[(65535, 65535)] * 255, counts=1),
        runs(*[(0, 32768)] * 2, counts=0),
        packed(payload=b"\2\xff\0\0"),
        packed(payload=b"\4\1\0\0\1\0\0\0"),  # half a count
    ],
)
def test_channel_lists_that_lie_are_thrown_away(message: bytes) -> None:
    decoder = Decoder()
    assert decoder.feed(message) == []
    assert [reason for reason, _ in balanced(decoder).discarded] == ["content"]


def test_channels_beyond_16_bits_do_not_wrap_to_low_ones() -> None:
    (got,) = Decoder().feed(runs((65535, 3), (4, 0), counts=3))
    assert isinstance(got, Samples)
    assert got.channels.tolist() == [65535, 65536, 65537]


def test_garbage_without_an_end_is_not_kept() -> None:
    decoder = Decoder()
    for _ in range(3 * LONGEST // 4096):
        decoder.feed(b"\x11" * 4096)
        assert balanced(decoder).buffered <= LONGEST

    assert [m.sequence for m in decoder.feed(b"\x11\0" + scan(4))] == [4]
    assert dict(balanced(decoder).discarded) == {"too long": 3 * LONGEST + 2}


def test_bytes_never_fed_are_counted_as_overrun() -> None:
    decoder = Decoder()
    decoder.feed(scan(0))
    seen = decoder.accounting(overrun=10)
    assert seen.discarded == (("overrun", 10),)
    assert seen.bytes_in == seen.bytes_good + seen.bytes_discarded == len(scan(0)) + 10


# Sequence numbers


def taken(numbers: list[int]) -> tuple[Sequence, list[bool]]:
    sequence, answers = Sequence(), []
    for number in numbers:
        answers.append(sequence.take(number % 2**32))
        assert sequence.good == sequence.accepted + sequence.duplicate
        assert sequence.span == sequence.accepted + sequence.lost
    return sequence, answers


@given(st.lists(SEQUENCES, max_size=60))
def test_the_balance_holds_for_any_sequence_numbers(numbers: list[int]) -> None:
    taken(numbers)


@given(
    st.integers(0, 2**32 - 1),
    st.lists(st.tuples(st.integers(0, 3), st.integers(0, 40)), min_size=1, max_size=150),
)
def test_lost_late_and_double_frames_are_told_apart(first: int, fates) -> None:
    # Each frame is sent as often as its fate says (0: lost), each copy up to 40 places late.
    order = sorted((n + late, n) for n, (copies, late) in enumerate(fates) for _ in range(copies))
    numbers = [first, *(first + 1 + n for _, n in order)]

    sequence, answers = taken(numbers)

    distinct = set(numbers)
    assert sequence.accepted == sum(answers) == len(distinct)
    assert sequence.duplicate == len(numbers) - len(distinct)
    assert sequence.lost == max(numbers) - first + 1 - len(distinct)
    assert sequence.restarts == 0


def test_a_late_frame_moves_from_lost_to_accepted() -> None:
    before, _ = taken([10, 13])
    after, answers = taken([10, 13, 11])
    assert (before.lost, before.accepted, before.span) == (2, 2, 4)
    assert (after.lost, after.accepted, after.span) == (1, 3, 4)
    assert answers == [True, True, True]


def test_sequence_numbers_go_on_through_their_wrap() -> None:
    sequence, _ = taken([2**32 - 2, 2**32 - 1, 2**32, 2**32 + 2])
    assert (sequence.accepted, sequence.lost, sequence.restarts) == (4, 1, 0)


def test_a_restarted_device_loses_nothing() -> None:
    sequence, answers = taken([5000, 5001, 0, 1, 2])
    assert (sequence.accepted, sequence.lost, sequence.restarts) == (5, 0, 1)
    assert all(answers)


def test_a_frame_too_late_to_tell_from_a_restart_starts_anew() -> None:
    assert taken([100, 200, 136])[0].restarts == 1
    assert taken([100, 200, 137])[0].restarts == 0
