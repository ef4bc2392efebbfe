"""Haptic cues of an engine: nothing sticks when it is killed, or its source stalls or dies."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from importlib.resources import files
from itertools import pairwise

import numpy as np
import pytest

from kappaskin import Engine, Setup

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="stops and kills as POSIX does"),
]

GUIDE = (files("kappaskin_resources") / "guide" / "telemanipulation.md").read_text("utf-8")
SOON = 0.1 + 0.3  # s: as promised, and what a busy machine adds


@pytest.fixture
def engine() -> Iterator[Engine]:
    with Engine(Setup(4, 4, quantities=())) as made:
        yield made


@pytest.fixture
def device() -> Iterator[Callable[[], subprocess.Popen[str]]]:
    """A sensor on a port of this machine, which somebody presses, as a process."""
    command = [sys.executable, "-m", "kappaskin", "device", "centre", "--rate", "100"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=-3, text=True) as process:
        yield process
        process.send_signal(signal.SIGCONT)
        process.kill()


class Listener:
    """Keeps every cue that comes, with when it came."""

    def __init__(self, receiver: socket.socket) -> None:
        self.socket, self.cues = receiver, list[tuple[float, dict[str, object]]]()
        self.target = f"cue://127.0.0.1:{receiver.getsockname()[1]}?force=0.1"
        receiver.settimeout(0.05)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _listen(self) -> None:
        while not self._ended.is_set():
            try:
                self.cues.append((time.monotonic(), json.loads(self.socket.recv(9999))))
            except TimeoutError:
                continue

    def until(self, holds: Callable[[dict[str, object]], bool]) -> float:
        """When the first cue from now on came of which something holds."""
        seen, end = len(self.cues), time.monotonic() + 60
        while time.monotonic() < end:
            for when, cue in self.cues[seen:]:
                seen += 1
                if holds(cue):
                    return when
            time.sleep(1e-3)
        raise AssertionError(self.cues[-1:])

    def close(self) -> None:
        self._ended.set()
        self._thread.join()

    def check(self) -> None:
        """Nothing is felt of old data, the limits hold, and the force never jumps."""
        told = [cue for _, cue in self.cues]
        assert all(cue["scale"] == 0 for cue in told if (cue["age_s"] or 0) > 0.09 + 1e-6)
        assert all(0 <= cue["force_N"] <= 0.1 for cue in told)
        for a, b in pairwise(told):
            passed = b["timestamp"] - a["timestamp"]
            assert abs(b["force_N"] - a["force_N"]) <= 100 * passed + 1e-3


@pytest.fixture
def heard(receiver) -> Iterator[Listener]:
    made = Listener(receiver)
    yield made
    made.close()
    made.check()


def is_felt(cue: dict[str, object]) -> bool:
    return cue["scale"] == 1 and cue["force_N"] > 0.09


def is_nothing(cue: dict[str, object]) -> bool:
    return not (cue["scale"] or cue["force_N"])


def test_a_source_that_stalls_fades_and_comes_back(engine, device, heard) -> None:
    engine.connect(json.loads(device.stdout.readline())["port"])
    engine.publish([heard.target])
    heard.until(is_felt)
    device.send_signal(signal.SIGSTOP)
    stopped = time.monotonic()
    assert heard.until(is_nothing) - stopped < SOON
    heard.until(lambda cue: cue["state"] == "stale")
    count = len(heard.cues)
    time.sleep(0.3)
    assert all(map(is_nothing, (cue for _, cue in heard.cues[count:])))
    assert len(heard.cues) > count + 30  # zeros go on
    device.send_signal(signal.SIGCONT)
    heard.until(is_felt)


def test_a_source_that_dies_is_lost_to_the_operator(engine, device, heard) -> None:
    engine.connect(json.loads(device.stdout.readline())["port"])
    engine.publish([heard.target])
    heard.until(is_felt)
    device.kill()
    died = time.monotonic()
    assert heard.until(is_nothing) - died < SOON
    heard.until(lambda cue: cue["state"] == "lost" and is_nothing(cue))
    end = time.monotonic() + 30
    while (told := engine.status().publishing.targets[0].cue).state != "lost":
        assert time.monotonic() < end
        time.sleep(0.05)
    assert told.scale < 1
    assert 0 < told.half <= told.most


def test_an_engine_that_ends_lets_the_cue_fade_first(heard) -> None:
    with Engine(Setup(4, 4, quantities=())) as engine:
        engine.connect("sim:centre")
        engine.publish([heard.target])
        heard.until(is_felt)
    time.sleep(0.2)
    last = [cue for _, cue in heard.cues[-10:]]
    assert all(map(is_nothing, last))
    assert last[-1]["state"] == "lost"


def test_other_limits_take_the_place_of_the_present_ones(engine, heard) -> None:
    engine.connect("sim:centre")
    engine.publish([heard.target])
    heard.until(is_felt)
    engine.publish([heard.target.replace("=0.1", "=0.05")])
    heard.until(is_nothing)
    count = len(heard.cues)
    heard.until(lambda cue: cue["force_N"] > 0.049)
    assert max(cue["force_N"] for _, cue in heard.cues[count:]) <= 0.05


def test_the_receiver_of_the_guide_stops_when_the_engine_is_killed(engine) -> None:
    block = re.search(r"```python\n(import json\n.*?)\n\n\nfelt =", GUIDE, re.DOTALL)[1]
    code: dict[str, object] = {}
    exec(block, code)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    engine.connect("sim:centre")
    engine.publish([f"cue://127.0.0.1:{port}?force=0.1"])
    killed, after = np.inf, []
    for _, force in code["forces"](port, 60):
        now = time.monotonic()
        if force > 0.09 and killed == np.inf:
            os.kill(engine.pid, signal.SIGKILL)
            killed = now
        if now > killed:
            after.append((now - killed, force))
        if now > killed + 1:
            break
    assert killed < np.inf
    assert max(when for when, force in after if force) < SOON
    assert after[-1][1] == 0
