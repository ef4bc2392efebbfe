"""A tare is what rest reads; it is refused when loaded or moving, and its drift is told."""

import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from kappaskin import (
    Calibration,
    DiscLoad,
    LineLoad,
    Pipeline,
    PointLoad,
    Refusal,
    Setup,
    Simulator,
    Tare,
    load_scene,
)
from kappaskin.calibration import DriftMonitor, Rest, TareMeasurement
from kappaskin.calibration.calibration import fingerprint
from kappaskin.contact import LoadDetector
from kappaskin.scenes import SCENES
from kappaskin.scenes.effects import (
    SECOND_GENERATION_LOOPS,
    Creep,
    GaussianNoise,
    Temperature,
    Tolerance,
)
from kappaskin.scenes.effects.electronics import FlickerNoise

pytestmark = pytest.mark.slow

SCENE = replace(load_scene("centre"), stimuli=(), rate=100.0)
SENSOR = SCENE.sensor()
SEEKER = LoadDetector(SENSOR)
C = SENSOR.channels
NOW = datetime(2026, 11, 22, 1, 2, 3, tzinfo=UTC)
OFF = Tolerance(gain_sd=0.0, offset_sd=1.0, seed=3)
"""Elements that are off by 1 1/m at random."""


def spoilt(scene, *effects):
    return replace(scene, effects=(*scene.effects, *effects))


def frames_of(scene, seconds=1.2, start=0.0):
    simulator = Simulator(scene)
    first = round(start * scene.rate)
    return [
        simulator.frame(n, lambda: n / scene.rate)  # noqa: B023
        for n in range(first, first + math.ceil(seconds * scene.rate))
    ]


def taken(scene, pipeline=None, frames=None, seeker=None, temperature=math.nan):
    pipeline = pipeline or Pipeline(scene.sensor(), Setup())
    taring = TareMeasurement(pipeline.sensor, -1.0)
    for frame in frames or frames_of(scene):
        if taring.done(0.0):
            break
        estimate = pipeline(frame)
        taring.take(estimate.device_time, estimate.host_time, estimate.nominal)
    seeker = seeker or LoadDetector(pipeline.sensor)
    return taring.tare(seeker, pipeline.rest(), NOW, temperature)


def tare_of(level, **changes):
    offset = np.broadcast_to(np.asarray(level, float), C).copy()
    layout = fingerprint(SENSOR.layout)
    parts = (SENSOR.name, SENSOR.serial_number, layout, NOW, None, 500, 1.0, offset, 0 * offset)
    return replace(Tare(*parts), **changes)


def calibration_of(**changes):
    zero, one = np.zeros(C), np.ones(C)
    layout, when = fingerprint(SENSOR.layout), NOW - timedelta(days=1)
    parts = (SENSOR.name, SENSOR.serial_number, SENSOR.firmware, layout, when)
    return replace(Calibration(*parts, one, zero, zero, zero), **changes)


# What it is


def test_it_is_what_the_elements_are_off_by():
    scene = spoilt(SCENE, OFF)
    off = np.random.default_rng(3)  # what the effect draws: gains first, then offsets
    off.normal(size=C)

    tare = taken(scene)

    simulator = Simulator(replace(scene, effects=(OFF,)))
    expected = simulator.reading(SENSOR.scan(), 0.0)[1]
    error = tare.offset - expected
    assert np.sqrt(np.mean(error**2)) < 3 * 0.231 / math.sqrt(tare.frames)
    assert (tare.frames, tare.seconds) == (101, 1.0)


def test_its_errors_are_those_of_its_offsets():
    tares = [taken(replace(SCENE, seed=seed)) for seed in range(6)]

    spread = np.std([tare.offset for tare in tares], axis=0, ddof=1)
    told = np.array([tare.offset_sd for tare in tares])
    assert np.sqrt(np.mean(spread**2)) == pytest.approx(np.sqrt(np.mean(told**2)), rel=0.1)


