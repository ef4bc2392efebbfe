"""What recording costs of a core, and how fast a recording is read, verified and repaired."""

import time
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import Pipeline, Setup, load_scene
from kappaskin.recording import (
    Exported,
    ExportRequest,
    ExportTask,
    Recorder,
    Recording,
    RecordingStatus,
)
from kappaskin.sources import SimulatedSource, VirtualClock
from kappaskin.sources.wire import encode_samples

RATE = 1000.0  # frames/s
FRAMES = 4000


def test_recording_takes_little_of_a_core(figure, ratio, tmp_path) -> None:
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

    def spent(name, tell) -> tuple[float, RecordingStatus]:
        """CPU seconds of all threads, as frames come, so that the file is written meanwhile."""
        recorder = Recorder(tmp_path / name, now)
        source.record(recorder)
        recorder.set_up(pipeline)
        began, start = time.process_time(), time.monotonic()
        for n in range(FRAMES):
            tell(recorder, n)
            recorder.take(frames[n], estimates[n])
            ahead = n / RATE - (time.monotonic() - start)
            if n % 10 == 0 and ahead > 0:
                time.sleep(ahead)
        recorder.close()
        return time.process_time() - began, recorder.written

    sent = [encode_samples(f.sequence, f.device_time, f.channels, f.counts, 2) for f in frames]
    for kind, tell in (
        ("a device", lambda recorder, n: recorder.received(frames[n].host_time, sent[n])),
        (
            "a simulation with its truth",
            lambda recorder, n: source._record(recorder, [frames[n]]),  # noqa: SLF001 - as `read`
        ),
    ):
        cpu, written = spent(f"{kind}.mcap", tell)
        assert written.messages > 2 * FRAMES
        figure(
            f"recording {RATE:.0f} frames/s of 300 channels, {kind}: {cpu / (FRAMES / RATE):.3f} "
            f"of a core, {cpu / computing:.2f} of what estimates of them cost, "
            f"{written.size / (FRAMES / RATE) / 1e6:.2f} MB/s"
        )
        ratio(f"recording {kind}, against estimates", cpu / computing, at_most=0.5)

    began = time.process_time()
    with Recording(tmp_path / f"{kind}.mcap") as recording:
        count = sum(1 for _ in recording.messages())
    reading = time.process_time() - began
    figure(f"reading it: {FRAMES / RATE / reading:.0f} times as fast as it was recorded")
    assert count == written.messages
    assert np.isfinite(reading)


@pytest.fixture(scope="module")
def long(tmp_path_factory):
    """A recording of 12 s of the simulation at 1,000 frames/s."""
    path, clock, scene = (
        tmp_path_factory.mktemp("long") / "a.mcap",
        VirtualClock(),
        load_scene("circle"),
    )
    quick = replace(scene.transduction.converter, conversion_time=1e-6)  # or a scan takes 1.5 ms
    chain = replace(scene.transduction, converter=quick)
    source = SimulatedSource(replace(scene, rate=RATE, transduction=chain), clock, clock.sleep)
    with closing(Recorder(path, clock())) as recorder:
        source.record(recorder)
        recorder.set_up(Pipeline(source.sensor, Setup()))
        while clock() < 12.0:
            source.read(0.1)
            recorder.wait()
    return path


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_an_export_of_12_s_is_small_by_default(suffix: str, long, figure, tmp_path) -> None:
    began = time.monotonic()
    with ExportTask(ExportRequest(long, tmp_path / f"a{suffix}")) as task:
        *_, done = task.wait()
    size = (tmp_path / f"a{suffix}").stat().st_size
    figure(
        f"export of 12 s at {RATE:.0f} frames/s as {suffix}: {size / 1e6:.2f} MB, "
        f"in {time.monotonic() - began:.1f} s"
    )
    assert isinstance(done, Exported)
    assert done.written == pytest.approx(12 * RATE, rel=0.01)
    assert size < 2e6
