"""Simulated hand: fingertips around an object, in balance with friction, and their course in time.

The fingers close on the object until each presses with its force. The forces of the contacts are
those of least energy, on springs that are alike in all directions, which hold the weight of the
object within Coulomb's cones; where there are none, the object slips. What was before does not
matter: a motion is a row of balances. Skins feel normal forces; friction is known to the truth
alone.
"""

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
import scipy

from kappaskin.bases import basis_for
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask
from kappaskin.hand.pose import Placement, Triple, placement
from kappaskin.mechanics import (
    Block,
    Cylinder,
    DiscLoad,
    IndentationSolver,
    Plate,
    RigidObject,
    Sphere,
)
from kappaskin.scenes import EASES, RecordedMotion, Scene, Stimulus
from kappaskin.skin import Cap

SHAPES = ("ball", "cylinder", "box")
"""Shapes of an object in a simulated hand."""

GRAVITY = scipy.constants.g
"""The acceleration of free fall in m/s^2, along -z of the hand's frame."""

_TRAVEL = 0.03  # m that a finger closes, or opens, from its place
_CLOSINGS, _CLOSED = 20, 1e-10  # of Newton's method, and m to which it closes
_HEAD_ON = 0.05  # cosine between a finger's way and the normal, below which it passes by
_FORCES = np.array([0.0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5, 2.0])
_MOST_FORCE = float(_FORCES[-1])
_LEAST = 1e-3  # N: less does not touch
_FACETS, _FINER = 16, (1.0, 0.1, 0.01)  # of a friction cone; how wide around the one found
_BALANCE, _GRIP = 1e4, 1e7  # weights beside the energy
_SLIPS = 1e-4  # of the forces, out of balance
_MOST_MASS, _MOST_FRICTION = 10.0, 10.0  # kg
_FINE = 18, 41  # functions of the true shape: with 16 x 33 a contact is 35 um off
_EVERY = 0.04  # s between the poses of a course, straight between them
_LONGEST = 600.0  # s


@dataclass(frozen=True)
class SimulatedObject:
    """A ball, a cylinder or a box in a simulated hand, with its middle at the origin of its frame.

    A ball has a `radius`, a cylinder a `radius` and a `length` along x, a box `sides` along x, y
    and z, in m. Its `mass` is in kg; `friction` is the coefficient on skins. One that is not `held`
    stands on something else that bears it: the fingers touch it without friction.
    """

    shape: str
    radius: float = 0.0
    length: float = 0.0
    sides: Triple = (0.0, 0.0, 0.0)
    mass: float = 0.0
    friction: float = 0.5
    held: bool = True

    def __post_init__(self) -> None:
        needs = {"ball": ("radius",), "cylinder": ("radius", "length"), "box": ("sides",)}
        if self.shape not in needs:
            raise Refusal(f"expected an object of shape {', '.join(SHAPES)}, got {self.shape!r}")
        for name in ("radius", "length", "sides"):
            value = getattr(self, name)
            if (
                name not in needs[self.shape]
                and value != type(self).__dataclass_fields__[name].default
            ):
                raise Refusal(f"expected no {name} of a {self.shape}, got {value}; leave it out")
            if name in needs[self.shape] and not 0 < np.min(value) < math.inf:
                raise Refusal(f"expected a {self.shape} with a {name} above zero in m, got {value}")
        if not 0 <= self.mass <= _MOST_MASS:
            raise Refusal(f"expected a mass of 0 to {_MOST_MASS:g} kg, got {self.mass:g}")
        if not 0 < self.friction <= _MOST_FRICTION:
            raise Refusal(
                f"expected a coefficient of friction above 0, {_MOST_FRICTION:g} at most, got "
                f"{self.friction:g}; for an object that is not to be lifted give held = false"
            )

    @property
    def weight(self) -> float:
        """The weight in N that the fingers bear."""
        return self.mass * GRAVITY if self.held else 0.0

    @property
    def rigid(self) -> RigidObject:
        """What presses on a skin, as far as it is not an edge."""
        if self.shape == "ball":
            return Sphere(self.radius)
        if self.shape == "cylinder":
            return Cylinder(self.radius, self.length)
        return Block(max(self.sides), max(self.sides))

    def nearest(self, points: Array) -> Array:
        """The points (k, 3) of the object nearest to `points` (k, 3), in m in its own frame."""
        if self.shape == "box":
            half = np.array(self.sides) / 2
            return np.clip(points, -half, half)
        from_axis = points if self.shape == "ball" else points * (0.0, 1.0, 1.0)
        away = np.linalg.norm(from_axis, axis=1, keepdims=True)
        near = from_axis * (self.radius / np.maximum(away, self.radius))
        if self.shape == "cylinder":
            near[:, 0] = np.clip(points[:, 0], -self.length / 2, self.length / 2)
        return near