def test_a_tared_skin_at_rest_reads_nothing():
    scene = spoilt(SCENE, OFF)
    pipeline = Pipeline(SENSOR, Setup(tare=taken(scene)))

    told = np.mean([pipeline(frame).curvature for frame in frames_of(scene, start=2.0)], axis=0)

    assert np.sqrt(np.mean(told**2)) < 0.05


def test_raw_readings_are_kept_whatever_the_tare():
    frame = frames_of(spoilt(SCENE, OFF), 0.01)[0]

    tared = Pipeline(SENSOR, Setup(tare=tare_of(1.0)))(frame)
    plain = Pipeline(SENSOR, Setup())(frame)

    assert np.array_equal(tared.nominal, plain.curvature)
    assert np.allclose(tared.curvature, plain.curvature - 1.0)


def test_a_channel_without_a_tare_reads_nothing():
    offset = np.zeros(C)
    offset[7] = np.nan

    estimate = Pipeline(SENSOR, Setup(tare=tare_of(offset)))(frames_of(SCENE, 0.01)[0])

    assert np.flatnonzero(np.isnan(estimate.curvature.ravel())).tolist() == [7]
    assert np.isfinite(estimate.nominal).all()
    assert np.isfinite(estimate.coefficients).all()


def test_it_stands_in_for_the_offset_of_a_calibration_before_its_gain():
    gain = np.full(C, 1.25)
    calibrated = calibration_of(gain=gain, offset=np.full(C, 3.0))
    frame = frames_of(SCENE, 0.01)[0]

    told = Pipeline(SENSOR, Setup(calibration=calibrated, tare=tare_of(2.0)))(frame)

    assert np.allclose(told.curvature, (told.nominal - 2.0) / 1.25)


def test_a_shift_of_the_bridge_is_undone_inside_the_loops():
    loops = SECOND_GENERATION_LOOPS
    calibration = calibration_of(hysteresis=loops.operator(C))
    rising = [i / 100 * 30.0 for i in range(100)]
    plays, corrected = loops.operator(C).start(), []
    pipeline = Pipeline(SENSOR, Setup(calibration=calibration, tare=tare_of(1.5)))
    for n, k in enumerate(rising):
        read = plays(np.full(C, k)) + 1.5  # the amplifier wandered by 1.5 1/m
        counts = SENSOR.transduction.counts(read)
        frame = replace(frames_of(SCENE, 0.01)[0], counts=counts, device_time=n / 500)
        corrected.append(pipeline.curvature(frame)[0, 0])

    assert np.allclose(corrected, rising, atol=3 * SENSOR.transduction.resolution)


@pytest.mark.full
def test_what_loops_still_hold_of_a_bend_is_not_in_it():
    scene = replace(SCENE, effects=())
    pipeline = Pipeline(SENSOR, Setup(calibration=calibration_of(hysteresis=LOOPS)))
    plays = LOOPS.start()
    course = np.concatenate([np.linspace(0, 34, 100), np.linspace(34, 0, 100), np.zeros(600)])
    shape = Simulator(load_scene("centre")).reading(SENSOR.scan(), 0.0)[1]
    shape /= np.abs(shape).max()
    taring, frame = TareMeasurement(SENSOR, -1.0), frames_of(scene, 0.01)[0]
    rng = np.random.default_rng(1)
    for n, k in enumerate(course):
        read = plays(k * shape) + 0.5 + rng.normal(0, 0.2, C)
        counts = SENSOR.transduction.counts(read)
        estimate = pipeline(replace(frame, counts=counts, device_time=n / 500))
        if n >= 250:
            taring.take(estimate.device_time, 0.0, estimate.nominal)

    tare = taring.tare(SEEKER, pipeline.rest(), NOW, 21.257)

    left = plays(0 * shape)
    assert np.abs(left).max() > 1.0  # which would be taken for zero without the loops
    assert np.abs(tare.offset - 0.5).max() < 0.3
    assert tare.temperature == 21.26


LOOPS = SECOND_GENERATION_LOOPS.operator(C)


