"""What a host asks of a device: to begin, and what time and how warm it is there."""

import math
import struct
from collections.abc import Callable

from kappaskin.sources.clock import ClockMap
from kappaskin.sources.wire import (
    UNKNOWN_TEMPERATURE,
    VERSION,
    Fault,
    Operation,
    Reply,
    encode_command,
    pack_runs,
)

_PING = 0.5  # s between two pings
_DEAF = 3.0  # s between two, to a device that does not answer
_PATIENCE = 2.0  # s within which a ping is answered
_ANSWER = struct.Struct("<Qh")


class Asking:
    """Commands to one device, and what became of them.

    `write` sends bytes, or gives them up. `refusal` says which command was refused last, and why.
    """

    def __init__(self, write: Callable[[bytes], object], times: ClockMap) -> None:
        self._write, self._times = write, times
        self._sequence = 0
        self._pings: dict[int, float] = {}
        self._answered = self._asked = -math.inf
        self.temperature, self.refusal = math.nan, ""

    def ask(self, operation: Operation, now: float, arguments: bytes = b"") -> int:
        """Send one command at host time `now` in s, its number; it may be lost on the line."""
        self._sequence = (self._sequence + 1) % 2**32
        self._write(encode_command(self._sequence, now, operation, arguments))
        return self._sequence

    def greet(self, now: float) -> None:
        """Begin: every channel is wanted, and to know who is there."""
        # By the clock: a device that did not see the last host go would take the first commands of
        # the next, were they counted from one, for repeated ones.
        self._sequence = round(now * 1e3) % 2**32
        self.ask(Operation.HELLO, now, bytes([VERSION, VERSION]))
        self.ask(Operation.IDENTIFY, now)
        self.ask(Operation.SCAN_LIST, now, pack_runs([]))
        self.ask(Operation.START, now)

    def attend(self, now: float) -> bool:
        """Ping when it is time to; whether it was."""
        pause = _PING if now - self._answered < _PATIENCE else _DEAF
        if now - self._asked < (_PING if math.isinf(self._asked) else pause):
            return False
        self._asked = now
        self._pings = {q: sent for q, sent in self._pings.items() if now - sent < _PATIENCE}
        self.ask(Operation.PING, now)
        self._pings[self._sequence] = now
        return True

    def take(self, reply: Reply, now: float) -> None:
        """Take note of a reply that came at host time `now`."""
        if reply.fault:
            self.refusal = f"the device refused {name_of(reply.operation)}: {reply.reason}"
            if reply.fault == Fault.NO_COMMON_VERSION:
                self.refusal += f"; this program speaks {VERSION}: update the older of the two"
            return
        sent = self._pings.pop(reply.command, None)
        if reply.operation != Operation.PING or sent is None or len(reply.data) != _ANSWER.size:
            return
        received_us, hundredths = _ANSWER.unpack(reply.data)
        self._answered = now
        self._times.exchange(sent, received_us * 1e-6, reply.time, now)
        self.temperature = math.nan if hundredths == UNKNOWN_TEMPERATURE else hundredths / 100


def name_of(operation: int) -> str:
    """What is asked for with this number, in words."""
    try:
        return Operation(operation).name.lower().replace("_", " ")
    except ValueError:
        return f"operation {operation}"
