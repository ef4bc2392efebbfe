"""Decoder of the wire: bytes to messages, with accounting."""

from binascii import crc32, crc_hqx
from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kappaskin.sources.wire import (
    CHECKED,
    CHECKSUM,
    HEAD,
    HEADER,
    LONGEST,
    MAGIC,
    VERSION,
    Message,
    MessageKind,
    Samples,
    read_command,
    read_information,
    read_reply,
    unpack_runs,
)

SEQUENCES = 2**32
"""Sequence numbers there are, before they begin again at 0."""

_LATE = 64  # how far back a sequence number may be late rather than a restart of the device

_SMALLEST_SHARE = 1e-5  # share below which its size is not told

FROM_DEVICE = frozenset((MessageKind.INFORMATION, MessageKind.SAMPLES, MessageKind.REPLY))
FROM_HOST = frozenset((MessageKind.COMMAND,))
_WHOLE = 0x2144DF1C  # the CRC-32 of any bytes that their own CRC-32 follows
_SAMPLES_KIND = int(MessageKind.SAMPLES)
_COUNTS = np.dtype(np.int32)
_LISTS = 64  # scan lists that are cached as arrays

_BLOCK = 2048  # bytes; the checksum of a longer message is computed from sums at their ends
_ZEROS = bytes(_BLOCK)
_ALL_ONES, _POLYNOMIAL = 0xFFFFFFFF, 0xEDB88320  # of the CRC-32, its highest power in bit 0


