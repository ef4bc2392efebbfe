"""A simulated hand: its balance, its course, and what the pipeline tells of what it holds."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog, minimize
from scipy.spatial.transform import Rotation

from kappaskin import Pipeline, Refusal, Simulator, load_scene
from kappaskin.hand import (
    HANDS,
    Grasp,
    HandCourse,
    Keyframe,
    ObjectMap,
    Placement,
    SimulatedHand,
    SimulatedObject,
    find_held_object,
    finger_contact,
    hand_file,
    load_hand,
    object_motion,
    placement,
)
from kappaskin.hand.simulated_hand import balanced_forces
from kappaskin.mechanics import Cylinder, IndentationSolver, Sphere
from kappaskin.pipeline import usual_setup
from kappaskin.sources import SimulatedSource, VirtualClock, open_source

G = 9.80665
BALL = SimulatedObject("ball", radius=0.04, mass=0.05, friction=0.5)
ROD = SimulatedObject("cylinder", radius=0.03, length=0.1, mass=0.03, friction=0.7)
BOX = SimulatedObject("box", sides=(0.06, 0.05, 0.08), mass=0.04, friction=0.9)
UPRIGHT = placement((0, 0, 0), (0, -np.pi / 2, 0)).rotation
SIMULATED = ("hold", "roll-between-fingers", "explore")


@cache
def skins():
    """The three skins that face the middle, their poles on a circle of 40 mm radius."""
    hand, scene = load_hand(hand_file("three-fingertips")), load_scene("fingertip-cap")
    return {name: (where, scene) for name, where in hand.placements().items()}


def hand(what=BALL, course=None):
    return SimulatedHand(skins(), what, course)


# The balance


@pytest.mark.parametrize("friction", [0.3, 0.5, 1.0])
def test_three_symmetric_fingers_hold_a_ball_from_a_third_of_its_weight_over_friction_on(friction):
    scene, around = load_scene("fingertip-cap"), {}
    for n in range(3):
        R = Rotation.from_euler("z", 2 * n * np.pi / 3) * Rotation.from_euler("y", -np.pi / 2)
        pole = R.apply([0, 0, -0.04])
        pole_in_frame = R.apply([scene.plate.patch.rim_radius] * 2 + [0])
        around[f"f{n}"] = Placement(R.as_matrix(), pole - pole_in_frame), scene
    held = SimulatedHand(around, replace(BALL, friction=friction))
    least = BALL.mass * G / (3 * friction)

    assert held.move((0, 0, 0), (0, 0, 0), 0.999 * least).slips
    state = held.move((0, 0, 0), (0, 0, 0), 1.001 * least)
    assert not state.slips
    for press in state.presses.values():
        assert press.force == pytest.approx(1.001 * least, rel=1e-4)
        np.testing.assert_allclose(press.friction, (0, 0, BALL.mass * G / 3), atol=2e-4)
    for press in held.move((0, 0, 0), (0, 0, 0), 2 * least).presses.values():
        assert press.margin == pytest.approx(0.5, abs=1e-3)


def imbalance(state, what):
    """Sums of forces and of moments about the object's middle, from what each finger does."""
    force, moment = np.array([0, 0, -what.mass * G]), np.zeros(3)
    for press in state.presses.values():
        if press.force:
            each = press.force * press.normal + press.friction
            force, moment = force + each, moment + np.cross(press.point - state.pose.position, each)
    return force, moment


@pytest.mark.parametrize("what", [BALL, ROD, BOX])
def test_forces_and_moments_balance_within_the_cones_of_friction(what):
    rng, held, balanced = np.random.default_rng(0), hand(what), 0
    for _ in range(60):
        position, rotation = rng.uniform(-3e-3, 3e-3, 3), (0, 0, rng.uniform(-0.3, 0.3))
        state = held.move(position, rotation, grip := rng.uniform(0.1, 0.6))
        presses = state.presses.values()
        assert np.mean([press.force for press in presses]) == pytest.approx(grip, rel=1e-3)
        for press in presses:
            assert abs(press.friction @ press.normal) < 1e-6
            size = np.linalg.norm(press.friction)
            assert size <= what.friction * press.force * (1 + 1e-6)
            assert press.margin == pytest.approx(1 - size / (what.friction * press.force), abs=1e-6)
        force, moment = imbalance(state, what)
        np.testing.assert_allclose(state.imbalance, [*force, *moment], atol=1e-9)
        if not state.slips:
            balanced += 1
            scale = what.mass * G + 3 * grip
            assert np.abs(force).max() < 2e-4 * scale
            assert np.abs(moment).max() < 2e-4 * scale * 0.05
    assert balanced > 10


