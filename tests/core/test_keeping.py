"""What is live to a recording: what is left of one when another has begun."""

import gc
import time
from types import SimpleNamespace

from kappaskin.keeping import Keeping
from kappaskin.recorder import Recorder

NO_SIDE = SimpleNamespace(pipeline=None, left=None)


def recorders() -> int:
    gc.collect()
    return sum(isinstance(held, Recorder) for held in gc.get_objects())


def test_recordings_one_after_another_leave_only_the_newest_in_memory(tmp_path) -> None:
    keeping = Keeping()
    for number in range(5):
        keeping.begin(tmp_path / f"{number}.mcap", None, NO_SIDE)
    deadline = time.monotonic() + 20
    while recorders() > 1 and time.monotonic() < deadline:
        assert keeping.look(None) == ""
        time.sleep(0.02)

    assert recorders() == 1
    assert keeping.written.path == str(tmp_path / "4.mcap")
    assert keeping.written.active
    keeping.close()
    assert sorted(file.name for file in tmp_path.iterdir()) == [f"{n}.mcap" for n in range(5)]


def test_what_was_written_last_is_told_when_nothing_is_recorded_any_more(tmp_path) -> None:
    keeping = Keeping()
    keeping.begin(tmp_path / "a.mcap", None, NO_SIDE)
    keeping.end(None)
    deadline = time.monotonic() + 20
    while keeping.written.active or not keeping.written.path:
        assert time.monotonic() < deadline
        keeping.look(None)
        time.sleep(0.01)

    keeping.look(None)

    assert keeping.written.path == str(tmp_path / "a.mcap")
    assert not keeping.written.active
