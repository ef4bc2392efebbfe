"""Test stand of a drill: a device, a relay that corrupts its traffic, and the source."""

import json
import math
import os
import subprocess
import sys
import threading
import time
import tty
from collections import deque
from collections.abc import Callable, Generator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kappaskin._files import TemporaryFolder
from kappaskin.errors import SourceError
from kappaskin.frames import Counts, Event, Frame
from kappaskin.sources import Decoder, SerialConnection, SerialSource, wire

_OUTBOX = 2**21  # bytes that wait; beyond it a message goes unsent, as from a device
_BLOCK = 4096
_KEPT = 16384  # scans that are remembered: more than wait anywhere

Rewrite = Callable[[wire.FromDevice], list[wire.FromDevice]]
Spoil = Callable[[bytes], bytes]


def unchanged(message: wire.FromDevice) -> list[wire.FromDevice]:
    return [message]


def clean(data: bytes) -> bytes:
    return data


class Relay:
    """Relay between `device` and the program that opens `port`, in both directions.

    It numbers the messages anew: `sent` keeps the counts of every scan under its number until they
    are asked for, `spent` counts numbers. `rewrite` makes other messages of each, `spoil` other
    bytes of those; `held` keeps bytes back, `deaf` leaves commands unread. Works when `pump` is
    called, and only then.
    """

    def __init__(self, device: SerialConnection, folder: Path) -> None:
        self._device, self._decoder = device, Decoder()
        self._link = folder / "port"
        self.port = str(self._link)
        self.rewrite: Rewrite = unchanged
        self.spoil: Spoil = clean
        self.held = self.deaf = False
        self.sequence = self.spent = self.written = 0
        self.sent: dict[int, Counts] = {}
        self._outbox: deque[bytes] = deque()
        self._waiting = 0
        self._master = -1
        self.plug()

    def plug(self) -> None:
        """Create the port."""
        self._master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        self._link.symlink_to(os.ttyname(slave))
        os.close(slave)

    def unplug(self) -> None:
        """Remove the port; bytes under way are lost."""
        if self._master >= 0:
            os.close(self._master)
            self._link.unlink()
        self._master = -1
        self._outbox.clear()
        self._waiting = 0

    @property
    def speed(self) -> int:
        """The system's constant of the baud rate that the program has set."""
        import termios

        return termios.tcgetattr(self._master)[5]

    @property
    def empty(self) -> bool:
        return not self._outbox

    def pump(self) -> None:
        """Pass on the received bytes."""
        for _, data in self._device.take(0.0):
            for message in self._decoder.feed(data):
                if not isinstance(message, wire.Command):
                    for made in self.rewrite(message):
                        self.send(made)
        if not self.held:
            self.flush()
        if not self.deaf and self._master >= 0:
            with suppress(OSError):  # nothing came, or nobody is there
                self._device.write(os.read(self._master, _BLOCK))

    def forget(self) -> None:
        """Discard what the device has sent."""
        for _, data in self._device.take(0.0):
            self._decoder.feed(data)

    def ignore(self) -> None:
        """Discard the program's commands."""
        with suppress(OSError):  # nothing more
            while os.read(self._master, _BLOCK):
                pass

    def send(self, message: wire.FromDevice) -> bytes:
        """Send a message under the next number; its bytes before they are spoilt."""
        number, self.sequence = self.sequence, (self.sequence + 1) % 2**32
        self.spent += 1
        if isinstance(message, wire.Samples):
            self.sent[number] = message.counts
            if len(self.sent) > _KEPT:
                del self.sent[next(iter(self.sent))]
        whole = _bytes_of(message, number)
        self.write(self.spoil(whole))
        return whole

    def write(self, data: bytes) -> None:
        """Send these bytes, if there is a port and room."""
        if data and self._master >= 0 and self._waiting + len(data) <= _OUTBOX:
            self._outbox.append(data)
            self._waiting += len(data)

    def flush(self, most: int = _OUTBOX) -> None:
        """Write what waits, `most` bytes of it, or as many as there is room for."""
        with suppress(OSError):  # full, or nobody listens
            while self._outbox and most > 0 and self._master >= 0:
                data = self._outbox[0]
                done = os.write(self._master, data[: min(most, _BLOCK)])
                self.written += done
                self._waiting -= done
                most -= done
                if done == len(data):
                    self._outbox.popleft()
                else:
                    self._outbox[0] = data[done:]


def _bytes_of(message: wire.FromDevice, number: int) -> bytes:
    if isinstance(message, wire.Information):
        return wire.encode_information(number, message.time, message.text)
    if isinstance(message, wire.Reply):
        command = wire.Command(message.command, message.operation, b"")
        return wire.encode_reply(number, message.time, command, message.fault, message.data)
    narrow = abs(message.counts).max(initial=0) < 2**15
    return wire.encode_samples(
        number, message.time, message.channels, message.counts, 2 if narrow else 4
    )


