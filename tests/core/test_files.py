"""Files: written whole or not at all, read only where they are files, in use or left behind."""

import os
import resource
import signal
import stat
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import platformdirs
import pytest

from kappaskin import _files
from kappaskin._files import (
    LIMIT,
    Budget,
    TemporaryFolder,
    check_memory,
    hold,
    left_behind,
    mark_folder,
    remove_folders_left_behind,
    replace_whole,
    replacing,
    user_folder,
    write_whole,
)
from kappaskin.calibration import Calibration, TareStore
from kappaskin.errors import Refusal
from kappaskin.mechanics import HeightMap, Mesh


@contextmanager
def room(size: int) -> Iterator[None]:
    """A disk on which no file grows beyond `size` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_file_is_replaced_and_nothing_is_left_beside_it(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    for text in ("first", "second, \N{PLUS-MINUS SIGN}"):
        write_whole(file, text)
        assert file.read_text("utf-8") == text
    write_whole(file, b"\x00\xff")
    assert file.read_bytes() == b"\x00\xff"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("size", [0, 100])
def test_a_full_disk_leaves_the_old_file(tmp_path: Path, size: int) -> None:
    file = tmp_path / "a.npz"
    file.write_bytes(b"old")
    with room(size), pytest.raises(Refusal, match=r"a\.npz: cannot be written \(File too large"):
        write_whole(file, bytes(100_000))
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]


def test_an_error_while_writing_leaves_the_old_file(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text("old")

    def write() -> None:
        with replacing(file) as part:
            part.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write()
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


def test_until_the_block_ends_readers_see_the_old_file(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text("old")
    with replacing(file) as part:
        part.write_text("new")
        assert file.read_text() == "old"
        assert part.suffix == file.suffix
    assert file.read_text() == "new"


def test_a_link_is_replaced_and_its_target_untouched(tmp_path: Path) -> None:
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("mine")
    link.symlink_to(target)
    write_whole(link, "new")
    assert (target.read_text(), link.read_text()) == ("mine", "new")
    assert not link.is_symlink()


def test_permissions_are_kept(tmp_path: Path) -> None:
    file = tmp_path / "key"
    file.write_text("old")
    file.chmod(0o600)
    write_whole(file, "new")
    assert stat.S_IMODE(file.stat().st_mode) == 0o600


def test_a_read_only_file_is_refused(tmp_path: Path, monkeypatch) -> None:
    file = tmp_path / "a"
    file.write_text("old")
    monkeypatch.setattr(os, "access", lambda path, _: path != file)  # root may write everywhere
    with pytest.raises(Refusal, match="it is read-only"):
        write_whole(file, "new")
    assert file.read_text() == "old"


def test_devices_and_pipes_are_written_directly(tmp_path: Path) -> None:
    write_whole(Path("/dev/null"), "nothing")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)
    link = tmp_path / "link to a device"
    link.symlink_to("/dev/null")
    write_whole(link, "nothing")
    assert link.is_symlink()

    pipe, found = tmp_path / "pipe", list[bytes]()
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: found.append(pipe.read_bytes()))
    reader.start()
    write_whole(pipe, "through")
    reader.join(30)
    assert found == [b"through"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)


@pytest.mark.slow
@pytest.mark.parametrize("path", ["-", "/dev/stdout", "/dev/fd/1"])
@pytest.mark.parametrize("into", ["a pipe", "a file"])
def test_standard_output_is_written_to(tmp_path: Path, path: str, into: str) -> None:
    script = (
        "from pathlib import Path; from kappaskin._files import write_whole; "
        f"write_whole(Path({path!r}), 'told')"
    )
    before = os.lstat("/dev/stdout")
    if into == "a pipe":
        out = subprocess.run([sys.executable, "-c", script], stdout=-1, check=True).stdout
    else:
        with (tmp_path / "out").open("w") as file:
            subprocess.run([sys.executable, "-c", script], stdout=file, check=True)
        out = (tmp_path / "out").read_bytes()
    assert out == b"told"
    assert os.lstat("/dev/stdout").st_ino == before.st_ino


@pytest.mark.parametrize("name", ["", ".", "..", "/", "folder", "missing/a", "a\ud800", "a" * 300])
def test_what_is_no_place_for_a_file_is_refused(tmp_path: Path, name: str, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    with pytest.raises(Refusal, match="cannot be written"):
        write_whole(Path(name), "new")
    assert list(tmp_path.iterdir()) == [tmp_path / "folder"]


def test_text_that_cannot_be_encoded_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Refusal, match=r"cannot be written .*surrogates"):
        write_whole(tmp_path / "a", "\ud800")
    assert list(tmp_path.iterdir()) == []


def test_a_file_made_by_another_program_takes_the_place(tmp_path: Path) -> None:
    file, part = tmp_path / "a.mp4", tmp_path / ".part.mp4"
    file.write_text("old")
    with pytest.raises(Refusal, match=r"a\.mp4: cannot be written \(No such file"):
        replace_whole(file, part)
    part.write_text("new")
    replace_whole(file, part)
    assert file.read_text() == "new"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("kind", ["pipe", "folder", "device"])
@pytest.mark.parametrize(
    "command",
    [
        ("reconstruct", "FILE", "--out", "out.npz"),
        ("plan", "FILE"),
        ("study", "FILE"),
        ("info", "FILE"),
        pytest.param(("verify", "FILE"), marks=pytest.mark.slow),
        ("repair", "FILE", "--out", "out.mcap"),
    ],
    ids=["reconstruct", "plan", "study", "info", "verify", "repair"],
)
def test_what_is_no_file_is_refused_at_once(
    tmp_path: Path, monkeypatch, run, command: tuple[str, ...], kind: str
) -> None:
    monkeypatch.chdir(tmp_path)
    made = tmp_path / "in.toml"
    if kind == "pipe":
        os.mkfifo(made)
    elif kind == "folder":
        made.mkdir()
    else:
        made.symlink_to("/dev/zero")
    code, _, why = run(*(str(made) if word == "FILE" else word for word in command))
    assert code == 2
    assert "it is not a file" in why or "Is a directory" in why
    assert list(tmp_path.iterdir()) == [made]


@pytest.mark.parametrize(
    "read",
    [Calibration.read, lambda path: HeightMap.read(path, 0.1, 0.1, 1e-3), Mesh.read],
    ids=["calibration", "height map", "mesh"],
)
def test_no_reader_waits_for_a_pipe(tmp_path: Path, read: Callable[[Path], object]) -> None:
    for name in ("a.toml", "a.png", "a.npy", "a.obj"):
        os.mkfifo(tmp_path / name)
        with pytest.raises(Refusal):
            read(tmp_path / name)


# What a file may take


@pytest.mark.parametrize(
    ("size", "legal"), [(100, 256_000_000), (1_280_000, 256_000_000), (10**9, 200 * 10**9)]
)
def test_a_file_may_take_256_mb_or_200_times_its_size(size: int, legal: int) -> None:
    budget = Budget(Path("a.mcap"), size)
    budget.take(legal - 1, "this")
    budget.take(1, "this")
    with pytest.raises(Refusal, match=r"^a\.mcap: expected a file of .* but that would take .*GB"):
        budget.take(10**12, "that")
    with pytest.raises(Refusal, match="that would take"):
        Budget(Path("a.mcap"), size).take(legal + 1, "that")


def test_no_more_than_a_quarter_of_memory_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_files, "total_memory", lambda: 8_000_000_000)
    check_memory(2_000_000_000, "this")
    with pytest.raises(Refusal, match=r"at most 2 GB of memory, but that would take 2 GB; reduce"):
        check_memory(2_000_000_001, "that")


def test_a_limit_replaces_both(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LIMIT, "3000")
    with pytest.raises(Refusal, match="at most 3 kB, but this would take 3 kB"):
        Budget(Path("a"), 10**9).take(3001, "this")
    with pytest.raises(Refusal, match="at most 3 kB of memory"):
        check_memory(3001, "this")
    monkeypatch.setenv(LIMIT, "1000000000000")
    Budget(Path("a"), 10).take(10**12, "this")
    check_memory(10**12, "this")


def test_the_memory_is_that_of_the_machine_or_the_container(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    memory = _files.total_memory.__wrapped__
    whole = memory()
    assert 10**8 < whole < 10**14
    monkeypatch.setattr(_files, "_CONTAINER", tmp_path / "memory.max")
    for text, found in (("max", whole), ("500000000\n", 500_000_000), (f"{2**60}", whole)):
        (tmp_path / "memory.max").write_text(text)
        assert memory() == found


# What is in use, and what was left behind

CONTENTS = b"what it holds"
HELD = """
import os, sys, time
from kappaskin._files import hold
file = os.open(sys.argv[1], os.O_RDWR | os.O_CREAT | os.O_EXCL)
hold(file)
os.write(file, b"what it holds")
print("held", flush=True)
time.sleep(60)
"""


@pytest.fixture
def holding() -> Iterator[Callable[[Path], subprocess.Popen[str]]]:
    """Processes each of which makes a file and holds it."""
    pytest.importorskip("fcntl", reason="no locks of files on this system")
    made: list[subprocess.Popen[str]] = []

    def begin(path: Path) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", HELD, str(path)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        made.append(process)
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        return process

    yield begin
    for process in made:
        process.kill()
        process.communicate()


def was_left(path: Path) -> bool:
    with left_behind(path, CONTENTS) as left:
        return left


@pytest.mark.slow
def test_a_file_is_left_behind_once_its_process_was_killed(tmp_path: Path, holding) -> None:
    path = tmp_path / "a"
    process = holding(path)
    assert not was_left(path)
    os.kill(process.pid, signal.SIGSTOP)
    assert not was_left(path)
    process.kill()
    process.wait()
    assert was_left(path)


@pytest.mark.slow
def test_a_file_that_another_process_uses_too_is_not_left_behind(tmp_path: Path, holding) -> None:
    path = tmp_path / "a"
    process = holding(path)
    with path.open("rb") as file:
        assert hold(file.fileno())
        process.kill()
        process.wait()
        assert not was_left(path)
    assert was_left(path)


@pytest.mark.slow
def test_while_one_removes_what_was_left_behind_no_other_does(tmp_path: Path, holding) -> None:
    path = tmp_path / "a"
    process = holding(path)
    process.kill()
    process.wait()
    with left_behind(path, CONTENTS) as left:
        assert left
        assert not was_left(path)


@pytest.mark.parametrize("foreign", ["contents", "empty", "link", "folder", "pipe", "none"])
def test_what_is_foreign_was_not_left_behind(foreign: str, tmp_path: Path) -> None:
    path = tmp_path / "a"
    if foreign == "contents":
        path.write_bytes(b"another program's")
    elif foreign == "empty":
        path.touch()
    elif foreign == "link":
        (tmp_path / "b").write_bytes(CONTENTS)
        path.symlink_to(tmp_path / "b")
    elif foreign == "folder":
        path.mkdir()
    elif foreign == "pipe":
        os.mkfifo(path)
    assert not was_left(path)


def test_another_users_file_was_not_left_behind(tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "a"
    path.write_bytes(CONTENTS)
    assert was_left(path)
    monkeypatch.setattr(os, "geteuid", lambda: path.stat().st_uid + 1)
    assert not was_left(path)


def test_where_files_have_no_locks_nothing_was_left_behind(tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "a"
    path.write_bytes(CONTENTS)
    monkeypatch.setitem(sys.modules, "fcntl", None)
    assert not was_left(path)
    with path.open("rb") as file:
        assert not hold(file.fileno())


def test_only_marked_folders_that_nobody_uses_are_removed(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    dead = [tmp_path / name for name in ("kappaskin-dead", "pymp-dead")]
    foreign = [tmp_path / name for name in ("kappaskin-foreign", "pymp-foreign", "other")]
    for folder in dead + foreign:
        folder.mkdir()
        (folder / "content").touch()
    for folder in [*dead, foreign[-1]]:
        os.close(mark_folder(folder))
    (foreign[0] / "kappaskin.lock").touch()
    linked = tmp_path / "kappaskin-link"
    linked.symlink_to(foreign[-1])

    with TemporaryFolder() as used:
        remove_folders_left_behind()
        assert set(tmp_path.iterdir()) == {*foreign, linked, Path(used)}
    assert not Path(used).exists()
    assert all((folder / "content").exists() for folder in foreign)


@pytest.fixture
def homeless(monkeypatch: pytest.MonkeyPatch) -> None:
    """A user without a home directory, as the system's `nobody` in a container."""
    for name in ("HOME", *(name for name in os.environ if name.startswith("XDG_"))):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)


@pytest.mark.skipif(sys.platform == "win32", reason="every user has one")
@pytest.mark.usefixtures("homeless")
def test_without_a_home_nothing_is_found_and_each_write_is_refused() -> None:
    for kind in ("cache", "config", "data", "log", "state"):
        folder = user_folder(getattr(platformdirs, f"user_{kind}_path")) / kind
        assert not list(folder.glob("*"))
        with pytest.raises(OSError, match="Not a directory"):
            folder.mkdir(parents=True)
        with pytest.raises(Refusal, match=r"no-home-directory.*cannot be written"):
            write_whole(folder / "a", "text")
    assert TareStore(TareStore.user_folder()).load("SN1").used is None
