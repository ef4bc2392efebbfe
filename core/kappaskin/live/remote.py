"""Engines on another machine, used like those of this one.

A process holds the connection and fills the memory that an engine here would fill: reports and
estimates of the server go there, with times on this machine's clock, and what is requested goes to
the server.
"""

import math
import secrets
import select
import signal
import time
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from multiprocessing.connection import Connection
from pathlib import Path
from statistics import median
from typing import Any, get_type_hints

import numpy as np

from kappaskin._processes import end_with_parent
from kappaskin._text import printable
from kappaskin.errors import Refusal, SourceError
from kappaskin.frames import Event
from kappaskin.live.codec import BadMessageError, decoded, encoded
from kappaskin.live.engine import Engine, Fingers
from kappaskin.live.link import (
    SCHEME,
    Change,
    Denied,
    EngineAddress,
    MessageSocket,
    Ping,
    Pong,
    Report,
    Seen,
    Shown,
    place_of,
)
from kappaskin.live.pipelines import PipelineStatus
from kappaskin.live.records import unpacked
from kappaskin.live.requests import SETTINGS, Action, Requested, Seek, Update
from kappaskin.live.resume import ResumeInfo
from kappaskin.live.ring import Ring, is_slot
from kappaskin.live.status import LOST, WAITING, LinkStatus, Status
from kappaskin.recording import RecordingStatus

_FIRST = 5.0  # s within which an engine has to answer at first
_AGAIN = 0.7, 3.0  # s within which it has to again, where the way is short, or where it is not
_SHORT = 0.2  # s there and back
_BREAK, _LONGEST_BREAK = 0.1, 0.5  # s between two tries: at first, and after many
_DENIED = 1.0  # s until a connection that is denied is tried again
_PING, _REPORT, _POLL = 0.25, 0.05, 0.004  # s
_LOST, _DEAD = 1.0, 2.0  # s without a message until it is called lost, and until it is given up
_PINGS, _AGES = 16, 32  # of which the medians are told
_CLOCKS = 240  # pings, of a minute, of which the quickest tells the clock
_SHARE = 2.0  # s in which estimates are counted
_OWN = ("finger", "actions", "trust", "number", "changed", "over")
"""Fields of what is requested that are not the server's."""
_KEPT = ("source", "recording")
"""Settings that are not requested again of a server that was started again."""
_TYPES = get_type_hints(Status)
_TIMES = ("host_time", "taken", "ready_time")  # of an estimate, on the engine's clock
_MOST_EVENTS = 64


class _Clock:
    """The engine's clock by pings: `offset` is what it is ahead of ours, in s."""

    def __init__(self) -> None:
        self._pings = deque[tuple[float, float]](maxlen=_CLOCKS)
        self.offset = 0.0

    def take(self, pong: Pong, now: float) -> None:
        """Take an answer that came at `now`; the quickest one is the most exact."""
        self._pings.append((now - pong.sent, pong.time - (pong.sent + now) / 2))
        self.offset = min(self._pings)[1]

    @property
    def round_trip(self) -> float:
        trips = [trip for trip, _ in self._pings]
        return median(trips[-_PINGS:]) if trips else math.nan


@dataclass(frozen=True)
class _Generation:
    """A generation of estimates: its number here and at the engine, and the type of a record."""

    ours: int = 0
    theirs: int = 0
    slot: "np.dtype[np.void] | None" = None


