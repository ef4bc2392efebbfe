"""Who asks the live process: the one that began it, or while it records one that adopts it."""

import os
import time
from multiprocessing.connection import Connection
from pathlib import Path

from kappaskin.live.requests import Asked, Goodbye, Request, Seek
from kappaskin.live.resume import Left, Waiting

_ALONE = "the window ended unexpectedly while it recorded"


class Asker:
    """Takes requests from the `line` to whoever asks, until that is `over`.

    It is over with a goodbye. Where a line ends without one, another process may take over that
    finds a note in `folder`; without a folder, a recording or anybody within `patience` s it is
    over too. Whoever comes gets all that was asked for, and the names of the `rings`.
    """

    def __init__(
        self,
        line: "Connection[Request, Request]",
        rings: tuple[str, str],
        folder: Path | None,
        patience: float,
    ) -> None:
        self._line: Connection[Request, Request] | None = line
        self._rings, self._folder, self._patience = rings, folder, patience
        self._all, self._since = Asked(), 0.0
        self._waiting: Waiting | None = None
        self.over = False

    @property
    def adoptable(self) -> bool:
        return self._folder is not None and not self.over

    def asked(self, wait: float) -> list[Request]:
        """What was asked for within `wait` s, without places in a source left for another."""
        asked: list[Request] = []
        if self._line is None:
            time.sleep(wait)
            return asked
        try:
            while not self.over and self._line.poll(wait):
                request, wait = self._line.recv(), 0.0
                self.over = isinstance(request, Goodbye)
                if asked and _overtaken(asked[-1], request):
                    asked.pop()
                asked.append(request)
        except (EOFError, OSError):  # the other where it ended in the middle of a request
            self._line.close()
            self._line = None
        for request in asked:
            self._all = self._all.after(request)
        return asked

    def look(self, recording: bool) -> str:
        """What became of whoever asks since the last look, in words; nothing where nothing did."""
        if self.over or self._line is not None:
            return ""
        if self._waiting is None:
            return self._begin_to_wait() if recording else self._end()
        if not recording or time.monotonic() - self._since > self._patience:
            self._waiting.end()
            if self._waiting.line is None:
                return self._end()
        if self._waiting.line is None:
            return ""
        self._line, told, self._waiting = self._waiting.line, self._waiting.told, None
        return f"the recording {told.lasted}"

    def _begin_to_wait(self) -> str:
        self._since = time.monotonic()
        try:
            if self._folder is not None:
                self._waiting = Waiting(self._folder, self._left)
                return _ALONE
        except OSError:  # no place for a note: nobody would ever come
            pass
        return self._end()

    def _end(self) -> str:
        self.over = True
        return ""

    def _left(self) -> Left:
        return Left(self._all, self._rings, os.getpid(), time.monotonic() - self._since)


def _overtaken(before: Request, request: Request) -> bool:
    """Whether nobody would see what was asked `before`: another place in the source follows."""
    if not (isinstance(before, Seek) and isinstance(request, Seek)) or request.at is None:
        return False
    return before.looped is None or request.looped is not None
