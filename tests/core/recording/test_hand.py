"""One file of several fingers: each is read alone, on one clock, whatever ends meanwhile."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from multiprocessing.connection import Client
from pathlib import Path

import pytest
from mcap.reader import make_reader

from kappaskin import Refusal
from kappaskin.recording import HandRecorder, Recording, Repaired, ReplayedSource
from kappaskin.recording import messages as m
from kappaskin.recording.writing import HandLine, RecordingFile, part_of
from kappaskin.sources import open_source

pytestmark = pytest.mark.slow

FINGERS = "thumb", "index_2"


def line(n: int) -> bytes:
    return m.pack_line(float(n), False, os.urandom(600))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Lines 0 to 99 of the thumb, and 50 to 99 of the index, with a file each."""
    path = tmp_path_factory.mktemp("hand") / "hand.mcap"
    file = RecordingFile(path, zero=10**18, fingers=FINGERS)
    for n in range(100):
        for finger in FINGERS if n >= 50 else FINGERS[:1]:
            file.put(m.LINES.of(finger), float(n), line(n))
    for finger in FINGERS:
        file.attach(f"{finger}/scene.toml", "application/toml", finger.encode())
    file.close()
    return path


def times(path: Path, finger: str | None) -> list[float]:
    with Recording(path, finger) as recording:
        return [time for time, _, _ in recording.lines()]


def test_each_finger_is_read_alone_on_one_clock(whole: Path) -> None:
    assert times(whole, "thumb") == list(range(100))
    assert times(whole, "index_2") == list(range(50, 100))
    with Recording(whole, "index_2") as recording:
        assert recording.fingers == FINGERS
        assert recording.counts == {m.LINES.name: 50}
        [first, *_] = recording.messages()
        assert recording.seconds(first.stamp) == 50.0  # of what began with the thumb
        assert recording.attachments == ("scene.toml",)
        assert recording.attachment("scene.toml") == b"index_2"


def test_the_first_finger_is_read_where_none_is_named(whole: Path) -> None:
    assert times(whole, None) == list(range(100))
    with pytest.raises(Refusal, match="one of its fingers, thumb, index_2; got 'ring'"):
        Recording(whole, "ring")


def test_a_finger_may_be_named_in_the_path(whole: Path, tmp_path: Path) -> None:
    assert times(whole.with_name("hand.mcap#index_2"), None) == list(range(50, 100))
    odd = tmp_path / "a#thumb"  # where that is a file, it is the file
    odd.write_bytes(whole.read_bytes())
    assert times(odd, "index_2") == list(range(50, 100))
    with pytest.raises(Refusal, match=r"none\.mcap: cannot be read"):
        Recording(tmp_path / "none.mcap#thumb")


def test_others_see_a_topic_for_each_finger(whole: Path) -> None:
    with whole.open("rb") as file:
        reader = make_reader(file)
        topics = {channel.topic for _, channel, _ in reader.iter_messages()}
        [about] = reader.iter_metadata()
    assert topics == {"/kappaskin/thumb/line", "/kappaskin/index_2/line"}
    assert about.metadata["format"] == "2"


def test_one_finger_without_a_name_is_a_file_as_ever(tmp_path: Path) -> None:
    file = RecordingFile(tmp_path / "a.mcap")
    file.put(m.LINES, 0.0, line(0))
    file.close()
    with Recording(tmp_path / "a.mcap") as recording:
        assert (recording.fingers, recording.finger, recording.format) == (("",), "", 1)
    with pytest.raises(Refusal, match="which have no names; got 'thumb'"):
        Recording(tmp_path / "a.mcap", "thumb")


@pytest.mark.parametrize("finger", ["a/b", "1", "", "x" * 33, "a\n", "ä"])
def test_what_may_be_no_finger_is_none(finger: str) -> None:
    topics = {topic.name for topic in m.TOPICS}
    assert m.finger_of(f"/kappaskin/{finger}/line")[1] not in topics
    assert m.finger_of("/kappaskin/a_1/line") == ("a_1", m.LINES.name)
    assert m.finger_of(m.LINES.name) == ("", m.LINES.name)


@pytest.mark.parametrize("damaged", [True, False], ids=["at its beginning", "at its end"])
def test_a_damaged_one_is_repaired_finger_by_finger(
    damaged: bool, whole: Path, tmp_path: Path
) -> None:
    file = RecordingFile(tmp_path / "a.mcap", fingers=FINGERS)
    for n in range(40):
        for finger in FINGERS:
            file.put(m.LINES.of(finger), float(n), line(n))
        if n == 9:
            time.sleep(0.3)  # the rest is in other chunks
    file.close()
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    cut = tmp_path / "cut.mcap"
    if damaged:  # the chunk that says what the channels are
        data[1000:1100] = bytes(100)
    cut.write_bytes(data[: len(data) - 2000])
    *_, done = Repaired.steps(cut, tmp_path / "b.mcap")
    assert isinstance(done, Repaired)
    for finger in FINGERS:
        found = times(tmp_path / "b.mcap", finger)
        assert found == list(range(10 if damaged else 0, 40))


def test_a_replay_is_of_a_finger_that_is_named(whole: Path) -> None:
    with pytest.raises(Refusal, match=r"fingers thumb, index_2; play one, such as replay:.*#thumb"):
        ReplayedSource(whole)
    with closing(open_source(f"replay:{whole}#index_2")) as source:
        assert isinstance(source, ReplayedSource)
        assert source.length == 99.0
    with pytest.raises(Refusal, match="got 'ring'"):
        open_source(f"replay:{whole}#ring")


# The process that writes what those of fingers send.


def wait_for(ask: Callable[[], object], within: float = 30.0) -> object:
    end = time.monotonic() + within
    while not (answer := ask()) and time.monotonic() < end:
        time.sleep(0.02)
    return answer


