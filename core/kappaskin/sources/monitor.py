"""Bytes on a line to lines that a person reads, for bringing up a device."""

import math
import time
from collections.abc import Callable

import numpy as np

from kappaskin.errors import SourceError
from kappaskin.sources import information
from kappaskin.sources.accounting import SEQUENCES, Accounting
from kappaskin.sources.asking import Asking, name_of
from kappaskin.sources.clock import ClockMap
from kappaskin.sources.decoder import Decoder
from kappaskin.sources.line import Line
from kappaskin.sources.tuning import BAUD_RATES
from kappaskin.sources.wire import VERSION, Command, FromDevice, Information, Reply, Samples

_SHOWN = 0.1  # s between two samples that are shown: nobody reads 500 lines a second
_PATIENCE = 3.0  # s of silence, after which the usual causes are named
_DWELL = 0.8  # s of bytes that mean nothing, after which another baud rate is tried
_FEW = 6  # counts that are shown of a scan


class Monitor:
    """What comes over the port or URL, told line by line; says hello to the device, and pings.

    Opening raises a `SourceError` that says why it cannot be. `gone` once the line broke.
    """

    def __init__(self, url: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.url, self._clock = url, clock
        self._line, self._decoder = Line(url, clock), Decoder()
        self._asking = Asking(self._line.write, ClockMap())
        self._began = self._heard = self._good_at = self._tuned = clock()
        self._shown, self._unshown, self._samples = -math.inf, 0, 0
        self._last: int | None = None
        self._told = Accounting()
        self.gone = False
        self._asking.greet(self._began)

    def reset(self) -> None:
        """Let DTR and RTS fall and rise again, at which many boards start anew."""
        self._line.reset()

    def read(self, timeout: float) -> list[str]:
        """What came, after at most `timeout` s."""
        gone, said = self._line.gone, list[str]()
        for now, data in self._line.take(timeout):
            self._heard = now
            for message in self._decoder.feed(data):
                self._good_at = now
                said += self._gap(message.sequence)
                said += [] if isinstance(message, Command) else self._words(message, now)
            said += self._changes(self.accounting())
        self._asking.attend(self._clock())
        said += self._hints(self._clock())
        if gone:
            self.gone = True
            self._decoder.line_ended()
            said += [*self._changes(self.accounting()), "the line is gone: unplugged, or ended"]
        return [f"{self._clock() - self._began:9.3f} s  {_plain(line)}" for line in said]

    def _gap(self, sequence: int) -> list[str]:
        last, self._last = self._last, sequence
        step = 1 if last is None else (sequence - last) % SEQUENCES
        if step == 1:
            return []
        if step < SEQUENCES // 2:
            return [_line("gap", last, f"to #{sequence}: {step - 1} messages lost")]
        return [_line("back", last, f"to #{sequence}: a late one, or the device began anew")]

    def _words(self, message: FromDevice, now: float) -> list[str]:
        if isinstance(message, Information):
            return [_line("information", message.sequence, _who(message.text), message.time)]
        if isinstance(message, Reply):
            self._asking.take(message, now)
            return [_line("reply", message.sequence, _answer(message), message.time)]
        self._samples += 1
        if now - self._shown < _SHOWN:
            self._unshown += 1
            return []
        more = f"; {self._unshown} more before it" if self._unshown else ""
        self._shown, self._unshown = now, 0
        return [_line("samples", message.sequence, _counts(message) + more, message.time)]

    def _changes(self, now: Accounting) -> list[str]:
        """What went wrong since this was last asked."""
        was, self._told = self._told, now
        before = dict(was.discarded)
        said = [
            f"discarded    {count - before.get(reason, 0)} bytes: {reason}"
            for reason, count in now.discarded
            if count > before.get(reason, 0)
        ]
        if now.duplicate > was.duplicate:
            said.append(f"duplicate    {now.duplicate - was.duplicate} messages came twice")
        if now.restarts > was.restarts:
            said.append("restart      the device counts from another number")
        if now.other_version is not None and was.other_version is None:
            said.append(f"version      the device speaks {now.other_version}, this is {VERSION}")
        return said

    def _hints(self, now: float) -> list[str]:
        since = max(self._good_at, self._tuned)
        if self._heard > since and now - since > _DWELL:
            return [self._other_rate(now)]
        if now - max(self._heard, self._tuned) < _PATIENCE:
            return []
        self._tuned = now
        self._asking.greet(now)
        return [
            f"nothing came for {_PATIENCE:g} s. Is the device powered, and its firmware started "
            "(--reset pulses DTR and RTS)? On a UART: are TX and RX crossed, and ground joined?"
        ]

    def _other_rate(self, now: float) -> str:
        place = (BAUD_RATES.index(self._line.baud_rate) + 1) % len(BAUD_RATES)
        self._line.speak_at(BAUD_RATES[place])
        self._tuned = now
        self._asking.greet(now)
        return (
            f"bytes come, but no message of wire version {VERSION}: trying "
            f"{self._line.baud_rate} baud"
        )

    def accounting(self) -> Accounting:
        return self._decoder.accounting(overrun=self._line.overrun)

    def summary(self) -> str:
        """What came in all: messages, bytes, and the rate."""
        seen, lasted = self.accounting(), max(self._clock() - self._began, 1e-9)
        reasons = ", ".join(f"{count} {reason}" for reason, count in seen.discarded) or "none"
        return (
            f"{lasted:.1f} s at {self._line.baud_rate} baud: {seen.bytes_in} bytes in, "
            f"{seen.bytes_good} good, {seen.buffered} waiting, discarded: {reasons}; "
            f"{seen.accepted} messages accepted, {seen.lost} lost, {seen.duplicate} twice, "
            f"{seen.restarts} restarts; {self._samples / lasted:.1f} scans/s"
        )

    def close(self) -> None:
        self._line.close()


def _plain(text: str) -> str:
    """The text without what would steer a terminal: a device may say anything."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def _line(kind: str, sequence: int | None, words: str, device_time: float | None = None) -> str:
    at = "" if device_time is None else f"at {device_time:.6f} s  "
    return f"{kind:<13}#{sequence}  {at}{words}"


def _who(text: str) -> str:
    try:
        sensor = information.from_json(text)
    except SourceError as error:
        return f"{len(text)} characters that cannot be used: {error}"
    return (
        f"{sensor.name}, serial number {sensor.serial_number}, firmware {sensor.firmware}, "
        f"{sensor.layout}, {sensor.channels} channels, at most {sensor.rate:g} scans/s"
        f"{', simulated' if sensor.simulated else ''}"
    )


def _answer(reply: Reply) -> str:
    done = f"refused ({reply.fault}): {reply.reason}" if reply.fault else "done"
    data = f", {reply.data.hex(' ')}" if reply.data and not reply.fault else ""
    return f"to #{reply.command} {name_of(reply.operation)}: {done}{data}"


def _counts(samples: Samples) -> str:
    counts, channels = samples.counts, samples.channels
    if not len(counts):
        return "no channels"
    first = " ".join(str(count) for count in counts[:_FEW])
    more = " ..." if len(counts) > _FEW else ""
    return (
        f"{len(counts)} channels from {channels[0]} to {channels[-1]}: {first}{more}, "
        f"least {np.min(counts)}, most {np.max(counts)}"
    )
