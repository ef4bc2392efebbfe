"""The messages of a recording to the frames that there were, bit for bit."""

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from kappaskin.bases import check_edge
from kappaskin.errors import Refusal
from kappaskin.frames import Frame, Truth
from kappaskin.recording import messages as m
from kappaskin.recording.cdr import decode
from kappaskin.recording.reading import Message
from kappaskin.sensing import Sensor
from kappaskin.sources import Accounting, ClockState, Decoder, Interpreter, RecordedClock, wire

_UNREAD = 2**16  # messages kept until the device says what they are of
_FUNCTIONS = 128  # of a truth along one side, at most


class Reenactment:
    """Takes the messages of the recording called `name` as they were written.

    Sensors `made` by another of the same recording are the same ones here.
    """

    def __init__(self, name: str, made: dict[str, Sensor] | None = None) -> None:
        self._decoder = Decoder()
        self._times = RecordedClock()
        self._means = Interpreter(name, made)
        self._means.begin(self._times)
        self._pending: deque[tuple[float, wire.FromDevice]] = deque(maxlen=_UNREAD)
        self._truth: Truth | None = None

    @property
    def sensor(self) -> Sensor | None:
        return self._means.sensor

    @property
    def trouble(self) -> str:
        """Why what was recorded cannot be used; empty when it can."""
        return self._means.unusable

    def accounting(self) -> Accounting:
        return self._decoder.accounting()

    def begin_with(self, message: Message) -> None:
        """Take it, from the middle of a recording, that a device or clock was last told of so."""
        if message.topic == m.CLOCKS.name:
            self._map(decode(m.CLOCK, message.data) | {"since": math.nan})
        else:
            self._means.learn(decode(m.STRING, message.data)["data"])

    def __call__(self, message: Message) -> Iterator[Frame]:
        """The frames that came with one message, each of the `sensor` that there is then.

        A `Refusal` when it is none of its topic.
        """
        if message.topic == m.LINES.name:
            host_time, sent, data = m.unpack_line(message.data)
            if not sent and data:
                yield from self._came(host_time, data)
            elif not sent:
                self._ended()
        elif message.topic == m.DEVICE.name:
            self._means.learn(decode(m.STRING, message.data)["data"])
        elif message.topic == m.CLOCKS.name:
            self._map(decode(m.CLOCK, message.data))
        elif message.topic == m.TRUTHS.name:
            self._truth = _truth(decode(m.TRUTH, message.data), self.sensor)

    def _ended(self) -> None:
        self._decoder.line_ended()
        self._decoder.sequence.interrupt()
        self._pending.clear()
        self._times, self._truth = RecordedClock(), None
        self._means.begin(self._times)

    def _map(self, said: dict[str, Any]) -> None:
        numbers = (said[name] for name in ("at", "offset", "half", "drift", "spread"))
        known = ClockState((*numbers, bool(said["doubted"])), int(said["wraps"]), said["last"])
        if math.isnan(said["since"]):
            self._times.restore(known)
        else:
            self._times.changes.append((said["since"], known))

    def _came(self, now: float, data: bytes) -> Iterator[Frame]:
        messages = self._decoder.feed(data)
        self._pending += [(now, got) for got in messages if not isinstance(got, wire.Command)]
        if not self._means.known and not self._introduced():
            return
        while self._pending:
            now, message = self._pending.popleft()
            if isinstance(message, wire.Information):
                self._means.learn(message.text)
            elif isinstance(message, wire.Samples) and (frame := self._means.frame(message, now)):
                yield replace(frame, truth=self._truth)

    def _introduced(self) -> bool:
        """Whether the device is known, now that it has been looked for in what came."""
        for _, message in self._pending:
            if isinstance(message, wire.Information):
                self._means.learn(message.text)
                break
        return self._means.known


def _truth(said: dict[str, Any], sensor: Sensor | None) -> Truth | None:
    """The truth of the frames that follow; None where there is none."""
    shape, coefficients = tuple(said["shape"].tolist()), said["coefficients"]
    if sensor is None or not coefficients.size:
        return None
    check_edge(sensor.layout.patch, said["edge"])
    if math.prod(shape) != coefficients.size or max(shape) > _FUNCTIONS:
        raise Refusal(f"expected a truth of shape {shape}, got {coefficients.size} numbers")
    return Truth(coefficients.reshape(shape), said["contact"], said["edge"])