def test_creep_left_behind_is_not_in_it():
    calibration = calibration_of(creep=Creep(0.1, 5.0).solid(C))
    correct, relaxing = calibration.start(), calibration.creep.start()
    for n in range(500):
        correct(relaxing(np.full(C, 50.0), n / 100), n / 100)
    read = relaxing(np.zeros(C), 5.0)
    correct(read, 5.0)

    assert np.abs(read).min() > 2.0
    assert np.allclose(correct.remanence(), read, atol=1e-5)


def test_a_corrector_that_remembers_nothing_leaves_nothing():
    assert not calibration_of().start().remanence().any()


# Refused


@pytest.mark.cases("demo", "fingertip", "on-foam", "tapping")
@pytest.mark.parametrize("name", [name for name in SCENES if not load_scene(name).laid])
def test_every_ready_scene_is_refused_while_it_presses_and_tared_when_it_does_not(name):
    scene = load_scene(name)
    scene = replace(scene, rate=min(scene.rate, 200.0))
    at_rest = replace(scene, stimuli=())

    assert np.isfinite(taken(at_rest).offset).any()
    with pytest.raises(Refusal, match=r"loaded|move"):
        taken(scene)


@pytest.mark.cases("load0", "load2", "load3")
@pytest.mark.parametrize(
    "load",
    [
        PointLoad(0.05, 0.05, 0.05),
        PointLoad(0.015, 0.08, 0.3),
        PointLoad(0.05, 0.05, -0.05),
        DiscLoad(0.04, 0.06, 0.02, 0.1),
        LineLoad(0.02, 0.03, 0.08, 0.07, 0.15),
    ],
)
def test_a_load_is_told_from_elements_that_are_off_by_as_much(load):
    scene = spoilt(SCENE.touched_by(load), replace(OFF, offset_sd=0.3))

    with pytest.raises(
        Refusal, match=r"loaded: .* N at \(\d+, \d+\) mm; this contact explains \d+ % of"
    ):
        taken(scene)


def test_a_small_load_is_told_against_the_tare_before():
    spread = spoilt(SCENE, OFF)
    pressed = spread.touched_by(PointLoad(0.05, 0.05, 0.02))
    pipeline = Pipeline(SENSOR, Setup(tare=taken(spread)))

    first = taken(pressed)  # cannot be told from elements that are off

    assert first.frames
    with pytest.raises(Refusal, match=r"since the tare of 2026-11-22 01:02: undo that tare first"):
        taken(pressed, pipeline)


def test_the_force_and_the_place_of_a_load_are_told():
    load = PointLoad(0.03, 0.07, 0.1)

    found = SEEKER(Simulator(SCENE.touched_by(load)).reading(SENSOR.scan(), 0.0)[1], 0.0)

    assert found is not None
    assert found.position == pytest.approx([0.03, 0.07], abs=3e-3)
    assert found.force == pytest.approx(0.1, rel=0.1)
    assert found.share > 0.9


@pytest.mark.parametrize("spread", [0.0, 0.3])
@pytest.mark.parametrize("slope", [0.0, 0.5])
def test_warmth_is_no_load(spread, slope):
    rng = np.random.default_rng(2)
    x = SENSOR.layout.positions[:, 0] / 0.1
    warm = 5.0 * np.tile(1 + slope * x, 3) * (1 + spread * rng.normal(size=C))

    assert SEEKER(warm, 1e-4) is None


def test_offsets_at_random_are_seldom_a_load():
    rng = np.random.default_rng(0)
    assert not any(SEEKER(rng.normal(size=C), 0.0) for _ in range(200))


def test_offsets_at_random_are_seldom_a_load_on_a_strip():
    sensor = load_scene("fingertip").sensor()
    seeker, rng = LoadDetector(sensor), np.random.default_rng(0)
    assert sum(seeker(rng.normal(size=sensor.channels), 0.0) is not None for _ in range(2000)) < 3


