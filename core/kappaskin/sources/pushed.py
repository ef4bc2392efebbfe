"""Pushed readings: those of another program of this user, over a local socket.

The socket sends the information text of the sensor once, then binary records of values.
"""

import math
import os
import re
import selectors
import socket
import struct
import threading
import time as clock
import weakref
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from kappaskin._files import machine_folder
from kappaskin.errors import Refusal, SourceError
from kappaskin.frames import Array
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
from kappaskin.sources.ports import Port

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
_LOCK = ".lock"  # ending of the file that is locked while there is a feed
_LATEST = 1e11  # s since 1970: some three thousand years


class Feed:
    """Pushes readings of the sensor that a file describes to whoever receives `feed:NAME`.

    `push` never waits. Of the records that a receiver has not taken, the oldest are dropped;
    `dropped` counts these, and those that nobody received. It belongs to the process that opened
    it. Raises a `Refusal` for an invalid name or description, or where there is a feed of that
    name.
    """

    def __init__(self, name: str, sensor: str | os.PathLike[str]) -> None:
        description = load_description(Path(sensor))
        values = of_values(description)
        self._record = cast("BinaryDecoder", values.decoder()).record
        columns = description.columns
        self._columns, self._timed = len(columns), columns.time >= 0
        self._counts = [place for place in (columns.time, columns.sequence) if place >= 0]
        text = described_text(values.sensor).encode()
        self._pushed = 0
        self._server = _Server(name, _HEAD.pack(_MAGIC, len(text)) + text)
        self._end = weakref.finalize(self, self._server.end)

    @property
    def dropped(self) -> int:
        return self._server.dropped

    def push(self, values: ArrayLike, time: float | None = None) -> None:
        """Push the numbers of one record, in the order of the description's `columns`.

        `values` (N,) are as the device would send them; NaN, or a masked one, is missing. `time` is
        when they were read, in s as of `time.time()`; now if left out, and not given where a column
        has it. Raises a `Refusal` for another number of values, what is no real number, an invalid
        time or sequence number, after `close`, and in another process.
        """
        numbers = _real_numbers(values)
        if numbers.shape != (self._columns,):
            raise Refusal(
                f"expected {self._columns} values, one for each column of the description, got an "
                f"array of shape {numbers.shape}"
            )
        if time is not None and self._timed:
            raise Refusal("expected no time: a column of the description has it; leave it out")
        stamp = clock.time() if time is None else float(_real_numbers(time))
        if not 0 <= stamp < _LATEST:
            raise Refusal(f"expected a time in s since 1970, as of time.time(), got {time}")
        if not np.all((numbers[self._counts] >= 0) & (numbers[self._counts] < 2.0**63)):
            raise Refusal(
                f"expected times and sequence numbers of 0 or more, got {numbers[self._counts]}"
            )
        with self._server.lock:
            record = self._record([self._pushed % SEQUENCES, stamp, *numbers.tolist()])
            self._server.send(record)
            self._pushed += 1

    def close(self) -> None:
        """End the feed, once what waits is sent or a second has passed."""
        self._end()

    def __enter__(self) -> "Feed":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _real_numbers(values: ArrayLike) -> Array:
    try:
        if np.iscomplexobj(values):
            raise TypeError("complex numbers")
        return np.ma.filled(np.ma.asarray(values, float), math.nan)
    except (TypeError, ValueError, OverflowError) as error:
        raise Refusal(f"expected real numbers, got {values!r:.80} ({error})") from error


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
        self.connection, self._part, self.open = connection, greeting, True
        self._waiting = deque[bytes](maxlen=_WAITING)

    @property
    def waits(self) -> int:
        """How many records wait, and the one that is sent in part."""
        return len(self._waiting) + bool(self._part)

    def send(self, record: bytes) -> int:
        """Send what waits and this record, as far as is possible; how many were dropped."""
        dropped = int(len(self._waiting) == _WAITING)
        self._waiting.append(record)
        return dropped + max(self.flush() - 1, 0)  # who is gone waits for no further one

    def flush(self) -> int:
        """Send what waits, as far as is possible; how many are dropped as it is gone."""
        try:
            while self._part or self._waiting:
                self._part = self._part or self._waiting.popleft()
                self._part = self._part[self.connection.send(self._part) :]
        except BlockingIOError:
            pass
        except OSError:
            return self.close()
        return 0

    def gone(self) -> bool:
        """Whether the other end was closed: it never sends anything."""
        try:
            return not self.connection.recv(_BLOCK)
        except BlockingIOError:
            return False
        except OSError:
            return True

    def end(self, end: float) -> int:
        """Send what waits until the time `end`, and close; how many were dropped."""
        while self.open and self.waits and (left := end - clock.monotonic()) > 0:
            with selectors.DefaultSelector() as selector:
                selector.register(self.connection, selectors.EVENT_WRITE)
                selector.select(left)
            if dropped := self.flush():
                return dropped
        return self.close()

    def close(self) -> int:
        """Close it; how many records waited."""
        self.connection.close()
        self.open = False
        return self.waits


