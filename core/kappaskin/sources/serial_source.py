"""Serial source: frames from a port, or any URL that pyserial opens; reconnects by itself."""

import math
import time
from collections import deque
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

from kappaskin.errors import EndedSource, SourceError
from kappaskin.estimation import Scanner
from kappaskin.frames import Event, Frame
from kappaskin.sensing import Sensor
from kappaskin.sources.clock import ClockMap, ClockState
from kappaskin.sources.commands import DeviceCommands, ScanControl
from kappaskin.sources.decoder import Accounting, Decoder, SequenceCounter
from kappaskin.sources.description import (
    SCHEME,
    SUFFIX,
    Description,
    described_text,
    load_description,
    parts_of,
)
from kappaskin.sources.inputs import (
    STANDARD_INPUT,
    UDP,
    Datagrams,
    Input,
    PlayedFile,
    StandardInput,
)
from kappaskin.sources.interpreter import Interpreter
from kappaskin.sources.lines import LineDecoder
from kappaskin.sources.ports import (
    BaudRateSearch,
    Port,
    SerialConnection,
    holders,
)
from kappaskin.sources.pushed import FEED, FedInput, fed_description
from kappaskin.sources.source import (
    InputRecorder,
    Source,
    plugged_source,
    register_scheme,
)
from kappaskin.sources.wire import (
    VERSION,
    Command,
    FromDevice,
    Information,
    Reply,
    Samples,
    encode_samples,
)

_PATIENCE = 3.0  # s without messages, or without the device's information, before that is reported
_DWELL = 0.8  # s of unreadable bytes, after which another baud rate is tried
_SLOW = 8.0  # s to open a port, after which that is reported: Bluetooth takes some
_RETRY = 0.25  # s between two attempts to open a port that was lost
_UNREAD = 2**22  # counts kept until the device has sent its information
_MESSAGE_OVERHEAD = 64  # counts that take as much memory as a message beside its own
_CLOCK_OFFSET, _CLOCK_DRIFT = 0.5, 0.01  # s, and share, by which two running clocks may differ
_LONGEST_TEXT = 500  # characters: a device may send any name, and each status has 64 events
_EVENTS, _EVENTS_A_SECOND = 256, 20  # that are reported at once at most, and for long
_CHANGE = 0.5  # s between two changes of a device's description that is connected
_LOSS_INTERVAL = 1.0  # s of which lost messages are reported together


