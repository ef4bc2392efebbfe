"""A region of interest on a device behind a line: what it scans, how fast, and why it does not."""

import threading
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from kappaskin import Plate, Refusal, Region, load_scene
from kappaskin.estimation import Scanner
from kappaskin.live import STREAMING, track_region
from kappaskin.sources import SerialSource, information

pytest.importorskip("pty", reason="no pseudo-terminals on this system")
from kappaskin.live import Engine
from kappaskin.sources import PseudoDevice

pytestmark = pytest.mark.slow

SCENE = replace(load_scene("off-centre"), rate=200.0)
ELEMENTS = (3, 4)


class Served(PseudoDevice):
    """A device that serves in a thread until it is unplugged."""

    def __init__(self, scene=SCENE):
        super().__init__(scene)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self.serve, args=(self._stop.is_set,))
        self._thread.start()

    def begin_anew(self):
        """Forget what was asked, and begin another count, as a reset board does."""
        self._scan = SCENE.sensor().scan()
        self.spent -= 1000

    def become(self, scene):
        """Say that it is the sensor of another scene."""
        self._information = information.sensor_to_json(scene.sensor())
        self._send_information()

    def unplug(self):
        self._stop.set()
        self._thread.join()
        self.close()


@pytest.fixture
def device():
    made = Served()
    yield made
    made.unplug()


@pytest.fixture
def source(device):
    made = SerialSource(device.port)
    read_until(made, lambda _: made.sensor is not None)
    yield made
    made.close()


def read_until(source, holds, within=30.0):
    """The first frame for which something holds."""
    end = time.monotonic() + within
    while time.monotonic() < end:
        for frame in source.read(0.02):
            if holds(frame):
                return frame
    raise AssertionError(f"it never came to hold; {source.trouble or source.scan_refusal}")


def scans(*elements):
    numbers = np.sort(np.ravel([np.array(elements) + 100 * k for k in range(3)])).tolist()
    return lambda frame: np.sort(frame.channels).tolist() == numbers


def test_elements_by_hand_are_scanned_as_fast_as_asked_until_they_are_not(source, device):
    track_region(source, Region("elements", elements=ELEMENTS, share=0.0, rate=900.0))
    read_until(source, scans(*ELEMENTS))
    read_until(source, lambda _: device.rate == 900.0)
    frames = [read_until(source, scans(*ELEMENTS)) for _ in range(50)]
    took = np.diff([f.device_time for f in frames])
    each = took / np.diff([f.sequence for f in frames])  # on a busy machine some are passed over
    assert np.median(each) == pytest.approx(1 / 900, rel=1e-2)

    assert track_region(source, Region()) is None

    read_until(source, scans(*range(100)))
    assert device.rate == 200.0
    assert source.scan_refusal == ""


def test_the_region_follows_the_contact(source):
    steering = track_region(source, Region("skin", radius=0.015, share=0.0))
    for x in (0.02, 0.08):
        steering(PointTouch(x, 0.05), None)
        frame = read_until(source, partial(inside, source, x))
        assert len(frame.channels) < 90


class PointTouch:
    """A contact of which only the place is told."""

    def __init__(self, x, y):
        self.position = np.array([x, y])


def inside(source, x, frame):
    places = source.sensor.layout.positions[np.unique(frame.channels % 100)]
    return np.hypot(*(places - [x, 0.05]).T).max() < 0.0151


@pytest.mark.parametrize(
    ("around", "why"),
    [
        ("intrinsic", "does not report a force/torque sensor"),
        ("turns", "new scan list for every frame"),
        ("adaptive", "new scan list for every frame"),
    ],
)
def test_a_region_that_no_line_carries_is_refused_and_everything_scanned(source, around, why):
    track_region(source, Region("elements", elements=ELEMENTS))
    with pytest.raises(Refusal, match=f"elements or skin, got {around}: .*{why}.*; choose another"):
        track_region(source, Region(around))
    read_until(source, scans(*range(100)))


def test_a_region_off_the_skin_is_refused_and_everything_scanned(source):
    with pytest.raises(Refusal, match="elements from 0 to 99"):
        track_region(source, Region("elements", elements=(4000,)))
    read_until(source, scans(*range(100)))


@pytest.mark.full
def test_a_device_that_began_anew_scans_the_region_again(source, device):
    track_region(source, Region("elements", elements=ELEMENTS, share=0.0))
    before = read_until(source, lambda f: scans(*ELEMENTS)(f) and f.sequence > 40)
    device.begin_anew()
    # It may be told of the region before it has scanned the whole skin once.
    read_until(source, lambda f: scans(*ELEMENTS)(f) and f.sequence < before.sequence)
    assert "restarted" in [event.kind for event in source.events()]


def test_another_skin_on_the_line_is_scanned_whole(source, device):
    source.scan(Scanner(source.sensor, Region("elements", elements=ELEMENTS, share=0.0)))
    read_until(source, scans(*ELEMENTS))
    stiff = Plate(SCENE.plate.patch, 2 * SCENE.plate.rigidity)
    device.become(replace(SCENE, plate=stiff))
    read_until(source, scans(*range(100)))
    assert source.sensor.plate.rigidity == stiff.rigidity


def test_an_engine_scans_the_region_on_a_line_and_after_it_came_back(tmp_path):
    device = Served()
    port = tmp_path / "ttyACM0"
    port.symlink_to(device.port)
    region = Region("elements", elements=ELEMENTS, share=0.2)
    with Engine() as engine:
        engine.scan(region)
        engine.connect(str(port))
        wait_for(lambda: few(engine))
        status = engine.status()
        assert (status.state, status.region, status.region_refusal) == (STREAMING, region, "")
        generation = status.generation

        device.unplug()
        other = Served()
        port.unlink()
        port.symlink_to(other.port)
        wait_for(lambda: "back" in [event.kind for event in engine.status().events])
        wait_for(lambda: few(engine))
        assert engine.status().generation == generation

        engine.scan(Region("intrinsic"))
        wait_for(lambda: "force/torque sensor" in engine.status().region_refusal)
        wait_for(lambda: scanned(engine) == 300)
        engine.scan(Region())
        wait_for(lambda: not engine.status().region_refusal)
    other.unplug()


def scanned(engine):
    estimate = engine.latest(engine.status())
    return 300 if estimate is None else int(estimate.fresh.sum())


def few(engine):
    return 0 < scanned(engine) < 90


def wait_for(holds, within=30.0):
    end = time.monotonic() + within
    while not holds():
        assert time.monotonic() < end, "it never came to hold"
        time.sleep(0.01)


@pytest.mark.full
def test_a_deaf_device_is_told_of_and_goes_on(device, monkeypatch):
    monkeypatch.setattr(PseudoDevice, "_listen", lambda self: None)
    source = SerialSource(device.port)
    read_until(source, lambda _: source.sensor is not None)
    steering = track_region(source, Region("elements", elements=ELEMENTS))
    assert steering.refusal == ""
    read_until(source, lambda _: steering.refusal)
    assert "got no reply; it scans the channels that it selects" in steering.refusal
    read_until(source, scans(*range(100)))
    assert not source.trouble
    source.close()
