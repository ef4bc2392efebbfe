"""Commands to a device: the greeting, pings, scan lists and frame rates, and their replies."""

import math
import struct
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from kappaskin.estimation import Scanner
from kappaskin.sensing import Sensor
from kappaskin.sources.clock import ClockMap
from kappaskin.sources.wire import (
    MOST_RUNS,
    RATE_UNIT,
    UNKNOWN_TEMPERATURE,
    VERSION,
    Fault,
    Operation,
    Reply,
    encode_command,
    pack_runs,
)

SCAN_LISTS_PER_SECOND = 20
"""Scan lists a second that are sent to a device, at most."""

_PING = 0.5  # s between two pings
_PING_UNANSWERED = 3.0  # s between two, to a device that does not answer
_PING_TIMEOUT = 2.0  # s within which a ping is answered
_PING_REPLY = struct.Struct("<Qh")

_ALL_CHANNELS = pack_runs([])
_PAUSE = 1 / SCAN_LISTS_PER_SECOND
_AGAIN = 0.5  # s after which a command without a reply is sent again
_REPLY_TIMEOUT = 2.0  # s after which a device is taken for one that obeys no command
_NO_REPLY = (
    "expected a device that replies to commands, got no reply; it scans the channels that it "
    "selects: update its firmware, or check the line from the host to it"
)

SendCommand = Callable[[Operation, float, bytes], int]


class DeviceCommands:
    """Sends commands to one device and takes its replies; pings map its clock by `clock_map`.

    `write` sends bytes, or gives them up. `refusal` says which command was refused last, and why.
    """

    def __init__(self, write: Callable[[bytes], object], clock_map: ClockMap) -> None:
        self._write, self._clock_map = write, clock_map
        self._sequence = 0
        self._pings: dict[int, float] = {}
        self._answered_at = self._pinged_at = -math.inf
        self.temperature, self.refusal = math.nan, ""

    def send(self, operation: Operation, now: float, arguments: bytes = b"") -> int:
        """Send one command at host time `now` in s, its number; it may be lost on the way."""
        self._sequence = (self._sequence + 1) % 2**32
        self._write(encode_command(self._sequence, now, operation, arguments))
        return self._sequence

    def greet(self, now: float) -> None:
        """Begin: ask for the device's information, and for all channels."""
        # By the clock: a device that did not see the last host go would take the first commands of
        # the next, were they counted from one, for repeated ones.
        self._sequence = round(now * 1e3) % 2**32
        self.send(Operation.HELLO, now, bytes([VERSION, VERSION]))
        self.send(Operation.IDENTIFY, now)
        self.send(Operation.SCAN_LIST, now, _ALL_CHANNELS)
        self.send(Operation.START, now)

    def attend(self, now: float) -> bool:
        """Ping when it is time to; whether it was."""
        pause = _PING if now - self._answered_at < _PING_TIMEOUT else _PING_UNANSWERED
        if now - self._pinged_at < (_PING if math.isinf(self._pinged_at) else pause):
            return False
        self._pinged_at = now
        self._pings = {q: sent for q, sent in self._pings.items() if now - sent < _PING_TIMEOUT}
        self._pings[self.send(Operation.PING, now)] = now
        return True

    def take(self, reply: Reply, now: float) -> None:
        """Take a reply that arrived at host time `now`."""
        if reply.fault:
            self.refusal = f"the device refused {operation_name(reply.operation)}: {reply.reason}"
            if reply.fault == Fault.NO_COMMON_VERSION:
                self.refusal += f"; this program uses {VERSION}: update the older of the two"
            return
        sent = self._pings.pop(reply.command, None)
        if reply.operation != Operation.PING or sent is None or len(reply.data) != _PING_REPLY.size:
            return
        received_us, hundredths = _PING_REPLY.unpack(reply.data)
        self._answered_at = now
        self._clock_map.exchange(sent, received_us * 1e-6, reply.time, now)
        self.temperature = math.nan if hundredths == UNKNOWN_TEMPERATURE else hundredths / 100


def operation_name(operation: int) -> str:
    """The name of the operation with this number, such as "scan list"."""
    try:
        return Operation(operation).name.lower().replace("_", " ")
    except ValueError:
        return f"operation {operation}"


