"""MCAP writer in a separate thread; of a hand in a process, to which those of fingers send."""

import itertools
import math
import multiprocessing
import secrets
import shlex
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib import metadata
from multiprocessing import AuthenticationError
from multiprocessing.connection import Client, Connection, Listener, wait
from pathlib import Path
from typing import Any, cast

from mcap.writer import CompressionType, Writer

from kappaskin._processes import starting_process
from kappaskin.errors import Refusal
from kappaskin.frames import Event
from kappaskin.pipeline import REVISION
from kappaskin.recording.disk import ReservedFile, is_there
from kappaskin.recording.messages import EVENTS, LINES, TOPICS, Topic, pack_event, pack_line

FORMAT, HAND_FORMAT = 1, 2
"""Versions of the meaning of our own messages: of a file without, and with, names of fingers."""

VERSION = metadata.version("kappaskin")
PROGRAM = f"kappaskin {VERSION}"
"""What recordings and exported files are made by."""

_FLUSH = 0.1  # s between two times that all there is goes to the file: what a killed process loses
_SYNC = 2.0  # s between two times that the file goes to the disk: what a loss of power takes
_CHUNK = 2**20  # bytes
_BACKLOG = 2**26  # bytes that may wait for the disk
_WAIT = 0.01  # s
_EACH = 128  # bytes of memory for each message in addition to its own
_SUMMED = 512  # bytes of the end of the file for each chunk
_UNDATED = 0
_KEY = 32  # bytes
_SILENT = 5.0  # s that a finger may take to end, each of which sends every 0.1 s
_DIED = "the engine process ended unexpectedly; its last 0.1 s are missing"
_WRITER = "the process that writes the recording"


@dataclass(frozen=True)
class RecordingStatus:
    """State of a recording: its path, duration in s, and size.

    `path` is empty where none was asked for. `lost` counts messages that found too many waiting for
    the disk. `trouble` says why it ended before it was asked to, or does not begin. Of a `finger`
    it is the part of that in the file, and its size is not known.
    """

    path: str = ""
    active: bool = False
    seconds: float = 0.0
    size: int = 0
    messages: int = 0
    lost: int = 0
    trouble: str = ""
    finger: str = ""

    def broken_off(self, by: str = "the engine process") -> "RecordingStatus":
        """The same where the process that was writing it has ended."""
        path = Path(self.path)
        # Another process writes that of a hand; or the file is complete by now.
        if not self.active or self.finger or path.exists():
            return replace(self, active=False)
        trouble = (
            f"the recording {path.name} broke off: {by} ended unexpectedly; "
            f"`{repair_command(path)}` completes the file"
        )
        return replace(self, active=False, trouble=trouble)


class RecordingQueue:
    """Messages that wait to be written by a thread, those of a recording to be at `path`.

    Time 0 is `zero` in ns since 1970. `put` and `attach` never wait; `written` is the state of it.
    """

    def __init__(self, path: Path, zero: int) -> None:
        self.path, self._zero = path, zero
        self._began = time.monotonic()
        self._waiting: deque[tuple[str, float, bytes]] = deque()
        self._attachments: deque[tuple[str, str, bytes]] = deque()
        self._put = self._taken = 0  # bytes: each counted by one thread only
        self.written = RecordingStatus(str(path), active=True)
        self._lost = 0
        self._closing = threading.Event()
        self._threads: list[threading.Thread] = []

    def _start(self, **work: Callable[[], None]) -> None:
        """Start a thread of each name."""
        for name, target in work.items():
            thread = threading.Thread(target=target, name=name.replace("_", "-"), daemon=True)
            self._threads.append(thread)
            thread.start()

    def stamp(self, time: float) -> int:
        """Nanoseconds since 1970 at `time` in s on the monotonic clock."""
        return self._zero + round(time * 1e9)

    def wait(self) -> None:
        """Wait until so much has been written that none of what comes next is lost."""
        while self._put - self._taken > _BACKLOG // 2 and self.written.active:
            time.sleep(_WAIT)

    def put(self, topic: Topic, time: float, data: bytes) -> None:
        """Write a message that belongs to `time` in s on the monotonic clock."""
        if not self.written.active:
            return
        if self._put - self._taken > _BACKLOG:
            self._lost += 1
            return
        self._put += len(data) + _EACH
        self._waiting.append((topic.name, time, data))

    def attach(self, name: str, kind: str, data: bytes) -> None:
        """Attach a file `name` of a media type `kind`."""
        self._attachments.append((name, kind, data))

    def _report(self, messages: int, size: int) -> None:
        """So many more messages were written, and so many bytes in all."""
        seconds, messages = time.monotonic() - self._began, self.written.messages + messages
        written = replace(self.written, seconds=seconds, size=size, messages=messages)
        self.written = replace(written, lost=self._lost)

    def _stop(self, trouble: str) -> None:
        self.written = replace(self.written, active=False, trouble=trouble)

    def end(self) -> None:
        """Let what waits be written, and the file ended."""
        self._closing.set()

    def close(self) -> None:
        """End the file, and wait until it is on the disk."""
        self.end()
        for thread in self._threads:
            thread.join()


