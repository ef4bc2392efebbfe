"""UDP transport: JSON datagrams, and their listener."""

import errno
import json
import math
import socket
import time
from collections import defaultdict
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, cast

from kappaskin._text import NO_FORCE, ONE_SIGMA, SNAPS, printable, with_error
from kappaskin.errors import Refusal
from kappaskin.publish.message import LARGEST, VERSION, EstimateMessage, SourceState
from kappaskin.publish.publishing import Receiver, Target, reason

_AGAIN = 1.0  # s between two tries to reach a network that was lost


def opened(target: Target) -> "Udp":
    """A socket connected to the first reachable address of `target`."""
    try:
        found = socket.getaddrinfo(target.host, target.port, type=socket.SOCK_DGRAM)
    except (OSError, UnicodeError) as error:
        raise Refusal(
            f"{target}: the host {target.host} is not known ({reason(error)}); give another "
            "name, or its address"
        ) from error
    # Of a name with both, most who receive listen on the older kind of address.
    found.sort(key=lambda each: each[0] != socket.AF_INET)
    trouble = ""
    for family, _, _, _, address in found:
        try:
            return Udp(str(target), _connected(family, address), address)
        except OSError as error:
            trouble = reason(error)
    raise Refusal(
        f"{target}: cannot be sent to ({trouble}); connect this machine to that network, then "
        "switch it on again"
    )


def _connected(family: int, address: object) -> socket.socket:
    """A non-blocking socket; connected, so that it reports when nobody receives."""
    made = socket.socket(family, socket.SOCK_DGRAM)
    try:
        made.setblocking(False)
        if family == socket.AF_INET:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        made.connect(address)  # pyright: ignore[reportArgumentType]
    except OSError:
        made.close()
        raise
    return made


class Udp:
    """Sends each message as one datagram."""

    notices, cue = (), None

    def __init__(self, name: str, made: socket.socket, address: tuple[object, ...]) -> None:
        self._name, self._socket, self._address = name, made, address
        self._sent = self._dropped = 0
        self._trouble, self._again = "", 0.0

    @property
    def receivers(self) -> tuple[Receiver, ...]:
        return (Receiver(self._name, self._sent, self._dropped, self._trouble),)

    @property
    def counts(self) -> tuple[int, int]:
        return self._sent, self._dropped

    def send(self, message: EstimateMessage) -> None:
        self.put(message.contact)
        if message.shape_follows:
            self.put(message.shape)

    def report(self, state: SourceState) -> None:
        self.put(state.encoded())

    def put(self, data: bytes) -> None:
        """Send a datagram, or drop and count it."""
        if len(data) > LARGEST:
            self._drop(f"a message of {len(data)} bytes is too large for a datagram")
            return
        try:
            self._send(data)
        except OSError as error:
            self._drop(reason(error))
            if error.errno not in (errno.EAGAIN, errno.ENOBUFS):
                self._find_way()
        else:
            self._sent += 1

    def _send(self, data: bytes) -> None:
        try:
            self._socket.send(data)
        except ConnectionRefusedError:
            # The error is of the last message, which nobody received, and this one was not sent.
            self._sent -= 1
            self._drop("nobody receives there")
            self._socket.send(data)

    def _drop(self, why: str) -> None:
        self._dropped += 1
        self._trouble = why

    def _find_way(self) -> None:
        """Reconnect now and then: the network may have changed."""
        now = time.monotonic()
        if now >= self._again:
            self._again = now + _AGAIN
            with suppress(OSError):
                self._socket.connect(self._address)  # pyright: ignore[reportArgumentType]

    def close(self) -> None:
        self._socket.close()


_SHOWN = 0.1  # s between two contacts that are shown: nobody reads a thousand lines a second
_BUFFER = 2**20  # bytes that may wait while this process sleeps
_LARGEST = 65536
_ENDLESS = 1e300  # larger than any published quantity
_AT_ONCE = 1000  # datagrams read in one call at most
_FINGERS = 64  # that count for themselves at most

JsonMessage = dict[str, Any]


@dataclass
class _Heard:
    """What was received last of one finger: its sender, number and state, and when it was shown."""

    sender: object = None
    number: int | None = None
    shown: float = -math.inf
    state: str = ""


