"""The wire format: bytes to messages and back, with every byte and sequence number accounted for.

A message is `version, kind (1 byte each), sequence (4), device time in us (8)`, its payload, and
the CRC-32 of all that (4), little-endian, encoded by COBS (consistent overhead byte stuffing,
doi:10.1109/90.769765) so that it holds no zero byte, and ended by a zero byte. Every message, of
either kind, spends one sequence number.

- kind 1, information: what the device is, as UTF-8 JSON (see `information`);
- kind 2, samples: bytes per count (1 byte, 2 or 4), number of channel runs (1), for each run its
  first channel and its length (2 each), then one signed count for each channel of each run.
"""

import binascii
import struct
from collections import Counter
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import Refusal
from kappaskin.frames import Counts

VERSION = 1
INFORMATION, SAMPLES = 1, 2
LONGEST = 2**20
"""Bytes after which a message without an end is given up: four times 65,535 counts of 4 bytes."""

_HEADER = struct.Struct("<BBIQ")
_CHECKSUM = struct.Struct("<I")
_SEQUENCES = 2**32
_LATE = 64  # how far back a sequence number may be late rather than a restart of the device


def cobs_encode(data: bytes) -> bytes:
    """`data` without zero bytes, by COBS; the delimiter is not added."""
    out = bytearray()
    for block in data.split(b"\0"):
        while len(block) >= 254:
            out += b"\xff" + block[:254]
            block = block[254:]
        out.append(len(block) + 1)
        out += block
    return bytes(out)


def cobs_decode(data: bytes) -> bytes | None:
    """The bytes that `cobs_encode` made `data` from, None when it cannot have."""
    blocks: list[bytes] = []
    at, end = 0, len(data)
    while at < end:
        code = data[at]
        block = data[at + 1 : at + code]
        if not code or len(block) != code - 1:
            return None
        blocks.append(block)
        at += code
        if code < 255 and at < end:
            blocks.append(b"\0")
    return b"".join(blocks)


@dataclass(frozen=True, slots=True)
class Information:
    """What the device says it is, as JSON text."""

    sequence: int
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """One scan: `counts` (C,) of `channels` (C,) at device `time` in s."""

    sequence: int
    time: float
    channels: NDArray[np.intp]
    counts: Counts


Message = Information | Samples


def _encode(kind: int, sequence: int, time: float, payload: bytes) -> bytes:
    head = _HEADER.pack(VERSION, kind, sequence % _SEQUENCES, round(time * 1e6))
    body = head + payload
    return cobs_encode(body + _CHECKSUM.pack(binascii.crc32(body))) + b"\0"


def encode_information(sequence: int, time: float, text: str) -> bytes:
    """The bytes of an information message, delimiter included."""
    return _encode(INFORMATION, sequence, time, text.encode())


def encode_samples(
    sequence: int, time: float, channels: NDArray[np.intp], counts: Counts, width: int
) -> bytes:
    """The bytes of a samples message with `width` (2 or 4) bytes per count."""
    starts = np.flatnonzero(np.diff(channels, prepend=-2) != 1)
    if len(starts) > 255:
        raise Refusal(f"expected at most 255 runs of channels, got {len(starts)}")
    runs = [(int(channels[s]), int(e - s)) for s, e in pairwise([*starts, len(channels)])]
    payload = struct.pack("<BB", width, len(runs))
    payload += b"".join(struct.pack("<HH", *run) for run in runs)
    return _encode(SAMPLES, sequence, time, payload + counts.astype(f"<i{width}").tobytes())


def _samples(sequence: int, time: float, payload: memoryview) -> Samples | None:
    if len(payload) < 2 or payload[0] not in (2, 4):
        return None
    width, runs = payload[0], payload[1]
    start = 2 + 4 * runs
    if len(payload) < start:
        return None
    table = np.frombuffer(payload[2:start], "<u2").reshape(runs, 2).astype(np.intp)
    if len(payload) - start != width * int(table[:, 1].sum()):
        return None
    starts, lengths = table[:, 0], table[:, 1]
    within = np.arange(int(lengths.sum())) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    channels = np.repeat(starts, lengths) + within
    counts = np.frombuffer(payload[start:], f"<i{width}").astype(np.int32)
    return Samples(sequence, time, channels, counts)


def _message(kind: int, sequence: int, time: float, payload: memoryview) -> Message | None:
    if kind == SAMPLES:
        return _samples(sequence, time, payload)
    try:
        return Information(sequence, bytes(payload).decode())
    except UnicodeDecodeError:
        return None


