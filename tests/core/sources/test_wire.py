"""The wire format: bytes cut and spoiled anywhere, and every one of them accounted for."""

import struct
import weakref
import zlib
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kappaskin.errors import Refusal
from kappaskin.sources import Accounting, Decoder
from kappaskin.sources.decoder import FROM_DEVICE, FROM_HOST, SequenceCounter
from kappaskin.sources.wire import (
    LONGEST,
    Command,
    Fault,
    Information,
    Message,
    MessageKind,
    Operation,
    Reply,
    Samples,
    encode,
    encode_command,
    encode_information,
    encode_reply,
    encode_samples,
)

SEQUENCES = st.integers(0, 2**32 - 1)
MICROSECONDS = st.integers(0, 2**53)


def packed(
    kind: int = 2,
    payload: bytes = b"\2\0",
    sequence: int = 0,
    time_us: int = 0,
    version: int = 1,
    length: int | None = None,
) -> bytes:
    """A message as the wire format's page has it, made without the code under test."""
    said = len(payload) if length is None else length
    head = b"\x4b\xa7" + struct.pack("<BBIIQ", version, kind, said, sequence, time_us)
    body = head + struct.pack("<H", crc_16(head)) + payload
    return body + struct.pack("<I", zlib.crc32(body))


def crc_16(data: bytes) -> int:
    """The header check, bit by bit."""
    value = 0
    for bit in (byte >> shift & 1 for byte in data for shift in range(7, -1, -1)):
        value = (value << 1 ^ (0x1021 if (value >> 15) ^ bit else 0)) & 0xFFFF
    return value


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
    message = encode_information(sequence, 1.5, text)
    assert Decoder().feed(message) == [Information(sequence, 1.5, text)]


def test_messages_are_the_bytes_that_the_format_describes() -> None:
    channels, counts = np.array([0, 1, 2, 9]), np.array([0, -1, 300, 7], np.int32)
    payload = bytes([2, 2]) + struct.pack("<4H", 0, 3, 9, 1) + struct.pack("<4h", 0, -1, 300, 7)

    assert encode_samples(5, 2.5, channels, counts, 2) == packed(2, payload, 5, 2_500_000)
    assert encode_information(6, 0.0, "{}") == packed(1, b"{}", 6)


def test_more_runs_of_channels_than_a_byte_counts_are_refused() -> None:
    channels = np.arange(0, 512, 2)
    with pytest.raises(Refusal, match="255 runs"):
        encode_samples(0, 0.0, channels, np.zeros(256, np.int32), 2)


def test_a_payload_that_is_too_long_is_refused() -> None:
    with pytest.raises(Refusal, match="at most 262144 bytes, got 262145"):
        encode(MessageKind.INFORMATION, 0, 0.0, bytes(LONGEST + 1))


@given(SEQUENCES, st.sampled_from(Operation), st.binary(max_size=40))
def test_commands_come_back_as_sent(sequence: int, operation: Operation, arguments: bytes) -> None:
    message = encode_command(sequence, 2.5, operation, arguments)
    assert Decoder(FROM_HOST).feed(message) == [Command(sequence, operation, arguments)]


@given(SEQUENCES, SEQUENCES, st.binary(max_size=40))
def test_replies_come_back_as_sent(sequence: int, asked: int, data: bytes) -> None:
    to = Command(asked, Operation.PING, b"")
    message = encode_reply(sequence, 2.5, to, data=data)
    expected = Reply(sequence, 2.5, asked, Operation.PING, Fault.NONE, data)
    assert Decoder().feed(message) == [expected]


def test_a_reason_is_cut_to_its_longest_and_read_as_text() -> None:
    to = Command(7, Operation.RATE, b"")
    (got,) = Decoder().feed(encode_reply(0, 0.0, to, Fault.OUT_OF_RANGE, b"far too fast " * 50))
    assert isinstance(got, Reply)
    assert (got.fault, got.command, len(got.reason)) == (3, 7, 200)
    assert got.reason.startswith("far too fast")


def test_what_the_other_side_alone_may_say_is_thrown_away() -> None:
    command = encode_command(0, 0.0, Operation.START)
    assert Decoder(FROM_DEVICE).feed(command) == []
    assert Decoder(FROM_HOST).feed(scan(0)) == []


def test_the_longest_message_there_can_be_arrives_in_pieces() -> None:
    channels = np.arange(65534)
    counts = np.arange(65534, dtype=np.int32) << 8
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
        stream += spoiled(message, how, where, noise) if how else message
        intact += [] if how else [sequence]
    decoder = Decoder()

    messages = fed(decoder, stream + scan(first + len(damages)), cuts)
    assert messages.pop().sequence == (first + len(damages)) % 2**32

    # A damage may also leave a message whole: garbage put before its first byte, for one.
    assert set(intact) <= {m.sequence for m in messages} <= set(sent)
    assert [m for m in messages if encoded_again(m) != sent[m.sequence]] == []
    seen = decoder.accounting()
    assert seen.accepted == len(messages) + 1
    assert seen.span <= len(damages) + 1
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


def test_a_frame_broken_off_at_every_byte_spoils_nothing_after_it() -> None:
    for end in range(1, len(scan(0))):
        decoder = Decoder()
        messages = fed(decoder, scan(0)[:end] + scan(1) + scan(2), [])
        assert [m.sequence for m in messages] == [1, 2]
        assert decoder.accounting().bytes_discarded == end


def test_what_is_buffered_when_a_line_ends_is_counted_as_cut_off() -> None:
    decoder = Decoder()
    decoder.feed(scan(0) + scan(1)[:17])
    decoder.line_ended()
    assert [m.sequence for m in decoder.feed(scan(2))] == [2]
    assert dict(balanced(decoder).discarded) == {"cut off": 17}