# Cones of 64 facets, inside and around the round ones: linear programs, by another's solver.
@pytest.mark.parametrize("what", [BALL, ROD, BOX])
def test_it_slips_where_a_linear_program_finds_no_balance(what):
    rng, held, answers = np.random.default_rng(1), hand(what), []
    for _ in range(60):
        position, rotation = rng.uniform(-4e-3, 4e-3, 3), (0, 0, rng.uniform(-0.3, 0.3))
        state = held.move(position, rotation, grip := rng.uniform(0.05, 0.5))
        if any(press.force == 0 for press in state.presses.values()):
            continue
        around = 1 / np.cos(np.pi / 64)
        inside, outside = (
            feasible(state, what, grip, wider * what.friction) for wider in (1.0, around)
        )
        if inside == outside:  # or it is too near to say
            assert state.slips != inside
            answers.append(inside)
    assert {*answers} == {True, False}
    assert len(answers) > 40


def feasible(state, what, grip, friction):
    columns = []
    for press in state.presses.values():
        t = np.linalg.svd(press.normal[None])[2][1:]
        for angle in np.linspace(0, 2 * np.pi, 64, endpoint=False):
            edge = press.normal + friction * (np.cos(angle) * t[0] + np.sin(angle) * t[1])
            moment = np.cross(press.point - state.pose.position, edge)
            columns.append([*edge, *(moment / 0.04), 1.0])
    wanted = [0, 0, what.mass * G, 0, 0, 0, 3 * grip]
    found = linprog(np.zeros(len(columns)), A_eq=np.array(columns).T, b_eq=wanted)
    return found.status == 0


@pytest.mark.parametrize("friction", [0.28, 0.32])  # so small that cones bound the answer
def test_forces_are_those_of_least_energy(friction):
    rng, tight = np.random.default_rng(2), 0
    for _ in range(40):
        turns = 2 * np.pi * np.arange(3) / 3 + rng.uniform(-0.3, 0.3, 3)
        out = np.array([np.cos(turns), np.sin(turns), rng.uniform(-0.2, 0.2, 3)]).T
        out /= np.linalg.norm(out, axis=1)[:, None]
        arms, normals, weight, grip = 0.03 * out, -out, 0.2, 0.3
        found, _, holds = balanced_forces(arms, normals, weight, friction, grip)
        free = balanced_forces(arms, normals, weight, 100.0, grip)[0]
        if not holds or np.allclose(free, found, atol=1e-4):
            continue
        tight += 1

        def energy(f, normals=normals):
            return np.sum((f.reshape(3, 3) - 0.3 * normals) ** 2)

        def balance(f, arms=arms, normals=normals):
            each = f.reshape(3, 3)
            moment = np.cross(arms, each).sum(axis=0) / 0.03
            grips = np.vecdot(each, normals).sum() - 0.9
            return [*(each.sum(axis=0) - (0, 0, 0.2)), *moment, grips]

        def inside(f, normals=normals):
            along = np.vecdot(f.reshape(3, 3), normals)
            slanted = f.reshape(3, 3) - along[:, None] * normals
            return friction * along - np.sqrt(np.sum(slanted**2, axis=1) + 1e-14)

        rules = [{"type": "eq", "fun": balance}, {"type": "ineq", "fun": inside}]
        best = minimize(energy, found.ravel(), constraints=rules, options={"ftol": 1e-12})
        assert best.success
        np.testing.assert_allclose(found.ravel(), best.x, atol=2e-4 * grip)
    assert tight > 2


# The contacts


