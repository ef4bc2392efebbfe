"""Files: written whole or not at all, read within limits, in use, left behind, or a cache."""

import hashlib
import io
import os
import platform
import secrets
import shutil
import stat
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import Refusal

_ELSEWHERE = "choose another place"
_NO_HOME = Path(os.devnull, "no-home-directory")  # in which nothing can be written

LIMIT = "KAPPASKIN_LIMIT"
"""Environment variable: bytes that reading a file may take, instead of the usual limits."""

# RuntimeError where it seems encrypted or packed by a method there is not, MemoryError where it
# claims to be huge.
ARCHIVE_DAMAGES = (
    *(OSError, ValueError, EOFError, RuntimeError, MemoryError, OverflowError),
    *(zipfile.BadZipFile, zlib.error),
)
"""What a damaged archive makes zipfile and NumPy raise."""

_TIMES = 200  # its size, that a file may declare
_ALWAYS = 256_000_000  # bytes that any file may declare
_SHARE = 4  # of the memory
_UNKNOWN = 4_000_000_000  # bytes of memory, where the system does not say
_CONTAINER = Path("/sys/fs/cgroup/memory.max")


def user_folder(folder: Callable[..., Path]) -> Path:
    """Kappaskin's own of a user's folders, such as `platformdirs.user_cache_path`.

    Without a home directory a place where nothing is, and nothing can be written.
    """
    try:
        return folder("kappaskin", appauthor=False)
    except RuntimeError:  # no HOME, and no entry of this user among the system's
        return _NO_HOME


def machine_folder(name: str) -> Path:
    """Folder of this user's sockets and notes of one kind on this machine.

    Short, whatever the machine is called: the path of a socket may have some 100 characters.
    """
    import platformdirs  # needed by few

    machine = hashlib.sha256(platform.node().encode(errors="surrogatepass")).hexdigest()[:8]
    return user_folder(platformdirs.user_state_path) / name / machine


def open_file(path: Path) -> BinaryIO:
    """Open the file at `path` to read bytes from it.

    An `OSError` also for anything else than a file: a pipe that nobody writes to would block.
    """
    # Nor may a terminal become that of this process.
    at_once = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0)
    file = open(path, "rb", opener=lambda name, flags: os.open(name, flags | at_once))  # noqa: SIM115
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise OSError("it is not a file")
    return file


def read_file(path: Path, most: int) -> bytes:
    """The bytes of the file at `path`; an `OSError` as of `open_file`, or above `most` bytes."""
    with open_file(path) as file:
        if os.fstat(file.fileno()).st_size > most:
            raise OSError(f"it has more than {most} bytes")
        return file.read()


class Budget:
    """The limit of what the file at `path`, of `size` bytes, may take by what it declares.

    In all over 200 times its size, where that is over 256 MB, is refused.
    """

    def __init__(self, path: Path, size: int) -> None:
        self._path, self._size, self.taken = path, size, 0
        self._most = _limit() or max(_ALWAYS, _TIMES * size)

    def take(self, count: int, part: str) -> None:
        """Count `count` bytes for a `part` of the file, or work of that size.

        A `Refusal` where that is too much with what was counted before.
        """
        self.taken += count
        if self.taken > self._most:
            raise Refusal(
                f"{self._path}: expected a file of {_said(self._size)} to take at most "
                f"{_said(self._most)}, but {part} would take {_said(self.taken)} or more; "
                "`--limit` with a size such as 2GB allows it, for a file that you trust"
            )


def check_memory(count: int, part: str) -> None:
    """Raise a `Refusal` where `part` would take more than a quarter of the memory, in bytes."""
    most = _limit() or total_memory() // _SHARE
    if count > most:
        raise Refusal(
            f"expected to take at most {_said(most)} of memory, but {part} would take "
            f"{_said(count)}; reduce it, or allow it by `--limit` with a size such as 8GB"
        )


def _limit() -> int:
    try:
        return int(os.environ.get(LIMIT, ""))
    except ValueError:
        return 0


