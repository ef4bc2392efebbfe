"""What is live to a recording: what is left of one when another has begun."""

import gc
import time
import tomllib
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime
from types import SimpleNamespace

import numpy as np
import pytest

from kappaskin import Calibration, Pipeline, Setup, load_scene
from kappaskin.calibration.calibration import fingerprint
from kappaskin.estimation import METHODS
from kappaskin.live.recorder import LiveRecorder
from kappaskin.recording import Recorder, Recording, Verification
from kappaskin.scenes import SCENES
from kappaskin.scenes.effects import SECOND_GENERATION_LOOPS, StuckElements
from kappaskin.sources import SimulatedSource

NO_SIDE = SimpleNamespace(pipeline=None, excluded=None)


def recorders() -> int:
    gc.collect()
    return sum(isinstance(held, Recorder) for held in gc.get_objects())


def test_recordings_one_after_another_leave_only_the_newest_in_memory(tmp_path) -> None:
    keeping = LiveRecorder()
    for number in range(5):
        keeping.begin(tmp_path / f"{number}.mcap", None, NO_SIDE)
    deadline = time.monotonic() + 20
    while recorders() > 1 and time.monotonic() < deadline:
        assert keeping.check(None) == ""
        time.sleep(0.02)

    assert recorders() == 1
    assert keeping.status.path == str(tmp_path / "4.mcap")
    assert keeping.status.active
    keeping.close()
    assert sorted(file.name for file in tmp_path.iterdir()) == [f"{n}.mcap" for n in range(5)]


def test_what_was_written_last_is_told_when_nothing_is_recorded_any_more(tmp_path) -> None:
    keeping = LiveRecorder()
    keeping.begin(tmp_path / "a.mcap", None, NO_SIDE)
    keeping.end(None)
    deadline = time.monotonic() + 20
    while keeping.status.active or not keeping.status.path:
        assert time.monotonic() < deadline
        keeping.check(None)
        time.sleep(0.01)

    keeping.check(None)

    assert keeping.status.path == str(tmp_path / "a.mcap")
    assert not keeping.status.active


def test_that_another_recording_is_refused_is_told_while_the_last_one_still_ends(tmp_path) -> None:
    keeping, taken = LiveRecorder(), tmp_path / "b.mcap"
    taken.write_bytes(b"somebody's")
    keeping.begin(tmp_path / "a.mcap", None, NO_SIDE)

    keeping.begin(taken, None, NO_SIDE)

    for _ in range(2):
        assert keeping.check(None) == ""
        assert keeping.status.path == str(taken)
        assert "already exists" in keeping.status.trouble
        keeping.close()


def test_what_was_connected_twice_comes_to_the_same_again(tmp_path) -> None:
    now, path = [100.0], tmp_path / "a.mcap"
    scene = replace(load_scene("circle"), rate=100.0)
    with closing(LiveRecorder()) as keeping:
        keeping.begin(path, None, NO_SIDE)
        for generation in (1, 2):
            source = SimulatedSource(scene, lambda: now[0])
            keeping.connect(source)
            pipeline = Pipeline(source.sensor, calibrated(source.sensor), generation)
            keeping.set_up(SimpleNamespace(pipeline=pipeline))
            for _ in range(10):
                now[0] += 0.01
                for frame in source.read(0.0):
                    keeping.take(frame, pipeline(frame))
            keeping.source_ended()

    *_, verdict = Verification.steps(path)

    assert verdict.same, verdict.words


def test_what_another_device_remembered_is_not_taken_for_that_of_the_next(tmp_path) -> None:
    now, path = [100.0], tmp_path / "a.mcap"
    before = SimulatedSource(load_scene("circle"), lambda: now[0])
    source = SimulatedSource(load_scene("fingertip"), lambda: now[0])
    with closing(LiveRecorder()) as keeping:
        gone = Pipeline(before.sensor, calibrated(before.sensor))
        keeping.begin(path, before, SimpleNamespace(pipeline=gone, excluded=None))
        keeping.source_ended()
        keeping.connect(source)
        pipeline = Pipeline(source.sensor, calibrated(source.sensor), 1)
        keeping.set_up(SimpleNamespace(pipeline=pipeline))
        now[0] += 0.01
        for frame in source.read(0.0):
            keeping.take(frame, pipeline(frame))

    *_, verdict = Verification.steps(path)

    assert verdict.same, verdict.words


def calibrated(sensor) -> Setup:
    """With loops to be undone: what is read depends on all that was before."""
    ones, date = np.ones(sensor.channels), datetime(2026, 1, 1, tzinfo=UTC)
    said = sensor.name, sensor.serial_number, sensor.firmware, fingerprint(sensor.layout), date
    loops = SECOND_GENERATION_LOOPS.operator(sensor.channels)
    return Setup(
        4, 4, 9, 9, calibration=Calibration(*said, ones, 0 * ones, 0 * ones, 0 * ones, loops)
    )


def test_every_ready_scene_is_recorded_one_that_no_file_tells_by_its_name(tmp_path) -> None:
    with closing(Recorder(tmp_path / "a.mcap", 0.0)) as recorder:
        for name in SCENES:
            recorder.plays(load_scene(name))

    with Recording(tmp_path / "a.mcap") as recording:
        told = [recording.attachment(f"scene-{n}.toml").decode() for n in range(len(SCENES))]
    for name, text in zip(SCENES, told, strict=True):
        said = tomllib.loads(text)
        assert said.get("format") == 1 or text.startswith(f"# {name}: expected ")


@pytest.mark.cases("bayes", "fast", "finite-slope", "tracking")
@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_what_is_recorded_from_the_middle_comes_to_the_same_again(method, tmp_path) -> None:
    now, path = [100.0], tmp_path / "a.mcap"
    scene = load_scene("failing-elements")
    others = tuple(e for e in scene.effects if not isinstance(e, StuckElements))
    scene = replace(scene, rate=100.0, effects=(StuckElements((27, 63), 0.01), *others))
    source = SimulatedSource(scene, lambda: now[0])
    pipeline = Pipeline(source.sensor, replace(calibrated(source.sensor), method=method))

    def play(seconds: float) -> None:
        for _ in range(round(10 * seconds)):
            now[0] += 0.1  # ten frames that arrive at once
            for frame in source.read(0.0):
                keeping.take(frame, pipeline(frame))

    with closing(LiveRecorder()) as keeping:
        play(0.2)
        keeping.begin(path, source, SimpleNamespace(pipeline=pipeline, excluded=None))
        play(0.4)

    *_, verdict = Verification.steps(path)

    assert verdict.same, verdict.words