@pytest.mark.parametrize("what", [BALL, ROD, BOX])
def test_a_finger_touches_the_object_as_deep_as_it_presses(what):
    rng, held = np.random.default_rng(3), hand(what)
    cap = load_scene("fingertip-cap").plate.patch
    for _ in range(30):
        position = rng.uniform(-3e-3, 3e-3, 3)
        R = Rotation.from_euler("xyz", rng.uniform(-0.3, 0.3, 3)).as_matrix()
        R = R @ UPRIGHT if what is ROD else R
        for press in held.move(position, R, 0.4).presses.values():
            if not press.force:
                continue
            own, out = (press.point - position) @ R, -press.normal @ R
            assert_on(what, own, out)
            middle = np.array([cap.rim_radius, cap.rim_radius, -cap.radius])
            centre = press.where.rotation @ middle + press.where.position
            np.testing.assert_allclose(
                press.point, centre + (cap.radius - press.depth) * press.normal, atol=1e-8
            )
            base = cap.base(*press.place.tolist())
            np.testing.assert_allclose(press.where.rotation @ base.normal, press.normal, atol=1e-9)


def assert_on(what, point, out):
    """Whether a point of the object's own frame lies on it, with the outward normal `out`."""
    if what.shape == "ball":
        np.testing.assert_allclose(point, 0.04 * out, atol=1e-9)
    elif what.shape == "cylinder":
        np.testing.assert_allclose(np.hypot(*point[1:]), 0.03, atol=1e-9)
        np.testing.assert_allclose(out, [0, *point[1:] / 0.03], atol=1e-7)
    else:
        half = np.array([0.03, 0.025, 0.04])
        assert (np.abs(point) < half + 1e-9).all()
        assert np.isclose(np.abs(point), half, atol=1e-9).any()


def test_fingers_move_along_their_ways_alone():
    state = hand().move((1e-3, -2e-3, 3e-3), (0, 0, 0), 0.4)
    for name, (was, _) in skins().items():
        moved = state.presses[name].where.position - was.position
        np.testing.assert_allclose(np.cross(moved, was.rotation[:, 2]), 0, atol=1e-12)
        assert np.array_equal(state.presses[name].where.rotation, was.rotation)


@pytest.mark.parametrize("grip", [0.13, 0.42, 1.3])
@pytest.mark.parametrize(("what", "rigid"), [(BALL, Sphere(0.04)), (ROD, Cylinder(0.03, 0.1))])
def test_a_finger_presses_as_deep_as_mechanics_has_it(what, rigid, grip):
    held = hand(replace(what, held=False))
    state = held.move((0, 0, 0), (0, -np.pi / 2, 0), grip)
    scene = held.skins["thumb"][1]
    press, c = IndentationSolver(scene.plate, scene.basis), scene.plate.patch.rim_radius

    for one in state.presses.values():
        exact = press(rigid, c, c, force=one.force)
        assert one.depth == pytest.approx(exact.depth, rel=0.02)


def test_a_skin_reads_as_under_the_object_itself():
    held = hand(replace(BALL, held=False))
    for grip in (0.15, 0.4, 0.8):
        state = held.move((0, 0, 2e-3), (0, 0, 0), grip)
        scene = held.scenes(state)["thumb"]
        press = IndentationSolver(scene.plate, scene.basis)
        exact = press(Sphere(0.04), *state.presses["thumb"].place, force=grip)
        M = scene.layout.operator(scene.basis, scene.plate)
        true = M @ exact.coefficients.ravel()
        read = M @ Simulator(scene).frame(0, lambda: 0.0).truth.coefficients.ravel()
        assert np.abs(read - true).max() < 0.03 * np.abs(true).max()


def test_fingers_can_be_moved_from_where_the_hand_has_them():
    held = hand(replace(BALL, held=False))
    before = held.move((0, 0, 0), (0, 0, 0), 0.3)
    after = held.move((0, 0, 1e-3), (0, 0, 0), 0.3, dict.fromkeys(skins(), (0, 0, 0.001)))
    for name, press in after.presses.items():
        was = before.presses[name]
        np.testing.assert_allclose(
            press.where.position, was.where.position + np.array([0, 0, 1e-3])
        )
        np.testing.assert_allclose(press.place, was.place, atol=1e-12)


def test_roll_pitch_and_yaw_are_taken_as_well_as_a_matrix():
    turn = (0.1, 0.2, 0.3)
    one = hand(BOX).move((0, 0, 0), turn, 0.4)
    other = hand(BOX).move((0, 0, 0), placement((0, 0, 0), turn).rotation, 0.4)
    for name, press in one.presses.items():
        np.testing.assert_array_equal(press.point, other.presses[name].point)