def test_every_flipped_bit_is_noticed() -> None:
    message = scan(900)
    for bit in range(8 * len(message)):
        data = bytearray(message)
        data[bit // 8] ^= 1 << bit % 8
        decoder = Decoder()
        assert [m.sequence for m in fed(decoder, bytes(data) + scan(901), [])] == [901]
        assert decoder.accounting().bytes_discarded == len(message)


def test_a_message_inside_a_spoilt_one_is_found() -> None:
    outer = bytearray(packed(kind=1, payload=b"x" * 40 + scan(5) + b"y" * 9))
    outer[-1] ^= 1
    decoder = Decoder()
    assert [m.sequence for m in fed(decoder, bytes(outer) + scan(6), [])] == [5, 6]


WRONG_CHECK = bytearray(packed())
WRONG_CHECK[20] ^= 1
WRONG_CHECK[-4:] = struct.pack("<I", zlib.crc32(WRONG_CHECK[:-4]))


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (b"\x11" * 30, "garbage"),
        (bytes(WRONG_CHECK), "garbage"),
        (packed(length=LONGEST + 1) + bytes(30), "garbage"),
        (scan(1)[:-3] + b"\1\1\0", "checksum"),
        (packed(version=2), "version"),
        (packed(kind=3), "unknown kind"),
        (packed(kind=0), "unknown kind"),
        (packed(kind=1, payload=b"\xff\xfe"), "content"),
        (packed(kind=4, payload=b"\0\0\0\0\1"), "content"),
        (packed(payload=b""), "content"),
        (packed(payload=b"\3\0"), "content"),
        (packed(payload=b"\2\1\0"), "content"),
    ],
)
def test_what_is_thrown_away_is_counted_under_its_reason(message: bytes, reason: str) -> None:
    decoder = Decoder()
    assert [m.sequence for m in decoder.feed(scan(0) + message + scan(1))] == [0, 1]
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


def test_of_many_scan_lists_only_the_last_are_remembered() -> None:
    decoder, lists = Decoder(), []
    for channel in range(300):
        message = encode_samples(channel, 0.0, np.array([channel]), np.zeros(1, np.int32), 2)
        ((_, _, channels, _),) = decoder.feed(message)
        assert channels.tolist() == [channel]
        lists.append(weakref.ref(channels))
    del channels
    assert sum(one() is not None for one in lists) <= 64


def test_garbage_without_an_end_is_not_kept() -> None:
    decoder = Decoder()
    for _ in range(300):
        decoder.feed(b"\x11" * 4096)
        assert balanced(decoder).buffered < 22

    assert [m.sequence for m in decoder.feed(b"\x11\0" + scan(4))] == [4]
    assert dict(balanced(decoder).discarded) == {"garbage": 300 * 4096 + 2}


def test_a_length_that_is_believed_takes_no_more_than_it_says() -> None:
    decoder = Decoder()
    decoder.feed(packed(length=LONGEST)[:22])
    for _ in range(300):
        decoder.feed(b"\x11" * 4096)
        assert balanced(decoder).buffered <= LONGEST + 26


def test_of_nothing_that_came_nothing_became_of_anything() -> None:
    assert Accounting().balanced
    assert Accounting() == Decoder().accounting()


def test_bytes_never_fed_are_counted_as_overrun() -> None:
    decoder = Decoder()
    decoder.feed(scan(0))
    seen = decoder.accounting(overrun=10)
    assert seen.discarded == (("overrun", 10),)
    assert seen.bytes_in == seen.bytes_good + seen.bytes_discarded == len(scan(0)) + 10


def test_what_waits_for_more_is_held_as_it_came() -> None:
    decoder, rest = Decoder(), scan(1)[:30]
    for byte in scan(0) + rest:
        decoder.feed(bytes([byte]))
    assert decoder.held == rest


@pytest.mark.parametrize(
    ("thrown", "share"),
    [(900_000, "90 %"), (3_060, "0.31 %"), (10, "0.001 %"), (9, "under 0.001 %")],
)
def test_the_share_that_was_thrown_away_is_told_in_two_digits(thrown: int, share: str) -> None:
    seen = Accounting(bytes_in=1_000_000, discarded=(("garbage", thrown), ("checksum", 0)))
    assert f"; {share} of bytes discarded: garbage {thrown:,}" in seen.words


# Sequence numbers


def taken(numbers: list[int]) -> tuple[SequenceCounter, list[bool]]:
    sequence, answers = SequenceCounter(), []
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


@pytest.mark.parametrize(
    ("first", "same", "lost", "restarts"),
    [(5002, True, 0, 0), (5100, True, 98, 0), (5100, False, 0, 1), (7, True, 0, 1)],
)
def test_a_device_that_comes_back_goes_on_or_begins_anew(first, same, lost, restarts) -> None:
    sequence, _ = taken([5000, 5001])
    sequence.interrupt()
    assert sequence.take(first)
    sequence.take(first + 1)
    sequence.resume(same)
    assert (sequence.lost, sequence.restarts) == (lost, restarts)
    assert sequence.span == sequence.accepted + sequence.lost


def test_nothing_is_said_of_a_line_that_was_not_interrupted_or_is_silent_since() -> None:
    sequence, _ = taken([5000, 5001])
    sequence.resume(False)
    sequence.interrupt()
    sequence.resume(False)
    assert (sequence.lost, sequence.restarts, sequence.span) == (0, 0, 2)


def test_a_frame_too_late_to_tell_from_a_restart_starts_anew() -> None:
    assert taken([100, 200, 136])[0].restarts == 1
    assert taken([100, 200, 137])[0].restarts == 0
