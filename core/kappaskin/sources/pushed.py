"""Pushed readings: those of another program of this user, over a local socket.

The socket sends the information text of the sensor once, then binary records of values.
"""

import os
import re
import select
import socket
import struct
import threading
import time as clock
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from kappaskin._files import machine_folder
from kappaskin.errors import Refusal, SourceError
from kappaskin.sources.decoder import SEQUENCES
from kappaskin.sources.description import (
    Description,
    described_text,
    description_of,
    load_description,
    of_values,
)
from kappaskin.sources.information import sensor_from_json
from kappaskin.sources.inputs import Input
from kappaskin.sources.lines import BinaryDecoder

FEED = "feed:"
"""Scheme of readings that another program pushes, followed by the name of its feed."""

_NAME = re.compile(r"[A-Za-z0-9_-]{1,24}")  # the path of a socket may have some 100 characters
_HEAD = struct.Struct("<16sI")  # of what is sent first: what this is, and the bytes of the text
_MAGIC = b"kappaskin feed 1"
_LARGEST = 2**24  # bytes of the text
_WAITING = 64  # records that wait for a receiver at most, beside what the system holds
_HELD = 2**14  # bytes that the system is to hold
_ANSWER, _LAST, _WAIT = 2.0, 1.0, 0.1  # s for the text, for what waits at the end, for a read
_BLOCK = 2**16
_LATEST = 1e11  # s since 1970: some three thousand years


class Feed:
    """Pushes readings of the sensor that a file describes to whoever receives `feed:NAME`.

    `push` never waits. Of the records that a receiver has not taken, the oldest are dropped;
    `dropped` counts these, and those that nobody received. Raises a `Refusal` for an invalid name
    or description, or where another program has a feed of this name.
    """

    def __init__(self, name: str, sensor: str | os.PathLike[str]) -> None:
        description = load_description(Path(sensor))
        values = of_values(description)
        self._record = cast("BinaryDecoder", values.decoder()).record
        self._columns, self._timed = len(description.columns), description.columns.time >= 0
        text = described_text(values.sensor).encode()
        self._greeting = _HEAD.pack(_MAGIC, len(text)) + text
        self._pushed = self.dropped = 0
        self._lock, self._receivers = threading.Lock(), list[_Receiver]()
        self._path = _path_of(name)
        self._listener: socket.socket | None = _listening(name, self._path)
        args = (self._listener,)
        self._thread = threading.Thread(target=self._accept, args=args, name="feed", daemon=True)
        self._thread.start()

    def push(self, values: ArrayLike, time: float | None = None) -> None:
        """Push the numbers of one record, in the order of the description's `columns`.

        `values` (N,) are as the device would send them; NaN is a missing one. `time` is when they
        were read, in s as of `time.time()`; now if left out, and not given where a column has it.
        Raises a `Refusal` for another number of values, an invalid time, or after `close`.
        """
        if self._listener is None:
            raise Refusal("expected an open feed, but this one was closed; make another")
        numbers = np.asarray(values, float)
        if numbers.shape != (self._columns,):
            raise Refusal(
                f"expected {self._columns} values, one for each column of the description, got an "
                f"array of shape {numbers.shape}"
            )
        if time is not None and self._timed:
            raise Refusal("expected no time: a column of the description has it; leave it out")
        stamp = clock.time() if time is None else float(time)
        if not 0 <= stamp < _LATEST:
            raise Refusal(f"expected a time in s since 1970, as of time.time(), got {time}")
        with self._lock:
            record = self._record([self._pushed % SEQUENCES, stamp, *numbers.tolist()])
            self._pushed += 1
            for receiver in self._receivers:
                self.dropped += receiver.send(record)
            self._receivers = [each for each in self._receivers if each.open]
            self.dropped += not self._receivers

    def _accept(self, listener: socket.socket) -> None:
        """Greet each receiver, until the feed is closed."""
        while True:
            try:
                connection = listener.accept()[0]
            except OSError:  # closed
                return
            with self._lock:
                if self._listener is None:
                    connection.close()
                    return
                self._receivers.append(_Receiver(connection, self._greeting))

    def close(self) -> None:
        """End the feed, once what waits is sent or a second has passed."""
        with self._lock:
            listener, self._listener = self._listener, None
            if listener is None:
                return
            end = clock.monotonic() + _LAST
            for receiver in self._receivers:
                receiver.end(end)
        self._path.unlink(missing_ok=True)
        with suppress(OSError):
            listener.shutdown(socket.SHUT_RDWR)  # wakes who accepts
        listener.close()
        self._thread.join(_LAST)

    def __enter__(self) -> "Feed":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def feed(name: str, sensor: str | os.PathLike[str]) -> Feed:
    """Opens the feed `name`, which pushes readings of the sensor that the file `sensor` describes.

    A running app shows them by `kappaskin app --source feed:NAME`. Raises as `Feed` does.
    """
    return Feed(name, sensor)


