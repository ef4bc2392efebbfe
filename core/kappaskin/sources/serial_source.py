"""Serial source: frames from a port, or any URL that pyserial opens; reconnects by itself."""

import math
import time
from collections import deque
from collections.abc import Callable, Iterable

from kappaskin.errors import SourceError
from kappaskin.estimation import Scanner
from kappaskin.frames import Event, Frame
from kappaskin.sensing import Sensor
from kappaskin.sources.clock import ClockMap, ClockState
from kappaskin.sources.commands import DeviceCommands, ScanControl
from kappaskin.sources.decoder import Accounting, Decoder, SequenceCounter
from kappaskin.sources.interpreter import Interpreter
from kappaskin.sources.ports import (
    BaudRateSearch,
    SerialConnection,
    holders,
    port_called,
    serial_ports,
)
from kappaskin.sources.source import InputRecorder, register_scheme
from kappaskin.sources.wire import (
    VERSION,
    Command,
    FromDevice,
    Information,
    Reply,
    Samples,
    encode_samples,
)

_LONGEST = 500  # characters: a device may say anything of itself, and each status has 64 events
_SUMMED = 1.0  # s of which lost messages are told together


class _EventLog:
    """Gathers events until they are taken; what was lost is told of the numbers in `sequence`."""

    def __init__(self, sequence: SequenceCounter, clock: Callable[[], float]) -> None:
        self._sequence, self._clock = sequence, clock
        self._events: list[Event] = []
        self._lost = self._restarts = 0  # that were told
        self._summed_at = 0.0

    def __call__(self, kind: str, text: str) -> None:
        """Tell this too."""
        self._events.append(Event(self._clock(), kind, text[:_LONGEST]))

    def taken(self) -> list[Event]:
        """What happened since the last time that this was asked."""
        told, self._events = self._events, []
        return told

    def met(self, was: Sensor | None, now: Sensor) -> None:
        """Tell what is new of the device that is there `now`."""
        name = _device_name(now)
        if was is None:
            self("met", f"{name}, firmware {now.firmware}")
        elif was.serial_number != now.serial_number:
            self("other", f"another device: {name} instead of {was.serial_number}")
        elif now.firmware != was.firmware:
            self("firmware", f"firmware {now.firmware} instead of {was.firmware}")
        elif now is not was:
            self("changed", f"{name} says something else of itself than before")

    def resumed(self, sensor: Sensor, away: float, same: bool, lost: int) -> None:
        """Tell that the `same` device is back after `away` s, in which so many were `lost`."""
        again = "" if self._sequence.restarts == self._restarts else ", from its beginning"
        self._lost, self._restarts = self._lost + lost, self._sequence.restarts
        if same:
            text = f"{_device_name(sensor)} is back after {away:.1f} s{again}: {lost} messages lost"
            self("back", text)

    def restarted(self) -> bool:
        """Whether the device started anew since the last look, which is told."""
        restarted = self._sequence.restarts > self._restarts
        if restarted:
            self._restarts = self._sequence.restarts
            self("restarted", "the device started anew while it was connected")
        return restarted

    def losses(self) -> None:
        """Tell of what was lost, now and then."""
        lost, now = self._sequence.lost - self._lost, self._clock()
        if lost and now - self._summed_at >= _SUMMED:
            if lost > 0:
                self("gap", f"{lost} messages lost")
            self._lost, self._summed_at = self._sequence.lost, now


def _device_name(sensor: Sensor) -> str:
    return f"{sensor.name} {sensor.serial_number}"


