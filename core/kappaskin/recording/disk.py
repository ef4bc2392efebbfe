"""Files on a disk that may fill up."""

import os
import sys
import tempfile
from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from typing import IO, Generic, Self, TypeVar, cast

from kappaskin._files import TemporaryFolder
from kappaskin._processes import BackgroundProcess
from kappaskin.errors import Refusal

_Result = TypeVar("_Result")

_RESERVE = 2**20  # bytes kept for the end of the file, which a full disk has no room for otherwise


class ReservedFile:
    """The new file `path`, as what the MCAP writer writes to.

    Once the disk is full, `trouble` says so; what has been kept in reserve is then used for what is
    still written. A write that finds no room even there, or no disk, raises an `OSError` and leaves
    the file as it was before.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.trouble = path, ""
        self._reserve: IO[bytes] | None = None
        try:
            self._file = path.open("xb", buffering=0)
        except OSError as error:
            raise Refusal(f"{path}: cannot be written ({_why(error)}); {_ELSEWHERE}") from error
        _locked(self._file)
        self._reserved = self._at = 0
        try:
            self._reserve = tempfile.TemporaryFile(dir=path.parent, buffering=0)  # noqa: SIM115
            self.reserve(_RESERVE)
        except OSError as error:
            self.close()
            path.unlink(missing_ok=True)
            raise Refusal(
                f"{path}: expected room for {_RESERVE >> 20} MiB at least ({_why(error)}); "
                f"{_ELSEWHERE}"
            ) from error

    @property
    def stream(self) -> IO[bytes]:
        """Itself, for callers that wrap files."""
        return cast("IO[bytes]", self)

    def reserve(self, size: int) -> None:
        """Reserve `size` more bytes."""
        if self._reserve is not None and size > self._reserved:
            _write(self._reserve, bytes(size - self._reserved))
            self._reserved = size

    def tell(self) -> int:
        return self._at

    def write(self, data: bytes) -> None:
        try:
            self.put(data)
        except OSError as error:
            self._back()
            if self._reserve is None:
                raise
            self.trouble = _why(error)
            self._reserve.close()
            self._reserve = None
            self.write(data)
            return
        self._at += len(data)

    def put(self, data: bytes) -> None:
        """Write to the disk; an `OSError` where there is no room for all of it."""
        _write(self._file, data)

    def _back(self) -> None:
        self._file.truncate(self._at)
        self._file.seek(self._at)

    def flush(self) -> None:
        """No effect: nothing is buffered in this process."""

    def sync(self) -> None:
        """Wait until it is on the disk, where it survives a loss of power."""
        os.fsync(self._file.fileno())

    @property
    def there(self) -> bool:
        """Whether the file is still where it was made."""
        try:
            return os.path.samestat(self.path.stat(), os.fstat(self._file.fileno()))
        except OSError:
            return False

    def close(self) -> None:
        self._file.close()
        if self._reserve is not None:
            self._reserve.close()


_ELSEWHERE = "choose another place"


def is_written(path: Path) -> bool:
    """Whether a process is writing the file at `path`; never known on Windows."""
    try:
        with path.open("rb") as file:
            return not _locked(file)
    except OSError:
        return False


def _locked(file: IO[bytes]) -> bool:
    """Whether this process could mark `file` as its own, as long as it is open."""
    if sys.platform != "win32":
        import fcntl

        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:  # a disk that knows no such marks
            return True
    return True


def is_there(path: Path) -> bool:
    """Whether anything is at `path`; a `Refusal` if unknown, as for too long a name.

    The path's own `exists` raises then, which would end the process that is live.
    """
    try:
        return path.exists() or path.is_symlink()
    except OSError as error:
        raise Refusal(f"{path}: cannot be accessed ({_why(error)}); {_ELSEWHERE}") from error


class ScratchTask(Generic[_Result]):
    """Makes `files` by `steps(about, folder)` in a process called `name`; only `wait` waits.

    They are in a temporary folder beside the file `to` until complete. Steps yield the share that
    is done now and then, and the `result` at the end. It ends when it is done, when `close` is
    called, which leaves nothing of what is not whole, or when the process that started it is gone;
    the next task there removes the folder then.
    """

    def __init__(
        self,
        name: str,
        to: Path,
        files: tuple[Path, ...],
        result: type[_Result],
        steps: Callable[..., Iterable[float | _Result]],
        about: object,
    ) -> None:
        self.files, self._to, self._result = files, to, result
        try:
            self._room = TemporaryFolder(to.parent)
        except OSError as error:
            raise _unwritable(to, error) from error
        self._scratch = Path(self._room.name)
        try:
            self._task = BackgroundProcess[float | _Result](name, steps, about, self._scratch)
        except BaseException:  # Ctrl+C, while it begins
            self._room.cleanup()
            raise

    @property
    def done(self) -> bool:
        return self._task.done

    def poll(self) -> list[float | _Result]:
        """The shares that are done since the last call, and in the end what came of it.

        A `Refusal` where that is nothing.
        """
        over, found = self.done, self._task.poll()
        if self.done and not over:
            self._give()
        return found

    def wait(self) -> Generator[float | _Result]:
        """Each share as soon as it is done, and in the end what came of it."""
        for found in self._task.wait():
            if isinstance(found, self._result):
                self._give()
            yield found

    def _give(self) -> None:
        """Give what is whole its place; nothing, where one is taken."""
        given: list[tuple[Path, Path]] = []
        try:
            for place in self.files:
                if place.exists():
                    raise FileExistsError(17, "it has been created meanwhile")
                made = self._scratch / place.name
                made.rename(place)
                given.append((place, made))
        except OSError as error:
            for place, made in given:
                place.rename(made)
            raise _unwritable(self._to, error) from error

    def close(self) -> None:
        """End it, done or not."""
        self._task.close()
        self._room.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _unwritable(path: Path, error: OSError) -> Refusal:
    return Refusal(f"{path}: cannot be written ({_why(error)}); {_ELSEWHERE}")


def _write(file: IO[bytes], data: bytes) -> None:
    left = memoryview(data)
    while left:
        left = left[file.write(left) :]


def _why(error: OSError) -> str:
    return error.strerror or str(error)
