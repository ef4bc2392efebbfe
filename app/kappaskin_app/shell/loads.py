"""Loads on a simulated skin: load cases, free loads and dragged loads."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Generic, NamedTuple, ParamSpec, TypeVar

import numpy as np

from kappaskin.bases import Basis, basis_for
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics import (
    Compliance,
    DiscLoad,
    GaussianLoad,
    LineLoad,
    Load,
    Plate,
    PointLoad,
    RectangleLoad,
)
from kappaskin.scenes import Indenter, Orbit, Scene, Stimulus, load_scene
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Patch
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import (
    FREE_CASES,
    LOAD_CASES,
    READY_CASES,
    SPREAD_CASES,
    TWO_ENDED,
)

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


class Cache(Generic[_Arguments, _Result]):
    """Caches the last `size` results of `function`; `store` adds one computed elsewhere.

    `functools.lru_cache` cannot store the result of another process.
    """

    def __init__(self, function: Callable[_Arguments, _Result], size: int) -> None:
        self._function, self._size = function, size
        self._results: dict[tuple[Any, ...], _Result] = {}

    def __call__(self, *arguments: _Arguments.args, **_: _Arguments.kwargs) -> _Result:
        found = self._results.pop(arguments, None)  # at once, as another thread may do it too
        if found is None:
            found = self._function(*arguments, **_)
        self.store(arguments, found)  # the latest comes last
        return found

    def store(self, arguments: tuple[Any, ...], result: _Result) -> None:
        """Store the `result` for these `arguments`."""
        self._results[arguments] = result
        if len(self._results) > self._size:
            self._results.pop(next(iter(self._results)), None)


_REFERENCE = 15  # basis functions of the true shape along a side, as in Table 1
# So many are seen by elements near a load on a small area: with Table 1's no object fits it.
_RESOLVED, _RESOLVED_MIXED = 40, 20  # on a flat rectangle: of waves that mix, what a file may ask
_MARGIN = 0.03  # of the patch along each edge, where no load can be dragged
_HIGHEST_CURVATURE = 27.0  # 1/m, under the load: a moving one reaches more, and 38 saturates
_LEAST_COMPLIANCE = 1e-12  # m/N, of a skin where it is free to move
_TAIL = 4.0  # standard deviations of a Gaussian that must be on the skin
_HALVINGS = 16
_CACHED = 8  # skins whose compliance is cached


def free_loads(settings: Settings) -> tuple[Load, ...]:
    s = settings
    if s.load_case == "disc":
        return (DiscLoad(s.x, s.y, s.size, s.force),)
    if s.load_case == "rectangle":
        return (RectangleLoad(s.x, s.y, s.size, s.size_y, s.force),)
    if s.load_case == "gaussian":
        return (GaussianLoad(s.x, s.y, s.size, s.force),)
    if s.load_case == "free-line":
        return (LineLoad(s.x, s.y, s.x_end, s.y_end, s.force),)
    if s.load_case == "two-points":
        return PointLoad(s.x, s.y, s.force / 2), PointLoad(s.x_end, s.y_end, s.force / 2)
    return (PointLoad(s.x, s.y, s.force),)


@lru_cache(len(LOAD_CASES) * _CACHED)
def reference_on(plate: Plate, edge: str, case: str = "") -> tuple[int, int]:
    """Basis functions of the true shape of `plate`; a strip is uniform along y.

    Of a load `case` on its own skin they are those of the ready scene.
    """
    patch, ready = plate.patch, load_scene(case) if case in READY_CASES else None
    if ready and (plate, edge) == (ready.plate, ready.edge):
        return ready.reference
    if patch.strip:
        return _REFERENCE, 1
    if type(patch) is not Patch or plate.mixes_sines or plate.stretches:
        return _REFERENCE, _REFERENCE
    count = _RESOLVED if edge == "hinged" else _RESOLVED_MIXED
    return count, count


def _compliance_or_refusal(plate: Plate, edge: str) -> Compliance | Refusal:
    try:
        return plate.compliance(basis_for(plate.patch, edge, *reference_on(plate, edge)))
    except Refusal as refusal:
        return refusal


compliance_or_refusal = Cache(_compliance_or_refusal, _CACHED)
"""The compliance of the true shape, or the refusal of a skin that has none."""


def compliance_of(plate: Plate, edge: str) -> Compliance:
    """The cached compliance of the true shape; raises `Refusal` for a skin without support."""
    found = compliance_or_refusal(plate, edge)
    if isinstance(found, Refusal):
        raise found
    return found


@lru_cache(_CACHED)
def middle_compliance(plate: Plate, edge: str) -> float:
    """Displacement in m of the middle of the skin under a point load of 1 N there."""
    patch = plate.patch
    basis = basis_for(patch, edge, *reference_on(plate, edge))
    return abs(_moved(PointLoad(patch.a / 2, patch.b / 2), basis, compliance_of(plate, edge)))


def _moved(load: Load, basis: Basis, compliance: Compliance) -> float:
    """Displacement in m of the skin at the centre of the load."""
    return float(basis.at(load.centre()[None])[0] @ compliance(load.modal(basis)).ravel())


def _placed(load: Load, was: Patch, patch: Patch) -> PointLoad | LineLoad:
    """The load at the same relative position on `patch`, or nearer to its middle."""
    ends = [[load.x0, load.y0], [load.x1, load.y1]] if isinstance(load, LineLoad) else load.centre()
    shares = np.reshape(ends, (-1, 2)) / (was.a, was.b) - 0.5
    places = [(0.5 + s * shares) * (patch.a, patch.b) for s in np.linspace(1.0, 0.0, 11)]
    place = next(p for p in places if patch.contains(p).all())
    return (
        LineLoad(*place.ravel().tolist())
        if isinstance(load, LineLoad)
        else PointLoad(*place[0].tolist())
    )


@lru_cache(len(LOAD_CASES) * _CACHED)
def load_case_stimuli(case: str, plate: Plate, edge: str) -> tuple[Stimulus, ...]:
    """The stimuli of a load case; on another skin than Table 1's, at the same relative positions.

    A displacement W on the patch of side L becomes W s on a skin whose shorter side is s L, which
    has the same slopes. It is smaller where elements would saturate.
    """
    paper = load_scene(case)
    if (plate, edge) == (paper.plate, paper.edge):
        return paper.stimuli
    compliance, patch = compliance_of(plate, edge), plate.patch
    was = paper.plate.patch
    size = min(patch.a / was.a, patch.b / was.b)
    moved = _moved(paper.loads[0], paper.basis, paper.plate.compliance(paper.basis))
    load = _placed(paper.loads[0], was, patch)
    basis = basis_for(patch, edge, *reference_on(plate, edge))
    gives = abs(_moved(load, basis, compliance))
    if not gives > _LEAST_COMPLIANCE:
        raise Refusal(
            f"the skin does not move at the load, {load.centre()} m: expected a position "
            "further inside; select a free load and drag it there"
        )
    load = load.scaled(size * moved / gives)
    bent = SensorLayout.regular(patch, 21, 21).operator(basis, plate)
    most = float(np.abs(bent @ compliance(load.modal(basis)).ravel()).max())
    motion = paper.stimuli[0].motion
    if isinstance(motion, Orbit):
        motion = replace(motion, radius=motion.radius * size)
    return (Stimulus(load.scaled(min(1.0, _HIGHEST_CURVATURE / most)), motion),)


def dragged(
    settings: Settings, scene: Scene, x: float, y: float, grabbed_end: bool
) -> dict[str, Any]:
    """The settings that change when a load of `scene` is dragged to (x, y) in m.

    It becomes a free load of the same force. A line moves as a whole, a distributed load while it
    is completely on the skin, and of two points the grabbed one.
    """
    if not scene.loads:
        return {}  # the skin is on a cylinder
    patch, load = scene.plate.patch, scene.loads[0]
    x, y = _inside(patch, x, y)
    if settings.load_case == "two-points":
        return {"x_end": x, "y_end": y} if grabbed_end else {"x": x, "y": y}
    force = {} if settings.load_case in FREE_CASES else {"force": load.force}
    if settings.load_case in SPREAD_CASES:
        return {"x": x, "y": y} | inside_rim(replace(settings, x=x, y=y), patch)
    if not isinstance(load, LineLoad):
        return {"load_case": "point", "x": x, "y": y, **force}
    half_x, half_y = (load.x1 - load.x0) / 2, (load.y1 - load.y0) / 2
    x = min(max(x, abs(half_x)), patch.a - abs(half_x))
    y = min(max(y, abs(half_y)), patch.b - abs(half_y))
    ends = {"x": x - half_x, "y": y - half_y, "x_end": x + half_x, "y_end": y + half_y}
    if not patch.contains(np.reshape(list(ends.values()), (2, 2))).all():
        return {}
    return {"load_case": "free-line", **ends, **force}


def inside_rim(settings: Settings, patch: Patch) -> dict[str, float]:
    """The position at which a free load is completely on `patch`; empty where it already is.

    It is the nearest to the present one, and the middle for a load that is too large.
    """
    s = settings
    if s.load_case in TWO_ENDED:
        end = inside_rim(replace(s, load_case="point", x=s.x_end, y=s.y_end), patch)
        moved = {f"{name}_end": value for name, value in end.items()}
        return inside_rim(replace(s, load_case="point"), patch) | moved
    place, middle = np.array([s.x, s.y]), np.array([patch.a, patch.b]) / 2
    if _lies_on(s, patch, place):
        return {}
    farthest = np.maximum(middle - _reach(s), 0.0)
    away = np.clip(place - middle, -farthest, farthest)
    if not _lies_on(s, patch, middle + away):
        away *= _share_on(s, patch, middle, away)
    x, y = (middle + away).tolist()
    return {"x": x, "y": y}


def _reach(settings: Settings) -> tuple[float, float]:
    """Half the extent of a free load along x and y, in m."""
    s = settings
    if s.load_case == "rectangle":
        return s.size / 2, s.size_y / 2
    times = {"disc": 1.0, "gaussian": _TAIL}.get(s.load_case, 0.0)
    return times * s.size, times * s.size


def _share_on(settings: Settings, patch: Patch, middle: Array, away: Array) -> float:
    """The fraction of `away` from the middle at which the load is still completely on `patch`."""
    least, most = 0.0, 1.0
    for _ in range(_HALVINGS):
        share = (least + most) / 2
        there = _lies_on(settings, patch, middle + share * away)
        least, most = (share, most) if there else (least, share)
    return least


def _lies_on(settings: Settings, patch: Patch, place: Array) -> bool:
    """Whether the free load at `place` (2,) in m is completely on `patch`."""
    x, y = place.tolist()
    try:
        for load in free_loads(replace(settings, x=x, y=y)):
            load.check(patch)
    except Refusal:
        return False
    return True


def _inside(patch: Patch, x: float, y: float) -> tuple[float, float]:
    """The point inside the margin of the rim that is nearest to (x, y) in m."""
    middle = np.array([patch.a, patch.b]) / 2
    x, y = np.clip([x, y], 2 * _MARGIN * middle, 2 * (1 - _MARGIN) * middle)
    if patch.depth(np.array([[x, y]]))[0] < 0.99 * _MARGIN * min(patch.a, patch.b):
        x, y = middle + (1 - 2 * _MARGIN) * (np.array(patch.inward(x, y)) - middle)
    return float(x), float(y)


_POINTS = 41  # of every footprint, so that one polyline can show each of them
_CORNERS = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]) / 2


def footprint(load: Load, patch: Patch) -> Array | None:
    """Points (41, 2) in m along a line load, or on the outline of a distributed one; else None.

    The outline of a Gaussian is at two standard deviations, which includes 86 % of its force.
    """
    along = np.linspace(0, 1, _POINTS)
    if isinstance(load, LineLoad):
        ends = np.array([(load.x0, load.y0), (load.x1, load.y1)])
        return _between(along, ends)
    if isinstance(load, RectangleLoad):
        corners = _CORNERS * (load.width, load.height)
        return patch.around(load.x, load.y, _between(4 * along, corners))
    if isinstance(load, DiscLoad | GaussianLoad):
        radius = load.radius if isinstance(load, DiscLoad) else 2 * load.sd
        turn = 2 * np.pi * along
        rim = radius * np.column_stack([np.cos(turn), np.sin(turn)])
        return patch.around(load.x, load.y, rim)
    return None


def _between(at: Array, corners: Array) -> Array:
    """Points on the polyline through `corners` (k, 2), interpolated at the corner numbers `at`."""
    passed = np.arange(len(corners))
    return np.column_stack([np.interp(at, passed, corners[:, axis]) for axis in (0, 1)])


_DEEPEST = 0.2  # of the skin's shorter side
_LEAST_FORCE = 0.01  # of the largest force of the mouse: a smaller one is no contact


class DrawnStimulus(NamedTuple):
    """The `number` of a stimulus of the scene, and the `load` that represents it."""

    number: int
    load: Load


def loads_at(scene: Scene, time: float) -> list[DrawnStimulus]:
    """The loads at `time` in s; a rigid object is a point load of its force, or of 1 N."""
    found = list[DrawnStimulus]()
    for number, stimulus in enumerate(scene.stimuli):
        pose, what = stimulus.pose_at(time), stimulus.what
        load = stimulus.load_at(time)
        if isinstance(what, Indenter) and pose.amount:
            load = PointLoad(what.x + pose.dx, what.y + pose.dy, what.force or 1.0)
        if load is not None:
            found.append(DrawnStimulus(number, load))
    return found


@dataclass
class GrabbedStimulus:
    """A stimulus of a `scene`, there `at` (x, y) in m, that is held and moved `by` (dx, dy) in m.

    It leaves its motion and rests with its whole force or depth, which is `times` the one in the
    scene, within limits that keep the skin in the view.
    """

    scene: Scene
    number: int
    at: tuple[float, float]
    by: tuple[float, float] = (0.0, 0.0)
    times: float = 1.0
    moved: bool = False

    @classmethod
    def at_place(cls, scene: Scene, time: float, x: float, y: float) -> "GrabbedStimulus | None":
        """The stimulus that presses nearest to (x, y) in m at `time` in s.

        Where none presses it is the nearest one in the scene, put there; None without any.
        """
        pressing = loads_at(scene, time)
        there = pressing or [
            DrawnStimulus(number, PointLoad(*_place(stimulus.what), 1.0))
            for number, stimulus in enumerate(scene.stimuli)
        ]
        if not there:
            return None
        near = min(there, key=lambda touch: math.dist(touch.load.centre(), (x, y)))
        grabbed = cls(scene, near.number, _place(scene.stimuli[near.number].what))
        if grabbed.moves:
            grabbed.moved_to(*(near.load.centre().tolist() if pressing else (x, y)))
            grabbed.moved = not pressing
        return grabbed

    @property
    def moves(self) -> bool:
        """Whether it has a motion in the scene."""
        return self.scene.stimuli[self.number].motion is not None

    def moved_to(self, x: float, y: float) -> Scene:
        """The scene with the stimulus at (x, y) in m, or as near to it on a line to the middle.

        It is there completely on the skin.
        """
        patch, before = self.scene.plate.patch, self.by
        middle, to = np.array([patch.a, patch.b]) / 2, np.array([x, y])
        least, most = 0.0, 2.0  # of the line: the whole of it first
        for _ in range(_HALVINGS):
            share = (least + most) / 2
            dx, dy = (middle + share * (to - middle) - self.at).tolist()
            if self._fits(dx, dy):
                self.by, least = (dx, dy), share
            else:
                most = share
            if least == 1.0:
                break
        self.moved |= self.by != before
        return self.resting

    def pressed(self, times: float) -> Scene:
        """The scene with `times` the force that the stimulus has in the scene."""
        what = self.scene.stimuli[self.number].what
        most = largest_factor(self.scene, what)
        self.times = min(max(times, min(_LEAST_FORCE * most, 1.0)), max(most, 1.0))
        self.moved |= self.times != 1.0
        return self.resting

    @property
    def resting(self) -> Scene:
        """The scene with the stimulus at rest where it is held."""
        stimuli = list(self.scene.stimuli)
        stimuli[self.number] = scaled(self._held(*self.by), self.times)
        return replace(self.scene, stimuli=tuple(stimuli))

    def _held(self, dx: float, dy: float) -> Stimulus:
        return Stimulus(_shifted(self.scene.stimuli[self.number].what, dx, dy))

    def _fits(self, dx: float, dy: float) -> bool:
        """Whether the stimulus is on the skin where it is moved by (dx, dy) in m."""
        held, plate = self._held(dx, dy), self.scene.plate
        try:
            held.check(plate)
            if isinstance(held.what, Indenter):  # its middle is on the skin too
                PointLoad(held.what.x, held.what.y, 1.0).check(plate.patch)
        except Refusal:
            return False
        return True


def _place(what: Load | Indenter) -> tuple[float, float]:
    """The place (x, y) in m of `what`, without its motion."""
    x, y = (what.x, what.y) if isinstance(what, Indenter) else what.centre().tolist()
    return x, y


def _shifted(what: Load | Indenter, dx: float, dy: float) -> Load | Indenter:
    if isinstance(what, Indenter):
        return replace(what, x=what.x + dx, y=what.y + dy)
    return what.shifted(dx, dy)


def scaled(stimulus: Stimulus, times: float) -> Stimulus:
    """The stimulus with `times` the force or depth."""
    what = stimulus.what
    if not isinstance(what, Indenter):
        return replace(stimulus, what=what.scaled(times))
    if what.force is not None:
        return replace(stimulus, what=replace(what, force=what.force * times))
    return replace(stimulus, what=replace(what, depth=(what.depth or 0.0) * times))


def largest_factor(scene: Scene, what: Load | Indenter) -> float:
    """Largest factor of the force or depth of `what`.

    At that force, as a point load, the middle of the skin moves by a fifth of its shorter side.
    """
    patch = scene.plate.patch
    deepest = _DEEPEST * min(patch.a, patch.b)
    if isinstance(what, Indenter) and what.force is None:
        return deepest / (what.depth or deepest)
    gives = middle_compliance(scene.plate, scene.edge)
    return deepest / (abs(what.force or 1.0) * gives) if gives > 0 else 1.0


def object_replaceable(scene: Scene) -> bool:
    """Whether another object can replace the present one, which must be single and at rest.

    Not on a strip, which is uniform along y and has loads only.
    """
    alone = len(scene.stimuli) == 1 and not scene.moves
    return alone and not scene.plate.patch.strip