class _RecordingTap:
    """Tells a tape all that frames come from, as the interpreter `means` it; nobody without one."""

    def __init__(self, means: Interpreter) -> None:
        self._means = means
        self._tape: InputRecorder | None = None
        self._told: ClockState | None = None  # of the clock
        self._mapped: list[tuple[float, ClockState]] = []
        self._met = ""  # what was told of the device

    def to(self, tape: InputRecorder | None) -> None:
        """Tell this one from now on."""
        self._tape, self._told, self._mapped = tape, None, []

    def begin(self, now: float, waiting: Iterable[tuple[float, FromDevice]], held: bytes) -> None:
        """Tell of the device, of messages `waiting` to be read, and of bytes `held` of the next."""
        if self._tape is None:
            return
        self._met = ""
        if self._means.sensor is not None:  # frames go through what was made of one that is gone
            self._meet(self._tape)
            if not self._means.known:
                self._tape.ended(now)
        for came, message in waiting:
            if isinstance(message, Samples):
                sequence, began, channels, counts = message
                self._tape.came(came, encode_samples(sequence, began, channels, counts, 4))
        self._told = self._means.times.known
        self._tape.mapped(math.nan, self._told)
        if held:
            self._tape.came(now, held)

    def sent(self, now: float, data: bytes) -> None:
        if self._tape is not None:
            self._tape.sent(now, data)

    def ended(self, now: float) -> None:
        if self._tape is not None:
            self._tape.ended(now)

    def map(self, since: float) -> None:
        """Take note of what is known of the clock from the scan at device time `since` on."""
        if self._tape is None:
            return
        known = self._means.times.known
        if self._told is None or known.map != self._told.map:
            self._mapped.append((since, known))
            self._told = known

    def came(self, came: list[tuple[float, bytes]]) -> None:
        """Tell of the bytes that were read, and before them of how their times are mapped."""
        if self._tape is None:
            return
        for since, known in self._mapped:
            self._tape.mapped(since, known)
        self._mapped = []
        for now, data in came:
            self._tape.came(now, data)
        if self._means.known:
            self._meet(self._tape)  # told in those bytes: here for whoever begins after them

    def _meet(self, tape: InputRecorder) -> None:
        if self._means.text != self._met:
            self._met = self._means.text
            tape.met(self._met)


_PATIENCE = 3.0  # s that a device may say nothing, or not what it is
_DWELL = 0.8  # s of bytes that mean nothing, after which another baud rate is tried
_RETRY = 0.25  # s between two tries to open a port that is gone
_UNREAD = 2**22  # counts kept until the device says what they are of
_MESSAGE_OVERHEAD = 64  # counts that take as much memory as a message beside its own
_APART, _DRIFT = 0.5, 0.01  # s, and share, by which two clocks that both went on may differ


