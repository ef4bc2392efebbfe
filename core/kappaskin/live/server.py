"""Server of the engines beside a hand: a window on another machine, at a time, controls them."""

import hmac
import secrets
import select
import socket
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, get_type_hints

from kappaskin._text import printable
from kappaskin.errors import Refusal
from kappaskin.live.codec import BadMessageError, decoded, encoded
from kappaskin.live.engine import Engine, Fingers
from kappaskin.live.link import (
    SCHEME,
    VERSION,
    Answer,
    Change,
    Denied,
    Greeting,
    Message,
    MessageSocket,
    Ping,
    Pong,
    Report,
    Seen,
    Shown,
    Welcome,
    check_version,
    place_text,
    proof_of,
)
from kappaskin.live.records import packed
from kappaskin.live.requests import Requested
from kappaskin.live.status import Status
from kappaskin.publish import THIS_MACHINE
from kappaskin.recording import unused
from kappaskin.scenes import SCENES

_REPORT = 0.1  # s between two reports of the status
_OFTEN, _SELDOM = 1 / 70, 0.1  # s between two estimates: a screen shows no more; on a bad link
_SLOWER, _FASTER = 1.5, 0.95  # times that, after one that came late, or in time
_QUEUED = 0.15  # s that what is sent may wait on the way, besides the way itself
_UNKNOWN = 1.0  # s that the way may take until it is known
_WAYS = 64  # messages by which it is known
_SILENT = 3.0  # s after which a window that sends nothing is gone
_WAITING = 16  # connections at most that have not shown that they have the token
_POLL = 0.004  # s
_CONTROLLED = {
    *("setup", "compared", "region", "targets", "scene", "speed", "looped", "recomputes"),
    *("added_noise", "window_state", "access"),
}
"""Settings that a window may change besides the source and the recording."""
_HINTS = get_type_hints(Requested)
_SIMULATED = "sim:"


class _Finger:
    """A finger that is served: its `engine`, and what a window is sent of it by its `line`."""

    def __init__(self, engine: Engine, source: str, trust: bool) -> None:
        self.engine, self._source, self._trust = engine, source, trust
        self.line: MessageSocket | None = None
        self.window, self.received = "", -1
        """Which window was connected last, and the number of the last change that came from it."""
        self._refusal = ""
        self._taken: deque[tuple[int, int]] = deque()  # number of a change, that of the request
        self._covered = -1
        self._begin()

    def _begin(self) -> None:
        self._number, self._next_report, self._next_shown = 0, 0.0, 0.0
        self._told, self._sent = Status(), dict[str, bytes]()
        self._count, self._generation, self._apart = 0, 0, _OFTEN
        self._under_way: deque[tuple[int, float]] = deque()
        self._ways: deque[float] = deque(maxlen=_WAYS)

    def connect(self, line: MessageSocket, window: str) -> int:
        """Serve this window from now on; the number of the last change that came from it."""
        if window != self.window:
            self.window, self.received, self._covered = window, -1, -1
            self._taken.clear()
        if self.line is not None:
            self.line.close()
        self.line = line
        self._begin()
        return self.received

    def change(self, change: Change, record: Callable[[Path | None], None]) -> None:
        """Request what the window requests; a `BadMessageError` for what it may not."""
        if change.number <= self.received:
            return
        if change.settings.keys() - {*_CONTROLLED, "source", "recording"}:
            raise BadMessageError(f"expected settings, got {sorted(change.settings)}")
        found = {name: decoded(data, _HINTS[name]) for name, data in change.settings.items()}
        self.received = change.number
        if "recording" in found:
            record(found.pop("recording"))
        if "source" in found:
            self._connect(found.pop("source"))
        with suppress(Refusal):
            self.engine.request(found, change.actions)
        self._taken.append((change.number, self.engine.requested.number))

    def _connect(self, source: str | None) -> None:
        """Take frames from a source that is served, or one of ready scenes; or from none."""
        returns, self._refusal = bool(self._refusal), ""
        scene = (source or "").removeprefix(_SIMULATED)
        ready = source == f"{_SIMULATED}{scene}" and scene in ("", *SCENES)
        if source is None:
            self.engine.disconnect()
        elif not (source == self._source or (ready and self._source.startswith(_SIMULATED))):
            self._refusal = (
                f"the engine reads {self._source} only; to read {source}, start `kappaskin serve` "
                "with it"
            )
        elif not (returns and source == self.engine.source):
            self.engine.connect(source, self._trust)

    def seen(self, number: int, now: float) -> None:
        """The window has received all up to this number."""
        while self._under_way and self._under_way[0][0] <= number:
            self._ways.append(now - self._under_way.popleft()[1])
            late = self._ways[-1] > min(self._ways) + _QUEUED
            apart = self._apart * (_SLOWER if late else _FASTER)
            self._apart = min(max(apart, _OFTEN), _SELDOM)

    def send(self, now: float, recording: Any) -> None:
        """Send the newest status and estimate, if it is time and the connection takes them."""
        line = self.line
        if line is None or line.waiting:
            return
        way = min(self._ways, default=_UNKNOWN)
        if self._under_way and now - self._under_way[0][1] > way + _QUEUED:
            return
        if now >= self._next_report:
            self._next_report = now + _REPORT
            self._report(line, recording, now)
        elif now >= self._next_shown:
            self._show(line, now)

    def _next(self, now: float) -> int:
        self._number += 1
        self._under_way.append((self._number, now))
        return self._number

    def _report(self, line: MessageSocket, recording: Any, now: float) -> None:
        """Send what has changed of the status."""
        self._told = status = self.engine.status()
        shown = replace(status, source_refusal=self._refusal or status.source_refusal)
        if recording is not None:
            shown = replace(shown, recording=recording)
        while self._taken and self._taken[0][1] <= status.requested:
            self._covered = self._taken.popleft()[0]
        changed = dict[str, bytes]()
        for each in fields(Status):
            data = encoded(getattr(shown, each.name))
            if data != self._sent.get(each.name):
                changed[each.name] = self._sent[each.name] = data
        line.send(Report(self._next(now), self._covered, changed))

    def _show(self, line: MessageSocket, now: float) -> None:
        """Send the newest estimate, if there is another one."""
        status = self._told
        found = self.engine.newest_records(status)
        if found is None or (status.generation, found[0]) == (self._generation, self._count):
            return
        self._next_shown = now + self._apart
        self._count, record, compared = found
        self._generation = status.generation
        other = b"" if compared is None else packed(compared)
        number = self._next(now)
        line.send(Shown(number, status.generation, self._count, packed(record), other))

    def end(self) -> None:
        if self.line is not None:
            self.line.close()
        self.line = None