@dataclass(frozen=True, slots=True)
class Accounting:
    """What became of every byte and every sequence number since a source was opened.

    bytes_in = bytes_good + sum of discarded + buffered; good = accepted + duplicate;
    span = accepted + lost.
    """

    bytes_in: int = 0
    bytes_good: int = 0
    discarded: tuple[tuple[str, int], ...] = ()
    buffered: int = 0
    good: int = 0
    accepted: int = 0
    duplicate: int = 0
    lost: int = 0
    span: int = 0
    restarts: int = 0
    other_version: int | None = None

    @property
    def bytes_discarded(self) -> int:
        return sum(n for _, n in self.discarded)


class Sequence:
    """Tells accepted, duplicate, late and lost sequence numbers apart, through wrap and restart."""

    def __init__(self) -> None:
        self.good = self.accepted = self.duplicate = self.lost = self.span = self.restarts = 0
        self._next: int | None = None
        self._missing: set[int] = set()

    def take(self, sequence: int) -> bool:
        """Count one good message; False when it came before."""
        self.good += 1
        expected = sequence if self._next is None else self._next
        ahead = (sequence - expected) % _SEQUENCES
        if ahead < _SEQUENCES // 2:
            self._advance(sequence, ahead)
        elif _SEQUENCES - ahead > _LATE:
            self.restarts += 1
            self._missing.clear()
            self._advance(sequence, 0)
        elif sequence in self._missing:
            self._missing.remove(sequence)
            self.lost -= 1
        else:
            self.duplicate += 1
            return False
        self.accepted += 1
        return True

    def _advance(self, sequence: int, gap: int) -> None:
        self.lost += gap
        self.span += gap + 1
        self._next = (sequence + 1) % _SEQUENCES
        recent = min(gap, _LATE)
        self._missing.update((sequence - q) % _SEQUENCES for q in range(1, recent + 1))
        if self._missing:
            self._missing = {s for s in self._missing if (self._next - s) % _SEQUENCES <= _LATE}


class Decoder:
    """Takes bytes as they come, cut anywhere, and gives the messages they hold; never raises."""

    def __init__(self) -> None:
        self.sequence = Sequence()
        self._buffer = bytearray()
        self._too_long = False
        self._bytes_in = self._bytes_good = 0
        self._discarded: Counter[str] = Counter()
        self._other_version: int | None = None

    def feed(self, data: bytes) -> list[Message]:
        """The new messages in order, duplicates left out."""
        self._bytes_in += len(data)
        self._buffer += data
        *ended, rest = bytes(self._buffer).split(b"\0") if b"\0" in data else (self._buffer,)
        messages = [message for piece in ended if (message := self._piece(piece))]
        self._buffer = bytearray(rest)
        if self._too_long or len(self._buffer) > LONGEST:
            self._too_long = True
            self._discarded["too long"] += len(self._buffer)
            self._buffer.clear()
        return messages

    def _piece(self, piece: bytes) -> Message | None:
        size = len(piece) + 1
        message = self._decoded(piece)
        if isinstance(message, str):
            self._discarded[message] += size
            return None
        self._bytes_good += size
        return message if self.sequence.take(message.sequence) else None

    def _decoded(self, piece: bytes) -> Message | str:
        """The message in the bytes between two delimiters, or why there is none."""
        if self._too_long:
            self._too_long = False
            return "too long"
        if not piece:
            return "empty"
        body = cobs_decode(piece)
        if body is None:
            return "encoding"
        if len(body) < _HEADER.size + _CHECKSUM.size:
            return "too short"
        end = len(body) - _CHECKSUM.size
        if _CHECKSUM.unpack_from(body, end)[0] != binascii.crc32(memoryview(body)[:end]):
            return "checksum"
        version, kind, sequence, time_us = _HEADER.unpack_from(body)
        if version != VERSION:
            self._other_version = version
            return "version"
        if kind not in (INFORMATION, SAMPLES):
            return "unknown kind"
        payload = memoryview(body)[_HEADER.size : end]
        return _message(kind, sequence, time_us * 1e-6, payload) or "content"

    def accounting(self, overrun: int = 0) -> Accounting:
        """The balance so far, with `overrun` bytes that came but were never fed."""
        counts = self.sequence
        discarded = self._discarded + Counter(overrun=overrun)
        return Accounting(
            self._bytes_in + overrun,
            self._bytes_good,
            tuple(discarded.items()),
            len(self._buffer),
            counts.good,
            counts.accepted,
            counts.duplicate,
            counts.lost,
            counts.span,
            counts.restarts,
            self._other_version,
        )
