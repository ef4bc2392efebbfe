"""A scene to the counts that a real device would send, with the truth beside them."""

from dataclasses import replace

import numpy as np
import pytest

from kappaskin import Patch, Plate, PointLoad, Refusal, Scene, SensorLayout, Simulator, load_scene
from kappaskin.bases import SineBasis
from kappaskin.mechanics import Stretching
from kappaskin.scenes import EffectSelection, Orbit, plan
from kappaskin.scenes.cylinders import CylinderStep, Presentation
from kappaskin.scenes.effects import SECOND_GENERATION_LOOPS, Creep, GaussianNoise, UniformNoise

PATCH = Patch(0.1, 0.1)
QUIET = Scene("quiet", Plate(PATCH), SensorLayout.regular(PATCH, 5, 4)).touched_by(
    PointLoad(0.03, 0.06, 0.15)
)
NOISY = replace(QUIET, effects=(UniformNoise(0.2), GaussianNoise(0.1)), seed=3)


def counts(scene, frames=4):
    simulator = Simulator(scene)
    return np.array([simulator.frame(n, lambda: 0.0).counts for n in range(frames)])


def test_without_effects_the_counts_are_those_of_the_true_curvature():
    c = QUIET.plate.deflection(QUIET.loads, QUIET.basis)
    curvature = QUIET.layout.operator(QUIET.basis) @ c.ravel()

    expected = np.rint(curvature * 0.065625 / (2.5 / 2**15))

    assert np.abs(expected).max() > 1000
    np.testing.assert_array_equal(counts(QUIET), np.tile(expected, (4, 1)))


def test_effects_of_no_size_change_nothing():
    without_size = replace(QUIET, effects=(UniformNoise(0.0), GaussianNoise(0.0)))

    np.testing.assert_array_equal(counts(without_size), counts(QUIET))


SHEET = replace(QUIET, plate=Plate(PATCH, thickness=0.25e-3))
LIGHT = {"auto": True, "accuracy": 0.01}


def largest_deflection(scene):
    truth = Simulator(scene).frame(0, lambda: 0.0).truth
    return scene.basis.value(0.03, 0.06, truth.coefficients)


def test_a_skin_of_known_thickness_stretches():
    truth = Simulator(SHEET).frame(0, lambda: 0.0).truth

    c = Stretching(SHEET.plate, SHEET.basis).deflection(SHEET.loads)

    np.testing.assert_allclose(truth.coefficients, c, rtol=0, atol=1e-7 * np.abs(c).max())
    assert largest_deflection(SHEET) < 0.5 * largest_deflection(QUIET)
    without = replace(SHEET, choice=EffectSelection(off=frozenset({"stretching", "finite-slope"})))
    assert largest_deflection(without) == largest_deflection(QUIET)


@pytest.mark.parametrize(("force", "kept"), [(0.15, True), (1e-4, False)])
def test_stretching_is_simulated_where_the_deflection_calls_for_it(force, kept):
    scene = replace(SHEET.touched_by(PointLoad(0.03, 0.06, force)), choice=EffectSelection(**LIGHT))

    entry = next(entry for entry in plan(scene) if entry.name == "stretching")

    assert entry.kept == kept
    assert entry.size.number == pytest.approx(largest_deflection(scene) / 0.25e-3, rel=0.1)


def test_a_moving_load_stretches_the_skin_as_a_still_one_does():
    moving = SHEET.touched_by(PointLoad(0.03, 0.06, 0.15), motion=Orbit(0.01, 1.0))
    simulator = Simulator(moving)
    times = [0.1, 0.11, 0.6, 0.12]

    found = [simulator.reading(moving.sensor().scan(), time)[0].coefficients for time in times]

    for time, c in zip(times, found, strict=True):
        still = Simulator(SHEET.touched_by(*moving.loads_at(time))).frame(0, lambda: 0.0).truth
        np.testing.assert_allclose(c, still.coefficients, rtol=0, atol=1e-6 * np.abs(c).max())


