"""Held objects, from contacts with analytic ones and noise of known covariances."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from held import (
    Spot,
    assert_covers,
    contact,
    contacts,
    on_box,
    on_cylinder,
    on_edge,
    on_ellipsoid,
    on_plane,
    on_sphere,
)
from kappaskin.hand import HELD, find_held_object, fit_object

NOISE = 1e-4, 0.02, 5.0  # m, rad, 1/m
DRAWS = 600


def turns(frame, direction):
    """By what small rotations about the first two rows the third of `frame` is `direction`."""
    a, b, u = frame
    return -(direction @ b) / (direction @ u), (direction @ a) / (direction @ u)


def of_plane(fit, truth):
    n = truth["normal"]
    off = (truth["at"] - fit.point) @ n / (fit.normal @ n)
    return np.array([*turns(fit.frame, n), off]) / np.sqrt(np.diag(fit.covariance))


def of_sphere(fit, truth):
    off = (fit.centre - truth["centre"]) / np.sqrt(np.diag(fit.centre_covariance))
    low, high = fit.radius_95
    # Of the radius the interval alone: 1 where it holds the truth.
    within = 0.0 if low <= truth["radius"] <= high else 9.0
    bent = (fit.curvature - 1 / truth["radius"]) / fit.curvature_sd
    assert (within == 0.0) == (abs(bent) <= 1.959964)
    return np.array([*off, bent])


def of_cylinder(fit, truth):
    a, b, u = fit.frame
    axis = truth["axis"] * np.sign(truth["axis"] @ a)
    sd = np.sqrt(np.diag(fit.covariance))
    off = truth["at"] - fit.centre
    off = off - (off @ a) / (axis @ a) * axis  # of the axes, across
    C = fit.centre_covariance
    return np.array(
        [
            -(axis @ u) / (axis @ a) / sd[1],
            (axis @ b) / (axis @ a) / sd[4],
            (fit.curvature - 1 / truth["radius"]) / sd[3],
            (off @ b) / np.sqrt(b @ C @ b),
            (off @ u) / np.sqrt(u @ C @ u),
        ]
    )


def of_edge(fit, truth):
    a, b, u = fit.frame
    axis = truth["axis"] * np.sign(truth["axis"] @ a)
    off = truth["at"] - fit.point
    off = off - (off @ a) / (axis @ a) * axis
    found = [off @ b, off @ u, -(axis @ u) / (axis @ a), (axis @ b) / (axis @ a)]
    return np.array(found) / np.sqrt(np.diag(fit.covariance))


CASES = {
    "plane": ("plane", lambda rng: on_plane(rng, 4), of_plane),
    "sphere": ("sphere", lambda rng: on_sphere(rng, 4, 0.02), of_sphere),
    "large sphere": ("sphere", lambda rng: on_sphere(rng, 5, 1.0, 0.05), of_sphere),
    "cylinder": ("cylinder", lambda rng: on_cylinder(rng, 5, 0.015), of_cylinder),
    "edge": ("edge", lambda rng: on_edge(rng, 4), of_edge),
}


@pytest.mark.truth
@pytest.mark.parametrize("curved", [False, pytest.param(True, marks=pytest.mark.full)])
@pytest.mark.parametrize("case", CASES)
def test_intervals_hold_the_truth_as_often_as_they_say(case, curved):
    kind, made, errors = CASES[case]
    rng = np.random.default_rng(1)
    z, chance = [], []
    for _ in range(DRAWS):
        spots, truth = made(rng)
        fit = fit_object(kind, contacts(spots, rng, NOISE, curved))
        if case == "large sphere":  # its centre is far; the first order is not for it
            z.append([(fit.curvature - 1 / truth["radius"]) / fit.curvature_sd])
        else:
            z.append(errors(fit, truth))
        chance.append(fit.chance)
    assert_covers(z)
    assert 0.025 < np.mean(np.array(chance) < 0.05) < 0.075


@pytest.mark.truth
@pytest.mark.parametrize(
    ("kind", "made"),
    [
        ("plane", lambda rng: on_plane(rng, 6)),
        ("sphere", lambda rng: on_sphere(rng, 5, 0.02)),
        ("cylinder", lambda rng: on_cylinder(rng, 6, 0.015)),
        ("edge", lambda rng: on_edge(rng, 5)),
    ],
)
def test_a_kind_is_named_right_or_not_at_all(kind, made):
    rng = np.random.default_rng(2)
    named, none = Counter(), 0
    for _ in range(40):
        found = find_held_object(contacts(made(rng)[0], rng, NOISE))
        named[found.kind] += 1
        none += found.is_none
    assert none <= 2  # of 0.4 by chance
    assert named[kind] + named[""] >= 39
    assert named[kind] >= 24


@pytest.mark.parametrize(
    "made",
    [
        lambda rng: on_ellipsoid(rng, 5, (0.02, 0.03, 0.045)),
        lambda rng: on_box(rng, 4, (0.02, 0.03, 0.045)),
    ],
)
def test_another_object_is_none_of_the_kinds(made):
    rng = np.random.default_rng(3)
    for _ in range(5):
        found = find_held_object(contacts(made(rng)[0], rng, NOISE))
        assert found.is_none
        assert found.kind == ""
        assert found.describe() == "not one of plane, sphere, cylinder, edge"


def test_one_contact_is_too_few():
    rng = np.random.default_rng(4)
    found = find_held_object(contacts(on_sphere(rng, 1, 0.02)[0], rng, NOISE))
    assert found.describe() == "expected two contacts or more, got 1"
    assert (found.kind, found.is_none) == ("", False)


def opposite(radius):
    n = np.array([1.0, 0.0, 0.0])
    return [Spot(s * radius * n, s * n, np.zeros((3, 3))) for s in (1.0, -1.0)]


def test_two_opposite_contacts_leave_a_ball_and_a_cylinder_of_any_axis():
    rng = np.random.default_rng(5)
    found = find_held_object(contacts(opposite(0.02), rng, NOISE))

    assert found.kind == ""
    assert {one.kind for one in found.possible} >= {"sphere", "cylinder"}
    assert found.fits["sphere"].radius == pytest.approx(0.02, rel=0.02)
    assert found.fits["cylinder"].radius == pytest.approx(0.02, rel=0.02)
    assert found.fits["cylinder"].axis_sd > 0.3  # rad
    text = found.describe()
    assert text.startswith("not determined: ")
    assert "sphere of radius 2" in text
    assert " or cylinder of radius 2" in text


def test_contacts_around_a_great_circle_do_not_tell_a_ball_from_a_rod():
    rng = np.random.default_rng(6)
    spots = []
    for turn in (0.0, 2.0, 4.2):
        n = np.array([np.cos(turn), np.sin(turn), 0.0])
        spots.append(Spot(0.02 * n, n, np.zeros((3, 3))))
    found = find_held_object(contacts(spots, rng, NOISE))

    assert found.kind == ""
    assert {one.kind for one in found.possible} == {"sphere", "cylinder"}


def test_an_object_that_is_touched_from_inside_has_a_negative_radius():
    rng = np.random.default_rng(7)
    spots, _ = on_sphere(rng, 5, 0.03)
    inside = [Spot(spot.point, -spot.normal, -spot.curvature) for spot in spots]
    found = find_held_object(contacts(inside, rng, NOISE))

    assert found.kind == "sphere"
    low, high = found.fits["sphere"].radius_95
    assert low < -0.03 < high < 0


@pytest.mark.parametrize("kind", HELD)
def test_a_fit_does_not_depend_on_the_frame_of_the_hand(kind):
    rng = np.random.default_rng(8)
    made = {"plane": on_plane, "sphere": lambda r, n: on_sphere(r, n, 0.02)}
    made |= {"cylinder": lambda r, n: on_cylinder(r, n, 0.02), "edge": on_edge}
    given = contacts(made[kind](rng, 5)[0], rng, NOISE)
    R, shift = Rotation.random(random_state=1).as_matrix(), np.array([0.3, -0.2, 0.5])
    whole = np.eye(8)
    whole[:3, :3] = R
    moved = []
    for one in given:
        C = np.full((8, 8), np.nan)
        C[:5, :5] = (whole @ np.nan_to_num(one.covariance) @ whole.T)[:5, :5]
        moved.append(
            replace(one, position=R @ one.position + shift, frame=one.frame @ R.T, covariance=C)
        )

    here, there = fit_object(kind, given), fit_object(kind, moved)

    assert there.chi_squared == pytest.approx(here.chi_squared, rel=1e-3)
    assert there.curvature == pytest.approx(here.curvature, rel=1e-3)
    assert there.curvature_sd == pytest.approx(here.curvature_sd, rel=1e-2)


def test_exact_contacts_make_an_exact_ball():
    rng = np.random.default_rng(9)
    spots, truth = on_sphere(rng, 4, 0.02)
    exact = [
        replace(one, covariance=0 * one.covariance)  # NaN of curvatures
        for one in (contact(spot, rng, "index", NOISE, noise=0.0) for spot in spots)
    ]
    found = find_held_object(exact)
    assert found.kind == "sphere"
    np.testing.assert_allclose(found.fits["sphere"].centre, truth["centre"], atol=1e-8)


def test_a_plane_says_how_flat_another_object_would_be():
    rng = np.random.default_rng(10)
    found = find_held_object(contacts(on_plane(rng, 6)[0], rng, (1e-5, 1e-3, 1.0)))
    assert found.kind == "plane"
    assert "plane, or a sphere of radius above " in found.describe()
