"""The serial ports there are, whose they are, and why one of them cannot be opened."""

import errno
import os
import re
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import serial
from serial.tools import list_ports

from kappaskin.errors import SourceError

BAUD_RATE = 2_000_000
"""What a UART must run at for 300 channels at 300 frames/s; USB ports ignore it."""

_SENT = 0.05  # s that a command may wait for room
_FEW = 3  # holders of a port that are named


@dataclass(frozen=True)
class Port:
    """A serial port: its name, what it is and who made it, as its plug says; empty if unknown.

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
        """Whether both are one plug: by its serial number where it has one, else by name."""
        if self.serial_number or other.serial_number:
            return (self.usb, self.serial_number) == (other.usb, other.serial_number)
        return self.port == other.port


def serial_ports() -> list[Port]:
    """The ports found, in the order of their names."""
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


def port_called(url: str) -> Port:
    """What is known of the port with this name; its name alone if that is all."""
    return next((port for port in serial_ports() if port.port == url), Port(url))


def open_port(url: str) -> serial.SerialBase:
    """The port or URL, open; raises a `SourceError` that says why it cannot be.

    DTR and RTS are left as the system sets them on opening, and stay so when the port is closed:
    many boards start anew when DTR falls and rises.
    """
    try:
        port = serial.serial_for_url(
            url, baudrate=BAUD_RATE, timeout=0.1, write_timeout=_SENT, exclusive=True
        )
    except (serial.SerialException, OSError, ValueError, LookupError, re.error) as error:
        raise SourceError(_why_not(url, error)) from error
    _keep_lines(port)
    return port


def _keep_lines(port: serial.SerialBase) -> None:
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
        return f"{url}: no permission to open it. {permission_line(url)}"
    if code in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in str(error):
        return f"{url}: busy, {_holders_told(url)} has it open; close that program"
    if code in (errno.ENOENT, errno.ENXIO, errno.ENODEV, errno.EIO):
        return (
            f"{url}: there is no such port; plug the sensor in, or choose one of the ports found "
            "(`kappaskin doctor` lists them)"
        )
    if code == errno.ECONNREFUSED or "refused" in str(error):
        return f"{url}: nothing listens there; start the server"
    return (
        f"{url}: cannot be opened ({error}); expected a port such as /dev/ttyACM0 or COM3, or a "
        "URL such as socket://host:port"
    )


def permission_line(url: str) -> str:
    """What mends a missing permission."""
    return f"Join the port's group with `sudo usermod -aG {_group(url)} $USER`, then log in again"


def _group(url: str) -> str:
    try:
        import grp  # not on Windows

        return grp.getgrgid(os.stat(url).st_gid).gr_name
    except (ImportError, OSError, KeyError):
        return "dialout"


def holders(url: str) -> list[str]:
    """The other programs that have the port open, so far as this user may know."""
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


def _holders_told(url: str) -> str:
    return ", ".join(holders(url)[:_FEW]) or "another program"
