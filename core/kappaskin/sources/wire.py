"""Wire format: messages to bytes, and payloads of messages to their contents.

`wire.md` among the resources specifies it, with test vectors; `Decoder` finds messages in a stream.
"""

import binascii
import struct
from collections.abc import Sequence
from enum import IntEnum
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import Refusal
from kappaskin.frames import Counts

VERSION = 1
MAGIC = b"\x4b\xa7"
LONGEST = 2**18
"""Bytes of payload that a message may have."""

HEADER = struct.Struct("<2sBBIIQH")
"""Magic, version, kind, length, sequence, time in us, header check."""

HEAD = HEADER.size
CHECKED = HEAD - 2
"""Bytes of the header that its check is of."""

CHECKSUM = struct.Struct("<I")

RATE_UNIT = 1000
"""Unit of a rate on the wire: frames in so many seconds."""

UNKNOWN_TEMPERATURE = -(2**15)

_REPLY = struct.Struct("<IBB")
MOST_RUNS = 255
_LONGEST_REASON = 200  # bytes


class MessageKind(IntEnum):
    INFORMATION = 1
    SAMPLES = 2
    COMMAND = 3
    REPLY = 4


class Operation(IntEnum):
    """The commands that a host may send to a device."""

    HELLO = 1
    START = 2
    STOP = 3
    SCAN_LIST = 4
    RATE = 5
    GAIN = 6
    IDENTIFY = 7
    PING = 8


class Fault(IntEnum):
    """Why a device did not carry out a command; `NONE` when it did."""

    NONE = 0
    UNKNOWN_OPERATION = 1
    WRONG_LENGTH = 2
    OUT_OF_RANGE = 3
    NO_COMMON_VERSION = 4
    NOT_NOW = 5


class Information(NamedTuple):
    """The device's description of itself, as JSON text, sent at device `time` in s."""

    sequence: int
    time: float
    text: str


class Samples(NamedTuple):
    """One scan: `counts` (C,) of `channels` (C,) of the wire at device `time` in s."""

    sequence: int
    time: float
    channels: NDArray[np.intp]
    counts: Counts


class Command(NamedTuple):
    """A command of a host; `operation` is one of `Operation`, or an unknown number."""

    sequence: int
    operation: int
    arguments: bytes


class Reply(NamedTuple):
    """The reply to the `command` of that sequence number, sent at device `time` in s."""

    sequence: int
    time: float
    command: int
    operation: int
    fault: int
    data: bytes

    @property
    def reason(self) -> str:
        """Why it was refused, in the device's words."""
        return self.data.decode(errors="replace")


FromDevice = Information | Samples | Reply
Message = FromDevice | Command


def encode(kind: int, sequence: int, time: float, payload: bytes) -> bytes:
    """The bytes of a message made at `time` in s on the sender's clock."""
    if len(payload) > LONGEST:
        raise Refusal(f"expected a payload of at most {LONGEST} bytes, got {len(payload)}")
    header = MAGIC, VERSION, kind, len(payload), sequence % 2**32, round(time * 1e6)
    check = binascii.crc_hqx(HEADER.pack(*header, 0)[:CHECKED], 0)
    body = HEADER.pack(*header, check) + payload
    return body + CHECKSUM.pack(binascii.crc32(body))


def encode_information(sequence: int, time: float, text: str) -> bytes:
    """The bytes of an information message."""
    return encode(MessageKind.INFORMATION, sequence, time, text.encode())


def encode_samples(
    sequence: int, time: float, channels: NDArray[np.intp], counts: Counts, width: int
) -> bytes:
    """The bytes of a samples message with `width` (2 or 4) bytes per count."""
    return encode_scan(sequence, time, pack_runs(channels), counts, width)


def encode_scan(sequence: int, time: float, runs: bytes, counts: Counts, width: int) -> bytes:
    """The bytes of a samples message of the channels that `runs` holds, made by `pack_runs`."""
    payload = bytes([width]) + runs + counts.astype(f"<i{width}").tobytes()
    return encode(MessageKind.SAMPLES, sequence, time, payload)


def encode_command(sequence: int, time: float, operation: int, arguments: bytes = b"") -> bytes:
    """The bytes of a command."""
    return encode(MessageKind.COMMAND, sequence, time, bytes([operation]) + arguments)


def encode_reply(
    sequence: int, time: float, to: Command, fault: int = Fault.NONE, data: bytes = b""
) -> bytes:
    """The bytes of the reply to a command: its `data`, or the reason of a `fault`."""
    if fault:
        data = data[:_LONGEST_REASON]
    payload = _REPLY.pack(to.sequence, to.operation, fault) + data
    return encode(MessageKind.REPLY, sequence, time, payload)


def pack_runs(channels: Sequence[int] | NDArray[np.intp]) -> bytes:
    """The list of `channels` as a number of runs, then the first channel and length of each."""
    chosen = np.asarray(channels, np.intp)
    starts = np.flatnonzero(np.diff(chosen, prepend=-2) != 1)
    if len(starts) > MOST_RUNS:
        raise Refusal(f"expected at most {MOST_RUNS} runs of channels, got {len(starts)}")
    runs = [(int(chosen[s]), int(e - s)) for s, e in pairwise([*starts, len(chosen)])]
    return bytes([len(runs)]) + b"".join(struct.pack("<HH", *run) for run in runs)


def unpack_runs(data: bytes, most: int = LONGEST // 2) -> NDArray[np.intp] | None:
    """The channels of what `pack_runs` made; None if `data` is none, or has above `most`."""
    if not data or len(data) != 1 + 4 * data[0]:
        return None
    starts, lengths = np.frombuffer(data, "<u2", offset=1).reshape(-1, 2).astype(np.intp).T
    total = int(lengths.sum())
    if total > most:
        return None
    within = np.arange(total) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    return np.repeat(starts, lengths) + within


def read_command(sequence: int, payload: bytes) -> Command | None:
    """The command in `payload`, None when it is empty."""
    return Command(sequence, payload[0], payload[1:]) if payload else None


def read_reply(sequence: int, time: float, payload: bytes) -> Reply | None:
    """The reply in `payload`, None when it is too short for one."""
    if len(payload) < _REPLY.size:
        return None
    command, operation, fault = _REPLY.unpack_from(payload)
    return Reply(sequence, time, command, operation, fault, payload[_REPLY.size :])


def read_information(sequence: int, time: float, payload: bytes) -> Information | None:
    """The information in `payload`, None when that is no text."""
    try:
        return Information(sequence, time, payload.decode())
    except UnicodeDecodeError:
        return None
