"""Rolling and sliding against rigid bodies moved by themselves, and the map of a surface.

The truth moves bodies in small steps and finds where they touch anew: a finger's skin is a ball or
a plane, and the contact is the object's point that is nearest to its centre. No equation of contact
is in it.
"""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from held import assert_covers, covariance, on_sphere
from held import contact as noisy_contact
from kappaskin import Refusal
from kappaskin.hand import (
    FingerContact,
    Grasp,
    ObjectFit,
    ObjectMap,
    Placement,
    contact_motions,
    object_motion,
)

SKIN = 0.008  # m, radius of a fingertip
DT = 0.01  # s
DRAWS = 400


def turned(vector):
    return Rotation.from_rotvec(vector).as_matrix()


def moved(where, velocity, time):
    """The placement after `time` s at a velocity (6,) of the material at the origin."""
    if not (w := np.linalg.norm(velocity[3:])):
        return Placement(where.rotation, where.position + time * velocity[:3])
    steps = 200
    R, p = where.rotation, where.position
    for _ in range(steps):  # midpoint rule
        half = p + time / steps / 2 * (velocity[:3] + np.cross(velocity[3:], p))
        p = p + time / steps * (velocity[:3] + np.cross(velocity[3:], half))
    assert w
    return Placement(turned(time * velocity[3:]) @ R, p)


class Ball:
    kind = "sphere"

    def __init__(self, radius):
        self.radius = radius

    def nearest(self, where, c):
        n = c - where.position
        n = n / np.linalg.norm(n)
        return where.position + self.radius * n, n


class Rod(Ball):
    """A cylinder whose axis is its own x."""

    kind = "cylinder"

    def nearest(self, where, c):
        a = where.rotation[:, 0]
        foot = where.position + (c - where.position) @ a * a
        n = (c - foot) / np.linalg.norm(c - foot)
        return foot + self.radius * n, n


class Table(Ball):
    """A plane whose outward normal is its own z."""

    kind = "plane"

    def nearest(self, where, c):
        n = where.rotation[:, 2]
        return c - (c - where.position) @ n * n, n


def touching(name, centre, skin, object_, where):
    """The contact of a ball-shaped skin, whose frame is at its centre, with an object."""
    c = centre.position
    p, n_object = object_.nearest(where, c)
    n = -n_object  # the skin's own
    t = np.cross(n, centre.rotation[:, 1])
    t = t / np.linalg.norm(t)
    depth = SKIN - (p - c) @ n
    K = np.eye(2) / (SKIN - depth)
    frame = np.array([t, np.cross(n, t), n])
    C = np.full((8, 8), np.nan)
    C[:5, :5] = np.diag(np.repeat([1e-6, 1e-3], [3, 2]) ** 2)
    return FingerContact(
        name, p, frame, np.full(3, np.nan), C, 1.0, 0.1, centre, K * skin, depth, 1e-6
    )


def shape(object_, where):
    """The fit of the true object."""
    R = where.rotation
    if object_.kind == "plane":
        return ObjectFit("plane", where.position, R.T, 0.0, 1e-20 * np.eye(3), 0.0, 1)
    k = len({"sphere": range(4), "cylinder": range(5)}[object_.kind])
    point = where.position + object_.radius * R[:, 2]
    return ObjectFit(object_.kind, point, R.T, 1 / object_.radius, 1e-20 * np.eye(k), 0.0, 1)


def fingers(object_, where, rng, count=3):
    """Placements of the centres of skins around an object, each pressed in by 0.1 to 0.3 mm."""
    found = []
    for n in range(count):
        if object_.kind == "plane":
            away = np.array([*(0.03 * rng.uniform(-1, 1, 2)), 0.0])
            p, out = where.position + where.rotation @ away, where.rotation[:, 2]
        else:
            turn = 2 * np.pi * n / count + rng.uniform(-0.3, 0.3)
            out = where.rotation @ [0.0, np.cos(turn), np.sin(turn)]
            out = out + (0.3 * rng.normal(size=3) if object_.kind == "sphere" else 0.0)
            out = out / np.linalg.norm(out)
            p = where.position + object_.radius * out
            p = p + where.rotation[:, 0] * rng.uniform(-0.02, 0.02) * (object_.kind == "cylinder")
        c = p + (SKIN - rng.uniform(1e-4, 3e-4)) * out
        found.append(Placement(turned(rng.normal(size=3)), c))
    return found


