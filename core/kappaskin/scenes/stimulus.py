"""Stimuli: loads and rigid objects on a skin, and their motion."""

import math
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate
from typing import Protocol

import numpy as np

from kappaskin._schema import Within
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
from kappaskin.skin import Patch

_SECONDS = Within(1e-6, 1e9, "s")
_AMOUNT = Within(0, 1000)
_MOST_STEPS = 1000
_MOST_POSES = 20_000  # a minute at some 300 a second


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a touch is, `dx` and `dy` in m from its place, and the `amount` of its force or depth.

    `turn` in rad is about the skin's normal.
    """

    dx: float = 0.0
    dy: float = 0.0
    amount: float = 1.0
    turn: float = 0.0


class Motion(Protocol):
    """What a touch does in the course of time."""

    @property
    def duration(self) -> float:
        """Seconds after which it repeats."""
        ...

    @property
    def moments(self) -> list[float]:
        """Times in s, from zero to `duration`, at which it sets out, arrives or presses hardest."""
        ...

    def at(self, time: float) -> Pose:
        """The pose at `time` in s."""
        ...


@dataclass(frozen=True)
class Orbit:
    """A motion in a circle by `radius` m, once every `period` s."""

    radius: float
    period: float

    def __post_init__(self) -> None:
        if not (0 <= self.radius < math.inf and self.period in _SECONDS):
            raise Refusal(f"expected a radius >= 0 m and a period of {_SECONDS}, got {self}")

    @property
    def duration(self) -> float:
        return self.period

    @property
    def moments(self) -> list[float]:
        return [self.period * q / 4 for q in range(4)]

    def at(self, time: float) -> Pose:
        angle = 2 * math.pi * time / self.period
        return Pose(self.radius * math.cos(angle), self.radius * math.sin(angle))


EASES: dict[str, Callable[[float], float]] = {
    # Begins and ends at rest without a jerk: speed and acceleration are zero there. Rounding alone
    # would take it beyond its end, and what is lifted to less than no force.
    "smooth": lambda s: min(s**3 * (10 + s * (6 * s - 15)), 1.0),
    "linear": lambda s: s,
}
"""How a step goes from its beginning to its end, as shares of both; the usual one first."""


@dataclass(frozen=True)
class MotionStep(ABC):
    """One part of a path, of so many `seconds`, along which it eases as `ease` says."""

    seconds: float
    ease: str = "smooth"

    def __post_init__(self) -> None:
        if self.seconds not in _SECONDS:
            raise Refusal(f"expected a step that takes {_SECONDS}, got {self.seconds:g} s")
        if self.ease not in EASES:
            raise Refusal(f"expected an ease among {', '.join(EASES)}, got {self.ease!r}")

    @property
    def moments(self) -> list[float]:
        """Times in s after its beginning at which it presses hardest or is over."""
        return [self.seconds]

    @abstractmethod
    def end(self, pose: Pose) -> Pose:
        """The pose it leads to from `pose`."""

    def at(self, pose: Pose, time: float) -> Pose:
        """The pose `time` s after it began at `pose`."""
        s, end = EASES[self.ease](min(max(time / self.seconds, 0.0), 1.0)), self.end(pose)
        return Pose(
            pose.dx + s * (end.dx - pose.dx),
            pose.dy + s * (end.dy - pose.dy),
            pose.amount + s * (end.amount - pose.amount),
            pose.turn + s * (end.turn - pose.turn),
        )


@dataclass(frozen=True)
class PressStep(MotionStep):
    """Press until the whole force or depth is reached, or the share `to` of it."""

    to: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.to not in _AMOUNT:
            raise Refusal(f"expected a share of {_AMOUNT} to press to, got {self.to:g}")

    def end(self, pose: Pose) -> Pose:
        return replace(pose, amount=self.to)


@dataclass(frozen=True)
class HoldStep(MotionStep):
    """Stay."""

    def end(self, pose: Pose) -> Pose:
        return pose


@dataclass(frozen=True)
class ReleaseStep(MotionStep):
    """Lift until nothing presses any more."""

    def end(self, pose: Pose) -> Pose:
        return replace(pose, amount=0.0)


@dataclass(frozen=True)
class SlideStep(MotionStep):
    """Move `by` so many m along x and y, pressing as before; what rolls moves so too."""

    by: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not all(map(math.isfinite, self.by)):
            raise Refusal(f"expected a finite distance (dx, dy) in m to slide, got {self.by}")

    def end(self, pose: Pose) -> Pose:
        return replace(pose, dx=pose.dx + self.by[0], dy=pose.dy + self.by[1])


@dataclass(frozen=True)
class TurnStep(MotionStep):
    """Turn `by` so many rad about the skin's normal, pressing as before."""

    by: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not math.isfinite(self.by):
            raise Refusal(f"expected a finite angle in rad to turn, got {self.by}")

    def end(self, pose: Pose) -> Pose:
        return replace(pose, turn=pose.turn + self.by)


@dataclass(frozen=True)
class TapStep(MotionStep):
    """Press and lift again so many `times`; between two taps nothing presses for as long."""

    times: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.times <= 1000:
            raise Refusal(f"expected 1 to 1000 taps, got {self.times}")

    @property
    def moments(self) -> list[float]:
        return [self.seconds / (4 * self.times - 2), self.seconds]  # all taps are like the first

    def end(self, pose: Pose) -> Pose:
        return replace(pose, amount=0.0)

    def at(self, pose: Pose, time: float) -> Pose:
        phase = min(max(time / self.seconds, 0.0), 1.0) * (2 * self.times - 1)
        down = math.sin(math.pi * phase) ** 2 if int(phase) % 2 == 0 else 0.0
        return replace(pose, amount=down)


