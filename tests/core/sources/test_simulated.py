"""The simulated source keeps a device's pace by any clock, or goes slower and loses nothing."""

import math
from contextlib import closing
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import (
    DiscLoad,
    Frame,
    Patch,
    Plate,
    PointLoad,
    Refusal,
    Region,
    Scene,
    SensorLayout,
    Simulator,
    Stimulus,
    Transduction,
    load_scene,
)
from kappaskin.estimation import Scanner
from kappaskin.mechanics import Sphere
from kappaskin.recording import Recorder, Recording
from kappaskin.recording.messages import LINES
from kappaskin.scenes import EffectSelection, Indenter
from kappaskin.scenes.effects import CorruptedFrames, DroppedFrames
from kappaskin.sensing import Amplifier
from kappaskin.sources import SimulatedSource, open_source
from kappaskin.sources.wire import pack_runs, unpack_runs

pytestmark = pytest.mark.slow


class Clock:
    """A clock that stands still but for those who sleep by it."""

    def __init__(self, now: float = 1000.1) -> None:
        self.now = now
        self.slept: list[float] = []

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds >= 0
        self.slept.append(seconds)
        self.now += seconds


def source_of(name: str = "centre", clock: Clock | None = None, **changes) -> SimulatedSource:
    clock = clock or Clock()
    return SimulatedSource(replace(load_scene(name), **changes), clock, clock.sleep)


def read_until(source: SimulatedSource, clock: Clock, end: float) -> list[Frame]:
    frames: list[Frame] = []
    for _ in range(5000):  # a source that stands still fails the test instead of stopping it
        frames += source.read(0.02) if clock.now < end else []
    return frames


def counts_of(frames: list[Frame]) -> list[list[int]]:
    return [frame.counts.tolist() for frame in frames]


@pytest.mark.parametrize("start", [0.0, 1000.1, 12345.678, 4e7 / 3])
def test_frames_come_at_their_rate(start: float) -> None:
    clock = Clock(start)
    source = source_of(clock=clock)

    frames = read_until(source, clock, start + 2)

    assert [f.sequence for f in frames] == list(range(len(frames)))
    assert len(frames) in (1000, 1001)
    whole_us = [round(n / 500 * 1e6) * 1e-6 for n in range(len(frames))]
    assert [f.device_time for f in frames] == whole_us
    assert [(f.taken, f.taken_sd) for f in frames] == [(start + f.device_time, 0) for f in frames]
    late = [f.host_time - start - f.device_time for f in frames]
    assert max(map(abs, late)) < 1e-5  # each when it is due, not in a lump


@given(st.floats(0, 1e6), st.sampled_from([50.0, 333.3, 500.0]))
def test_a_reader_that_sleeps_as_told_never_reads_nothing_twice(start: float, rate: float) -> None:
    clock = Clock(start)
    source = source_of(clock=clock, rate=rate)
    empty = [not source.read(1.0) for _ in range(60)]
    assert not any(one and two for one, two in pairwise(empty))
    assert empty.count(False) >= 30


def test_no_read_sleeps_longer_than_it_may() -> None:
    clock = Clock()
    source = source_of(clock=clock, rate=10.0)
    for _ in range(50):
        source.read(0.004)
    assert max(clock.slept) == pytest.approx(0.004)


def test_a_reader_a_little_late_gets_every_frame() -> None:
    clock = Clock()
    source = source_of(clock=clock)
    source.read(0.0)

    clock.now += 0.2
    frames = source.read(0.0)

    assert [f.sequence for f in frames] == list(range(1, 101))
    assert source.accounting().lost == 0


def test_a_reader_far_too_late_misses_nothing_as_the_simulated_time_waits_for_it() -> None:
    clock = Clock()
    source = source_of(clock=clock)
    first = source.read(0.0)

    clock.now += 2.0
    frames = source.read(0.0)

    assert [f.sequence for f in first + frames] == [0, 1]
    assert frames[0].device_time == 0.002
    assert frames[0].taken == pytest.approx(clock.now)
    seen = source.accounting()
    assert (seen.accepted, seen.lost, seen.span) == (2, 0, 2)


@pytest.mark.parametrize("cost", [0.0, 0.001, 0.0025, 0.004, 0.02])
def test_a_simulation_that_takes_too_long_goes_slower_than_real_time(cost: float) -> None:
    clock = Clock()
    source, paces = source_of(clock=clock), list[float]()
    while clock.now < 1020:
        frames = source.read(0.02)
        clock.now += cost * len(frames)  # each takes so long to compute
        paces.append(source.pace)

    assert paces[-1] == pytest.approx(min(0.002 / cost, 1.0) if cost else 1.0, rel=0.08)
    assert source.accounting().lost == 0


