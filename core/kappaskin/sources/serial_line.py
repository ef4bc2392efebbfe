"""Bytes on a serial line, or any URL that pyserial opens, to frames."""

import errno
import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue

import serial

from kappaskin.errors import SourceError
from kappaskin.frames import Frame
from kappaskin.sensor import Sensor
from kappaskin.sources import information
from kappaskin.sources.wire import VERSION, Accounting, Decoder, Information, Message

BAUD_RATE = 2_000_000
"""What a UART must run at for 300 channels at 300 frames/s; USB ports ignore it."""

_PATIENCE = 3.0  # s a device has to say what it is
_BLOCK = 65536
_BACKLOG = 4096  # reads that may wait; beyond it bytes are thrown away, and counted


def _open(url: str) -> serial.SerialBase:
    try:
        return serial.serial_for_url(url, baudrate=BAUD_RATE, timeout=0.1, exclusive=True)
    except (serial.SerialException, OSError, ValueError) as error:
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
            f"{url}: there is no such port; plug the sensor in, or choose one of the ports listed "
            "by `kappaskin doctor`"
        )
    return (
        f"{url}: cannot be opened ({error}); expected a port such as /dev/ttyACM0 or COM3, or a "
        "URL such as socket://host:port"
    )


def _group(url: str) -> str:
    try:
        import grp  # not on Windows

        return grp.getgrgid(os.stat(url).st_gid).gr_name
    except (ImportError, OSError, KeyError):
        return "dialout"


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
        port = self._port
        # A native port says how much waits; others fill a block until the time-out.
        native = isinstance(port, serial.Serial)
        if not native:
            port.timeout = 0.005
        try:
            while not self._closing.is_set():
                data = port.read(port.in_waiting or 1) if native else port.read(_BLOCK)
                if data and self._arrived.qsize() > _BACKLOG:
                    self._overrun += len(data)
                elif data:
                    self._arrived.put((self._clock(), data))
        except (serial.SerialException, OSError, TypeError):  # TypeError: closed while reading
            self._gone.set()

    def read(self, timeout: float) -> list[Frame]:
        gone, frames = self._gone.is_set(), list[Frame]()
        with suppress(Empty):
            arrived = self._arrived.get(timeout=0 if gone else timeout)
            while True:
                frames += self._frames(*arrived)
                arrived = self._arrived.get_nowait()
        if gone and not frames:
            raise SourceError(
                f"{self.url}: the line is gone: unplugged, or the device stopped; plug it in and "
                "connect again"
            )
        if self._sensor is None and self._clock() - self._opened > _PATIENCE:
            raise SourceError(self._why_unknown())
        return frames

    def _frames(self, now: float, data: bytes) -> list[Frame]:
        found = [self._frame(message, now) for message in self._decoder.feed(data)]
        return [frame for frame in found if frame]

    def _frame(self, message: Message, now: float) -> Frame | None:
        if isinstance(message, Information):
            if message.text != self._information:
                self._sensor = information.from_json(message.text)
                self._information = message.text
            return None
        if self._sensor is None:
            return None  # counts mean nothing before the device says what they count
        beyond = int(message.channels.max(initial=-1))
        if beyond >= self._sensor.channels:
            raise SourceError(
                f"{self.url}: the device sends channel {beyond} but says it has "
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
