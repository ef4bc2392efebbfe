"""What a scanner chooses to commands that let a device scan it, until the device says it does."""

import math
import struct
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from kappaskin.estimation import Scanner
from kappaskin.sensing import Sensor
from kappaskin.sources.wire import MOST_RUNS, RATE_UNIT, Operation, Reply, pack_runs

_ALL = pack_runs([])
_DEAF = (
    "expected a device that takes commands, got no reply to them; it goes on scanning what it "
    "chooses: update its firmware, or check the line from the host to it"
)

Ask = Callable[[Operation, float, bytes], int]

LISTS = 20
"""Lists a second that a device is asked to scan, at most."""

_PAUSE = 1 / LISTS
_AGAIN = 0.5  # s after which a command without a reply is sent again
_PATIENCE = 2.0  # s after which a device is taken for one that obeys nothing


class Scanning:
    """Lets one device scan what a scanner chooses; everything without one.

    `refusal` says why the device scans something else; empty when it does as asked.
    """

    def __init__(self) -> None:
        self._scanner: Scanner | None = None
        self.refusal = ""
        self.begin()

    def begin(self) -> None:
        """A device is there that scans everything, at its own rate."""
        self._list: bytes | None = _ALL  # asked for last; None while nobody knows what it does
        self._rate: int | None = None  # asked for last; None for the device's own
        self._forget()

    def _forget(self) -> None:
        self._asked: dict[int, tuple[Operation, bytes]] = {}  # not answered yet, by number
        self._sent = -math.inf
        self._since = math.inf  # when the first of them was sent
        self._takes_lists = self._takes_rates = True

    def scan(self, scanner: Scanner | None) -> None:
        """Let the device scan what `scanner` chooses from now on."""
        self._scanner, self.refusal = scanner, ""
        if self._asked:
            self._list = None
        self._forget()

    def attend(self, now: float, sensor: Sensor, ask: Ask) -> None:
        """Send what is to be sent at host time `now` in s."""
        pause = _AGAIN if self._asked else _PAUSE
        if now - self._sent < pause or not self._takes_lists:
            return
        if self._scanner is not None and now - self._since > _PATIENCE:
            self.refusal = _DEAF
        if wanted := list(self._asked.values()) or self._wanted(sensor):
            self._sent, self._since = now, min(self._since, now)
            self._asked = {ask(what, now, how): (what, how) for what, how in wanted}

    def _wanted(self, sensor: Sensor) -> list[tuple[Operation, bytes]]:
        """What is to be asked for, in the order in which no list is too long for its rate."""
        listed, rate = self._next(sensor)
        wanted = [(Operation.SCAN_LIST, listed)] if listed != self._list else []
        if rate is not None and rate != self._rate and self._takes_rates:
            slower = self._rate is not None and rate < self._rate
            wanted.insert(0 if slower else len(wanted), (Operation.RATE, struct.pack("<I", rate)))
            self._rate = rate
        self._list = listed
        return wanted

    def _next(self, sensor: Sensor) -> tuple[bytes, int | None]:
        """The next list, and the rate in frames per 1000 s; none where it was never another."""
        if self._scanner is None:
            return _ALL, None if self._rate is None else _paced(sensor.rate)
        scan = self._scanner()
        channels, rate = scan.channels, _paced(min(self._scanner.rate, scan.rate))
        if len(channels) == sensor.channels:
            return _ALL, rate
        if sensor.channel_map is not None:
            channels = np.argsort(sensor.channel_map)[channels]
        return pack_runs(in_few_runs(channels)), rate

    def take(self, reply: Reply) -> None:
        """Take note of a reply, if it is to one of the commands."""
        what, _ = self._asked.pop(reply.command, (None, b""))
        if what == Operation.RATE:
            self._takes_rates = not reply.fault  # the region is scanned at another, then
        elif what == Operation.SCAN_LIST:
            self._takes_lists = not reply.fault
            self.refusal = f"the device refused the scan list: {reply.reason}" * bool(reply.fault)
        if what is not None:
            self._since = math.inf


def _paced(rate: float) -> int:
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
