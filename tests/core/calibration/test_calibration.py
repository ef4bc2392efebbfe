"""Cylinders to gains, offsets, loops and creep, and frames without them."""

import json
import math
import pickle
import time
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise

import numpy as np
import pytest

import sweeps
from kappaskin import (
    Calibration,
    Engine,
    Patch,
    Pipeline,
    Plate,
    Refusal,
    SensorLayout,
    Setup,
    Simulator,
    Status,
    load_scene,
)
from kappaskin.calibration import Procedure, calibrate
from kappaskin.calibration.calibration import fingerprint
from kappaskin.calibration.identification import fit_lines, identify_hysteresis, play_thresholds
from kappaskin.calibration.report import ChannelLimits
from kappaskin.live.ring import Ring
from kappaskin.scenes.cylinders import Presentation, schedule
from kappaskin.scenes.effects import (
    FIRST_GENERATION_LOOPS,
    SECOND_GENERATION_LOOPS,
    Creep,
    GaussianNoise,
    Hysteresis,
    ReadingEffect,
    Size,
    Tolerance,
)

pytestmark = pytest.mark.slow

DATE = datetime(2026, 3, 1, 12, tzinfo=UTC)
TOLERANCE = Tolerance(0.05, 3.0, seed=8)
NOISE = GaussianNoise(0.23)
SKIN = load_scene("calibration")
SMALL = replace(SKIN, layout=SensorLayout.regular(SKIN.plate.patch, 4, 4))
SEEN = 0.16  # s on each cylinder: what the mean is good to is 0.23 / sqrt(36) = 0.04 1/m

# Larger and smaller swings than any sweep makes, with minor loops inside of minor loops.
TURNS = (
    0,
    75,
    0,
    -75,
    0,
    60,
    20,
    50,
    -30,
    10,
    -70,
    -20,
    -50,
    72,
    33,
    41,
    5,
    66,
    -61,
    -12,
    -37,
    18,
    0,
)
UNSEEN = np.concatenate([np.linspace(a, b, 60) for a, b in pairwise(TURNS)])


def swept(*effects, scene=SMALL, steps=None, dwell=SEEN):
    """The sensor of a skin that `effects` spoil, and its sweep over the steps."""
    laid = Presentation(schedule() if steps is None else steps, dwell)
    simulator = Simulator(replace(scene, effects=effects, laid=laid))
    sensor = scene.sensor()
    procedure, n = Procedure(sensor, laid.steps), 0
    while not procedure.done:
        times, readings = [], []
        while laid.index(n / scene.rate) == len(procedure.taken):
            frame = simulator.frame(n, lambda: 0.0)
            if laid.settled(frame.device_time):
                times.append(frame.device_time)
                readings.append(sensor.nominal(frame))
            n += 1
        procedure.take(np.array(times), np.array(readings))
    return sensor, procedure.sweep()


def report_of(*effects, limits=None, **how):
    sensor, sweep = swept(*effects, **how)
    return calibrate(sweep, sensor, DATE, limits)


def played(path, effects, correct, channels, noise=0.0):
    """What is corrected of the skin's readings on the way `path`, less the truth, (T, C)."""
    rng = np.random.default_rng(11)
    running = [effect.start((channels,), rng) for effect in effects]
    errors = np.empty((len(path), channels))
    for k, x in enumerate(path):
        read = np.full(channels, x)
        for run in running:
            read = run(read, k / 500)
        errors[k] = correct(read + noise * rng.normal(size=channels), k / 500) - x
    return errors


def by_line(report):
    return lambda reading, _: (reading - report.line.offset) / report.line.gain


@pytest.fixture(scope="module")
def second():
    """The second prototype's sweep: 300 channels, each with its own gain and offset."""
    return report_of(SECOND_GENERATION_LOOPS, TOLERANCE, NOISE, scene=SKIN)


@pytest.fixture(scope="module")
def plain():
    """A sweep without loops."""
    return report_of(TOLERANCE, NOISE, scene=SKIN)


# Lines


def test_the_line_is_numpys_with_its_standard_errors():
    rng = np.random.default_rng(2)
    x, y = rng.uniform(-80, 80, 30), rng.normal(size=(30, 4)) + np.arange(4)
    found = fit_lines(x, y)
    for c in range(4):
        (gain, offset), covariance = np.polyfit(x, y[:, c], 1, cov=True)
        assert [found.gain[c], found.offset[c]] == pytest.approx([gain, offset])
        sd = np.sqrt(np.diag(covariance))
        assert [found.gain_sd[c], found.offset_sd[c]] == pytest.approx(sd)