class SerialSource:
    """Frames from the device on a port; reconnects when it was unplugged, on whichever port it is.

    Opening raises a `SourceError` where it cannot be; thereafter `trouble` says why no frames come.
    A thread of its own reads, so that no byte waits for arithmetic. A device with a line format of
    its own has a `description` in place of its information, and is sent nothing; its lines may also
    come as datagrams, on standard input, or from a file, which end with an `EndedSource`, or from
    an `Input` that `opened` returns.
    """

    def __init__(
        self,
        url: str,
        clock: Callable[[], float] = time.monotonic,
        description: Description | None = None,
        opened: Callable[[], Input] | None = None,
    ) -> None:
        self.url, self._clock, self._opened_by = url, clock, opened
        self._plug = Port.named(url)
        self._description = description
        connection, self._decoder = connected(url, description, clock, opened)
        self._interpreter = Interpreter(url)
        self._events = _EventQueue(self._decoder.sequence, clock)
        self._scan_control = ScanControl()
        self._recording = _RecordingTap(self._interpreter)
        self._pending: deque[tuple[float, FromDevice]] = deque()
        self._last: tuple[float, float] | None = None  # device and host time of the last message
        self._overrun = 0
        self._disconnected = ""  # why there is no connection
        self._lost_at: float | None = None  # when the connection was lost, until the device is back
        self._next_try, self._changed_at = 0.0, -math.inf
        self._connection: SerialConnection | None = None
        self._connect(connection)

    @property
    def sensor(self) -> Sensor | None:
        return self._interpreter.sensor

    @property
    def temperature(self) -> float:
        """The device's, in degrees Celsius; NaN where it does not report it."""
        return self._commands.temperature

    # The connection: opened, lost, opened again.

    def _connect(self, connection: SerialConnection) -> None:
        """Read from `connection`, and ask the device for its information."""
        now = self._clock()
        self._connection, self._opening = connection, connection.opening
        self._opened = self._received_at = self._good_at = self._tuned_at = now
        self._bytes_before = self._decoder.accounting().bytes_in
        self._holders: list[str] = []
        clock_map = ClockMap()
        self._interpreter.begin(clock_map)
        self._commands = DeviceCommands(self._send, clock_map)
        if self._description is not None:
            by_datagrams = self.url.startswith(UDP)
            self._identify(described_text(self._description.sensor, by_datagrams))
            if held := self._decoder.held:  # that it begins with a whole line again
                self._recording.received([(now, held)])
            return
        self._rates = BaudRateSearch(connection.baud_rate)
        self._commands.greet(now)
        self._scan_control.begin()

    def _disconnect(self, connection: SerialConnection) -> None:
        """Close a connection that was lost; the device may come back."""
        if connection.refusal is not None:  # it took long to open, in vain
            self._connection, self._disconnected = None, f"{connection.refusal}; retrying"
            return
        self._overrun += connection.overrun
        connection.close()
        self._connection = None
        self._decoder.line_ended()
        self._decoder.sequence.interrupt()
        self._pending.clear()
        self._lost_at = self._clock()
        self._recording.disconnected(self._lost_at)
        self._disconnected = f"{self.url}: connection lost: {(connection.input or Input).lost}"
        self._events.add("gone", self._disconnected)

    def _reconnect(self, timeout: float) -> None:
        """Try to open the port, or the one where a plug of the same serial number is now."""
        now = self._clock()
        if now < self._next_try:
            time.sleep(min(timeout, self._next_try - now))
            return
        self._next_try = now + _RETRY
        try:
            url, opened = self._present_url(), self._opened_by
            self._connect(connected(url, self._description, self._clock, opened)[0])
        except SourceError as error:
            self._disconnected = f"{error}; retrying"

    def _present_url(self) -> str:
        known = self._plug.serial_number
        here = (port.port for port in Port.found() if port.same_plug(self._plug)) if known else ()
        return next(iter(here), self.url)

    def reset(self) -> None:
        """Let the board restart, if DTR or RTS does that."""
        if self._connection is not None:
            self._connection.reset()

    def close(self) -> None:
        if self._connection is not None:
            self._connection.close()

    # From the device: bytes to messages to frames.

    def read(self, timeout: float) -> list[Frame]:
        """The frames that arrived, after at most `timeout` s."""
        connection = self._connection
        if connection is None:
            self._reconnect(timeout)
            return []
        # Asked for first: what arrived before the connection was lost is still to be read.
        lost = connection.lost
        # No more than can be used, or a flood would be kept in memory.
        wait = 0.0 if lost else timeout
        arrived = [] if self._has_usable() else connection.take(wait)
        if self._opening and not connection.opening:
            self._connect(connection)
        for now, data in arrived:
            messages = self._decoder.feed(data)
            self._received_at = now
            self._pending += [(now, got) for got in messages if not isinstance(got, Command)]
            if messages:
                self._good_at = now
                if self._description is None and self._rates.good(connection.baud_rate):
                    self._events.add("rate", f"the device sends at {connection.baud_rate} baud")
        if not self._interpreter.known:
            self._find_information()
        frames = self._frames()
        if self._has_usable() and not frames:
            time.sleep(timeout)  # until the description may change again
        self._recording.received(arrived)
        if self._interpreter.known and self._events.restarted():
            self._scan_control.begin()
        self._events.losses()
        if lost and connection.empty and not self._has_usable():
            if connection.ended and not frames:
                self._decoder.line_ended()
                raise EndedSource(f"{self.url}: ended, {self._decoder.accounting().words}")
            if not connection.ended:
                self._disconnect(connection)
        else:
            self._maintain(connection)
        return frames

    def _has_usable(self) -> bool:
        """Whether messages wait that can be used before more bytes are read."""
        return self._interpreter.known and bool(self._pending)

    def _find_information(self) -> None:
        """Learn which device it is; what it sent before that is kept until then."""
        for place, (_, message) in enumerate(self._pending):
            if isinstance(message, Information):
                self._identify(message.text)
                if not self._interpreter.known:
                    self._drop(place + 1)
                return
        self._drop_beyond(_UNREAD)

    def _drop_beyond(self, most: int) -> None:
        """Keep the newest messages, of `most` counts together."""
        counts = 0
        for newer, (_, message) in enumerate(reversed(self._pending)):
            counts += _MESSAGE_OVERHEAD
            counts += len(message.counts) if isinstance(message, Samples) else 0
            if counts > most:
                self._drop(len(self._pending) - newer)
                return

    def _drop(self, count: int) -> None:
        for _ in range(count):
            self._pending.popleft()

    def _identify(self, text: str) -> None:
        """Take the device's information, and report what of it is new."""
        before, text_before = self._interpreter.sensor, self._interpreter.text
        if not self._interpreter.learn(text):
            return
        self._changed_at = self._clock()
        if text != text_before:
            self._scan_control.scan(None)  # what was chosen is on the skin that was
        sensor = self._interpreter.sensor
        if sensor is not None:
            if self._lost_at is not None:
                self._resume(before, sensor, self._clock() - self._lost_at)
            self._events.connected(before, sensor)

    def _resume(self, before: Sensor | None, now: Sensor, away: float) -> None:
        """Count what was lost while the connection was, for `away` s."""
        self._lost_at = None
        same = before is not None and before.serial_number == now.serial_number
        sequence = self._decoder.sequence
        lost_before = sequence.lost
        sequence.resume(same and self._ran_on())
        self._events.reconnected(now, away, same, sequence.lost - lost_before)

    def _ran_on(self) -> bool:
        """Whether the device's clock went on while there was no connection.

        One that shows more than had passed here as the port was opened went on too: this machine
        was asleep, or busy, then or since.
        """
        if self._last is None or not self._pending:
            return False
        device = self._pending[0][1].time - self._last[0]
        host = self._opened - self._last[1]
        return device > 0 and device - host > -_CLOCK_OFFSET - _CLOCK_DRIFT * host

    def _frames(self) -> list[Frame]:
        """The frames before the next message that changes the sensor, or cannot be used."""
        frames: list[Frame] = []
        while self._has_usable():
            first = self._pending[0][1]
            if self._interpreter.is_of_another(first):
                soon = self._clock() - self._changed_at < _CHANGE  # again: each takes a pipeline
                if frames or (soon and isinstance(first, Information)):
                    break
            now, message = self._pending.popleft()
            self._last = message.time, now
            if isinstance(message, Reply):
                self._take_reply(message, now)
            elif isinstance(message, Information):
                self._identify(message.text)
            elif frame := self._interpreter.frame(message, now):
                frames.append(frame)
                self._recording.clock(frame.device_time)
        return frames

    # To the device: pings, scan lists, other baud rates.

    def _send(self, data: bytes) -> None:
        if self._connection is not None and self._connection.write(data):
            self._recording.sent(self._clock(), data)

    def scan(self, scanner: Scanner | None) -> None:
        """Let the device scan what `scanner` chooses, a few times a second; all without one."""
        self._scan_control.scan(scanner)

    @property
    def scan_refusal(self) -> str:
        """Why the device does not scan what was requested; empty when it does."""
        return self._scan_control.refusal

    def _take_reply(self, reply: Reply, now: float) -> None:
        before = self._commands.refusal
        self._commands.take(reply, now)
        self._scan_control.take(reply)
        if self._commands.refusal != before:
            self._events.add("refused", self._commands.refusal)

    def _maintain(self, connection: SerialConnection) -> None:
        """Send pings and scan lists; try other baud rates on unreadable bytes."""
        if self._description is not None:
            return
        now, known = self._clock(), self._interpreter.known
        if known and self._interpreter.sensor is not None:
            self._scan_control.attend(now, self._interpreter.sensor, self._commands.send)
        if self._commands.attend(now) and not known:
            self._commands.greet(now)
        since = max(self._good_at, self._tuned_at)
        patience = _PATIENCE if known and self._tuned_at < self._good_at else _DWELL
        if self._received_at > since and now - since > patience:
            connection.set_baud_rate(self._rates.next(connection.baud_rate))
            self._tuned_at, self._holders = now, holders(self.url)
            self._commands.greet(now)

    # What is reported.

    def record(self, recorder: InputRecorder | None) -> None:
        """Give `recorder` from now on all that frames are made of; nobody without one."""
        now = self._clock()
        self._recording.begin(recorder, now, self._pending, self._decoder.held)
        if self._connection is None:
            self._recording.disconnected(now)

    def events(self) -> list[Event]:
        """The events since the last call."""
        return self._events.take()

    def accounting(self) -> Accounting:
        overrun = self._overrun + (self._connection.overrun if self._connection else 0)
        return self._decoder.accounting(overrun=overrun)

    @property
    def patient(self) -> bool:
        """Whether it is a file, or standard input."""
        by = self._connection.input if self._connection else None
        return by is not None and by.patient

    @property
    def trouble(self) -> str:
        """Why no frames come; empty when they do, or may be expected to."""
        if self._connection is None:
            return self._disconnected
        now = self._clock()
        if self._opening and now - self._opened < _SLOW:
            return self._disconnected
        if self._opening:
            return (
                f"{self.url}: not open after {_SLOW:g} s; unplug it and plug it in again, or check "
                "the address"
            )
        # More waits, as after a long computation, and may be as described.
        behind = now - self._received_at >= _PATIENCE and not self._connection.empty
        if self._interpreter.unusable or behind or now - self._opened < _PATIENCE:
            return self._interpreter.unusable
        if self._interpreter.known and now - self._good_at < _PATIENCE:
            return ""
        return self._why_none(now)

    def _why_none(self, now: float) -> str:
        counts, known = self._decoder.accounting(), self._interpreter.known
        if self._commands.refusal and not known:
            return f"{self.url}: {self._commands.refusal}"
        if counts.other_version is not None and not known:
            return (
                f"{self.url}: the device speaks wire version {counts.other_version}, this program "
                f"uses {VERSION}; update the older of the two"
            )
        arrived = counts.bytes_in - self._bytes_before
        by = self._connection.input if self._connection else None
        if by is not None and now - self._received_at >= _PATIENCE:
            silent = f"{self.url}: nothing came for more than {_PATIENCE:g} s; {by.silence}"
            return silent if by.silence else ""
        if not arrived or (known and now - self._received_at >= _PATIENCE):
            return (
                f"{self.url}: silent for more than {_PATIENCE:g} s; check the power, and that this "
                "is its port"
            )
        if isinstance(self._decoder, LineDecoder):
            last = self._decoder.last and f"; the last one discarded: {self._decoder.last}"
            return (
                f"{self.url}: {arrived} bytes came but no record as described; check columns, "
                f"separator and baud rate in the sensor's description{last}"
            )
        if self._good_at > self._opened and not known:
            return (
                f"{self.url}: messages arrive, but in {_PATIENCE:g} s none described the "
                "device; its firmware must send an information message every second"
            )
        others = ", ".join(self._holders)
        return (
            f"{self.url}: {arrived} bytes came but no message of wire version {VERSION} "
            f"{self._rates.tried} it is another kind of device: one that prints numbers needs "
            "--sensor FILE, its description" + (f", or {others} reads its bytes" if others else "")
        )


