"""Diagnosis of a port, identification of devices, and a monitor of messages."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from itertools import cycle
from typing import Any

import numpy as np

from kappaskin._text import printable
from kappaskin.errors import SourceError
from kappaskin.frames import Event, Frame
from kappaskin.sources import information
from kappaskin.sources.clock import ClockMap
from kappaskin.sources.commands import DeviceCommands, operation_name
from kappaskin.sources.decoder import SEQUENCES, Accounting, Decoder
from kappaskin.sources.description import Description
from kappaskin.sources.lines import LineDecoder
from kappaskin.sources.ports import BAUD_RATE, BaudRateSearch, Port, SerialConnection, holders
from kappaskin.sources.recognition import TEXT_RATES, Recogniser
from kappaskin.sources.serial_source import SerialSource, connected
from kappaskin.sources.wire import VERSION, Command, FromDevice, Information, Reply, Samples

_FEWEST_FRAMES = 3  # frames that tell no rate
_SOON = 0.02  # s that a read may wait
_SEARCH = 10.0  # s in which every baud rate has been tried
_LISTEN = 2.0  # s that a known device is read for

_SLOW = 10.0  # lines/s below which their rate is shown with a decimal
_SHOWN = 0.1  # s between two samples that are shown: nobody reads 500 lines a second
_SILENCE = 3.0  # s of silence, after which the usual causes are named
_RATE_DWELL = 0.8  # s of unreadable bytes, after which another baud rate is tried
_COUNTS_SHOWN = 6  # counts that are shown of a scan


@dataclass(frozen=True)
class Diagnosis:
    """What was found on `port`, described as `plug`; `why` is empty if all is well.

    `device` is its name, serial number and firmware, empty where it did not send them. `rate` in
    frames/s is measured, `said_rate` is from its information; `clock_sd` in s is the standard
    deviation of the time of a reading on this machine's clock, infinite where the device does not
    answer pings; NaN where nothing was measured.
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

    @staticmethod
    def of(url: str, clock: Callable[[], float] = time.monotonic) -> "Diagnosis":
        """The diagnosis of the port or URL, after reading it for a few seconds."""
        plug = Port.named(url).words
        try:
            source = SerialSource(url, clock)
        except SourceError as error:
            return Diagnosis(url, plug, str(error))
        try:
            return _diagnosed(source, plug, clock)
        finally:
            source.close()

    def to_json(self) -> dict[str, Any]:
        """Everything as JSON values; null for what is not known."""
        found = asdict(self) | {"well": not self.why}
        return {
            key: None if isinstance(value, float) and not math.isfinite(value) else value
            for key, value in found.items()
        }


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
        why = why or f"{source.url}: the device sends its description but no readings; restart it"
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
    """Whether the trouble is one that no other baud rate can solve."""
    counts = source.accounting()
    understood = counts.good > 0 or counts.other_version is not None
    return bool(source.trouble) and (understood or not counts.bytes_in)


def _frame_rate(frames: list[Frame]) -> tuple[float, float]:
    """Frames per second, and the standard deviation of the time of the last one in s."""
    if len(frames) < _FEWEST_FRAMES:
        return math.nan, math.inf
    span = frames[-1].device_time - frames[0].device_time
    return (len(frames) - 1) / span if span > 0 else math.nan, frames[-1].taken_sd


def identified_ports(
    urls: Sequence[str], stopped: Callable[[], bool] = lambda: False
) -> Iterator[tuple[str, str]]:
    """Each port with what it sends, in words, after 10 s at most; before, that it is read.

    All are read at once until `stopped()`; the words are then empty for the rest. Nothing is sent,
    and a port that another program has open is not opened. Opening one raises DTR and RTS, at which
    some boards restart.
    """
    reading: list[_Identification] = []
    try:
        for url in urls:
            if stopped():
                break
            if by := ", ".join(holders(url)):
                yield url, f"in use by {by}"
                continue
            try:
                reading.append(_Identification(url))
            except SourceError as error:
                yield url, str(error).removeprefix(f"{url}: ")
            else:
                yield url, "listening\N{HORIZONTAL ELLIPSIS}"
        while reading and not stopped():
            time.sleep(_SOON)
            for each in list(reading):
                if text := each.found():
                    each.close()
                    reading.remove(each)
                    yield each.url, text
        for each in reading:
            yield each.url, ""
    finally:
        for each in reading:
            each.close()