def test_a_skin_that_creeps_back_is_still_moving():
    loaded = SCENE.touched_by(PointLoad(0.05, 0.05, 0.3))
    scene = replace(loaded, effects=(*SCENE.effects, Creep(0.2, 5.0)), rate=500.0)
    simulator = Simulator(scene)
    for n in range(50):
        simulator.reading(SENSOR.scan(), n / 10)
    simulator.change(replace(scene, stimuli=()))
    after = [simulator.frame(n, lambda: 0.0) for n in range(2500, 3100)]

    with pytest.raises(Refusal, match=r"the readings move: .* of element \d+ at .* come to rest"):
        taken(scene, frames=after)


def test_noise_that_wanders_slowly_is_no_motion():
    scene = replace(SCENE, effects=(FlickerNoise(0.3), GaussianNoise(0.02)))
    assert taken(scene).frames


def test_a_slow_change_of_the_whole_is_a_motion():
    frames = frames_of(SCENE)
    step = np.round(2.0 / SENSOR.transduction.resolution).astype(int)
    moved = [replace(f, counts=f.counts + n * step // 100) for n, f in enumerate(frames)]

    with pytest.raises(Refusal, match="the readings move"):
        taken(SCENE, frames=moved)


def test_too_few_frames_are_refused():
    with pytest.raises(Refusal, match="at least 20 frames within 5 s, got 15"):
        taken(SCENE, frames=frames_of(SCENE)[:15])


def test_a_skin_on_its_rails_is_refused():
    frame = frames_of(SCENE, 0.01)[0]
    high = SENSOR.transduction.limits[1]
    frames = [
        replace(frame, device_time=n / 50, counts=np.full(C, high, np.int32)) for n in range(60)
    ]
    with pytest.raises(Refusal, match=r"300 of 300 channels read nothing.*saturated.*lower"):
        taken(SCENE, frames=frames)


def test_a_few_channels_on_a_rail_are_left_out():
    high = SENSOR.transduction.limits[1]
    frames = frames_of(SCENE)
    for frame in frames:
        frame.counts[[5, 120]] = high

    tare = taken(SCENE, frames=frames)

    assert np.flatnonzero(np.isnan(tare.offset)).tolist() == [5, 120]


def test_a_device_that_restarts_meanwhile_is_refused():
    frames = frames_of(SCENE)
    with pytest.raises(Refusal, match="clock went back: it restarted; tare again"):
        taken(SCENE, frames=[*frames[60:], *frames[:60]])


def test_a_frame_that_another_overtook_is_no_restart():
    frames = frames_of(SCENE)
    frames[60], frames[61] = frames[61], frames[60]

    assert taken(SCENE, frames=frames).frames == 100


def test_frames_of_before_it_was_asked_for_do_not_count():
    taring = TareMeasurement(SENSOR, 10.0)
    for n in range(600):
        taring.take(n / 500, 9.0, np.zeros((3, 100)))

    assert not taring.done(10.1)
    assert taring.done(15.1)
    with pytest.raises(Refusal, match="got 0"):
        taring.tare(SEEKER, Rest(np.zeros(C), np.zeros(C), None), NOW, math.nan)


# Whose it is


def test_another_sensor_is_refused():
    other = replace(SENSOR, serial_number="other")
    with pytest.raises(Refusal, match="this tare belongs to Simulated skin SIM-0001, not to"):
        Pipeline(other, Setup(tare=tare_of(0.0)))


def test_a_sensor_with_its_elements_elsewhere_is_refused():
    other = load_scene("fingertip").sensor()
    with pytest.raises(Refusal, match="at other positions than when it was tared; tare it again"):
        Pipeline(other, Setup(tare=tare_of(0.0)))


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"date": NOW.replace(tzinfo=None)}, "time zone"),
        ({"offset": np.zeros((2, 2))}, "shapes"),
        ({"offset_sd": np.zeros(3)}, "shapes"),
        ({"offset": np.full(C, np.nan)}, "finite"),
        ({"offset": np.full(C, np.inf)}, "finite"),
        ({"offset_sd": np.full(C, -1.0)}, "at least 0"),
        ({"frames": 0}, "frames"),
        ({"seconds": math.nan}, "frames"),
        ({"temperature": math.inf}, "temperature"),
    ],
)
def test_a_tare_that_makes_no_sense_is_refused(changes, reason):
    with pytest.raises(Refusal, match=reason):
        tare_of(0.0, **changes)