def test_effects_add_up():
    noise = (counts(NOISY, 200) - counts(QUIET, 200)) * NOISY.transduction.resolution

    # 200 x 60 draws: the standard error of the rms is under 1 %.
    assert noise.std() == pytest.approx(np.hypot(0.2, 0.1), rel=0.03)


def test_the_same_seed_gives_the_same_frames_and_another_one_others():
    first = counts(NOISY)

    np.testing.assert_array_equal(first, counts(NOISY))
    assert (first != counts(replace(NOISY, seed=4))).mean() > 0.9
    assert (first[0] != first[1]).mean() > 0.9


def test_frames_carry_their_number_device_time_host_time_and_channels():
    frame = Simulator(QUIET).frame(50, lambda: 17.5)

    assert (frame.sequence, frame.device_time, frame.host_time) == (50, 0.1, 17.5)
    np.testing.assert_array_equal(frame.channels, np.arange(60))
    assert frame.counts.dtype == np.int32


def test_the_sequence_number_wraps_at_32_bits_and_time_goes_on():
    frame = Simulator(QUIET).frame(2**32 + 5, lambda: 0.0)

    assert frame.sequence == 5
    assert frame.device_time == (2**32 + 5) / 500


def test_dead_channels_read_zero_and_the_others_as_before():
    dead = replace(QUIET, layout=QUIET.layout.without([0, 7]))

    read = counts(dead, 1).reshape(3, 20)

    assert not read[:, [0, 7]].any()
    np.testing.assert_array_equal(read[:, 8:], counts(QUIET, 1).reshape(3, 20)[:, 8:])


def test_the_truth_travels_with_the_frame():
    truth = Simulator(NOISY).frame(0, lambda: 0.0).truth

    np.testing.assert_array_equal(truth.contact, [0.03, 0.06])
    np.testing.assert_array_equal(
        truth.coefficients, QUIET.plate.deflection(QUIET.loads, QUIET.basis)
    )


def test_the_truth_moves_with_the_load():
    scene = QUIET.touched_by(*QUIET.loads, motion=Orbit(0.01, 4.0))
    simulator = Simulator(scene)

    truth = simulator.frame(500, lambda: 0.0).truth

    moved = PointLoad(0.03, 0.07, 0.15)
    np.testing.assert_allclose(truth.contact, moved.centre())
    expected = scene.plate.deflection([moved], scene.basis)
    np.testing.assert_allclose(truth.coefficients, expected, rtol=1e-9, atol=1e-15)


def test_a_changed_load_shows_in_the_next_frame():
    simulator = Simulator(QUIET)
    simulator.frame(0, lambda: 0.0)
    other = QUIET.touched_by(PointLoad(0.07, 0.02, 0.1))

    simulator.change(other)
    frame = simulator.frame(1, lambda: 0.0)

    np.testing.assert_array_equal(frame.counts, counts(other)[0])
    np.testing.assert_array_equal(frame.truth.contact, [0.07, 0.02])


def test_changing_only_the_load_goes_on_with_the_noise():
    simulator = Simulator(NOISY)
    simulator.frame(0, lambda: 0.0)

    simulator.change(NOISY.touched_by(*NOISY.loads, motion=Orbit(0.0, 1.0)))

    np.testing.assert_array_equal(simulator.frame(1, lambda: 0.0).counts, counts(NOISY)[1])


def test_changed_effects_are_seeded_anew():
    simulator = Simulator(QUIET)
    simulator.frame(0, lambda: 0.0)

    simulator.change(NOISY)

    np.testing.assert_array_equal(simulator.frame(1, lambda: 0.0).counts, counts(NOISY)[0])


def test_changing_only_the_load_keeps_the_loops_and_the_creep():
    lasting = replace(QUIET, effects=(SECOND_GENERATION_LOOPS, Creep(0.2, 0.01)))
    changed, fresh = Simulator(lasting), Simulator(lasting)
    for n in range(50):
        changed.frame(n, lambda: 0.0)

    changed.change(lasting.touched_by())

    left = changed.frame(50, lambda: 0.0).counts
    assert np.abs(left).max() > 10  # what remains of the load
    effects = Creep(0.2, 0.01), SECOND_GENERATION_LOOPS
    fresh.change(replace(lasting, stimuli=(), effects=effects))
    assert not fresh.frame(51, lambda: 0.0).counts.any()


