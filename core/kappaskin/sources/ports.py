"""Serial ports: discovery, connection, baud rates and reader thread."""

import errno
import math
import os
import re
import select
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import cast
from urllib.parse import urlsplit

import serial
from serial.tools import list_ports
from serial.urlhandler import protocol_socket

from kappaskin.errors import SourceError
from kappaskin.sources.inputs import UDP, EndOfInput, Input

BAUD_RATE = 2_000_000
"""Baud rate that 300 channels at 300 frames/s need on a UART; USB ports ignore it."""

_SENT = 0.05  # s that a command may wait for room
_HOLDERS_NAMED = 3
_WITH_PORT = "socket://", "rfc2217://"  # URLs that need a port number

BAUD_RATES = (BAUD_RATE, 1_000_000, 921_600, 500_000, 460_800, 230_400, 115_200)
"""Baud rates that a device may use, the usual one first."""

_BLOCK = 65536
_OPENING = 0.5  # s that opening is waited for: a port is open, or refused, in milliseconds
_BACKLOG = 2**24  # bytes that may wait to be taken; beyond it they are discarded, and counted
_CROWDED = 2**18  # bytes that may wait after that, or what is shown would be seconds old for good
_CROWDED_FOR = 1.0  # s without such a loss, after which more may wait again
_READ_OVERHEAD = 128  # bytes of memory that a read takes beside what came
_PATIENT = 0.01  # s until it is looked whether what waits was taken
_PULSE = 0.1  # s that DTR and RTS are low to reset a board
_BROKEN = (serial.SerialException, OSError, TypeError)  # TypeError: closed while reading


@dataclass(frozen=True)
class Port:
    """A serial port: its name, description, maker and serial number; empty if unknown.

    `usb` is the vendor and product number. `opened` is whether this user may open it.
    """

    port: str
    description: str = ""
    maker: str = ""
    serial_number: str = ""
    usb: tuple[int, int] | None = None
    opened: bool = True

    @property
    def words(self) -> str:
        """Name, description, maker and serial number in a line."""
        parts = [self.port, self.description]
        parts += [self.maker] if self.maker and self.maker not in self.description else []
        parts += [f"[{self.serial_number}]"] if self.serial_number else []
        return "  ".join(part for part in parts if part)

    def same_plug(self, other: "Port") -> bool:
        """Whether both are the same device: by its serial number if it has one, else by name."""
        if self.serial_number or other.serial_number:
            return (self.usb, self.serial_number) == (other.usb, other.serial_number)
        return self.port == other.port

    @property
    def group(self) -> str:
        """The group of users who may open it."""
        try:
            import grp  # not on Windows

            return grp.getgrgid(os.stat(self.port).st_gid).gr_name
        except (ImportError, OSError, KeyError):
            return "dialout"

    @property
    def permission_help(self) -> str:
        """How to get the permission to open it."""
        return (
            f"Join the port's group with `sudo usermod -aG {self.group} $USER`, then log in again"
        )

    @staticmethod
    def found() -> "list[Port]":
        """The ports of this machine, in the order of their names."""
        return [
            Port(
                found.device,
                "" if found.description == "n/a" else found.description or "",
                found.manufacturer or "",
                found.serial_number or "",
                None if found.vid is None or found.pid is None else (found.vid, found.pid),
                sys.platform == "win32" or os.access(found.device, os.R_OK | os.W_OK),
            )
            for found in sorted(list_ports.comports())
        ]

    @staticmethod
    def named(url: str) -> "Port":
        """The port with this name, with its name alone if it is not among those found."""
        return next((port for port in Port.found() if port.port == url), Port(url))


def open_port(url: str, baud_rate: int = BAUD_RATE) -> serial.SerialBase:
    """The port or URL, open; raises a `SourceError` that says why it cannot be.

    DTR and RTS are left as the system sets them on opening, and stay so when the port is closed:
    many boards restart when DTR falls and rises.
    """
    try:
        port = serial.serial_for_url(
            url, baudrate=baud_rate, timeout=0.1, write_timeout=_SENT, exclusive=True
        )
    except (serial.SerialException, OSError, ValueError, LookupError, re.error) as error:
        raise SourceError(_why_not(url, error)) from error
    _preserve_lines(port)
    return port


def _preserve_lines(port: serial.SerialBase) -> None:
    """Ask the system not to drop DTR when the port is closed."""
    if sys.platform == "win32" or not isinstance(port, serial.Serial):
        return
    import termios

    with suppress(termios.error, OSError):
        attributes = termios.tcgetattr(port.fileno())
        attributes[2] &= ~termios.HUPCL
        termios.tcsetattr(port.fileno(), termios.TCSANOW, attributes)


