"""Fault drills of line and device: noise, baud rates, stalls, restarts, unplugging."""

import json
import math
import os
import signal
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from kappaskin.sources import BAUD_RATES, wire
from kappaskin.studies.drills.stand import (
    Drill,
    DrillOutcome,
    ProcessResources,
    Spoil,
    Stand,
    clean,
)

# Faults of messages, before they are numbered

_ANSWER = struct.Struct("<Qh")  # as to a ping: when it came in us, how warm it is


@dataclass
class ClockShift:
    """As from a device whose clock is `ahead` s fast; no time is before 0."""

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
class InformationChange:
    """As from a device that reports `value` under `key` of its description."""

    key: str
    value: str

    def __call__(self, message: wire.FromDevice) -> list[wire.FromDevice]:
        if not isinstance(message, wire.Information):
            return [message]
        return [
            message._replace(text=json.dumps(json.loads(message.text) | {self.key: self.value}))
        ]


def without_information(message: wire.FromDevice) -> list[wire.FromDevice]:
    """As from a device that does not describe itself."""
    return [] if isinstance(message, wire.Information) else [message]


# Faults of bytes under way

_BURST = 64  # bytes, the mean of a burst of garbage
_KIND = 3  # the place of a message's kind


@dataclass
class Garbage:
    """Bursts of noise in the place of `share` of the bytes, or as many between them, at random."""

    share: float
    rng: np.random.Generator

    def __call__(self, data: bytes) -> bytes:
        spoilt = bytearray(data)
        for _ in range(self.rng.poisson(self.share * len(data) / _BURST)):
            length = int(self.rng.geometric(1 / _BURST))
            at = int(self.rng.integers(len(spoilt) + 1))
            over = length if self.rng.random() < 0.5 else 0
            spoilt[at : at + over] = self.rng.bytes(length)
        return bytes(spoilt)