class _Relay:
    """Carries requests from the line of a window to a server, and reports and estimates back."""

    def __init__(
        self,
        requests: "Connection[Update, Update]",
        rings: tuple[Ring, Ring],
        address: EngineAddress,
        finger: str,
        requested: Requested,
    ) -> None:
        self._requests, self._rings = requests, rings
        self._address, self._finger, self._requested = address, finger, requested
        self._line: MessageSocket | None = None
        self._changes: list[Change] = []  # that the server may not have
        self._numbers: list[tuple[int, int]] = []  # of a change, and of what was requested with it
        self._number, self._known = 0, requested.number
        self._first, self._again, self._break = True, 0.0, _BREAK
        self._status = Status(state=WAITING, source=requested.source or "", setup=requested.setup)
        self._fields = dict[str, Any]()
        self._events, self._event_count = list[Event](), 0
        self._taken = 0  # events of the engine
        self._trouble, self._heard, self._lost_since = "", time.monotonic(), math.inf
        self._link, self._clock = LinkStatus(address.place), _Clock()
        self._next_ping = self._next_report = 0.0
        self._generation = self._compared = _Generation()
        self._connections = 0
        self._ages = deque[float](maxlen=_AGES)
        self._counts = deque[tuple[float, int]]()

    def run(self) -> None:
        """Relay until the window ends it or is gone."""
        while self._take_requests(0.0 if self._line else _REPORT):
            if self._line is not None:
                self._exchange(self._line)
            elif time.monotonic() >= self._again:
                self._connect()
            if time.monotonic() >= self._next_report:
                self._report()
        self._disconnect("")

    # Requests.

    def _take_requests(self, wait: float) -> bool:
        """Pass on what the window requests; whether it is there and goes on."""
        try:
            while self._requests.poll(wait):
                was, wait = self._requested, 0.0
                self._requested = was.updated(self._requests.recv())
                if self._requested.over:
                    return False
                self._send_changes(was)
        except (EOFError, OSError):
            return False
        return True

    def _send_changes(self, was: Requested) -> None:
        """Send what was requested since then, in order."""
        now = self._requested
        new = [name for name, at in now.changed.items() if at > was.number and name not in _OWN]
        beside = [name for name in new if name not in SETTINGS]
        for step in [*now.since(was.number), ""]:
            if isinstance(step, str):
                names, actions = [*beside, *([step] if step else [])], ()
            else:
                names, actions = beside, (self._of_engine(step),)
            beside = []
            if names or actions:
                self._change(names, actions)

    def _of_engine(self, action: Action) -> Action:
        """The same with a time on the engine's clock."""
        if isinstance(action, Seek) and action.since is not None:
            return replace(action, since=action.since + self._clock.offset)
        return action

    def _change(self, names: Iterable[str], actions: tuple[Action, ...] = ()) -> None:
        values = {name: getattr(self._requested, name) for name in names}
        if isinstance(path := values.get("recording"), Path):
            values["recording"] = Path(path.name)
        self._number += 1
        settings = {name: encoded(value) for name, value in values.items()}
        change = Change(self._number, settings, actions)
        self._changes.append(change)
        self._numbers.append((self._number, self._requested.number))
        if self._line is not None:
            with suppress(OSError):  # that it is lost is seen when it is read
                self._line.send(change)

    # The connection.

    def _connect(self) -> None:
        short = self._clock.round_trip < _SHORT
        within = _FIRST if self._first else _AGAIN[0] if short else _AGAIN[1]
        try:
            line, welcome = self._address.connect(self._finger, within)
        except Refusal as refusal:
            self._lose(str(refusal))
            self._again = time.monotonic() + self._break
            self._break = min(2 * self._break, _LONGEST_BREAK)
            if not isinstance(refusal, SourceError):
                self._again = time.monotonic() + _DENIED
            return
        now = time.monotonic()
        if welcome.received < 0 and not self._first:
            # Started again, or another window was there: it gets what this window shows.
            self._changes.clear()
            shown = [name for name in self._requested.changed if name not in (*_OWN, *_KEPT)]
            self._change(shown)
            self._connections += self._status.connections
            self._generation = _Generation(self._generation.ours)
            self._compared = _Generation(self._compared.ours)
        self._line, self._break = line, _BREAK
        with suppress(OSError):  # that it is lost again is seen when it is read
            for change in self._changes:
                if change.number > welcome.received:
                    line.send(change)
        if not self._first and self._lost_since < math.inf:
            lasted = now - self._lost_since
            self._say(f"the connection to {self._address.place} is back after {lasted:.1f} s")
        self._first, self._trouble, self._lost_since = False, "", math.inf
        self._next_ping = 0.0

    def _say(self, text: str) -> None:
        self._add_events([Event(time.monotonic(), "engine", text)])

    def _add_events(self, events: Sequence[Event]) -> None:
        self._events = [*self._events, *events][-_MOST_EVENTS:]
        self._event_count += len(events)

    def _lose(self, trouble: str) -> None:
        """Remember that there is no connection, and why."""
        if self._lost_since == math.inf:
            self._lost_since = self._heard
            if not self._first:
                self._say(f"the connection to {self._address.place} is lost: {trouble}")
                self._link = replace(self._link, cuts=self._link.cuts + 1)
        self._trouble = trouble

    def _disconnect(self, trouble: str) -> None:
        if self._line is not None:
            self._heard = self._line.heard
            self._line.close()
            self._line = None
            self._again = time.monotonic()
        if trouble:
            self._lose(trouble)

    def _exchange(self, line: MessageSocket) -> None:
        """Receive what has come, and ask for the time."""
        try:
            select.select([line], [line] if line.waiting else [], [], _POLL)
            line.flush()
            for message in line.receive():
                self._take(line, message)
            now = time.monotonic()
            if now >= self._next_ping:
                self._next_ping = now + _PING
                line.send(Ping(now))
            if now - line.heard > _DEAD:
                raise TimeoutError("no answer")
        except Refusal as refusal:
            self._disconnect(str(refusal))
            self._again = time.monotonic() + _DENIED
        except OSError as error:
            self._disconnect(str(error.strerror or error))

    def _take(self, line: MessageSocket, message: object) -> None:
        now = time.monotonic()
        match message:
            case Pong():
                self._clock.take(message, now)
            case Report():
                line.send(Seen(message.number))
                self._take_report(message)
            case Shown():
                line.send(Seen(message.number))
                self._take_estimate(message, now)
            case Denied():
                raise Refusal(f"{self._address.place}: {printable(message.reason)}")
            case _:
                raise BadMessageError(f"expected no {type(message).__name__}")

    def _take_report(self, report: Report) -> None:
        for name, data in report.fields.items():
            self._fields[name] = decoded(data, _TYPES[name])
        while self._numbers and self._numbers[0][0] <= report.received:
            self._known = self._numbers.pop(0)[1]
        self._changes = [each for each in self._changes if each.number > report.received]
        status = Status(**{each.name: self._fields[each.name] for each in fields(Status)})
        fresh = status.event_count - self._taken
        fresh = fresh if 0 <= fresh < len(status.events) else len(status.events)
        self._taken, offset = status.event_count, self._clock.offset
        newest = status.events[len(status.events) - fresh :]
        self._add_events([replace(each, time=each.time - offset) for each in newest])
        self._generation = self._laid_out(self._rings[0], self._generation, status)
        if status.compared is not None:
            self._compared = self._laid_out(self._rings[1], self._compared, status.compared)
        self._status = status
        self._report()

    def _laid_out(
        self, ring: Ring, used: "_Generation", status: Status | PipelineStatus
    ) -> "_Generation":
        """The generation here of the one in a status, for which the ring is laid out."""
        slot = status.slot
        if slot is None or (status.generation, slot) == (used.theirs, used.slot):
            return used
        if not is_slot(slot):
            raise BadMessageError("expected records of estimates, got others")
        ring.lay_out(used.ours + 1, slot)
        self._counts.clear()
        return _Generation(used.ours + 1, status.generation, slot)

    def _take_estimate(self, shown: Shown, now: float) -> None:
        status = self._status
        if status.slot is None or shown.generation != status.generation:
            return
        record = self._record(shown.record, status.slot, self._generation.ours)
        other = status.compared
        if shown.compared and other is not None and other.slot is not None:
            also = self._record(shown.compared, other.slot, self._compared.ours)
            self._rings[1].write_record(also)
        self._rings[0].write_record(record)
        if math.isfinite(age := now - float(record["host_time"])):
            self._ages.append(age)
        self._counts.append((now, shown.count))

    def _record(self, data: bytes, slot: Any, generation: int) -> Any:
        """The record with times on this machine's clock, in a generation of ours."""
        record = unpacked(data, slot)
        record["generation"] = generation
        for name in _TIMES:
            record[name] -= self._clock.offset
        return record

    # Reports.

    def _report(self) -> None:
        """Write the status with times on this machine's clock, and how the connection is."""
        now = time.monotonic()
        self._next_report = now + _REPORT
        while self._counts and self._counts[0][0] < now - _SHARE:
            self._counts.popleft()
        status, offset = self._status, self._clock.offset
        computed = self._counts[-1][1] - self._counts[0][1] if len(self._counts) > 1 else 0
        self._link = replace(
            self._link,
            round_trip=self._clock.round_trip,
            age=median(self._ages) if self._ages else math.nan,
            shown=(len(self._counts) - 1) / computed if computed else math.nan,
        )
        status = replace(
            status,
            connections=self._connections + status.connections,
            generation=self._generation.ours,
            last_frame=status.last_frame - offset,
            reported=status.reported - offset,
            events=tuple(self._events),
            event_count=self._event_count,
            requested=self._known,
            link=self._link,
        )
        if status.compared is not None:
            status = replace(
                status, compared=replace(status.compared, generation=self._compared.ours)
            )
        silent = self._line is None or now - self._line.heard > _LOST
        if silent and not (self._first and not self._trouble):
            trouble = self._trouble or f"no answer from {self._address.place}"
            message = f"{trouble}; connecting again by itself"
            status = replace(status, state=LOST, rate=0.0, message=message, reported=now)
        self._rings[0].write_status(status)


