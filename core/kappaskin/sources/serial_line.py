"""Bytes on a serial line, or any URL that pyserial opens, to frames."""

import errno
import os
import re
import select
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import cast

import serial
from serial.urlhandler import protocol_socket

from kappaskin.errors import SourceError
from kappaskin.frames import Frame
from kappaskin.sensor import Sensor
from kappaskin.sources import information
from kappaskin.sources.accounting import Accounting
from kappaskin.sources.decoder import Decoder
from kappaskin.sources.wire import VERSION, Information, Message, Samples

BAUD_RATE = 2_000_000
"""What a UART must run at for 300 channels at 300 frames/s; USB ports ignore it."""

_PATIENCE = 3.0  # s a device has to say what it is
_BLOCK = 65536
_BACKLOG = 4096  # reads that may wait; beyond it bytes are thrown away, and counted


def _open(url: str) -> serial.SerialBase:
    try:
        return serial.serial_for_url(url, baudrate=BAUD_RATE, timeout=0.1, exclusive=True)
    except (serial.SerialException, OSError, ValueError, LookupError, re.error) as error:
        raise SourceError(_why_not(url, error)) from error


def _why_not(url: str, error: Exception) -> str:
    code = getattr(error, "errno", None)
    if code in (errno.EACCES, errno.EPERM):
        return (
            f"{url}: no permission to open it. Join the port's group with "
            f"`sudo usermod -aG {_group(url)} $USER`, then log in again"
        )
    if code in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in str(error):
        return f"{url}: busy, another program has it open; close that program, then connect again"
    if code in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        return (
            f"{url}: there is no such port; plug the sensor in, or choose one of the ports found "
            "(`kappaskin doctor` lists them)"
        )
    if code == errno.ECONNREFUSED or "refused" in str(error):
        return f"{url}: nothing listens there; start the server, then connect again"
    return (
        f"{url}: cannot be opened ({error}); expected a port such as /dev/ttyACM0 or COM3, or a "
        "URL such as socket://host:port"
    )


def _highest(samples: Samples) -> int:
    return int(samples.channels.max(initial=-1))


def _group(url: str) -> str:
    try:
        import grp  # not on Windows

        return grp.getgrgid(os.stat(url).st_gid).gr_name
    except (ImportError, OSError, KeyError):
        return "dialout"


def _arriving(port: serial.SerialBase) -> bytes:
    """What has come, after waiting 0.1 s at most for a first byte."""
    if isinstance(port, protocol_socket.Serial):
        # pyserial does not say how much a socket holds, and a longer read throws away what it has
        # when the other end closes: with no time-out it is a single `recv`.
        port.timeout = 0
        select.select([port], [], [], 0.1)
        return port.read(_BLOCK)
    return port.read(cast("serial.Serial", port).in_waiting or 1)


class SerialSource:
    """Frames from a port; a thread of its own reads, so that no byte waits for arithmetic."""

    def __init__(self, url: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.url, self._clock = url, clock
        self._port = _open(url)
        self._sensor: Sensor | None = None
        self._information = ""
        self._decoder = Decoder()
        self._opened = clock()
        self._arrived: SimpleQueue[tuple[float, bytes]] = SimpleQueue()
        self._messages: deque[tuple[float, Message]] = deque()
        self._overrun = 0
        self._gone = threading.Event()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._listen, name="serial-reader", daemon=True)
        self._thread.start()

    @property
    def sensor(self) -> Sensor | None:
        return self._sensor

    def _listen(self) -> None:
        """Move bytes with the time they came, until the line is gone."""
        try:
            while not self._closing.is_set():
                data = _arriving(self._port)
                if data and self._arrived.qsize() > _BACKLOG:
                    self._overrun += len(data)
                elif data:
                    self._arrived.put((self._clock(), data))
        except (serial.SerialException, OSError, TypeError):  # TypeError: closed while reading
            self._gone.set()

    def read(self, timeout: float) -> list[Frame]:
        gone = self._gone.is_set()
        self._decode(0.0 if gone or self._messages else timeout)
        frames = self._frames()
        if gone and not frames:
            raise SourceError(
                f"{self.url}: the line is gone: unplugged, or the device stopped; plug it in and "
                "connect again"
            )
        if self._sensor is None and self._clock() - self._opened > _PATIENCE:
            raise SourceError(self._why_unknown())
        return frames

    def _decode(self, timeout: float) -> None:
        with suppress(Empty):
            now, data = self._arrived.get(timeout=timeout)
            while True:
                self._messages += [(now, message) for message in self._decoder.feed(data)]
                now, data = self._arrived.get_nowait()

    def _frames(self) -> list[Frame]:
        """The frames before the next message that changes the sensor, or cannot be used."""
        frames: list[Frame] = []
        while self._messages and not (frames and self._upsets(self._messages[0][1])):
            now, message = self._messages.popleft()
            if frame := self._frame(message, now):
                frames.append(frame)
        return frames

    def _upsets(self, message: Message) -> bool:
        if isinstance(message, Information):
            return message.text != self._information
        return self._sensor is not None and _highest(message) >= self._sensor.channels

    def _frame(self, message: Message, now: float) -> Frame | None:
        if isinstance(message, Information):
            if message.text != self._information:
                self._sensor = information.from_json(message.text)
                self._information = message.text
            return None
        if self._sensor is None:
            return None  # counts mean nothing before the device says what they count
        if self._upsets(message):
            raise SourceError(
                f"{self.url}: the device sends channel {_highest(message)} but says it has "
                f"{self._sensor.channels}; its firmware and its information disagree"
            )
        return Frame(message.sequence, message.time, now, message.channels, message.counts)

    def _why_unknown(self) -> str:
        seen = self._decoder.accounting()
        if seen.other_version is not None:
            return (
                f"{self.url}: the device speaks wire version {seen.other_version}, this program "
                f"speaks {VERSION}; update the older of the two"
            )
        if not seen.bytes_in:
            return (
                f"{self.url}: silent for {_PATIENCE:g} s; is the device on, and is this its port?"
            )
        if not seen.good:
            return (
                f"{self.url}: {seen.bytes_in} bytes came but no message of wire version {VERSION}; "
                f"this is another kind of device, or its baud rate is not {BAUD_RATE}"
            )
        return (
            f"{self.url}: {seen.good} messages came in {_PATIENCE:g} s but none said what the "
            "device is; its firmware must send an information message every second"
        )

    def accounting(self) -> Accounting:
        return self._decoder.accounting(overrun=self._overrun)

    def close(self) -> None:
        self._closing.set()
        if isinstance(self._port, serial.Serial):
            with suppress(OSError, serial.SerialException):
                self._port.cancel_read()
        self._thread.join(timeout=1.0)
        with suppress(OSError, serial.SerialException):
            self._port.close()