@cache
def total_memory() -> int:
    """The memory of this machine, or of this container, in bytes."""
    try:
        memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):  # there is no sysconf on Windows
        return _UNKNOWN
    try:
        return min(memory, int(_CONTAINER.read_text()))
    except (OSError, ValueError):
        return memory


def _said(count: int) -> str:
    """`count` bytes as text."""
    for size, unit in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if count >= size:
            return f"{count / size:,.3g} {unit}" if count < 1e12 else f"{count / size:,.0f} {unit}"
    return f"{count} bytes"


def why_unread(error: Exception) -> str:
    """The reason for a refusal of a file; nothing that may quote the file's contents."""
    return f" ({error.strerror or error})" if isinstance(error, OSError) else ""


@contextmanager
def replacing(path: Path, remedy: str = _ELSEWHERE) -> Generator[Path]:
    """A new file to write to in the block, which replaces the one at `path` when the block ends.

    Until then, and for good if the block raises, `path` is as it was. A link is replaced, its
    target untouched. A device or a pipe cannot be replaced: it is written to directly, and so is
    standard output, for `-`. Raises a `Refusal` with a `remedy` where the file cannot be written.
    """
    part = part_for(path)
    try:
        with _refused(path, remedy):
            if str(path) == "-":
                yield Path("/dev/stdout")
            elif _is_stream(path):
                yield path
            else:
                yield part
                _replace(path, part)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def write_whole(path: Path, content: bytes | str, remedy: str = _ELSEWHERE) -> None:
    """Replace the file at `path` by the `content`, as `replacing` does."""
    with replacing(path, remedy) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)


def replace_whole(path: Path, part: Path) -> None:
    """Replace the file at `path` by the complete one at `part`; a `Refusal` if that fails."""
    with _refused(path, _ELSEWHERE):
        _replace(path, part)


def part_for(path: Path) -> Path:
    """The path of a new hidden file in the same folder, of the same suffix."""
    return path.parent / f".{secrets.token_hex(4)}.part{path.suffix}"


@contextmanager
def _refused(path: Path, remedy: str) -> Generator[None]:
    try:
        yield
    except (OSError, UnicodeEncodeError) as error:
        why = getattr(error, "strerror", None) or error
        raise Refusal(f"{path}: cannot be written ({why}); {remedy}") from error


def _is_stream(path: Path) -> bool:
    """Whether what is at `path` has no contents to replace, as a device or a pipe."""
    if path.parent.resolve() in (Path("/dev"), Path("/dev/fd").resolve()):
        return True  # /dev/stdout is a link, which must stay, wherever it leads
    try:
        kind = path.stat().st_mode
    except FileNotFoundError:
        return False
    return not (stat.S_ISREG(kind) or stat.S_ISDIR(kind))


def _replace(path: Path, part: Path) -> None:
    with part.open("rb+") as file:
        os.fsync(file.fileno())  # before it has the name, or a loss of power could leave neither
    with suppress(FileNotFoundError):
        before = path.lstat().st_mode
        if stat.S_ISREG(before):
            if not os.access(path, os.W_OK):
                raise PermissionError("it is read-only")
            part.chmod(stat.S_IMODE(before))
    part.replace(path)


# What a process leaves behind that is ended by force is told from what is in use by a lock on it:
# the system releases it however the process ends. The number of a process may be another's by then.


def hold(file: int) -> bool:
    """Mark an open file, before it has its contents, as in use by this process; False if it cannot.

    It is in use until the file is closed or the process ends.
    """
    try:
        import fcntl  # not on Windows

        fcntl.flock(file, fcntl.LOCK_SH)
    except (ImportError, OSError):
        return False
    return True


@contextmanager
def left_behind(path: Path, contents: bytes, at: int = 0) -> Generator[bool]:
    """Whether the file at `path`, with these `contents`, was left behind by a process that ended.

    It is one of this user that was marked by `hold`, and that no process holds any more; during the
    block none can. False also where that cannot be told, and for a link.
    """
    try:
        import fcntl

        file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except (ImportError, OSError):
        yield False
        return
    try:
        found = os.fstat(file)
        ours = stat.S_ISREG(found.st_mode) and found.st_uid == os.geteuid()
        if ours:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            ours = os.pread(file, len(contents), at) == contents
            ours = ours and os.path.samestat(found, path.lstat())
    except OSError:  # it is in use, or gone
        ours = False
    try:
        yield ours
    finally:
        os.close(file)


