"""The simulator behind the wire format on a pseudo-terminal: the other end of the line."""

import os
import select
import time
import tty
from collections.abc import Callable
from contextlib import suppress

from kappaskin.effects import CorruptedFrames, DroppedFrames
from kappaskin.scene import Scene
from kappaskin.simulate import Simulator
from kappaskin.sources import information
from kappaskin.sources.wire import encode_information, encode_samples

_OUTBOX = 2**19  # bytes held before a frame goes unsent: more than a second of a full scan
_LINGER = 0.3  # s
_INTRODUCTION = 0.5  # s between two information messages


class PseudoDevice:
    """A scene that speaks the wire format on `port`; spends a sequence number on every message.

    It is quiet until someone opens the port, and again after they close it. `unsent` counts the
    messages that found the outbox full or were in it at the end, `spent` all of them.
    """

    def __init__(self, scene: Scene, clock: Callable[[], float] = time.monotonic) -> None:
        self._simulator, self._clock = Simulator(scene), clock
        self._information = information.to_json(scene.sensor())
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        # With no other holder of the slave end, a hang-up on the master says nobody listens.
        os.close(slave)
        os.set_blocking(self._master, False)
        self._width = 2 if scene.transduction.converter.bits <= 16 else 4
        self._outbox = bytearray()
        self.rate = scene.rate
        self.spent = self.unsent = self.samples = 0

    def serve(self, stopped: Callable[[], bool]) -> None:
        """Send until `stopped()`; each listener gets a fresh clock and an introduction."""
        while not stopped():
            if self._hung_up():
                time.sleep(0.02)
                continue
            self._stream(stopped)
            self._flush()
            self.unsent += self._outbox.count(0)  # each message ends with its only zero byte
            self._outbox.clear()

    def _hung_up(self) -> bool:
        poll = select.poll()
        poll.register(self._master, select.POLLOUT)
        return any(event & select.POLLHUP for _, event in poll.poll(0))

    def _stream(self, stopped: Callable[[], bool]) -> None:
        rate = self.rate
        start, introduced = self._clock() - self.samples / rate, -_INTRODUCTION
        while not (stopped() or self._hung_up()):
            now = self._clock() - start
            if now - introduced >= _INTRODUCTION:
                introduced = now
                self._send(encode_information(self.spent, now, self._information))
            while self.samples / rate <= now:
                self._send_samples()
            self._flush()
            wait = self.samples / rate - (self._clock() - start)
            select.select([], [self._master] if self._outbox else [], [], max(0.0, min(wait, 0.05)))

    def _send_samples(self) -> None:
        frame = self._simulator.frame(self.samples, self._clock)
        self.samples += 1
        message = encode_samples(
            self.spent, frame.device_time, frame.channels, frame.counts, self._width
        )
        match self._simulator.failure(self.samples - 1):
            case DroppedFrames.name:
                self.spent += 1
            case CorruptedFrames.name:
                self._send(_corrupted(message))
            case _:
                self._send(message)

    def _send(self, message: bytes) -> None:
        self.spent += 1
        if len(self._outbox) + len(message) > _OUTBOX:
            self.unsent += 1
        else:
            self._outbox += message

    def _flush(self) -> None:
        with suppress(OSError):  # full, or nobody listens any more: what stays is told as unsent
            while self._outbox:
                del self._outbox[: os.write(self._master, self._outbox[:4096])]

    def close(self) -> None:
        """Close the port, after a moment for a listener to take what it was sent."""
        if not self._hung_up():
            time.sleep(_LINGER)  # what is unread when the last holder closes is thrown away
        os.close(self._master)


def _corrupted(message: bytes) -> bytes:
    """The message with a bit in its middle turned over, and its end where it was."""
    spoilt = bytearray(message)
    middle = len(spoilt) // 2
    spoilt[middle] ^= 1 if spoilt[middle] != 1 else 2
    return bytes(spoilt)
