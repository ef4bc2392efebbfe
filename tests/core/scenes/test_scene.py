"""Scenes: a skin, what touches it, and what spoils its readings."""

import math
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import (
    Disk,
    LineLoad,
    Patch,
    Plate,
    PointLoad,
    Polygon,
    Refusal,
    Scene,
    SensorLayout,
    SineBasis,
    load_scene,
)
from kappaskin.scenes import SCENES, TABLE_1_NOISE, LoadingHistory, Orbit, check_elements, scaled_to
from kappaskin.scenes.stimulus import MotionPath, PressStep, ReleaseStep, SlideStep, contact_of

PATCH = Patch(0.1, 0.1)


def scene(*loads, motion=None):
    bare = Scene("a scene", Plate(PATCH), SensorLayout.regular(PATCH, 4, 4))
    return bare.touched_by(*loads, motion=motion)


@pytest.mark.parametrize("name", SCENES)
def test_every_ready_scene_is_a_sensor_that_says_it_is_simulated(name):
    sensor = load_scene(name).sensor()

    assert sensor.simulated
    others = {"fingertip": 30, "camera": 400, "tilts": 200, "dome": 192, "saddle": 192}
    assert sensor.channels == (others | {"fingertip-cap": 180, "thumb-pad": 360}).get(name, 300)


@pytest.mark.parametrize(
    ("name", "place", "w_applied"),
    [
        ("centre", (0.05, 0.05), 4.70e-3),
        ("off-centre", (0.02, 0.08), 4.89e-3),
        ("line", (0.05, 0.05), 4.68e-3),
    ],
)
def test_table_1s_skins_move_by_w_applied_at_the_load(name, place, w_applied):
    scene = load_scene(name)

    c = scene.plate.deflection(scene.loads, SineBasis(PATCH, 15, 15))

    assert scene.reference == (15, 15)
    assert scene.basis.at(np.array([place]))[0] @ c.ravel() == pytest.approx(w_applied, rel=1e-12)


def test_the_peak_of_the_off_centre_case_is_5_53_mm():
    scene = load_scene("off-centre")

    w = scene.basis.on_grid(*PATCH.grid(201, 201))(scene.plate.deflection(scene.loads, scene.basis))

    assert 1e3 * w.max() == pytest.approx(5.53, abs=5e-3)


def test_table_1s_noise_is_even_between_plus_and_minus_0_40():
    (noise,) = load_scene("centre").effects

    drawn = noise.start((100_000,), np.random.default_rng(0))(np.zeros(100_000), 0.0)

    assert 0.3999 < np.abs(drawn).max() <= 0.40 + 1e-12
    assert drawn.std() == pytest.approx(TABLE_1_NOISE, rel=1e-2)


def test_without_a_name_the_default_scene_is_loaded():
    assert load_scene().name == load_scene("circle").name == "circle"


def test_an_unknown_scene_is_refused_with_those_there_are():
    with pytest.raises(
        Refusal,
        match=r"among bolt, calibration, camera, .*, or a file that ends in .toml; got 'moon'",
    ):
        load_scene("moon")


def test_a_load_scaled_to_a_displacement_moves_its_point_that_far():
    basis, line = SineBasis(PATCH, 9, 9), LineLoad(0.02, 0.03, 0.07, 0.05)

    load = scaled_to(Plate(PATCH), line, 1.5e-3, basis)

    c = Plate(PATCH).deflection([load], basis)
    assert basis.at(np.array([[0.045, 0.04]]))[0] @ c.ravel() == pytest.approx(1.5e-3)


def test_a_load_on_the_edge_cannot_be_scaled_to_a_displacement_and_is_refused():
    with pytest.raises(Refusal):
        scaled_to(Plate(PATCH), PointLoad(0.0, 0.05), 1e-3, SineBasis(PATCH, 9, 9))


def test_the_contact_is_the_centre_of_force():
    contact = contact_of((PointLoad(0.02, 0.03, 1.0), LineLoad(0.05, 0.03, 0.07, 0.09, -3.0)))

    np.testing.assert_allclose(contact, [0.05, 0.0525])


@pytest.mark.parametrize("loads", [(), (PointLoad(0.02, 0.03, 0.0),)])
def test_without_force_there_is_no_contact(loads):
    assert np.isnan(contact_of(loads)).all()


@pytest.mark.parametrize(
    ("time", "expected"), [(0.0, (0.07, 0.05)), (1.0, (0.05, 0.07)), (2.0, (0.03, 0.05)),
                           (4.0, (0.07, 0.05)), (4.5, (0.0641421, 0.0641421))]
)  # fmt: skip
def test_a_load_on_an_orbit_goes_round_once_in_a_period(time, expected):
    (load,) = scene(PointLoad(0.05, 0.05), motion=Orbit(0.02, 4.0)).loads_at(time)

    assert (load.x, load.y) == pytest.approx(expected)


