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

_WHOLE = 0x2144DF1C  # the CRC-32 of any bytes that their own CRC-32 follows
_SAMPLES = int(Kind.SAMPLES)
_COUNTS = np.dtype(np.int32)
_LISTS = 64  # scan lists that are remembered as arrays


class _List(NamedTuple):
    """The `head` of a samples payload, its channels and how counts are told; `size` of it all."""

    head: bytes
    size: int
    channels: NDArray[np.intp]
    kind: "np.dtype[np.signedinteger]"


_NO_LIST = _List(b"", -1, np.empty(0, np.intp), np.dtype("<i2"))


class Decoder:
    """Takes bytes as they come and gives the messages of `kinds` in them; never raises."""

    def __init__(self, kinds: frozenset[Kind] = FROM_DEVICE) -> None:
        self.sequence = Sequence()
        self._kinds = kinds
        self._parts: list[bytes] = []  # joined once they may hold a message, not at every read
        self._held, self._needed = 0, HEAD
        self._bytes_in = self._bytes_good = 0
        self._discarded: Counter[str] = Counter()
        self._other_version: int | None = None
        self._lists: dict[bytes, _List] = {}
        self._list = _NO_LIST  # of the last scan

    def feed(self, data: bytes) -> list[Message]:
        """The new messages in order, duplicates left out."""
        self._bytes_in += len(data)
        self._parts.append(data)
        self._held = end = self._held + len(data)
        if end < self._needed:
            return []
        stream, messages, at = b"".join(self._parts), list[Message](), 0
        take, unpack = self.sequence.take, HEADER.unpack_from
        while at + HEAD <= end:
            magic, version, kind, length, sequence, time_us, check = unpack(stream, at)
            if magic != MAGIC or crc_hqx(stream[at : at + CHECKED], 0) != check or length > LONGEST:
                at = self._skip(stream, at, "garbage")
                continue
            last = at + HEAD + length
            stop = last + CHECKSUM.size
            if stop > end:
                break
            if crc32(stream[at:stop]) != _WHOLE:
                at = self._skip(stream, at, "checksum")
                continue
            if version != VERSION:
                self._other_version = version
                message = "version"
            elif kind not in self._kinds:
                message = "unknown kind"
            elif kind == _SAMPLES:
                message = self._samples(sequence, time_us * 1e-6, stream, at + HEAD, last)
            else:
                message = _read(kind, sequence, time_us * 1e-6, stream[at + HEAD : last])
            if isinstance(message, str):
                self._discarded[message] += stop - at
            else:
                self._bytes_good += stop - at
                if take(sequence):
                    messages.append(message)
            at = stop
        else:
            stop = at + HEAD
        self._parts, self._held, self._needed = [stream[at:]], end - at, stop - at
        return messages

    def _skip(self, stream: bytes, at: int, reason: str) -> int:
        """Throw bytes away up to where the next message may begin; where that is."""
        found = stream.find(MAGIC, at + 1)
        if found < 0:
            found = max(at + 1, len(stream) - stream.endswith(MAGIC[:1]))
        self._discarded[reason] += found - at
        return found

    def _samples(
        self, sequence: int, time: float, stream: bytes, at: int, stop: int
    ) -> Samples | str:
        head, size, channels, kind = self._list
        if stop - at != size or not stream.startswith(head, at):  # seldom: it changes with the scan
            if not self._take_list(stream, at, stop):
                return "content"
            head, size, channels, kind = self._list
        counts = np.frombuffer(stream, kind, len(channels), at + len(head)).astype(_COUNTS)
        return Samples(sequence, time, channels, counts)

    def _take_list(self, stream: bytes, at: int, stop: int) -> bool:
        """Go over to the list of channels that a payload begins with; whether it is one."""
        if stop - at < 2:
            return False
        head = stream[at : at + 2 + 4 * stream[at + 1]]
        found = self._lists.get(head) or self._new_list(head)
        if found is None or found.size != stop - at:
            return False
        self._list = found
        return True

    def _new_list(self, head: bytes) -> _List | None:
        width, channels = head[0], unpack_runs(head[1:])
        if width not in (2, 4) or channels is None:
            return None
        channels.flags.writeable = False  # every scan of this list shares it
        if len(self._lists) == _LISTS:
            self._lists.clear()
        size = len(head) + width * len(channels)
        found = _List(head, size, channels, np.dtype(f"<i{width}"))
        self._lists[head] = found
        return found

    @property
    def held(self) -> bytes:
        """The bytes that wait for more."""
        return b"".join(self._parts)

    def accounting(self, overrun: int = 0) -> Accounting:
        """The balance so far, with `overrun` bytes that came but were never fed."""
        counts = self.sequence
        discarded = self._discarded + Counter(overrun=overrun)
        return Accounting(
            self._bytes_in + overrun,
            self._bytes_good,
            tuple(discarded.items()),
            self._held,
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
        if self._held:
            self._discarded["cut off"] += self._held
            self._parts, self._held, self._needed = [], 0, HEAD


def _read(kind: int, sequence: int, time: float, payload: bytes) -> Message | str:
    """What a payload says, or why it means nothing."""
    if kind == Kind.INFORMATION:
        return read_information(sequence, time, payload) or "content"
    if kind == Kind.REPLY:
        return read_reply(sequence, time, payload) or "content"
    return read_command(sequence, payload) or "content"
