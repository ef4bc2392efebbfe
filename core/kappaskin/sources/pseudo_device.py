"""Simulated device: a scene that speaks the wire format on a pseudo-terminal."""

import os
import select
import struct
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Frame, Indices
from kappaskin.scenes import Scene, Simulator
from kappaskin.scenes.effects import CorruptedFrames, DroppedFrames, ReadingEffect
from kappaskin.sensing import Sensor, Transduction
from kappaskin.sources import information
from kappaskin.sources.decoder import FROM_HOST, Decoder
from kappaskin.sources.description import Description
from kappaskin.sources.wire import (
    RATE_UNIT,
    UNKNOWN_TEMPERATURE,
    VERSION,
    Command,
    Fault,
    Operation,
    encode_information,
    encode_reply,
    encode_samples,
    unpack_runs,
)

_OUTBOX = 2**19  # bytes held before a frame goes unsent: more than a second of a full scan
_LINGER = 0.3  # s without anything unread before the port is closed
_PATIENCE = 2.0  # s to wait at most for what is unread
_AT_ONCE = 32  # frames that are due, as after standing still, before it listens again
_INFORMATION_INTERVAL = 0.5  # s between two information messages


class _RefusedCommand(Exception):
    """A command that is not done: why, by its number, and in words."""

    def __init__(self, fault: Fault, reason: str) -> None:
        super().__init__(reason)
        self.fault = fault


