"""The contact from force and moment at the base, against contacts put there by hand."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Cap, IntrinsicContact, LineLoad, Patch, PointLoad, Refusal
from kappaskin.contact import ForceTorqueSensor, Wrench

FLAT = Patch(0.04, 0.03)
FINGER = Patch(math.pi * 12.9e-3, 0.03, radius=12.9e-3)  # half a cylinder
SHALLOW = Patch(0.04, 0.03, radius=0.5)
DOME, SADDLE = Patch(0.04, 0.03, (0.1, 0.09)), Patch(0.04, 0.03, (0.1, -0.09))
CAP, SPHEROID = Cap(0.016, 1.2), Cap(0.016, 1.2, 1.5)
SKINS = pytest.mark.parametrize("patch", [FLAT, FINGER, SHALLOW], ids=["flat", "finger", "shallow"])
DOMED = pytest.mark.parametrize(
    "patch", [DOME, SADDLE, CAP, SPHEROID], ids=["dome", "saddle", "cap", "spheroid"]
)
BASE = (0.021, -0.012, -0.03)
EXACT = ForceTorqueSensor(BASE, 0.0, 0.0)
NOISY = ForceTorqueSensor(BASE, 3e-3, 2e-5)

places = st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
forces = st.tuples(st.floats(0.05, 20), st.floats(-5, 5), st.floats(-5, 5))


def frame_at(patch, place):
    """Point, outward normal and the tangent across the axis, by rotating the flat ones."""
    x, y = place
    if patch.is_shallow or isinstance(patch, Cap):
        at, n = patch.at_rest(np.array(place))
        return at, n, patch.base(*place).frame[0]
    turn = 0.0 if math.isinf(patch.radius) else (x - patch.a / 2) / patch.radius
    n, t = (
        np.array([math.sin(turn), 0, math.cos(turn)]),
        np.array([math.cos(turn), 0, -math.sin(turn)]),
    )
    if math.isinf(patch.radius):
        return np.array([x, y, 0.0]), n, t
    return np.array([patch.a / 2, y, -patch.radius]) + patch.radius * n, n, t


def pressed(patch, place, pressure, traction=(0.0, 0.0), torque=0.0, base=BASE):
    """The wrench of a soft-finger contact, by its definition."""
    at, n, t = frame_at(patch, place)
    p = -pressure * n + traction[0] * t + traction[1] * np.cross(n, t)
    return Wrench(p, np.cross(at - base, p) + torque * n)


def numbers(touch):
    return np.array([*touch.position, touch.pressure, *touch.traction, touch.torque])


def spreads(touch):
    return np.array([*touch.position_sd, touch.pressure_sd, *touch.traction_sd, touch.torque_sd])


# Where, and what


@SKINS
@given(places, forces, st.floats(-0.05, 0.05))
def test_the_contact_and_its_force_come_back(patch, place, force, torque):
    where = (place[0] * patch.a, place[1] * patch.b)
    pressure, *traction = force

    touch = IntrinsicContact(patch, EXACT)(pressed(patch, where, pressure, traction, torque))

    assert touch.reason == ""
    scale = max(force[0], *map(abs, traction))
    np.testing.assert_allclose(touch.position, where, rtol=0, atol=1e-10 * scale / pressure)
    np.testing.assert_allclose([touch.pressure, *touch.traction], force, rtol=0, atol=1e-9 * scale)
    assert touch.torque == pytest.approx(torque, abs=1e-9 * scale)
    assert not spreads(touch).any()


@DOMED
@given(
    places,
    st.floats(0.05, 20),
    st.tuples(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7)),
    st.floats(-1e-3, 1e-3),
)
def test_the_contact_on_a_skin_that_bends_both_ways_comes_back(patch, place, force, pull, torque):
    side = np.array([patch.a, patch.b])
    where = 0.2 * side + 0.6 * np.array(place) * side
    traction = np.array(pull) * force

    touch = IntrinsicContact(patch, EXACT)(pressed(patch, where, force, traction, torque * force))

    assert touch.reason == ""
    np.testing.assert_allclose(touch.position, where, rtol=0, atol=1e-9)
    np.testing.assert_allclose([touch.pressure, *touch.traction], [force, *traction], atol=1e-5)
    assert touch.torque == pytest.approx(torque * force, abs=1e-8)


def test_a_very_shallow_cylinder_answers_like_the_plane():
    wrench = pressed(FLAT, (0.01, 0.02), 0.5, (0.1, -0.2), 1e-3)

    flat = IntrinsicContact(FLAT, NOISY)(wrench)
    nearly = IntrinsicContact(Patch(0.04, 0.03, radius=1e5), NOISY)(wrench)

    np.testing.assert_allclose(numbers(nearly), numbers(flat), rtol=0, atol=1e-7)
    np.testing.assert_allclose(spreads(nearly), spreads(flat), rtol=1e-5)


@SKINS
def test_the_place_does_not_depend_on_where_the_sensor_is(patch):
    where = (0.3 * patch.a, 0.6 * patch.b)
    found = []
    for base in ((0.0, 0.0, 0.0), (0.1, -0.2, 0.3)):
        wrench = pressed(patch, where, 0.5, (0.1, 0.2), 2e-3, base)
        found.append(numbers(IntrinsicContact(patch, ForceTorqueSensor(base, 0, 0))(wrench)))

    np.testing.assert_allclose(found[0], found[1], atol=1e-12)


# The simulated sensor


@SKINS
def test_a_point_load_is_found_where_it_presses(patch):
    load = PointLoad(0.3 * patch.a, 0.6 * patch.b, 0.2)

    wrench = EXACT.read(patch, [load], np.random.default_rng(0))
    touch = IntrinsicContact(patch, EXACT)(wrench)

    np.testing.assert_allclose(touch.position, load.centre(), atol=1e-12)
    assert touch.pressure == pytest.approx(0.2)
    np.testing.assert_allclose([*touch.traction, touch.torque], 0, atol=1e-14)


def test_a_line_load_on_the_plane_is_found_at_its_middle():
    line = LineLoad(0.01, 0.005, 0.03, 0.025, 0.4)

    touch = IntrinsicContact(FLAT, EXACT)(EXACT.read(FLAT, [line], np.random.default_rng(0)))

    np.testing.assert_allclose(touch.position, line.centre(), atol=1e-12)
    assert touch.pressure == pytest.approx(0.4)


def test_a_line_load_around_a_finger_presses_with_the_resultant_of_its_points():
    line = LineLoad(0.005, 0.004, 0.036, 0.02, 0.4)
    s = (np.arange(4000) + 0.5) / 4000
    points = [PointLoad(0.005 + 0.031 * u, 0.004 + 0.016 * u, 0.4 / 4000) for u in s]

    whole = EXACT.read(FINGER, [line], np.random.default_rng(0))
    parts = EXACT.read(FINGER, points, np.random.default_rng(0))

    np.testing.assert_allclose(whole.force, parts.force, atol=1e-7)
    np.testing.assert_allclose(whole.moment, parts.moment, atol=1e-8)
    # Less than 0.4 N: over an arc of +-h rad the points press against each other, by sin(h) / h.
    h = 0.031 / 2 / 12.9e-3
    assert np.linalg.norm(whole.force) == pytest.approx(0.4 * math.sin(h) / h, rel=1e-9)


def test_two_equal_points_are_found_between_them():
    loads = [PointLoad(0.01, 0.01, 0.1), PointLoad(0.03, 0.02, 0.1)]

    touch = IntrinsicContact(FLAT, EXACT)(EXACT.read(FLAT, loads, np.random.default_rng(0)))

    np.testing.assert_allclose(touch.position, [0.02, 0.015], atol=1e-12)


def test_the_same_seed_gives_the_same_wrench_and_its_noise_is_as_told():
    rng = np.random.default_rng(4)
    draws = [NOISY.read(FLAT, [], rng) for _ in range(4000)]
    again = NOISY.read(FLAT, [], np.random.default_rng(4))

    np.testing.assert_array_equal(draws[0].force, again.force)
    np.testing.assert_array_equal(draws[0].moment, again.moment)
    # The standard error of a standard deviation over 12,000 draws is 0.7 %.
    assert np.std([d.force for d in draws]) == pytest.approx(3e-3, rel=0.03)
    assert np.std([d.moment for d in draws]) == pytest.approx(2e-5, rel=0.03)


# Error bars


@pytest.mark.cases("traction0-finger")
@pytest.mark.slow
@SKINS
@pytest.mark.parametrize("traction", [(0.0, 0.0), (0.2, -0.3)])
def test_the_error_bars_are_those_of_many_draws(patch, traction):
    where, rng = (0.35 * patch.a, 0.4 * patch.b), np.random.default_rng(1)
    wrench = pressed(patch, where, 0.5, traction, 8e-3)
    find = IntrinsicContact(patch, NOISY)

    told = find(wrench)
    draws = np.array(
        [
            numbers(
                find(
                    Wrench(
                        wrench.force + rng.normal(0, 3e-3, 3),
                        wrench.moment + rng.normal(0, 2e-5, 3),
                    )
                )
            )
            for _ in range(4000)
        ]
    )

    # The standard error of a standard deviation over 4000 draws is 1.1 %.
    np.testing.assert_allclose(draws.std(axis=0), spreads(told), rtol=0.05)
    bias = np.abs(draws.mean(axis=0) - numbers(told)) / spreads(told)
    assert bias.max() < 0.1


@DOMED
def test_the_error_bars_on_a_skin_that_bends_both_ways_are_those_of_small_changes(patch):
    where = (0.35 * patch.a, 0.4 * patch.b)
    wrench = pressed(patch, where, 0.5, (0.2, -0.1), 1e-3)
    find = IntrinsicContact(patch, EXACT)
    steps = 1e-6 * np.eye(6)

    changes = [
        numbers(find(Wrench(wrench.force + d[:3], wrench.moment + d[3:])))
        - numbers(find(Wrench(wrench.force - d[:3], wrench.moment - d[3:])))
        for d in steps
    ]

    noise = np.repeat([3e-3, 2e-5], 3)[:, None]
    expected = np.sqrt(np.sum((np.array(changes) / 2e-6 * noise) ** 2, axis=0))
    told = spreads(IntrinsicContact(patch, NOISY)(wrench))
    # The tangents of a shallow skin along x and y are taken for orthogonal.
    np.testing.assert_allclose(told, expected, rtol=0.02 if patch.is_shallow else 1e-4)


@DOMED
def test_a_force_beside_a_domed_skin_or_none_has_no_place(patch):
    find, side = IntrinsicContact(patch, NOISY), np.array([patch.a, patch.b])
    beside = np.array([0, 0, -1.0])
    far = np.cross(np.array([*(1.5 * side), 0.0]) - BASE, beside)

    for wrench in (
        Wrench(beside, far),
        pressed(patch, 0.4 * side, -0.5),
        Wrench(np.zeros(3), np.zeros(3)),
    ):
        assert re.match("expected a normal force above|the force passes", find(wrench).reason)


@SKINS
def test_a_tenth_of_the_force_spreads_the_place_ten_times(patch):
    where, find = (0.5 * patch.a, 0.5 * patch.b), IntrinsicContact(patch, NOISY)

    hard, light = (find(pressed(patch, where, pressure)) for pressure in (1.0, 0.1))

    np.testing.assert_allclose(light.position_sd / hard.position_sd, 10, rtol=1e-6)


# What is no contact


def refused(patch, wrench, match, sensor=NOISY):
    touch = IntrinsicContact(patch, sensor)(wrench)
    assert not touch.present
    assert np.isnan(numbers(touch)).all()
    assert np.isnan(spreads(touch)).all()
    assert match in touch.reason


@SKINS
def test_noise_alone_is_never_a_contact(patch):
    rng, find = np.random.default_rng(0), IntrinsicContact(patch, NOISY)

    assert not any(find(NOISY.read(patch, [], rng)).present for _ in range(3000))


@SKINS
def test_a_force_too_small_against_its_noise_has_no_place(patch):
    refused(
        patch,
        pressed(patch, (0.02, 0.015), 0.02),
        "expected a normal force above 0.03 N, got 0.02 N",
    )


@SKINS
@pytest.mark.parametrize("sensor", [EXACT, NOISY])
def test_no_force_at_all_has_no_place_even_without_noise(patch, sensor):
    refused(patch, Wrench(np.zeros(3), np.zeros(3)), "expected a normal force above", sensor)
    refused(
        patch,
        Wrench(np.zeros(3), np.array([1.0, 0.5, 0.2])),
        "expected a normal force above",
        sensor,
    )
    tiny = np.array([0, 0, -1e-300])
    refused(patch, Wrench(tiny, np.array([1.0, 0.5, 0.2])), "expected a normal force above", sensor)


@SKINS
def test_a_pull_has_no_place(patch):
    refused(patch, pressed(patch, (0.5 * patch.a, 0.015), -0.5), "")


def test_a_pull_on_the_plane_is_told_as_one():
    refused(FLAT, pressed(FLAT, (0.02, 0.015), -0.5), "got -0.5 N")


@SKINS
def test_a_force_along_the_skin_alone_has_no_place(patch):
    along = Wrench(np.array([0.0, 1.0, 0.0]), np.array([0.01, 0.0, 0.0]))

    refused(patch, along, "expected a normal force above")


@pytest.mark.parametrize("place", [(-0.005, 0.01), (0.045, 0.01), (0.02, -0.004), (0.02, 0.034)])
@pytest.mark.parametrize("patch", [FLAT, SHALLOW], ids=["flat", "shallow"])
def test_a_force_beside_the_skin_has_no_place(patch, place):
    refused(patch, pressed(patch, place, 0.5), "passes beside the skin, through")


def test_a_force_beside_the_cylinder_has_no_place():
    passing = Wrench(np.array([0.0, 0.0, -0.5]), np.zeros(3))
    # 13 mm beside the axis of a cylinder of 12.9 mm.
    base = ForceTorqueSensor((FINGER.a / 2 + 0.013, 0.01, 0.0), 3e-3, 2e-5)

    refused(FINGER, passing, "beside the skin's cylinder", base)


def test_a_grazing_force_that_hardly_presses_has_no_place():
    where = (0.5 * FINGER.a, 0.015)

    refused(
        FINGER, pressed(FINGER, where, 0.02, (1.0, 0.0)), "expected a normal force above 0.03 N"
    )


def test_a_moment_too_noisy_for_the_force_has_no_place():
    coarse = ForceTorqueSensor(BASE, 1e-3, 5e-3)

    refused(FLAT, pressed(FLAT, (0.02, 0.015), 0.2), "determine the position only to +-25", coarse)


def test_a_contact_at_the_rim_stays_on_the_skin():
    rng, find = np.random.default_rng(0), IntrinsicContact(FLAT, NOISY)
    load = PointLoad(0.0, 0.015, 0.5)

    touches = [find(NOISY.read(FLAT, [load], rng)) for _ in range(500)]

    assert np.mean([touch.present for touch in touches]) > 0.99
    assert all(FLAT.contains(touch.position) for touch in touches if touch.present)


@pytest.mark.parametrize("number", [math.nan, math.inf])
def test_a_sensor_that_gives_no_number_has_no_contact(number):
    refused(FLAT, Wrench(np.array([0, 0, number]), np.zeros(3)), "reports NaN or infinity")
    refused(
        FLAT, Wrench(np.array([0, 0, -1.0]), np.array([0, number, 0])), "reports NaN or infinity"
    )


@pytest.mark.parametrize("force", [np.zeros(2), np.zeros((3, 1)), np.zeros(6)])
def test_a_wrench_of_another_shape_is_refused(force):
    with pytest.raises(Refusal, match=r"shape \(3,\)"):
        IntrinsicContact(FLAT, NOISY)(Wrench(force, np.zeros(3)))


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"origin": (0.0, 0.0)}, "three lengths"),
        ({"origin": (0.0, 0.0, math.nan)}, "three lengths"),
        ({"force_noise": -1.0}, r"force_noise of at least zero, got -1\.0"),
        ({"moment_noise": math.nan}, "moment_noise of at least zero, got nan"),
    ],
)
def test_an_impossible_sensor_is_refused(changes, match):
    with pytest.raises(Refusal, match=match):
        ForceTorqueSensor(**{"origin": BASE, **changes})
