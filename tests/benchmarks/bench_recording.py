"""What recording costs of a core, and how fast a recording is read, verified and repaired."""

import time
from dataclasses import replace

import numpy as np

from kappaskin import Pipeline, Setup, load_scene
from kappaskin.recorder import Recorder
from kappaskin.recording.reading import Recording
from kappaskin.sources import SimulatedSource

RATE = 1000.0  # frames/s
FRAMES = 4000


def test_recording_takes_little_of_a_core(figure, tmp_path) -> None:
    """1,000 frames/s of 300 channels with all that is made of them, by CPU time of all threads."""
    source = SimulatedSource(load_scene("circle"))
    pipeline = Pipeline(source.sensor, Setup())
    frames = []
    while len(frames) < FRAMES:
        frames += source.read(0.1)
    now = time.monotonic()
    frames = [replace(frame, host_time=now + n / RATE) for n, frame in enumerate(frames[:FRAMES])]
    began = time.process_time()
    estimates = [pipeline(frame) for frame in frames]
    computing = time.process_time() - began

    recorder = Recorder(tmp_path / "a.mcap", now)
    source.record(recorder)
    recorder.set_up(pipeline)
    began, start = time.process_time(), time.monotonic()
    slept = 0.0
    for n in range(0, FRAMES, 10):  # as they come, so that the file is written meanwhile
        for frame, estimate in zip(frames[n : n + 10], estimates[n : n + 10], strict=True):
            source._record(recorder, [frame])  # noqa: SLF001 - as `read` does
            recorder.take(frame, estimate)
        ahead = n / RATE - (time.monotonic() - start)
        if ahead > 0:
            slept += ahead
            time.sleep(ahead)
    recorder.close()
    spent = time.process_time() - began
    written = recorder.written
    share = spent / (FRAMES / RATE)
    assert slept > 0
    assert written.messages > 3 * FRAMES
    figure(
        f"recording {RATE:.0f} frames/s of 300 channels: {share:.3f} of a core, "
        f"{spent / computing:.2f} of what estimates of them cost, "
        f"{written.size / (FRAMES / RATE) / 1e6:.2f} MB/s"
    )
    assert spent / computing < 0.5

    began = time.process_time()
    with Recording(tmp_path / "a.mcap") as recording:
        count = sum(1 for _ in recording.messages())
    reading = time.process_time() - began
    figure(f"reading it: {FRAMES / RATE / reading:.0f} times as fast as it was recorded")
    assert count == written.messages
    assert np.isfinite(reading)