def test_the_error_of_a_reading_left_out_is_that_of_leaving_each_out():
    rng = np.random.default_rng(3)
    x = rng.uniform(-80, 80, 12)
    y = 1.1 * x[:, None] + rng.normal(size=(12, 1))
    left = []
    for k in range(12):
        gain, offset = np.polyfit(np.delete(x, k), np.delete(y[:, 0], k), 1)
        left.append(y[k, 0] - offset - gain * x[k])
    found = fit_lines(x, y)
    assert found.left_out[0] == pytest.approx(np.sqrt(np.mean(np.square(left))) / found.gain[0])


def coverage(found, sd, true):
    """Share of channels whose truth lies within 1.96 standard errors: 0.95 when all is right."""
    return np.mean(np.abs(found - true) < 1.96 * sd)


FOUR_SIGMA = 4 * math.sqrt(0.95 * 0.05 / 300)


@pytest.mark.full
def test_without_loops_gains_and_offsets_lie_within_their_standard_errors(plain):
    gain, offset = TOLERANCE.errors((300,))
    assert plain.passed.all()
    assert plain.calibration.creep is None
    assert coverage(plain.fitted.gain, plain.fitted.gain_sd, gain) > 0.95 - FOUR_SIGMA
    assert coverage(plain.fitted.offset, plain.fitted.offset_sd, offset) > 0.95 - FOUR_SIGMA
    assert np.median(plain.fitted.gain_sd) < 2e-4


def test_without_loops_almost_no_channel_is_given_any(plain):
    found = plain.calibration.hysteresis
    given = 0 if found is None else np.count_nonzero(found.weights.any(axis=0))
    assert given <= 15  # of 300
    errors = played(UNSEEN, [TOLERANCE], plain.calibration.start(), 300)
    assert np.abs(errors).max() < 0.25


@pytest.mark.full
def test_with_loops_gains_and_offsets_lie_within_their_standard_errors(second):
    gain, offset = TOLERANCE.errors((300,))
    assert second.passed.all()
    assert coverage(second.fitted.gain, second.fitted.gain_sd, gain) > 0.95 - FOUR_SIGMA
    assert coverage(second.fitted.offset, second.fitted.offset_sd, offset) > 0.95 - FOUR_SIGMA
    # A line alone is not even near: the loops pull its slope.
    assert coverage(second.line.gain, second.line.gain_sd, gain) < 0.1


# Loops


def test_the_report_shows_the_loops_and_what_is_left_of_them(second):
    (inner, outer), (inner_left, outer_left) = second.gaps, second.gaps_left
    # The line shows them a little too wide, as it shows all curvature.
    assert np.median(inner[:200]) == pytest.approx(7.0 / 0.963, abs=0.1)
    assert np.median(outer[:200]) < np.median(inner[:200])
    two_means = math.sqrt(2) * 0.23 / 6
    assert np.median(inner_left) < 3 * two_means
    assert max(inner_left.max(), outer_left.max()) < 6 * two_means
    assert np.median(second.line.left_out[:200]) == pytest.approx(2.3, abs=0.2)
    assert np.median(second.fitted.left_out) < 0.06
    assert second.fitted.left_out.max() < 0.3
    assert np.median(second.noise) == pytest.approx(0.23, rel=0.05)


@pytest.mark.full
def test_a_skin_that_was_bent_before_is_calibrated_as_well_as_one_at_rest():
    class Used(ReadingEffect):
        """The second prototype's loops, with a past."""

        name = "used-loops"
        formula = "none"

        def size(self, survey):
            return Size(1.0, 1.0)

        def start(self, shape, rng):
            running = SECOND_GENERATION_LOOPS.start(shape, rng)
            for x in (-70.0, 60.0, 20.0, 35.0, 0.0):
                running(np.full(shape, x), 0.0)
            return running

    used, rested = (
        report_of(loops, TOLERANCE, NOISE) for loops in (Used(), SECOND_GENERATION_LOOPS)
    )
    np.testing.assert_allclose(used.fitted.gain, rested.fitted.gain, rtol=1e-9)
    np.testing.assert_allclose(used.fitted.offset, rested.fitted.offset, atol=1e-9)


