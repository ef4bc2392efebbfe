"""The operator's process: targets from the window or by UDP, within limits, to a robot by UDP.

The window draws for tens of milliseconds at a time, which targets are not to wait for.
"""

import math
import multiprocessing
import secrets
import signal
import socket
import time
from collections import deque
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection, wait
from typing import Any, cast
from urllib.parse import urlsplit

import numpy as np

from kappaskin._processes import end_with_parent, starting_process
from kappaskin.errors import Refusal
from kappaskin.hand.gamepad import Gamepad
from kappaskin.hand.operation import (
    FOLLOWING,
    OFF,
    RELEASED,
    STALE,
    STALE_TARGET,
    HandTarget,
    OperatorLimits,
    TargetFilter,
    TargetMessage,
    TargetReceiver,
)

_EVERY = 0.004  # s between two targets that are sent while none comes
_LEAST = 0.0005  # s between two that are sent at all
_IDLE = 0.02  # s between two looks at requests while nothing is sent
_AGAIN = 1.0  # s between two tries to open a socket
_AT_ONCE = 256  # datagrams read in one step at most
_BUFFER = 2**18  # bytes that the system keeps until they are read
_READ = 65536
_KEPT = 1024  # latencies that the percentile is taken over
_MOST_WAITING = 4  # requests without an answer: more would fill the pipe


@dataclass(frozen=True)
class OperatorSettings:
    """What an operator is allowed and where targets come from and go.

    Targets come by UDP to the address `listen`, `HOST:PORT`, or where that is empty from a
    `gamepad`, or else from the window. They are sent to `robot`, `HOST:PORT`, unless that is empty.
    A gamepad rumbles with a share `rumble` of the strongest.
    """

    limits: OperatorLimits = field(default_factory=OperatorLimits)
    enabled: bool = False
    listen: str = ""
    gamepad: bool = False
    robot: str = ""
    rumble: float = 0.0


@dataclass(frozen=True)
class OperatorStatus:
    """The present `target`, and whether it is followed or why it is not (`state`).

    `received`, `late` and `refused` count messages that came by UDP, `sent` and `dropped` those to
    the robot; `refusal` says why the last one was refused, `trouble` what is wrong with the gamepad
    or an address. `latency` is the 99th percentile in s from the arrival of a target until it was
    sent.
    """

    target: HandTarget
    state: str = OFF
    received: int = 0
    late: int = 0
    refused: int = 0
    refusal: str = ""
    sent: int = 0
    dropped: int = 0
    trouble: str = ""
    latency: float = math.nan


def _address(text: str) -> tuple[str, int]:
    try:
        place = urlsplit(f"//{text.strip()}")
        host, port = place.hostname, place.port
        if host and port and not (place.path or place.query or place.username):
            return host, port
    except ValueError:
        pass
    raise Refusal(f"expected HOST:PORT such as 127.0.0.1:9875, got {text[:60]!r}")


class _Socket:
    """A UDP socket at an address that may change; tried again where it cannot be opened."""

    def __init__(self, listens: bool) -> None:
        self._listens, self._text, self._again = listens, "", 0.0
        self.opened: socket.socket | None = None
        self.trouble = ""

    def at(self, text: str, now: float) -> socket.socket | None:
        """The socket at the address `text`, or none."""
        if text != self._text:
            self.close()
            self._text, self.trouble, self._again = text, "", now
        if text and self.opened is None and now >= self._again:
            self._again = now + _AGAIN
            try:
                self.opened, self.trouble = self._open(*_address(text)), ""
            except Refusal as refusal:
                self.trouble = str(refusal)
            except (OSError, UnicodeError) as error:
                what = "is not available" if self._listens else "cannot be sent to"
                why = getattr(error, "strerror", None) or error
                self.trouble = f"{text} {what} ({why}); give another address"
        return self.opened

    def _open(self, host: str, port: int) -> socket.socket:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
        family, _, _, _, address = found[0]
        made = socket.socket(family, socket.SOCK_DGRAM)
        try:
            made.setblocking(False)
            if self._listens:
                made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
            (made.bind if self._listens else made.connect)(address)
        except OSError:
            made.close()
            raise
        return made

    def close(self) -> None:
        if self.opened is not None:
            self.opened.close()
            self.opened = None


