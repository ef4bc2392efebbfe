"""How late a message is: from the arrival of a frame until it was sent, with the window drawing."""

import json
import math
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kappaskin import Simulator, load_scene
from kappaskin.live import Engine
from kappaskin.pipeline import usual_setup
from kappaskin.publish import TargetStatus
from kappaskin.sources.information import sensor_to_json

_PUBLISHING = Path(__file__).with_name("publishing.py")


@pytest.fixture
def receiver() -> Iterator[int]:
    """The port of somebody who reads every datagram."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        made.settimeout(0.2)
        done = threading.Event()

        def read() -> None:
            while not done.is_set():
                try:
                    made.recv(9999)
                except TimeoutError:
                    continue

        thread = threading.Thread(target=read)
        thread.start()
        yield made.getsockname()[1]
        done.set()
        thread.join()


def published(port: str, seconds: float, *targets: str, deaf: bool = False) -> dict[str, float]:
    words = [port, seconds, "deaf" if deaf else "all-hear", *targets]
    command = [sys.executable, str(_PUBLISHING), *map(str, words)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def words(told: dict[str, float]) -> str:
    return (
        f"99 % within {told['whole']:.2f} ms (wait {told['wait']:.2f}, compute "
        f"{told['compute']:.2f}, send {told['send']:.2f}); {told['sent']:.0f} sent and "
        f"{told['dropped']:.0f} dropped a second, of {told['frames']:.0f} frames; "
        f"{told['drawn']:.0f} drawings/s"
    )


@pytest.mark.parametrize("kind", ["read", "dead", "deaf"])
def test_messages_are_sent_soon_whoever_receives_them(
    play, figure, ratio, seconds, receiver, kind
) -> None:
    port = play("--rate", 1000)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as nobody, socket.socket() as found:
        nobody.bind(("127.0.0.1", 0))
        found.bind(("127.0.0.1", 0))
        dead, served = nobody.getsockname()[1], found.getsockname()[1]
    targets = [f"udp://127.0.0.1:{receiver}"]
    targets += [f"udp://127.0.0.1:{dead}"] if kind == "dead" else []
    targets += [f"foxglove://:{served}"] if kind == "deaf" else []
    told = published(port, seconds, *targets, deaf=kind == "deaf")
    figure(f"publishing at 1000 frames/s of 300 channels, a receiver {kind}: {words(told)}")
    assert told["frames"] == pytest.approx(1000, rel=0.2)
    assert math.isfinite(told["whole"])
    assert told["dropped"] > 0 or kind == "read"
    if kind != "read":
        alone = published(port, seconds, targets[0])
        figure(f"  without it: {words(alone)}")
        ratio(
            f"latency beside a {kind} receiver, of twice that without it and 1 ms",
            told["whole"] / (2 * alone["whole"] + 1.0),
            at_most=1,
        )


def without_window(port: str, seconds: float, receiver: int) -> dict[str, float]:
    """As `published`, by an engine alone."""
    with Engine() as engine:
        engine.connect(port)
        engine.publish([f"udp://127.0.0.1:{receiver}"])
        time.sleep(3)
        before = engine.status()
        time.sleep(seconds)
        after = engine.status()
    sent = after.publishing.targets[0].sent - before.publishing.targets[0].sent
    frames = after.accounting.accepted - before.accounting.accepted
    latency = after.publishing.latency
    parts = {name: 1e3 * getattr(latency, name) for name in ("whole", "wait", "compute", "send")}
    return parts | {
        "sent": sent / seconds,
        "dropped": 0.0,
        "frames": frames / seconds,
        "drawn": 0.0,
        "skipped": (after.skipped - before.skipped) / seconds,
    }


def test_without_a_window_messages_are_sent_sooner(play, figure, ratio, seconds, receiver) -> None:
    told = without_window(play("--rate", 1000), seconds, receiver)
    figure(f"publishing at 1,000 frames/s without a window: {words(told)}")
    ratio("latency without a window, of the 50 ms allowed", told["whole"] / 50, at_most=1)


@pytest.fixture
def pressed(play, tmp_path: Path) -> str:
    """A device that a contact moves around on, at 2,000 frames/s of 300 channels."""
    scene = load_scene("circle")
    chain = scene.transduction
    quick = replace(chain, converter=replace(chain.converter, conversion_time=1e-6))
    simulator = Simulator(replace(scene, transduction=quick))
    frames = [simulator.frame(number, time.monotonic).counts for number in range(2000)]
    counts, information = tmp_path / "counts.bin", tmp_path / "information.json"
    counts.write_bytes(np.array(frames).astype("<i2").tobytes())
    information.write_text(sensor_to_json(replace(scene, transduction=quick).sensor()))
    return play("--rate", 2000, "--counts", counts, "--information", information)


@pytest.mark.parametrize("name", ["fingertip", "fingertip-cap"])
def test_cues_are_sent_soon_after_the_bytes(
    play, figure, ratio, seconds, receiver, tmp_path, name
) -> None:
    rate, scene = 400, load_scene(name)
    chain = scene.transduction
    quick = replace(chain, converter=replace(chain.converter, conversion_time=1e-6))
    scene = replace(scene, transduction=quick, rate=float(rate))
    simulator = Simulator(scene)
    frames = [simulator.frame(number, time.monotonic).counts for number in range(6 * rate)]
    frames = frames[3 * rate :]  # of the cap those in which one contact rolls
    counts, information = tmp_path / "counts.bin", tmp_path / "information.json"
    counts.write_bytes(np.array(frames).astype("<i2").tobytes())
    information.write_text(sensor_to_json(scene.sensor()))
    played = ("--counts", counts, "--information", information)
    port = play("--rate", rate, *played, "--channels", frames[0].size)
    with Engine(replace(usual_setup(scene.sensor()), quantities=())) as engine:
        engine.connect(port)
        engine.publish([f"cue://127.0.0.1:{receiver}"])
        time.sleep(4)
        before = engine.status()
        time.sleep(seconds)
        after = engine.status()
    old, new = (status.publishing.targets[0] for status in (before, after))
    sent, missed = ((b - a) / seconds for a, b in ((old.sent, new.sent), _missed(old, new)))
    frames_read = (after.accounting.accepted - before.accounting.accepted) / seconds
    skipped = (after.skipped - before.skipped) / seconds
    figure(
        f"cues of {name} at {frames_read:.0f} frames/s, {skipped:.0f} of them skipped: "
        f"{1e3 * new.cue.half:.2f} ms after the bytes, 99 % within {1e3 * new.cue.most:.2f} ms; "
        f"{sent:.0f} sent and {missed:.0f} missed a second; load {os.getloadavg()[0]:.1f}"
    )
    ratio(f"latency of cues of {name}, of the 5 ms allowed", new.cue.most / 5e-3, at_most=1)


def _missed(old: TargetStatus, new: TargetStatus) -> tuple[int, int]:
    return old.cue.missed, new.cue.missed


def test_2000_frames_a_second_are_published(pressed, figure, ratio, seconds, receiver) -> None:
    told = without_window(pressed, seconds, receiver)
    figure(
        f"publishing at 2,000 frames/s of a moving contact without a window: {words(told)}; "
        f"{told['skipped']:.0f} counted as skipped"
    )
    assert told["frames"] == pytest.approx(2000, rel=0.1)
    share = told["sent"] / told["frames"]
    ratio("share of 2,000 frames/s published", share, at_least=0.98)
    ratio("latency at 2,000 frames/s, of the 1.5 ms allowed", told["whole"] / 1.5, at_most=1)


def test_2000_frames_a_second_are_published_with_the_window_drawing(
    pressed, figure, ratio, seconds, receiver
) -> None:
    told = published(pressed, seconds, f"udp://127.0.0.1:{receiver}")
    figure(f"publishing at 2,000 frames/s of a moving contact with the window: {words(told)}")
    assert told["frames"] == pytest.approx(2000, rel=0.1)
    share = told["sent"] / told["frames"]
    ratio("share of 2,000 frames/s published while drawing", share, at_least=0.95)
    ratio(
        "latency at 2,000 frames/s while drawing, of the 3 ms allowed", told["whole"] / 3, at_most=1
    )
    ratio("drawings while publishing, of the 20 a second asked", told["drawn"] / 20, at_least=1)
