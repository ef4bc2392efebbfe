"""What a disk does to a recording: it fills, is slow, has other files, or loses this one."""

import errno
import io
import os
import threading
import time

import pytest

from kappaskin import Refusal
from kappaskin.recording import Recording, writing
from kappaskin.recording import disk as disk_room
from kappaskin.recording import messages as m
from kappaskin.recording.writing import RecordingFile, part_of

LINE = m.pack_line(0.0, False, bytes(600))


class Full(io.RawIOBase):
    """A file on a disk with room for so many bytes in all its files."""

    room = 0

    def __init__(self, file):
        self._file = file

    def write(self, data):
        used = Full.room - len(data)
        if used < 0:
            some = max(Full.room, 0)
            self._file.write(data[:some])
            Full.room -= some
            raise OSError(errno.ENOSPC, "No space left on device")
        Full.room = used
        return self._file.write(data)

    def truncate(self, size=None):
        before = self._file.seek(0, 2)
        Full.room += before - self._file.truncate(size)
        return size

    def seek(self, *args):
        return self._file.seek(*args)

    def fileno(self):
        return self._file.fileno()

    def close(self):
        if not self.closed:
            if self._file.name != self.named:
                Full.room += self._file.seek(0, 2)  # what was in reserve is free again
            self._file.close()
        super().close()

    named = ""


@pytest.fixture
def small_disk(tmp_path, monkeypatch):
    """A disk of 3 MiB."""
    Full.room = 3 * 2**20
    path = tmp_path / "full.mcap"
    Full.named = str(part_of(path))
    opened, temporary = type(path).open, disk_room.tempfile.TemporaryFile
    monkeypatch.setattr(
        type(path),
        "open",
        lambda self, mode="r", *a, **k: (
            Full(opened(self, mode, *a, **k)) if "x" in mode else opened(self, mode, *a, **k)
        ),
    )
    monkeypatch.setattr(disk_room.tempfile, "TemporaryFile", lambda **k: Full(temporary(**k)))
    return path


def test_a_disk_that_fills_leaves_a_whole_recording(small_disk) -> None:
    file = RecordingFile(small_disk)
    end = time.monotonic() + 20
    sent = 0
    while file.written.active and time.monotonic() < end:
        for _ in range(20):
            file.put(m.LINES, sent * 1e-3, m.pack_line(sent * 1e-3, False, os.urandom(2000)))
            sent += 1
        time.sleep(0.01)
    assert not file.written.active
    assert "No space left on device; it is complete up to that time" in file.written.trouble
    file.put(m.LINES, 0.0, LINE)  # nobody minds
    file.close()
    with Recording(small_disk) as recording:
        assert recording.whole
        found = [m.unpack_line(got.data)[0] for got in recording.messages()]
    assert found == [n * 1e-3 for n in range(len(found))]
    assert len(found) == file.written.messages > 500


def test_without_room_to_end_it_none_is_begun(small_disk) -> None:
    for room, why in ((2**20 - 1, "room for 1 MiB"), (2**20, None)):
        Full.room = room
        if why:
            with pytest.raises(Refusal, match=why):
                RecordingFile(small_disk)
            continue
        file = RecordingFile(small_disk)
        file.close()
        assert "No space left" in file.written.trouble
        small_disk.unlink()
    assert not part_of(small_disk).exists()


def test_what_is_there_is_never_written_over(tmp_path) -> None:
    path = tmp_path / "there.mcap"
    for there in (path, part_of(path)):
        there.write_bytes(b"mine")
        with pytest.raises(Refusal, match="already exists"):
            RecordingFile(path)
        assert there.read_bytes() == b"mine"
        there.unlink()
    with pytest.raises(Refusal, match="cannot be written"):
        RecordingFile(tmp_path / "no" / "folder.mcap")


def test_a_file_that_appears_meanwhile_stays(tmp_path) -> None:
    path = tmp_path / "a.mcap"
    file = RecordingFile(path)
    file.put(m.LINES, 0.0, LINE)
    path.write_bytes(b"mine")
    file.close()
    assert "a.mcap has been created meanwhile" in file.written.trouble
    assert path.read_bytes() == b"mine"
    with Recording(part_of(path)) as recording:
        assert recording.whole


def test_a_file_that_is_taken_away_ends_the_recording(tmp_path) -> None:
    file = RecordingFile(tmp_path / "a.mcap")
    part_of(file.path).unlink()
    end = time.monotonic() + 30
    while file.written.active and time.monotonic() < end:
        time.sleep(0.01)
    assert "it was moved or removed" in file.written.trouble
    file.close()


def test_a_slow_disk_holds_nobody_up_and_what_is_not_written_is_counted(
    tmp_path, monkeypatch
) -> None:
    monkeypatch.setattr(writing, "_BACKLOG", 2**16)
    go, write = threading.Event(), disk_room.ReservedFile.write
    file = RecordingFile(tmp_path / "slow.mcap")

    def slow(self, data):
        go.wait(10)
        write(self, data)

    monkeypatch.setattr(disk_room.ReservedFile, "write", slow)
    began = time.monotonic()
    for n in range(1000):
        file.put(m.LINES, n * 1e-3, LINE)
    assert time.monotonic() - began < 5.0  # where waiting for the disk takes 10 s
    go.set()
    file.close()
    assert file.written.lost > 800
    assert file.written.lost + file.written.messages == 1000
    with Recording(file.path) as recording:
        assert recording.counts[m.LINES.name] == file.written.messages