def test_a_finger_that_passes_by_does_not_press():
    bare = SimulatedObject("ball", radius=0.01, held=False)
    state = hand(bare).move((-0.025, 0, 0), (0, 0, 0), 0.3)
    assert state.presses["thumb"].force == pytest.approx(0.3)
    assert state.presses["index"].force == 0
    assert np.isnan(state.presses["index"].place).all()
    scenes = hand(bare).scenes(state)
    assert [len(one.stimuli) for one in scenes.values()] == [1, 0, 0]


# The course


def test_a_course_is_smooth_from_keyframe_to_keyframe_and_begins_anew():
    a = Keyframe(0.0, (0, 0, 0), grip=0.3)
    b = Keyframe(2.0, (0, 0, 0.004), (0, 0, 1.0), 0.5, {"thumb": (0, 0.002, 0)})
    course = HandCourse((a, b, replace(a, time=4.0)))

    pose, grip, fingers = course.at(1.0)  # half of the way, by symmetry
    np.testing.assert_allclose(pose.position, (0, 0, 0.002))
    half = Rotation.from_euler("z", 0.5).as_matrix()
    np.testing.assert_allclose(pose.rotation, half, atol=1e-12)
    assert grip == pytest.approx(0.4)
    np.testing.assert_allclose(fingers["thumb"], (0, 0.001, 0))
    np.testing.assert_array_equal(course.at(5.0)[0].position, pose.position)
    slow, fast = (course.at(t + 1e-3)[1] - course.at(t)[1] for t in (0.0, 1.0))
    assert abs(slow) < 1e-3 * fast


@pytest.mark.parametrize("name", SIMULATED)
def test_the_scenes_of_a_ready_hand_follow_its_course(name):
    held = load_hand(hand_file(name)).simulated
    rng = np.random.default_rng(4)
    for time in rng.uniform(0, held.course.duration, 20):
        state = held.at(time)
        assert not state.slips
        for finger, scene in held.course_scenes.items():
            press, (load,) = state.presses[finger], (*scene.loads_at(time), None)[:1]
            if press.force < 2e-3:
                assert load is None or load.force < 4e-3
                continue
            np.testing.assert_allclose(load.centre(), press.place, atol=5e-6)
            assert load.force == pytest.approx(press.force, abs=2e-3)


def test_ready_hands_have_titles_and_fingers_of_their_own():
    assert set(SIMULATED) < set(HANDS)
    seeds = set()
    for name in SIMULATED:
        found = load_hand(hand_file(name))
        assert found.title
        assert found.text.strip().endswith(".")
        assert [one.source for one in found.fingers] == [
            f"hand:{name}#{finger}" for finger in ("thumb", "index", "middle")
        ]
        seeds = {scene.seed for scene in found.simulated.course_scenes.values()}
        assert len(seeds) == 3


def test_placements_are_those_of_the_course_until_the_hand_is_moved():
    found = load_hand(hand_file("roll-between-fingers"))
    at = found.placements(now=3.0)["thumb"].position
    rest = found.placements(now=0.0)["thumb"].position
    np.testing.assert_allclose((at - rest)[1:], (-0.003, 0), atol=1e-9)
    state = found.simulated.move((0, 0, 0), (0, -np.pi / 2, 0), 0.5)
    for name, where in found.placements().items():
        assert where is state.presses[name].where
    found.simulated.state = None
    np.testing.assert_array_equal(found.placements(now=3.0)["thumb"].position, at)


# Fingers are engines of their own: one begins later, one cannot keep up, one frame is late.
def test_fingers_agree_on_the_time_of_their_course():
    clock, found = VirtualClock(1000.3), load_hand(hand_file("roll-between-fingers")).simulated
    for finger, delay in (("thumb", 0.0), ("index", 0.077), ("middle", 0.5)):
        clock.now = 1000.3
        clock.sleep(delay)
        source = SimulatedSource(
            found.course_scenes[finger], clock, clock.sleep, follows_clock=True
        )
        frames = []
        while len(frames) < 60:
            frames += source.read(0.02)
            if len(frames) == 20:
                clock.sleep(1.7)
        for frame in frames:
            place = found.at(frame.taken).presses[finger].place
            np.testing.assert_allclose(frame.truth.contact, place, atol=3e-6)
        assert np.ptp([frame.taken for frame in frames]) > 2.0


