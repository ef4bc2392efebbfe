"""Recordings as the live process plays them, and what is told of them."""

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from kappaskin import Engine, Recording, Refusal, Setup, Status
from kappaskin.live import LONGEST_NOTE
from kappaskin.recording import ReplayedSource, Verification, recorded_setups
from kappaskin.recording.cdr import decode
from kappaskin.recording.messages import EVENTS, LOG

pytestmark = pytest.mark.slow

Clock = list[float]


@pytest.fixture
def clock() -> Clock:
    return [0.0]


@pytest.fixture
def source(recording: Path, clock: Clock) -> Iterator[ReplayedSource]:
    source = ReplayedSource(
        recording, lambda: clock[0], lambda s: clock.__setitem__(0, clock[0] + s)
    )
    yield source
    source.close()


def test_gaps_events_and_the_day_are_told(source: ReplayedSource, recording: Path) -> None:
    replay = source.replay
    assert replay.gaps == (pytest.approx((1.0, 1.8), abs=0.015),)
    assert [(e.time, e.kind, e.text) for e in replay.events] == [
        (pytest.approx(0.5, abs=0.015), "note", "the object is changed")
    ]
    assert replay.whole
    assert abs(replay.begun - recording.stat().st_mtime) < 60
    assert replay.length == pytest.approx(2.5, abs=0.02)


def test_the_setups_recorded_are_told_with_their_times(recording: Path) -> None:
    with Recording(recording) as opened:
        found = recorded_setups(opened)
    assert [(s.Ni, s.Nj) for _, s in found] == [(8, 8), (6, 7), (6, 7)]
    assert [t for t, _ in found] == pytest.approx([0.0, 0.7, 1.8], abs=0.02)


def test_what_is_there_of_a_recording_cut_off_tells_its_setups_too(
    recording: Path, tmp_path: Path
) -> None:
    with Recording(recording) as opened:
        within_the_last = opened.chunks[-1].at + 100
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(recording.read_bytes()[:within_the_last])
    with Recording(cut) as opened:
        assert not opened.whole
        assert [(s.Ni, s.Nj) for _, s in recorded_setups(opened)][:2] == [(8, 8), (6, 7)]


def test_a_standing_recording_gives_its_frame_again_and_no_other(
    source: ReplayedSource, clock: Clock
) -> None:
    source.seek(0.4, 0.0)
    (first,) = source.read(0.0)
    assert not source.read(0.0)
    source.again()
    (again,) = source.read(0.0)
    assert again.sequence == first.sequence
    assert np.array_equal(again.counts, first.counts)
    source.step(1)
    (following,) = source.read(0.0)
    assert following.sequence == first.sequence + 1


def test_a_step_is_a_step_where_the_frame_was_asked_for_again(source: ReplayedSource) -> None:
    source.seek(0.4, 0.0)
    (first,) = source.read(0.0)
    source.again()
    source.step(1)
    assert [frame.sequence for frame in source.read(0.0)] == [first.sequence + 1]
    assert not source.read(0.0)


@pytest.mark.parametrize(
    ("steps", "to"), [([1] * 5, 5), ([2, 3], 5), ([-1] * 5, -5), ([-2, 3], 1), ([-1, 1, -1], -1)]
)
def test_steps_asked_for_before_a_frame_is_given_are_added(
    source: ReplayedSource, steps: list[int], to: int
) -> None:
    source.seek(0.4, 0.0)
    (first,) = source.read(0.0)
    for step in steps:
        source.step(step)
    assert source.read(0.0)[-1].sequence == first.sequence + to
    source.step(1)
    assert source.read(0.0)[-1].sequence == first.sequence + to + 1


def test_one_that_plays_is_not_held_up_by_being_asked_again(
    source: ReplayedSource, clock: Clock
) -> None:
    source.seek(0.2, 1.0)
    clock[0] += 0.1
    seen = [frame.sequence for frame in source.read(0.0)]
    source.again()
    clock[0] += 0.1
    seen += [frame.sequence for frame in source.read(0.0)]
    assert seen == list(range(seen[0], seen[0] + len(seen)))


