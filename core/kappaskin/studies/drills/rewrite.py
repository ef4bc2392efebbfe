"""What happens to messages under way, before they are numbered."""

import json
import struct
from dataclasses import dataclass

from kappaskin.sources import wire

_ANSWER = struct.Struct("<Qh")  # as to a ping: when it came in us, how warm it is


@dataclass
class Times:
    """As from a device whose clock shows `ahead` s more; nothing is before 0."""

    ahead: float

    def __call__(self, message: wire.FromDevice) -> list[wire.FromDevice]:
        if (
            isinstance(message, wire.Reply)
            and message.operation == wire.Operation.PING
            and not message.fault
        ):
            received_us, temperature = _ANSWER.unpack(message.data)
            received_us = max(0, received_us + round(self.ahead * 1e6))
            message = message._replace(data=_ANSWER.pack(received_us, temperature))
        return [message._replace(time=max(0.0, message.time + self.ahead))]


@dataclass
class Says:
    """As from a device that says `value` under `key` of what it is."""

    key: str
    value: str

    def __call__(self, message: wire.FromDevice) -> list[wire.FromDevice]:
        if not isinstance(message, wire.Information):
            return [message]
        return [
            message._replace(text=json.dumps(json.loads(message.text) | {self.key: self.value}))
        ]


def untold(message: wire.FromDevice) -> list[wire.FromDevice]:
    """As from a device that does not say what it is."""
    return [] if isinstance(message, wire.Information) else [message]