class SerialSource:
    """Frames from the device on a port, which is found again when it was unplugged.

    Opening raises a `SourceError` where it cannot be; thereafter `trouble` says why no frames come.
    A thread of its own reads, so that no byte waits for arithmetic.
    """

    def __init__(self, url: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.url, self._clock = url, clock
        self._plug = port_called(url)
        self._decoder = Decoder()
        self._means = Interpreter(url)
        self._absent = ""
        self._pending: deque[tuple[float, FromDevice]] = deque()
        self._tell = _EventLog(self._decoder.sequence, clock)
        self._overrun, self._next_try = 0, 0.0
        self._gone_at: float | None = None  # when the line was lost, until the device is back
        self._last: tuple[float, float] | None = None  # device and host time of the last message
        self._scanning = ScanControl()
        self._taping = _RecordingTap(self._means)
        self._line: SerialConnection | None = None
        self._begin(SerialConnection(url, clock))

    @property
    def sensor(self) -> Sensor | None:
        return self._means.sensor

    @property
    def temperature(self) -> float:
        """The device's, in degrees Celsius; NaN where it does not tell."""
        return self._asking.temperature

    # The line: there, gone, back.

    def _begin(self, line: SerialConnection) -> None:
        """Listen on `line`, and ask who is there."""
        now = self._clock()
        self._line = line
        self._opened = self._heard = self._good_at = self._tuned = now
        self._bytes_before = self._decoder.accounting().bytes_in
        self._holders: list[str] = []
        self._tuning = BaudRateSearch(line.baud_rate)
        times = ClockMap()
        self._means.begin(times)
        self._asking = DeviceCommands(self._send, times)
        self._asking.greet(now)
        self._scanning.begin()

    def _send(self, data: bytes) -> None:
        if self._line is not None and self._line.write(data):
            self._taping.sent(self._clock(), data)

    def record(self, tape: InputRecorder | None) -> None:
        """Tell `tape` from now on all that frames come from; nobody without one."""
        now = self._clock()
        self._taping.to(tape)
        self._taping.begin(now, self._pending, self._decoder.held)
        if self._line is None:
            self._taping.ended(now)

    def scan(self, scanner: Scanner | None) -> None:
        """Let the device scan what `scanner` chooses, a few times a second; all without one."""
        self._scanning.scan(scanner)

    @property
    def scan_refusal(self) -> str:
        """Why the device scans something else than was asked for; empty when it does not."""
        return self._scanning.refusal

    def reset(self) -> None:
        """Let the board start anew, if DTR or RTS does that."""
        if self._line is not None:
            self._line.reset()

    def _end(self, line: SerialConnection) -> None:
        """Give the line up; the device may come back."""
        self._overrun += line.overrun
        line.close()
        self._line = None
        self._decoder.line_ended()
        self._decoder.sequence.interrupt()
        self._pending.clear()
        self._gone_at = self._clock()
        self._taping.ended(self._gone_at)
        self._absent = (
            f"{self.url}: the line is gone: unplugged, or the device stopped; plug it in, and it "
            "goes on"
        )
        self._tell("gone", self._absent)

    def _come_back(self, timeout: float) -> None:
        """Look for the port, or by the serial number of its plug for the one it is now."""
        now = self._clock()
        if now < self._next_try:
            time.sleep(min(timeout, self._next_try - now))
            return
        self._next_try = now + _RETRY
        try:
            self._begin(SerialConnection(self._where(), self._clock))
        except SourceError as error:
            self._absent = f"{error}; it is tried again until it opens"

    def _where(self) -> str:
        known = self._plug.serial_number
        here = (port.port for port in serial_ports() if port.same_plug(self._plug)) if known else ()
        return next(iter(here), self.url)

    # What comes.

    def read(self, timeout: float) -> list[Frame]:
        """The frames that came, after at most `timeout` s."""
        line = self._line
        if line is None:
            self._come_back(timeout)
            return []
        gone = line.gone  # looked at first: what came before it was is still to be taken
        came = line.take(0.0 if gone or self._usable() else timeout)
        for now, data in came:
            messages = self._decoder.feed(data)
            self._heard = now
            self._pending += [(now, got) for got in messages if not isinstance(got, Command)]
            if messages:
                self._good_at = now
                if self._tuning.good(line.baud_rate):
                    self._tell("rate", f"the device speaks at {line.baud_rate} baud")
        if not self._means.known:
            self._look_for_information()
        frames = self._frames()
        self._taping.came(came)
        self._tell_losses()
        if gone and not self._usable():
            self._end(line)
        else:
            self._attend(line)
        return frames

    def _usable(self) -> bool:
        """Whether messages wait that can be used without another look at the line."""
        return self._means.known and bool(self._pending)

    def _look_for_information(self) -> None:
        """Learn who is there; what came before that is kept until then."""
        for place, (_, message) in enumerate(self._pending):
            if isinstance(message, Information):
                self._meet(message.text)
                if not self._means.known:
                    self._drop(place + 1)
                return
        self._drop_beyond(_UNREAD)

    def _drop_beyond(self, most: int) -> None:
        """Keep the newest messages, of `most` counts together."""
        counts = 0
        for kept, (_, message) in enumerate(reversed(self._pending)):
            counts += _MESSAGE_OVERHEAD + (
                len(message.counts) if isinstance(message, Samples) else 0
            )
            if counts > most:
                self._drop(len(self._pending) - kept)
                return

    def _drop(self, count: int) -> None:
        for _ in range(count):
            self._pending.popleft()

    def _meet(self, text: str) -> None:
        """Take what the device says it is, and say what of it is new."""
        was, before = self._means.sensor, self._means.text
        if not self._means.learn(text):
            return
        if text != before:
            self._scanning.scan(None)  # what was chosen is on the skin that was
        if self._means.sensor is not None:
            self._compare(was, self._means.sensor)

    def _compare(self, was: Sensor | None, now: Sensor) -> None:
        if self._gone_at is not None:
            same = was is not None and was.serial_number == now.serial_number
            away, self._gone_at = self._clock() - self._gone_at, None
            sequence = self._decoder.sequence
            before = sequence.lost
            sequence.resume(same and self._went_on())
            self._tell.resumed(now, away, same, sequence.lost - before)
        self._tell.met(was, now)

    def _went_on(self) -> bool:
        """Whether the device's clock went on while nobody listened.

        One that shows more than had passed here as the line was opened went on too: this machine
        was asleep, or busy, then or since.
        """
        if self._last is None:
            return False
        device = self._pending[0][1].time - self._last[0]
        host = self._opened - self._last[1]
        return device > 0 and device - host > -_APART - _DRIFT * host

    def _frames(self) -> list[Frame]:
        """The frames before the next message that changes the sensor, or cannot be used."""
        frames: list[Frame] = []
        while self._usable() and not (frames and self._means.upsets(self._pending[0][1])):
            now, message = self._pending.popleft()
            self._last = message.time, now
            if isinstance(message, Reply):
                self._take(message, now)
            elif isinstance(message, Information):
                self._meet(message.text)
            elif frame := self._means.frame(message, now):
                frames.append(frame)
                self._taping.map(frame.device_time)
        return frames

    def _take(self, reply: Reply, now: float) -> None:
        before = self._asking.refusal
        self._asking.take(reply, now)
        self._scanning.take(reply)
        if self._asking.refusal != before:
            self._tell("refused", self._asking.refusal)

    # What is said, and what is in the way.

    def events(self) -> list[Event]:
        """What happened since the last time that this was asked."""
        return self._tell.taken()

    def _tell_losses(self) -> None:
        if self._means.known and self._tell.restarted():
            self._scanning.begin()
        self._tell.losses()

    def _attend(self, line: SerialConnection) -> None:
        """Ping, and say what to scan; try other baud rates on bytes that mean nothing."""
        now = self._clock()
        if self._means.known and self._means.sensor is not None:
            self._scanning.attend(now, self._means.sensor, self._asking.ask)
        if self._asking.attend(now) and not self._means.known:
            self._asking.greet(now)
        since = max(self._good_at, self._tuned)
        patience = _PATIENCE if self._means.known and self._tuned < self._good_at else _DWELL
        if self._heard > since and now - since > patience:
            line.speak_at(self._tuning.next(line.baud_rate))
            self._tuned, self._holders = now, holders(self.url)
            self._asking.greet(now)

    @property
    def trouble(self) -> str:
        """Why no frames come; empty when they do, or may be expected to."""
        if self._line is None:
            return self._absent
        now = self._clock()
        if self._means.unusable or now - self._opened < _PATIENCE:
            return self._means.unusable
        if self._means.known and now - self._good_at < _PATIENCE:
            return ""
        return self._why_unknown(now)

    def _why_unknown(self, now: float) -> str:
        seen = self._decoder.accounting()
        if self._asking.refusal and not self._means.known:
            return f"{self.url}: {self._asking.refusal}"
        if seen.other_version is not None and not self._means.known:
            return (
                f"{self.url}: the device speaks wire version {seen.other_version}, this program "
                f"speaks {VERSION}; update the older of the two"
            )
        came = seen.bytes_in - self._bytes_before
        if not came or (self._means.known and now - self._heard >= _PATIENCE):
            return (
                f"{self.url}: silent for more than {_PATIENCE:g} s; is the device on, and is this "
                "its port?"
            )
        if self._good_at > self._opened and not self._means.known:
            return (
                f"{self.url}: messages come, but for more than {_PATIENCE:g} s none said what the "
                "device is; its firmware must send an information message every second"
            )
        others = ", ".join(self._holders)
        return (
            f"{self.url}: {came} bytes came but no message of wire version {VERSION} "
            f"{self._tuning.told} it is another kind of device"
            + (f", or {others} takes its bytes" if others else "")
        )

    def accounting(self) -> Accounting:
        overrun = self._overrun + (self._line.overrun if self._line else 0)
        return self._decoder.accounting(overrun=overrun)

    def close(self) -> None:
        if self._line is not None:
            self._line.close()


register_scheme("", SerialSource)