class _Receiver:
    """A receiver and the records that wait for it; `open` until it is gone."""

    def __init__(self, connection: socket.socket, greeting: bytes) -> None:
        connection.setblocking(False)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _HELD)
        self._connection, self._part, self.open = connection, greeting, True
        self._waiting = deque[bytes](maxlen=_WAITING)
        self._flush()

    def send(self, record: bytes) -> int:
        """Send what waits and this record, as far as is possible; how many were dropped."""
        dropped = int(len(self._waiting) == _WAITING)
        self._waiting.append(record)
        self._flush()
        return dropped

    def _flush(self) -> None:
        try:
            while self._part or self._waiting:
                self._part = self._part or self._waiting.popleft()
                self._part = self._part[self._connection.send(self._part) :]
        except BlockingIOError:
            pass
        except OSError:
            self._connection.close()
            self.open = False

    def end(self, end: float) -> None:
        """Send what waits until the time `end`, and close."""
        while self.open and (self._part or self._waiting):
            if not select.select([], [self._connection], [], max(0.0, end - clock.monotonic()))[1]:
                break
            self._flush()
        self._connection.close()


def _path_of(name: str) -> Path:
    if not _NAME.fullmatch(name):
        raise SourceError(
            "expected a name of a feed of at most 24 letters, digits, - or _, such as glove; got "
            f"{name!r:.60}"
        )
    if not hasattr(socket, "AF_UNIX"):
        raise SourceError("feeds need sockets of the Unix domain, which this system does not have")
    return machine_folder("feeds") / f"{name}.sock"


def _listening(name: str, path: Path) -> socket.socket:
    """A socket that listens at `path`, in a folder that only this user may enter."""
    with suppress(SourceError):
        _joined(name)[0].close()
        raise Refusal(f"another program has a feed {name!r}; choose another name, or end it")
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        path.parent.mkdir(0o700, parents=True, exist_ok=True)
        path.parent.chmod(0o700)
        path.unlink(missing_ok=True)  # of a program that was ended by force
        listener.bind(str(path))
        listener.listen()
    except OSError as error:
        listener.close()
        raise Refusal(f"{path}: cannot listen there ({error.strerror or error})") from error
    return listener


def _joined(name: str) -> tuple[socket.socket, str]:
    """A connection to the feed, and the information text that it began with."""
    path, connection = _path_of(name), socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.settimeout(_ANSWER)
    try:
        connection.connect(str(path))
        magic, size = _HEAD.unpack(_exactly(connection, _HEAD.size))
        if magic == _MAGIC and size <= _LARGEST:
            return connection, _exactly(connection, size).decode()
        why = "another version of this program feeds it, or something else; update the older"
    except (OSError, UnicodeDecodeError):
        why = f"no program feeds it; start one with kappaskin.feed({name!r}, ...)"
    connection.close()
    raise SourceError(f"{FEED}{name}: {why}")


def _exactly(connection: socket.socket, size: int) -> bytes:
    data = bytearray()
    while len(data) < size:
        if not (more := connection.recv(size - len(data))):
            raise OSError("it ended")
        data += more
    return bytes(data)


def fed_description(name: str) -> Description:
    """The description of what the feed `name` pushes; a `SourceError` where there is none."""
    connection, text = _joined(name)
    connection.close()
    sensor = sensor_from_json(text)
    return description_of(sensor.description, sensor.name, sensor.serial_number)


class FedInput(Input):
    """The records of the feed in a URL `feed:NAME`, of the sensor with this `description`."""

    patient = False
    lost = "the program that feeds it ended; start it again to continue"

    def __init__(self, url: str, description: Description, read: Callable[[], float]) -> None:
        super().__init__(read)
        self._connection, text = _joined(url.removeprefix(FEED))
        if text != described_text(description.sensor):
            self._connection.close()
            raise SourceError(f"{url}: it is of another sensor than before; connect again")

    def arriving(self) -> tuple[float, bytes]:
        if not select.select([self._connection], [], [], _WAIT)[0]:
            return self._clock(), b""
        if not (data := self._connection.recv(_BLOCK)):
            raise OSError("the feed ended")
        return self._clock(), data

    def close(self) -> None:
        self._connection.close()
