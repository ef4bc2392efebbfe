"""A stream of bytes, cut anywhere, to the messages in it; nothing is lost without being counted."""

from binascii import crc32, crc_hqx
from collections import Counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kappaskin.sources.accounting import Accounting, Sequence
from kappaskin.sources.wire import (
    CHECKED,
    CHECKSUM,
    HEAD,
    HEADER,
    LONGEST,
    MAGIC,
    VERSION,
    Kind,
    Message,
    Samples,
    read_command,
    read_information,
    read_reply,
    unpack_runs,
)

FROM_DEVICE = frozenset((Kind.INFORMATION, Kind.SAMPLES, Kind.REPLY))
FROM_HOST = frozenset((Kind.COMMAND,))

_LISTS = 64  # scan lists that are remembered as arrays


class _List(NamedTuple):
    """A list of channels as samples begin with, and how its counts are told."""

    channels: NDArray[np.intp]
    kind: "np.dtype[np.signedinteger]"
    size: int


class Decoder:
    """Takes bytes as they come and gives the messages of `kinds` in them; never raises."""

    def __init__(self, kinds: frozenset[Kind] = FROM_DEVICE) -> None:
        self.sequence = Sequence()
        self._kinds = kinds
        self._buffer = bytearray()
        self._needed = HEAD
        self._bytes_in = self._bytes_good = 0
        self._discarded: Counter[str] = Counter()
        self._other_version: int | None = None
        self._lists: dict[bytes, _List] = {}

    def feed(self, data: bytes) -> list[Message]:
        """The new messages in order, duplicates left out."""
        self._bytes_in += len(data)
        self._buffer += data
        end = len(self._buffer)
        if end < self._needed:
            return []
        stream, messages, at = bytes(self._buffer), list[Message](), 0
        while at + HEAD <= end:
            head = HEADER.unpack_from(stream, at)
            magic, length, check = head[0], head[3], head[6]
            if magic != MAGIC or crc_hqx(stream[at : at + CHECKED], 0) != check or length > LONGEST:
                at = self._skip(stream, at, "garbage")
                continue
            last = at + HEAD + length
            stop = last + CHECKSUM.size
            if stop > end:
                break
            if CHECKSUM.unpack_from(stream, last)[0] != crc32(stream[at:last]):
                at = self._skip(stream, at, "checksum")
                continue
            message = self._message(head, stream, at + HEAD, last)
            if isinstance(message, str):
                self._discarded[message] += stop - at
            else:
                self._bytes_good += stop - at
                if self.sequence.take(message[0]):
                    messages.append(message)
            at = stop
        else:
            stop = at + HEAD
        self._buffer, self._needed = bytearray(stream[at:]), stop - at
        return messages

    def _skip(self, stream: bytes, at: int, reason: str) -> int:
        """Throw bytes away up to where the next message may begin; where that is."""
        found = stream.find(MAGIC, at + 1)
        if found < 0:
            found = max(at + 1, len(stream) - stream.endswith(MAGIC[:1]))
        self._discarded[reason] += found - at
        return found

    def _message(self, head: tuple[int, ...], stream: bytes, at: int, stop: int) -> Message | str:
        """What is said from `at` to `stop` under this header, or why it means nothing."""
        _, version, kind, _, sequence, time_us, _ = head
        if version != VERSION:
            self._other_version = version
            return "version"
        if kind not in self._kinds:
            return "unknown kind"
        if kind == Kind.SAMPLES:
            return self._samples(sequence, time_us * 1e-6, stream, at, stop) or "content"
        return _read(kind, sequence, time_us * 1e-6, stream[at:stop]) or "content"

    def _samples(
        self, sequence: int, time: float, stream: bytes, at: int, stop: int
    ) -> Samples | None:
        if stop - at < 2:
            return None
        start = at + 2 + 4 * stream[at + 1]
        head = stream[at:start]
        scan = self._lists.get(head) or self._list(head)
        if scan is None or stop - start != scan.size:
            return None
        counts = np.frombuffer(stream, scan.kind, len(scan.channels), start).astype(np.int32)
        return Samples(sequence, time, scan.channels, counts)

    def _list(self, head: bytes) -> _List | None:
        width, channels = head[0], unpack_runs(head[1:])
        if width not in (2, 4) or channels is None:
            return None
        channels.flags.writeable = False  # every scan of this list shares it
        if len(self._lists) == _LISTS:
            self._lists.clear()
        found = _List(channels, np.dtype(f"<i{width}"), width * len(channels))
        self._lists[head] = found
        return found

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

    def line_ended(self) -> None:
        """Count what is buffered as cut off: the rest of it will not come."""
        if self._buffer:
            self._discarded["cut off"] += len(self._buffer)
            self._buffer, self._needed = bytearray(), HEAD


def _read(kind: int, sequence: int, time: float, payload: bytes) -> Message | None:
    if kind == Kind.INFORMATION:
        return read_information(sequence, time, payload)
    if kind == Kind.REPLY:
        return read_reply(sequence, time, payload)
    return read_command(sequence, payload)