class OperatorLoop:
    """Takes targets, follows them within limits, and sends them on; begins at `start`."""

    def __init__(
        self,
        start: HandTarget,
        clock: Callable[[], float] = time.monotonic,
        gamepad: Callable[[], Gamepad] = Gamepad,
    ) -> None:
        self._gamepad: Gamepad | None = None
        self._new_gamepad = gamepad
        self._clock, self._settings = clock, OperatorSettings()
        self._filter = TargetFilter(self._settings.limits, replace(start, time=clock()))
        self._receiver = TargetReceiver()
        self._in, self._out = _Socket(listens=True), _Socket(listens=False)
        self._wanted: HandTarget | None = None
        self._wanted_at = self._heard = -math.inf
        self._session, self._sequence = secrets.randbelow(2**31), 0
        self._sent = self._dropped = 0
        self._unsent, self._dropped_at = "", -math.inf
        self._arrived, self._last = math.nan, -math.inf
        self._latencies = deque[float](maxlen=_KEPT)

    def request(self, settings: OperatorSettings, wanted: HandTarget | None) -> OperatorStatus:
        """Have these settings, and follow a target of the window; returns the status.

        `wanted.time` is when it was made, on the monotonic clock.
        """
        if settings.listen != self._settings.listen:
            self._receiver = TargetReceiver()
        self._settings, self._heard = settings, self._clock()
        self._filter.limits = settings.limits
        if not settings.gamepad:
            self._wanted, self._wanted_at = wanted, self._heard
            if wanted is not None and not settings.listen:
                self._arrived = wanted.time
        if settings.gamepad != (self._gamepad is not None):
            self._change_gamepad()
        return self.status

    def _change_gamepad(self) -> None:
        if self._gamepad is not None:
            self._gamepad.close()
        self._gamepad = self._new_gamepad() if self._settings.gamepad else None

    @property
    def status(self) -> OperatorStatus:
        receiver, now = self._receiver, self._clock()
        unsent = self._unsent if now - self._dropped_at < _AGAIN else ""
        device = "" if self._gamepad is None else self._gamepad.trouble
        troubles = (device, self._in.trouble, self._out.trouble, unsent)
        latencies = self._latencies
        return OperatorStatus(
            self._filter.target,
            self._state(now),
            *(receiver.received, receiver.late, receiver.refused, receiver.refusal),
            *(self._sent, self._dropped, next(filter(None, troubles), "")),
            float(np.percentile(latencies, 99)) if latencies else math.nan,
        )

    def _state(self, now: float) -> str:
        if not self._settings.enabled:
            return OFF
        if self._settings.listen:
            return self._receiver.state(now)
        if now - self._wanted_at > STALE:
            return STALE_TARGET
        return RELEASED if self._wanted is None else FOLLOWING

    def sockets(self) -> list[socket.socket]:
        """The sockets to wait for."""
        there = self._in.at(self._settings.listen, self._clock())
        return [] if there is None else [there]

    def due(self) -> float:
        """For how long in s nothing is due."""
        if not math.isnan(self._arrived):
            return max(0.0, self._last + _LEAST - self._clock())
        active = self._settings.enabled or self._settings.robot or self._settings.gamepad
        return max(0.0, self._last + (_EVERY if active else _IDLE) - self._clock())

    def step(self) -> None:
        """Take what has come, and send a target where one is due."""
        self._receive()
        if self.due() > 0:
            return
        now = self._last = self._clock()
        if self._gamepad is not None and not self._settings.listen:
            self._feel(self._gamepad, now)
        following = self._state(now) == FOLLOWING
        wanted = self._receiver.wanted(now) if self._settings.listen else self._wanted
        self._filter.follow(wanted if following else None, now)
        self._send(now, following)
        self._arrived = math.nan

    def _feel(self, gamepad: Gamepad, now: float) -> None:
        """Take the target of the gamepad, and let it rumble while the window says how much."""
        target = self._filter.target
        wanted = gamepad.wanted(target, self._settings.limits, now - target.time)
        self._wanted, self._wanted_at = wanted, now
        gamepad.rumble(self._settings.rumble if now - self._heard <= STALE else 0.0)
        if wanted is not None:
            self._arrived = now

    def _receive(self) -> None:
        for there in self.sockets():
            with suppress(OSError):  # nothing more waits, or of the last message to a port
                for _ in range(_AT_ONCE):
                    data, sender = there.recvfrom(_READ)
                    now = self._clock()
                    if self._receiver.take(data, sender, now, self._settings.limits):
                        self._arrived = now

    def _send(self, now: float, following: bool) -> None:
        """Send the present target to the robot, if there is one."""
        there = self._out.at(self._settings.robot, now)
        if there is None:
            return
        message = TargetMessage(self._filter.target, following, self._session, self._sequence)
        self._sequence += 1
        try:
            there.send(message.encoded())
            self._sent += 1
            if following and not math.isnan(self._arrived):
                self._latencies.append(self._clock() - self._arrived)
        except OSError as error:  # also that nobody received the last one
            self._dropped, self._dropped_at = self._dropped + 1, now
            why = error.strerror or error
            self._unsent = f"{self._settings.robot} does not receive ({why})"

    def close(self) -> None:
        """Tell the robot to hold still, and let go of the addresses."""
        now = self._clock()
        self._filter.follow(None, now)
        self._send(now, following=False)
        self._settings = OperatorSettings()
        self._change_gamepad()
        self._in.close()
        self._out.close()