@dataclass(frozen=True, eq=False)
class FingerPress:
    """How one finger presses the object, in the hand's frame; without a `force` it does not.

    The skin's frame is `where`. It presses at `place` (2,) in m on the skin, `depth` in m deep, at
    the `point` (3,) in m, with its outward unit `normal` (3,) into the object. `force` in N is the
    normal force, `friction` (3,) in N that of friction on the object, along the skin. `margin` is
    how far that is from slipping: 1 without friction, 0 at Coulomb's limit.
    """

    where: Placement
    place: Array = field(default_factory=lambda: np.full(2, np.nan))
    point: Array = field(default_factory=lambda: np.full(3, np.nan))
    normal: Array = field(default_factory=lambda: np.full(3, np.nan))
    depth: float = 0.0
    force: float = 0.0
    friction: Array = field(default_factory=lambda: np.zeros(3))
    margin: float = 1.0


@dataclass(frozen=True, eq=False)
class HandState:
    """An object at a placement `pose` in the hand, and how each finger presses it, by name.

    It `slips` where no forces with the grip that was asked for hold it. `imbalance` (6,) in N and
    N m is then the sum of all forces and moments about its middle.
    """

    pose: Placement
    presses: dict[str, FingerPress]
    imbalance: Array
    slips: bool


@dataclass(frozen=True)
class Keyframe:
    """At `time` in s the object is at `position` in m, turned by `rotation` in rad as `placement`.

    `grip` in N is the mean of the normal forces of the fingers that touch. `fingers` that are named
    are moved by so many m along x, y and z from where the hand has them.
    """

    time: float
    position: Triple
    rotation: Triple = (0.0, 0.0, 0.0)
    grip: float = 0.3
    fingers: Mapping[str, Triple] = field(default_factory=dict[str, Triple])


@dataclass(frozen=True)
class HandCourse:
    """What a hand does in the course of time: smooth from one of the `keyframes` to the next.

    It stands still at each, and turns to it the shorter way. The last is as the first, and then it
    begins anew.
    """

    keyframes: tuple[Keyframe, ...]

    def __post_init__(self) -> None:
        times = [one.time for one in self.keyframes]
        if len(times) < 2 or times[0] or not all(np.diff(times) > 0) or times[-1] > _LONGEST:
            raise Refusal(
                "expected two keyframes or more, at increasing times from 0 to at most "
                f"{_LONGEST:g} s, got times {times!r:.80}"
            )
        if replace(self.keyframes[-1], time=0.0) != self.keyframes[0]:
            raise Refusal(
                "expected a course that ends as it begins, got another last keyframe; add one that "
                "is as the first"
            )

    @property
    def duration(self) -> float:
        """Seconds after which it begins anew."""
        return self.keyframes[-1].time

    def at(self, time: float) -> tuple[Placement, float, dict[str, Array]]:
        """The object's placement at `time` in s, the grip in N, and by how much fingers move."""
        time %= self.duration
        k = min(bisect_right([one.time for one in self.keyframes], time), len(self.keyframes) - 1)
        a, b = self.keyframes[k - 1], self.keyframes[k]
        s = EASES["smooth"]((time - a.time) / (b.time - a.time))
        first, last = placement(a.position, a.rotation), placement(b.position, b.rotation)
        turn = scipy.spatial.transform.Rotation.from_matrix(first.rotation.T @ last.rotation)
        part = scipy.spatial.transform.Rotation.from_rotvec(s * turn.as_rotvec()).as_matrix()
        where = Placement(
            first.rotation @ part, first.position + s * (last.position - first.position)
        )
        still = np.zeros(3)
        moved = {
            name: (1 - s) * np.array(a.fingers.get(name, still))
            + s * np.array(b.fingers.get(name, still))
            for name in {*a.fingers, *b.fingers}
        }
        return where, a.grip + s * (b.grip - a.grip), moved