def test_a_finger_opens_by_name_and_by_file(tmp_path):
    file = tmp_path / "own.toml"
    file.write_text(hand_file("hold").read_text())
    for name in ("hold", str(file)):
        source = open_source(f"hand:{name}#index")
        assert source.sensor.simulated
        assert source.scene.seed == 1
        source.close()
    assert load_hand(file).fingers[1].source == f"hand:{file}#index"
    for name, why in (
        ("hold", "hand:NAME#FINGER of a hand with an .object., got hand:hold"),
        ("hold#ring", "a finger among thumb, index, middle, got hand:hold#ring"),
        ("three-fingertips#thumb", "with an .object., got"),
        ("fist#thumb", "expected a hand among explore, hold, .*got 'fist'"),
    ):
        with pytest.raises(Refusal, match=why):
            open_source(f"hand:{name}")


# Refusals


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"shape": "cone"}, "of shape ball, cylinder, box, got 'cone'"),
        ({"shape": "ball"}, "a ball with a radius above zero in m, got 0.0"),
        ({"shape": "ball", "radius": 0.02, "length": 0.1}, "no length of a ball"),
        ({"shape": "box", "sides": (0.1, 0.0, 0.1)}, "a box with a sides above zero|sides above"),
        ({"shape": "ball", "radius": 0.02, "mass": -0.1}, "a mass of 0 to 10 kg, got -0.1"),
        ({"shape": "ball", "radius": 0.02, "friction": 0.0}, "friction above 0, .*got 0"),
        ({"shape": "ball", "radius": np.nan}, "above zero in m, got nan"),
        ({"shape": "ball", "radius": 0.02, "mass": np.nan}, "a mass of 0 to 10 kg, got nan"),
    ],
)
def test_an_object_that_cannot_be_is_refused(given, why):
    with pytest.raises(Refusal, match=why):
        SimulatedObject(**given)


@pytest.mark.parametrize(
    ("what", "move", "why"),
    [
        (BALL, ((0.5, 0, 0), (0, 0, 0), 0.3), "that a finger reaches, got a ball at .500"),
        (
            replace(BALL, radius=0.08),
            ((0, 0, 0), (0, 0, 0), 0.3),
            "fits between the fingers, got a ball .*'thumb' would have to open by more than 30 mm",
        ),
        (BALL, ((0, 0, 0), (0, 0, 0), 9.0), "a grip of 0 to 2 N"),
        (BALL, ((0, 0, 0), (0, 0, 0), np.nan), "a grip of 0 to 2 N"),
        (BALL, ((0, 0, np.nan), (0, 0, 0), 0.3), "all finite"),
        (BALL, ((0, 0), (0, 0, 0), 0.3), r"a position \(3,\) in m"),
        (
            replace(BALL, radius=0.004, held=False),
            ((-0.03, 0, 0.0118), (0, 0, 0), 0.3),
            "on the skin of finger 'thumb', got it pressed .* mm from the pole",
        ),
    ],
)
def test_a_move_that_cannot_be_is_refused_and_changes_nothing(what, move, why):
    held = hand(what)
    with pytest.raises(Refusal, match=why):
        held.move(*move)
    assert held.state is None


HEAD = """format = 1
[object]
shape = "ball"
radius = 0.04
mass = 0.05
"""
TAIL = """[[finger]]
name = "thumb"
source = "sim:fingertip-cap"
position = [-0.04, 0.010472, -0.010472]
rotation = [0.0, -1.5707963, 3.1415927]
"""
COURSE = """[[course]]
time = 0.0
position = [0.0, 0.0, 0.0]
[[course]]
time = 1.0
position = [0.0, 0.0, 0.0]
"""


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (HEAD.replace("0.05", "-1.0") + TAIL, "line 2: object: expected a mass of 0 to 10"),
        (HEAD + 'colour = "red"\n' + TAIL, "line 6: object.colour: expected no such key"),
        (HEAD.replace("ball", "bal") + TAIL, "did you mean 'ball'"),
        (COURSE + TAIL, "format|shape"),
        (HEAD + COURSE.replace("1.0", "0.0") + TAIL, "increasing times from 0"),
        (HEAD + COURSE + "grip = 0.9\n" + TAIL, "a course that ends as it begins"),
        (HEAD + COURSE + "fingers = { ring = [0.0, 0.0, 0.0] }\n" + TAIL, "ends as it begins"),
        (HEAD + TAIL.replace("sim:fingertip-cap", "/dev/ttyACM0"), "a scene for each finger"),
        (HEAD + TAIL.replace("fingertip-cap", "circle"), "caps of a sphere"),
    ],
)
def test_a_simulated_hand_that_cannot_be_is_refused(tmp_path, text, why):
    file = tmp_path / "own.toml"
    file.write_text(text if text.startswith("format") else "format = 1\n" + text)
    with pytest.raises(Refusal, match=why):
        load_hand(file)