def test_tares_of_the_same_content_are_equal():
    assert tare_of(1.0) == tare_of(1.0)
    assert tare_of(1.0) != tare_of(1.5)


# Its drift


def drift_after(scene, seconds=6.0, tare=None):
    pipeline = Pipeline(scene.sensor(), Setup(tare=tare or tare_of(0.0)))
    for frame in frames_of(scene, seconds):
        pipeline(frame)
        if frame.sequence % 10 == 0:
            pipeline.drift.current()
    return pipeline.drift.current()


def test_drift_is_what_the_readings_wandered_by():
    drift = drift_after(SCENE, tare=tare_of(np.random.default_rng(0).normal(0, 0.5, C)))

    assert drift.curvature == pytest.approx(0.5, rel=0.1)
    assert not drift.loaded
    assert drift.device_time > 5.0


def test_frames_that_others_overtook_do_not_keep_the_drift_from_being_told():
    watch = DriftMonitor(SEEKER, np.zeros_like)
    off = np.random.default_rng(0).normal(0, 0.5, (3, 100))
    for n in range(300):
        late = 0.05 if n % 50 == 49 else 0.0
        watch.follow(0.02 * n - late, off, np.zeros((9, 9)), 0.2)
        watch.current()

    assert watch.current().curvature == pytest.approx(0.5, rel=0.1)


def test_noise_is_no_drift():
    drift = drift_after(SCENE)

    assert drift.curvature < 0.01
    assert drift.displacement < 1e-5


@pytest.mark.full
def test_drift_tells_the_displacement_that_it_looks_like():
    warm = Temperature(rise=10.0, time_constant=0.01, offset=0.2)
    drift = drift_after(replace(SCENE, effects=(GaussianNoise(0.1), warm)))

    assert drift.curvature == pytest.approx(2.0, rel=0.02)
    shape = Pipeline(SENSOR, Setup()).fit(np.full((3, 100), 2.0)).coefficients
    surface = Pipeline(SENSOR, Setup())._surface(shape)  # noqa: SLF001
    assert drift.displacement == pytest.approx(np.abs(surface).max(), rel=0.05)


def test_a_load_is_no_drift_and_what_was_told_before_it_stays():
    tare = tare_of(np.random.default_rng(0).normal(0, 0.5, C))
    pipeline = Pipeline(SENSOR, Setup(tare=tare))
    simulator, told = Simulator(SCENE), []
    for n in range(1600):
        if n == 500:
            simulator.change(SCENE.touched_by(PointLoad(0.05, 0.05, 0.3)))
        if n == 1000:
            simulator.change(SCENE)
        pipeline(simulator.frame(n, lambda: 0.0))
        if n % 10 == 9:
            told.append(pipeline.drift.current())

    loaded = [drift.loaded for drift in told]
    assert not any(loaded[:50])
    assert all(loaded[56:100])
    assert not loaded[-1]
    known = [drift.curvature for drift in told if math.isfinite(drift.curvature)]
    assert known == pytest.approx([0.5] * len(known), rel=0.1)


def test_a_pipeline_without_a_tare_watches_no_drift():
    assert Pipeline(SENSOR, Setup()).drift is None


def test_another_tare_does_not_forget_how_the_skin_was_bent():
    calibration = calibration_of(hysteresis=LOOPS)
    before = Pipeline(SENSOR, Setup(calibration=calibration))
    after = Pipeline(SENSOR, Setup(calibration=calibration, tare=tare_of(0.5)))

    after.continue_from(before)

    assert after.past.correct is before.past.correct
    assert after.past.hold is not before.past.hold
