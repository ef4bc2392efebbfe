"""Change of source: the one in use streams on until the other one answers, or is refused."""

import os
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from kappaskin import load_scene
from kappaskin.errors import SourceError
from kappaskin.live import STREAMING, Engine, Status

pytest.importorskip("pty", reason="no pseudo-terminals on this system")
from kappaskin.sources import PseudoDevice
from kappaskin.sources.ports import open_port

pytestmark = pytest.mark.slow


class Plugged(PseudoDevice):
    """A device on a port of this machine, silent until `answer` and served until it is pulled."""

    def __init__(self) -> None:
        super().__init__(replace(load_scene("circle"), rate=50.0))
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self.serve, args=(self._stop.is_set,))

    def answer(self) -> None:
        self._thread.start()

    def pull(self) -> None:
        if not self._stop.is_set():
            self._stop.set()
            self._thread.join()
            self.close()


def wait_for(engine: Engine, holds: Callable[[Status], bool]) -> list[Status]:
    """All that the engine reports until something `holds`; fails after a while."""
    end, seen = time.monotonic() + 30.0, [engine.status()]
    while not holds(seen[-1]):
        assert time.monotonic() < end, seen[-1]
        time.sleep(0.005)
        seen.append(engine.status())
    return seen


def sequence(engine: Engine) -> int:
    estimate = engine.latest(engine.status())
    return -1 if estimate is None else estimate.sequence


def streams_on(engine: Engine) -> bool:
    """Whether the simulation that was connected first still brings new estimates."""
    before = sequence(engine)
    wait_for(engine, lambda _: sequence(engine) > before + 3)
    status = engine.status()
    return (status.state, status.source, status.connections) == (STREAMING, "sim:centre", 1)


@pytest.fixture
def engine() -> Iterator[Engine]:
    """An engine that simulates a scene."""
    with Engine() as made:
        made.connect("sim:centre")
        wait_for(made, lambda status: status.state == STREAMING and sequence(made) > 0)
        yield made


@pytest.fixture
def device() -> Iterator[Plugged]:
    made = Plugged()
    made.answer()
    yield made
    made.pull()


@pytest.mark.cases("/dev/ttyABSENT7", "sim:nowhere")
@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("/dev/ttyABSENT7", "there is no such port"),
        ("sim:nowhere", "expected a scene among"),
        ("replay:/nowhere.mcap", "nowhere.mcap"),
        ("feed:nobody", "no program feeds it"),
        ("", "got no name"),
    ],
)
def test_a_refused_source_leaves_the_simulation_running(engine, source, reason) -> None:
    scene = replace(load_scene("centre"), seed=7)
    engine.play(scene)
    engine.connect(source)
    status = wait_for(engine, lambda status: bool(status.source_refusal))[-1]

    assert reason in status.source_refusal
    assert (status.connecting, status.message) == ("", "")
    assert streams_on(engine)

    engine.withdraw()
    wait_for(engine, lambda status: not status.source_refusal)
    assert streams_on(engine)
    assert (engine.source, engine.requested.scene) == ("sim:centre", scene)


def test_a_silent_port_leaves_the_simulation_running_until_it_is_withdrawn(engine) -> None:
    master, slave = os.openpty()
    port = os.ttyname(slave)
    engine.connect(port)
    wait_for(engine, lambda status: status.connecting == port and bool(status.source_refusal))
    assert streams_on(engine)
    with pytest.raises(SourceError, match="busy"):
        open_port(port)

    engine.seek(None, 0.5)  # of the simulation, which stays
    engine.withdraw()
    wait_for(engine, lambda status: not (status.connecting or status.source_refusal))

    open_port(port).close()
    assert streams_on(engine)
    assert (engine.source, engine.requested.speed) == ("sim:centre", 0.5)
    for end in (master, slave):
        os.close(end)


def test_the_simulation_streams_until_the_device_answers(engine) -> None:
    device = Plugged()
    engine.connect(device.port)
    wait_for(engine, lambda status: status.connecting == device.port)
    assert streams_on(engine)

    device.answer()
    seen = wait_for(engine, lambda status: status.source == device.port)

    assert {status.state for status in seen[:-1]} == {STREAMING}
    status = wait_for(engine, lambda status: status.state == STREAMING)[-1]
    assert (status.connecting, status.source_refusal, status.connections) == ("", "", 2)
    device.pull()


def test_a_port_in_use_is_opened_again_under_another_name(engine, device, tmp_path: Path) -> None:
    engine.connect(device.port)
    wait_for(engine, lambda status: status.source == device.port and status.state == STREAMING)
    link = tmp_path / "ttySKIN"
    link.symlink_to(device.port)

    engine.connect(str(link))
    seen = wait_for(engine, lambda s: s.source == str(link) and s.state == STREAMING)

    assert not any(status.source_refusal for status in seen)


def test_the_requested_source_takes_over_from_one_that_is_lost(engine, device) -> None:
    master, slave = os.openpty()
    engine.connect(device.port)
    wait_for(engine, lambda status: status.source == device.port and status.state == STREAMING)
    port = os.ttyname(slave)
    engine.connect(port)
    wait_for(engine, lambda status: status.connecting == port)

    device.pull()
    wait_for(engine, lambda status: status.source == port)
    for end in (master, slave):
        os.close(end)