@dataclass
class FlippedBits:
    """One bit in `every` so many turned over, at random."""

    every: int
    rng: np.random.Generator

    def __call__(self, data: bytes) -> bytes:
        spoilt = bytearray(data)
        for place in self.rng.integers(
            8 * len(data), size=self.rng.poisson(8 * len(data) / self.every)
        ):
            spoilt[place // 8] ^= 1 << (place % 8)
        return bytes(spoilt)


@dataclass
class CutScans:
    """Every second scan is broken off, one byte later each time; `cuts` counts them."""

    cuts: int = 0
    length: int = 1
    whole: bool = True

    def __call__(self, data: bytes) -> bytes:
        if data[_KIND] != wire.MessageKind.SAMPLES:
            return data
        self.whole, self.length = not self.whole, len(data)
        if self.whole:
            return data
        self.cuts += 1
        return data[: (self.cuts - 1) % len(data)]


@dataclass
class OtherBaudRate:
    """The line is read at another baud rate than it is sent at."""

    sent_at: float
    read_at: float

    def __call__(self, data: bytes) -> bytes:
        return received_at(data, self.sent_at, self.read_at)


# A receiver at another baud rate


def _levels(data: bytes) -> NDArray[np.uint8]:
    """The line while `data` passes, a level for each bit: start, eight data bits, stop."""
    bits = np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little").reshape(-1, 8)
    framed = np.ones((len(data), 10), np.uint8)
    framed[:, 0], framed[:, 1:9] = 0, bits
    return framed.ravel()


def received_at(data: bytes, sent_at: float, read_at: float) -> bytes:
    """What a receiver at the baud rate `read_at` takes for bytes when `data` is sent at another.

    It waits for the line to fall, samples the middle of eight bits, lowest first, and of a stop
    bit; whether that is one is not checked, as systems do by default.
    """
    line = np.append(_levels(data), np.ones(10, np.uint8))
    step = sent_at / read_at  # bits of the sender per bit of the receiver
    falls = np.flatnonzero(np.diff(line.astype(np.int8), prepend=1) < 0)
    middles = ((np.arange(1, 9) + 0.5) * step).astype(np.intp)
    sampled = np.minimum(falls[:, None] + middles, len(line) - 1)
    values = np.packbits(line[sampled], axis=1, bitorder="little").ravel().tolist()
    # A line that is still low in the middle of the stop bit must rise before it can fall again.
    following = np.searchsorted(falls, falls + 9.5 * step).tolist()
    made, at = bytearray(), 0
    while at < len(values):
        made.append(values[at])
        at = following[at]
    return bytes(made)


def speed_code(baud_rate: int) -> int:
    """The system's constant of a baud rate."""
    import termios

    return getattr(termios, f"B{baud_rate}", baud_rate)


# Drills on the line and the device: noise, wrong baud rates, stalls, restarts, unplugging

# The bytes under way

_WITHIN = 1.0  # s
_SEARCH = 12.0  # s to find one of seven baud rates


def _spoilt(make: Callable[[Stand], Spoil], stand: Stand) -> DrillOutcome:
    """Corrupt the traffic for some time."""
    with stand.fault(_WITHIN):
        stand.relay.spoil = make(stand)
        stand.run(10.0 if stand.long else 0.8)
    spoilt = stand.source.accounting().bytes_discarded
    return stand.outcome((spoilt > 0, "nothing was corrupted"))


def _cuts(stand: Stand) -> DrillOutcome:
    """Break messages off at every byte of the longest, and let a whole one follow each."""
    cut = CutScans()
    with stand.fault(_WITHIN):
        stand.relay.rewrite, stand.relay.spoil = (lambda message: [message] * 4), cut
        done = stand.until(lambda: cut.cuts >= cut.length, 60.0)
    lost = stand.source.accounting().lost
    return stand.outcome(
        (done, f"only {cut.cuts} of {cut.length} cuts were made within 60 s"),
        (lost == cut.cuts, f"{cut.cuts} messages were cut, {lost} lost"),
    )


def _speed(baud_rate: int, stand: Stand) -> DrillOutcome:
    """A device that is readable at one baud rate only."""
    relay, code = stand.relay, speed_code(baud_rate)
    rates = {speed_code(rate): rate for rate in BAUD_RATES}

    def as_heard(data: bytes) -> bytes:
        if relay.speed == code:
            return data
        return OtherBaudRate(baud_rate, rates.get(relay.speed, baud_rate / 2))(data)

    relay.spoil = as_heard
    stand.recover(_SEARCH)
    relay.spoil = clean
    lost = stand.source.accounting().lost
    return stand.outcome(
        (stand.reported("rate"), "the detected baud rate is not reported"),
        (lost == 0, f"{lost} messages lost after the rate was found"),
        restarted=True,  # what was sent before is nowhere counted
    )


GARBAGE = [
    Drill(
        f"garbage {100 * share:.0f} %",
        f"bursts of noise over and between {100 * share:.0f} % of the bytes",
        partial(_spoilt, lambda stand, share=share: Garbage(share, stand.rng)),
        _WITHIN,
    )
    for share in (0.01, 0.05, 0.2)
]

BYTE_DRILLS = [
    *GARBAGE,
    Drill(
        "bits",
        "one bit in 20,000 inverted",
        partial(_spoilt, lambda stand: FlippedBits(20_000, stand.rng)),
        _WITHIN,
    ),
    Drill("cuts", "messages cut off after each byte in turn, then restarted", _cuts, _WITHIN),
    Drill(
        "baud rate too low",
        "bits at 2,000,000 baud read at 921,600",
        partial(_spoilt, lambda _: OtherBaudRate(BAUD_RATES[0], 921_600)),
        _WITHIN,
    ),
    Drill(
        "baud rate too high",
        "bits at 2,000,000 baud read at 5,000,000",
        partial(_spoilt, lambda _: OtherBaudRate(BAUD_RATES[0], 5e6)),
        _WITHIN,
    ),
    Drill(
        "baud rate", "a device that sends at 921,600 baud only", partial(_speed, 921_600), _SEARCH
    ),
]


# The device and its plug

_START = 20.0  # s until a device that has just begun answers
_FOLLOWED = 5.0  # s: two pings are answered, one is lost, and the next after it is 3 s later
_BACK = 2.0  # s after a port's return
_BLOCKED = 0.3  # s that a read may take on a busy machine
_GROWTH = 10 * 2**20  # bytes
_NUMBERED = 200  # messages after which a restart can be distinguished from a late one
_NOBODY = bytes(65536)


def _nothing_lost(stand: Stand) -> DrillOutcome:
    stand.drain()
    seen = stand.source.accounting()
    return stand.outcome(
        (seen.lost == 0, f"{seen.lost} messages lost"),
        (seen.bytes_discarded == 0, f"{seen.bytes_discarded} bytes discarded"),
    )


def _stall(stand: Stand) -> DrillOutcome:
    """Stop in the middle of a message, then send the rest of it."""
    with stand.fault(_WITHIN):
        stand.relay.held = True
        stand.until(lambda: not stand.relay.empty, _WITHIN)
        stand.relay.flush(most=100)
        stand.run(4.0 if stand.long else 1.0)
    return _nothing_lost(stand)


def _flood(stand: Stand) -> DrillOutcome:
    with stand.fault(_WITHIN):
        stand.relay.rewrite = lambda message: [message] * 10
        stand.run(20.0 if stand.long else 1.5)
        stand.heal()
        # It is over once it has passed the line, for which a busy machine takes its time.
        stand.until(lambda: stand.relay.empty, _START)
    return stand.outcome()


def _not_read(stand: Stand) -> DrillOutcome:
    """Read no frames; the reader thread continues."""
    with stand.fault(_WITHIN):
        stand.until(lambda: False, 10.0 if stand.long else 1.5, stand.pump)
    return _nothing_lost(stand)


def _deaf(stand: Stand) -> DrillOutcome:
    """Do not read what the program writes, until the line's buffer is full."""
    stand.settle()
    stand.relay.deaf = True
    line = os.open(stand.relay.port, os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        while os.write(line, _NOBODY):
            pass
    except BlockingIOError:
        pass
    finally:
        os.close(line)
    slowest = stand.longest_read(10.0 if stand.long else 1.5)
    stand.relay.ignore()
    stand.heal()
    stand.recover(_WITHIN)
    return stand.outcome((slowest < _BLOCKED, f"a read took {slowest:.2f} s"))


def _twice(stand: Stand) -> DrillOutcome:
    with stand.fault(_WITHIN):
        stand.relay.spoil = lambda data: data * 2
        stand.run(10.0 if stand.long else 0.5)
    twice = stand.source.accounting().duplicate
    return stand.outcome((twice > 0, "no message was reported as a duplicate"))


def _without_information(stand: Stand) -> DrillOutcome:
    """Hold back the device's description for a while after the program has begun to listen."""
    stand.relay.rewrite = without_information
    stand.run(1.0)
    stand.heal()
    stand.recover(_BACK)
    return _nothing_lost(stand)


def _restart(stand: Stand) -> DrillOutcome:
    """Restart with the first number, at device time 0."""
    stand.settle()
    stand.until(lambda: stand.relay.sequence > _NUMBERED, 5.0)
    began = stand.last.device_time if stand.last else 0.0
    stand.relay.sequence, stand.relay.rewrite = 0, ClockShift(-began)
    stand.recover(_WITHIN)
    stand.run(0.5)
    return stand.outcome(
        (stand.reported("restarted"), "the restart of the device is not reported"), restarted=True
    )


def _other(key: str, event: str, stand: Stand) -> DrillOutcome:
    """Change the device's description while it is plugged in."""
    stand.settle()
    stand.relay.rewrite = InformationChange(key, "drill")
    reported = stand.until(lambda: stand.reported(event), _BACK)
    stand.recover(_WITHIN)
    stand.heal()
    return stand.outcome((reported, f"another {key.replace('_', ' ')} is not reported"))


def _other_plugged_in(stand: Stand) -> DrillOutcome:
    """Unplug it, and plug in another."""
    stand.settle()
    stand.relay.unplug()
    stand.run(0.3)
    stand.relay.rewrite, stand.relay.sequence = InformationChange("serial_number", "drill"), 0
    stand.relay.plug()
    stand.recover(_BACK)
    other = (stand.reported("other"), "the other device is not reported")
    return stand.outcome(other, cut_off=True, restarted=True)


def _unplug(stand: Stand) -> DrillOutcome:
    """Unplug it again and again, each time in the middle of a message."""
    stand.settle()
    cycles, worst, before = 100 if stand.long else 6, 0.0, ProcessResources.now()
    for _ in range(cycles):
        stand.relay.held = True
        stand.until(lambda: not stand.relay.empty, _WITHIN)
        stand.relay.flush(most=int(stand.rng.integers(600)))
        stand.run(0.02)
        stand.relay.unplug()
        stand.heal()
        stand.run(float(stand.rng.uniform(0.05, 0.3)))
        stand.relay.plug()
        stand.recover(_BACK)
        worst = max(worst, stand.recovered)
    stand.recovered = worst
    stand.run(0.2)
    counts = [sum(event.kind == kind for event in stand.events) for kind in ("gone", "back")]
    return stand.outcome(
        (
            counts == [cycles, cycles],
            f"of {cycles} disconnections, {counts[0]} were reported, and {counts[1]} reconnections",
        ),
        *ProcessResources.now().leaked(before, _GROWTH),
        cut_off=True,
    )


def _suspend(stand: Stand) -> DrillOutcome:
    """Suspend the process of the simulated device for a while."""
    with stand.fault(_WITHIN):
        stand.device.signal(signal.SIGSTOP)
        try:
            stand.run(5.0 if stand.long else 1.0)
        finally:
            stand.device.signal(signal.SIGCONT)
    return stand.outcome()


def _in_step(stand: Stand) -> bool:
    """Whether the newest frame's time of measurement is just before its arrival."""
    frame = stand.last
    return frame is not None and abs(frame.host_time - frame.taken) < 0.2


def _device_clock(stand: Stand) -> DrillOutcome:
    """Set the device's clock, forth and back."""
    stand.settle()
    followed: list[bool] = []
    for shift in (100.0, 50.0):
        stand.relay.rewrite = ClockShift(shift)
        stand.recover(_WITHIN)
        followed.append(stand.until(lambda: _in_step(stand), _BACK))
    return stand.outcome((all(followed), "times do not follow the device's clock"))


def _host_clock(stand: Stand) -> DrillOutcome:
    """Set this machine's clock, forth and back."""
    stand.settle()
    # A ping unanswered at first is sent again after seconds; before an answer no clock is known.
    stand.until(lambda: stand.last and stand.last.taken_sd < math.inf, _START)
    followed: list[bool] = []
    for shift in (30.0, 10.0):
        stand.clock = lambda shift=shift: time.monotonic() + shift
        stand.recover(_WITHIN)
        followed.append(stand.until(lambda: _in_step(stand), _FOLLOWED))
    trouble = stand.source.trouble
    return stand.outcome(
        (all(followed), "times do not follow this machine's clock"),
        (not trouble, f"it still reports an error: {trouble}"),
    )


DEVICE_DRILLS = [
    Drill("stall", "a device that stops in the middle of a frame, and resumes", _stall, _WITHIN),
    Drill("flood", "frames at 10 times the rate", _flood, _WITHIN),
    Drill("not read", "the program reads no frames for a while", _not_read, _WITHIN),
    Drill("deaf", "a device that does not read what it is sent", _deaf, _WITHIN),
    Drill("twice", "every message arrives twice", _twice, _WITHIN),
    Drill("untold", "a device that sends its description late", _without_information, _BACK),
    Drill("restart", "a device that restarts while it is connected", _restart, _WITHIN),
    Drill(
        "other device",
        "another device on the same line",
        partial(_other, "serial_number", "other"),
        _WITHIN,
    ),
    Drill(
        "other firmware",
        "the device returns with other firmware",
        partial(_other, "firmware", "firmware"),
        _WITHIN,
    ),
    Drill("other plugged in", "another device on the same port", _other_plugged_in, _BACK),
    Drill("unplug", "unplugged and plugged in again and again", _unplug, _BACK),
    Drill("suspend", "the device is suspended and resumes", _suspend, _WITHIN),
    Drill("device clock", "the device's clock is set", _device_clock, _WITHIN),
    Drill("host clock", "this machine's clock is set", _host_clock, _WITHIN),
]