def test_a_hand_without_a_course_rests_until_it_is_moved(tmp_path):
    file = tmp_path / "own.toml"
    file.write_text(HEAD.replace("format = 1", 'format = 1\ntitle = "One"') + TAIL)
    found = load_hand(Path(file))
    np.testing.assert_allclose(found.placements()["thumb"].position, (-0.04, 0.010472, -0.010472))
    with pytest.raises(Refusal, match="a hand with a course, got none"):
        found.simulated.at(0.0)


# Through the pipeline


def grasps(name, times):
    """What the pipeline makes of a ready hand at `times`, with the truth."""
    found = load_hand(hand_file(name))
    held = found.simulated
    pipelines, simulators = {}, {}
    for finger, scene in held.course_scenes.items():
        pipelines[finger] = Pipeline(scene.sensor(), usual_setup(scene.sensor()))
        simulators[finger] = Simulator(scene)
    for n, time in enumerate(times):
        where, contacts = found.placements(now=time), []
        for finger in found.fingers:
            simulator, pipeline = simulators[finger.name], pipelines[finger.name]
            scan = simulator.scene.sensor().scan()
            estimate = pipeline(simulator.scanned(scan, n, time, lambda: 0.0))
            contacts.append(finger_contact(finger, where[finger.name], estimate, pipeline.fitted))
        yield Grasp([one for one in contacts if one]), held.at(time)


@pytest.mark.slow
def test_a_ball_that_is_held_is_told_with_the_forces_on_it():
    for grasp, state in grasps("hold", (0.5, 3.0, 5.0, 8.0)):
        found = find_held_object(grasp.contacts)
        assert found.kind == "sphere"
        assert abs(found.fits["sphere"].radius - 0.0412) < 2e-4
        assert np.linalg.norm(found.fits["sphere"].centre - state.pose.position) < 1e-3
        true = sum(press.force * press.normal for press in state.presses.values())
        assert np.abs(grasp.force - true).max() < 0.02


@pytest.mark.slow
def test_a_rod_that_rolls_is_told_to_turn_as_it_does():
    times = (1.8, 2.1, 4.8, 5.1)
    (one, first), (two, second), (three, third), (four, fourth) = grasps(
        "roll-between-fingers", times
    )
    for before, after, a, b in ((one, two, first, second), (three, four, third, fourth)):
        found = find_held_object(before.contacts)
        assert found.kind == "cylinder"
        assert abs(found.fits["cylinder"].radius - 0.012) < 2e-4
        motion = object_motion(before, after, 0.3, found.fits["cylinder"], rolls=True)
        turn = Rotation.from_matrix(b.pose.rotation @ a.pose.rotation.T).as_rotvec() / 0.3
        assert not motion.chance < 0.01
        np.testing.assert_allclose(motion.velocity[3:], turn, atol=0.02 * abs(turn[2]))


@pytest.mark.slow
def test_an_object_that_is_explored_makes_a_map_of_its_surface():
    surface = ObjectMap()
    for grasp, state in grasps("explore", np.arange(0.0, 14.0, 0.25)):
        for contact in grasp.contacts:
            surface.add(contact, state.pose)
    rows = surface.rows
    off = np.hypot(rows["y"], rows["z"]) - 0.025
    assert len(rows) > 120
    assert np.abs(off).max() < 1.5e-4
    around = np.sort(np.arctan2(rows["z"], rows["y"]))
    assert np.diff(around).max() < 0.4
    assert np.ptp(rows["x"]) > 0.04