_MARK, _MARKED = "kappaskin.lock", b"in use by kappaskin\n"
_HIDDEN = ".kappaskin-"


def mark_folder(folder: Path) -> int:
    """Let the next start remove a temporary `folder` if this process is ended by force.

    Returns the file that must stay open until the folder is removed.
    """
    file = os.open(folder / _MARK, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    if hold(file):
        os.write(file, _MARKED)
    return file


class TemporaryFolder(tempfile.TemporaryDirectory[str]):
    """A folder that is removed when it is closed; if never, when the next process starts.

    One `beside` a person's files is hidden, and then removed when the next is made there.
    """

    def __init__(self, beside: Path | None = None) -> None:
        if beside is not None:
            remove_folders_left_behind(beside)
        prefix = "kappaskin-" if beside is None else _HIDDEN
        super().__init__(prefix=prefix, dir=beside, ignore_cleanup_errors=True)
        self._mark = mark_folder(Path(self.name))

    def cleanup(self) -> None:
        mark, self._mark = self._mark, -1
        if mark >= 0:
            os.close(mark)
        super().cleanup()


def remove_folders_left_behind(beside: Path | None = None) -> None:
    """Remove the marked temporary folders of processes that were ended by force.

    Those of the system's folder for them, or those `beside` a person's files.
    """
    # The last are those of Python's `multiprocessing`.
    for prefix in ("kappaskin-", "pymp-") if beside is None else (_HIDDEN,):
        for folder in (beside or Path(tempfile.gettempdir())).glob(f"{prefix}*"):
            with left_behind(folder / _MARK, _MARKED) as left:
                if left and not folder.is_symlink():
                    shutil.rmtree(folder, ignore_errors=True)


_MEANING = 2  # to be changed by whatever makes other arrays of the same key
_MOST = 16  # files
_DIGEST = hashlib.sha256().digest_size  # bytes: what a file begins with
_LARGEST = 64_000_000  # bytes of one: more is read no faster than it is computed


def cached(key: str, compute: Callable[[], dict[str, NDArray[Any]]]) -> dict[str, NDArray[Any]]:
    """The arrays of `compute()`, by name: read from the cache where `key` is there.

    The same bits whether cached or computed. A damaged file and those of other versions of numpy
    or scipy are not used; where none can be written, the arrays are computed every time.
    """
    import scipy  # needed by few

    versioned = f"{_MEANING} {np.__version__} {scipy.__version__} {key}"
    file = _cache_folder() / f"{hashlib.sha256(versioned.encode()).hexdigest()[:24]}.npz"
    with suppress(OSError):
        data = file.read_bytes()
        if data.startswith(_digest(data[_DIGEST:])):
            file.touch()  # the oldest go first
            return dict(np.load(io.BytesIO(data[_DIGEST:])))
    arrays = compute()
    if sum(values.nbytes for values in arrays.values()) <= _LARGEST:
        with suppress(OSError, Refusal):
            _write_arrays(file, arrays)
    return arrays


def _digest(data: bytes) -> bytes:
    return hashlib.sha256(data).digest()


def _cache_folder() -> Path:
    import platformdirs  # needed by few

    return user_folder(platformdirs.user_cache_path) / "modes"


def _write_arrays(file: Path, arrays: dict[str, NDArray[Any]]) -> None:
    made = io.BytesIO()
    np.savez(made, **arrays)  # pyright: ignore[reportArgumentType]
    data = made.getvalue()
    file.parent.mkdir(parents=True, exist_ok=True)
    write_whole(file, _digest(data) + data)
    there = sorted(file.parent.iterdir(), key=lambda one: one.stat().st_mtime, reverse=True)
    for old in there[_MOST:]:
        old.unlink(missing_ok=True)