def _serve(pipe: "Connection[Any, Any]", start: HandTarget) -> None:
    """Answer requests until the pipe is closed; runs in a process of its own."""
    for name in ("SIGINT", "SIGHUP"):  # these are the parent's
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    end_with_parent()
    with closing(OperatorLoop(start)) as loop, suppress(EOFError, OSError):
        while True:
            wait([pipe, *loop.sockets()], loop.due())
            while pipe.poll():
                pipe.send(loop.request(*pipe.recv()))
            loop.step()


class OperatorLink:
    """The operator's process, from the window; it begins at `start`.

    No call waits. The hand holds still when this process ends and, with targets of the window, when
    it stops for 0.1 s.
    """

    def __init__(self, start: HandTarget | None = None) -> None:
        start = start or HandTarget()
        self._status, self._waiting = OperatorStatus(start), 0
        with starting_process() as context:
            ours, theirs = multiprocessing.Pipe()
            self._pipe = cast("Connection[Any, Any]", ours)
            self.process = context.Process(
                target=_serve, args=(theirs, start), name="kappaskin-operator", daemon=True
            )
            self.process.start()
        theirs.close()

    def request(self, settings: OperatorSettings, wanted: HandTarget | None) -> OperatorStatus:
        """Have these settings, and follow `wanted`; returns the newest status.

        To be called at least every 50 ms. A `Refusal` where the process has ended.
        """
        try:
            while self._pipe.poll():
                self._status, self._waiting = self._pipe.recv(), self._waiting - 1
            if self._waiting < _MOST_WAITING:
                self._pipe.send((settings, wanted))
                self._waiting += 1
        except (EOFError, OSError):
            raise Refusal("the operator's process ended unexpectedly; switch it on again") from None
        return self._status

    def close(self) -> None:
        """End the process; the robot is told to hold still."""
        self._pipe.close()
        self.process.join(1.0)
        self.process.kill()
        self.process.join()
        self.process.close()