@given(st.lists(st.floats(0, 1.5), max_size=12))
def test_the_balance_holds_however_late_the_reader_is(pauses: list[float]) -> None:
    clock = Clock()
    source = source_of(clock=clock, rate=40.0)
    got: list[Frame] = []
    for pause in pauses:
        clock.now += pause
        got += source.read(0.01)

    seen = source.accounting()

    assert seen.good == seen.accepted == len(got)
    assert seen.span == seen.accepted + seen.lost
    assert [frame.sequence for frame in got] == list(range(len(got)))
    assert seen.bytes_in == seen.bytes_good == seen.bytes_discarded == seen.buffered == 0


def test_the_same_seed_gives_the_same_counts_and_another_gives_others() -> None:
    def first(seed: int) -> list[list[int]]:
        clock = Clock()
        return counts_of(read_until(source_of("circle", clock, seed=seed), clock, clock.now + 0.1))

    assert first(3) == first(3)
    assert first(3) != first(4)


def test_other_loads_play_on_without_a_gap() -> None:
    clock = Clock()
    source = source_of("circle", clock)
    before = read_until(source, clock, clock.now + 0.5)
    scene = load_scene("circle").touched_by(PointLoad(0.03, 0.06, 0.2))

    source.play(scene)
    after = read_until(source, clock, clock.now + 0.5)

    assert [f.sequence for f in before + after] == list(range(len(before) + len(after)))
    assert after[0].device_time == len(before) / 500
    assert after[0].truth is not None
    assert after[0].truth.contact.tolist() == [0.03, 0.06]
    assert source.accounting().lost == 0


def fingertip(m: int = 7, rate: float = 100.0) -> Scene:
    patch = Patch(0.04, 0.03, 0.0129)
    return Scene("arc", Plate(patch), SensorLayout.regular(patch, m, 3), rate=rate)


def test_other_loads_are_not_another_sensor_but_another_skin_is() -> None:
    source = source_of()
    sensor = source.sensor

    source.play(replace(load_scene("circle"), seed=5))
    assert source.sensor is sensor

    for scene in (
        replace(load_scene(), layout=SensorLayout.regular(Patch(0.1, 0.1), 6, 6)),
        replace(load_scene(), edge="sliding"),
        replace(load_scene(), plate=Plate(Patch(0.1, 0.1), tension=5.0)),
        replace(load_scene(), transduction=Transduction(), rate=400.0),
        fingertip(),
    ):
        source.play(scene)
        assert source.sensor is not sensor
        sensor = source.sensor


def test_another_skin_plays_on_without_a_gap_and_without_a_loss() -> None:
    clock = Clock()
    source = source_of(clock=clock)
    before = read_until(source, clock, clock.now + 0.5)
    clock.now += 5.0  # as long as another skin takes to be made

    source.play(fingertip())
    started = clock.now
    after = read_until(source, clock, clock.now + 0.5)

    assert [f.sequence for f in before + after] == list(range(len(before) + len(after)))
    assert {len(f.counts) for f in after} == {3 * 21}
    assert len(after) in (50, 51)
    assert after[0].host_time == pytest.approx(started)
    seen = source.accounting()
    assert (seen.lost, seen.span) == (0, len(before) + len(after))


def test_a_scene_that_is_refused_leaves_the_one_that_plays() -> None:
    clock = Clock()
    source = source_of("centre", clock)
    sensor = source.sensor
    half = Patch(np.pi * 0.01, 0.02, 0.01, strip=True)  # moves as a whole unless it is pinned
    loose = Scene(
        "loose", Plate(half), SensorLayout.regular(half, 8, 1), reference=(15, 1), edge="sliding"
    )

    with pytest.raises(Refusal, match="moves as a whole"):
        source.play(loose)
    with pytest.raises(Refusal, match="lower the rate"):
        source.play(fingertip(m=32, rate=5000.0))

    amplified = replace(fingertip().transduction, amplifier=Amplifier(gain=1e9))
    with pytest.raises(Refusal, match="expected electronics with a range"):
        source.play(replace(fingertip(), transduction=amplified))
    crushed = Stimulus(Indenter(Sphere(0.01), 0.05, 0.05, force=1e6))
    with pytest.raises(Refusal, match="press with less force"):
        source.play(replace(source.scene, stimuli=(crushed,), choice=EffectSelection(auto=True)))

    assert source.sensor is sensor
    assert not source.scene.indenter
    (frame,) = source.read(0.0)
    assert len(frame.counts) == sensor.channels
    assert frame.truth is not None
    assert frame.truth.contact.tolist() == [0.05, 0.05]


