"""Several fingers at once: each its own engine, one file, one clock."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from kappaskin import Setup
from kappaskin._processes import BackgroundProcess
from kappaskin.live import LOST, STREAMING, Fingers
from kappaskin.recording import Recording, Verification
from kappaskin.recording import messages as m

pytestmark = pytest.mark.slow

SOURCES = {"thumb": "sim:circle", "index": "sim:circle"}


def wait_for(ask: Callable[[], object], within: float = 60.0) -> object:
    end = time.monotonic() + within
    while not (answer := ask()) and time.monotonic() < end:
        time.sleep(0.02)
    return answer


@pytest.fixture
def hand() -> Iterator[Fingers]:
    with Fingers(SOURCES, Setup(quantities=())) as made:
        yield made


def streams(hand: Fingers, finger: str) -> bool:
    engine = hand.engines[finger]
    status = engine.status()
    return status.state == STREAMING and engine.latest(status) is not None


def test_fingers_are_aligned_on_one_clock(hand: Fingers) -> None:
    hand.connect(SOURCES)
    assert wait_for(lambda: len(hand.aligned(hand.status())) == 2)
    for _ in range(5):
        time.sleep(0.1)
        found = hand.aligned(hand.status())
        taken = [estimate.taken for estimate in found.values()]
        assert all(np.isfinite(estimate.taken_sd) for estimate in found.values())
        # Computed frames of a busy machine may be far apart, but not as those of two clocks.
        assert max(taken) - min(taken) < 0.5
        assert abs(time.monotonic() - max(taken)) < 5.0


@pytest.mark.skipif(os.name == "nt", reason="by a signal")
def test_a_finger_that_is_killed_goes_on_in_the_same_file(hand: Fingers, tmp_path: Path) -> None:
    path = tmp_path / "hand.mcap"
    hand.record(path)
    hand.connect(SOURCES)
    assert wait_for(lambda: all(streams(hand, finger) for finger in SOURCES))
    time.sleep(0.5)
    was = hand.engines["index"].pid
    os.kill(was or 0, signal.SIGKILL)
    assert wait_for(lambda: hand.status()["index"].state == LOST)
    assert hand.status()["index"].recording.trouble == ""  # the file goes on
    hand.revive()
    assert hand.engines["index"].pid != was
    assert wait_for(lambda: streams(hand, "index"))
    assert streams(hand, "thumb")
    time.sleep(0.5)
    written = hand.end_recording()
    assert (written.active, written.trouble, written.path) == (False, "", str(path))
    assert not [event for event in hand.status()["thumb"].events if event.kind == "engine"]
    for finger, devices in (("thumb", 1), ("index", 2)):
        with Recording(path, finger) as recording:
            assert recording.whole
            assert recording.counts[m.DEVICE.name] == devices
        about = "verify", Verification.steps, path, finger
        with BackgroundProcess[float | Verification](*about) as work:
            *_, verdict = work.wait()
        assert isinstance(verdict, Verification)
        assert verdict.same, verdict.words


def test_one_that_cannot_be_opened_leaves_the_others_alone(hand: Fingers) -> None:
    hand.connect({"thumb": "sim:circle", "index": "/dev/none-there"})
    assert wait_for(lambda: streams(hand, "thumb"))
    lost = hand.status()["index"]
    assert (lost.state, "/dev/none-there" in lost.message) == (LOST, True)
    assert list(hand.aligned(hand.status())) == ["thumb"]
