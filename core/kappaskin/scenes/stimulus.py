"""What touches a skin, a load or a rigid object, and how it moves."""

import math
from dataclasses import dataclass

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics import (
    Indentation,
    IndentationSolver,
    Load,
    PlacedObject,
    Plate,
    RigidObject,
)
from kappaskin.scenes.motion import Motion, Pose
from kappaskin.skin import Patch

_PLACES = 48  # along a motion at which it is on a skin whose rim is round, or has inward corners


@dataclass(frozen=True)
class Indenter:
    """A rigid object at (x, y) in m that is pressed in, by `force` in N or to `depth` in m.

    It is turned by `turn` in rad about the skin's normal, from x to y.
    """

    rigid: RigidObject
    x: float
    y: float
    force: float | None = None
    depth: float | None = None
    turn: float = 0.0

    def __post_init__(self) -> None:
        if (self.force is None) == (self.depth is None):
            raise Refusal(
                f"expected a force in N or a depth in m to press an object by, got {self.force} "
                f"and {self.depth}"
            )
        for value, what in ((self.force, "a force in N"), (self.depth, "a depth in m")):
            if value is not None and not 0 < value < math.inf:
                raise Refusal(f"expected {what} above zero to press an object by, got {value}")
        if not all(map(math.isfinite, (self.x, self.y, self.turn))):
            raise Refusal(
                f"expected a finite place in m and turn in rad, got ({self.x}, {self.y}) and "
                f"{self.turn}"
            )

    def check(self, patch: Patch, pose: Pose) -> None:
        """Refuse an object that, standing as `pose` says, is beside the skin or all through it."""
        reach, x, y = math.hypot(*self.rigid.extent), self.x + pose.dx, self.y + pose.dy
        if not (-reach <= x <= patch.a + reach and -reach <= y <= patch.b + reach):
            raise self._missing(patch, pose)
        deepest = min(patch.a, patch.b)
        if (depth := (self.depth or 0.0) * pose.amount) > deepest:
            raise Refusal(
                f"expected a depth of at most {deepest:g} m, the skin's shorter side, got "
                f"{depth:g}; depths are in metres"
            )

    def check_pressing(self, patch: Patch, pose: Pose) -> None:
        """Refuse an object that is to press as `pose` says where nothing of the skin is below."""
        self.check(patch, pose)
        place = np.array([self.x + pose.dx, self.y + pose.dy])
        over = patch.moves(place[None])[0]  # the usual, and quickly told
        if not over and not PlacedObject(self.rigid, place, self.turn + pose.turn).meets(patch):
            raise self._missing(patch, pose)

    def _missing(self, patch: Patch, pose: Pose) -> Refusal:
        return Refusal(
            f"expected an object over the {patch.name}, got {self.rigid} at "
            f"({self.x + pose.dx:g}, {self.y + pose.dy:g}) m, which misses it; positions are in "
            "metres from the corner x = y = 0"
        )

    def into(self, press: IndentationSolver, pose: Pose, after: Indentation | None) -> Indentation:
        """What it does to the skin when it stands as `pose` says; `after` starts the search."""
        return press(
            self.rigid,
            self.x + pose.dx,
            self.y + pose.dy,
            self.turn + pose.turn,
            depth=None if self.depth is None else self.depth * pose.amount,
            force=None if self.force is None else self.force * pose.amount,
            after=after,
        )


@dataclass(frozen=True)
class Stimulus:
    """What touches the skin, moving and pressing as `motion` says; without one it rests there."""

    what: Load | Indenter
    motion: Motion | None = None

    def pose_at(self, time: float) -> Pose:
        return Pose() if self.motion is None else self.motion.at(time)

    def check(self, plate: Plate) -> None:
        """Refuse what does not touch `plate`, at rest or wherever it presses while it moves."""
        poses = _poses(self.motion, plate.patch) if self.motion else []
        if isinstance(self.what, Indenter):
            self.what.check(plate.patch, Pose())
            for pose in poses if self.motion else [Pose()]:
                if pose.amount:
                    self.what.check_pressing(plate.patch, pose)
            return
        plate.check(self.what)
        for pose in poses:
            if pose.amount:
                plate.check(self._posed(self.what, pose))

    @staticmethod
    def _posed(load: Load, pose: Pose) -> Load:
        moved = load.shifted(pose.dx, pose.dy)
        return moved if pose.amount == 1 else moved.scaled(pose.amount)

    def load_at(self, time: float) -> Load | None:
        """The load at `time` in s; None when it is lifted, or no load."""
        if isinstance(self.what, Indenter):
            return None
        pose = self.pose_at(time)
        return self._posed(self.what, pose) if pose.amount else None


def _poses(motion: Motion, patch: Patch) -> list[Pose]:
    """Those by which it shows whether `motion` leaves `patch`; a rectangle at its moments alone."""
    times = np.array([*motion.moments, motion.duration])
    parts = 1 if type(patch) is Patch else math.ceil(_PLACES / len(times))
    each = np.interp(np.arange((len(times) - 1) * parts + 1) / parts, np.arange(len(times)), times)
    return [motion.at(time) for time in each.tolist()]


def contact_of(loads: tuple[Load, ...]) -> Array:
    """The centre of force (2,) in m of `loads`; NaN when there is none."""
    if len(loads) == 1 and loads[0].force:
        return loads[0].centre()
    total = sum(abs(load.force) for load in loads)
    if not total:
        return np.full(2, np.nan)
    return np.sum([abs(load.force) * load.centre() for load in loads], axis=0) / total