class RecordingFile(RecordingQueue):
    """A recording at `path`, called `path` + `.part` until it is closed.

    The file is opened by `disk`. Time 0 is `zero` in ns since 1970, by default that of the
    monotonic clock. It has the channels of each of the `fingers`. One that ends by itself, as on a
    full disk, is closed as one that is asked to.
    """

    def __init__(
        self,
        path: Path,
        disk: Callable[[Path], ReservedFile] = ReservedFile,
        zero: int | None = None,
        fingers: Sequence[str] = ("",),
    ) -> None:
        super().__init__(path, wall_zero() if zero is None else zero)
        self.part, self._fingers = part_of(path), fingers
        for there in (self.path, self.part):
            if is_there(there):
                raise Refusal(
                    f"{there}: already exists; choose another name"
                    + (f", or see `kappaskin repair {there}`" if there == self.part else "")
                )
        self._disk = disk(self.part)
        self._channels: dict[str, int] = {}
        self._sequences = Counter[int]()
        self._writer = Writer(self._disk.stream, _CHUNK, CompressionType.LZ4)
        try:
            self._begin()
        except OSError as error:
            self._disk.close()
            self.part.unlink(missing_ok=True)
            raise Refusal(f"{path}: cannot be written ({error.strerror or error})") from error
        self._start(recorder=self._work, recorder_sync=self._sync)

    def _begin(self) -> None:
        self._writer.start("ros2", PROGRAM)
        schemas: dict[str, int] = {}
        for name, kind in (topic.of(finger) for finger in self._fingers for topic in TOPICS):
            if kind.name not in schemas:
                schema = self._writer.register_schema(kind.name, "ros2msg", kind.definition)
                schemas[kind.name] = schema
            channel_metadata = {"offered_qos_profiles": ""}
            self._channels[name] = self._writer.register_channel(
                name, "cdr", schemas[kind.name], channel_metadata
            )
        named = ",".join(filter(None, self._fingers))
        made_by = {"format": str(HAND_FORMAT if named else FORMAT), "version": VERSION}
        made_by |= {"revision": str(REVISION)} | ({"fingers": named} if named else {})
        self._writer.add_metadata("kappaskin", made_by)

    def _work(self) -> None:
        """Write waiting messages now and then, until the end is requested."""
        try:
            while not (self._closing.wait(_FLUSH) or self._disk.trouble):
                self._write()
                if not self._disk.there:
                    raise OSError("it was moved or removed")
            if not self._disk.trouble:
                self._write()
            self._writer.finish()
            self._finish()
        except OSError as error:
            self._stop(f"{self.part}: {error.strerror or error}")
        self._disk.close()

    def _write(self) -> None:
        writer, channels, sequences = self._writer, self._channels, self._sequences
        for _ in range(len(self._attachments)):
            name, kind, data = self._attachments.popleft()
            writer.add_attachment(_UNDATED, self.stamp(time.monotonic()), name, kind, data)
        count = len(self._waiting)
        for _ in range(count):
            name, at, data = self._waiting.popleft()
            channel, stamp = channels[name], self.stamp(at)
            writer.add_message(channel, stamp, data, stamp, sequences[channel])
            sequences[channel] += 1
            self._taken += len(data) + _EACH
        writer.flush()
        size, seconds = self._disk.tell(), self.written.seconds
        self._disk.reserve(_SUMMED * (size // _CHUNK + int(seconds / _FLUSH)))
        self._report(count, size)

    def _finish(self) -> None:
        """Rename the complete file."""
        self._disk.sync()
        if self.path.exists():
            raise OSError(f"{self.path.name} has been created meanwhile")
        self.part.rename(self.path)
        trouble = self._disk.trouble
        self._stop(f"{self.path}: {trouble}; it is complete up to that time" if trouble else "")

    def _sync(self) -> None:
        """Flush to the disk; in a thread of its own, since this may take long."""
        while not self._closing.wait(_SYNC) and self.written.active:
            try:
                self._disk.sync()
            except (OSError, ValueError):  # closed meanwhile
                return


def wall_zero() -> int:
    """Zero of the monotonic clock in ns since 1970.

    Read once for a file, so that a wall clock that is set does not reorder messages.
    """
    return time.time_ns() - time.monotonic_ns()


@dataclass(frozen=True)
class HandPart:
    """The part of one `finger` in the recording of a hand at `path`, as a process writes it.

    The process that writes the file listens at `address` for those that have the `key`. Time 0 is
    `zero` in ns since 1970, for every finger.
    """

    path: Path
    finger: str
    address: str
    key: bytes
    zero: int

    def __fspath__(self) -> str:
        return str(self.path)


class HandLine(RecordingQueue):
    """Sends what is recorded of one finger to the process that writes the recording of the hand."""

    def __init__(self, part: HandPart) -> None:
        super().__init__(part.path, part.zero)
        self._part = part
        self.written = replace(self.written, finger=part.finger)
        self._start(recorder=self._work)

    def _work(self) -> None:
        try:
            with Client(self._part.address, authkey=self._part.key) as made:
                line = cast("Connection[Any, Any]", made)
                line.send(self._part.finger)
                while not self._closing.wait(_FLUSH):
                    self._send(line)
                self._send(line)
                line.send(None)
            self._stop("")
        except (OSError, EOFError, AuthenticationError):
            self._stop(f"{self.path.name}: {_WRITER} has ended")

    def _send(self, line: "Connection[Any, Any]") -> None:
        """Send what waits."""
        files = [self._attachments.popleft() for _ in range(len(self._attachments))]
        messages = [self._waiting.popleft() for _ in range(len(self._waiting))]
        line.send((files, messages))
        self._taken += sum(len(data) + _EACH for _, _, data in messages)
        self._report(len(messages), self.written.size)


class HandRecorder:
    """The process that writes the recording of a hand with these `fingers` to `path`.

    It goes on when a finger's process has ended, also when all have, until `end`; or when this
    process has ended, until the last of theirs has. Then the file is whole, also where one of them
    hangs. A `Refusal` where none can be made.
    """

    def __init__(self, path: Path, fingers: Sequence[str]) -> None:
        self.path, self._key, self._zero = path, secrets.token_bytes(_KEY), wall_zero()
        self.written, self._asked = RecordingStatus(str(path), active=True), False
        about = path, tuple(fingers), self._key, self._zero
        with starting_process() as context:
            ours, theirs = multiprocessing.Pipe()
            self._pipe = cast("Connection[Any, Any]", ours)
            self._process = context.Process(
                target=_write_hand, args=(theirs, *about), name="kappaskin-recorder", daemon=True
            )
            self._process.start()
        theirs.close()
        self._address = self._answer()

    def _answer(self) -> str:
        try:
            answer = self._pipe.recv()
        except (EOFError, OSError):
            answer = Refusal(f"{self.path}: {_WRITER} ended unexpectedly; try again")
        if isinstance(answer, Refusal):
            self._process.join()
            raise answer
        return answer

    def part(self, finger: str) -> HandPart:
        """What the process of a `finger` needs to record."""
        return HandPart(self.path, finger, self._address, self._key, self._zero)

    def poll(self) -> RecordingStatus:
        """The state of the file, as it was when it was last asked for; it never waits."""
        try:
            while self._pipe.poll():
                self.written, self._asked = self._pipe.recv(), False
            if self.written.active and not self._asked:  # once: a full pipe would hold up the file
                self._pipe.send(True)
                self._asked = True
        except (EOFError, OSError):
            self.written = self.written.broken_off(_WRITER)
        return self.written

    def end(self) -> None:
        """Let the file be ended once no finger writes to it any more."""
        with suppress(OSError):
            self._pipe.send(None)

    def close(self, within: float = math.inf) -> None:
        """End the file, and wait until it is on the disk, for `within` s at most."""
        self.end()
        until = time.monotonic() + within
        while self.poll().active and time.monotonic() < until:
            self._pipe.poll(_FLUSH)
        self._pipe.close()
        if self.written.active:
            self._process.kill()
        self._process.join()
        self.written = self.written.broken_off(_WRITER)


def _write_hand(
    pipe: "Connection[Any, Any]", path: Path, fingers: Sequence[str], key: bytes, zero: int
) -> None:
    """Write the recording of a hand; runs in a process of its own."""
    for name in ("SIGINT", "SIGHUP"):  # these are the parent's
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    try:
        file = RecordingFile(path, zero=zero, fingers=fingers)
    except Refusal as refusal:
        pipe.send(refusal)
        return
    with Listener(backlog=len(fingers), authkey=key) as listener:
        pipe.send(listener.address)
        _HandWriter(file, pipe, listener).run()


class _HandWriter:
    """Takes messages of fingers as they come, and writes them to one file."""

    def __init__(
        self, file: RecordingFile, pipe: "Connection[Any, Any]", listener: Listener
    ) -> None:
        self._file, self._pipe, self._listener = file, pipe, listener
        self._lines: dict[Connection[Any, Any], str] = {}
        self._topics = {topic.name: topic for topic in TOPICS}
        self._ending, self._heard = False, time.monotonic()

    @property
    def _over(self) -> bool:
        """Whether nothing more comes: a finger that hangs is not waited for."""
        silent = time.monotonic() - self._heard > _SILENT
        return not self._file.written.active or (self._ending and (silent or not self._lines))

    def run(self) -> None:
        threading.Thread(target=self._accept, name="hand-listener", daemon=True).start()
        while not self._over:
            for ready in wait([*self._lines, *([] if self._ending else [self._pipe])], _FLUSH):
                line = cast("Connection[Any, Any]", ready)
                died = False
                try:
                    received = line.recv()
                except (EOFError, OSError):
                    received, died = None, True
                if line is self._pipe and received:
                    self._report()
                elif line is self._pipe:
                    self._ending, self._heard = True, time.monotonic()
                elif received is None:
                    self._close(line, died)
                else:
                    self._take(self._lines[line], *received)
        self._file.close()
        self._report()

    def _accept(self) -> None:
        """Take the lines of fingers, as long as the file is written."""
        while self._file.written.active:
            with suppress(OSError, EOFError, AuthenticationError):
                line = cast("Connection[Any, Any]", self._listener.accept())
                finger, until = line.recv(), time.monotonic() + _SILENT
                # What came of it before, from a process that died, has its end first.
                while finger in self._lines.values() and time.monotonic() < until:
                    time.sleep(_WAIT)
                self._lines[line] = finger

    def _take(self, finger: str, files: list[tuple[str, str, bytes]], messages: list[Any]) -> None:
        for name, kind, data in files:
            self._file.attach(f"{finger}/{name}", kind, data)
        for name, at, data in messages:
            self._file.put(self._topics[name].of(finger), at, data)
        self._heard = time.monotonic()
        self._file.wait()

    def _close(self, line: "Connection[Any, Any]", died: bool) -> None:
        """A finger's recording ended, or its process `died`: what comes next is another's."""
        finger, now = self._lines.pop(line), time.monotonic()
        if died:
            event = pack_event(Event(now, "engine", _DIED), self._file.stamp(now))
            self._file.put(EVENTS.of(finger), now, event)
        self._file.put(LINES.of(finger), now, pack_line(now, False, b""))
        line.close()

    def _report(self) -> None:
        with suppress(OSError):  # the parent has ended
            self._pipe.send(self._file.written)


def part_of(path: Path) -> Path:
    """Path of a recording until it is complete."""
    return path.with_name(path.name + ".part")


def renamed(path: Path, name: str) -> Path:
    """The new path of the complete recording `path`, from now on called `name`.

    A `Refusal` where that is not possible.
    """
    if not name or Path(name).name != name:
        raise Refusal(f"expected a name without a folder, got {name!r}; choose another name")
    new = path.with_name(f"{name.removesuffix(path.suffix)}{path.suffix}")
    if is_there(new) or is_there(part_of(new)):
        raise Refusal(f"{new.name}: already exists; choose another name")
    try:
        path.rename(new)
    except OSError as error:
        raise Refusal(
            f"{path.name}: cannot be renamed ({error.strerror or error}); it keeps its name"
        ) from error
    return new


def repair_command(path: Path) -> str:
    """The command that completes the recording to be at `path`."""
    return shlex.join(["kappaskin", "repair", str(part_of(path)), "--out", str(path)])


def unused(path: Path) -> Path:
    """`path`, or a numbered one, that does not exist yet."""
    names = (path.with_stem(f"{path.stem}-{n}") if n > 1 else path for n in itertools.count(1))
    return next(name for name in names if not (name.exists() or part_of(name).exists()))
