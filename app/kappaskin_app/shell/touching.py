"""Stimuli of a scene as they are drawn, grabbed and dragged in the view."""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

from kappaskin.errors import Refusal
from kappaskin.mechanics import Load, PointLoad
from kappaskin.scenes import Indenter, Scene, Stimulus
from kappaskin_app.shell.loads import yielding

_DEEPEST = 0.2  # of the skin's shorter side
_LEAST = 0.01  # of the hardest press that a hand can do: lighter is no touch


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
        self.times = min(max(times, min(_LEAST * most, 1.0)), max(most, 1.0))
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