def test_an_object_that_a_drum_head_refuses_leaves_the_load_that_presses() -> None:
    clock = Clock()
    drum = Plate(Patch(0.1, 0.1), rigidity=0.0, tension=10.0)
    disc = (Stimulus(DiscLoad(0.05, 0.05, 0.01, 0.1)),)
    source = source_of("centre", clock, plate=drum, stimuli=disc)
    ball = Stimulus(Indenter(Sphere(0.01), 0.05, 0.05, force=0.1))

    with pytest.raises(Refusal, match="does not determine its Young's modulus"):
        source.play(replace(source.scene, stimuli=(ball,)))

    (frame,) = source.read(0.0)
    assert frame.truth is not None
    assert frame.truth.contact.tolist() == [0.05, 0.05]


def test_no_load_reads_nothing_but_noise() -> None:
    clock = Clock()
    source = source_of(clock=clock, stimuli=(), effects=())
    (frame,) = source.read(0.0)
    assert not frame.counts.any()
    assert frame.truth is not None
    assert np.isnan(frame.truth.contact).all()


def test_the_name_of_a_scene_opens_it() -> None:
    for name, contact in (("sim:", (0.072, 0.05)), ("sim:line", (0.05, 0.05))):
        source = open_source(name)
        (frame, *_) = source.read(0.1)
        assert source.sensor is not None
        assert source.sensor.simulated
        assert frame.truth is not None
        assert frame.truth.contact == pytest.approx(contact)
        source.close()


# Parts of the skin


def part_of(source: SimulatedSource, rate: float, *elements: int) -> Scanner:
    assert source.sensor is not None
    return Scanner(source.sensor, Region("elements", elements, share=0.0, rate=rate))


def test_a_part_of_the_skin_comes_as_often_as_its_scan_allows() -> None:
    clock = Clock()
    source = source_of(clock=clock)
    source.scan(part_of(source, 1e6, 3, 4))

    frames = read_until(source, clock, clock.now + 0.01)

    assert {tuple(f.channels) for f in frames} == {(3, 4, 103, 104, 203, 204)}
    # Six conversions of 5 us.
    np.testing.assert_allclose(np.diff([f.device_time for f in frames]), 30e-6, rtol=1e-9)
    assert source.accounting().accepted == len(frames) == pytest.approx(0.01 / 30e-6, abs=2)