@pytest.fixture
def recorder(tmp_path: Path) -> Iterator[HandRecorder]:
    made = HandRecorder(tmp_path / "hand.mcap", FINGERS)
    yield made
    made.close(10.0)


def test_a_finger_that_ends_leaves_the_others_alone(recorder: HandRecorder) -> None:
    thumb, index = (HandLine(recorder.part(finger)) for finger in FINGERS)
    thumb.put(m.LINES, 1.0, line(1))
    index.put(m.LINES, 2.0, line(2))
    index.attach("a.toml", "application/toml", b"a = 1")
    thumb.close()
    index.put(m.LINES, 3.0, line(3))
    assert wait_for(lambda: index.written.messages == 2)
    assert index.written.finger == "index_2"
    again = HandLine(recorder.part("thumb"))
    again.put(m.LINES, 4.0, line(4))
    for each in (index, again):
        each.close()
    recorder.close()
    assert (recorder.written.active, recorder.written.trouble) == (False, "")
    with Recording(recorder.path, "thumb") as recording:
        assert recording.whole
        seen = [(time, data != b"") for time, _, data in recording.lines()]
    assert [time for time, held in seen if held] == [1.0, 4.0]
    assert [held for _, held in seen] == [True, False, True, False]  # it ended, and ended again
    with Recording(recorder.path, "index_2") as recording:
        assert recording.attachment("a.toml") == b"a = 1"


def test_a_finger_that_dies_is_told_in_the_file(recorder: HandRecorder) -> None:
    part = recorder.part("thumb")
    with Client(part.address, authkey=part.key) as dies:
        dies.send("thumb")
        dies.send(([], [(m.LINES.name, 1.0, line(1))]))
        assert wait_for(lambda: recorder.poll().messages == 1)
    with closing(HandLine(recorder.part("index_2"))) as index:
        index.put(m.LINES, 2.0, line(2))
    recorder.close()
    with Recording(recorder.path, "thumb") as recording:
        (event,) = recording.events()
    assert (event.kind, "ended unexpectedly" in event.text) == ("engine", True)
    with Recording(recorder.path, "index_2") as recording:
        assert not list(recording.events())


def test_its_state_is_told_while_it_writes(recorder: HandRecorder) -> None:
    with closing(HandLine(recorder.part("thumb"))) as thumb:
        thumb.put(m.LINES, 1.0, line(1))
        assert wait_for(lambda: recorder.poll().messages == 1)
        assert recorder.poll().size > 600


@pytest.mark.skipif(os.name == "nt", reason="by a signal")
def test_where_the_writer_is_killed_the_fingers_say_so_and_the_file_is_read(
    recorder: HandRecorder,
) -> None:
    with closing(HandLine(recorder.part("thumb"))) as thumb:
        thumb.put(m.LINES, 1.0, line(1))
        assert wait_for(lambda: recorder.poll().messages == 1)
        os.kill(recorder._process.pid or 0, signal.SIGKILL)  # noqa: SLF001
        assert wait_for(lambda: thumb.written.trouble)
        assert "hand.mcap: the process that writes the recording has ended" in thumb.written.trouble
    assert wait_for(lambda: "broke off" in recorder.poll().trouble)
    assert times(part_of(recorder.path), "thumb") == [1.0]


def test_a_finger_that_hangs_does_not_keep_the_file_from_its_end(recorder: HandRecorder) -> None:
    part = recorder.part("thumb")
    with Client(part.address, authkey=part.key) as hangs:
        hangs.send("thumb")
        with closing(HandLine(recorder.part("index_2"))) as index:
            index.put(m.LINES, 1.0, line(1))
        recorder.close(20.0)
    assert (recorder.written.active, recorder.written.trouble) == (False, "")
    assert times(recorder.path, "index_2")[0] == 1.0


def test_no_file_is_written_over(whole: Path) -> None:
    with pytest.raises(Refusal, match="already exists"):
        HandRecorder(whole, FINGERS)


_ENDS = """
import os, sys, time
from pathlib import Path
from kappaskin.recording import HandRecorder, messages as m
from kappaskin.recording.writing import HandLine

if __name__ == "__main__":
    recorder = HandRecorder(Path(sys.argv[1]), ("thumb",))
    thumb = HandLine(recorder.part("thumb"))
    for n in range(100):
        thumb.put(m.LINES, float(n), m.pack_line(float(n), False, bytes(600)))
    time.sleep(1.0)
    os.kill(os.getpid(), 9)
"""


@pytest.mark.skipif(os.name == "nt", reason="by a signal")
def test_where_all_others_are_killed_the_file_is_ended(tmp_path: Path) -> None:
    path = tmp_path / "hand.mcap"
    (tmp_path / "ends.py").write_text(_ENDS)
    subprocess.run([sys.executable, str(tmp_path / "ends.py"), str(path)], check=False)
    assert wait_for(path.exists)
    assert len(times(path, "thumb")) == 101  # and that the line ended


def test_replays_that_begin_together_keep_what_fingers_are_apart(whole: Path) -> None:
    now = 100.0

    def clock() -> float:
        return now

    for finger, first in (("thumb", 0.0), ("index_2", 50.0)):
        now = 100.0
        path = whole.with_name(f"{whole.name}#{finger}")
        with closing(ReplayedSource(path, clock, lambda _: None)) as source:
            source.seek(0.0, 1.0, since=105.0)
            now = 104.9
            assert source.replay.at == 0.0
            source.read(0.0)
            assert next(source._messages).stamp <= 10**18 + (first + 1) * 1e9  # noqa: SLF001
            now = 105.0 + first + 0.1
            assert source.replay.at == pytest.approx(first + 0.1)