class UdpListener:
    """Messages received on a UDP `port`, as lines of text; gaps in `number` are losses.

    Each finger of a hand counts for itself.
    """

    def __init__(self, port: int) -> None:
        if not 0 < port < 65536:
            raise Refusal(f"expected a port from 1 to 65535, got {port}")
        self._began = time.monotonic()
        self._socket = _bound(port)
        self._heard = defaultdict[str, _Heard](_Heard)
        self.contacts = self.lost = self.foreign = 0

    def read(self, timeout: float) -> list[JsonMessage]:
        """The messages received, after at most `timeout` s."""
        self._socket.settimeout(timeout)
        came: list[JsonMessage] = []
        with suppress(TimeoutError, BlockingIOError):
            for _ in range(_AT_ONCE):
                data, sender = self._socket.recvfrom(_LARGEST)
                self._socket.settimeout(0)
                message = _understood(data)
                if message is None:
                    self.foreign += 1
                    continue
                heard = self._of(message)
                if heard.sender not in (None, sender):
                    heard.number = None  # another one counts for itself
                heard.sender = sender
                came.append(message)
        return came

    def _of(self, message: JsonMessage) -> _Heard:
        finger = str(message.get("finger", ""))
        known = finger in self._heard or len(self._heard) < _FINGERS
        return self._heard[finger if known else ""]

    def lines(self, message: JsonMessage) -> list[str]:
        """Lines for a message and for a gap before it; none where nothing new is to be shown."""
        lines, heard = list[str](), self._of(message)
        if message["kind"] in ("contact", "cue"):
            lines += self._gap(heard, message.get("number"))
            now = time.monotonic()
            if now - heard.shown >= _SHOWN:
                heard.shown = now
                lines.append(_cue_words(message) if message["kind"] == "cue" else _words(message))
        elif message["kind"] == "status":
            state = f"{message.get('state')}  {message.get('sensor')}  {message.get('message')}"
            if state != heard.state:
                lines.append(f"status    {state}")
            heard.state = state
        finger = f"{message['finger']!s:.32}  " if message.get("finger") else ""
        seconds = time.monotonic() - self._began
        return [f"{seconds:9.3f} s  {printable(finger + line)}" for line in lines]

    def _gap(self, heard: _Heard, number: object) -> list[str]:
        last, heard.number = heard.number, number if isinstance(number, int) else None
        self.contacts += 1
        if last is None or heard.number is None or heard.number == last + 1:
            return []
        missing = heard.number - last - 1
        if missing < 0:
            return ["back      out of order, or the sender restarted"]
        self.lost += missing
        return [f"gap       {missing} messages lost"]

    @property
    def summary(self) -> str:
        foreign = f", {self.foreign} foreign datagrams" if self.foreign else ""
        counts = f"{self.contacts} contacts received, {self.lost} lost{foreign}"
        return f"{counts}; error bars: {ONE_SIGMA}"

    def close(self) -> None:
        self._socket.close()


def _bound(port: int) -> socket.socket:
    """A socket for IPv4 and IPv6, where the system has both."""
    both = socket.has_dualstack_ipv6()
    made = socket.socket(socket.AF_INET6 if both else socket.AF_INET, socket.SOCK_DGRAM)
    try:
        if both:
            made.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        made.bind(("::" if both else "", port))
    except OSError as error:
        made.close()
        raise Refusal(f"port {port} is not available ({error}); choose another") from error
    return made


def _understood(data: bytes) -> JsonMessage | None:
    """The message in a datagram; None if it is of no known kind."""
    try:
        message = json.loads(data)
    except (ValueError, RecursionError):
        return None
    if not isinstance(message, dict):
        return None
    message = cast("JsonMessage", message)
    kind, version = message.get("kind"), message.get("version")
    known = kind in ("contact", "shape", "status", "cue") and version == VERSION
    return message if known else None


def _number(message: JsonMessage, key: str) -> float:
    """A number of a message; NaN where it has none."""
    value = message.get(key)
    return value if isinstance(value, int | float) and abs(value) < _ENDLESS else math.nan


def _figure(message: JsonMessage, key: str, scale: float, how: str) -> str:
    value = _number(message, key)
    return "?" if math.isnan(value) else f"{scale * value:{how}}"


def _cue_words(message: JsonMessage) -> str:
    slip = ", ".join(_figure(message, f"slip_{axis}_m_per_s", 1e3, ".1f") for axis in "xy")
    return (
        f"cue       {message.get('state')}  force {_figure(message, 'force_N', 1, '.4f')} N  "
        f"slip {slip} mm/s  scale {_figure(message, 'scale', 1, '.2f')}  "
        f"age {_figure(message, 'age_s', 1e3, '.1f')} ms"
    )


def _words(message: JsonMessage) -> str:
    head = f"contact   #{_figure(message, 'sequence', 1, '.0f')}"
    tail = f"age {_figure(message, 'age_s', 1e3, '.1f')} ms"
    if not message.get("present"):
        return f"{head}  none  {tail}"

    def bar(key: str, unit: str, scale: float, shown: str) -> str:
        value, sd = (scale * _number(message, f"{key}{of}_{unit}") for of in ("", "_sd"))
        return with_error(value, sd, shown)

    doubt = "" if message.get("single") else "  not a single load"
    second = message.get("second")
    if isinstance(second, dict):
        also = cast("JsonMessage", second)
        x, y = (_figure(also, key, 1e3, ".2f") for key in ("x_m", "y_m"))
        doubt = f"  second x {x} mm  y {y} mm  force {_figure(also, 'force_N', 1, '.4f')} N"
    snaps = SNAPS if message.get("snaps_through") else ""
    force = NO_FORCE if message.get("near_rim") else snaps
    force = force or f"force {bar('force', 'N', 1, 'N')}"
    least = "  force is a lower bound" if message.get("force_is_lower_bound") else ""
    most = "  force is an upper bound" if message.get("force_is_upper_bound") else ""
    return (
        f"{head}  x {bar('x', 'm', 1e3, 'mm')}  y {bar('y', 'm', 1e3, 'mm')}  "
        f"{force}  moved {bar('displacement', 'm', 1e3, 'mm')}  "
        f"curvature {bar('curvature_1', 'per_m', 1, '1/m')}, "
        f"{bar('curvature_2', 'per_m', 1, '1/m')}{doubt}{least}{most}  {tail}"
    )