# The test stand of a drill: a device, the relay before it and the source that reads through it

_PAGE = 4096


@dataclass(frozen=True)
class ProcessResources:
    """Threads, open descriptors, child processes and resident bytes; 0 where unknown."""

    threads: int
    descriptors: int
    processes: int
    memory: int

    @classmethod
    def now(cls) -> "ProcessResources":
        """Of this process."""
        own = Path("/proc/self")
        if not (own / "fd").exists():
            return cls(threading.active_count(), 0, 0, 0)
        children = (own / "task" / str(os.getpid()) / "children").read_text().split()
        resident = int((own / "statm").read_text().split()[1])
        return cls(
            threading.active_count(), len(os.listdir(own / "fd")), len(children), resident * _PAGE
        )

    def leaked(self, since: "ProcessResources", memory: int) -> list[tuple[bool, str]]:
        """Claims that nothing was added, but for so many bytes of `memory`."""
        grown = self.memory - since.memory
        return [
            (self.threads <= since.threads, f"{self.threads - since.threads} threads leaked"),
            (
                self.descriptors <= since.descriptors,
                f"{self.descriptors - since.descriptors} descriptors leaked",
            ),
            (self.processes <= since.processes, "a process leaked"),
            (grown <= memory, f"memory grew by {grown / 2**20:.1f} MiB"),
        ]


class NeedsSimulatedDevice(Exception):
    """The fault needs the process that plays a device."""


@dataclass(frozen=True)
class DrillOutcome:
    """Figures of a drill: messages `sent`, `accepted` and `lost`, and bytes `discarded`.

    `wrong` counts frames that were accepted but never sent so. `recovered` is the time from the end
    of the fault to the first good frame sent after it in s, NaN where nothing had to recover.
    `failures` are the claims that did not hold.
    """

    sent: int = 0
    accepted: int = 0
    lost: int = 0
    discarded: int = 0
    wrong: int = 0
    recovered: float = math.nan
    failures: tuple[str, ...] = ()


def judged(outcome: DrillOutcome, within: float) -> list[str]:
    """Why a drill failed: its own claims, a wrong frame, or no recovery `within` so many s."""
    reasons = list(outcome.failures)
    if outcome.wrong:
        reasons.append(f"{outcome.wrong} wrong frames were accepted")
    if within < math.inf and not outcome.recovered <= within:
        after = "at all" if math.isnan(outcome.recovered) else f"for {outcome.recovered:.2f} s"
        reasons.append(f"did not recover within {within:g} s; not {after}")
    return reasons


RATE = 200  # frames/s of the simulated device
_TICK = 0.002  # s that a read waits
_SETTLED = 5  # frames in a row, after which a drill begins
_START = 20.0  # s that a device may take until its first frame
_PARTS = 3  # of a time, in each of which what blocks a read does so
_IDLE = 1000  # reads that bring nothing, after which nothing is under way


@dataclass
class Device:
    """The device's line; `process` plays it, None for the user's own. `rng` spoils."""

    line: SerialConnection
    process: "subprocess.Popen[str] | None"
    rng: np.random.Generator

    def signal(self, number: int) -> None:
        """Send a signal to the process that plays the device."""
        if self.process is None:
            raise NeedsSimulatedDevice
        self.process.send_signal(number)