@pytest.mark.parametrize("twist", [False, True])
def test_on_an_unseen_sweep_the_loops_shrink_more_than_tenfold(second, twist):
    channels = slice(200, 300) if twist else slice(0, 200)
    path = UNSEEN / 2 if twist else UNSEEN  # a twist gage is bent half as far
    effects = [SECOND_GENERATION_LOOPS, TOLERANCE]

    before = played(path, effects, by_line(second), 300)[:, channels]
    after = played(path, effects, second.calibration.start(), 300)[:, channels]

    # Every channel by itself, and minor loops count.
    assert (np.abs(before).max(axis=0) > 10 * np.abs(after).max(axis=0)).all()
    assert before.std() > 30 * after.std()
    if not twist:  # as the guide and lesson 8 say
        assert np.abs(before).max() == pytest.approx(4.6, abs=0.05)
        assert np.abs(after).max() == pytest.approx(0.17, abs=0.005)
    # No two ways to one curvature are further apart than a tenth of the loops' 7 1/m.
    assert 2 * np.abs(after).max() < 0.7


def test_the_first_prototypes_loops_shrink_more_than_tenfold_too():
    report = report_of(FIRST_GENERATION_LOOPS, TOLERANCE, NOISE)
    effects = [FIRST_GENERATION_LOOPS, TOLERANCE]
    before = played(UNSEEN, effects, by_line(report), 48)[:, :32]
    after = played(UNSEEN, effects, report.calibration.start(), 48)[:, :32]
    assert report.passed.all()
    assert np.abs(before).max() > 10
    assert (np.abs(before).max(axis=0) > 10 * np.abs(after).max(axis=0)).all()


def test_noise_in_every_frame_grows_by_no_more_than_the_loops_hide(second):
    effects = [SECOND_GENERATION_LOOPS, TOLERANCE]
    errors = played(UNSEEN, effects, second.calibration.start(), 300, noise=0.23)[:, :200]
    # A small change is read with 0.80 of its size: undone, noise is 1 / 0.80 as large at most.
    assert 0.23 < errors.std() < 0.23 / 0.80
    assert np.abs(errors.mean()) < 0.02


def test_every_channel_has_its_own_loops():
    none, narrow, wide = (
        Hysteresis((3.0, 9.0, 15.0), weights, 1.3)
        for weights in ((0.0,) * 3, (0.02,) * 3, (0.1,) * 3)
    )

    class Mixed(ReadingEffect):
        """A skin whose elements are glued on differently."""

        name = "mixed-loops"
        formula = "none"

        def size(self, survey):
            return Size(1.0, 1.0)

        def start(self, shape, rng):
            third = [effect.start(shape, rng) for effect in (none, narrow, wide)]
            turn = np.arange(np.prod(shape)).reshape(shape) % 3
            return lambda x, t: np.choose(turn, [run(x, t) for run in third])

    report = report_of(Mixed(), TOLERANCE, NOISE)
    share = report.calibration.hysteresis.weights.sum(axis=0)[:32]
    np.testing.assert_allclose(share[1::3], 0.06, atol=0.015)
    np.testing.assert_allclose(share[2::3], 0.3, atol=0.02)
    assert np.count_nonzero(share[0::3]) <= 2
    after = played(UNSEEN, [Mixed(), TOLERANCE], report.calibration.start(), 48)[:, :32]
    assert np.abs(after).max() < 0.6


def test_loops_of_another_make_shrink_as_well():
    class Smooth(ReadingEffect):
        """Many plays on a smoothly bent scale, none of the thresholds or kinks of ours."""

        name = "smooth-loops"
        formula = "none"

        def size(self, survey):
            return Size(1.0, 1.0)

        def start(self, shape, rng):
            r = np.geomspace(1.0, 40.0, 60).reshape(60, *np.ones_like(shape))
            w = np.zeros((60, *shape))

            def read(x, _):
                u = np.sinh(x / 150) * 150 / (1 + 0.2 * (1 + np.tanh(x / 30)))
                np.clip(w, u - r, u + r, out=w)
                return 0.85 * (0.7 * u + 0.3 * w.mean(axis=0)) * (1 + 0.2 * (1 + np.tanh(x / 30)))

            return read

    report = report_of(Smooth(), TOLERANCE, NOISE)
    # After the first swing to both sides: the widest plays of these loops were never told at rest.
    before = played(UNSEEN, [Smooth(), TOLERANCE], by_line(report), 48)[180:, :32]
    after = played(UNSEEN, [Smooth(), TOLERANCE], report.calibration.start(), 48)[180:, :32]
    assert before.std() > 3 * after.std()


