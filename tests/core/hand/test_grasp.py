"""Contacts in the hand's frame, and the sum of their forces and moments."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from held import assert_covers, contacts, on_sphere
from kappaskin import (
    DiscLoad,
    Pipeline,
    Refusal,
    Simulator,
    Stimulus,
    load_scene,
)
from kappaskin.hand import Finger, Grasp, find_held_object, finger_contact, placement
from kappaskin.mechanics import Block, Cylinder, Sphere
from kappaskin.pipeline import usual_setup
from kappaskin.scenes import Indenter

UNSURE = Finger("index", "sim:", (0.0, 0.0, 0.0), position_sd=1e-4, rotation_sd=2e-3)
DEPTH = 1.8e-4  # m, of some 0.5 N
FINGER = Finger("index", "sim:", (0.0, 0.0, 0.0))


@cache
def skin():
    # With the functions that the scene itself has, its loads are 20 um off.
    scene = replace(load_scene("fingertip-cap"), reference=(20, 51))
    sensor = scene.sensor()
    return scene, Pipeline(sensor, usual_setup(sensor)), Simulator(scene)


def estimated(*stimuli, seed=0):
    scene, pipeline, simulator = skin()
    simulator.change(replace(scene, stimuli=stimuli, seed=seed))
    return pipeline(simulator.frame(0, lambda: 0.0)), pipeline.fitted


def test_a_contact_moves_with_its_finger():
    estimate, fit = estimated(Stimulus(DiscLoad(0.0105, 0.0125, 0.0025, 0.1)))
    here = finger_contact(FINGER, placement((0, 0, 0), (0, 0, 0)), estimate, fit)
    where = placement((0.1, -0.2, 0.3), (0.4, 0.5, 0.6))
    there = finger_contact(FINGER, where, estimate, fit)

    R = Rotation.from_euler("xyz", (0.4, 0.5, 0.6)).as_matrix()
    np.testing.assert_allclose(there.position, R @ here.position + where.position, atol=1e-15)
    np.testing.assert_allclose(there.normal, R @ here.normal, atol=1e-15)
    np.testing.assert_allclose(
        there.covariance[:3, :3], R @ here.covariance[:3, :3] @ R.T, atol=1e-20
    )
    np.testing.assert_allclose(there.covariance[3:5, 3:5], here.covariance[3:5, 3:5], atol=1e-15)
    np.testing.assert_allclose(there.on_skin, here.position, atol=1e-15)
    assert (here.force, here.force_sd) == (estimate.contact.force, estimate.contact.force_sd)


def test_a_contact_lies_on_the_cap_as_deep_as_it_is():
    estimate, fit = estimated(Stimulus(DiscLoad(0.0105, 0.0125, 0.0025, 0.1)))
    here = finger_contact(FINGER, placement((0, 0, 0), (0, 0, 0)), estimate, fit)

    cap = skin()[0].plate.patch
    middle = np.array([cap.rim_radius, cap.rim_radius, -cap.radius])
    away = np.linalg.norm(here.position - middle)
    assert away == pytest.approx(cap.radius - estimate.contact.displacement, abs=1e-9)
    rest = 1 / cap.radius
    moved = rest / (1 - rest * here.depth)  # a sphere that is smaller by the depth
    np.testing.assert_allclose(here.skin_curvature, moved * np.eye(2), rtol=1e-9, atol=1e-9)
    along = here.normal @ here.covariance[:3, :3] @ here.normal
    assert along >= (0.99 * estimate.contact.displacement_sd) ** 2


def test_where_a_finger_is_uncertain_so_is_its_contact():
    estimate, fit = estimated(Stimulus(DiscLoad(0.0105, 0.0125, 0.0025, 0.1)))
    where = placement((0.1, -0.2, 0.3), (0.4, 0.5, 0.6))
    sure = finger_contact(FINGER, where, estimate, fit)
    unsure = replace(FINGER, position_sd=1e-4, rotation_sd=3e-3)
    found = finger_contact(unsure, where, estimate, fit)
    more = (found.covariance - sure.covariance)[:5, :5]

    rng, drawn = np.random.default_rng(0), []
    for _ in range(20_000):
        turn = Rotation.from_rotvec(3e-3 * rng.normal(size=3)).as_matrix()
        shift = 1e-4 * rng.normal(size=3)
        position = turn @ (sure.position - where.position) + shift
        drawn.append([*position, *(sure.frame[:2] @ turn @ sure.normal)])
    np.testing.assert_allclose(more, np.cov(np.array(drawn).T), rtol=0.1, atol=3e-8)


def test_the_curvature_of_an_object_is_told_by_a_skin_that_conforms_alone():
    estimate, fit = estimated(Stimulus(DiscLoad(0.0105, 0.0125, 0.0025, 0.1)))
    where = placement((0, 0, 0), (0, 0, 0))
    assert np.isnan(finger_contact(FINGER, where, estimate, fit).curvature).all()
    found = finger_contact(replace(FINGER, conforms=True), where, estimate, fit)
    K = estimate.geometry.curvature_form
    np.testing.assert_allclose(found.curvature, (-K[0, 0], -K[1, 1], -K[0, 1]))
    np.testing.assert_allclose(found.covariance[5:, 5:], estimate.geometry.covariance)


def test_without_a_contact_there_is_none():
    estimate, fit = estimated()
    assert finger_contact(FINGER, placement((0, 0, 0), (0, 0, 0)), estimate, fit) is None


def test_forces_and_moments_add_up_within_their_error_bars():
    rng = np.random.default_rng(1)
    z = []
    for _ in range(1500):
        spots, _ = on_sphere(rng, 3, 0.02)
        forces = rng.uniform(0.5, 2, 3)
        given = contacts(spots, rng, (5e-4, 0.05, 1.0))
        given = [
            replace(one, force=force + 0.1 * rng.normal(), force_sd=0.1)
            for one, force in zip(given, forces, strict=True)
        ]
        grasp = Grasp(given)
        each = [-f * spot.normal for f, spot in zip(forces, spots, strict=True)]
        moments = [np.cross(spot.point, f) for f, spot in zip(each, spots, strict=True)]
        off = np.concatenate([grasp.force - sum(each), grasp.moment - sum(moments)])
        z.append(off / np.sqrt(np.diag(grasp.covariance)))
    assert_covers(z)


def test_an_unknown_force_leaves_the_sum_unknown():
    rng = np.random.default_rng(2)
    given = contacts(on_sphere(rng, 2, 0.02)[0], rng, (1e-4, 0.02, 1.0))
    grasp = Grasp([given[0], replace(given[1], force=np.nan, force_sd=np.nan)])
    assert np.isnan(grasp.force).all()
    assert np.isnan(grasp.covariance).all()
    with pytest.raises(Refusal, match="one contact of each finger"):
        Grasp([given[0], given[0]])


# The object is a ball, a rod or a table with its middle or its surface at the origin, touched by
# three fingertips; each presses it where their common normal is, as the contact solver of the
# simulation has it, with any depth. The truth of the object is where it is put.
def pressed_by_three(rng, what):
    grasp, cap = [], skin()[0].plate.patch
    for n in range(3):
        turn = 2 * np.pi * n / 3 + rng.uniform(-0.4, 0.4)
        out, p = np.array([0.0, np.cos(turn), np.sin(turn)]), np.zeros(3)
        rigid, along = Sphere(0.02), 0.0
        if what == "sphere":
            out = out + 0.3 * rng.normal(size=3)
            out /= np.linalg.norm(out)
            p = 0.02 * out
        elif what == "cylinder":
            rigid, along = Cylinder(0.015, 0.05), rng.uniform(-0.03, 0.03)
            p = 0.015 * out + (along, 0, 0)
        else:
            rigid, out = Block(0.04, 0.04), np.array([0.0, 0.0, 1.0])
            p = np.array([*rng.uniform(-0.03, 0.03, 2), 0.0])
        # Where on the skin, and how the object lies there: turned so that its axis is along x.
        far, way = rng.uniform(0, 0.003), rng.uniform(0, 2 * np.pi)
        place = cap.rim_radius + far * np.array([np.cos(way), np.sin(way)])
        turned = rng.uniform(-1, 1)
        stimulus = Stimulus(Indenter(rigid, *place.tolist(), depth=DEPTH, turn=turned))
        estimate, fit = estimated(stimulus, seed=int(rng.integers(2**31)))
        base = cap.base(*place.tolist())
        E = np.array([base.along, base.across])
        axis = np.cos(turned) * E[0] + np.sin(turned) * E[1]
        inner = np.array([axis, np.cross(base.normal, axis), base.normal])
        outer = np.array([(1.0, 0.0, 0.0), np.cross(-out, (1.0, 0.0, 0.0)), -out])
        outer[0] = np.cross(outer[1] / np.linalg.norm(outer[1]), outer[2])
        outer[1] = np.cross(outer[2], outer[0])
        R = outer.T @ inner
        tip = np.array(base.point) - DEPTH * np.array(base.normal)
        where = placement((0, 0, 0), (0, 0, 0))._replace(rotation=R, position=p - R @ tip)
        # The hand's description has it with the errors that it admits.
        turn = Rotation.from_rotvec(UNSURE.rotation_sd * rng.normal(size=3)).as_matrix()
        shift = UNSURE.position_sd * rng.normal(size=3)
        said = where._replace(rotation=turn @ where.rotation, position=where.position + shift)
        finger = replace(UNSURE, name=f"f{n}")
        grasp.append(finger_contact(finger, said, estimate, fit))
    return grasp


@pytest.mark.slow
@pytest.mark.parametrize("what", ["sphere", "cylinder", "plane"])
def test_what_three_simulated_fingertips_hold_is_found(what):
    rng, radius, none = np.random.default_rng(3), {"sphere": 0.02, "cylinder": 0.015}, 0
    within, off = [], []
    for _ in range(20):
        found = find_held_object(pressed_by_three(rng, what))
        none += found.is_none
        fit = found.fits[what]
        assert not fit.chance < 1e-4
        assert found.kind in (what, "")
        if what == "plane":
            sd = np.sqrt(np.diag(fit.covariance))
            off.append(fit.point @ fit.normal)
            within.append(abs(off[-1]) < 1.96 * sd[2])
        else:
            low, high = fit.radius_95
            off.append(fit.radius - radius[what])
            within.append(low < radius[what] < high)
    assert none == 0
    assert np.mean(within) >= 0.9
    assert abs(np.mean(off)) < 1.5e-4  # m