class EngineServer:
    """Lets one window at a time control the engines of a `hand`, from another machine.

    It listens at `host` and `port`; 0 is any free one, and `port` the one in use. Each finger has a
    connection of its own. Who connects has to have the `token`. `sources` are those that the
    fingers read. Recordings are files in the folder `recordings`, whatever folder the window names.
    The engines go on when the window is gone. `taken_over` tells whether there has been any,
    `notices` what happened. A `Refusal` where nothing can listen there.
    """

    def __init__(
        self,
        hand: Fingers,
        sources: Mapping[str, str],
        host: str,
        port: int,
        token: str,
        recordings: Path,
        trust: bool = False,
    ) -> None:
        self._hand, self._token, self._folder, self._host = hand, token, recordings, host
        self._fingers = {
            name: _Finger(engine, sources[name], trust) for name, engine in hand.engines.items()
        }
        self._new = dict[MessageSocket, tuple[float, bytes]]()
        self._owner, self.window, self._since = "", "", 0.0
        self._name: Path | None = None
        self.taken_over, self.notices = False, list[str]()
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            self._listener = socket.create_server((host, port), family=family)
        except OSError as error:
            why = (error.strerror or str(error)).partition(" (while")[0]
            raise Refusal(
                f"expected to listen at {host}, port {port}, got {why}; choose another port"
            ) from error
        self._listener.setblocking(False)
        self.port = int(self._listener.getsockname()[1])

    @property
    def invitation(self) -> str:
        """The source that a window connects to."""
        everywhere = self._host in ("0.0.0.0", "::")
        return (
            f"{SCHEME}{place_text(socket.gethostname() if everywhere else self._host, self.port)}"
        )

    def poll(self, wait: float) -> None:
        """Serve for some `wait` s."""
        end = time.monotonic() + wait
        while (now := time.monotonic()) < end:
            served = [each for each in self._fingers.values() if each.line is not None]
            lines = [*self._new, *(each.line for each in served if each.line is not None)]
            full = [each for each in lines if each.waiting]
            left = min(end - now, _POLL) if served else end - now
            select.select([self._listener, *lines], full, [], left)
            self._accept()
            for line in tuple(self._new):
                self._hear_new(line)
            for each in served:
                self._serve(each)
            self._follow_window()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                line = MessageSocket(self._listener.accept()[0])
                challenge = secrets.token_bytes(32)
                self._new[line] = time.monotonic(), challenge
                line.send(Greeting(VERSION, challenge))
                if len(self._new) > _WAITING:  # the one that has waited longest
                    self._drop(next(iter(self._new)))

    def _drop(self, line: MessageSocket) -> None:
        self._new.pop(line, None)
        line.close()

    def _hear_new(self, line: MessageSocket) -> None:
        """Let one in that has the token, once it answers."""
        since, challenge = self._new[line]
        try:
            line.flush()
            answers = line.receive()
            if answers:
                self._answer(line, answers[0], challenge)
            elif time.monotonic() - since > _SILENT:
                self._drop(line)
        except Refusal as refusal:
            self._deny(line, str(refusal))
        except OSError:
            self._drop(line)

    def _deny(self, line: MessageSocket, reason: str) -> None:
        """End a connection and say why."""
        self.notices.append(f"{_address(line)}: {reason}")
        with suppress(OSError):
            line.send(Denied(reason))
        self._drop(line)

    def _answer(self, line: MessageSocket, answer: Message, challenge: bytes) -> None:
        """Let the window in that answers; a `Refusal` says why it is not."""
        if not isinstance(answer, Answer):
            raise BadMessageError("expected an answer to the challenge")
        check_version(answer.version, "the window")
        both = challenge, answer.challenge
        if not hmac.compare_digest(answer.proof, proof_of(self._token, "window", *both)):
            raise Refusal("expected the token of this engine, got another one; give the right one")
        if self._owner and answer.window != self._owner:
            minutes = (time.monotonic() - self._since) / 60
            raise Refusal(f"in use by {self.window} for {minutes:.0f} min; close that window first")
        line.proven = True
        proof = proof_of(self._token, "engine", *both)
        if answer.finger is None:
            line.send(Welcome(proof, {name: self._requested(name) for name in self._fingers}))
            return
        finger = self._fingers.get(answer.finger)
        if finger is None:
            raise Refusal(f"expected a finger among {', '.join(self._fingers)}")
        del self._new[line]
        received = finger.connect(line, answer.window)
        line.send(Welcome(proof, {answer.finger: self._requested(answer.finger)}, received))
        if not self._owner:
            self._owner, self._since, self.taken_over = answer.window, time.monotonic(), True
            self.window = f"the window on {printable(answer.machine)[:80]} ({_address(line)})"
            self.notices.append(f"{self.window} is connected")

    def _requested(self, finger: str) -> Requested:
        """What is requested of a finger's engine, as a window may have it."""
        now = self._fingers[finger].engine.requested
        name = Path(self._name.name) if self._name is not None else None
        return replace(now, actions=(), access=THIS_MACHINE, recording=name)

    def _serve(self, finger: _Finger) -> None:
        """Carry out what the window of a finger requests, and send what is new."""
        if (line := finger.line) is None:
            return
        try:
            for message in line.receive():
                now = time.monotonic()
                match message:
                    case Change():
                        finger.change(message, self._record)
                    case Seen():
                        finger.seen(message.number, now)
                    case Ping():
                        line.send(Pong(message.sent, now))
                    case _:
                        raise BadMessageError(f"expected no {type(message).__name__}")
            line.flush()
            recording = self._hand.recording if len(self._fingers) > 1 else None
            finger.send(time.monotonic(), recording)
            if time.monotonic() - line.heard > _SILENT:
                raise TimeoutError("silent")
        except Refusal as refusal:
            finger.line = None
            self._deny(line, str(refusal))
        except OSError:
            finger.end()

    def _record(self, name: Path | None) -> None:
        """Record all fingers to a file of this name in the folder, or end that."""
        if name is not None and (name.name != str(name) or name.name.startswith(".")):
            raise BadMessageError(f"expected the name of a recording, got {str(name)!r:.99}")
        self._name = name
        several = len(self._fingers) > 1
        (engine, *_) = self._hand.engines.values()
        if name is None:
            self._hand.stop_recording() if several else engine.record(None)
            return
        path = unused(self._folder.absolute() / name)
        try:
            self._hand.record(path) if several else engine.record(path)
        except Refusal as refusal:
            self.notices.append(str(refusal))
            self._name = None

    def _follow_window(self) -> None:
        """Let another window in once no connection of the last one is left."""
        if self._owner and all(each.line is None for each in self._fingers.values()):
            self.notices.append(f"{self.window} is gone; the engine goes on")
            self._owner, self.window = "", ""

    def close(self) -> None:
        """End all connections."""
        for line in tuple(self._new):
            self._drop(line)
        for each in self._fingers.values():
            each.end()
        self._listener.close()

    def __enter__(self) -> "EngineServer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _address(line: MessageSocket) -> str:
    try:
        return str(line.line.getpeername()[0])
    except OSError:
        return "a connection that is gone"