def connected(
    url: str,
    description: Description | None,
    clock: Callable[[], float],
    opened: Callable[[], Input] | None = None,
) -> tuple[SerialConnection, Decoder | LineDecoder]:
    """A connection to a device, and a decoder of what it sends.

    A described one is read from the input that `opened` returns, if that is given; it may also be
    datagrams, standard input, a feed, or a file, which begin with whole records.
    """
    if description is None:
        return SerialConnection(url, clock), Decoder()
    opened = opened or _input_of(url, description, clock)
    connection = SerialConnection(url, clock, description.baud_rate, opened)
    by_datagrams = url.startswith(UDP)
    return connection, description.decoder(whole=opened is not None, by_datagrams=by_datagrams)


def _input_of(
    url: str, description: Description, clock: Callable[[], float]
) -> Callable[[], Input] | None:
    """What opens the input at `url`; None for a port."""
    if url == STANDARD_INPUT:
        return partial(StandardInput, clock)
    if url.startswith(UDP):
        return partial(Datagrams, url, clock)
    if url.startswith(FEED):
        return partial(FedInput, url, description, clock)
    if Path(url).is_file():
        records = description.decoder(whole=True)
        return partial(PlayedFile, Path(url), records, description.rate, clock)
    return None


class _EventQueue:
    """Collects events until they are taken; those of lost messages by the counts of `sequence`."""

    def __init__(self, sequence: SequenceCounter, clock: Callable[[], float]) -> None:
        self._sequence, self._clock = sequence, clock
        self._events: list[Event] = []
        self._lost = self._restarts = 0  # that were reported
        self._losses_at = 0.0
        self._room, self._left_out, self._added_at = float(_EVENTS), 0, clock()

    def add(self, kind: str, text: str) -> None:
        """Report an event, unless there were too many shortly before."""
        now = self._clock()
        room = self._room + _EVENTS_A_SECOND * (now - self._added_at)
        self._room, self._added_at = min(room, _EVENTS), now
        if self._room < 1:
            self._left_out += 1
            return
        more = f" ({self._left_out} more events before it)" if self._left_out else ""
        self._events.append(Event(now, kind, text[:_LONGEST_TEXT] + more))
        self._room, self._left_out = self._room - 1, 0

    def take(self) -> list[Event]:
        """The events since the last call."""
        events, self._events = self._events, []
        return events

    def connected(self, before: Sensor | None, now: Sensor) -> None:
        """Report what is new of the device that is there `now`."""
        name = _device_name(now)
        if before is None:
            self.add("met", f"{name}, firmware {now.firmware}")
        elif before.serial_number != now.serial_number:
            self.add("other", f"another device: {name} instead of {before.serial_number}")
        elif now.firmware != before.firmware:
            self.add("firmware", f"firmware {now.firmware} instead of {before.firmware}")
        elif now is not before:
            self.add("changed", f"{name} sent a different description than before")

    def reconnected(self, sensor: Sensor, away: float, same: bool, lost: int) -> None:
        """Report that the `same` device is back after `away` s, in which so many were `lost`."""
        restarted = "" if self._sequence.restarts == self._restarts else ", restarted"
        self._lost, self._restarts = self._lost + lost, self._sequence.restarts
        if same:
            text = f"{_device_name(sensor)} is connected again after {away:.1f} s{restarted}"
            self.add("back", f"{text}: {lost} messages lost")

    def restarted(self) -> bool:
        """Whether the device restarted since the last call, which is reported."""
        restarted = self._sequence.restarts > self._restarts
        if restarted:
            self._restarts = self._sequence.restarts
            self.add("restarted", "the device restarted while it was connected")
        return restarted

    def losses(self) -> None:
        """Report what was lost, at most once in a while."""
        lost, now = self._sequence.lost - self._lost, self._clock()
        if lost and now - self._losses_at >= _LOSS_INTERVAL:
            if lost > 0:
                self.add("gap", f"{lost} messages lost")
            self._lost, self._losses_at = self._sequence.lost, now


