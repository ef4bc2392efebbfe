"""What touches a skin, a load or a rigid object, and how it moves."""

import math
from dataclasses import dataclass

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics import Indentation, Load, Press, RigidObject
from kappaskin.scene.motion import Motion, Pose


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

    def into(self, press: Press, pose: Pose, after: Indentation | None) -> Indentation:
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

    def load_at(self, time: float) -> Load | None:
        """The load at `time` in s; None when it is lifted, or no load."""
        if isinstance(self.what, Indenter):
            return None
        pose = self.pose_at(time)
        if not pose.amount:
            return None
        load = self.what.shifted(pose.dx, pose.dy)
        return load if pose.amount == 1 else load.scaled(pose.amount)


def contact_of(loads: tuple[Load, ...]) -> Array:
    """The centre of force (2,) in m of `loads`; NaN when there is none."""
    total = sum(abs(load.force) for load in loads)
    if len(loads) == 1 and total:
        return loads[0].centre()
    if not total:
        return np.full(2, np.nan)
    return np.sum([abs(load.force) * load.centre() for load in loads], axis=0) / total