def _at(force: float, values: Array) -> float:
    """The value under a normal `force` in N, of those under `_FORCES`."""
    return float(np.interp(force, _FORCES, values))


@cache
def _give(plate: Plate, edge: str, reference: tuple[int, int], rigid: RigidObject) -> Array:
    """Depth and radius (2, F) in m of what presses on the middle of a skin with `_FORCES`.

    The radius is that of a disc whose load is as wide.
    """
    press, middle = IndentationSolver(plate, basis_for(plate.patch, edge, *reference)), plate.patch
    found = [press(rigid, middle.a / 2, middle.b / 2, force=F) for F in _FORCES[1:].tolist()]
    wide = [
        math.sqrt(
            2 * one.forces @ np.sum((one.points - one.centre) ** 2, axis=1) / one.forces.sum()
        )
        for one in found
    ]
    return np.array([[0.0, *(one.depth for one in found)], [wide[0], *wide]])


def balanced_forces(
    arms: Array, normals: Array, weight: float, friction: float, grip: float
) -> tuple[Array, Array, bool]:
    """Forces (k, 3) in N on an object at contacts, which bear its `weight` in N along -z.

    `arms` (k, 3) in m are from its centre of mass, the unit `normals` (k, 3) point into it. Normal
    forces are `grip` in N in the mean. Of such forces within the cones of `friction` these are
    nearest to the grip alone. Cones have facets, 1e-4 at most beside the true direction of friction
    where it is at the limit. Also the sum (6,) of forces and moments, and whether they balance.
    """
    k, scale = len(arms), max(float(np.abs(arms).max()), 1e-3)
    A, b = np.zeros((7, 3 * k)), np.array([0, 0, weight, 0, 0, 0, k * grip])
    A[:3] = np.tile(np.eye(3), k)
    moments = np.cross(arms[:, None], np.eye(3)) / scale  # of 1 N along each axis
    A[3:6] = moments.reshape(-1, 3).T
    A[6] = normals.ravel()
    alone = grip * normals.ravel()
    f = alone + np.linalg.pinv(A) @ (b - A @ alone)
    if np.abs(A @ f - b).max() > 1e-9 * max(b.max(), 1e-9) or not _within(f, normals, friction):
        f = _in_cones(A, b, alone, normals, friction)
    left = A @ f - b
    balanced = bool(np.abs(left).max() <= _SLIPS * (weight + k * grip))
    return f.reshape(k, 3), left[:6] * np.repeat([1.0, scale], 3), balanced


def _within(f: Array, normals: Array, friction: float) -> bool:
    along = np.vecdot(f.reshape(-1, 3), normals)
    slanted = np.linalg.norm(f.reshape(-1, 3) - along[:, None] * normals, axis=1)
    return bool((slanted <= friction * along).all())


def _in_cones(A: Array, b: Array, alone: Array, normals: Array, friction: float) -> Array:
    """The f (3k,) in the cones nearest to `alone`, of those with A f = b as far as there are."""
    k = len(normals)
    t = np.cross(normals, np.eye(3)[np.argmin(np.abs(normals), axis=1)])
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    s = np.cross(normals, t)
    weights = np.repeat([_BALANCE, _GRIP, 1.0], [6, 1, 3 * k])
    rows = np.vstack([A, np.eye(3 * k)])
    towards, f = np.zeros(k), alone.reshape(k, 3)
    for width in _FINER:
        angles = towards[:, None] + width * math.pi * np.arange(-_FACETS, _FACETS + 1) / _FACETS
        slanted = np.cos(angles)[..., None] * t[:, None] + np.sin(angles)[..., None] * s[:, None]
        edges = normals[:, None] + friction * slanted  # (k, facets, 3)
        edges = np.concatenate([normals[:, None], edges], axis=1)
        D = np.asarray(scipy.linalg.block_diag(*edges.swapaxes(1, 2)), float)
        share, _ = scipy.optimize.nnls(weights[:, None] * (rows @ D), weights * [*b, *alone])
        f = np.asarray(D @ share, float).reshape(k, 3)
        towards = np.arctan2(np.vecdot(f, s), np.vecdot(f, t))
    return f.ravel()


