"""How late a message is: from the arrival of a frame until it was sent, with the window drawing."""

import json
import math
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from kappaskin.live import Engine

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


def test_without_a_window_messages_are_sent_sooner(play, figure, ratio, seconds, receiver) -> None:
    with Engine() as engine:
        engine.connect(play("--rate", 1000))
        engine.publish([f"udp://127.0.0.1:{receiver}"])
        threading.Event().wait(seconds + 3)
        latency = engine.status().publishing.latency
    parts = {name: 1e3 * getattr(latency, name) for name in ("whole", "wait", "compute", "send")}
    figure(f"publishing without a window: 99 % within {parts['whole']:.2f} ms, {parts}")
    ratio("latency without a window, of the 50 ms allowed", parts["whole"] / 50, at_most=1)
