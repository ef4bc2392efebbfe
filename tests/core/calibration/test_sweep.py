"""The steps of a calibration, who presents them, and the procedure that takes them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Refusal, Transduction, load_scene
from kappaskin.calibration import Procedure
from kappaskin.scenes.cylinders import RADII, CylinderStep, Presentation, radii_for, schedule
from kappaskin.sensing import Amplifier, HalfBridge

SENSOR = load_scene("calibration").sensor()
SHORT = schedule((0.05, 0.025, 0.015))


def frames(step, n=5, time=None, noise=0.1):
    """Times (n,) and readings (n, C) of a step, read with noise and nothing else."""
    rng = np.random.default_rng(step.number)
    begun = float(step.number) if time is None else time
    true = np.repeat(step.curvature, len(SENSOR.layout))
    return begun + 0.01 * np.arange(n), true + noise * rng.normal(size=(n, SENSOR.channels))


def all_taken(steps=SHORT):
    procedure = Procedure(SENSOR, steps)
    while step := procedure.step:
        procedure.take(*frames(step))
    return procedure


@pytest.mark.parametrize("along", ["x", "y", "diagonal"])
@pytest.mark.parametrize("face", [1, -1])
def test_a_cylinder_has_one_principal_curvature_and_bends_as_it_lies(along, face):
    xx, yy, xy = CylinderStep(1, 0.02, along, face).curvature
    principal = np.linalg.eigvalsh([[xx, xy], [xy, yy]])
    assert sorted(principal, key=abs) == pytest.approx([0.0, face * 50.0])
    direction = {"x": (1, 0), "y": (0, 1), "diagonal": (math.sqrt(0.5), math.sqrt(0.5))}[along]
    assert direction @ np.array([[xx, xy], [xy, yy]]) @ direction == pytest.approx(face * 50.0)


def test_each_direction_goes_from_large_to_small_and_back_on_one_face_then_on_the_other():
    steps = schedule((0.025, 0.1, 0.05))

    told = [(s.along, s.face, round(1e3 * s.radius), s.way) for s in steps if not s.flat]
    ways = [(100, "there"), (50, "there"), (25, "there"), (50, "back"), (100, "back")]
    sweep = [(face, *way) for face in (1, -1) for way in ways]
    assert told == [
        (along, *step) for along in ("x", "y", "diagonal") for step in ((-1, 25, "first"), *sweep)
    ]
    assert [step.number for step in steps] == list(range(1, 44))
    assert [step.number for step in steps if step.flat][:5] == [1, 3, 9, 15, 17]


def test_a_strip_is_bent_along_x_alone():
    assert {step.along for step in schedule(strip=True)} == {"x"}


def test_a_hold_comes_first_and_bends_every_channel():
    steps = schedule(hold=60.0)
    assert [step.flat for step in steps[:4]] == [True, False, True, False]
    assert steps[1].hold == 60.0
    assert (steps[1].curvature == 0.5 / min(RADII)).all()
    assert (schedule(hold=60.0, strip=True)[1].curvature[0]) == 1 / min(RADII)


def test_the_ready_radii_stay_within_the_elastic_limit_and_reach_the_papers_fingertip():
    Procedure(SENSOR, schedule())
    assert 75 < 1 / min(RADII) < 80
    assert np.ptp(np.diff([0, *(1 / np.array(RADII))])) < 3.1  # 1/m: nearly even


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (CylinderStep(1), "Flat table, nothing pressing on the skin"),
        (
            CylinderStep(5, 0.025, "x", 1, "back"),
            "Cylinder of radius 25 mm, bent along x, inner face on it, rising radius",
        ),
        (
            CylinderStep(5, 0.0145, "diagonal", -1),
            "Cylinder of radius 14.5 mm, bent along the diagonal from corner x = y = 0, "
            "outer face on it, falling radius",
        ),
        (
            CylinderStep(2, 0.013, "y", -1, "first"),
            "Cylinder of radius 13 mm, bent along y, outer face on it, preconditioning",
        ),
        (
            CylinderStep(2, 0.02, "y", hold=60.0),
            "Cylinder of radius 20 mm, bent along y, inner face on it, held for 60 s",
        ),
    ],
)
def test_a_step_says_what_to_do(step, words):
    assert str(step) == words


@pytest.mark.parametrize(
    ("radii", "hold", "reason"),
    [
        ((0.1, 0.05), 0.0, "at least 3 different radii, got 2"),
        ((0.1, 0.05, 0.05), 0.0, "at least 3 different radii, got 2"),
        ((), 0.0, "at least 3 different radii, got 0"),
        ((0.1, 0.05, 0.0), 0.0, "radii above zero"),
        ((0.1, 0.05, -0.1), 0.0, "radii above zero"),
        ((0.1, 0.05, math.nan), 0.0, "radii above zero"),
        ((0.1, 0.05, math.inf), 0.0, "radii above zero"),
        ((0.1, 0.05, 0.02), -1.0, "a hold of at least 0 s"),
        ((0.1, 0.05, 0.02), math.nan, "a hold of at least 0 s"),
    ],
)
def test_radii_that_make_no_schedule_are_refused(radii, hold, reason):
    with pytest.raises(Refusal, match=reason):
        schedule(radii, hold)


def test_a_cylinder_that_strains_the_gages_beyond_their_limit_is_refused_before_it_is_asked_for():
    with pytest.raises(Refusal, match=r"radius 12 mm strains .* by 1\.04 %.*at least 12\.5 mm"):
        Procedure(SENSOR, schedule((0.05, 0.02, 0.012)))
    Procedure(SENSOR, schedule((0.05, 0.02, 0.0125)))  # 1 % sharp


# Presentations


@given(
    st.floats(0.01, 100),
    st.integers(0, 42),
    st.sampled_from((0.01, 0.3, 0.49, 0.51, 0.94, 0.96, 0.99)),
)
def test_each_step_is_presented_for_its_dwell(dwell, number, share):
    laid = Presentation(SHORT, dwell)
    time = (number + share) * dwell
    assert laid.index(time) == number
    np.testing.assert_array_equal(laid.curvature(time), SHORT[number].curvature)
    assert laid.settled(time) == (0.5 < share < 0.95)


@pytest.mark.parametrize("dwell", [0.1, 0.06, 1 / 3])
def test_a_frame_that_is_due_when_a_step_ends_is_read_on_the_next(dwell):
    laid = Presentation(SHORT, dwell)
    for number in range(1, 43):
        for time in (number * dwell, round(number * dwell, 6)):
            assert laid.index(time) == number


def test_after_the_last_step_it_stays():
    laid = Presentation(SHORT[:4], 1.0)
    assert laid.index(1e9) == 4
    assert laid.curvature(1e9)[0] == SHORT[3].curvature[0] != 0
    assert not laid.settled(1e9)


def test_a_hold_lasts_as_long_as_it_should_and_counts_whole():
    laid = Presentation(schedule(hold=10.0), 1.0)
    assert [laid.index(t) for t in (0.9, 1.1, 10.9, 11.1)] == [0, 1, 1, 2]
    assert laid.settled(1.01)
    assert laid.settled(10.9)
    assert not laid.settled(10.96)


@pytest.mark.parametrize("dwell", [0.0, -1.0, math.nan, math.inf])
def test_a_presentation_without_steps_or_time_is_refused(dwell):
    for steps, seconds in ((SHORT, dwell), ((), 1.0)):
        with pytest.raises(Refusal, match="at least one step and a dwell above zero"):
            Presentation(steps, seconds)


# The procedure


def test_the_procedure_goes_through_all_steps_and_gives_their_means():
    procedure = all_taken()
    sweep = procedure.sweep()

    assert procedure.done
    assert procedure.step is None
    expected = np.repeat(sweep.curvature, 100, axis=1)
    assert np.abs(sweep.readings - expected).max() < 5 * 0.1 / math.sqrt(5)
    assert sweep.noise.mean() == pytest.approx(0.1 * 0.94, rel=0.01)  # c4(5): means of deviations
    np.testing.assert_allclose(sweep.times, np.arange(1, 44) + 0.02)


def test_redo_goes_back_by_one_step():
    procedure = Procedure(SENSOR, SHORT)
    with pytest.raises(Refusal, match="this is the first"):
        procedure.redo()
    procedure.take(*frames(SHORT[0]))
    procedure.take(*frames(SHORT[1]))

    procedure.redo()

    assert procedure.step is SHORT[1]
    assert len(procedure.taken) == 1
    procedure.take(*frames(SHORT[1], time=9.0))
    assert procedure.taken[-1].time == pytest.approx(9.02)


def test_the_cylinders_chosen_are_those_that_the_sensor_reads():
    wide, narrow = load_scene("calibration").sensor(), load_scene("circle").sensor()
    assert radii_for(wide) == RADII
    radii = radii_for(narrow)
    assert len(radii) == 5
    chain = narrow.transduction
    assert np.isfinite(chain.curvature(chain.counts(1.29 / np.array(radii)))).all()
    assert np.isnan(chain.curvature(chain.counts(1.4 / np.array([min(radii)])))).all()


def test_no_cylinder_chosen_strains_the_gages_too_far():
    thick = HalfBridge(substrate_thickness=300e-6)
    scene = replace(
        load_scene("calibration"), transduction=Transduction(thick, amplifier=Amplifier(gain=2.0))
    )
    sensor = scene.sensor()
    assert 1 / min(radii_for(sensor)) <= sensor.transduction.strain_limit_curvature < 1 / RADII[-1]
    Procedure(sensor, schedule(radii_for(sensor)))


def test_a_cylinder_that_drives_every_amplifier_onto_a_rail_is_refused_before_the_first():
    sensor = load_scene("circle").sensor()
    with pytest.raises(Refusal, match=r"step 2: .* 25 mm drives .* rails; use radii of at least"):
        Procedure(sensor, schedule((0.1, 0.05, 0.025)))
    Procedure(sensor, schedule((0.1, 0.05, 0.03)))


def test_a_channel_on_a_rail_in_any_frame_has_no_reading_of_that_step():
    times, readings = frames(SHORT[0])
    readings[2, 7] = np.nan
    taken = Procedure(SENSOR, SHORT).take(times, readings)
    assert np.flatnonzero(np.isnan(taken.mean)).tolist() == [7]
    assert "1 channels dead or saturated" in str(taken)


def test_what_was_taken_is_told_beside_the_cylinder():
    procedure = Procedure(SENSOR, SHORT)
    for step in SHORT[:4]:
        told = str(procedure.take(*frames(step, noise=0.0)))
    assert told == (
        "xx +20.0 (cylinder +20.0), yy +0.0 (cylinder +0.0), xy +0.0 (cylinder +0.0) 1/m, "
        "noise 0 1/m in 5 frames"
    )


def test_of_a_hold_the_course_is_kept_and_its_end_is_the_reading():
    steps = schedule((0.05, 0.025, 0.015), hold=10.0)
    procedure = Procedure(SENSOR, steps)
    procedure.take(*frames(steps[0], time=0.0))
    times = 1 + np.arange(2000) / 200
    readings = np.repeat(np.exp(-(times - 1))[:, None], SENSOR.channels, axis=1)

    taken = procedure.take(times, readings)

    assert taken.frames == 201
    assert taken.mean[0] == pytest.approx(np.exp(-9.5), rel=0.1)
    assert taken.course.shape == (500, SENSOR.channels)
    np.testing.assert_allclose(taken.course[:, 3], np.exp(-(taken.moments - 1)), rtol=1e-3)


def refused(procedure, reason, times, readings):
    step = procedure.step
    with pytest.raises(Refusal, match=reason):
        procedure.take(times, readings)
    assert procedure.step is step


def test_frames_that_make_no_reading_are_refused_and_the_step_stays():
    procedure = Procedure(SENSOR, SHORT)
    times, readings = frames(SHORT[0])
    refused(procedure, "at least 2 frames on step 1, got 1", times[:1], readings[:1])
    refused(procedure, "at least 2 frames on step 1, got 0", times[:0], readings[:0])
    refused(procedure, r"expected readings \(5, 300\), got \(5, 299\)", times, readings[:, 1:])
    refused(procedure, r"expected readings \(4, 300\)", times[1:], readings)
    refused(procedure, "expected finite readings and times", times, readings * np.inf)
    refused(procedure, "expected finite readings and times", times * np.nan, readings)
    refused(procedure, "clock went back on step 1", times[::-1], readings)
    refused(procedure, "every channel is dead or saturated", times, readings * np.nan)
    procedure.take(times, readings)
    refused(procedure, "clock went back on step 2: it restarted", times - 5, readings)


def test_a_sweep_is_given_when_all_is_done_and_not_before():
    procedure = Procedure(SENSOR, SHORT)
    with pytest.raises(Refusal, match="43 steps are not captured yet"):
        procedure.sweep()
    with pytest.raises(Refusal, match="all steps are captured"):
        all_taken().take(*frames(SHORT[0], time=99.0))


def test_a_sweep_of_mixed_shapes_or_of_infinities_is_refused():
    sweep = all_taken().sweep()
    with pytest.raises(Refusal, match="for 43 steps, got"):
        replace(sweep, readings=sweep.readings[1:])
    with pytest.raises(Refusal, match="for 43 steps, got"):
        replace(sweep, course=np.zeros((3, 300)))
    with pytest.raises(Refusal, match="got infinity"):
        replace(sweep, readings=sweep.readings + np.inf)