def test_a_file_that_cannot_be_read_any_more_is_a_refusal(
    source: ReplayedSource, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(*_: object) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr("kappaskin.recording.reading.record_at", gone)
    with pytest.raises(Refusal, match="can no longer be read"):
        source.seek(2.0, 1.0)


# As the live process plays them.


def until(holds: Callable[[], bool], patience: float = 60.0) -> None:
    end = time.monotonic() + patience
    while not holds():
        assert time.monotonic() < end, "it never came to hold"
        time.sleep(0.01)


@pytest.fixture
def engine(recording: Path) -> Iterator[Engine]:
    """It stands at the beginning of the recording."""
    with Engine(Setup()) as engine:
        engine.connect(f"replay:{recording}")
        engine.seek(0.0, 0.0)
        until(lambda: _ready(engine.status()))
        yield engine


def _ready(status: Status) -> bool:
    return status.replay is not None and status.slot is not None and not status.computing


def _place(engine: Engine) -> float | None:
    replay = engine.status().replay
    return replay and replay.at


def _sequence(engine: Engine) -> int | None:
    estimate = engine.latest(engine.status())
    return estimate.sequence if estimate else None


def test_of_many_places_asked_for_in_a_row_the_last_is_shown(engine: Engine) -> None:
    for at in np.linspace(0.9, 0.3, 60):
        engine.seek(float(at), 0.0)
    until(lambda: _place(engine) == 0.3)
    until(lambda: _sequence(engine) in (29, 30, 31))


def test_another_setup_is_seen_of_a_recording_that_stands(engine: Engine) -> None:
    engine.seek(0.5, 0.0)
    until(lambda: (_sequence(engine) or 0) > 40)
    sequence = _sequence(engine)
    engine.set_up(Setup(5, 4))
    engine.compare(Setup(3, 3))

    def shown() -> bool:
        status = engine.status()
        a, b = engine.pair(status) or (None, None)
        return a is not None and b is not None and a.coefficients.shape == (5, 4)

    until(shown)
    status = engine.status()
    a, b = engine.pair(status) or (None, None)
    assert a is not None
    assert b is not None
    assert a.sequence == b.sequence == sequence
    assert b.coefficients.shape == (3, 3)


@pytest.mark.full
def test_a_recording_goes_on_through_a_replay_which_is_not_recorded(
    recording: Path, tmp_path: Path
) -> None:
    path = tmp_path / "live.mcap"
    with Engine(Setup()) as engine:
        engine.connect("sim:centre")
        until(lambda: engine.status().slot is not None)
        engine.record(path)
        until(lambda: engine.status().recording.messages > 50)
        engine.connect(f"replay:{recording}")
        until(lambda: _ready(engine.status()))
        engine.note("meanwhile")
        time.sleep(0.8)
        assert engine.status().recording.active
        engine.connect("sim:centre")
        until(lambda: engine.status().state == "streaming" and engine.status().slot is not None)
        time.sleep(0.5)
        engine.record(None)
        until(lambda: path.exists())
    *_, verdict = Verification.steps(path)
    assert isinstance(verdict, Verification)
    assert verdict.same
    source = ReplayedSource(path)
    assert "meanwhile" in [event.text for event in source.replay.events]
    source.close()


def test_a_file_cut_off_while_it_is_played_ends_the_replay_alone(
    recording: Path, tmp_path: Path
) -> None:
    copy = tmp_path / "copy.mcap"
    copy.write_bytes(recording.read_bytes())
    with Engine(Setup()) as engine:
        engine.connect(f"replay:{copy}")
        engine.seek(0.0, 0.0)
        until(lambda: _ready(engine.status()))
        os.truncate(copy, 1000)
        engine.seek(2.2, 1.0)
        until(lambda: engine.status().state == "lost")
        assert "copy.mcap" in engine.status().message
        assert engine.status().replay is None
        assert engine.alive
        engine.connect("sim:centre")
        until(lambda: engine.status().state == "streaming")


def test_a_note_too_long_for_a_status_is_refused() -> None:
    with Engine(Setup()) as engine, pytest.raises(Refusal, match="at most 500 characters"):
        engine.note("x" * (LONGEST_NOTE + 1))


def test_what_a_recording_brings_happens_but_is_not_recorded_again(
    recording: Path, tmp_path: Path
) -> None:
    path = tmp_path / "new.mcap"
    with Engine(Setup()) as engine:
        engine.record(path)
        engine.connect(f"replay:{recording}")
        until(lambda: "the object is changed" in [e.text for e in engine.status().events])
        engine.note("by whom this is recorded")
        engine.record(None)
        until(path.exists)

    with Recording(path) as opened:
        told = [decode(LOG, message.data)["msg"] for message in opened.messages_on(EVENTS)]
    assert told == ["by whom this is recorded"]