@pytest.mark.cases("Preisach")
@pytest.mark.parametrize("loops", [sweeps.BoucWen, sweeps.Preisach, sweeps.ManyPlays])
def test_the_error_told_covers_paths_that_were_not_calibrated_on(loops):
    found = [sweeps.off(loops, seed) for seed in range(2)]
    for path in ("other order", "other radii", "partial loops"):
        errors = np.concatenate([one[path].ravel() for one in found])
        assert np.mean(np.abs(errors) < 1.96) > 0.9
        assert np.sqrt(np.mean(errors**2)) > 0.4  # and is not far too large


def test_without_loops_the_error_told_is_that_of_the_noise(plain):
    of_a_mean = 0.23 / 6
    assert np.median(plain.error) == pytest.approx(of_a_mean, rel=0.3)
    assert plain.calibration.error is plain.error


def test_the_identified_weights_are_those_of_a_sweep_they_explain():
    # Thresholds and curvatures of the true plays among those that are tried: found to the digit.
    true = Hysteresis((4.0, 16.0), (0.1, 0.15), 1.5)
    path = np.concatenate([[0.0], np.linspace(0, 80, 41), np.linspace(80, -80, 81)])
    running = true.start((1,), np.random.default_rng(0))
    y = 2.0 + 1.1 * np.array([running(np.array([x]), 0.0) for x in path])

    r, used = play_thresholds(path, 8), np.ones(len(path), bool)
    found, loops = identify_hysteresis(path, y, used, r, fit_lines(path, y), 1e-6)

    assert [found.gain[0], found.offset[0]] == pytest.approx([1.1, 2.0], abs=1e-6)
    assert loops.stretch[0] == pytest.approx(1.5, abs=1e-6)
    weights = dict(zip(loops.thresholds[:, 0].round(9).tolist(), loops.weights[:, 0], strict=True))
    assert weights.pop(4.0) == pytest.approx(0.1, abs=1e-6)
    assert weights.pop(16.0) == pytest.approx(0.15, abs=1e-6)
    assert max(weights.values()) < 1e-6


def test_a_twist_gage_that_is_bent_half_as_far_knows_how_well_its_gain_is_told():
    x = np.array([step.curvature[2] for step in schedule()])
    used = np.arange(len(x)) >= [step.along for step in schedule()].index("diagonal")
    rng = np.random.default_rng(6)
    gain = rng.normal(1, 0.05, 100)
    running = SECOND_GENERATION_LOOPS.start((100,), rng)
    y = np.array([gain * running(np.full(100, k), 0.0) for k in x])
    y += 0.01 * rng.normal(size=y.shape)

    found, _ = identify_hysteresis(
        x, y, used, play_thresholds(x, 8), fit_lines(x[used], y[used]), 1e-3
    )

    assert coverage(found.gain, found.gain_sd, gain) > 0.95 - 4 * math.sqrt(0.95 * 0.05 / 100)
    assert found.gain_sd.max() < 0.01


def test_the_error_of_a_reading_that_the_loops_had_not_seen_is_that_of_leaving_each_out():
    x = np.array([step.curvature[0] for step in schedule((0.05, 0.025, 0.015))])
    running = SECOND_GENERATION_LOOPS.start((1,), np.random.default_rng(0))
    y = np.array([running(np.array([k]), 0.0) for k in x])
    y += 0.05 * np.random.default_rng(5).normal(size=y.shape)
    used = np.ones(len(x), bool)
    left = []
    for k in range(len(x)):
        others = used & (np.arange(len(x)) != k)
        straight = fit_lines(x[others], y[others])
        found, loops = identify_hysteresis(x, y, others, play_thresholds(x, 3), straight, 1e-3)
        plays = loops.start()
        told = [found.offset + found.gain * plays(np.array([v])) for v in x]
        left.append((y[k] - told[k])[0])

    found, _ = identify_hysteresis(x, y, used, play_thresholds(x, 3), fit_lines(x, y), 1e-3)

    # The library keeps the stretch and most of the active weights, which all readings determine.
    assert found.left_out[0] == pytest.approx(np.sqrt(np.mean(np.square(left))), rel=0.2)
    assert found.left_out[0] > 1.1 * found.rms[0]


