"""Which channels a frame converts and when each is read; what a moving skin makes of that."""

import math
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import (
    Patch,
    Plate,
    PointLoad,
    Refusal,
    Scene,
    SensorLayout,
    Simulator,
    Stimulus,
    Transduction,
    load_scene,
)
from kappaskin.scenes import Orbit
from kappaskin.sensing import SECOND_GENERATION, Multiplexer, Scan

SETTLING = replace(SECOND_GENERATION, multiplexer=Multiplexer(settling_time=5e-6))
PATCH = Patch(0.1, 0.1)
MOVING = Scene(
    "moving",
    Plate(PATCH),
    SensorLayout.regular(PATCH, 10, 10),
    (Stimulus(PointLoad(0.05, 0.05, 0.15), Orbit(0.02, 0.5)),),
    transduction=SECOND_GENERATION,
    rate=160.0,
)


def sensor(transduction=SECOND_GENERATION):
    return replace(load_scene("centre"), transduction=transduction, rate=100.0).sensor()


def test_a_channel_is_read_when_it_has_settled_and_its_conversion_begins():
    scan = sensor(SETTLING).scan([7, 3, 200])

    np.testing.assert_allclose(scan.times, [5e-6, 30e-6, 55e-6], rtol=1e-12)
    assert scan.duration == pytest.approx(75e-6, rel=1e-12)
    assert scan.channels.tolist() == [7, 3, 200]


def test_a_full_scan_of_the_paper_takes_6_ms_for_167_frames_per_second():
    scan = sensor().scan()

    assert len(scan.channels) == 300
    assert scan.duration == pytest.approx(6e-3, rel=1e-12)
    assert scan.rate == pytest.approx(1 / 6e-3, rel=1e-12)
    assert scan.duration == pytest.approx(sensor().transduction.scan_time(300), rel=1e-12)


@pytest.mark.parametrize(
    "channels", [[300], [2.0, 3.0], ["a"], [True], np.array([1e300]), [-1, 300], [math.nan]]
)
def test_channels_that_the_sensor_has_not_are_refused(channels):
    with pytest.raises(Refusal, match="channels from 0 to 299"):
        sensor().scan(channels)


@pytest.mark.parametrize("channels", [[3, 4, 3], [-1], [5, -2]])
def test_a_channel_twice_or_below_zero_is_refused(channels):
    with pytest.raises(Refusal, match="every channel once, counted from 0"):
        sensor().scan(channels)


@pytest.mark.parametrize("channels", [[], [[1, 2]], 7])
def test_no_channels_in_a_row_are_refused(channels):
    with pytest.raises(Refusal, match="at least one channel in a row"):
        sensor().scan(channels)


def test_a_scan_of_a_channel_beyond_reason_is_refused_without_taking_memory():
    with pytest.raises(Refusal, match="twice"):
        Scan(np.array([2**60, 2**60]), 0.0, 1e-6)


# Skew


def exact(scene, scan, time):
    """Curvature (C,) of each channel at its own instant, one deflection at a time."""
    operator = scene.layout.operator(scene.basis)
    shapes = (
        scene.plate.deflection(scene.loads_at(time + t), scene.basis).ravel() for t in scan.times
    )
    return np.array([operator[c] @ w for c, w in zip(scan.channels, shapes, strict=True)])


@pytest.mark.parametrize("channels", [None, range(299, -1, -1), range(0, 300, 7)])
def test_every_channel_reads_the_skin_at_its_own_instant(channels):
    scan = MOVING.sensor().scan(channels if channels is None else np.array(channels))

    frame = Simulator(MOVING).scanned(scan, 3, 0.1, lambda: 2.0)

    # The load moves by 1.5 mm in 6 ms; a reading is 0.037 1/m per count, rounded.
    read = MOVING.transduction.curvature(frame.counts)
    at_once = exact(MOVING, MOVING.sensor().scan(frame.channels[:1]), 0.1)
    assert np.abs(read - exact(MOVING, scan, 0.1)).max() < 0.6 * MOVING.transduction.resolution
    assert np.abs(read[0] - at_once[0]) < MOVING.transduction.resolution
    assert (frame.sequence, frame.device_time, frame.host_time) == (3, 0.1, 2.0)
    np.testing.assert_array_equal(frame.channels, scan.channels)


def test_the_skew_is_what_moves_a_reading():
    scan = MOVING.sensor().scan()
    late = scan.channels[-100:]

    frame = Simulator(MOVING).scanned(scan, 0, 0.1, lambda: 0.0)
    at_start = Simulator(MOVING).scanned(MOVING.sensor().scan(late), 0, 0.1, lambda: 0.0)

    assert np.abs(frame.counts[-100:] - at_start.counts).max() > 10


def test_the_parabola_through_a_scan_converges_with_the_third_power_of_its_length():
    def error(duration):
        fast = Transduction(converter=replace(SECOND_GENERATION.converter, bits=24))
        converter = replace(fast.converter, conversion_time=duration / 300)
        scene = replace(MOVING, transduction=replace(fast, converter=converter), rate=10.0)
        scan = scene.sensor().scan()
        frame = Simulator(scene).scanned(scan, 0, 0.1, lambda: 0.0)
        return np.abs(scene.transduction.curvature(frame.counts) - exact(scene, scan, 0.1)).max()

    coarse, fine = error(16e-3), error(8e-3)

    assert 6 < coarse / fine < 10


def test_a_skin_that_rests_has_no_skew():
    still = MOVING.touched_by(*MOVING.loads)

    forth = Simulator(still).scanned(still.sensor().scan(), 0, 0.0, lambda: 0.0)
    back = Simulator(still).scanned(still.sensor().scan(np.arange(300)[::-1]), 0, 0.0, lambda: 0.0)

    np.testing.assert_array_equal(forth.counts, back.counts[::-1])


def test_a_partial_scan_reads_what_a_full_one_does_of_a_skin_at_rest():
    noisy = load_scene("centre")
    some = noisy.sensor().scan(np.arange(5, 300, 11))

    part = Simulator(noisy).scanned(some, 0, 0.0, lambda: 0.0)

    np.testing.assert_array_equal(
        part.counts, Simulator(noisy).frame(0, lambda: 0.0).counts[some.channels]
    )
