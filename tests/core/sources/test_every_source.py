"""The laws that every source of frames keeps, one suite over all of them."""

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from kappaskin import Frame, Refusal, load_scene
from kappaskin.recording import Recorder, Recording, ReplayedSource
from kappaskin.recording.recompute import RecordedFrames
from kappaskin.sources import (
    Decoder,
    SerialSource,
    SimulatedSource,
    Source,
    named_sources,
    sensor_to_json,
)
from kappaskin.sources.wire import Information, Samples, encode_information, encode_samples

SCENE = replace(load_scene("circle"), rate=100.0)
SENSOR = SCENE.sensor()
FRAMES = 20


class Clock:
    """A clock that stands still but for those who sleep by it."""

    def __init__(self) -> None:
        self.now = time.monotonic()

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += max(seconds, 1e-4)


class CallLog:
    """A recorder that notes its calls, in order."""

    def __init__(self) -> None:
        self.told: list[tuple[str, tuple[object, ...]]] = []

    def __getattr__(self, what: str) -> Callable[..., None]:
        return lambda *told: self.told.append((what, told))

    def bytes_that(self, what: str) -> bytes:
        return b"".join(told[1] for name, told in self.told if name == what)


def simulated(request: pytest.FixtureRequest) -> Iterator[SimulatedSource]:
    clock = Clock()
    yield SimulatedSource(SCENE, clock, clock.sleep)


def replayed(request: pytest.FixtureRequest) -> Iterator[ReplayedSource]:
    clock = Clock()
    yield ReplayedSource(request.getfixturevalue("recording"), clock, clock.sleep)


def on_a_line(request: pytest.FixtureRequest) -> Iterator[SerialSource]:
    tty = pytest.importorskip("tty", reason="no pseudo-terminals on this system")
    master, slave = os.openpty()
    tty.setraw(slave)
    source = SerialSource(os.ttyname(slave))
    os.close(slave)
    os.write(master, encode_information(0, 0.0, sensor_to_json(SENSOR)))
    for n in range(1, FRAMES + 1):
        counts = np.full(SENSOR.channels, n, np.int32)
        os.write(master, encode_samples(n, n / 100, np.arange(SENSOR.channels), counts, 2))
    yield source
    os.close(master)


@pytest.fixture(params=[simulated, replayed, on_a_line], ids=lambda made: made.__name__)
def source(request: pytest.FixtureRequest) -> Iterator[Source]:
    for made in request.param(request):
        yield made
        made.close()


def frames_of(source: Source) -> list[Frame]:
    """The first frames that come, few."""
    frames, patience = list[Frame](), time.monotonic() + 30.0
    while len(frames) < FRAMES:
        assert time.monotonic() < patience, "nothing comes"
        frames += source.read(0.02)
    return frames


def test_it_says_what_the_device_is_before_its_first_frame_and_nothing_is_wrong(source) -> None:
    frames_of(source)

    assert source.sensor is not None
    assert source.sensor.serial_number == SENSOR.serial_number
    assert not source.trouble


def test_frames_come_in_order_each_with_a_count_for_each_of_its_channels(source) -> None:
    frames = frames_of(source)

    for a, b in pairwise(frames):
        assert b.sequence > a.sequence
        assert b.device_time > a.device_time
        assert b.host_time >= a.host_time
    for frame in frames:
        assert frame.counts.shape == frame.channels.shape
        assert 0 <= frame.channels.min() <= frame.channels.max() < SENSOR.channels


def test_every_byte_and_every_number_is_accounted_for(source) -> None:
    frames = frames_of(source)

    seen = source.accounting()
    assert seen.balanced
    assert seen.accepted >= len(frames)


def test_what_happened_is_told_once(source) -> None:
    frames_of(source)
    source.events()

    assert source.events() == []


def test_a_recorder_gets_what_the_same_frames_are_made_of(source) -> None:
    if isinstance(source, ReplayedSource):
        pytest.skip("what a recording brings is in its file")
    recorder = CallLog()
    source.record(recorder)

    frames = frames_of(source)

    came = Decoder().feed(recorder.bytes_that("received"))
    scans = {message.sequence: message for message in came if isinstance(message, Samples)}
    met = [told[0] for name, told in recorder.told if name == "connected"]
    met += [message.text for message in came if isinstance(message, Information)]
    assert sensor_to_json(SENSOR) in met
    for frame in frames:
        np.testing.assert_array_equal(scans[frame.sequence].counts, frame.counts)
    assert "clock" in [name for name, _ in recorder.told]


def test_it_can_be_closed_twice(source) -> None:
    source.close()
    source.close()


def test_a_recording_brings_the_same_frames_again(source, tmp_path) -> None:
    if isinstance(source, ReplayedSource):
        pytest.skip("what a recording brings is not recorded again")
    recorder = Recorder(tmp_path / "a.mcap", time.monotonic())
    source.record(recorder)

    frames = frames_of(source)

    recorder.close()
    again = RecordedFrames("a.mcap")
    with Recording(tmp_path / "a.mcap") as recording:
        found = [frame for message in recording.messages() for frame in again(message)]
    assert [of_one(frame) for frame in found] == [of_one(frame) for frame in frames]


def of_one(frame: Frame) -> tuple[object, ...]:
    """All that is read of a frame; text for times, since NaN is not itself."""
    times = (frame.device_time, frame.host_time, frame.taken, frame.taken_sd)
    return frame.sequence, repr(times), frame.channels.tobytes(), frame.counts.tobytes()


# Sources of several fingers.


def test_a_source_of_each_finger_has_its_name_before_it() -> None:
    assert named_sources(["thumb=sim:", "index_2=/dev/ttyACM0"]) == {
        "thumb": "sim:",
        "index_2": "/dev/ttyACM0",
    }
    assert named_sources(["a=socket://host:1?x=y=z"]) == {"a": "socket://host:1?x=y=z"}


@pytest.mark.parametrize("source", ["sim:", "socket://host:1?x=y", "./a=b.csv", "1=2", "=", "-"])
def test_one_alone_may_be_without_a_name_whatever_is_in_it(source: str) -> None:
    assert named_sources([source]) == {"": source}


def test_names_of_fingers_are_there_and_differ() -> None:
    with pytest.raises(Refusal, match="name for each of several sources, such as thumb=sim:"):
        named_sources(["index=sim:", "sim:"])
    with pytest.raises(Refusal, match="one source for the finger thumb, got two"):
        named_sources(["thumb=sim:", "index=sim:", "thumb=sim:circle"])