class _Balance(NamedTuple):
    """How far fingers close, where and how deep they press, with which forces; and what is left.

    `each` (k, 3) are the whole forces on the object, `forces` (k,) the normal ones.
    """

    closing: Array
    normals: Array
    points: Array
    depths: Array
    each: Array
    forces: Array
    imbalance: Array
    balance: bool


class SimulatedHand:
    """Fingers with these `skins`, the placement and the scene of each, around an object `what`.

    `move` it, or let it follow its `course`. Of a scene counts all but its stimuli; its true shape
    has 18 x 41 functions at least, as narrow contacts need.
    """

    def __init__(
        self,
        skins: Mapping[str, tuple[Placement, Scene]],
        what: SimulatedObject,
        course: HandCourse | None = None,
    ) -> None:
        self.skins = dict[str, tuple[Placement, Scene]]()
        self.what, self.course = what, course
        self.state: HandState | None = None
        """Where the last `move` has put it; None while it follows its course."""
        self._caps = list[Cap]()
        for n, (name, (where, scene)) in enumerate(skins.items()):
            cap = scene.plate.patch
            if not isinstance(cap, Cap) or cap.stretch != 1:
                raise Refusal(
                    f"expected fingertips that are caps of a sphere to hold an object, got a "
                    f"{cap.name} of finger {name!r}; take a scene such as fingertip-cap"
                )
            self._caps.append(cap)
            # With the same seed the noise of all fingers would be alike.
            i, j = (max(each) for each in zip(scene.reference, _FINE, strict=True))
            bare = replace(scene, stimuli=(), reference=(i, j), seed=scene.seed + n)
            self.skins[name] = where, bare
        self._radii = np.array([cap.equator for cap in self._caps])
        places = [where for where, _ in self.skins.values()]
        inner = [np.array([cap.rim_radius, cap.rim_radius, -cap.equator]) for cap in self._caps]
        self._centres = np.array(
            [at.rotation @ middle + at.position for at, middle in zip(places, inner, strict=True)]
        )
        self._ways = np.array([at.rotation[:, 2] for at in places])
        for keyframe in () if course is None else course.keyframes:
            if unknown := keyframe.fingers.keys() - self.skins.keys():
                raise Refusal(
                    f"expected fingers among {', '.join(self.skins)} in a keyframe, got "
                    f"{', '.join(sorted(unknown))}"
                )

    @cached_property
    def _gives(self) -> list[Array]:
        """Depth and radius (2, F) of each finger's contact under `_FORCES`."""
        scenes = [scene for _, scene in self.skins.values()]
        return [_give(one.plate, one.edge, one.reference, self.what.rigid) for one in scenes]

    def move(
        self,
        position: Sequence[float] | Array,
        rotation: Sequence[float] | Array,
        grip: float,
        fingers: Mapping[str, Sequence[float] | Array] | None = None,
    ) -> HandState:
        """Move the object to `position` (3,) in m and press it with `grip` in N in the mean.

        `rotation` is roll, pitch and yaw in rad as of `placement`, or a matrix (3, 3). `fingers`
        are moved by so many m (3,) from where the hand has them. Raises a `Refusal`, and moves
        nothing, where no finger reaches the object, it does not fit between them, or is pressed
        beyond a skin's rim.
        """
        turn, at = np.asarray(rotation, float), np.asarray(position, float)
        if turn.shape == (3,):
            turn = placement((0.0, 0.0, 0.0), tuple(turn.tolist())).rotation
        if not (at.shape == (3,) and turn.shape == (3, 3) and np.isfinite([*at, *turn.flat]).all()):
            raise Refusal(
                "expected a position (3,) in m and a rotation (3,) in rad or (3, 3), all finite, "
                f"got {at.shape} and {turn.shape}"
            )
        self.state = self._state(Placement(turn, at), grip, fingers or {})
        return self.state

    def at(self, time: float) -> HandState:
        """The state at `time` in s of the course."""
        if self.course is None:
            raise Refusal("expected a hand with a course, got none; give keyframes at [[course]]")
        return self._state(*self.course.at(time))

    def placements(self, time: float) -> dict[str, Placement]:
        """Where each finger's skin is: after the last `move`, else at `time` in s of the course.

        Without either it is where the hand has it.
        """
        if self.state is None and self.course is None:
            return {name: where for name, (where, _) in self.skins.items()}
        state = self.state or self.at(time)
        return {name: press.where for name, press in state.presses.items()}

    def scenes(self, state: HandState) -> dict[str, Scene]:
        """The scene of each finger in a `state`, which `Engine.play` lets its skin feel."""
        found = dict[str, Scene]()
        for n, (name, (_, scene)) in enumerate(self.skins.items()):
            press = state.presses[name]
            loads = (self._load(n, press.place, press.force),) if press.force else ()
            found[name] = scene.touched_by(*loads)
        return found

    @cached_property
    def course_scenes(self) -> dict[str, Scene]:
        """The scene of each finger whose stimulus follows the course."""
        if self.course is None:
            raise Refusal("expected a hand with a course, got none; give keyframes at [[course]]")
        duration = self.course.duration
        times = np.linspace(0.0, duration, math.ceil(duration / _EVERY) + 1)
        states = [self.at(time) for time in times[:-1].tolist()]
        found = dict[str, Scene]()
        for n, (name, (_, scene)) in enumerate(self.skins.items()):
            presses = [state.presses[name] for state in (*states, states[0])]
            forces = np.array([one.force for one in presses])
            found[name] = scene
            if not (on := forces > 0).any():
                continue
            places = np.array([one.place for one in presses])
            known = np.flatnonzero(on)
            near = places[known[np.abs(np.arange(len(on))[:, None] - known).argmin(axis=1)]]
            load = self._load(n, near[known[0]], float(forces.max()), float(forces[on].mean()))
            poses = np.column_stack([near - near[known[0]], forces / forces.max()])
            moving = Stimulus(load, RecordedMotion(times, poses))
            found[name] = replace(scene, stimuli=(moving,))
        return found

    def _load(self, n: int, place: Array, force: float, wide_as: float | None = None) -> DiscLoad:
        """What finger `n` feels of a normal `force` in N: a disc as wide as the contact."""
        x, y = place.tolist()
        wide = _at(force if wide_as is None else wide_as, self._gives[n][1])
        return DiscLoad(x, y, wide, force)

    def _state(
        self, pose: Placement, grip: float, fingers: Mapping[str, Sequence[float] | Array]
    ) -> HandState:
        names = list(self.skins)
        if not 0 <= grip <= _MOST_FORCE:
            raise Refusal(f"expected a grip of 0 to {_MOST_FORCE:g} N, got {grip}")
        if unknown := fingers.keys() - self.skins.keys():
            raise Refusal(f"expected fingers among {', '.join(names)}, got {sorted(unknown)}")
        shifts = np.array([fingers.get(name, (0.0, 0.0, 0.0)) for name in names], float)
        if not (shifts.shape == (len(names), 3) and np.isfinite(shifts).all()):
            raise Refusal("expected fingers moved by three finite numbers in m, got others")
        alike = self._balanced(pose, shifts, grip, np.full(len(names), grip))
        found = self._balanced(pose, shifts, grip, alike.forces)  # as deep as forces differ
        presses = dict[str, FingerPress]()
        for n, (name, (at, _)) in enumerate(self.skins.items()):
            moved = shifts[n] + found.closing[n] * self._ways[n]
            where, force = Placement(at.rotation, at.position + moved), float(found.forces[n])
            if force > _MOST_FORCE:
                raise Refusal(
                    f"expected a grip at which no finger presses with more than {_MOST_FORCE:g} N, "
                    f"got {grip:g} N, at which {name!r} presses with {force:.3g} N; press less, or "
                    "take a lighter object"
                )
            presses[name] = FingerPress(where)
            if force > _LEAST:
                friction = found.each[n] - force * found.normals[n]
                limit = self.what.friction * force
                presses[name] = FingerPress(
                    where,
                    self._place(n, found.normals[n] @ at.rotation, force),
                    found.points[n],
                    found.normals[n],
                    float(found.depths[n]),
                    force,
                    friction,
                    1 - float(np.linalg.norm(friction)) / limit,
                )
        return HandState(pose, presses, found.imbalance, not found.balance)

    def _balanced(self, pose: Placement, shifts: Array, grip: float, before: Array) -> "_Balance":
        """The balance of fingers that press as deep as normal forces `before` (k,) in N press."""
        each_gives = zip(before.tolist(), self._gives, strict=True)
        depths = np.array([_at(force, give[0]) for force, give in each_gives])
        closing, normals, points, on = self._closed(pose, shifts, self._radii - depths)
        each, left, holds = grip * normals * on[:, None], np.zeros(6), True
        if self.what.held:
            arms = points[on] - pose.position
            weight, friction = self.what.weight, self.what.friction
            each[on], left, holds = balanced_forces(arms, normals[on], weight, friction, grip)
        forces = np.maximum(np.vecdot(each, normals), 0.0)
        return _Balance(closing, normals, points, depths, each, forces, left, holds)

    def _closed(
        self, pose: Placement, shifts: Array, apart: Array
    ) -> tuple[Array, Array, Array, Mask]:
        """How far (k,) in m fingers close until they are `apart` (k,) in m from their middles.

        With the normals (k, 3) into the object, its points (k, 3) there, and which ones touch it.
        The distance of a convex object is a convex function of the way: from outside, Newton's
        method never goes too far.
        """
        begin = self._centres + shifts
        q = np.full(len(apart), -_TRAVEL)
        normals, points, away = self._nearest(pose, begin + q[:, None] * self._ways)
        if (tight := away < apart).any():
            raise Refusal(
                f"expected an object that fits between the fingers, got a {self._described(pose)}, "
                f"for which finger {list(self.skins)[int(np.argmax(tight))]!r} would have to open "
                f"by more than {1e3 * _TRAVEL:g} mm; take a smaller one, or move it"
            )
        for _ in range(_CLOSINGS):
            rate = np.vecdot(normals, self._ways)
            by = np.where(rate > _HEAD_ON, (away - apart) / np.maximum(rate, _HEAD_ON), 0.0)
            q = q + by
            normals, points, away = self._nearest(pose, begin + q[:, None] * self._ways)
            if np.abs(by).max() < _CLOSED:
                break
        meets = (np.vecdot(normals, self._ways) > _HEAD_ON) & (np.abs(away - apart) < 10 * _CLOSED)
        on = meets & (q <= _TRAVEL)
        if not on.any():
            raise Refusal(
                f"expected an object that a finger reaches, got a {self._described(pose)}, which "
                "none does; move it between the fingers"
            )
        return np.where(on, q, 0.0), normals, points, on

    def _nearest(self, pose: Placement, middles: Array) -> tuple[Array, Array, Array]:
        """Unit vectors (k, 3) from `middles` (k, 3) to the object, its points, and how far (k,)."""
        R, at = pose
        points = self.what.nearest((middles - at) @ R) @ R.T + at
        away = np.linalg.norm(points - middles, axis=1)
        return (points - middles) / np.maximum(away, _CLOSED)[:, None], points, away

    def _described(self, pose: Placement) -> str:
        return f"{self.what.shape} at {np.round(1e3 * pose.position, 1).tolist()} mm"

    def _place(self, n: int, normal: Array, force: float) -> Array:
        """Where (2,) in m finger `n` presses, with the `normal` (3,) in the frame of its skin."""
        cap = self._caps[n]
        wide = _at(force, self._gives[n][1])
        from_pole = cap.equator * math.acos(min(1.0, float(normal[2])))
        if from_pole > cap.rim_radius - wide:
            raise Refusal(
                f"expected the object on the skin of finger {list(self.skins)[n]!r}, got it "
                f"pressed {1e3 * from_pole:.3g} mm from the pole, where the skin ends after "
                f"{1e3 * cap.rim_radius:.3g} mm; move or turn it"
            )
        middle = np.array([cap.rim_radius, cap.rim_radius, -cap.equator])
        return cap.places(middle + cap.equator * normal)