class ScanControl:
    """Lets one device scan what a scanner chooses; all channels without one.

    `refusal` says why the device scans something else; empty when it does as requested.
    """

    def __init__(self) -> None:
        self._scanner: Scanner | None = None
        self.refusal = ""
        self.begin()

    def begin(self) -> None:
        """A device is there that scans all channels, at its own rate."""
        self._list: bytes | None = _ALL_CHANNELS  # requested last; None where that is not known
        self._rate: int | None = None  # requested last; None for the device's own
        self._forget()

    def _forget(self) -> None:
        self._unanswered: dict[int, tuple[Operation, bytes]] = {}  # by number
        self._sent_at = -math.inf
        self._unanswered_since = math.inf
        self._takes_lists = self._takes_rates = True

    def scan(self, scanner: Scanner | None) -> None:
        """Let the device scan what `scanner` chooses from now on."""
        self._scanner, self.refusal = scanner, ""
        if self._unanswered:
            self._list = None
        self._forget()

    def attend(self, now: float, sensor: Sensor, send: SendCommand) -> None:
        """Send what is to be sent at host time `now` in s."""
        pause = _AGAIN if self._unanswered else _PAUSE
        if now - self._sent_at < pause or not self._takes_lists:
            return
        if self._scanner is not None and now - self._unanswered_since > _REPLY_TIMEOUT:
            self.refusal = _NO_REPLY
        if commands := list(self._unanswered.values()) or self._changes(sensor):
            self._sent_at, self._unanswered_since = now, min(self._unanswered_since, now)
            self._unanswered = {send(what, now, how): (what, how) for what, how in commands}

    def _changes(self, sensor: Sensor) -> list[tuple[Operation, bytes]]:
        """The commands to send, in the order in which no list is too long for its rate."""
        listed, rate = self._next(sensor)
        commands = [(Operation.SCAN_LIST, listed)] if listed != self._list else []
        if rate is not None and rate != self._rate and self._takes_rates:
            slower = self._rate is not None and rate < self._rate
            command = (Operation.RATE, struct.pack("<I", rate))
            commands.insert(0 if slower else len(commands), command)
            self._rate = rate
        self._list = listed
        return commands

    def _next(self, sensor: Sensor) -> tuple[bytes, int | None]:
        """The next list, and the rate in frames per 1000 s; none where it was never another."""
        if self._scanner is None:
            return _ALL_CHANNELS, None if self._rate is None else _wire_rate(sensor.rate)
        scan = self._scanner()
        channels, rate = scan.channels, _wire_rate(min(self._scanner.rate, scan.rate))
        if len(channels) == sensor.channels:
            return _ALL_CHANNELS, rate
        if sensor.channel_map is not None:
            channels = np.argsort(sensor.channel_map)[channels]
        return pack_runs(in_few_runs(channels)), rate

    def take(self, reply: Reply) -> None:
        """Take a reply, if it is to one of the commands."""
        what, _ = self._unanswered.pop(reply.command, (None, b""))
        if what == Operation.RATE:
            self._takes_rates = not reply.fault  # the region is scanned at another, then
        elif what == Operation.SCAN_LIST:
            self._takes_lists = not reply.fault
            self.refusal = f"the device refused the scan list: {reply.reason}" * bool(reply.fault)
        if what is not None:
            self._unanswered_since = math.inf


def _wire_rate(rate: float) -> int:
    return math.floor(rate * RATE_UNIT)


def in_few_runs(channels: NDArray[np.intp]) -> NDArray[np.intp]:
    """The `channels` (C,) upwards, and between them as few others as fit them into one list."""
    upwards = np.sort(channels)
    gaps = np.diff(upwards)
    if np.count_nonzero(gaps > 1) < MOST_RUNS:
        return upwards
    breaks = np.sort(np.argsort(gaps, kind="stable")[1 - MOST_RUNS :])
    ends = pairwise([-1, *map(int, breaks), len(upwards) - 1])
    runs = [np.arange(int(upwards[a + 1]), int(upwards[b]) + 1) for a, b in ends]
    return np.concatenate(runs)