@dataclass(frozen=True)
class MotionPath:
    """Steps one after the other, from a touch that is lifted; then again from the beginning.

    It has to end where it began or lifted, so that nothing jumps.
    """

    steps: tuple[MotionStep, ...]

    def __post_init__(self) -> None:
        if not 1 <= len(self.steps) <= _MOST_STEPS:
            raise Refusal(
                f"expected a path of at least one step and {_MOST_STEPS} at most, got "
                f"{len(self.steps) or 'none'}; use a recorded motion for more"
            )
        first, last = self._poses[0], self._poses[-1]
        if last.amount and last != first:
            raise Refusal(
                f"expected a path that ends lifted or at its start, got an end {last.dx:g} and "
                f"{last.dy:g} m away with {last.amount:g} of the load; end with a release"
            )

    @cached_property
    def _ends(self) -> list[float]:
        return list(accumulate(step.seconds for step in self.steps))

    @cached_property
    def _poses(self) -> list[Pose]:
        """Where each step begins, and where the last one ends."""
        return list(
            accumulate(self.steps, lambda pose, step: step.end(pose), initial=Pose(amount=0.0))
        )

    @property
    def duration(self) -> float:
        return self._ends[-1]

    @property
    def moments(self) -> list[float]:
        began = [0.0, *self._ends]
        each = zip(began, self.steps, strict=False)
        return [0.0, *(start + time for start, step in each for time in step.moments)]

    def at(self, time: float) -> Pose:
        time %= self.duration
        k = min(bisect_right(self._ends, time), len(self.steps) - 1)
        began = self._ends[k - 1] if k else 0.0
        return self.steps[k].at(self._poses[k], time - began)


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """What was recorded: `poses` (T, 3) of dx and dy in m and the amount at `times` (T,) in s.

    It is straight between them, and begins anew after the last one.
    """

    times: Array
    poses: Array

    def __post_init__(self) -> None:
        t, poses = self.times, self.poses
        if not (t.ndim == 1 and len(t) > 1 and poses.shape == (len(t), 3)):
            raise Refusal(
                f"expected at least two times (T,) and poses (T, 3), got {t.shape}, {poses.shape}"
            )
        if len(t) > _MOST_POSES:
            raise Refusal(f"expected at most {_MOST_POSES} poses, got {len(t)}; use fewer")
        if not (np.isfinite(poses).all() and t[0] == 0 and (np.diff(t) > 0).all()):
            raise Refusal("expected finite poses at increasing times in s that begin with 0")
        if self.duration not in _SECONDS:
            raise Refusal(f"expected a record of {_SECONDS}, got {self.duration:g} s")
        if not (0 <= poses[:, 2].min() <= poses[:, 2].max() <= _AMOUNT.most):
            raise Refusal(
                f"expected amounts of {_AMOUNT}, got {poses[:, 2].min():g} to "
                f"{poses[:, 2].max():g}; they are shares of the force or depth"
            )

    @property
    def duration(self) -> float:
        return float(self.times[-1])

    @property
    def moments(self) -> list[float]:
        return [*self.times[:-1].tolist(), math.nextafter(self.duration, 0.0)]  # then it is anew

    def at(self, time: float) -> Pose:
        time %= self.duration
        dx, dy, amount = (float(np.interp(time, self.times, self.poses[:, k])) for k in range(3))
        return Pose(dx, dy, amount)


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
                f"expected either a force in N or a depth in m for an object, got {self.force} "
                f"and {self.depth}"
            )
        for value, what in ((self.force, "a force in N"), (self.depth, "a depth in m")):
            if value is not None and not 0 < value < math.inf:
                raise Refusal(f"expected {what} above zero for an object, got {value}")
        if not all(map(math.isfinite, (self.x, self.y, self.turn))):
            raise Refusal(
                f"expected a finite position in m and angle in rad, got ({self.x}, {self.y}) and "
                f"{self.turn}"
            )

    def check(self, patch: Patch, pose: Pose) -> None:
        """Refuse an object that at `pose` is outside the skin or entirely through it."""
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
        """Refuse an object that would press at `pose` where there is no skin below."""
        self.check(patch, pose)
        place = np.array([self.x + pose.dx, self.y + pose.dy])
        over = patch.moves(place[None])[0]  # the usual case, and cheap
        if not over and not PlacedObject(self.rigid, place, self.turn + pose.turn).meets(patch):
            raise self._missing(patch, pose)

    def _missing(self, patch: Patch, pose: Pose) -> Refusal:
        return Refusal(
            f"expected an object over the {patch.name}, got {self.rigid} at "
            f"({self.x + pose.dx:g}, {self.y + pose.dy:g}) m, which misses it; positions are in "
            "metres from the corner x = y = 0"
        )

    def into(self, press: IndentationSolver, pose: Pose, after: Indentation | None) -> Indentation:
        """The contact with the skin at `pose`; the search starts `after` another one."""
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
            if plate.stretches and self.what.depth is not None:
                raise Refusal(
                    "expected a force in N for an object on a flat skin of known thickness, got a "
                    f"depth of {self.what.depth:g} m, which is computed only for a skin that does "
                    "not stretch; give the force, or omit the thickness"
                )
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