class _Server:
    """The socket of a feed, and a thread that greets its receivers and sends what waits for them.

    What is sent without waiting is sent by whoever pushes. `over` once it is closed.
    """

    def __init__(self, name: str, greeting: bytes) -> None:
        # Again by the thread that has it, where a feed without `close` is collected.
        self.lock, self.dropped = threading.RLock(), 0
        self._greeting, self._receivers, self.over = greeting, list[_Receiver](), False
        self._path = _path_of(name)
        self._mark, self._listener = _listening(name, self._path)
        self._selector, (self._wake, woken) = selectors.DefaultSelector(), socket.socketpair()
        self._woken = woken
        for each in (self._listener, woken):
            self._selector.register(each, selectors.EVENT_READ)
        _SERVERS.add(self)
        self._thread = threading.Thread(target=self._serve, name="feed", daemon=True)
        self._thread.start()

    def send(self, record: bytes) -> None:
        """Send a record to each receiver; `lock` is held."""
        if self.over:
            raise Refusal(
                "expected an open feed of this process, but it was closed, or opened before a "
                "fork; make another"
            )
        for receiver in self._receivers:
            self.dropped += receiver.send(record)
            self._watch(receiver)
        self._keep_open()
        self.dropped += not self._receivers

    def _watch(self, receiver: _Receiver) -> None:
        """Wait until it is gone, and for room where records wait for it."""
        if receiver.open:
            events = selectors.EVENT_READ | bool(receiver.waits) * selectors.EVENT_WRITE
            if self._selector.get_key(receiver.connection).events != events:
                self._selector.modify(receiver.connection, events, receiver)

    def _keep_open(self) -> None:
        """Forget the receivers that are gone."""
        if not all(each.open for each in self._receivers):
            kept = [each for each in self._receivers if each.open]
            for each in self._receivers:
                if not each.open:
                    self._selector.unregister(each.connection)
            self._receivers = kept

    def _serve(self) -> None:
        while True:
            ready = self._selector.select()
            with self.lock:
                if self.over:
                    return
                refused = any(key.fileobj is self._listener for key, _ in ready) and self._refuses()
                for key, events in ready:
                    if isinstance(receiver := key.data, _Receiver) and receiver.open:
                        if events & selectors.EVENT_READ and receiver.gone():
                            self.dropped += receiver.close()
                        else:
                            self.dropped += receiver.flush()
                        self._watch(receiver)
                self._keep_open()
            if refused:
                clock.sleep(_WAIT)

    def _refuses(self) -> bool:
        """Greet another receiver; True where the system allows none, perhaps for a moment."""
        try:
            connection = self._listener.accept()[0]
        except OSError:
            return True
        receiver = _Receiver(connection, self._greeting)
        self._selector.register(connection, selectors.EVENT_READ, receiver)
        self._receivers.append(receiver)
        self.dropped += receiver.flush()
        self._watch(receiver)
        return False

    def end(self) -> None:
        """Close all, once what waits is sent or a second has passed."""
        with self.lock:
            if self.over:
                return
            self.over = True
            self._path.unlink(missing_ok=True)
            end = clock.monotonic() + _LAST
            self.dropped += sum(receiver.end(end) for receiver in self._receivers)
        self._wake.close()  # the thread ends
        if threading.current_thread() is not self._thread:
            self._thread.join()
        self._path.with_suffix(_LOCK).unlink(missing_ok=True)
        self.forget()

    def forget(self) -> None:
        """Close the files of this process, as a copy of another's, and nothing else."""
        self.over = True
        for each in (self._listener, self._woken, self._wake, self._selector):
            each.close()
        for receiver in self._receivers:
            receiver.connection.close()
        os.close(self._mark)


