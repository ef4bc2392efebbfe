"""Datagrams that were published to lines that a person reads."""

import json
import math
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, cast

from kappaskin.errors import Refusal
from kappaskin.publish.message import VERSION

_SHOWN = 0.1  # s between two contacts that are shown: nobody reads a thousand lines a second
_BUFFER = 2**20  # bytes that may wait while this process sleeps
_LARGEST = 65536
_ENDLESS = 1e300  # no quantity of ours
_AT_ONCE = 1000  # datagrams read without a look at anything else

Told = dict[str, Any]


class Listener:
    """What comes to a UDP `port`, told line by line; what was lost is told by gaps in `number`."""

    def __init__(self, port: int, clock: Callable[[], float] = time.monotonic) -> None:
        if not 0 < port < 65536:
            raise Refusal(f"expected a port from 1 to 65535, got {port}")
        self._clock, self._began = clock, clock()
        self._socket = _bound(port)
        self._number: int | None = None
        self._shown, self._state = -math.inf, ""
        self._sender: object = None
        self.contacts = self.lost = self.foreign = 0

    def read(self, timeout: float) -> list[Told]:
        """The messages that came, after at most `timeout` s."""
        self._socket.settimeout(timeout)
        came: list[Told] = []
        with suppress(TimeoutError, BlockingIOError):
            for _ in range(_AT_ONCE):
                data, sender = self._socket.recvfrom(_LARGEST)
                self._socket.settimeout(0)
                message = _understood(data)
                if message is None:
                    self.foreign += 1
                    continue
                if self._sender not in (None, sender):
                    self._number = None  # another one counts for itself
                self._sender = sender
                came.append(message)
        return came

    def lines(self, message: Told) -> list[str]:
        """What a message says, and what is missing before it; often nothing that is news."""
        said: list[str] = []
        if message["kind"] == "contact":
            said += self._gap(message.get("number"))
            now = self._clock()
            if now - self._shown >= _SHOWN:
                self._shown = now
                said.append(_words(message))
        elif message["kind"] == "status":
            state = f"{message.get('state')}  {message.get('sensor')}  {message.get('message')}"
            if state != self._state:
                said.append(f"status    {state}")
            self._state = state
        return [f"{self._clock() - self._began:9.3f} s  {_plain(line)}" for line in said]

    def _gap(self, number: object) -> list[str]:
        last, self._number = self._number, number if isinstance(number, int) else None
        self.contacts += 1
        if last is None or self._number is None or self._number == last + 1:
            return []
        missing = self._number - last - 1
        if missing < 0:
            return ["back      a late one, or the sender began anew"]
        self.lost += missing
        return [f"gap       {missing} messages lost"]

    @property
    def summary(self) -> str:
        foreign = f", {self.foreign} datagrams that are none of ours" if self.foreign else ""
        return f"{self.contacts} contacts came, {self.lost} were lost{foreign}"

    def close(self) -> None:
        self._socket.close()


def _bound(port: int) -> socket.socket:
    """A socket that hears both kinds of addresses, where the system has both."""
    both = socket.has_dualstack_ipv6()
    made = socket.socket(socket.AF_INET6 if both else socket.AF_INET, socket.SOCK_DGRAM)
    try:
        if both:
            made.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        made.bind(("::" if both else "", port))
    except OSError as error:
        made.close()
        raise Refusal(f"port {port} cannot be listened on ({error}); choose another") from error
    return made


def _understood(data: bytes) -> Told | None:
    """The message in a datagram, if it is one of ours that is known here."""
    try:
        message = json.loads(data)
    except (ValueError, RecursionError):
        return None
    if not isinstance(message, dict):
        return None
    told = cast("Told", message)
    known = told.get("kind") in ("contact", "shape", "status") and told.get("version") == VERSION
    return told if known else None


def _plain(line: str) -> str:
    """What may be shown on a terminal, whoever sent it."""
    return "".join(c if c.isprintable() else "?" for c in line)


def _figure(message: Told, key: str, scale: float, how: str) -> str:
    value = message.get(key)
    if not isinstance(value, int | float) or not abs(value) < _ENDLESS:
        return "?"
    return f"{scale * value:{how}}"


def _words(message: Told) -> str:
    head = f"contact   #{_figure(message, 'sequence', 1, '.0f')}"
    tail = f"age {_figure(message, 'age_s', 1e3, '.1f')} ms"
    if not message.get("present"):
        return f"{head}  none  {tail}"

    def bar(key: str, unit: str, scale: float, how: str) -> str:
        sd_key = f"{key}_sd_{unit}"
        value, sd = (_figure(message, k, scale, how) for k in (f"{key}_{unit}", sd_key))
        return f"{value} +- {sd}"

    doubt = "" if message.get("single") else "  more than one load?"
    rim = "  near the rim" if message.get("near_rim") else ""
    return (
        f"{head}  x {bar('x', 'm', 1e3, '.2f')} mm  y {bar('y', 'm', 1e3, '.2f')} mm  "
        f"force {bar('force', 'N', 1, '.4f')} N  moved {bar('displacement', 'm', 1e3, '.3f')} mm  "
        f"curvature {bar('curvature_1', 'per_m', 1, '.2f')}, "
        f"{bar('curvature_2', 'per_m', 1, '.2f')} 1/m{doubt}{rim}  {tail}"
    )
