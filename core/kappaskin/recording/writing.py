"""MCAP writer in a separate thread."""

import itertools
import shlex
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path

from mcap.writer import CompressionType, Writer

from kappaskin.errors import Refusal
from kappaskin.pipeline import REVISION
from kappaskin.recording.disk import ReservedFile, is_there
from kappaskin.recording.messages import TOPICS, Topic

FORMAT = 1
"""Version of the meaning of our own messages."""

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


@dataclass(frozen=True)
class RecordingStatus:
    """State of a recording: its path, duration in s, and size.

    `path` is empty where none was asked for. `lost` counts messages that found too many waiting for
    the disk. `trouble` says why it ended before it was asked to, or does not begin.
    """

    path: str = ""
    active: bool = False
    seconds: float = 0.0
    size: int = 0
    messages: int = 0
    lost: int = 0
    trouble: str = ""

    def broken_off(self) -> "RecordingStatus":
        """The same where the process that was writing it has ended."""
        path = Path(self.path)
        if not self.active or path.exists():  # by now it is complete
            return replace(self, active=False)
        trouble = (
            f"the recording {path.name} broke off: the engine process ended unexpectedly; "
            f"`{repair_command(path)}` completes the file"
        )
        return replace(self, active=False, trouble=trouble)


class RecordingFile:
    """A recording at `path`, called `path` + `.part` until it is closed.

    The file is opened by `disk`. Time 0 is `zero` in ns since 1970, by default that of the
    monotonic clock. `put` and `attach` never wait; `written` is the state of
    it. One that ends by itself, as on a full disk, is closed as one that is asked to.
    """

    def __init__(
        self,
        path: Path,
        disk: Callable[[Path], ReservedFile] = ReservedFile,
        zero: int | None = None,
    ) -> None:
        self.path, self.part = path, part_of(path)
        for there in (self.path, self.part):
            if is_there(there):
                raise Refusal(
                    f"{there}: already exists; choose another name"
                    + (f", or see `kappaskin repair {there}`" if there == self.part else "")
                )
        self._disk = disk(self.part)
        self._began = time.monotonic()
        # Wall-clock time is read once, so that a clock that is set does not reorder messages.
        self._wall = time.time_ns() - time.monotonic_ns() if zero is None else zero
        self._waiting: deque[tuple[int, int, bytes]] = deque()
        self._attachments: deque[tuple[str, str, bytes]] = deque()
        self._put = self._taken = 0  # bytes: each counted by one thread only
        self._channels: dict[str, int] = {}
        self._sequences = dict.fromkeys(range(1, len(TOPICS) + 1), 0)
        self.written = RecordingStatus(str(path), active=True)
        self._lost = 0
        self._closing = threading.Event()
        self._writer = Writer(self._disk.stream, _CHUNK, CompressionType.LZ4)
        try:
            self._begin()
        except OSError as error:
            self._disk.close()
            self.part.unlink(missing_ok=True)
            raise Refusal(f"{path}: cannot be written ({error.strerror or error})") from error
        self._threads = [
            threading.Thread(target=self._work, name="recorder", daemon=True),
            threading.Thread(target=self._sync, name="recorder-sync", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    def _begin(self) -> None:
        self._writer.start("ros2", PROGRAM)
        schemas: dict[str, int] = {}
        for name, kind in TOPICS:
            if kind.name not in schemas:
                schema = self._writer.register_schema(kind.name, "ros2msg", kind.definition)
                schemas[kind.name] = schema
            channel_metadata = {"offered_qos_profiles": ""}
            self._channels[name] = self._writer.register_channel(
                name, "cdr", schemas[kind.name], channel_metadata
            )
        made_by = {"format": str(FORMAT), "version": VERSION, "revision": str(REVISION)}
        self._writer.add_metadata("kappaskin", made_by)

    def stamp(self, time: float) -> int:
        """Nanoseconds since 1970 at `time` in s on the monotonic clock."""
        return self._wall + round(time * 1e9)

    def wait(self) -> None:
        """Wait until the disk has taken so much that none of what comes next is lost."""
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
        self._waiting.append((self._channels[topic.name], self.stamp(time), data))

    def attach(self, name: str, kind: str, data: bytes) -> None:
        """Attach a file `name` of a media type `kind`."""
        self._attachments.append((name, kind, data))

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
        writer, sequences = self._writer, self._sequences
        for _ in range(len(self._attachments)):
            name, kind, data = self._attachments.popleft()
            writer.add_attachment(_UNDATED, self.stamp(time.monotonic()), name, kind, data)
        count = len(self._waiting)
        for _ in range(count):
            channel, stamp, data = self._waiting.popleft()
            writer.add_message(channel, stamp, data, stamp, sequences[channel])
            sequences[channel] += 1
            self._taken += len(data) + _EACH
        writer.flush()
        was, size = self.written, self._disk.tell()
        self._disk.reserve(_SUMMED * (size // _CHUNK + int(was.seconds / _FLUSH)))
        self.written = replace(
            was,
            seconds=time.monotonic() - self._began,
            size=size,
            messages=was.messages + count,
            lost=self._lost,
        )

    def _finish(self) -> None:
        """Rename the complete file."""
        self._disk.sync()
        if self.path.exists():
            raise OSError(f"{self.path.name} has been created meanwhile")
        self.part.rename(self.path)
        trouble = self._disk.trouble
        self._stop(f"{self.path}: {trouble}; it is complete up to that time" if trouble else "")

    def _stop(self, trouble: str) -> None:
        self.written = replace(self.written, active=False, trouble=trouble)

    def _sync(self) -> None:
        """Flush to the disk; in a thread of its own, since this may take long."""
        while not self._closing.wait(_SYNC) and self.written.active:
            try:
                self._disk.sync()
            except (OSError, ValueError):  # closed meanwhile
                return

    def end(self) -> None:
        """Let what waits be written, and the file ended."""
        self._closing.set()

    def close(self) -> None:
        """End the file, and wait until it is on the disk."""
        self.end()
        for thread in self._threads:
            thread.join()


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