_SERVERS = weakref.WeakSet[_Server]()


def _forget_all() -> None:
    """In a process that was forked: the feeds are those of the other one."""
    for server in list(_SERVERS):
        server.lock = threading.RLock()  # perhaps held by a thread that is not here
        if not server.over:
            server.forget()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_all)


def _path_of(name: str) -> Path:
    if not (isinstance(name, str) and _NAME.fullmatch(name)):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise SourceError(
            "expected a name of a feed of at most 24 letters, digits, - or _, such as glove; got "
            f"{name!r:.60}"
        )
    if not hasattr(socket, "AF_UNIX"):
        raise SourceError("feeds need sockets of the Unix domain, which this system does not have")
    return machine_folder("feeds") / f"{name}.sock"


def _listening(name: str, path: Path) -> tuple[int, socket.socket]:
    """A socket that listens at `path`, in a folder that only this user may enter.

    And the file whose lock says that it is in use.
    """
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        path.parent.mkdir(0o700, parents=True, exist_ok=True)
        path.parent.chmod(0o700)
        mark = _locked(name, path.with_suffix(_LOCK))
    except BaseException:
        listener.close()
        raise
    try:
        path.unlink(missing_ok=True)  # of a program that was ended by force
        listener.bind(str(path))
        listener.listen()
        listener.setblocking(False)
    except OSError as error:
        listener.close()
        os.close(mark)
        raise Refusal(f"{path}: cannot listen there ({error.strerror or error})") from error
    return mark, listener


def _locked(name: str, path: Path) -> int:
    """The file at `path`, locked by this process; a `Refusal` where another has it."""
    import fcntl  # not on Windows, where there are no feeds

    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(file)
            raise Refusal(
                f"there is a feed {name!r} already, in this program or another; close it, or "
                "choose another name"
            ) from error
        if path.exists() and os.path.samestat(os.fstat(file), path.stat()):
            return file
        os.close(file)  # removed meanwhile, by the one that had it


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


def feeds_found() -> list[Port]:
    """The feeds of this user's programs, each as a port with the sensor that it is of."""
    found: list[Port] = []
    for path in sorted(machine_folder("feeds").glob("*.sock")):
        with suppress(Refusal, OSError):
            found.append(_as_port(path.stem, path.stat().st_mtime_ns))
    return found


@cache  # each feed is joined once, as one that is joined counts the readings that are not taken
def _as_port(name: str, _: int) -> Port:
    sensor = fed_description(name).sensor
    return Port(f"{FEED}{name}", sensor.name, serial_number=sensor.serial_number)


class FedInput(Input):
    """The records of the feed in a URL `feed:NAME`, of the sensor with this `description`."""

    patient = False
    silence = "the program that feeds it pushes nothing"
    lost = "the program that feeds it ended; start it again to continue"

    def __init__(self, url: str, description: Description, read: Callable[[], float]) -> None:
        super().__init__(read)
        self._connection, text = _joined(url.removeprefix(FEED))
        if text != described_text(description.sensor):
            self._connection.close()
            raise SourceError(f"{url}: it is of another sensor than before; connect again")
        self._connection.settimeout(_WAIT)

    def arriving(self) -> tuple[float, bytes]:
        try:
            data = self._connection.recv(_BLOCK)
        except TimeoutError:
            return self._clock(), b""
        if not data:
            raise OSError("the feed ended")
        return self._clock(), data

    def close(self) -> None:
        self._connection.close()
