"""Loads on a simulated skin: ready ones, free ones, and those that are dragged."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Generic, NamedTuple, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from kappaskin.bases import Basis, basis_for
from kappaskin.errors import Refusal
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
from kappaskin_app.shell.settings.scene import FREE_CASES, LOAD_CASES, SPREAD_CASES, TWO_ENDED

_Question = ParamSpec("_Question")
_Answer = TypeVar("_Answer")


class Memo(Generic[_Question, _Answer]):
    """Remembers what `answer` said to the last `most` questions; `learn` brings what it would say.

    As `functools.lru_cache`, which learns from nobody.
    """

    def __init__(self, answer: Callable[_Question, _Answer], most: int) -> None:
        self._answer, self._most = answer, most
        self._known: dict[tuple[Any, ...], _Answer] = {}

    def __call__(self, *question: _Question.args, **_: _Question.kwargs) -> _Answer:
        if question not in self._known:
            self.learn(question, self._answer(*question, **_))
        self._known[question] = self._known.pop(question)  # the latest comes last
        return self._known[question]

    def learn(self, question: tuple[Any, ...], answer: _Answer) -> None:
        """Remember that `answer` is what there is to say to `question`."""
        self._known[question] = answer
        if len(self._known) > self._most:
            del self._known[next(iter(self._known))]


Array = NDArray[np.float64]

REFERENCE = (15, 15)
"""Functions of the true shape, by which Table 1 defines its truth."""
_MARGIN = 0.03  # share of the patch along each edge that a dragged load keeps out of
_MOST_BENT = 27.0  # 1/m, under the load: a moving one bends more in places, and 38 is a rail
_LEAST = 1e-12  # m/N that a skin gives where it is free to move
_TAIL = 4.0  # standard deviations of a Gaussian that the skin is to hold
_HALVINGS = 16
_REMEMBERED = 8  # skins whose compliance need not be computed again


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


def reference_on(patch: Patch) -> tuple[int, int]:
    """Functions of the true shape of `patch`; a strip is alike along y."""
    return (REFERENCE[0], 1) if patch.strip else REFERENCE


def _tried(plate: Plate, edge: str) -> Compliance | Refusal:
    try:
        return plate.compliance(basis_for(plate.patch, edge, *reference_on(plate.patch)))
    except Refusal as refusal:
        return refusal


tried = Memo(_tried, _REMEMBERED)
"""How the true shape gives, or why it cannot be told."""


def compliance_of(plate: Plate, edge: str) -> Compliance:
    """How the true shape gives, remembered; raises `Refusal` for a skin that nothing holds."""
    found = tried(plate, edge)
    if isinstance(found, Refusal):
        raise found
    return found


@lru_cache(_REMEMBERED)
def yielding(plate: Plate, edge: str) -> float:
    """How far in m the middle of the skin moves under a point load of 1 N there."""
    patch = plate.patch
    basis = basis_for(patch, edge, *reference_on(patch))
    return abs(_moved(PointLoad(patch.a / 2, patch.b / 2), basis, compliance_of(plate, edge)))


def _moved(load: Load, basis: Basis, compliance: Compliance) -> float:
    """How far the skin moves in m where the load presses."""
    return float(basis.at(load.centre()[None])[0] @ compliance(load.modal(basis)).ravel())


def _placed(load: Load, was: Patch, patch: Patch) -> PointLoad | LineLoad:
    """The load at the same shares of the sides of `patch`, or nearer to its middle."""
    ends = [[load.x0, load.y0], [load.x1, load.y1]] if isinstance(load, LineLoad) else load.centre()
    shares = np.reshape(ends, (-1, 2)) / (was.a, was.b) - 0.5
    places = [(0.5 + s * shares) * (patch.a, patch.b) for s in np.linspace(1.0, 0.0, 11)]
    place = next(p for p in places if patch.contains(p).all())
    return (
        LineLoad(*place.ravel().tolist())
        if isinstance(load, LineLoad)
        else PointLoad(*place[0].tolist())
    )


@lru_cache(len(LOAD_CASES) * _REMEMBERED)
def ready(case: str, plate: Plate, edge: str) -> tuple[Stimulus, ...]:
    """What touches the skin in a ready scene; on another skin, at the same shares of its sides.

    What moves by W on the patch of side L moves by W s there, whose shorter side is s L: the slopes
    stay as they are. It moves less where it would bend so much that elements stand on a rail.
    """
    paper = load_scene(case)
    compliance, patch = compliance_of(plate, edge), plate.patch
    if (plate, edge) == (paper.plate, paper.edge):
        return paper.stimuli
    was = paper.plate.patch
    size = min(patch.a / was.a, patch.b / was.b)
    moved = _moved(paper.loads[0], paper.basis, compliance_of(paper.plate, paper.edge))
    load = _placed(paper.loads[0], was, patch)
    basis = basis_for(patch, edge, *reference_on(patch))
    gives = abs(_moved(load, basis, compliance))
    if not gives > _LEAST:
        raise Refusal(
            f"the skin does not move where the load presses, at {load.centre()} m: expected it "
            "further inside; choose a free load and drag it there"
        )
    load = load.scaled(size * moved / gives)
    bent = SensorLayout.regular(patch, 21, 21).curvature_operator(basis)
    most = float(np.abs(bent @ compliance(load.modal(basis)).ravel()).max())
    motion = paper.stimuli[0].motion
    if isinstance(motion, Orbit):
        motion = replace(motion, radius=motion.radius * size)
    return (Stimulus(load.scaled(min(1.0, _MOST_BENT / most)), motion),)


def dragged(
    settings: Settings, scene: Scene, x: float, y: float, grabbed_end: bool
) -> dict[str, Any]:
    """The settings that change when a load of `scene` is dragged to (x, y) in m.

    It becomes a free one of the same force. A line moves as a whole, a spread load as far as all of
    it stays on the skin, of two points the one that was grabbed.
    """
    if not scene.loads:
        return {}  # it lies on a cylinder
    patch, load = scene.plate.patch, scene.loads[0]
    x, y = _inside(patch, x, y)
    if settings.load_case == "two-points":
        return {"x_end": x, "y_end": y} if grabbed_end else {"x": x, "y": y}
    kept = {} if settings.load_case in FREE_CASES else {"force": load.force}
    if settings.load_case in SPREAD_CASES:
        return {"x": x, "y": y} | whole_on(replace(settings, x=x, y=y), patch)
    if not isinstance(load, LineLoad):
        return {"load_case": "point", "x": x, "y": y, **kept}
    half_x, half_y = (load.x1 - load.x0) / 2, (load.y1 - load.y0) / 2
    x = min(max(x, abs(half_x)), patch.a - abs(half_x))
    y = min(max(y, abs(half_y)), patch.b - abs(half_y))
    ends = {"x": x - half_x, "y": y - half_y, "x_end": x + half_x, "y_end": y + half_y}
    if not patch.contains(np.reshape(list(ends.values()), (2, 2))).all():
        return {}
    return {"load_case": "free-line", **ends, **kept}


def whole_on(settings: Settings, patch: Patch) -> dict[str, float]:
    """Where a free load is to be so that all of it is on `patch`; nothing where it is already.

    As near as can be to where it is asked for, and in the middle where even there it is too large.
    """
    s = settings
    if s.load_case in TWO_ENDED:
        end = whole_on(replace(s, load_case="point", x=s.x_end, y=s.y_end), patch)
        moved = {f"{name}_end": value for name, value in end.items()}
        return whole_on(replace(s, load_case="point"), patch) | moved
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
    """How far a free load of one place presses from it along x and y, in m."""
    s = settings
    if s.load_case == "rectangle":
        return s.size / 2, s.size_y / 2
    times = {"disc": 1.0, "gaussian": _TAIL}.get(s.load_case, 0.0)
    return times * s.size, times * s.size


def _share_on(settings: Settings, patch: Patch, middle: Array, away: Array) -> float:
    """The share of the way from the middle that still has all of the load on `patch`."""
    least, most = 0.0, 1.0
    for _ in range(_HALVINGS):
        share = (least + most) / 2
        there = _lies_on(settings, patch, middle + share * away)
        least, most = (share, most) if there else (least, share)
    return least


def _lies_on(settings: Settings, patch: Patch, place: Array) -> bool:
    """Whether all of the free load is on `patch` when it is at `place` (2,) in m."""
    x, y = place.tolist()
    try:
        for load in free_loads(replace(settings, x=x, y=y)):
            load.check(patch)
    except Refusal:
        return False
    return True


def _inside(patch: Patch, x: float, y: float) -> tuple[float, float]:
    """The place nearest to (x, y) in m a little inside the rim."""
    middle = np.array([patch.a, patch.b]) / 2
    x, y = np.clip([x, y], 2 * _MARGIN * middle, 2 * (1 - _MARGIN) * middle)
    if patch.depth(np.array([[x, y]]))[0] < 0.99 * _MARGIN * min(patch.a, patch.b):
        x, y = middle + (1 - 2 * _MARGIN) * (np.array(patch.inward(x, y)) - middle)
    return float(x), float(y)


_POINTS = 41  # of every footprint, so that one line on the skin can be any of them
_CORNERS = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]) / 2


def footprint(load: Load) -> Array | None:
    """Positions (41, 2) in m along a line load, or round a spread one; None of a point.

    A Gaussian is drawn two standard deviations wide: 86 % of its force press inside.
    """
    along = np.linspace(0, 1, _POINTS)
    if isinstance(load, LineLoad):
        ends = np.array([(load.x0, load.y0), (load.x1, load.y1)])
        return _between(along, ends)
    if isinstance(load, RectangleLoad):
        corners = load.centre() + _CORNERS * (load.width, load.height)
        return _between(4 * along, corners)
    if isinstance(load, DiscLoad | GaussianLoad):
        radius = load.radius if isinstance(load, DiscLoad) else 2 * load.sd
        turn = 2 * np.pi * along
        return load.centre() + radius * np.column_stack([np.cos(turn), np.sin(turn)])
    return None


def _between(at: Array, corners: Array) -> Array:
    """Where the line through `corners` (k, 2) is when the corners are passed at 0, 1, 2, ..."""
    passed = np.arange(len(corners))
    return np.column_stack([np.interp(at, passed, corners[:, axis]) for axis in (0, 1)])


_DEEPEST = 0.2  # of the skin's shorter side
_LEAST_FORCE = 0.01  # of the hardest press that a hand can do: lighter is no touch


class DrawnStimulus(NamedTuple):
    """The `number` of a stimulus of the scene, and the `load` that it is drawn as."""

    number: int
    load: Load


def touches_at(scene: Scene, time: float) -> list[DrawnStimulus]:
    """What presses at `time` in s; a rigid object as a point that has its force, or 1 N."""
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
    """A touch of a `scene` that was grabbed `at` (x, y) in m; so far it moved `by` so much.

    And presses so many `times` as hard, between limits that keep the skin in the picture.
    """

    scene: Scene
    number: int
    at: tuple[float, float]
    by: tuple[float, float] = (0.0, 0.0)
    times: float = 1.0

    @classmethod
    def at_place(cls, scene: Scene, time: float, x: float, y: float) -> "GrabbedStimulus | None":
        """The touch nearest to (x, y) in m at `time` in s, if there is one."""
        there = touches_at(scene, time)
        if not there:
            return None
        near = min(there, key=lambda touch: math.dist(touch.load.centre(), (x, y)))
        return cls(scene, near.number, (x, y))

    @property
    def moved(self) -> bool:
        return self.by != (0.0, 0.0) or self.times != 1.0

    def moved_to(self, x: float, y: float) -> Scene:
        """The scene with the touch moved to (x, y) in m, or as near as it was last allowed."""
        by = x - self.at[0], y - self.at[1]
        try:
            scene = self._moved(by)
        except Refusal:  # over the rim
            return self._moved(self.by)
        self.by = by
        return scene

    def pressed(self, times: float) -> Scene:
        """The scene with the touch pressing so many `times` as hard as when it was grabbed."""
        what = self.scene.stimuli[self.number].what
        most = most_times(self.scene, what)
        self.times = min(max(times, min(_LEAST_FORCE * most, 1.0)), max(most, 1.0))
        return self._moved(self.by)

    def _moved(self, by: tuple[float, float]) -> Scene:
        stimuli = list(self.scene.stimuli)
        stimuli[self.number] = harder(_shifted(stimuli[self.number], *by), self.times)
        moved = replace(self.scene, stimuli=tuple(stimuli))
        if moved.indenter is not None:
            _check_inside(moved, moved.indenter)
        return moved


def _shifted(stimulus: Stimulus, dx: float, dy: float) -> Stimulus:
    what = stimulus.what
    if isinstance(what, Indenter):
        return replace(stimulus, what=replace(what, x=what.x + dx, y=what.y + dy))
    return replace(stimulus, what=what.shifted(dx, dy))


def harder(stimulus: Stimulus, times: float) -> Stimulus:
    """The stimulus with its force or depth so many `times` as large."""
    what = stimulus.what
    if not isinstance(what, Indenter):
        return replace(stimulus, what=what.scaled(times))
    if what.force is not None:
        return replace(stimulus, what=replace(what, force=what.force * times))
    return replace(stimulus, what=replace(what, depth=(what.depth or 0.0) * times))


def most_times(scene: Scene, what: Load | Indenter) -> float:
    """How many times as hard `what` may press until the skin's middle would be a fifth deep.

    A fifth of its shorter side, under a point load.
    """
    patch = scene.plate.patch
    deepest = _DEEPEST * min(patch.a, patch.b)
    if isinstance(what, Indenter) and what.force is None:
        return deepest / (what.depth or deepest)
    gives = yielding(scene.plate, scene.edge)
    return deepest / (abs(what.force or 1.0) * gives) if gives > 0 else 1.0


def _check_inside(scene: Scene, stimulus: Stimulus) -> None:
    """Refuse a rigid object whose middle leaves the skin on its way."""
    moments = stimulus.motion.moments if stimulus.motion else [0.0]
    for time in moments:
        pose, what = stimulus.pose_at(time), stimulus.what
        if isinstance(what, Indenter):
            PointLoad(what.x + pose.dx, what.y + pose.dy, 1.0).check(scene.plate.patch)


def may_choose(scene: Scene) -> bool:
    """Whether another object can take the place of what touches: one alone, and at rest.

    A strip is alike along y, as only a load can be.
    """
    alone = len(scene.stimuli) == 1 and not scene.moves
    return alone and not scene.plate.patch.strip
