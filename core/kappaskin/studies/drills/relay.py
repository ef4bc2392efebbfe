"""A pseudo-terminal between a device and a program: messages in, the same messages spoilt out."""

import os
import tty
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

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
