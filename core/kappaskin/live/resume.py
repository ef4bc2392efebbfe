"""A recording engine that outlives its window, and the next window that resumes it.

The engine without a window listens at the address in a file, with a key that only this user reads.
Nothing is unpickled before both sides have proved that they have the key.
"""

import os
import secrets
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib import metadata
from multiprocessing import AuthenticationError
from multiprocessing.connection import (
    Client,
    Connection,
    Listener,
    answer_challenge,
    deliver_challenge,
)
from pathlib import Path
from pickle import UnpicklingError
from typing import Any, cast

from kappaskin._files import machine_folder
from kappaskin.live.requests import Action, Requested, Update

_LARGEST = 4096  # bytes of a note
_QUEUE = 16  # that may wait to be heard
_KEY = 32  # bytes
_ANSWER = 2.0  # s within which one that is alive answers
_AGAIN = 0.1  # s after a connection without a key
_FOREIGN = (UnpicklingError, AttributeError, ImportError, IndexError, TypeError)
"""What reading the answer of another version may raise."""


@dataclass(frozen=True)
class ResumeInfo:
    """Information that an engine without a window sends to the window that resumes it.

    The state `requested` of it, the names of the `rings` that it writes to, its `pid`, and for how
    long in s it has been `alone`. Of one on another machine, which has none of this, the `place`.
    """

    requested: Requested
    rings: tuple[str, str]
    pid: int
    alone: float
    place: str = ""

    @property
    def lasted(self) -> str:
        """How long it recorded without a window, as text."""
        minutes, seconds = divmod(round(self.alone), 60)
        lasted = f"{minutes} min {seconds} s" if minutes else f"{seconds} s"
        return f"continued for {lasted} after the last window ended"


def resume_folder() -> Path:
    """Folder of the notes of this user's and machine's engines without a window."""
    return machine_folder("left-alone")


def _address(note: Path) -> str:
    """Address of the process that left a note."""
    if os.name == "nt":
        return rf"\\.\pipe\kappaskin-{note.stem}"
    return str(note.with_suffix(".sock"))


class ResumeListener:
    """Waits until another process connects, and sends it `info`; `line` is the connection.

    `sent` is the information sent. An `OSError` where no note can be written to `folder`.
    """

    def __init__(self, folder: Path, info: Callable[[], ResumeInfo]) -> None:
        self.line: Connection[Any, Any] | None = None
        self._info, self._over, key = info, threading.Event(), secrets.token_bytes(_KEY)
        self.sent = info()
        folder.mkdir(0o700, parents=True, exist_ok=True)
        self._note = folder / f"{secrets.token_hex(8)}.note"
        self._listener = Listener(_address(self._note), backlog=_QUEUE, authkey=key)
        try:
            _leave(self._note, key)
        except OSError:
            self._listener.close()
            raise
        self._thread = threading.Thread(target=self._wait, name="resume-listener", daemon=True)
        self._thread.start()

    def _wait(self) -> None:
        line = None
        while line is None and not self._over.is_set():
            try:
                line = cast("Connection[Any, Any]", self._listener.accept())
            except (OSError, EOFError, AuthenticationError):
                self._over.wait(_AGAIN)
        with suppress(OSError):
            self._note.unlink(missing_ok=True)
            self._listener.close()
        if line is not None:
            self.sent = self._info()
            with suppress(OSError):  # it is gone again: whoever reads from it finds out
                line.send(self.sent)
            self.line = line

    def end(self) -> None:
        """Stop listening."""
        self._over.set()
        with suppress(OSError):
            Client(_address(self._note)).close()  # to wake who listens
        self._thread.join(_ANSWER)