def grasp(object_, where, centres):
    return Grasp([touching(f"f{n}", c, 1.0, object_, where) for n, c in enumerate(centres)])


OBJECTS = {"sphere": Ball(0.02), "cylinder": Rod(0.015), "plane": Table(0.0)}
UNKNOWN = {"sphere": 3, "cylinder": 2, "plane": 3}  # directions that leave the surface as it is


@pytest.mark.parametrize("kind", OBJECTS)
@pytest.mark.parametrize("seed", range(4))
def test_a_held_object_moves_as_the_rigid_body_does(kind, seed):
    rng = np.random.default_rng(seed)
    object_, where = OBJECTS[kind], Placement(turned(rng.normal(size=3)), 0.05 * rng.normal(size=3))
    centres = fingers(object_, where, rng)
    about = where.position + 0.01 * rng.normal(size=3)
    w, v = rng.normal(size=3), 0.01 * rng.normal(size=3)
    velocity = np.concatenate([v - np.cross(w, about), w])
    now, then = moved(where, velocity, -DT / 2), moved(where, velocity, DT / 2)

    found = object_motion(
        grasp(object_, now, centres), grasp(object_, then, centres), DT, shape(object_, where)
    )

    assert len(found.unknown) == UNKNOWN[kind]
    off = found.velocity - velocity  # only what is unknown may be left of it
    basis = np.linalg.qr(found.unknown.T)[0]
    rest = off - basis @ (basis.T @ off)
    assert np.abs(rest[:3]).max() < 2e-3 * np.abs(velocity[:3]).max()
    for one in found.contacts:
        c = centres[int(one.finger[1:])]
        before, after = (touching("", c, 1.0, object_, at) for at in (now, then))
        along = (after.position - before.position) / DT
        n = touching("", c, 1.0, object_, where).frame[2]
        far = np.linalg.norm(along - (along @ n) * n)
        assert np.linalg.norm(one.on_skin) == pytest.approx(far, rel=0.01, abs=1e-5)


@pytest.mark.parametrize("kind", OBJECTS)
@pytest.mark.parametrize("seed", range(4))
def test_a_finger_that_moves_over_an_object_at_rest_rolls_and_slides_as_it_does(kind, seed):
    rng = np.random.default_rng(10 + seed)
    object_, where = OBJECTS[kind], Placement(turned(rng.normal(size=3)), 0.05 * rng.normal(size=3))
    (centre,) = fingers(object_, where, rng, 1)
    w, v = 2 * rng.normal(size=3), 0.01 * rng.normal(size=3)
    velocity = np.concatenate([v - np.cross(w, centre.position), w])
    now, then = moved(centre, velocity, -DT / 2), moved(centre, velocity, DT / 2)
    before, after = grasp(object_, where, [now]), grasp(object_, where, [then])

    (found,) = contact_motions(before, after, DT, shape(object_, where))

    p, n_object = object_.nearest(where, centre.position)
    t = before.contacts[0].frame[0] + after.contacts[0].frame[0]
    t = t - (t @ n_object) * n_object
    t = t / np.linalg.norm(t)
    frame = np.array([t, np.cross(t, n_object), -n_object])
    on_object = (after.contacts[0].position - before.contacts[0].position) / DT
    speed = np.linalg.norm(velocity[:3]) + 0.01
    sliding = -(v + np.cross(w, p - centre.position))  # of the object over the finger
    np.testing.assert_allclose(found.sliding, (frame @ sliding)[:2], atol=0.01 * speed)
    np.testing.assert_allclose(found.on_object, (frame @ on_object)[:2], atol=0.01 * speed)
    np.testing.assert_allclose(found.turning, -frame @ w, atol=0.01 * np.linalg.norm(w))