def test_a_region_that_no_list_on_the_wire_could_tell_is_read_and_recorded_with_more(
    tmp_path,
) -> None:
    skin, clock = load_scene("centre"), Clock()
    layout = SensorLayout.regular(skin.plate.patch, 20, 20)
    source = source_of(clock=clock, layout=layout, rate=10.0)
    chessboard = [p for p in range(400) if (p % 20 + p // 20) % 2 == 0]
    source.scan(part_of(source, 10.0, *chessboard))
    with closing(Recorder(tmp_path / "a.mcap", clock.now)) as recorder:
        source.record(recorder)

        (frame,) = source.read(1.0)

    wished = [c * 400 + p for c in range(3) for p in chessboard]
    assert set(wished) <= set(frame.channels.tolist())
    assert len(unpack_runs(pack_runs(frame.channels))) == len(frame.channels)
    with Recording(tmp_path / "a.mcap") as recording:
        assert recording.counts[LINES.name] == 1


def test_rates_may_change_at_any_frame_without_a_jump_in_time() -> None:
    clock = Clock(0.0)
    source = source_of(clock=clock)
    times: list[float] = []
    for rate in (100.0, 700.0, 500.0, 33.3, 1000.0):
        source.scan(part_of(source, rate, 7))
        times += [f.device_time for f in read_until(source, clock, clock.now + 0.1)]
    source.scan(None)
    times += [f.device_time for f in read_until(source, clock, clock.now + 0.1)]

    steps = np.diff(times)

    assert (steps > 1e-3 * (1 - 1e-9)).all()
    assert (steps < 1 / 33.3 * (1 + 1e-9)).all()
    assert steps[-40:] == pytest.approx(1 / 500)
    assert times[-1] == pytest.approx(clock.now, abs=2 / 500)


@given(st.lists(st.tuples(st.floats(0, 0.6), st.floats(20, 600)), max_size=6))
def test_the_balance_holds_while_rates_change(steps: list[tuple[float, float]]) -> None:
    clock = Clock()
    source = source_of(clock=clock, rate=40.0)
    got: list[Frame] = []
    for pause, rate in steps:
        source.scan(part_of(source, rate, 5))
        clock.now += pause
        got += source.read(0.01)

    seen = source.accounting()

    assert seen.accepted == len(got)
    assert seen.span == seen.accepted + seen.lost
    assert [frame.sequence for frame in got] == list(range(len(got)))
    assert all(b.device_time > a.device_time for a, b in pairwise(got))


@pytest.mark.parametrize("failure", [DroppedFrames, CorruptedFrames])
def test_frames_that_the_link_spoils_are_counted_as_lost(failure) -> None:
    clock = Clock()
    source = source_of("centre", clock, effects=(failure(0.2),))
    frames = read_until(source, clock, clock.now + 2.0)
    counted = source.accounting()
    assert counted.span == counted.accepted + counted.lost
    assert counted.accepted == len(frames)
    assert 0.15 < counted.lost / counted.span < 0.25
    again = source_of("centre", (other := Clock()), effects=(failure(0.2),))
    assert [f.sequence for f in read_until(again, other, other.now + 2.0)] == [
        f.sequence for f in frames
    ]


def contacts(frames: list[Frame]) -> list[list[float]]:
    return [frame.truth.contact.tolist() for frame in frames]


def test_a_scene_that_stands_still_goes_on_being_read() -> None:
    clock = Clock()
    source = source_of("circle", clock)
    read_until(source, clock, clock.now + 0.3)
    source.seek(None, 0.0)
    stood = source.playing.at
    frames = read_until(source, clock, clock.now + 0.3)
    assert len(frames) > 100
    assert np.ptp(contacts(frames[1:]), axis=0) == pytest.approx(0)
    assert len(set(map(tuple, counts_of(frames)))) > 100  # the noise goes on
    assert np.diff([frame.sequence for frame in frames]).tolist() == [1] * (len(frames) - 1)
    source.seek(None, 1.0)
    assert source.playing.at == pytest.approx(stood)
    later = read_until(source, clock, clock.now + 0.3)
    assert np.ptp(contacts(later), axis=0).max() > 1e-3


@pytest.mark.parametrize("speed", [0.25, 1.0, 4.0])
def test_a_scene_goes_on_from_where_it_is_sought_as_fast_as_asked(speed: float) -> None:
    clock = Clock()
    source = source_of("circle", clock)
    read_until(source, clock, clock.now + 0.5)
    scene = load_scene("circle")
    source.seek(1.25, speed)
    frames = read_until(source, clock, clock.now + 0.1)
    since = frames[0].device_time
    for frame in frames:
        (load,) = scene.loads_at(1.25 + speed * (frame.device_time - since))
        assert frame.truth.contact == pytest.approx(load.centre(), abs=1e-9)


def test_what_was_sought_stays_when_the_skin_becomes_another() -> None:
    clock = Clock()
    source = source_of("circle", clock)
    source.seek(0.7, 0.0)
    longer = Patch(0.12, 0.1)
    scene = load_scene("circle")
    layout = SensorLayout.regular(longer, 9, 9)
    source.play(replace(scene, plate=replace(scene.plate, patch=longer), layout=layout))
    (frame, *_) = read_until(source, clock, clock.now + 0.1)
    (load,) = scene.loads_at(0.7)
    assert frame.truth.contact == pytest.approx(load.centre(), abs=1e-9)


@pytest.mark.parametrize("bad", [(math.nan, 1.0), (math.inf, 1.0), (0.0, -1.0), (0.0, 11.0)])
def test_no_time_and_no_speed_are_refused(bad) -> None:
    with pytest.raises(Refusal, match="to play a scene"):
        source_of("circle").seek(*bad)


def test_a_rigid_object_that_is_moved_while_it_is_pressed_reads_as_one_put_there() -> None:
    sphere = load_scene("sphere")
    (stimulus,) = sphere.stimuli
    moved = replace(
        sphere, stimuli=(replace(stimulus, what=replace(stimulus.what, x=stimulus.what.x + 0.01)),)
    )
    going, fresh = Simulator(sphere), Simulator(moved)
    scan = sphere.sensor().scan()
    for n in range(30):
        going.reading(scan, n / 30)
    going.change(moved)
    for time in (0.3, 0.6, 0.9):
        truth, other = (each.reading(scan, time)[0].coefficients for each in (going, fresh))
        assert truth == pytest.approx(other, abs=1e-7 * np.abs(other).max())
