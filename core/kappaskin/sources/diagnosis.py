"""Diagnosis of a port: what is on it and how well it works, and a monitor of its messages."""

import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from kappaskin.errors import SourceError
from kappaskin.frames import Event, Frame
from kappaskin.sources import information
from kappaskin.sources.clock import ClockMap
from kappaskin.sources.commands import DeviceCommands, operation_name
from kappaskin.sources.decoder import SEQUENCES, Accounting, Decoder
from kappaskin.sources.ports import BAUD_RATES, SerialConnection, port_called
from kappaskin.sources.serial_source import SerialSource
from kappaskin.sources.wire import VERSION, Command, FromDevice, Information, Reply, Samples

_FEWEST_FRAMES = 3  # frames that tell no rate
_SOON = 0.02  # s that a read may wait
_SEARCH = 10.0  # s in which every baud rate has been tried
_LISTEN = 2.0  # s that a device which is known is listened to


@dataclass(frozen=True)
class Diagnosis:
    """What was found on `port`, which its plug describes as `plug`; `why` is empty if all is well.

    `device` says its name, serial number and firmware, empty where it did not say. `rate` in
    frames/s is measured, `said_rate` what it says; `clock_sd` in s is how well the time of a
    reading is known on this machine's clock, infinite where the device does not tell; NaN where
    nothing was measured.
    """

    port: str
    plug: str
    why: str = ""
    device: str = ""
    rate: float = math.nan
    said_rate: float = math.nan
    clock_sd: float = math.inf
    temperature: float = math.nan
    accounting: Accounting = field(default_factory=Accounting)
    events: tuple[Event, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Everything as JSON values; null for what is not known."""
        found = asdict(self) | {"well": not self.why}
        return {
            key: None if isinstance(value, float) and not math.isfinite(value) else value
            for key, value in found.items()
        }


def diagnose(url: str, clock: Callable[[], float] = time.monotonic) -> Diagnosis:
    """What is on the port or URL, after looking for a few seconds."""
    plug = port_called(url).words
    try:
        source = SerialSource(url, clock)
    except SourceError as error:
        return Diagnosis(url, plug, str(error))
    try:
        return _diagnosed(source, plug, clock)
    finally:
        source.close()


def _diagnosed(source: SerialSource, plug: str, clock: Callable[[], float]) -> Diagnosis:
    end = clock() + _SEARCH
    while source.sensor is None and clock() < end and not _settled(source):
        source.read(_SOON)
    sensor, frames = source.sensor, list[Frame]()
    end = clock() + _LISTEN
    while sensor is not None and clock() < end and not source.trouble:
        frames += source.read(_SOON)
    rate, clock_sd = _frame_rate(frames)
    why = source.trouble
    if sensor is not None and not frames:
        why = (
            why or f"{source.url}: the device says what it is but sends no readings; start it anew"
        )
    return Diagnosis(
        source.url,
        plug,
        why,
        f"{sensor.name} {sensor.serial_number}, firmware {sensor.firmware}" if sensor else "",
        rate,
        sensor.rate if sensor else math.nan,
        clock_sd,
        source.temperature,
        source.accounting(),
        tuple(source.events()),
    )


def _settled(source: SerialSource) -> bool:
    """Whether the trouble is one that no other baud rate can mend."""
    seen = source.accounting()
    understood = seen.good > 0 or seen.other_version is not None
    return bool(source.trouble) and (understood or not seen.bytes_in)


def _frame_rate(frames: list[Frame]) -> tuple[float, float]:
    """How many of `frames` came in a second, and how well the time of the last is known, in s."""
    if len(frames) < _FEWEST_FRAMES:
        return math.nan, math.inf
    span = frames[-1].device_time - frames[0].device_time
    return (len(frames) - 1) / span if span > 0 else math.nan, frames[-1].taken_sd


_SHOWN = 0.1  # s between two samples that are shown: nobody reads 500 lines a second
_SILENCE = 3.0  # s of silence, after which the usual causes are named
_RATE_DWELL = 0.8  # s of bytes that mean nothing, after which another baud rate is tried
_COUNTS_SHOWN = 6  # counts that are shown of a scan


class WireMonitor:
    """What comes over the port or URL, told line by line; says hello to the device, and pings.

    Opening raises a `SourceError` that says why it cannot be. `gone` once the line broke.
    """

    def __init__(self, url: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.url, self._clock = url, clock
        self._line, self._decoder = SerialConnection(url, clock), Decoder()
        self._asking = DeviceCommands(self._line.write, ClockMap())
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
        if self._heard > since and now - since > _RATE_DWELL:
            return [self._other_rate(now)]
        if now - max(self._heard, self._tuned) < _SILENCE:
            return []
        self._tuned = now
        self._asking.greet(now)
        return [
            f"nothing came for {_SILENCE:g} s. Is the device powered, and its firmware started "
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
        sensor = information.sensor_from_json(text)
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
    return f"to #{reply.command} {operation_name(reply.operation)}: {done}{data}"


def _counts(samples: Samples) -> str:
    counts, channels = samples.counts, samples.channels
    if not len(counts):
        return "no channels"
    first = " ".join(str(count) for count in counts[:_COUNTS_SHOWN])
    more = " ..." if len(counts) > _COUNTS_SHOWN else ""
    return (
        f"{len(counts)} channels from {channels[0]} to {channels[-1]}: {first}{more}, "
        f"least {np.min(counts)}, most {np.max(counts)}"
    )