def rolled(rng, slip=0.0):
    """A ball between a table at rest and one above that moves by 20 mm/s, and its true motion."""
    ball, R = Ball(0.02), 0.02
    speed = np.array([0.02, 0.0, 0.0])
    contacts = []
    for time in (-DT / 2, DT / 2):
        centre = speed * (1 - slip) / 2 * time
        each = []
        for name, side, own in (("below", -1.0, 0.0 * speed), ("above", 1.0, speed)):
            n = np.array([0.0, 0.0, -side])
            at = Placement(np.eye(3), own * time)
            C = np.full((8, 8), np.nan)
            C[:5, :5] = covariance(rng, 2e-6, 1e-2, 1.0)[:5, :5]
            frame = np.array([[1.0, 0.0, 0.0], [0.0, n[2], 0.0], n])
            place = centre + ball.radius * -n
            each.append((name, place, frame, C, at))
        contacts.append(each)
    turning = np.array([0.0, 0.5 * speed[0] / R, 0.0])
    return contacts, turning, Placement(np.eye(3), np.zeros(3))


def noisy_grasps(contacts, rng):
    for each in contacts:
        yield Grasp(
            [
                FingerContact(
                    name,
                    place + np.linalg.cholesky(C[:3, :3]) @ rng.normal(size=3),
                    frame,
                    np.full(3, np.nan),
                    C,
                    1.0,
                    0.1,
                    at,
                    np.zeros((2, 2)),
                    1e-4 + 2e-6 * rng.normal(),
                    2e-6,
                )
                for name, place, frame, C, at in each
            ]
        )


def test_a_ball_that_rolls_on_a_table_turns_within_its_error_bars():
    rng = np.random.default_rng(3)
    z = []
    for _ in range(DRAWS):
        contacts, turning, where = rolled(rng)
        below = [each[:1] for each in contacts]
        found = object_motion(*noisy_grasps(below, rng), DT, shape(Ball(0.02), where), rolls=True)
        assert len(found.unknown) == 1  # its spin
        z.append((found.velocity[3:5] - turning[:2]) / np.sqrt(np.diag(found.covariance))[3:5])
    assert_covers(z)


def test_whether_a_ball_rolls_is_doubted_as_seldom_as_said():
    rng = np.random.default_rng(3)
    chance = []
    for _ in range(DRAWS):
        contacts, turning, where = rolled(rng)
        found = object_motion(
            *noisy_grasps(contacts, rng), DT, shape(Ball(0.02), where), rolls=True
        )
        chance.append(found.chance)
        np.testing.assert_allclose(found.velocity[3:5], turning[:2], atol=1e-3)
    assert 0.02 < np.mean(np.array(chance) < 0.05) < 0.08


def test_a_ball_that_slips_is_told_from_one_that_rolls():
    rng = np.random.default_rng(4)
    contacts, _, where = rolled(rng, slip=0.5)
    grasps = list(noisy_grasps(contacts, rng))

    assert object_motion(*grasps, DT, shape(Ball(0.02), where), rolls=True).chance < 1e-6
    assert object_motion(*grasps, DT, shape(Ball(0.02), where)).chance > 1e-3


def test_the_turning_of_a_held_ball_is_unknown_unless_it_rolls():
    rng = np.random.default_rng(5)
    contacts, _, where = rolled(rng)
    found = object_motion(*noisy_grasps(contacts, rng), DT, shape(Ball(0.02), where))

    assert len(found.unknown) == 3
    for one in found.contacts:
        assert np.isinf(np.diag(one.turning_covariance)).all()
        assert np.isinf(np.diag(one.sliding_covariance)).all()
        assert np.isfinite(one.on_skin_covariance).all()


@pytest.mark.parametrize("kind", OBJECTS)
def test_velocities_of_a_held_object_are_within_their_error_bars(kind):
    rng = np.random.default_rng(6)
    object_, where = OBJECTS[kind], Placement(turned(rng.normal(size=3)), 0.05 * rng.normal(size=3))
    centres = fingers(object_, where, rng, 4)
    velocity = np.concatenate([0.01 * rng.normal(size=3), rng.normal(size=3)])
    velocity[:3] -= np.cross(velocity[3:], where.position)
    ends = [grasp(object_, moved(where, velocity, t), centres) for t in (-DT / 2, DT / 2)]
    fit = shape(object_, where)
    exact = object_motion(*ends, DT, fit)
    z, chance = [], []
    for _ in range(DRAWS):
        noisy = [Grasp([shaken(one, rng) for one in end.contacts]) for end in ends]
        found = object_motion(*noisy, DT, fit)
        known = np.linalg.svd(found.unknown)[2][len(found.unknown) :]
        spread = known @ found.covariance @ known.T
        z.append(known @ (found.velocity - exact.velocity) / np.sqrt(np.diag(spread)))
        chance.append(found.chance)
    assert_covers(z)
    assert 0.02 < np.mean(np.array(chance) < 0.05) < 0.08