def relay(
    requests: "Connection[Update, Update]",
    names: tuple[str, str],
    address: EngineAddress,
    finger: str,
    requested: Requested,
) -> None:
    """Relay between a window and the server at an `address`, until the window ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    rings = Ring.attach(names[0]), Ring.attach(names[1])
    try:
        _Relay(requests, rings, address, finger, requested).run()
    finally:
        for ring in rings:
            ring.close()


class RemoteEngine(Engine):
    """The engine of a `finger` at an address, which has `requested` already; closing leaves it.

    It is connected again by itself; `status` says while it is lost, and its `link` how the
    connection is. A recording is a file at the engine, of the name of the path that is requested.
    """

    _serve = staticmethod(relay)

    def __init__(self, address: EngineAddress, finger: str, requested: Requested) -> None:
        self._with = address, finger
        self._begin(requested)
        self.resumed = ResumeInfo(requested, ("", ""), 0, 0.0, address.place)

    def _start(self, status: Status) -> None:
        source, (address, _) = self.requested.source or "", self._with
        link = LinkStatus(address.place)
        super()._start(replace(status, state=WAITING, source=source, link=link))

    def _serves_with(self) -> tuple[object, ...]:
        return *self._with, self.requested

    def _known(self) -> int:
        return self.requested.number

    def revive(self) -> None:
        """Start the process again that holds the connection, if it died: the engine went on."""
        if self._process is not None and not self.alive:
            self._reap()
            self._start(self._seen)


class RemoteFingers(Fingers):
    """The engines of a hand at an `address`, by the names of fingers; closing leaves them."""

    def __init__(self, address: EngineAddress, fingers: Mapping[str, Requested]) -> None:
        super().__init__(())
        try:
            for finger, requested in fingers.items():
                self.engines[finger] = RemoteEngine(address, finger, requested)
        except BaseException:
            self.close()
            raise

    @property
    def _first(self) -> Engine:
        """Any: one file has all fingers."""
        return next(iter(self.engines.values()))

    def record(self, path: Path) -> None:
        self._first.record(path)

    def stop_recording(self) -> None:
        self._first.record(None)

    @property
    def recording(self) -> RecordingStatus:
        return self._first.status().recording


def remote_engines(source: str, token: str) -> RemoteEngine | RemoteFingers:
    """The engine, or the engines of a hand, at the address in `engine:HOST:PORT`.

    A `SourceError` where none answers, and a plain `Refusal` where this window is not let in.
    """
    host, port = place_of(source.removeprefix(SCHEME))
    address = EngineAddress(host, port, token, secrets.token_hex(16))
    line, welcome = address.connect(None, _FIRST)
    line.close()
    if set(welcome.fingers) == {""}:
        return RemoteEngine(address, "", welcome.fingers[""])
    return RemoteFingers(address, welcome.fingers)
