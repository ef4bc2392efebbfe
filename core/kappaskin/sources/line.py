"""An open port: a thread of its own moves bytes with the time they came, others write."""

import os
import select
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import cast

import serial
from serial.urlhandler import protocol_socket

from kappaskin.sources.ports import BAUD_RATE, open_port

_BLOCK = 65536
_BACKLOG = 2**24  # bytes that may wait to be taken; beyond it they are thrown away, and counted
_EACH = 128  # bytes of memory that a read takes beside what came
_PULSE = 0.1  # s that DTR and RTS are low to reset a board
_BROKEN = (serial.SerialException, OSError, TypeError)  # TypeError: closed while reading


class Line:
    """The port or URL called `url`, open until `close`; `gone` once it broke.

    `overrun` counts bytes that came while too many waited to be taken.
    """

    def __init__(self, url: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.url, self._clock = url, clock
        self._port = open_port(url)
        self.baud_rate = BAUD_RATE
        self.overrun = 0
        self._put = self._taken = (
            0  # bytes: each counted by one thread only, so that none is locked
        )
        self._arrived: SimpleQueue[tuple[float, bytes]] = SimpleQueue()
        self._gone, self._closing = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._listen, name="serial-reader", daemon=True)
        self._thread.start()

    @property
    def gone(self) -> bool:
        return self._gone.is_set()

    def _listen(self) -> None:
        """Move bytes with the time they came, until the line is gone."""
        try:
            while not self._closing.is_set():
                data = _arriving(self._port)
                if data and self._put - self._taken > _BACKLOG:
                    self.overrun += len(data)
                elif data:
                    self._put += len(data) + _EACH
                    self._arrived.put((self._clock(), data))
        except _BROKEN:
            self._gone.set()

    def take(self, timeout: float) -> list[tuple[float, bytes]]:
        """What has come and when, after at most `timeout` s."""
        taken: list[tuple[float, bytes]] = []
        with suppress(Empty):
            taken.append(self._arrived.get(timeout=timeout))
            while True:
                taken.append(self._arrived.get_nowait())
        self._taken += sum(len(data) + _EACH for _, data in taken)
        return taken

    def write(self, data: bytes) -> bool:
        """Send `data`; False where there is no room for it, or nobody any more."""
        try:
            return self._has_room() and self._port.write(data) == len(data)
        except _BROKEN:
            return False

    def _has_room(self) -> bool:
        if not isinstance(self._port, serial.Serial | protocol_socket.Serial):
            return True
        return bool(select.select([], [self._port], [], 0.0)[1])

    def speak_at(self, baud_rate: int) -> None:
        """Go on at another rate, where the port has one."""
        with suppress(*_BROKEN, ValueError):
            self._port.baudrate = baud_rate
            self.baud_rate = baud_rate

    def reset(self) -> None:
        """Let DTR and RTS fall and rise again, at which many boards start anew."""
        with suppress(*_BROKEN):
            self._port.dtr = self._port.rts = False
            time.sleep(_PULSE)
            self._port.dtr = self._port.rts = True

    def close(self) -> None:
        self._closing.set()
        if isinstance(self._port, serial.Serial):
            with suppress(*_BROKEN):
                self._port.cancel_read()
        self._thread.join(timeout=1.0)
        if isinstance(self._port, protocol_socket.Serial):
            # pyserial forgets a socket that the other end has closed without closing it.
            with suppress(*_BROKEN, AttributeError):
                vars(self._port)["_socket"].close()
        with suppress(*_BROKEN):
            self._port.close()


def _arriving(port: serial.SerialBase) -> bytes:
    """What has come, after waiting 0.1 s at most for a first byte."""
    if isinstance(port, protocol_socket.Serial):
        # pyserial does not say how much a socket holds, and a longer read throws away what it has
        # when the other end closes: with no time-out it is a single `recv`.
        port.timeout = 0
        select.select([port], [], [], 0.1)
        return port.read(_BLOCK)
    if sys.platform != "win32" and isinstance(port, serial.Serial):
        return _arriving_at(port)
    return port.read(cast("serial.Serial", port).in_waiting or 1)


def _arriving_at(port: serial.Serial) -> bytes:
    """What has come to a terminal, in two calls of the system where pyserial takes four.

    At each another thread may take the interpreter, which is not to be had back at once.
    """
    fd, ended = cast("int", port.fd), cast("int", port.pipe_abort_read_r)
    if fd not in select.select([fd, ended], [], [], 0.1)[0]:
        return b""
    if not (data := os.read(fd, _BLOCK)):
        raise serial.SerialException("the line ended")
    return data