def test_a_skin_laid_on_cylinders_bends_alike_everywhere_and_has_no_coefficients():
    steps = (CylinderStep(1), CylinderStep(2, 0.05, "x"), CylinderStep(3, 0.04, "diagonal", -1))
    simulator = Simulator(QUIET.laid_on(Presentation(steps, 0.01)))

    frames = [simulator.frame(n, lambda: 0.0) for n in range(30)]

    counts = np.array([frame.counts for frame in frames]).reshape(30, 3, 20)
    per_count = simulator.scene.transduction.resolution
    for n, curvature in ((0, (0, 0, 0)), (5, (20, 0, 0)), (29, (-12.5, -12.5, -12.5))):
        expected = np.rint(np.array(curvature) / per_count)[:, None]
        np.testing.assert_array_equal(counts[n], np.tile(expected, 20))
    assert all(frame.truth is None for frame in frames)


def test_a_load_on_a_skin_laid_on_cylinders_is_refused():
    with pytest.raises(Refusal, match="no loads on a skin that lies on cylinders"):
        replace(QUIET, laid=Presentation((CylinderStep(1),), 1.0))


def test_a_change_to_more_elements_is_answered_with_their_channels():
    simulator = Simulator(QUIET)

    simulator.change(replace(QUIET, layout=SensorLayout.regular(PATCH, 6, 6)))

    frame = simulator.frame(0, lambda: 0.0)
    assert len(frame.channels) == len(frame.counts) == 108


def test_every_frame_of_the_moving_scene_can_be_made():
    scene = load_scene("circle")
    simulator = Simulator(scene)

    contacts = [simulator.frame(n, lambda: 0.0).truth.contact for n in range(0, 2000, 40)]

    turn = 2 * np.pi * np.arange(50) / 50  # once round in 4 s, 2000 frames
    expected = 0.05 + 0.022 * np.column_stack([np.cos(turn), np.sin(turn)])
    np.testing.assert_allclose(contacts, expected, rtol=1e-9)


@pytest.mark.parametrize(
    "name", ["centre", "circle", "tapping", "calibration", "failing-elements", "creep-hold"]
)
def test_frames_at_once_are_those_one_after_the_other(name):
    scene = load_scene(name)
    times = np.arange(12) / scene.rate
    one_by_one, at_once = Simulator(scene), Simulator(scene)
    scan = scene.sensor().scan()

    truths, read = at_once.readings(scan, times)

    each = [one_by_one.reading(scan, time) for time in times.tolist()]
    np.testing.assert_array_equal(read, [curvature for _, curvature in each])
    assert len(truths) == (12 if scene.moves or scene.laid else 1)
    for truth, (expected, _) in zip(truths, each, strict=False):
        if expected is not None:
            np.testing.assert_array_equal(truth.coefficients, expected.coefficients)


def test_frames_tell_the_first_functions_of_a_finely_summed_shape_and_elements_read_all():
    fine = replace(QUIET, reference=(40, 40))

    truth, read = Simulator(fine).reading(fine.sensor().scan(), 0.0)
    told = Simulator(fine).frame(0, lambda: 0.0).truth

    c = fine.plate.deflection(fine.loads, fine.basis)
    np.testing.assert_array_equal(truth.coefficients, c)
    np.testing.assert_array_equal(told.coefficients, c[:24, :24])
    expected = fine.layout.operator(fine.basis) @ c.ravel()
    step = fine.transduction.resolution  # in which readings come
    np.testing.assert_allclose(read, expected, rtol=0, atol=0.51 * step)
    first = fine.layout.operator(SineBasis(PATCH, 24, 24)) @ told.coefficients.ravel()
    assert np.abs(read - first).max() > 4 * step
