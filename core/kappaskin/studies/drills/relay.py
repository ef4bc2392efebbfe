"""The relay between a device and a program, and the faults that it puts into messages and bytes."""

import json
import os
import struct
import tty
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kappaskin.frames import Counts
from kappaskin.sources import Decoder, SerialConnection, wire

_OUTBOX = 2**21  # bytes that wait; beyond it a message goes unsent, as from a device
_BLOCK = 4096
_KEPT = 16384  # scans that are remembered: more than wait anywhere

Rewrite = Callable[[wire.FromDevice], list[wire.FromDevice]]
Spoil = Callable[[bytes], bytes]


def unchanged(message: wire.FromDevice) -> list[wire.FromDevice]:
    return [message]


def clean(data: bytes) -> bytes:
    return data


class Relay:
    """Passes what `device` sends to whoever opens `port`, and back what they ask for.

    It numbers the messages anew: `sent` keeps the counts of every scan under its number until they
    are asked for, `spent` counts numbers. `rewrite` makes other messages of each, `spoil` other
    bytes of those; `held` keeps bytes back, `deaf` leaves commands unread. Works when `pump` is
    called, and only then.
    """

    def __init__(self, device: SerialConnection, folder: Path) -> None:
        self._device, self._decoder = device, Decoder()
        self._link = folder / "port"
        self.port = str(self._link)
        self.rewrite: Rewrite = unchanged
        self.spoil: Spoil = clean
        self.held = self.deaf = False
        self.sequence = self.spent = self.written = 0
        self.sent: dict[int, Counts] = {}
        self._outbox: deque[bytes] = deque()
        self._waiting = 0
        self._master = -1
        self.plug()

    def plug(self) -> None:
        """Let there be a port."""
        self._master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        self._link.symlink_to(os.ttyname(slave))
        os.close(slave)

    def unplug(self) -> None:
        """Let there be none; what was under way is lost."""
        if self._master >= 0:
            os.close(self._master)
            self._link.unlink()
        self._master = -1
        self._outbox.clear()
        self._waiting = 0

    @property
    def speed(self) -> int:
        """The baud rate that the program has set, as the system numbers it."""
        import termios

        return termios.tcgetattr(self._master)[5]

    @property
    def empty(self) -> bool:
        return not self._outbox

    def pump(self) -> None:
        """Pass on what has come."""
        for _, data in self._device.take(0.0):
            for message in self._decoder.feed(data):
                if not isinstance(message, wire.Command):
                    for made in self.rewrite(message):
                        self.send(made)
        if not self.held:
            self.flush()
        if not self.deaf and self._master >= 0:
            with suppress(OSError):  # nothing came, or nobody is there
                self._device.write(os.read(self._master, _BLOCK))

    def forget(self) -> None:
        """Throw away what the device has sent."""
        for _, data in self._device.take(0.0):
            self._decoder.feed(data)

    def ignore(self) -> None:
        """Throw away what the program asks for."""
        with suppress(OSError):  # nothing more
            while os.read(self._master, _BLOCK):
                pass

    def send(self, message: wire.FromDevice) -> bytes:
        """Send a message under the next number; its bytes before they are spoilt."""
        number, self.sequence = self.sequence, (self.sequence + 1) % 2**32
        self.spent += 1
        if isinstance(message, wire.Samples):
            self.sent[number] = message.counts
            if len(self.sent) > _KEPT:
                del self.sent[next(iter(self.sent))]
        whole = _bytes_of(message, number)
        self.write(self.spoil(whole))
        return whole

    def write(self, data: bytes) -> None:
        """Send these bytes, if there is a port and room."""
        if data and self._master >= 0 and self._waiting + len(data) <= _OUTBOX:
            self._outbox.append(data)
            self._waiting += len(data)

    def flush(self, most: int = _OUTBOX) -> None:
        """Write what waits, `most` bytes of it, or as many as there is room for."""
        with suppress(OSError):  # full, or nobody listens
            while self._outbox and most > 0 and self._master >= 0:
                data = self._outbox[0]
                done = os.write(self._master, data[: min(most, _BLOCK)])
                self.written += done
                self._waiting -= done
                most -= done
                if done == len(data):
                    self._outbox.popleft()
                else:
                    self._outbox[0] = data[done:]


def _bytes_of(message: wire.FromDevice, number: int) -> bytes:
    if isinstance(message, wire.Information):
        return wire.encode_information(number, message.time, message.text)
    if isinstance(message, wire.Reply):
        command = wire.Command(message.command, message.operation, b"")
        return wire.encode_reply(number, message.time, command, message.fault, message.data)
    narrow = abs(message.counts).max(initial=0) < 2**15
    return wire.encode_samples(
        number, message.time, message.channels, message.counts, 2 if narrow else 4
    )