# Creep


@pytest.fixture(scope="module")
def creeping():
    effects = (SECOND_GENERATION_LOOPS, Creep(0.05, 4.0), TOLERANCE, NOISE)
    return report_of(*effects, steps=schedule(hold=20.0))


@pytest.mark.full
def test_a_hold_tells_the_creep(creeping):
    creep = creeping.calibration.creep
    assert creep.time_constant == pytest.approx(4.0, rel=0.03)
    np.testing.assert_allclose(creep.share, 0.05, atol=0.003)


def test_loops_and_creep_are_undone_together(creeping):
    effects = [SECOND_GENERATION_LOOPS, Creep(0.05, 4.0), TOLERANCE]
    held = np.concatenate([UNSEEN, np.full(2000, 60.0), UNSEEN])
    after = played(held, effects, creeping.calibration.start(), 48)[:, :32]
    before = played(held, effects, by_line(creeping), 48)[:, :32]
    assert creeping.passed.all()
    assert before.std() > 10 * after.std()
    assert np.abs(after).max() < 0.6


def test_without_creep_a_hold_tells_none():
    assert report_of(TOLERANCE, NOISE, steps=schedule(hold=20.0)).calibration.creep is None


def test_a_hold_that_is_too_short_for_the_creep_is_refused():
    with pytest.raises(Refusal, match=r"too short for the creep.*use a longer hold"):
        report_of(Creep(0.3, 60.0), NOISE, steps=schedule(hold=5.0))


# Who passes


def spoilt(change):
    """A report of a sweep after `change(readings)`, in which one channel was changed."""
    sensor, sweep = swept(SECOND_GENERATION_LOOPS, TOLERANCE, NOISE, dwell=0.05)
    readings, noise = sweep.readings.copy(), sweep.noise.copy()
    change(readings, noise)
    return calibrate(replace(sweep, readings=readings, noise=noise), sensor, DATE)


def change_5(readings, kind, noise):
    rng = np.random.default_rng(0)
    if kind == "rail":
        readings[8:10, 5] = np.nan
    elif kind == "stuck":
        readings[:, 5] = 3.0
    elif kind == "reversed":
        readings[:, 5] *= -1
    elif kind == "loose":
        readings[:, 5] += rng.normal(0, 10, len(readings))
    elif kind == "unbalanced":
        readings[:, 5] += 60
    elif kind == "noisy":
        noise[:, 5] = 20
    elif kind == "weak":
        readings[:, 5] *= 0.2


@pytest.mark.cases("noisy", "stuck", "rail")
@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("rail", "saturated or not read on 2 of 103 steps, first on step 9"),
        ("stuck", "gain [-0-9.e]+, expected 0.5 to 2"),
        ("reversed", "gain -.*reversed wires"),
        ("loose", "error .* 1/m, expected at most 3.85"),
        ("unbalanced", "offset .*balance the bridge"),
        ("noisy", "noise .*loose wire"),
        ("weak", "gain 0.198, expected 0.5 to 2"),
    ],
)
def test_a_channel_that_fails_says_why_and_reads_nothing_any_more(kind, reason):
    report = spoilt(lambda readings, noise: change_5(readings, kind, noise))

    assert list(report.failed) == [5]
    with pytest.raises(AssertionError, match=reason):
        raise AssertionError(report.failed[5])
    assert np.flatnonzero(~report.passed).tolist() == [5]
    corrected = report.calibration.start()(np.full(48, 10.0), 0.0)
    assert np.flatnonzero(np.isnan(corrected)).tolist() == [5]


def test_loops_that_hide_small_changes_fail():
    report = report_of(
        SECOND_GENERATION_LOOPS, TOLERANCE, NOISE, dwell=0.05, limits=ChannelLimits(linear=0.8055)
    )
    assert 0 < len(report.failed) < 48
    assert all("of a small change" in why for why in report.failed.values())


def test_dead_channels_are_left_out_and_are_no_failure():
    dead = replace(SMALL, layout=SMALL.layout.without([3]))
    report = report_of(TOLERANCE, NOISE, scene=dead, dwell=0.05)
    assert report.failed == {}
    assert np.flatnonzero(~report.passed).tolist() == [3, 19, 35]
    assert dict(report.calibration.failures)[19] == "dead, reported by the device"


