"""Rerun transport: estimates to a viewer of Rerun that listens."""

import os
import socket
import threading
import time
from collections import deque

from kappaskin.errors import Refusal
from kappaskin.pipeline import Reported
from kappaskin.publish.message import EstimateMessage, SourceState
from kappaskin.publish.publishing import Receiver, Target, reason
from kappaskin.recording import RerunStream

_MOST = 2000  # messages that wait to be drawn
_AGAIN = 1.0  # s between two tries to reach a viewer, or checks that it is there
_PAUSE = 0.01  # s
_PATIENCE = 1.0  # s for what is left at the end


def opened(target: Target) -> "Rerun":
    """A sender to the viewer at `target`; a `Refusal` without the package, or of no host."""
    _stream(target)  # or refused here
    try:
        socket.getaddrinfo(target.host, target.port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        raise Refusal(
            f"{target}: the host {target.host} is not known ({reason(error)}); give another "
            "name, or its address"
        ) from error
    return Rerun(target)


def _stream(target: Target) -> RerunStream:
    # All fingers of a hand, each of which has a process, are in one recording of the viewer.
    name = f"hand-{os.getppid()}" if target.finger else ""
    return RerunStream(str(target), name, target.finger)


class Rerun:
    """Sends to a viewer in a thread of its own; while none listens, messages are dropped."""

    notices, cue = (), None

    def __init__(self, target: Target) -> None:
        self._target, self._waiting = target, deque[EstimateMessage](maxlen=_MOST)
        self._sent = self._dropped = 0
        self._trouble, self._closed = "opening", False
        self._out: RerunStream | None = None
        self._next_check = 0.0
        self._thread = threading.Thread(target=self._run, name="rerun", daemon=True)
        self._thread.start()

    @property
    def receivers(self) -> tuple[Receiver, ...]:
        return (Receiver(str(self._target), self._sent, self._dropped, self._trouble),)

    @property
    def counts(self) -> tuple[int, int]:
        return self._sent, self._dropped

    def send(self, message: EstimateMessage) -> None:
        if self._out is None or len(self._waiting) == _MOST:
            self._dropped += 1
        else:
            self._waiting.append(message)

    def report(self, state: SourceState) -> None:
        """Nothing: a viewer has the estimates alone."""

    def close(self) -> None:
        self._closed = True
        self._thread.join()

    def _run(self) -> None:
        while not self._closed:
            self._check()
            self._send()
            time.sleep(_PAUSE)
        self._send()
        self._disconnect()

    def _send(self) -> None:
        while self._out is not None and self._waiting:
            message = self._waiting.popleft()
            reported = Reported(message.estimate, message.fit)
            self._out.take(message.timestamp, reported, message.pipeline)
            self._sent += 1

    def _check(self) -> None:
        """Connect where a viewer listens, and disconnect where none does any more."""
        if time.monotonic() < self._next_check:
            return
        self._next_check = time.monotonic() + _AGAIN
        place = self._target.host, self._target.port
        try:
            socket.create_connection(place, _AGAIN).close()
        except OSError as error:
            self._trouble = f"no viewer listens there: {reason(error)}"
            self._disconnect()
            return
        if self._out is None:
            made = _stream(self._target)
            host = f"[{place[0]}]" if ":" in place[0] else place[0]
            made.stream.connect_grpc(f"rerun+http://{host}:{place[1]}/proxy")
            self._out = made
        self._trouble = ""

    def _disconnect(self) -> None:
        out, self._out = self._out, None
        if out is not None:
            if not self._trouble:
                try:
                    out.flush(_PATIENCE)
                except OSError as error:
                    self._trouble = str(error)
            out.stream.disconnect()
