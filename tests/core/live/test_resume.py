"""An engine that was left alone while it recorded, and who comes for it."""

import multiprocessing
import os
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Client, Connection
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kappaskin import Setup
from kappaskin.live import Engine, ResumeInfo
from kappaskin.live.requests import Note, Requested, RequestSender
from kappaskin.live.resume import (
    RequestReceiver,
    ResumedProcess,
    ResumeListener,
    _address,
    resume_folder,
    resume_process,
)
from kappaskin.recording import Recording
from kappaskin.recording import messages as m
from kappaskin.recording.recompute import RecordedFrames
from kappaskin.recording.writing import part_of

pytestmark = pytest.mark.slow

LEFT = ResumeInfo(Requested(source="sim:centre"), ("ring", "beside"), os.getpid(), 192.4)


def wait_for(ask: Callable[[], Any], within: float = 30.0) -> Any:
    """The first answer that is true, or the last one."""
    end = time.monotonic() + within
    while not (answer := ask()) and time.monotonic() < end:
        time.sleep(0.01)
    return answer


@pytest.fixture
def folder() -> Iterator[Path]:
    """Where notes are left, in a place whose name is short enough for a socket."""
    with tempfile.TemporaryDirectory() as place:
        yield Path(place, "orphans")


@pytest.fixture
def waiting(folder: Path) -> Iterator[ResumeListener]:
    one = ResumeListener(folder, lambda: LEFT)
    yield one
    one.end()
    if one.line is not None:
        one.line.close()


Sides = tuple[RequestSender, RequestReceiver]


@pytest.fixture
def asked_by(folder: Path) -> Iterator[Callable[..., Sides]]:
    """Makes the two sides of a line of requests."""
    lines: list[Connection[Any, Any]] = []

    def make(folder: Path | None = folder, patience: float = 20.0) -> Sides:
        theirs, ours = multiprocessing.Pipe(duplex=False)
        lines.extend((theirs, ours))
        sender = RequestSender(Requested())
        sender.connect(ours)
        return sender, RequestReceiver(theirs, ("ring", "beside"), folder, patience)

    yield make
    while (orphan := resume_process(folder)) is not None:
        orphan.close()
        time.sleep(0.05)
    for line in lines:
        line.close()


def test_a_socket_fits_whatever_the_machine_is_called(monkeypatch) -> None:
    monkeypatch.setattr("platform.node", lambda: 16 * "node" + ".internal")
    monkeypatch.setenv("XDG_STATE_HOME", f"/{42 * 's'}")
    assert len(_address(resume_folder() / f"{16 * 'a'}.note")) < 104  # of macOS, Linux has 108


# The processes.


def test_a_recording_outlives_a_killed_parent_and_is_adopted_without_a_gap(
    abandoned, folder, tmp_path
) -> None:
    file = tmp_path / "x.mcap"
    engine_alone = abandoned(folder, file)
    assert wait_for(lambda: list(folder.glob("*.note")))
    part = part_of(file)
    was = part.stat().st_size
    time.sleep(0.7)  # longer than an engine outlives its parent that nobody may adopt
    assert wait_for(lambda: part.stat().st_size > was + 2**18)

    with Engine(resume_from=folder) as engine:
        assert engine.resumed is not None
        assert engine.pid == engine_alone.pid
        assert engine.resumed.alone > 0.6
        assert (engine.source, engine.resumed.requested.setup) == ("sim:centre", Setup(6, 7))
        assert not list(folder.iterdir())
        status = wait_for(lambda: (s := engine.status()).events and len(s.events) == 2 and s)
        first = wait_for(lambda: engine.latest(engine.status()))
        assert first.coefficients.shape == (6, 7)
        assert (status.generation, status.connections) == (engine_alone.generation, 1)
        assert [event.text for event in status.events] == [
            "the window ended unexpectedly while it recorded",
            f"the recording {engine.resumed.lasted}",
        ]
        assert wait_for(lambda: engine.latest(engine.status()).sequence > first.sequence + 50)
        lost = engine.status().accounting.lost
        engine.record(None)
        assert wait_for(lambda: not engine.status().recording.active)
        assert engine.status().recording.trouble == ""
        lost_at_most = engine.status().accounting.lost
    assert wait_for(lambda: engine_alone.gone)
    assert not any(block.exists() for block in engine_alone.blocks)

    reenact = RecordedFrames(str(file))
    with Recording(file) as recording:
        assert recording.whole
        sequences = np.array([f.sequence for said in recording.messages() for f in reenact(said)])
        told = [said.stamp for said in recording.messages_on(m.EVENTS)]
        contacts = np.array([said.stamp for said in recording.messages_on(m.CONTACTS)])
    assert sequences[0] == 0
    assert (np.diff(sequences) > 0).all()
    missing = sequences[-1] + 1 - len(sequences)
    assert lost <= missing <= lost_at_most
    died, came = told
    assert ((died < contacts) & (contacts < came)).sum() > 10  # of as many as there was time for