def test_a_strip_is_calibrated_by_bending_it_along_x_alone():
    patch = Patch(0.1, 0.02, strip=True)
    strip = replace(SKIN, plate=Plate(patch), layout=SensorLayout.regular(patch, 10, 1))
    strip = replace(strip, reference=(15, 1))
    report = report_of(
        SECOND_GENERATION_LOOPS, TOLERANCE, NOISE, scene=strip, steps=schedule(strip=True)
    )
    assert report.failed == {}
    assert np.flatnonzero(report.passed).tolist() == list(range(10))
    assert report.gaps_left[:, :10].max() < 0.5


# Refusals


def test_a_sweep_that_cannot_calibrate_is_refused():
    sensor, sweep = swept(TOLERANCE, NOISE, dwell=0.05)

    def without(*steps):
        kept = [k for k, step in enumerate(sweep.steps) if step not in steps]
        parts = {name: getattr(sweep, name)[kept] for name in ("readings", "noise", "times")}
        return replace(sweep, steps=tuple(sweep.steps[k] for k in kept), **parts)

    def those(which):
        return [step for step in sweep.steps if not step.flat and which(step)]

    for which, reason in (
        (lambda s: s.face < 0, "no cylinder bends xx with the outer face.*both faces"),
        (lambda s: s.along != "x", "no cylinder bends yy with the inner face"),
        (lambda s: s.way == "back", "bends xx with the inner face was captured with rising radius"),
        (lambda s: s.radius < 0.05 and s.face > 0, "3 radii that bend xy with the inner.*got 2"),
        (lambda s: s.along == "diagonal" and s.radius < 0.05, "3 radii that bend xy.*got 2"),
    ):
        with pytest.raises(Refusal, match=reason):
            calibrate(without(*those(which)), sensor, DATE)
    cut = {name: getattr(sweep, name)[:, 1:] for name in ("readings", "noise", "course")}
    with pytest.raises(Refusal, match=r"expected readings of the 48 channels of .*, got 47"):
        calibrate(replace(sweep, **cut), sensor, DATE)
    with pytest.raises(Refusal, match="every channel was dead or saturated on some step"):
        calibrate(replace(sweep, readings=np.full_like(sweep.readings, np.nan)), sensor, DATE)
    with pytest.raises(Refusal, match=r"none of 48 channels passed; xx of element 0: gain"):
        calibrate(replace(sweep, readings=0.1 * sweep.readings), sensor, DATE)
    thick = replace(sensor.transduction.bridge, substrate_thickness=300e-6)
    other = replace(sensor, transduction=replace(sensor.transduction, bridge=thick))
    with pytest.raises(Refusal, match="beyond their elastic limit"):
        calibrate(sweep, other, DATE)


def test_an_amplifier_that_is_too_strong_is_refused_and_the_remedy_named():
    strong = replace(SMALL, transduction=load_scene("circle").transduction)
    with pytest.raises(Refusal, match=r"step 2: .* onto their rails; .*lower the amplifier's gain"):
        report_of(NOISE, scene=strong, dwell=0.05)


# The corrector


def test_a_missing_reading_is_nan_and_spoils_nothing_after_it(second):
    whole, holed = second.calibration.start(), second.calibration.start()
    rng = np.random.default_rng(1)
    for k, x in enumerate(UNSEEN[:200]):
        reading = np.full(300, x)
        expected = whole(reading, k / 500)
        gone = reading.copy()
        gone[150:] = np.where(rng.random(150) < 0.3, [np.nan, np.inf, -np.inf][k % 3], x)
        got = holed(gone, k / 500)
        np.testing.assert_array_equal(got[:150], expected[:150])
        np.testing.assert_array_equal(np.isnan(got), ~np.isfinite(gone))
    # Once each channel has been read at the turns, holes between them have left nothing behind.
    for k, x in enumerate((80.0, -80.0, 12.0)):
        np.testing.assert_allclose(
            holed(np.full(300, x), 1 + k), whole(np.full(300, x), 1 + k), atol=1e-9
        )


def test_a_hole_while_the_skin_stays_still_leaves_no_trace(second):
    whole, holed = second.calibration.start(), second.calibration.start()
    for x in (70.0, 30.0):
        whole(np.full(300, x), 0.0)
        holed(np.full(300, x), 0.0)
    holed(np.full(300, np.nan), 0.1)
    np.testing.assert_array_equal(holed(np.full(300, 30.0), 0.2), whole(np.full(300, 30.0), 0.2))