# Faults of messages, before they are numbered

_ANSWER = struct.Struct("<Qh")  # as to a ping: when it came in us, how warm it is


@dataclass
class ClockShift:
    """As from a device whose clock is `ahead` s fast; no time is before 0."""

    ahead: float

    def __call__(self, message: wire.FromDevice) -> list[wire.FromDevice]:
        if (
            isinstance(message, wire.Reply)
            and message.operation == wire.Operation.PING
            and not message.fault
        ):
            received_us, temperature = _ANSWER.unpack(message.data)
            received_us = max(0, received_us + round(self.ahead * 1e6))
            message = message._replace(data=_ANSWER.pack(received_us, temperature))
        return [message._replace(time=max(0.0, message.time + self.ahead))]


@dataclass
class InformationChange:
    """As from a device that reports `value` under `key` of its description."""

    key: str
    value: str

    def __call__(self, message: wire.FromDevice) -> list[wire.FromDevice]:
        if not isinstance(message, wire.Information):
            return [message]
        return [
            message._replace(text=json.dumps(json.loads(message.text) | {self.key: self.value}))
        ]


def without_information(message: wire.FromDevice) -> list[wire.FromDevice]:
    """As from a device that does not describe itself."""
    return [] if isinstance(message, wire.Information) else [message]


# Faults of bytes under way

_BURST = 64  # bytes, the mean of a burst of garbage
_KIND = 3  # the place of a message's kind


@dataclass
class Garbage:
    """Bursts of noise in the place of `share` of the bytes, or as many between them, at random."""

    share: float
    rng: np.random.Generator

    def __call__(self, data: bytes) -> bytes:
        spoilt = bytearray(data)
        for _ in range(self.rng.poisson(self.share * len(data) / _BURST)):
            length = int(self.rng.geometric(1 / _BURST))
            at = int(self.rng.integers(len(spoilt) + 1))
            over = length if self.rng.random() < 0.5 else 0
            spoilt[at : at + over] = self.rng.bytes(length)
        return bytes(spoilt)


@dataclass
class FlippedBits:
    """One bit in `every` so many turned over, at random."""

    every: int
    rng: np.random.Generator

    def __call__(self, data: bytes) -> bytes:
        spoilt = bytearray(data)
        for place in self.rng.integers(
            8 * len(data), size=self.rng.poisson(8 * len(data) / self.every)
        ):
            spoilt[place // 8] ^= 1 << (place % 8)
        return bytes(spoilt)


@dataclass
class CutScans:
    """Every second scan is broken off, one byte later each time; `cuts` counts them."""

    cuts: int = 0
    length: int = 1
    whole: bool = True

    def __call__(self, data: bytes) -> bytes:
        if data[_KIND] != wire.MessageKind.SAMPLES:
            return data
        self.whole, self.length = not self.whole, len(data)
        if self.whole:
            return data
        self.cuts += 1
        return data[: (self.cuts - 1) % len(data)]


@dataclass
class OtherBaudRate:
    """The line is read at another baud rate than it is sent at."""

    sent_at: float
    read_at: float

    def __call__(self, data: bytes) -> bytes:
        return received_at(data, self.sent_at, self.read_at)


# A receiver at another baud rate


def _levels(data: bytes) -> NDArray[np.uint8]:
    """The line while `data` passes, a level for each bit: start, eight data bits, stop."""
    bits = np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little").reshape(-1, 8)
    framed = np.ones((len(data), 10), np.uint8)
    framed[:, 0], framed[:, 1:9] = 0, bits
    return framed.ravel()


def received_at(data: bytes, sent_at: float, read_at: float) -> bytes:
    """What a receiver at the baud rate `read_at` takes for bytes when `data` is sent at another.

    It waits for the line to fall, samples the middle of eight bits, lowest first, and of a stop
    bit; whether that is one is not checked, as systems do by default.
    """
    line = np.append(_levels(data), np.ones(10, np.uint8))
    step = sent_at / read_at  # bits of the sender per bit of the receiver
    falls = np.flatnonzero(np.diff(line.astype(np.int8), prepend=1) < 0)
    middles = ((np.arange(1, 9) + 0.5) * step).astype(np.intp)
    sampled = np.minimum(falls[:, None] + middles, len(line) - 1)
    values = np.packbits(line[sampled], axis=1, bitorder="little").ravel().tolist()
    # A line that is still low in the middle of the stop bit must rise before it can fall again.
    following = np.searchsorted(falls, falls + 9.5 * step).tolist()
    made, at = bytearray(), 0
    while at < len(values):
        made.append(values[at])
        at = following[at]
    return bytes(made)


def speed_code(baud_rate: int) -> int:
    """How the system numbers a baud rate."""
    import termios

    return getattr(termios, f"B{baud_rate}", baud_rate)