class _Identification:
    """A port that is read, at one baud rate after the other, until it is known what it sends."""

    def __init__(self, url: str) -> None:
        self.url, self._connection = url, SerialConnection(url)
        self._rates, self._began = cycle(TEXT_RATES), time.monotonic()
        self._heard = self._garbled = False
        self._tune(BAUD_RATE)

    def _tune(self, rate: int) -> None:
        if rate != self._connection.baud_rate:
            self._connection.set_baud_rate(rate)
        self._decoder, self._recogniser, self._tuned_at = Decoder(), Recogniser(), time.monotonic()

    def found(self) -> str:
        """What it sends, from the bytes up to now; empty as long as that is not known."""
        connection, now, lost = self._connection, time.monotonic(), self._connection.lost
        for arrived, data in connection.take(0.0):
            self._heard = True
            self._recogniser.feed(arrived, data)
            for message in self._decoder.feed(data):
                if isinstance(message, Information):
                    return _information_text(message.text)
        if lost:
            return str(connection.refusal or "unplugged").removeprefix(f"{self.url}: ")
        counts = self._decoder.accounting()
        if counts.other_version is not None:
            return f"Kappaskin device of wire version {counts.other_version}, expected {VERSION}"
        late = now - self._began > (_SEARCH if self._heard else _SILENCE)
        if counts.good:
            return "Kappaskin device, without a description" if late else ""
        if late:
            return self._unknown()
        if now - self._tuned_at < _RATE_DWELL:
            return ""
        lines = self._recogniser.found()
        if lines.kind and math.isfinite(lines.rate):
            what = f"numbers: {len(lines.labels)} columns"
            what = what if lines.kind == "text" else f"JSON: {len(lines.labels)} numbers"
            return f"sends {what}, {lines.rate:.{int(lines.rate < _SLOW)}f} lines/s"
        if self._recogniser.garbled:
            self._garbled = True
            self._tune(next(self._rates))
        return ""

    def _unknown(self) -> str:
        if self._connection.opening:
            return "the system is still opening it"
        if not self._heard:
            return "silent"
        if (wrong := self._recogniser.found().trouble) and not self._recogniser.garbled:
            return "sends text, no rows of numbers"
        return "sends binary data" if wrong or self._garbled else "sends too little to identify"

    def close(self) -> None:
        self._connection.close()


def _information_text(text: str) -> str:
    try:
        sensor = information.sensor_from_json(text)
    except SourceError:
        return "Kappaskin device, with an invalid description"
    name = printable(f"{sensor.name} ({sensor.serial_number})")
    return f"Kappaskin device: {name}, {sensor.channels} channels"