def test_a_channel_that_was_never_read_begins_at_rest(second):
    corrector = second.calibration.start()
    nothing = corrector(np.full(300, np.nan), 0.0)
    assert np.isnan(nothing).all()
    np.testing.assert_array_equal(
        corrector(np.full(300, 20.0), 0.1), second.calibration.start()(np.full(300, 20.0), 0.1)
    )


def test_a_corrector_leaves_what_it_is_given_and_what_it_gave_alone(creeping):
    corrector = creeping.calibration.start()
    given = np.linspace(-50, 50, 48)
    first = corrector(given, 0.0)
    kept = first.copy()
    corrector(given[::-1].copy(), 5.0)
    np.testing.assert_array_equal(given, np.linspace(-50, 50, 48))
    np.testing.assert_array_equal(first, kept)


def test_calibrations_of_the_same_content_are_equal_also_through_a_pipe(creeping, second):
    same = pickle.loads(pickle.dumps(creeping.calibration))
    assert same == creeping.calibration
    assert hash(same) == hash(creeping.calibration)
    assert same != second.calibration
    assert replace(same, offset=same.offset + 1e-9) != same
    assert same != "a calibration"


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"date": datetime(2026, 3, 1)}, "date with its time zone"),
        ({"gain": np.ones(3)}, "arrays of equal length"),
        ({"gain": np.zeros(48)}, "gains above zero"),
        ({"gain": np.full(48, np.nan)}, "a reason for every channel"),
        ({"failures": ((3, "why"),)}, "a reason for every channel"),
        ({"offset": np.full(48, np.inf)}, "finite offsets"),
        ({"hysteresis": SECOND_GENERATION_LOOPS.operator(3)}, "arrays of equal length"),
        ({"creep": Creep(0.1, 1.0).solid(3)}, "arrays of equal length"),
    ],
)
def test_a_calibration_that_contradicts_itself_is_refused(creeping, changes, reason):
    with pytest.raises(Refusal, match=reason):
        replace(creeping.calibration, **changes)


# In the pipeline and the engine


def pipeline_of(calibration, sensor=None):
    return Pipeline(sensor or SKIN.sensor(), Setup(calibration=calibration))


def test_the_pipeline_shows_corrected_curvature(second):
    effects = (SECOND_GENERATION_LOOPS, TOLERANCE)
    laid = Presentation(schedule(), 0.02)
    simulator = Simulator(replace(SKIN, effects=effects, laid=laid))
    corrected, raw = pipeline_of(second.calibration), pipeline_of(None)
    errors = []
    for n in range(970):
        frame = simulator.frame(n, lambda: 0.0)
        true = laid.curvature(frame.device_time)[:, None]
        errors.append([p.curvature(frame) - true for p in (corrected, raw)])
    worst = np.abs(errors).max(axis=(0, 2, 3))
    assert worst[1] > 10
    assert worst[0] < 0.4


def test_an_estimate_takes_each_frame_once(second):
    simulator = Simulator(replace(SKIN, effects=(SECOND_GENERATION_LOOPS, TOLERANCE)))
    one, two = pipeline_of(second.calibration), pipeline_of(second.calibration)
    for n in range(0, 30):
        frame = simulator.frame(20 * n, lambda: 0.0)
        np.testing.assert_array_equal(one(frame).curvature, two.curvature(frame))


def test_a_new_pipeline_begins_with_a_fresh_memory(second):
    bent = Simulator(replace(SKIN, effects=(), laid=Presentation(schedule()[8:], 1.0)))
    flat = Simulator(replace(SKIN, effects=(), laid=Presentation(schedule()[:1], 1.0)))
    used = pipeline_of(second.calibration)
    fresh = used.curvature(flat.frame(0, lambda: 0.0))
    used.curvature(bent.frame(0, lambda: 0.0))

    assert np.abs(used.curvature(flat.frame(1, lambda: 0.0)) - fresh).max() > 1
    again = pipeline_of(second.calibration)
    np.testing.assert_array_equal(again.curvature(flat.frame(1, lambda: 0.0)), fresh)