def _device_name(sensor: Sensor) -> str:
    return f"{sensor.name} {sensor.serial_number}"


class _RecordingTap:
    """Passes all that frames are made of to a recorder while there is one."""

    def __init__(self, interpreter: Interpreter) -> None:
        self._interpreter = interpreter
        self._recorder: InputRecorder | None = None
        self._clock_state: ClockState | None = None  # as it was recorded last
        self._clock_changes: list[tuple[float, ClockState]] = []
        self._information = ""  # as it was recorded last

    def begin(
        self,
        recorder: InputRecorder | None,
        now: float,
        waiting: Iterable[tuple[float, FromDevice]],
        held: bytes,
    ) -> None:
        """Record by `recorder` from now on, or no more.

        First the device, messages `waiting` to be read, and bytes `held` of the next.
        """
        self._recorder, self._clock_changes, self._information = recorder, [], ""
        self._clock_state = None
        if recorder is None:
            return
        if self._interpreter.sensor is not None:  # frames are of it, also of one disconnected
            self._record_information(recorder)
            if not self._interpreter.known:
                recorder.disconnected(now)
        for received, message in waiting:
            if isinstance(message, Samples):
                sequence, began, channels, counts = message
                recorder.received(received, encode_samples(sequence, began, channels, counts, 4))
        self._clock_state = self._interpreter.clock_map.state
        recorder.clock(math.nan, self._clock_state)
        if held:
            recorder.received(now, held)

    def sent(self, now: float, data: bytes) -> None:
        if self._recorder is not None:
            self._recorder.sent(now, data)

    def disconnected(self, now: float) -> None:
        if self._recorder is not None:
            self._recorder.disconnected(now)

    def clock(self, since: float) -> None:
        """Note the state of the clock map from the scan at device time `since` on."""
        if self._recorder is None:
            return
        state = self._interpreter.clock_map.state
        if self._clock_state is None or state.map != self._clock_state.map:
            self._clock_changes.append((since, state))
            self._clock_state = state

    def received(self, arrived: list[tuple[float, bytes]]) -> None:
        """Record the bytes that were read, and before them how their times are mapped."""
        if self._recorder is None:
            return
        for since, state in self._clock_changes:
            self._recorder.clock(since, state)
        self._clock_changes = []
        for now, data in arrived:
            self._recorder.received(now, data)
        if self._interpreter.known:
            # It is in those bytes; here it is for whoever begins to replay after them.
            self._record_information(self._recorder)

    def _record_information(self, recorder: InputRecorder) -> None:
        if self._interpreter.text != self._information:
            self._information = self._interpreter.text
            recorder.connected(self._information)


register_scheme("", lambda name, _: SerialSource(name))


def _described(name: str) -> Source:
    """The source of a name as `described_source` makes it, without its scheme."""
    file, url = parts_of(f"{SCHEME}{name}")
    if not url:
        raise SourceError(
            f"expected {SCHEME}FILE{SUFFIX}:PORT, a sensor's description and where it is "
            f"connected; got {SCHEME}{name}"
        )
    if (plugged := plugged_source(url, Path(file))) is not None:
        return plugged
    description = load_description(Path(file), Port.named(url).serial_number)
    return SerialSource(url, description=description)


register_scheme(SCHEME, lambda name, _: _described(name))


register_scheme(FEED, lambda name, _: SerialSource(FEED + name, description=fed_description(name)))