def test_without_motion_loads_stay():
    loads = (PointLoad(0.05, 0.05), LineLoad(0.01, 0.02, 0.03, 0.04))

    assert scene(*loads).loads_at(17.0) == loads


def test_a_load_presses_as_hard_as_its_motion_says_where_that_has_taken_it():
    way = MotionPath(
        (
            PressStep(1.0, "linear"),
            SlideStep(1.0, "linear", (0.02, 0.0)),
            ReleaseStep(1.0, "linear"),
        )
    )
    moved = scene(PointLoad(0.05, 0.05, 0.4), motion=way)

    told = [moved.loads_at(time) for time in (0.0, 0.25, 1.5, 2.75)]

    assert told[0] == ()
    assert [(load.x, load.force) for (load,) in told[1:]] == [
        pytest.approx(expected) for expected in ((0.05, 0.1), (0.06, 0.4), (0.07, 0.1))
    ]


def test_a_load_off_the_skin_is_refused():
    with pytest.raises(Refusal, match=r"on the patch of 0\.1 x 0\.1 m"):
        scene(PointLoad(0.05, 0.101))


@pytest.mark.parametrize(("x", "y"), [(0.085, 0.05), (0.05, 0.085), (0.015, 0.05), (0.05, 0.015)])
def test_a_load_that_will_leave_the_skin_is_refused_at_once(x, y):
    with pytest.raises(Refusal, match=r"on the patch of 0\.1 x 0\.1 m"):
        scene(PointLoad(x, y), motion=Orbit(0.02, 4.0))


L = Polygon([(0, 0), (0.1, 0), (0.1, 0.05), (0.05, 0.05), (0.05, 0.1), (0, 0.1)])


@pytest.mark.parametrize(
    ("patch", "load", "motion"),
    [
        (Disk(0.05), PointLoad(0.07, 0.07), Orbit(0.0225, 1.0)),
        (
            L,
            PointLoad(0.08, 0.03),
            MotionPath((PressStep(1), SlideStep(1, by=(-0.05, 0.05)), ReleaseStep(1))),
        ),
    ],
    ids=["by the rim of a disk", "over the inner corner of an L"],
)
def test_a_load_that_leaves_the_skin_in_between_is_refused_too(patch, load, motion):
    there = Scene("there", Plate(patch), SensorLayout.regular(patch, 10, 10))
    for time in motion.moments:
        load.shifted(motion.at(time).dx, motion.at(time).dy).check(patch)

    with pytest.raises(Refusal, match="expected a load on the"):
        there.touched_by(load, motion=motion)


@pytest.mark.parametrize(("radius", "period"), [(-0.1, 1.0), (0.1, 0.0), (math.nan, 1.0)])
def test_an_orbit_that_cannot_be_is_refused(radius, period):
    with pytest.raises(Refusal, match="radius >= 0 m and a period of 1e-06 to"):
        Orbit(radius, period)


def test_a_scene_that_is_too_fast_for_its_converter_is_no_sensor():
    with pytest.raises(Refusal, match="lower the rate or the conversion time"):
        replace(load_scene("centre"), rate=700.0).sensor()


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_is_looked_at_all_over_once(name):
    scene = load_scene(name)

    moments = np.array(scene.survey_times)

    assert moments[0] == 0
    assert (np.diff(moments) > 0).all()
    if scene.moves or scene.laid:
        assert set(scene.moments) <= set(moments.tolist())
        assert scene.duration * 0.97 < moments[-1] <= scene.duration
        assert np.diff(moments).max() <= scene.duration / 48 * (1 + 1e-9)


def test_a_rigid_object_presses_as_the_point_loads_that_it_makes():
    scene = load_scene("pencil")
    time = max(scene.moments, key=lambda time: scene.stimuli[0].pose_at(time).amount)

    pressed = LoadingHistory(scene, scene.plate)(time)

    force = sum(load.modal(scene.basis) for load in pressed.loads)
    np.testing.assert_allclose(force, pressed.force, atol=1e-9 * np.abs(pressed.force).max())
    asked = scene.stimuli[0].what.force * scene.stimuli[0].pose_at(time).amount
    assert sum(load.force for load in pressed.loads) == pytest.approx(asked, rel=1e-3)
    np.testing.assert_allclose(contact_of(pressed.loads), pressed.contact, atol=1e-9)


def test_so_many_elements_as_the_wire_tells_apart_and_no_more():
    check_elements(2**16 // 3)
    check_elements(2**16 // 6, 2)
    for too_many in ((2**16 // 3 + 1,), (2**16 // 6 + 1, 2)):
        with pytest.raises(Refusal, match="at most 21845 elements"):
            check_elements(*too_many)