class PseudoDevice:
    """A scene that speaks the wire format on `port`; spends a sequence number on every message.

    With a `description` it is a device with that line format instead, and takes no commands.

    It is quiet until someone opens the port, and again after they close it. `unsent` counts the
    messages that found the outbox full or were in it at the end, `spent` counts all of them.
    """

    def __init__(
        self,
        scene: Scene,
        clock: Callable[[], float] = time.monotonic,
        description: Description | None = None,
    ) -> None:
        self._lines = None if description is None else description.decoder()
        if description is not None:
            scene, self._order = _as_described(scene, description.sensor)
        self._scene, self._simulator, self._clock = scene, Simulator(scene), clock
        self._sensor = scene.sensor()
        self._information = information.sensor_to_json(self._sensor)
        if not hasattr(os, "openpty"):
            raise Refusal("expected a system with pseudo-terminals (Linux, macOS)")
        import tty  # there is none on Windows

        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        # With no other holder of the slave end, a hang-up on the master says nobody listens.
        os.close(slave)
        os.set_blocking(self._master, False)
        self._decoder = Decoder(FROM_HOST)
        self._outbox: deque[bytes] = deque()
        self._held = self._sent = 0  # bytes in the outbox; of its first message, those sent
        self._running, self._scan = True, self._sensor.scan()
        self.rate = scene.rate
        self._first, self._since = 0, 0.0  # from frame `_first` on, due then, frames come at `rate`
        self._start = 0.0
        self.spent = self.unsent = self.samples = 0

    def serve(self, stopped: Callable[[], bool]) -> None:
        """Send until `stopped()`; each listener gets a fresh clock and the information."""
        while not stopped():
            if self._hung_up():
                time.sleep(0.02)
                continue
            self._stream(stopped)
            self._empty()
            self.unsent += len(self._outbox)
            self._outbox.clear()
            self._held = self._sent = 0
            if self._hung_up():
                self._clear_unread()

    def _hung_up(self) -> bool:
        poll = select.poll()
        poll.register(self._master, select.POLLOUT)
        return any(event & select.POLLHUP for _, event in poll.poll(0))

    def _clear_unread(self) -> None:
        """Throw away what the last listener left: the next one is greeted first."""
        import termios

        with suppress(OSError):
            slave = os.open(self.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            termios.tcflush(slave, termios.TCIFLUSH)
            os.close(slave)

    def _now(self) -> float:
        """Device time in s, which stands still while nobody listens."""
        return self._clock() - self._start

    def _due(self) -> float:
        """Device time of the next frame."""
        return self._since + (self.samples - self._first) / self.rate

    def _stream(self, stopped: Callable[[], bool]) -> None:
        self._decoder = Decoder(FROM_HOST)  # or the next one's first commands pass for repeated
        self._start, informed_at = self._clock() - self._due(), -_INFORMATION_INTERVAL
        while not (stopped() or self._hung_up()):
            now = self._now()
            if now - informed_at >= _INFORMATION_INTERVAL:
                informed_at = now
                self._send_information()
            self._listen()
            for _ in range(_AT_ONCE):
                if self._due() > now or not self._running:
                    break
                self._send_samples()
            self._flush()
            wait = self._due() - self._now() if self._running else _INFORMATION_INTERVAL
            ready = [self._master] if self._outbox else []
            select.select([self._master], ready, [], max(0.0, min(wait, 0.05)))

    def _send_information(self) -> None:
        if self._lines is None:
            self._send(encode_information(self.spent, self._now(), self._information))

    def _send_samples(self) -> None:
        frame = self._simulator.scanned(self._scan, self.samples, self._due(), self._clock)
        self.samples += 1
        message = self._message(frame)
        match self._simulator.failure(self.samples - 1):
            case DroppedFrames.name:
                self.spent += 1
            case CorruptedFrames.name:
                self._send(_corrupted(message))
            case _:
                self._send(message)

    def _message(self, frame: Frame) -> bytes:
        """The bytes that say what was read in a frame."""
        chain = self._scene.transduction
        if self._lines is not None:
            readings = chain.curvature(frame.counts)[np.argsort(frame.channels)][self._order]
            return self._lines.encoded(self.spent, frame.device_time, readings)
        width = chain.count_bytes
        return encode_samples(self.spent, frame.device_time, frame.channels, frame.counts, width)

    def _send(self, message: bytes) -> None:
        if self._held + len(message) > _OUTBOX:
            self.unsent += 1
        else:
            self._outbox.append(message)
            self._held += len(message)
        self.spent += 1  # last: of what is spent it is known whether it goes out

    def _flush(self) -> None:
        with suppress(OSError):  # full, or nobody listens any more: what stays counts as unsent
            while self._outbox:
                message = self._outbox[0]
                sent = os.write(self._master, message[self._sent : self._sent + 4096])
                self._sent, self._held = self._sent + sent, self._held - sent
                if self._sent == len(message):
                    self._outbox.popleft()
                    self._sent = 0

    def _empty(self) -> None:
        """Send what is in the outbox, as long as somebody takes it."""
        end = time.monotonic() + _PATIENCE
        self._flush()
        while self._outbox and not self._hung_up() and time.monotonic() < end:
            select.select([], [self._master], [], 0.02)
            self._flush()

    def _listen(self) -> None:
        """Carry out the commands of the host."""
        with suppress(OSError):  # nothing came, or nobody is there any more
            for command in self._decoder.feed(os.read(self._master, 4096)):
                if isinstance(command, Command) and self._lines is None:
                    self._answer(command, self._now())

    def _answer(self, command: Command, received: float) -> None:
        try:
            data, fault = self._done(command, received), Fault.NONE
        except _RefusedCommand as refused:
            data, fault = str(refused).encode(), refused.fault
        self._send(encode_reply(self.spent, self._now(), command, fault, data))
        if command.operation in (Operation.GAIN, Operation.IDENTIFY) and not fault:
            self._send_information()

    def _done(self, command: Command, received: float) -> bytes:
        """The data of the reply to a command, once it is carried out."""
        arguments = command.arguments
        match command.operation:
            case Operation.HELLO:
                low, high = _numbers("<BB", arguments)
                if not low <= VERSION <= high:
                    raise _RefusedCommand(Fault.NO_COMMON_VERSION, f"this device speaks {VERSION}")
                return bytes([VERSION])
            case Operation.START | Operation.STOP | Operation.IDENTIFY:
                _numbers("<", arguments)
                self._run(command.operation)
                return b""
            case Operation.SCAN_LIST:
                self._take_list(arguments)
                return b""
            case Operation.RATE:
                return self._take_rate(*_numbers("<I", arguments))
            case Operation.GAIN:
                return self._take_gain(*_numbers("<I", arguments))
            case Operation.PING:
                _numbers("<", arguments)
                return struct.pack("<Qh", round(received * 1e6), UNKNOWN_TEMPERATURE)
            case unknown:
                raise _RefusedCommand(Fault.UNKNOWN_OPERATION, f"there is no operation {unknown}")

    def _run(self, operation: int) -> None:
        if operation == Operation.START and not self._running:
            self._set_rate(self.rate)
            self._running = True
        elif operation == Operation.STOP:
            self._running = False

    def _set_rate(self, rate: float) -> None:
        """Send frames at `rate` from now on."""
        due = self._due() if self._running else self._now()
        self._first, self._since, self.rate = self.samples, due, rate

    def _take_list(self, arguments: bytes) -> None:
        channels = unpack_runs(arguments)
        if channels is None:
            raise _RefusedCommand(Fault.WRONG_LENGTH, "expected runs of channels")
        try:
            self._scan = self._sensor.scan(channels if len(channels) else None)
        except Refusal as refusal:
            raise _RefusedCommand(Fault.OUT_OF_RANGE, str(refusal)) from refusal
        if self._scan.rate < self.rate:
            self._set_rate(self._scan.rate)

    def _take_rate(self, requested: int) -> bytes:
        rate, most = requested / RATE_UNIT, self._scan.rate
        if not 0 < rate <= most:
            raise _RefusedCommand(
                Fault.OUT_OF_RANGE, f"expected at most {most:.1f} frames/s, got {rate}"
            )
        self._set_rate(rate)
        return struct.pack("<I", requested)

    def _take_gain(self, requested: int) -> bytes:
        chain = self._scene.transduction
        if not isinstance(chain, Transduction):
            raise _RefusedCommand(Fault.OUT_OF_RANGE, "digital readings have no gain")
        try:
            amplifier = replace(chain.amplifier, gain=requested / 1000)
            scene = replace(self._scene, transduction=replace(chain, amplifier=amplifier))
            self._simulator.change(scene)
        except Refusal as refusal:
            raise _RefusedCommand(Fault.OUT_OF_RANGE, str(refusal)) from refusal
        self._scene, self._sensor = scene, scene.sensor()
        self._information = information.sensor_to_json(self._sensor)
        return struct.pack("<I", requested)

    def close(self) -> None:
        """Close the port, once a listener has taken what it was sent, or will not."""
        if not self._hung_up():
            self._linger()
        os.close(self._master)

    def _linger(self) -> None:
        """Wait: what is unread when the last holder closes is thrown away."""
        import fcntl
        import termios

        slave = os.open(self.port, os.O_RDWR | os.O_NOCTTY)
        read = begun = time.monotonic()
        while (now := time.monotonic()) < min(read + _LINGER, begun + _PATIENCE):
            if any(fcntl.ioctl(slave, termios.FIONREAD, bytes(4))):
                read = now
            time.sleep(0.01)
        os.close(slave)


def _as_described(scene: Scene, sensor: Sensor) -> tuple[Scene, Indices]:
    """The scene with elements that read as the `sensor`, and which of its readings those are.

    Each element has every kind of reading of the sensor. Where they are other than curvature, they
    have the noise that the sensor tells in place of what the scene says of strain gages.
    """
    layout = sensor.layout
    if scene.layout.patch != layout.patch:
        raise Refusal(
            f"expected a scene on the skin of the description, a {layout.patch.name}, got one on "
            f"a {scene.layout.patch.name}; give both the same [skin]"
        )
    order = layout.kind * len(layout) + layout.element
    own = scene.layout
    if not (own.reads or layout.reads) and np.array_equal(own.positions, layout.positions):
        return scene, order
    read = layout.of_curvature
    if layout.reads:
        read = read.reading_each(layout.kind_names)
    if layout.senses_curvature_only and isinstance(scene.transduction, Transduction):
        return replace(scene, layout=read), order
    kept = (e for e in scene.effects if e.authored or not isinstance(e, ReadingEffect))
    effects = tuple(effect for effect in kept if not effect.of_gages)
    digital = sensor.transduction
    return replace(scene, layout=read, transduction=digital, effects=effects), order


def _numbers(form: str, arguments: bytes) -> tuple[int, ...]:
    if len(arguments) != struct.calcsize(form):
        raise _RefusedCommand(
            Fault.WRONG_LENGTH,
            f"expected {struct.calcsize(form)} bytes of arguments, got {len(arguments)}",
        )
    return struct.unpack(form, arguments)


def _corrupted(message: bytes) -> bytes:
    """The message with a bit in its middle turned over."""
    spoilt = bytearray(message)
    spoilt[len(spoilt) // 2] ^= 1
    return bytes(spoilt)