@dataclass(frozen=True, slots=True)
class Accounting:
    """Counts of every byte and every sequence number since a source was opened, by their fate.

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

    @property
    def words(self) -> str:
        """Losses as text, such as "12 of 30,210 messages lost; 0.3 % of bytes discarded"."""
        parts = [f"{self.lost:,} of {self.span:,} messages lost"]
        if thrown := self.bytes_discarded:
            why = ", ".join(f"{reason} {n:,}" for reason, n in self.discarded if n)
            parts.append(f"{_percent(thrown / self.bytes_in)} of bytes discarded: {why}")
        if self.restarts:
            times = "once" if self.restarts == 1 else f"{self.restarts} times"
            parts.append(f"the device restarted {times}")
        return "; ".join(parts)

    @property
    def balanced(self) -> bool:
        """Whether the three sums hold, as they always do."""
        return (
            self.bytes_in == self.bytes_good + self.bytes_discarded + self.buffered
            and self.good == self.accepted + self.duplicate
            and self.span == self.accepted + self.lost
        )


def _percent(share: float) -> str:
    return (
        f"under {100 * _SMALLEST_SHARE:g} %"
        if share < _SMALLEST_SHARE
        else f"{float(f'{100 * share:.2g}'):g} %"
    )


class SequenceCounter:
    """Counts accepted, duplicate, late and lost sequence numbers, through wrap and restart."""

    def __init__(self) -> None:
        self.good = self.accepted = self.duplicate = self.lost = self.span = self.restarts = 0
        self._next: int | None = None
        # The number expected when the connection was lost, and the first one since.
        self._before: int | None = None
        self._first: int | None = None
        self._missing: set[int] = set()

    def accounting(
        self,
        bytes_in: int,
        bytes_good: int,
        discarded: Counter[str],
        buffered: int,
        other_version: int | None = None,
    ) -> Accounting:
        """The balance of these bytes, with the numbers counted so far."""
        return Accounting(
            bytes_in,
            bytes_good,
            tuple(discarded.items()),
            buffered,
            self.good,
            self.accepted,
            self.duplicate,
            self.lost,
            self.span,
            self.restarts,
            other_version,
        )

    def take(self, sequence: int) -> bool:
        """Count one good message; False when it came before."""
        self.good += 1
        if sequence == self._next and not self._missing:  # nearly all of them
            self.span += 1
            self.accepted += 1
            self._next = (sequence + 1) % SEQUENCES
            return True
        if self._next is None:
            self._first = sequence
        expected = sequence if self._next is None else self._next
        gap = (sequence - expected) % SEQUENCES
        if gap < SEQUENCES // 2:
            self._advance(sequence, gap)
        elif SEQUENCES - gap > _LATE:
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

    def interrupt(self) -> None:
        """The connection was lost; `resume` says later whether the numbers continue."""
        if self._next is not None:
            self._before = self._next
        self._next = self._first = None
        self._missing.clear()

    def resume(self, same: bool) -> None:
        """Say whether the numbers since are of the `same` run of the device, or it restarted."""
        if self._before is None or self._first is None:
            return
        gap = (self._first - self._before) % SEQUENCES
        if same and gap < SEQUENCES // 2:
            self.lost += gap
            self.span += gap
        else:
            self.restarts += 1
        self._before = None

    def _advance(self, sequence: int, gap: int) -> None:
        self.lost += gap
        self.span += gap + 1
        self._next = (sequence + 1) % SEQUENCES
        recent = min(gap, _LATE)
        self._missing.update((sequence - q) % SEQUENCES for q in range(1, recent + 1))
        if self._missing:
            self._missing = {s for s in self._missing if (self._next - s) % SEQUENCES <= _LATE}


class _ScanList(NamedTuple):
    """The `head` of a samples payload, its channels and the type of counts; `size` of it all."""

    head: bytes
    size: int
    channels: NDArray[np.intp]
    kind: "np.dtype[np.signedinteger]"


_NO_LIST = _ScanList(b"", -1, np.empty(0, np.intp), np.dtype("<i2"))


def _followed_by_zeros(value: int, count: int) -> int:
    """The polynomial `value` times x^(8 count): the CRC register after `count` zero bytes."""
    return crc32(_ZEROS[:count], value ^ _ALL_ONES) ^ _ALL_ONES


def _product(a: int, b: int) -> int:
    """The product of two polynomials modulo that of the CRC-32; x^0 is in bit 31."""
    product = 0
    while a:
        if a & 1 << 31:
            product ^= b
        a = a << 1 & _ALL_ONES
        b = b >> 1 ^ (_POLYNOMIAL if b & 1 else 0)
    return product


def _powers() -> list[int]:
    """x^(8 n) for the length n of each number of blocks that a message may have."""
    powers = [1 << 31]
    while len(powers) <= (HEAD + LONGEST + CHECKSUM.size) // _BLOCK:
        powers.append(_followed_by_zeros(powers[-1], _BLOCK))
    return powers


_POWERS = _powers()


class _Buffer:
    """Bytes that arrived, from the first that is still needed, `at`, on.

    The checksum of any part of them takes bounded time, however long it is: of bytes A and then B,
    crc(AB) = crc(A) x^(8 |B|) + crc(B), and crc(A), crc(AB) are known at the ends of blocks. Else
    headers that announce long messages at every few bytes would have each byte summed thousands of
    times.
    """

    def __init__(self) -> None:
        self.data, self.at = bytearray(), 0
        self._sums = [0]  # CRC-32 of all before each block, from where they were begun

    def __len__(self) -> int:
        return len(self.data) - self.at

    def drop(self, at: int) -> None:
        """Only the bytes from `at` on are still needed."""
        blocks = at // _BLOCK
        if blocks:
            del self._sums[:blocks], self.data[: blocks * _BLOCK]
            self._sums = self._sums or [0]
        self.at = at - blocks * _BLOCK

    def crc32(self, start: int, stop: int) -> int:
        """The CRC-32 of the bytes from `start` to `stop`."""
        blocks, rest = divmod(stop - start, _BLOCK)
        before = _product(self._crc32_to(start), _POWERS[blocks])
        return self._crc32_to(stop) ^ _followed_by_zeros(before, rest)

    def _crc32_to(self, stop: int) -> int:
        block = stop // _BLOCK
        for begin in range((len(self._sums) - 1) * _BLOCK, block * _BLOCK, _BLOCK):
            self._sums.append(crc32(self.data[begin : begin + _BLOCK], self._sums[-1]))
        return crc32(self.data[block * _BLOCK : stop], self._sums[block])


class Decoder:
    """Finds the messages of `kinds` in bytes as they arrive; never raises.

    Its work for each byte is bounded, whatever the bytes.
    """

    def __init__(self, kinds: frozenset[MessageKind] = FROM_DEVICE) -> None:
        self.sequence = SequenceCounter()
        self._kinds = kinds
        self._buffer, self._needed = _Buffer(), HEAD  # looked at again once so many bytes are held
        self._bytes_in = self._bytes_good = 0
        self._discarded: Counter[str] = Counter()
        self._other_version: int | None = None
        self._lists: dict[bytes, _ScanList] = {}
        self._list = _NO_LIST  # of the last scan

    def feed(self, data: bytes) -> list[Message]:
        """The new messages in order, duplicates left out."""
        self._bytes_in += len(data)
        buffer = self._buffer
        buffer.data += data
        if len(buffer) < self._needed:
            return []
        # Parts of `bytes` are faster to take, unless much is held that was copied before.
        end, at, messages = len(buffer.data), buffer.at, list[Message]()
        stream = bytes(buffer.data) if end - len(data) <= 2 * _BLOCK else buffer.data
        take, unpack = self.sequence.take, HEADER.unpack_from
        while at + HEAD <= end:
            magic, version, kind, length, sequence, time_us, check = unpack(stream, at)
            if magic != MAGIC or length > LONGEST or crc_hqx(stream[at : at + CHECKED], 0) != check:
                at = self._skip(stream, at, "garbage")
                continue
            last = at + HEAD + length
            stop = last + CHECKSUM.size
            if stop > end:
                break
            short = stop - at <= _BLOCK
            if (crc32(stream[at:stop]) if short else buffer.crc32(at, stop)) != _WHOLE:
                at = self._skip(stream, at, "checksum")
                continue
            if version != VERSION:
                self._other_version = version
                message = "version"
            elif kind not in self._kinds:
                message = "unknown kind"
            elif kind == _SAMPLES_KIND:
                message = self._samples(sequence, time_us * 1e-6, stream, at + HEAD, last)
            else:
                message = _read(kind, sequence, time_us * 1e-6, bytes(stream[at + HEAD : last]))
            if isinstance(message, str):
                self._discarded[message] += stop - at
            else:
                self._bytes_good += stop - at
                if take(sequence):
                    messages.append(message)
            at = stop
        else:
            stop = at + HEAD
        buffer.drop(at)
        self._needed = stop - at
        return messages

    def _skip(self, stream: bytes | bytearray, at: int, reason: str) -> int:
        """Discard bytes up to where the next message may begin; where that is."""
        found = stream.find(MAGIC, at + 1)
        if found < 0:
            found = max(at + 1, len(stream) - stream.endswith(MAGIC[:1]))
        self._discarded[reason] += found - at
        return found

    def _samples(
        self, sequence: int, time: float, stream: bytes | bytearray, at: int, stop: int
    ) -> Samples | str:
        head, size, channels, kind = self._list
        if stop - at != size or not stream.startswith(head, at):  # seldom: it changes with the scan
            if not self._take_list(stream, at, stop):
                return "content"
            head, size, channels, kind = self._list
        counts = np.frombuffer(stream, kind, len(channels), at + len(head)).astype(_COUNTS)
        return Samples(sequence, time, channels, counts)

    def _take_list(self, stream: bytes | bytearray, at: int, stop: int) -> bool:
        """Use the list of channels that a payload begins with; whether it is a valid one."""
        if stop - at < 2:
            return False
        head = bytes(stream[at : at + 2 + 4 * stream[at + 1]])
        found = self._lists.get(head) or self._new_list(head, stop - at)
        if found is None or found.size != stop - at:
            return False
        self._list = found
        return True

    def _new_list(self, head: bytes, size: int) -> _ScanList | None:
        """The list of a payload of `size` bytes; a longer list is none, and is not expanded."""
        width = head[0]
        most = (size - len(head)) // width if width in (2, 4) else -1
        channels = unpack_runs(head[1:], most)
        if channels is None:
            return None
        channels.flags.writeable = False  # every scan of this list shares it
        if len(self._lists) == _LISTS:
            self._lists.clear()
        found = _ScanList(head, len(head) + width * len(channels), channels, np.dtype(f"<i{width}"))
        self._lists[head] = found
        return found

    @property
    def held(self) -> bytes:
        """The bytes that wait for more."""
        return bytes(self._buffer.data[self._buffer.at :])

    def accounting(self, overrun: int = 0) -> Accounting:
        """The balance so far, with `overrun` bytes that came but were never fed."""
        return self.sequence.accounting(
            self._bytes_in + overrun,
            self._bytes_good,
            self._discarded + Counter(overrun=overrun),
            len(self._buffer),
            self._other_version,
        )

    def line_ended(self) -> None:
        """Count what is buffered as cut off: the rest of it will not arrive."""
        if held := len(self._buffer):
            self._discarded["cut off"] += held
            self._buffer, self._needed = _Buffer(), HEAD


def _read(kind: int, sequence: int, time: float, payload: bytes) -> Message | str:
    """The message in a payload, or why there is none."""
    if kind == MessageKind.INFORMATION:
        return read_information(sequence, time, payload) or "content"
    if kind == MessageKind.REPLY:
        return read_reply(sequence, time, payload) or "content"
    return read_command(sequence, payload) or "content"
