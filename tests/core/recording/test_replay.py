"""Where a recording is played, and what comes when."""

import json
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import Event, Frame, Refusal, SensorLayout, load_scene
from kappaskin.recording import Recorder, Recording, ReplayedSource, contacts_in
from kappaskin.recording import messages as m
from kappaskin.sources import SimulatedSource, sensor_to_json
from kappaskin.sources.wire import encode_information, encode_samples

RATE, FRAMES, GAP = 500.0, 1000, 1.25
FIRST, LAST = 0, FRAMES - 1


class Clock:
    """A clock that only goes while somebody sleeps."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += max(seconds, 1e-4)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory, written_out):
    """A thousand frames with a gap in their middle, and an event at either side of it."""
    path, clock = tmp_path_factory.mktemp("replayed") / "circle.mcap", Clock()
    source = SimulatedSource(load_scene("circle"), clock, clock.sleep)
    recorder = Recorder(path, clock())
    source.record(recorder)
    count, shift = 0, 0.0
    recorder.add_event(Event(clock(), "note", "before"))
    put = recorder._file.put  # noqa: SLF001 - to let time pass for the file alone
    recorder._file.put = lambda topic, when, data: put(topic, when + shift, data)  # noqa: SLF001
    while count < FRAMES:
        count += len(source.read(1.0))
        if count == FRAMES // 2 and not shift:
            written_out(recorder)
            shift = GAP
            recorder.add_event(Event(clock(), "note", "after"))
        elif count % 100 == 0:
            written_out(recorder)
    recorder.close()
    return path


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def source(recorded, clock):
    made = ReplayedSource(recorded, clock, clock.sleep)
    yield made
    made.close()


def played(source, clock, seconds):
    """The frames of so many seconds."""
    end, frames = clock() + seconds, list[Frame]()
    while clock() < end:
        frames += source.read(min(0.02, end - clock()))
    return frames


def numbers(frames):
    return [frame.sequence for frame in frames]


def one(source):
    """The frame that is given next, the only one."""
    frames = source.read(0.01)
    assert source.read(0.01) == []
    assert len(frames) == 1
    return frames[0].sequence


@pytest.mark.full
def test_it_is_as_long_as_it_was_with_its_gap_and_events(source) -> None:
    replay = source.replay
    assert replay.length == pytest.approx((FRAMES - 1) / RATE + GAP, abs=0.02)
    [(begin, end)] = replay.gaps
    assert end - begin == pytest.approx(GAP, abs=0.02)
    assert [event.text for event in replay.events] == ["before", "after"]
    assert replay.events[1].time == pytest.approx(end, abs=0.01)
    assert (replay.at, replay.speed, replay.looped) == (0.0, 1.0, False)


@pytest.mark.full
def test_a_word_about_the_clock_ends_no_gap(tmp_path, clock, written_out) -> None:
    path = tmp_path / "gap.mcap"
    recorder = Recorder(path, 0.0)
    for when in (0.0, 0.1, 0.8, 1.5, 2.2, 2.25, 2.5, 2.6, 3.5):
        recorder.received(when, encode_information(0, 0.0, "{}"))
        written_out(recorder)
    recorder.close()
    with closing(ReplayedSource(path, clock, clock.sleep)) as source:
        gaps = source.replay.gaps
    assert np.array(gaps) == pytest.approx(np.array([(0.1, 2.2), (2.6, 3.5)]), abs=1e-3)


def test_frames_come_when_they_came(source, clock) -> None:
    began = clock()
    frames = played(source, clock, 5.0)
    assert numbers(frames) == list(range(FRAMES))
    came = np.array([frame.host_time for frame in frames]) - began
    steps = np.diff(came)
    assert np.delete(steps, FRAMES // 2 - 1) == pytest.approx(1 / RATE, abs=2e-4)
    assert steps[FRAMES // 2 - 1] == pytest.approx(1 / RATE + GAP, abs=2e-3)
    assert all(frame.host_time <= clock() for frame in frames)
    assert [event.text for event in source.events()] == ["before", "after"]
    assert source.events() == []
    assert source.replay.at == source.length
    assert source.read(0.01) == []


@pytest.mark.parametrize("speed", [0.1, 0.5, 4.0, 10.0])
def test_faster_and_slower(speed, source, clock) -> None:
    source.seek(0.0, speed)
    frames = played(source, clock, 0.5 / speed)
    assert len(frames) == pytest.approx(0.5 * RATE, abs=6)


def test_it_goes_faster_than_it_can_no_more_than_ten_times(source) -> None:
    source.seek(0.0, 1e9)
    assert source.replay.speed == 10.0
    source.seek(0.0, -5.0)
    assert source.replay.speed == 0.0


def test_paused_it_stands_and_then_goes_on(source, clock) -> None:
    before = played(source, clock, 0.4)
    source.seek(None, 0.0)
    assert played(source, clock, 3.0) == []
    source.seek(None, 1.0)
    after = played(source, clock, 0.4)
    assert numbers(before + after) == list(range(len(before + after)))
    assert len(after) > 150


@pytest.mark.parametrize("at", [0.0, 0.3, 0.999, 2.4, 3.1])
def test_it_goes_on_from_anywhere(at, source, clock) -> None:
    played(source, clock, 0.2)
    source.seek(at, 1.0)
    frames = played(source, clock, 0.05)
    expected = at * RATE if at < 1.0 else max((at - GAP) * RATE, FRAMES // 2)
    if at == 0.999:  # right before the gap
        assert numbers(frames) in ([], [FRAMES // 2 - 1])
        return
    assert frames[0].sequence == pytest.approx(expected, abs=2)
    assert numbers(frames) == list(range(frames[0].sequence, frames[0].sequence + len(frames)))
    assert np.isfinite([frame.taken for frame in frames]).all()


@pytest.mark.parametrize(("at", "kept"), [(-5.0, 0.0), (1e9, None), (float("inf"), None)])
def test_there_is_nothing_before_the_beginning_and_after_the_end(at, kept, source) -> None:
    source.seek(at, 0.0)
    assert source.replay.at == (source.length if kept is None else kept)


def test_standing_it_gives_the_one_frame_that_is_there(source, clock) -> None:
    source.seek(0.5, 0.0)
    [frame] = played(source, clock, 1.0)
    assert frame.sequence == pytest.approx(0.5 * RATE, abs=1)
    assert source.replay.at == 0.5


def test_frame_by_frame_forth_and_back(source) -> None:
    source.seek(0.5, 0.0)
    here = one(source)
    for step, to in ((1, 1), (1, 2), (5, 7), (-1, 6), (-3, 3), (-3, 0), (1, 1)):
        source.step(step)
        if step > 1:
            assert len(source.read(0.01)) == step
        else:
            assert one(source) == here + to
    assert source.replay.speed == 0.0


def test_over_the_gap_and_back(source) -> None:
    source.seek(0.99, 0.0)
    while (number := one(source)) < FRAMES // 2 - 1:
        source.step(1)
    source.step(1)
    assert one(source) == FRAMES // 2
    assert source.replay.at > 1.0 + GAP - 0.02
    source.step(-1)
    assert one(source) == number


def test_no_further_than_the_ends(source) -> None:
    source.step(-1)
    assert one(source) == FIRST
    source.step(-10)
    assert one(source) == FIRST
    source.seek(source.length, 0.0)
    assert one(source) == LAST
    for _ in range(3):
        source.step(1)
        assert source.read(0.01) == []
    source.step(-1)
    assert one(source) == LAST - 1


def test_looped_it_begins_anew(source, clock) -> None:
    source.seek(source.length - 0.1, 1.0, True)
    frames = numbers(played(source, clock, 0.5))
    again = frames.index(FIRST)
    assert frames[again - 1] == LAST
    assert frames[again:] == list(range(len(frames) - again))
    source.seek(None, 1.0, False)
    played(source, clock, 5.0)
    assert source.read(0.01) == []


def test_it_is_one_sensor_all_the_time(source, clock) -> None:
    sensor = source.sensor
    assert sensor is not None
    for at in (0.7, 0.1, 3.0, 0.0):
        source.seek(at, 1.0)
        assert played(source, clock, 0.02)
        assert source.sensor is sensor


def test_the_same_frames_come_whatever_way_they_are_reached(source, clock) -> None:
    frames = {frame.sequence: frame for frame in played(source, clock, 5.0)}
    for at in (0.2, 2.6, 0.9):
        source.seek(at, 4.0)
        for frame in played(source, clock, 0.02):
            other = frames[frame.sequence]
            assert frame.counts.tobytes() == other.counts.tobytes()
            assert frame.device_time == other.device_time
            assert frame.truth.coefficients.tobytes() == other.truth.coefficients.tobytes()


# More than one device, and bytes that mean nothing


class Line:
    """Takes down what somebody scripts."""

    def __init__(self, path):
        self._recorder = Recorder(path, 0.0)
        self._time = 0.0
        self.close = self._recorder.close

    def says(self, data):
        self._time += 1e-3
        self._recorder.received(self._time, data)

    def ends(self):
        self._recorder.disconnected(self._time)

    def scans(self, sensor, first, count):
        for n in range(first, first + count):
            counts = np.full(sensor.channels, n % 1000, np.int32)
            self.says(encode_samples(n, n * 1e-3, np.arange(sensor.channels), counts, 2))


def test_a_device_that_gives_way_to_another_does_so_again(tmp_path, clock) -> None:
    path = tmp_path / "two.mcap"
    one_ = load_scene("centre").sensor()
    other = replace(one_, layout=SensorLayout.regular(one_.layout.patch, 4, 4))
    line = Line(path)
    line.says(encode_information(0, 0.0, sensor_to_json(one_)))
    line.scans(one_, 1, 20)
    line.says(b"nothing that means anything")
    line.says(encode_information(21, 0.021, sensor_to_json(other)))
    line.scans(other, 22, 20)
    line.ends()
    line.says(encode_information(0, 0.0, json.dumps({"name": "of no use"})))
    line.scans(one_, 1, 5)
    line.close()
    source = ReplayedSource(path, clock, clock.sleep)
    seen = list[tuple[int, int]]()
    for _ in range(60):
        frames = source.read(0.002)
        assert len({len(frame.counts) for frame in frames}) < 2
        if frames:
            assert source.sensor is not None
            assert source.sensor.channels == len(frames[0].counts)
        seen += [(frame.sequence, len(frame.counts)) for frame in frames]
    assert seen == [(n, one_.channels) for n in range(1, 21)] + [
        (n, other.channels) for n in range(22, 42)
    ]
    assert "cannot be used" in source.trouble or "lacks" in source.trouble
    assert source.accounting().balanced
    assert source.accounting().bytes_discarded == len(b"nothing that means anything")
    source.close()


def test_damage_in_the_middle_is_met_where_it_is(recorded, tmp_path, clock) -> None:
    path = tmp_path / "damaged.mcap"
    with Recording(recorded) as recording:
        chunk = recording.chunks[len(recording.chunks) // 2]
        data = bytearray(recorded.read_bytes())
    data[chunk.at + 200] ^= 0xFF
    path.write_bytes(data)
    source = ReplayedSource(path, clock, clock.sleep)
    frames = list[Frame]()

    def play():
        for _ in range(2000):
            frames.extend(source.read(0.02))

    with pytest.raises(Refusal, match=r"damaged at byte.*repair"):
        play()
    assert numbers(frames) == list(range(len(frames)))
    assert len(frames) > 100
    source.close()


def test_one_that_was_never_ended_is_played_up_to_there(recorded, tmp_path, clock) -> None:
    path = tmp_path / "cut.mcap"
    data = recorded.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    source = ReplayedSource(path, clock, clock.sleep)
    frames = played(source, clock, 3.0)
    assert numbers(frames) == list(range(len(frames)))
    assert len(frames) > 100
    source.close()


def test_bytes_of_no_device_are_no_replay(tmp_path) -> None:
    line = Line(tmp_path / "none.mcap")
    line.close()
    with pytest.raises(Refusal, match="recording"):
        ReplayedSource(tmp_path / "none.mcap")
    assert m.LINES.name == "/kappaskin/line"


def test_the_contacts_of_a_recording_come_in_parts_with_their_times(recording) -> None:
    with Recording(recording) as read:
        length, count = read.seconds(read.last), sum(1 for _ in read.messages_on(m.CONTACTS))
    parts = list(contacts_in(recording))

    times = np.concatenate([times for _, times, _ in parts])
    assert {length for length, _, _ in parts} == {length}
    assert len(times) == count > 100
    assert (np.diff(times) >= 0).all()
    assert times[-1] <= length
    fields = parts[0][2]
    assert fields["position"].shape == (len(parts[0][1]), 2)
    assert fields["present"].any()
    assert np.nanmedian(fields["force"]) > 0.1


def test_contacts_of_what_is_no_recording_are_refused(tmp_path) -> None:
    (tmp_path / "no.mcap").write_bytes(b"nothing")
    with pytest.raises(Refusal, match=r"no\.mcap"):
        next(contacts_in(tmp_path / "no.mcap"))
