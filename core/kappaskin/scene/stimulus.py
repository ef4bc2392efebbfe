"""What touches a skin: a load, and how it moves."""

from dataclasses import dataclass

import numpy as np

from kappaskin.frames import Array
from kappaskin.mechanics import Load
from kappaskin.scene.motion import Motion


@dataclass(frozen=True)
class Stimulus:
    """A `load` that moves and presses as `motion` says; without one it rests where it is."""

    load: Load
    motion: Motion | None = None

    def load_at(self, time: float) -> Load | None:
        """The load at `time` in s; None when it is lifted."""
        if self.motion is None:
            return self.load
        pose = self.motion.at(time)
        if not pose.amount:
            return None
        return self.load.shifted(pose.dx, pose.dy).scaled(pose.amount)


def contact_of(loads: tuple[Load, ...]) -> Array:
    """The centre of force (2,) in m of `loads`; NaN when there is none."""
    total = sum(abs(load.force) for load in loads)
    if not total:
        return np.full(2, np.nan)
    return np.sum([abs(load.force) * load.centre() for load in loads], axis=0) / total