@pytest.mark.full
def test_adopted_it_is_revived_as_any_other_when_it_dies(abandoned, folder, tmp_path) -> None:
    engine_alone = abandoned(folder, tmp_path / "x.mcap")
    assert wait_for(lambda: list(folder.glob("*.note")))
    with Engine(resume_from=folder) as engine:
        os.kill(engine_alone.pid, signal.SIGKILL)
        assert wait_for(lambda: not engine.alive)

        engine.revive()

        estimate = wait_for(lambda: engine.latest(engine.status()))
        assert estimate.coefficients.shape == (6, 7)
        assert engine.pid != engine_alone.pid
        assert engine.status().generation > engine_alone.generation
        assert wait_for(lambda: engine.status().recording.path.endswith("x-2.mcap"))
    assert wait_for(lambda: not any(block.exists() for block in engine_alone.blocks))


@pytest.mark.full
def test_one_for_whom_nobody_comes_ends_its_file_and_leaves_nothing(
    abandoned, folder, tmp_path
) -> None:
    file = tmp_path / "x.mcap"
    engine_alone = abandoned(folder, file, patience=0.3)
    assert wait_for(lambda: engine_alone.gone)
    with Recording(file) as recording:
        assert recording.whole
    assert not part_of(file).exists()
    assert not list(folder.iterdir())
    assert not any(block.exists() for block in engine_alone.blocks)


@pytest.mark.full
def test_one_that_does_not_record_ends_with_its_parent(abandoned, folder) -> None:
    engine_alone = abandoned(folder, None)
    assert wait_for(lambda: engine_alone.gone, within=10.0)  # where its patience is 20 s
    assert not folder.exists()
    assert not any(block.exists() for block in engine_alone.blocks)


def test_closed_in_order_it_ends_its_recording_at_once(folder, tmp_path) -> None:
    with Engine(resume_from=folder) as engine:
        assert engine.resumed is None
        engine.record(tmp_path / "x.mcap")
        assert wait_for(lambda: engine.status().recording.active)
    assert (tmp_path / "x.mcap").exists()
    assert not folder.exists()


# Who asks.


def test_a_goodbye_is_the_end_after_all_that_was_asked_for_before(asked_by) -> None:
    sender, asker = asked_by()
    sender.act(Note("last"))
    sender.say_goodbye()
    sender.disconnect()
    assert asker.receive(1.0) == [Note("last")]
    assert asker.check(recording=True) == ""
    assert asker.over


@pytest.mark.parametrize("recording", [False, True])
@pytest.mark.parametrize("known", [False, True])
def test_a_line_that_breaks_is_the_end_but_of_a_recording_that_may_be_adopted(
    asked_by, folder, known: bool, recording: bool
) -> None:
    sender, asker = asked_by(folder if known else None)
    sender.act(Note("last"))
    sender.disconnect()
    assert asker.receive(1.0) == [Note("last")]
    assert bool(asker.check(recording)) == (known and recording)
    assert asker.over == (not (known and recording))


@pytest.mark.skipif(os.name != "posix", reason="writes half a message as POSIX systems do")
def test_a_request_that_breaks_off_is_no_request() -> None:
    theirs, ours = multiprocessing.Pipe(duplex=False)
    asker = RequestReceiver(theirs, ("ring", "beside"), None, 20.0)
    os.write(ours.fileno(), b"\0\0\1\0half")
    ours.close()
    assert asker.receive(1.0) == []
    asker.check(recording=False)
    assert asker.over


def test_whoever_comes_is_told_all_that_was_asked_for_and_asks_from_then_on(
    asked_by, folder, monkeypatch
) -> None:
    clock, later = time.monotonic, [0.0]
    monkeypatch.setattr("kappaskin.live.resume.time.monotonic", lambda: clock() + later[0])
    sender, asker = asked_by()
    sender.change(setup=Setup(5, 4))
    sender.change(source="sim:line")
    sender.change(window_state=b"mine")
    sender.disconnect()
    assert wait_for(lambda: not (asker.receive(0.0) or asker.resumable) or asker.check(True))

    orphan = resume_process(folder)
    assert orphan is not None
    assert orphan.info.requested == sender.requested
    assert (orphan.info.rings, orphan.pid) == (("ring", "beside"), os.getpid())
    later[0] = 100.0  # as where this process was put to sleep meanwhile
    told = wait_for(lambda: asker.check(recording=True))
    assert told == f"the recording {orphan.info.lasted}"
    assert orphan.info.alone < 100.0
    next_sender = RequestSender(orphan.info.requested)
    next_sender.connect(orphan.line, known=orphan.info.requested.number)
    next_sender.act(Note("here"))
    assert asker.receive(1.0) == [Note("here")]
    orphan.close()
    asker.receive(1.0)
    assert asker.check(recording=True) != ""  # and it waits for another
    assert not asker.over