def _why_not(url: str, error: Exception) -> str:
    code = getattr(error, "errno", None)
    if code in (errno.EACCES, errno.EPERM):
        return f"{url}: no permission to open it. {Port(url).permission_help}"
    if code in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in str(error):
        return f"{url}: busy, opened by {_holders_text(url)}; close that program"
    if url.startswith(UDP):
        return f"{url}: expected the format of the datagrams, too: sensor:FILE.toml:{UDP}host:port"
    if url.startswith(_WITH_PORT) and not _port_number(url):
        return f"{url}: expected host and port, such as socket://host:5000 (1 to 65535)"
    if code == errno.EISDIR or "configure port" in str(error):
        what = "a folder" if os.path.isdir(url) else "a file" if os.path.isfile(url) else "a device"
        return (
            f"{url}: {what}, not a serial port; expected a port such as /dev/ttyACM0 or COM3, "
            "replay:FILE for a recording or sim:FILE for a scene"
        )
    if code in (errno.ENOENT, errno.ENXIO, errno.ENODEV, errno.EIO):
        return (
            f"{url}: there is no such port; plug the sensor in, or choose one of the ports found "
            "(`kappaskin doctor` lists them)"
        )
    if code == errno.ECONNREFUSED or "refused" in str(error):
        return f"{url}: no server listens at this address; start it"
    return (
        f"{url}: cannot be opened ({error}); expected a port such as /dev/ttyACM0 or COM3, or a "
        "URL such as socket://host:port"
    )


def _port_number(url: str) -> int:
    """The port number of a URL, 0 without a valid one."""
    try:
        return urlsplit(url).port or 0
    except ValueError:
        return 0


def holders(url: str) -> list[str]:
    """The other programs that have the port open, as far as this user may see."""
    found: list[str] = []
    with suppress(OSError):
        device = os.stat(url).st_rdev
        for process in Path("/proc").glob("[0-9]*"):
            if process.name != str(os.getpid()) and device and _holds(process, device):
                found.append(f"{_name_of(process)} (process {process.name})")
    return found


def _holds(process: Path, device: int) -> bool:
    with suppress(OSError):  # it ended, or it is another user's
        for descriptor in (process / "fd").iterdir():
            with suppress(OSError):
                if os.stat(descriptor).st_rdev == device:
                    return True
    return False


def _name_of(process: Path) -> str:
    try:
        return (process / "comm").read_text().strip()
    except OSError:
        return "a program"


def _holders_text(url: str) -> str:
    return ", ".join(holders(url)[:_HOLDERS_NAMED]) or "another program"


class BaudRateSearch:
    """Which baud rate to try next; one that was right is tried again after each other one."""

    def __init__(self, rate: int) -> None:
        self._good: int | None = None
        self._reported, self._place, self._tried = rate, BAUD_RATES.index(rate), {rate}

    def good(self, rate: int) -> bool:
        """Note that a message came at `rate`; whether that is another rate than before."""
        self._good = rate
        changed, self._reported = rate != self._reported, rate
        return changed

    def next(self, rate: int) -> int:
        """The rate to try after this one."""
        if self._good not in (None, rate):
            return self._good
        self._place = (self._place + 1) % len(BAUD_RATES)
        if BAUD_RATES[self._place] == rate:
            self._place = (self._place + 1) % len(BAUD_RATES)
        self._tried.add(BAUD_RATES[self._place])
        return BAUD_RATES[self._place]

    @property
    def tried(self) -> str:
        """The rates tried so far, as part of a sentence."""
        if len(self._tried) == len(BAUD_RATES):
            return f"at any baud rate from {BAUD_RATES[-1]} to {BAUD_RATES[0]}:"
        tried = ", ".join(str(rate) for rate in BAUD_RATES if rate in self._tried)
        return f"at {tried} baud; other rates are tried as bytes arrive, or"