@contextmanager
def opened(source: str | None, seed: int) -> Generator[Device]:
    """The device on a port; the simulated one where `source` is None."""
    rng = np.random.default_rng(seed)
    if source is not None:
        with closing(SerialConnection(source)) as line:
            yield Device(line, None, rng)
        return
    command = [sys.executable, "-m", "kappaskin", "device", "centre", "--rate", str(RATE)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as process:
        try:
            with closing(SerialConnection(_port_of(process))) as line:
                yield Device(line, process, rng)
        finally:
            process.kill()


def _port_of(process: "subprocess.Popen[str]") -> str:
    line = process.stdout.readline() if process.stdout else ""
    if not line:
        raise SourceError("the simulated device did not start; try `kappaskin device`")
    return str(json.loads(line)["port"])


class Stand:
    """One drill's relay, on its own pseudo-terminal, and the source that reads through it.

    `clock` is what the source goes by. What it accepts is compared with what was sent.
    """

    def __init__(self, device: Device, long: bool) -> None:
        self.device, self.long, self.rng = device, long, device.rng
        self._folder = TemporaryFolder()
        device.line.take(0.0)  # from before this drill
        self.relay = Relay(device.line, Path(self._folder.name))
        self.clock = time.monotonic
        self._source: SerialSource | None = None
        self.frames = self.wrong = 0
        self.slowest = 0.0
        self.last: Frame | None = None
        self.events: list[Event] = []
        self.recovered = math.nan

    @property
    def source(self) -> SerialSource:
        if self._source is None:
            self._source = SerialSource(self.relay.port, lambda: self.clock())
        return self._source

    def step(self) -> list[Frame]:
        """Run relay and source once; the frames received."""
        source = self.source  # opened first: nothing may be sent before
        self.relay.pump()
        began = time.monotonic()
        frames = source.read(_TICK)
        self.slowest = max(self.slowest, time.monotonic() - began)
        for frame in frames:
            self._compare(frame)
        self.events += source.events()
        return frames

    def _compare(self, frame: Frame) -> None:
        self.frames, self.last = self.frames + 1, frame
        counts = self.relay.sent.pop(frame.sequence, None)
        self.wrong += counts is None or not np.array_equal(counts, frame.counts)

    def run(self, seconds: float) -> None:
        self.until(lambda: False, seconds)

    def longest_read(self, seconds: float) -> float:
        """Go on for so long: how long a read takes at the longest, again and again, in s.

        A machine that stands still for once holds up none of ours.
        """
        parts: list[float] = []
        for _ in range(_PARTS):
            self.slowest = 0.0
            self.run(seconds / _PARTS)
            parts.append(self.slowest)
        return min(parts)

    def until(
        self, done: Callable[[], object], within: float, step: Callable[[], object] | None = None
    ) -> bool:
        """Continue, by `step` or as usual, until `done`; whether within the time limit in s."""
        end = time.monotonic() + within
        while not done() and time.monotonic() < end:
            (step or self.step)()
        return bool(done())

    def pump(self) -> None:
        """Run the relay while the source reads nothing."""
        self.relay.pump()
        time.sleep(0.002)

    def settle(self) -> None:
        """Continue until frames arrive."""
        if not self.until(lambda: self.frames >= _SETTLED, _START):
            raise SourceError(f"no frames come: {self.source.trouble or 'the device is silent'}")

    def heal(self) -> None:
        """End the fault: from now on all messages are good."""
        self.relay.rewrite, self.relay.spoil = unchanged, clean
        self.relay.held = self.relay.deaf = False

    @contextmanager
    def fault(self, within: float) -> Generator[None]:
        """Once frames come, the fault inside; then its end, and recovery within so many s."""
        self.settle()
        yield
        self.heal()
        self.recover(within)

    def recover(self, within: float) -> None:
        """Go on until the first frame that was sent from now on; how long that takes is noted."""
        first, began, relay = self.relay.sequence, time.monotonic(), self.relay
        self.last = None
        if self.until(lambda: self.last and first <= self.last.sequence < relay.sequence, within):
            self.recovered = time.monotonic() - began

    def drain(self) -> None:
        """Send no more, and read all that was sent."""
        idle, came = 0, -1
        while idle < _IDLE:
            self.relay.forget()
            self.relay.flush()
            for frame in self.source.read(_TICK):
                self._compare(frame)
            if self.relay.empty and self.source.accounting().bytes_in == self.relay.written:
                break
            idle = idle + 1 if self.source.accounting().bytes_in == came else 0
            came = self.source.accounting().bytes_in
        while frames := self.source.read(_TICK):
            for frame in frames:
                self._compare(frame)

    def reported(self, kind: str) -> bool:
        """Whether the source has reported an event of this kind."""
        return any(event.kind == kind for event in self.events)

    def outcome(
        self, *claims: tuple[bool, str], cut_off: bool = False, restarted: bool = False
    ) -> DrillOutcome:
        """What became of it all, once the line is drained; `claims` that are false are failures.

        Every byte and every number sent must be accounted for, but for bytes on a line that was
        `cut_off`, and numbers of a device that `restarted`.
        """
        self.drain()
        seen = self.source.accounting()
        laws: list[tuple[bool, str]] = [(seen.balanced, "the accounting does not balance")]
        if not cut_off:
            written = self.relay.written
            text = f"{written} bytes were sent, {seen.bytes_in} accounted for"
            laws.append((seen.bytes_in == written, text))
        if not restarted:
            text = f"{self.relay.sequence} messages were sent, {seen.span} accounted for"
            laws.append((seen.span == self.relay.sequence, text))
        return DrillOutcome(
            self.relay.spent,
            seen.accepted,
            seen.lost,
            seen.bytes_discarded,
            self.wrong,
            self.recovered,
            tuple(text for holds, text in (*laws, *claims) if not holds),
        )

    def close(self) -> None:
        if self._source is not None:
            self._source.close()
        self.relay.unplug()
        self._folder.cleanup()


@dataclass(frozen=True)
class Drill:
    """A fault: `does` describes it, `run` inflicts it, `within` is the longest recovery in s."""

    name: str
    does: str
    run: Callable[[Stand], DrillOutcome]
    within: float = math.inf