def shaken(one, rng):
    """The contact with noise of its own covariance."""
    noise = 1e-6 * rng.normal(size=3)
    return replace(one, position=one.position + noise, depth=one.depth + 1e-6 * rng.normal())


def test_a_pair_of_grasps_without_a_common_finger_or_in_the_wrong_order_is_refused():
    rng = np.random.default_rng(0)
    object_, where = OBJECTS["sphere"], Placement(np.eye(3), np.zeros(3))
    one = grasp(object_, where, fingers(object_, where, rng, 2))
    with pytest.raises(Refusal, match="after the first, got 0 s"):
        object_motion(one, one, 0.0, shape(object_, where))
    with pytest.raises(Refusal, match="touches in both grasps, got none"):
        contact_motions(Grasp([]), one, 0.1, shape(object_, where))


def explored(rng, count, radius=0.02):
    """A map of a ball from `count` contacts, and the truth."""
    spots, truth = on_sphere(rng, count, radius)
    found = ObjectMap(2e-3)
    for spot in spots:
        found.add(noisy_contact(spot, rng, "index", (1e-4, 0.02, 1.0)))
    return found, truth


def test_the_points_of_a_map_lie_on_the_object_within_their_error_bars():
    found, truth = explored(np.random.default_rng(7), 3000)

    rows = found.rows
    assert len(found) == len(rows)
    assert rows["contacts"].sum() == 3000
    points = np.stack([rows["x"], rows["y"], rows["z"]], axis=-1) - truth["centre"]
    away = np.linalg.norm(points, axis=-1) - truth["radius"]
    assert_covers((away / rows["sd"])[:, None])


def test_a_map_in_the_frame_of_a_moving_object_does_not_move():
    rng = np.random.default_rng(8)
    one = noisy_contact(on_sphere(rng, 1, 0.02)[0][0], rng, "index", (1e-4, 0.02, 1.0))
    where = Placement(turned(rng.normal(size=3)), rng.normal(size=3))
    moved_too = noisy_contact_at(one, where)

    at_rest, moving = ObjectMap(), ObjectMap()
    at_rest.add(one)
    moving.add(moved_too, where)

    for name in at_rest.rows.dtype.names:
        np.testing.assert_allclose(moving.rows[name], at_rest.rows[name], atol=1e-12)


def noisy_contact_at(one, where):
    """The contact of an object that was moved by `where`."""
    whole = np.eye(8)
    whole[:3, :3] = where.rotation
    return replace(
        one,
        position=where.rotation @ one.position + where.position,
        frame=one.frame @ where.rotation.T,
        covariance=whole @ np.nan_to_num(one.covariance) @ whole.T,
    )


def test_a_map_is_kept_as_a_ply_file_that_others_read(tmp_path):
    found, _ = explored(np.random.default_rng(9), 200)
    found.save(tmp_path / "object.ply")

    again = ObjectMap.load(tmp_path / "object.ply")
    assert again.to_ply() == found.to_ply()
    assert again.cell == found.cell
    cloud = trimesh.load(tmp_path / "object.ply")
    rows = found.rows
    np.testing.assert_array_equal(
        cloud.vertices, np.stack([rows["x"], rows["y"], rows["z"]], axis=-1)
    )


@pytest.mark.parametrize("content", [b"", b"ply\nformat ascii 1.0\nend_header\n", None])
def test_another_file_is_no_map(tmp_path, content):
    found, _ = explored(np.random.default_rng(9), 5)
    (tmp_path / "object.ply").write_bytes(found.to_ply()[:-1] if content is None else content)
    with pytest.raises(Refusal, match="the surface of an object that kappaskin has written"):
        ObjectMap.load(tmp_path / "object.ply")


@pytest.mark.parametrize("cell", [0.0, -1.0, np.nan, np.inf])
def test_a_cell_without_a_size_is_refused(cell):
    with pytest.raises(Refusal, match="a cell with a side above zero"):
        ObjectMap(cell)