def _leave(note: Path, key: bytes) -> None:
    """Write a note whole, that only this user can read."""
    part = note.with_suffix(".part")
    with open(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
        file.write(f"{metadata.version('kappaskin')} {key.hex()}")
    os.replace(part, note)


class ResumedProcess:
    """An engine that another window began, used like a child process of this one.

    It lives as long as the `line` to it.
    """

    def __init__(self, line: "Connection[Update, ResumeInfo]", info: ResumeInfo) -> None:
        self.line, self.info, self.pid = line, info, info.pid

    def is_alive(self) -> bool:
        return not self._over(0.0)

    def join(self, timeout: float | None = None) -> None:
        self._over(timeout)

    def _over(self, timeout: float | None) -> bool:
        """Whether it ended within `timeout` s: only then is there anything to read."""
        try:
            return self.line.poll(timeout)
        except OSError:
            return True

    def kill(self) -> None:
        with suppress(ProcessLookupError):
            os.kill(self.pid, getattr(signal, "SIGKILL", signal.SIGTERM))

    def close(self) -> None:
        self.line.close()


def resume_process(folder: Path) -> ResumedProcess | None:
    """A process that left a note in `folder`, None where there is none.

    Notes of ended processes are removed.
    """
    found = (_reached(note) for note in sorted(folder.glob("*.note")))
    return next((process for process in found if process is not None), None)


def _reached(note: Path) -> ResumedProcess | None:
    """The process that left a `note`; None if it ended, was resumed by another, or is stuck."""
    try:
        version, key = _read(note)
        line = cast("Connection[Update, ResumeInfo]", Client(_address(note)))
    except (OSError, ValueError):
        with suppress(OSError):
            note.unlink(missing_ok=True)
            note.with_suffix(".sock").unlink(missing_ok=True)
        return None
    try:
        if version == metadata.version("kappaskin") and line.poll(_ANSWER):
            answer_challenge(line, key)
            deliver_challenge(line, key)
            if line.poll(_ANSWER):
                return ResumedProcess(line, line.recv())
    except (OSError, EOFError, AuthenticationError, *_FOREIGN):
        pass
    line.close()
    return None


def _read(note: Path) -> tuple[str, bytes]:
    """The version that wrote a note, and its key; a `ValueError` for an invalid note."""
    with note.open("rb") as file:
        version, key = file.read(_LARGEST).decode().split()
    return version, bytes.fromhex(key)


_ALONE = "the window ended unexpectedly while it recorded"


class RequestReceiver:
    """The engine's side: holds what is `requested`, by the `line` to a window, until it is `over`.

    It is over when the window requests it. Where the line ends without that, another window may
    resume the engine that finds a note in `folder`; without a folder, a recording or anybody within
    `patience` s it is over too. That window gets all that is requested, and the names of the
    `rings`.
    """

    def __init__(
        self,
        line: "Connection[Update, Update]",
        rings: tuple[str, str],
        folder: Path | None,
        patience: float,
    ) -> None:
        self._line: Connection[Update, Update] | None = line
        self._rings, self._folder, self._patience = rings, folder, patience
        self.requested, self._since = Requested(), 0.0
        self._listener: ResumeListener | None = None
        self.over = False

    @property
    def resumable(self) -> bool:
        return self._folder is not None and not self.over

    def receive(self, wait: float) -> list[str | Action]:
        """Settings, by name, and actions newly requested within `wait` s."""
        if self._line is None:
            time.sleep(wait)
            return []
        before = self.requested.number
        try:
            while not self.over and self._line.poll(wait):
                self.requested, wait = self.requested.updated(self._line.recv()), 0.0
                self.over = self.requested.over
        except (EOFError, OSError):  # the window ended in the middle of a message
            self._line.close()
            self._line = None
        return self.requested.since(before)

    def check(self, recording: bool) -> str:
        """Change of the window's state since the last check, as text; empty without one."""
        if self.over or self._line is not None:
            return ""
        if self._listener is None:
            return self._listen() if recording else self._end()
        if not recording or time.monotonic() - self._since > self._patience:
            self._listener.end()
            if self._listener.line is None:
                return self._end()
        if self._listener.line is None:
            return ""
        self._line, sent, self._listener = self._listener.line, self._listener.sent, None
        return f"the recording {sent.lasted}"

    def _listen(self) -> str:
        self._since = time.monotonic()
        try:
            if self._folder is not None:
                self._listener = ResumeListener(self._folder, self._info)
                return _ALONE
        except OSError:  # no place for a note: nobody would ever come
            pass
        return self._end()

    def _end(self) -> str:
        self.over = True
        return ""

    def _info(self) -> ResumeInfo:
        alone = time.monotonic() - self._since
        return ResumeInfo(self.requested, self._rings, os.getpid(), alone)