def test_a_pipeline_that_goes_on_from_another_remembers_what_that_one_saw(second):
    bent = Simulator(replace(SKIN, effects=(), laid=Presentation(schedule()[8:], 1.0)))
    flat = Simulator(replace(SKIN, effects=(), laid=Presentation(schedule()[:1], 1.0)))
    sensor = SKIN.sensor()
    used, other = pipeline_of(second.calibration, sensor), pipeline_of(None, sensor)
    used(bent.frame(0, lambda: 0.0))
    part = flat.frame(1, lambda: 0.0)
    part = replace(part, channels=part.channels[:100], counts=part.counts[:100])

    after = Pipeline(sensor, Setup(5, 5, calibration=second.calibration))
    after.continue_from(used)
    other.continue_from(used)  # its readings are not corrected: it has nothing to take over
    stranger = pipeline_of(second.calibration)
    stranger.continue_from(used)  # of another sensor

    went_on, alone = after(part).curvature, stranger(part).curvature
    assert np.isfinite(went_on).all()  # the others are held
    assert np.isnan(other(part).curvature).sum() == np.isnan(alone).sum() == 200
    assert np.abs(went_on - alone)[np.isfinite(alone)].max() > 1  # bent the other way before
    np.testing.assert_array_equal(went_on, used(part).curvature)


def test_the_calibration_of_another_device_or_skin_is_refused(second):
    sensor = SKIN.sensor()
    with pytest.raises(
        Refusal, match=r"belongs to Simulated skin SIM-0001, the sensor is .* SIM-0002"
    ):
        pipeline_of(second.calibration, replace(sensor, serial_number="SIM-0002"))
    for layout in (
        SensorLayout.regular(sensor.layout.patch, 5, 20),
        SMALL.layout,
        SensorLayout.scattered(sensor.layout.patch, sensor.layout.positions + 1e-6),
    ):
        with pytest.raises(Refusal, match="at other positions than when it was calibrated"):
            pipeline_of(second.calibration, replace(sensor, layout=layout))
    pipeline_of(second.calibration, replace(sensor, layout=sensor.layout.without([1])))


def test_a_skin_calibrated_flat_stays_calibrated_when_it_is_mounted(second):
    sensor = SKIN.sensor()
    bent = Patch(0.1, 0.1, radius=0.05)
    mounted = replace(sensor.layout, patch=bent)
    second.calibration.check(replace(sensor, layout=mounted, plate=Plate(bent)))


def test_the_engine_goes_over_to_a_calibration_and_keeps_it_from_other_devices(second):
    foreign = replace(second.calibration, serial_number="K-7")
    with Engine(Setup(calibration=second.calibration)) as engine:

        def wait_for(told):
            end = time.monotonic() + 30
            while not told(status := engine.status()) and time.monotonic() < end:
                time.sleep(0.02)
            return status

        engine.connect("sim:calibration")
        status = wait_for(lambda s: engine.latest(s) is not None)
        assert status.setup.calibration == second.calibration
        engine.set_up(Setup(calibration=foreign))
        status = wait_for(lambda s: s.refusal)
        assert "belongs to Simulated skin K-7" in status.refusal
        assert status.setup.calibration == second.calibration
        engine.set_up(Setup())
        assert wait_for(lambda s: s.setup == Setup()).refusal == ""


def test_the_calibration_of_the_largest_skin_fits_into_a_status():
    sensor = replace(SKIN.sensor(), serial_number="x")
    loops = Hysteresis(tuple(range(1, 14)), (0.01,) * 13, 1.5)
    numbers = np.ones((4, 2**14))
    about = (sensor.name, sensor.serial_number, sensor.firmware, fingerprint(sensor.layout), DATE)
    largest = Calibration(*about, *numbers, loops.operator(2**14), Creep(0.1, 1.0).solid(2**14))
    ring = Ring.create()
    try:
        ring.write_status(Status(setup=Setup(calibration=largest)))
        assert ring.read_status().setup.calibration == largest
    finally:
        ring.destroy()
    with pytest.raises(Refusal, match="arrays of equal length for 1 to 16384 channels"):
        Calibration(*about, *np.ones((4, 2**14 + 1)))


def test_a_report_says_everything_in_json(second):
    told = json.loads(json.dumps(second.to_json(), allow_nan=False))
    assert (told["passed"], told["failed"], len(told["channels"])) == (300, 0, 300)
    assert told["channels"][205]["component"] == "xy"
    assert told["channels"][205]["element"] == 5
    assert told["channels"][205]["gain"] == second.fitted.gain[205]
    assert isinstance(second.calibration, Calibration)