def test_nobody_is_waited_for_when_the_recording_ends_by_itself(asked_by, folder) -> None:
    sender, asker = asked_by()
    sender.disconnect()
    asker.receive(1.0)
    asker.check(recording=True)
    assert list(folder.iterdir())
    asker.check(recording=False)
    assert asker.over
    assert not list(folder.iterdir())


def test_nobody_is_waited_for_longer_than_may_be(asked_by, folder, monkeypatch) -> None:
    clock, later = time.monotonic, [0.0]
    monkeypatch.setattr("kappaskin.live.resume.time.monotonic", lambda: clock() + later[0])
    sender, asker = asked_by(patience=600.0)
    sender.disconnect()
    asker.receive(1.0)
    asker.check(recording=True)
    later[0] = 550.0
    asker.check(recording=True)
    assert not asker.over
    later[0] = 600.1
    asker.check(recording=True)
    assert asker.over
    assert not list(folder.iterdir())


def test_where_no_note_can_be_left_it_is_the_end(asked_by, tmp_path) -> None:
    (tmp_path / "file").write_text("no folder")
    sender, asker = asked_by(tmp_path / "file")
    sender.disconnect()
    asker.receive(1.0)
    assert asker.check(recording=True) == ""
    assert asker.over


# Notes, and who finds them.


@pytest.mark.skipif(os.name != "posix", reason="the rights are of a POSIX system")
def test_only_this_user_can_read_a_note(waiting: ResumeListener, folder: Path) -> None:
    (note,) = folder.glob("*.note")
    assert note.stat().st_mode & 0o777 == 0o600
    assert folder.stat().st_mode & 0o777 == 0o700


def test_of_two_who_come_at_once_one_gets_it(waiting: ResumeListener, folder: Path) -> None:
    both = threading.Barrier(2)

    def come(_: int) -> ResumedProcess | None:
        both.wait()
        return resume_process(folder)

    with ThreadPoolExecutor(2) as pool:
        found = [orphan for orphan in pool.map(come, range(2)) if orphan]
    assert [orphan.info for orphan in found] == [LEFT]
    assert not list(folder.iterdir())
    found[0].close()


def test_who_has_not_the_key_is_told_nothing_and_another_may_come(
    waiting: ResumeListener, folder: Path
) -> None:
    (note,) = folder.glob("*.note")
    with Client(_address(note)) as stranger:
        assert stranger.poll(30.0)
        stranger.recv_bytes()
        stranger.send_bytes(b"let me in")
        assert stranger.poll(30.0)
        assert stranger.recv_bytes() == b"#FAILURE#"
        with pytest.raises(EOFError):
            stranger.recv_bytes()
    version, key = note.read_text().split()
    note.write_text(f"{version} {bytes(32).hex()}")
    assert resume_process(folder) is None
    assert waiting.line is None
    note.write_text(f"{version} {key}")
    orphan = resume_process(folder)
    assert orphan is not None
    orphan.close()


def test_another_version_leaves_it_to_its_own(waiting: ResumeListener, folder: Path) -> None:
    (note,) = folder.glob("*.note")
    _, key = note.read_text().split()
    note.write_text(f"0.0.0 {key}")
    assert resume_process(folder) is None
    assert note.exists()
    assert waiting.line is None


def test_a_note_of_another_version_that_died_is_taken_away(folder: Path) -> None:
    folder.mkdir()
    (folder / "x.note").write_text(f"0.0.0 {'ab' * 32}")
    assert resume_process(folder) is None
    assert not list(folder.iterdir())


@pytest.mark.parametrize(
    "text", [b"", b"\xff\xfe", b"one", b"0.1.0 xyz", b"0.1.0 00 more", b"[" * 9999]
)
def test_a_note_that_is_none_is_taken_away(folder: Path, text: bytes) -> None:
    folder.mkdir()
    (folder / "x.note").write_bytes(text)
    assert resume_process(folder) is None
    assert not list(folder.iterdir())


def test_a_note_of_one_that_died_is_taken_away_and_another_is_found(
    waiting: ResumeListener, folder: Path
) -> None:
    (note,) = folder.glob("*.note")
    stale = folder / "0.note"
    stale.write_text(note.read_text())
    stale.with_suffix(".sock").touch()
    orphan = resume_process(folder)
    assert orphan is not None
    assert orphan.info == LEFT
    assert wait_for(lambda: not list(folder.iterdir()))
    orphan.close()


def test_where_nobody_left_a_note_nobody_is_found(folder: Path) -> None:
    assert resume_process(folder) is None


def test_how_long_it_went_on_is_told_in_minutes_and_seconds() -> None:
    assert LEFT.lasted == "continued for 3 min 12 s after the last window ended"