class SerialConnection:
    """A port or URL that a thread of its own opens and reads until `close`; `lost` once it broke.

    It is opened by `opened`, a port by default. An input that is no port may have `ended`.

    Raises a `SourceError` where it cannot be opened. Where the system takes long, it is `opening`
    until it is open, or `lost`: `refusal` then says why. `overrun` counts bytes that arrived while
    too many waited to be taken.
    """

    def __init__(
        self,
        url: str,
        clock: Callable[[], float] = time.monotonic,
        baud_rate: int = BAUD_RATE,
        opened: Callable[[], Input] | None = None,
    ) -> None:
        self.url, self._clock = url, clock
        self._open = opened or partial(open_port, url, baud_rate)
        self._port: serial.SerialBase | Input | None = None
        self.ended = False
        self.refusal: SourceError | None = None
        self.baud_rate = baud_rate
        self.overrun = 0
        self._put = self._taken = (
            0  # bytes: each counted by one thread only, so that none is locked
        )
        self._arrived: SimpleQueue[tuple[float, bytes]] = SimpleQueue()
        self._lost, self._closing = threading.Event(), threading.Event()
        self._opened = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="serial-reader", daemon=True)
        self._thread.start()
        self._opened.wait(_OPENING)
        if self.refusal is not None:
            raise self.refusal

    @property
    def input(self) -> Input | None:
        """What is read if that is no port, once it is open."""
        return self._port if isinstance(self._port, Input) else None

    @property
    def lost(self) -> bool:
        return self._lost.is_set()

    @property
    def opening(self) -> bool:
        return not self._opened.is_set()

    @property
    def empty(self) -> bool:
        """Whether nothing that arrived waits to be taken."""
        return self._arrived.empty()

    def _serve(self) -> None:
        """Open the port, and read it until the connection is lost."""
        try:
            self._port = port = self._open()
        except SourceError as error:
            self.refusal = error
            self._lost.set()
            return
        finally:
            self._opened.set()
        try:
            if self._closing.is_set():  # perhaps before there was anything to close
                port.close()
            self._read(port)
        except EndOfInput:
            self.ended = True
            self._lost.set()
        except _BROKEN:
            self._lost.set()

    def _read(self, port: serial.SerialBase | Input) -> None:
        """Read bytes with the time they arrived."""
        most, lost_at, patient = _BACKLOG, -math.inf, isinstance(port, Input) and port.patient
        while not self._closing.is_set():
            if patient and self._put - self._taken > _CROWDED:
                time.sleep(_PATIENT)
                continue
            if isinstance(port, Input):
                now, data = port.arriving()
            else:
                data = _arriving(port)
                now = self._clock()
            waiting = self._put - self._taken
            if not waiting and now - lost_at > _CROWDED_FOR:
                most = _BACKLOG
            if data and waiting > most:
                self.overrun += len(data)
                most, lost_at = min(_CROWDED, _BACKLOG), now
            elif data:
                self._put += len(data) + _READ_OVERHEAD
                self._arrived.put((now, data))

    def take(self, timeout: float) -> list[tuple[float, bytes]]:
        """What arrived and when, after at most `timeout` s; the rest of much with the next call."""
        taken: list[tuple[float, bytes]] = []
        size = 0
        with suppress(Empty):
            taken.append(self._arrived.get(timeout=timeout))
            while (size := size + len(taken[-1][1]) + _READ_OVERHEAD) < _BLOCK:
                taken.append(self._arrived.get_nowait())
        self._taken += size
        return taken

    def write(self, data: bytes) -> bool:
        """Send `data`; False where there is no room for it, or nobody any more."""
        try:
            port = self._port
            return port is not None and _has_room(port) and port.write(data) == len(data)
        except _BROKEN:
            return False

    def set_baud_rate(self, baud_rate: int) -> None:
        """Continue at another rate, where the port has one."""
        if not isinstance(self._port, serial.SerialBase):
            return
        with suppress(*_BROKEN, ValueError):
            self._port.baudrate = baud_rate
            self.baud_rate = baud_rate

    def reset(self) -> None:
        """Let DTR and RTS fall and rise again, at which many boards restart."""
        if not isinstance(self._port, serial.SerialBase):
            return
        with suppress(*_BROKEN):
            self._port.dtr = self._port.rts = False
            time.sleep(_PULSE)
            self._port.dtr = self._port.rts = True

    def close(self) -> None:
        self._closing.set()
        if self._port is None:
            return  # the thread closes it, should it ever be open
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


def _has_room(port: serial.SerialBase | Input) -> bool:
    if not isinstance(port, serial.Serial | protocol_socket.Serial):
        return True
    return bool(select.select([], [port], [], 0.0)[1])


def _arriving(port: serial.SerialBase) -> bytes:
    """What arrived, after waiting 0.1 s at most for a first byte."""
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
    """What arrived at a terminal, in two calls of the system where pyserial takes four.

    At each another thread may take the interpreter, which is not to be had back at once.
    """
    fd, ended = cast("int", port.fd), cast("int", port.pipe_abort_read_r)
    if fd not in select.select([fd, ended], [], [], 0.1)[0]:
        return b""
    if not (data := os.read(fd, _BLOCK)):
        raise serial.SerialException("the connection ended")
    return data