class WireMonitor:
    """The messages on a port or URL as lines of text; greets the device, and pings it.

    Opening raises a `SourceError` that says why it cannot be. `lost` once the connection broke, or
    `ended`. A device with a `description` is sent nothing.
    """

    def __init__(
        self,
        url: str,
        clock: Callable[[], float] = time.monotonic,
        description: Description | None = None,
    ) -> None:
        self.url, self._clock, self._described = url, clock, description
        self._connection, self._decoder = connected(url, description, clock)
        if description is None:
            self._rates = BaudRateSearch(self._connection.baud_rate)
        self._commands = DeviceCommands(self._connection.write, ClockMap())
        self._began = self._received_at = self._good_at = self._tuned_at = clock()
        self._shown, self._unshown, self._samples = -math.inf, 0, 0
        self._last: int | None = None
        self._reported = Accounting()
        self.lost = False
        if self._described is None:
            self._commands.greet(self._began)

    @property
    def ended(self) -> bool:
        """Whether what was read has come to its end."""
        return self.lost and self._connection.ended

    def reset(self) -> None:
        """Let DTR and RTS fall and rise again, at which many boards restart."""
        self._connection.reset()

    def read(self, timeout: float) -> list[str]:
        """A line for each message and problem, after at most `timeout` s."""
        lost, lines = self._connection.lost, list[str]()
        for now, data in self._connection.take(timeout):
            self._received_at = now
            for message in self._decoder.feed(data):
                self._good_at = now
                if self._described is None:
                    self._rates.good(self._connection.baud_rate)
                lines += self._gap(message.sequence)
                lines += [] if isinstance(message, Command) else self._describe(message, now)
            lines += self._problems(self.accounting())
        if self._described is None:
            self._commands.attend(self._clock())
        lines += self._hints(self._clock())
        if lost and self._connection.empty:
            self.lost = True
            self._decoder.line_ended()
            lines += self._problems(self.accounting())
            broken = "connection lost: unplugged, or closed by the other end"
            why = self._connection.refusal or ("ended" if self.ended else broken)
            lines.append(str(why))
        return [f"{self._clock() - self._began:9.3f} s  {printable(line)}" for line in lines]

    def _gap(self, sequence: int) -> list[str]:
        if sequence < 0:  # of a device that numbers nothing
            return []
        last, self._last = self._last, sequence
        step = 1 if last is None else (sequence - last) % SEQUENCES
        if step == 1:
            return []
        if step < SEQUENCES // 2:
            return [_line("gap", last, f"to #{sequence}: {step - 1} messages lost")]
        return [_line("back", last, f"to #{sequence}: out of order, or the device restarted")]

    def _describe(self, message: FromDevice, now: float) -> list[str]:
        if isinstance(message, Information):
            return [
                _line("information", message.sequence, _device_text(message.text), message.time)
            ]
        if isinstance(message, Reply):
            self._commands.take(message, now)
            return [_line("reply", message.sequence, _reply_text(message), message.time)]
        self._samples += 1
        if now - self._shown < _SHOWN:
            self._unshown += 1
            return []
        more = f"; {self._unshown} more before it" if self._unshown else ""
        self._shown, self._unshown = now, 0
        text = _samples_text(message, self._described) + more
        return [_line("samples", message.sequence, text, message.time)]

    def _problems(self, now: Accounting) -> list[str]:
        """What went wrong since the last call."""
        was, self._reported = self._reported, now
        before = dict(was.discarded)
        lines = [
            f"discarded    {count - before.get(reason, 0)} bytes: {self._shown_of(reason)}"
            for reason, count in now.discarded
            if count > before.get(reason, 0)
        ]
        if now.duplicate > was.duplicate:
            lines.append(f"duplicate    {now.duplicate - was.duplicate} duplicate messages")
        if now.restarts > was.restarts:
            lines.append("restart      the device started a new count")
        if now.other_version is not None and was.other_version is None:
            lines.append(f"version      the device uses {now.other_version}, this is {VERSION}")
        return lines

    def _shown_of(self, reason: str) -> str:
        """The reason, with the last line of a described device that was discarded for it."""
        last = self._decoder.last if isinstance(self._decoder, LineDecoder) else ""
        return last if last.startswith(f"{reason}: ") else reason

    def _hints(self, now: float) -> list[str]:
        if self._described is not None:
            by, quiet = self._connection.input, now - max(self._received_at, self._tuned_at)
            hint = by.silence if by else "check its power, and that this is its port"
            if quiet < _SILENCE or not hint:
                return []
            self._tuned_at = now
            return [f"no bytes for {_SILENCE:g} s: {hint}"]
        since = max(self._good_at, self._tuned_at)
        if self._received_at > since and now - since > _RATE_DWELL:
            return [self._other_rate(now)]
        if now - max(self._received_at, self._tuned_at) < _SILENCE:
            return []
        self._tuned_at = now
        if self._connection.opening:
            return [f"not open after {now - self._began:.0f} s: the system is still opening it"]
        self._commands.greet(now)
        return [
            f"no bytes for {_SILENCE:g} s. Check that the device is powered and its firmware runs "
            "(--reset pulses DTR and RTS); on a UART, that TX and RX are crossed, ground joined"
        ]

    def _other_rate(self, now: float) -> str:
        self._connection.set_baud_rate(self._rates.next(self._connection.baud_rate))
        self._tuned_at = now
        self._commands.greet(now)
        return (
            f"bytes arrive, but no message of wire version {VERSION}: trying "
            f"{self._connection.baud_rate} baud"
        )

    def accounting(self) -> Accounting:
        return self._decoder.accounting(overrun=self._connection.overrun)

    def summary(self) -> str:
        """Totals in one line: messages, bytes, and the rate."""
        counts, lasted = self.accounting(), max(self._clock() - self._began, 1e-9)
        reasons = ", ".join(f"{count} {reason}" for reason, count in counts.discarded) or "none"
        return (
            f"{lasted:.1f} s at {self._connection.baud_rate} baud: {counts.bytes_in} bytes in, "
            f"{counts.bytes_good} good, {counts.buffered} waiting, discarded: {reasons}; "
            f"{counts.accepted} messages accepted, {counts.lost} lost, "
            f"{counts.duplicate} duplicate, {counts.restarts} restarts; "
            f"{self._samples / lasted:.1f} scans/s"
        )

    def close(self) -> None:
        self._connection.close()


def _line(kind: str, sequence: int | None, words: str, device_time: float | None = None) -> str:
    at = "" if device_time is None or math.isnan(device_time) else f"at {device_time:.6f} s  "
    number = "" if sequence is None or sequence < 0 else f"#{sequence}  "
    return f"{kind:<13}{number}{at}{words}"


def _device_text(text: str) -> str:
    try:
        sensor = information.sensor_from_json(text)
    except SourceError as error:
        return f"an invalid description of {len(text)} characters: {error}"
    return (
        f"{sensor.name}, serial number {sensor.serial_number}, firmware {sensor.firmware}, "
        f"{sensor.layout}, {sensor.channels} channels, at most {sensor.rate:g} scans/s"
        f"{', simulated' if sensor.simulated else ''}"
    )


def _reply_text(reply: Reply) -> str:
    done = f"refused ({reply.fault}): {reply.reason}" if reply.fault else "done"
    data = f", {reply.data.hex(' ')}" if reply.data and not reply.fault else ""
    return f"to #{reply.command} {operation_name(reply.operation)}: {done}{data}"


def _samples_text(samples: Samples, described: Description | None) -> str:
    """What was scanned: counts, or the readings of a described device."""
    counts, channels = samples.counts, samples.channels
    if not len(counts):
        return "no channels"
    if described is not None:
        counts = described.sensor.transduction.curvature(counts)
    first = " ".join(f"{count:g}" for count in counts[:_COUNTS_SHOWN])
    more = " ..." if len(counts) > _COUNTS_SHOWN else ""
    return (
        f"{len(counts)} channels from {channels[0]} to {channels[-1]}: {first}{more}, "
        f"min {np.min(counts):g}, max {np.max(counts):g}"
    )
