"""Drills on the line and the device: noise, wrong baud rates, stalls, restarts, unplugging."""

import math
import os
import signal
import time
from collections.abc import Callable
from functools import partial

from kappaskin.sources import BAUD_RATES, wire
from kappaskin.studies.drills.relay import (
    ClockShift,
    CutScans,
    FlippedBits,
    Garbage,
    InformationChange,
    OtherBaudRate,
    Spoil,
    clean,
    speed_code,
    without_information,
)
from kappaskin.studies.drills.stand import Drill, DrillOutcome, ProcessResources, Stand

# The bytes under way

_WITHIN = 1.0  # s
_SEARCH = 12.0  # s to find one of seven baud rates


def _spoilt(make: Callable[[Stand], Spoil], stand: Stand) -> DrillOutcome:
    """Spoil what passes for some time."""
    stand.settle()
    stand.relay.spoil = make(stand)
    stand.run(10.0 if stand.long else 0.8)
    stand.heal()
    stand.recover(_WITHIN)
    spoilt = stand.source.accounting().bytes_discarded
    return stand.outcome((spoilt > 0, "nothing was spoilt"))


def _garbage(share: float, stand: Stand) -> DrillOutcome:
    return _spoilt(lambda stand: Garbage(share, stand.rng), stand)


def _flips(stand: Stand) -> DrillOutcome:
    return _spoilt(lambda stand: FlippedBits(20_000, stand.rng), stand)


def _misread(rate: float, stand: Stand) -> DrillOutcome:
    return _spoilt(lambda _: OtherBaudRate(BAUD_RATES[0], rate), stand)


def _cuts(stand: Stand) -> DrillOutcome:
    """Break messages off at every byte of the longest, and let a whole one follow each."""
    stand.settle()
    cut = CutScans()

    def many(message: wire.FromDevice) -> list[wire.FromDevice]:
        return [message] * 4

    stand.relay.rewrite, stand.relay.spoil = many, cut
    done = stand.until(lambda: cut.cuts >= cut.length, 60.0)
    stand.heal()
    stand.recover(_WITHIN)
    lost = stand.source.accounting().lost
    return stand.outcome(
        (done, f"only {cut.cuts} of {cut.length} cuts were made within 60 s"),
        (lost == cut.cuts, f"{cut.cuts} messages were cut, {lost} lost"),
    )


def _speed(baud_rate: int, stand: Stand) -> DrillOutcome:
    """A device that means something at one baud rate only."""
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
        (stand.reported("rate"), "the rate that was found is not reported"),
        (lost == 0, f"{lost} messages lost after the rate was found"),
        restarted=True,  # what was sent before is nowhere counted
    )


GARBAGE = [
    Drill(
        f"garbage {100 * share:.0f} %",
        f"bursts of noise over and between {100 * share:.0f} % of the bytes",
        partial(_garbage, share),
        _WITHIN,
    )
    for share in (0.01, 0.05, 0.2)
]

BYTE_DRILLS = [
    *GARBAGE,
    Drill("bits", "one bit in 20,000 turned over", _flips, _WITHIN),
    Drill("cuts", "messages broken off after every byte, and begun again", _cuts, _WITHIN),
    Drill(
        "baud rate too low",
        "bits at 2,000,000 baud read at 921,600",
        partial(_misread, 921_600),
        _WITHIN,
    ),
    Drill(
        "baud rate too high",
        "bits at 2,000,000 baud read at 5,000,000",
        partial(_misread, 5e6),
        _WITHIN,
    ),
    Drill(
        "baud rate", "a device that speaks at 921,600 baud only", partial(_speed, 921_600), _SEARCH
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
    """Stop in the middle of a message, and go on with the rest of it."""
    stand.settle()
    stand.relay.held = True
    stand.until(lambda: not stand.relay.empty, _WITHIN)
    stand.relay.flush(most=100)
    stand.run(4.0 if stand.long else 1.0)
    stand.heal()
    stand.recover(_WITHIN)
    return _nothing_lost(stand)


def _flood(stand: Stand) -> DrillOutcome:
    stand.settle()
    stand.relay.rewrite = lambda message: [message] * 10
    stand.run(20.0 if stand.long else 1.5)
    stand.heal()
    # It is over once it has passed the line, for which a busy machine takes its time.
    stand.until(lambda: stand.relay.empty, _START)
    stand.recover(_WITHIN)
    return stand.outcome()


def _not_read(stand: Stand) -> DrillOutcome:
    """Let nobody ask for frames; the thread that reads goes on."""
    stand.settle()
    end = time.monotonic() + (10.0 if stand.long else 1.5)
    while time.monotonic() < end:
        stand.relay.pump()
        time.sleep(0.002)
    stand.recover(_WITHIN)
    return _nothing_lost(stand)


def _deaf(stand: Stand) -> DrillOutcome:
    """Let nobody read what the program writes, until there is no more room for it."""
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
    stand.settle()
    stand.relay.spoil = lambda data: data * 2
    stand.run(10.0 if stand.long else 0.5)
    stand.heal()
    stand.recover(_WITHIN)
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
    """Begin again with the first number, at the device's time 0."""
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
    """Change what it reports of itself while it is plugged in."""
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
    other = (stand.reported("other"), "that it is another device is not reported")
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
            f"of {cycles} times, gone was reported {counts[0]}, back {counts[1]}",
        ),
        *ProcessResources.now().leaked(before, _GROWTH),
        cut_off=True,
    )


def _suspend(stand: Stand) -> DrillOutcome:
    """Stop the process that plays the device for a while."""
    stand.settle()
    stand.device.signal(signal.SIGSTOP)
    try:
        stand.run(5.0 if stand.long else 1.0)
    finally:
        stand.device.signal(signal.SIGCONT)
    stand.recover(_WITHIN)
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
        (not trouble, f"it is still in trouble: {trouble}"),
    )


DEVICE_DRILLS = [
    Drill("stall", "a device that stops in the middle of a frame, and goes on", _stall, _WITHIN),
    Drill("flood", "frames at 10 times the rate", _flood, _WITHIN),
    Drill("not read", "nobody asks for frames for a while", _not_read, _WITHIN),
    Drill("deaf", "a device that does not read what it is sent", _deaf, _WITHIN),
    Drill("twice", "every message comes twice", _twice, _WITHIN),
    Drill("untold", "a device that says late what it is", _without_information, _BACK),
    Drill("restart", "a device that begins anew while it is connected", _restart, _WITHIN),
    Drill(
        "other device",
        "another one on the same line",
        partial(_other, "serial_number", "other"),
        _WITHIN,
    ),
    Drill(
        "other firmware",
        "its firmware is changed",
        partial(_other, "firmware", "firmware"),
        _WITHIN,
    ),
    Drill("other plugged in", "another one on the port", _other_plugged_in, _BACK),
    Drill("unplug", "unplugged and plugged in again and again", _unplug, _BACK),
    Drill("suspend", "the device stands still and goes on", _suspend, _WITHIN),
    Drill("device clock", "the device's clock is set", _device_clock, _WITHIN),
    Drill("host clock", "this machine's clock is set", _host_clock, _WITHIN),
]
