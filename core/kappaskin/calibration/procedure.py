"""Frames taken step by step to a sweep: what every channel read on every cylinder."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import Refusal
from kappaskin.frames import COMPONENTS, Array
from kappaskin.scenes import CylinderStep, applied_curvature, check_readable, check_strain
from kappaskin.sensing import Sensor

_FEWEST_FRAMES = 2  # whose spread tells the noise
_SETTLED = 1.0  # s at the end of a hold that count as its reading
_KEPT = 500  # moments that are kept of a hold


@dataclass(frozen=True, eq=False)
class Taken:
    """What came of one step: `mean` and `noise` (C,) in 1/m of `frames` frames, at `time` in s.

    NaN marks a channel that was dead or on a rail in any of them. Of a hold, `moments` (T,) in s
    and what was read then, `course` (T, C) in 1/m, tell how it went.
    """

    step: CylinderStep
    mean: Array
    noise: Array
    frames: int
    time: float
    moments: Array
    course: Array

    def __str__(self) -> str:
        """The median channel of each component beside the curvature of the step."""
        mean, noise = (values.reshape(3, -1) for values in (self.mean, self.noise))
        told = [
            f"{name} {_median(mean[c]):+.1f} (cylinder {self.step.curvature[c]:+.1f})"
            for c, name in enumerate(COMPONENTS)
        ]
        missing = int(np.isnan(self.mean).sum())
        return (
            f"{', '.join(told)} 1/m, noise {_median(noise.ravel()):.2g} 1/m in {self.frames} frames"
            + (f"; {missing} channels dead or on a rail" if missing else "")
        )


def _median(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else math.nan


@dataclass(frozen=True, eq=False)
class Sweep:
    """What a skin read on every step of a calibration.

    `readings` (S, C) are nominal curvature in 1/m (Eq. 8), NaN where dead or on a rail; `noise`
    (S, C) in 1/m is the standard deviation of one frame; `times` (S,) in s. `moments` (T,) and
    `course` (T, C) tell how the hold went, and are empty without one.
    """

    steps: tuple[CylinderStep, ...]
    readings: Array
    noise: Array
    times: Array
    moments: Array
    course: Array

    def __post_init__(self) -> None:
        S, C = len(self.steps), self.readings.shape[-1]
        shapes = (self.readings.shape, self.noise.shape, self.times.shape)
        if shapes != ((S, C), (S, C), (S,)) or self.course.shape != (len(self.moments), C):
            raise Refusal(
                f"expected readings and noise ({S}, C), times ({S},) and a course (T, C) for {S} "
                f"steps, got {shapes} and {self.course.shape}"
            )
        parts = (self.readings, self.noise, self.times, self.course)
        if any(np.isinf(part).any() for part in parts) or np.isnan(self.times).any():
            raise Refusal("expected finite readings, or NaN for those on a rail; got infinity")

    @property
    def curvature(self) -> Array:
        """The curvature (S, 3) in 1/m of every step."""
        return applied_curvature(self.steps)


class Procedure:
    """A calibration being taken: knows the next step, takes its frames, goes back if asked."""

    def __init__(self, sensor: Sensor, steps: tuple[CylinderStep, ...]) -> None:
        check_strain(steps, sensor)
        check_readable(steps, sensor)
        self.sensor, self.steps = sensor, steps
        self.taken: list[Taken] = []

    @property
    def step(self) -> CylinderStep | None:
        """What to lay the skin on now; None when all is done."""
        return None if self.done else self.steps[len(self.taken)]

    @property
    def done(self) -> bool:
        return len(self.taken) == len(self.steps)

    def take(self, times: Array, readings: Array) -> Taken:
        """Take the present step's frames and go on to the next.

        `times` (n,) are device times in s, `readings` (n, C) nominal curvature in 1/m, NaN where
        dead or on a rail. A refusal leaves the step as it is.
        """
        step = self.step
        if step is None:
            raise Refusal("every step is done; go back one to take it again")
        self._check(step, times, readings)
        late = times >= times[-1] - _SETTLED if step.hold else np.ones(len(times), bool)
        if np.count_nonzero(late) < _FEWEST_FRAMES:
            late[-_FEWEST_FRAMES:] = True
        read = readings[late]
        held = (
            _course(times, readings) if step.hold else (np.empty(0), np.empty((0, read.shape[1])))
        )
        taken = Taken(
            step, read.mean(axis=0), read.std(axis=0, ddof=1), len(read), times[late].mean(), *held
        )
        self.taken.append(taken)
        return taken

    def _check(self, step: CylinderStep, times: Array, readings: Array) -> None:
        n, C = len(times), self.sensor.channels
        if times.ndim != 1 or readings.shape != (n, C):
            raise Refusal(f"expected readings ({n}, {C}), got {readings.shape}")
        if n < _FEWEST_FRAMES:
            raise Refusal(
                f"expected at least {_FEWEST_FRAMES} frames on step {step.number}, got {n}"
            )
        if np.isinf(readings).any() or not np.isfinite(times).all():
            raise Refusal(f"expected finite readings and times on step {step.number}")
        before = self.taken[-1].time if self.taken else -math.inf
        if not (np.diff(times, prepend=before) >= 0).all():
            raise Refusal(
                f"the device's clock went back on step {step.number}: it restarted; begin anew"
            )
        if np.isnan(readings).any(axis=0).all():
            raise Refusal(
                f"on step {step.number} every channel is dead or on a rail ({step}); lower the "
                "amplifier's gain, or leave out the smallest cylinders"
            )

    def redo(self) -> None:
        """Go back by one step."""
        if not self.taken:
            raise Refusal("there is no step to take again: this is the first")
        self.taken.pop()

    def sweep(self) -> Sweep:
        """All that was read, once every step is done."""
        if not self.done:
            raise Refusal(f"{len(self.steps) - len(self.taken)} steps are still to be taken")
        return Sweep(
            self.steps,
            np.stack([taken.mean for taken in self.taken]),
            np.stack([taken.noise for taken in self.taken]),
            np.array([taken.time for taken in self.taken]),
            np.concatenate([taken.moments for taken in self.taken]),
            np.concatenate([taken.course for taken in self.taken]),
        )


def _course(times: Array, readings: Array) -> tuple[Array, Array]:
    """The means of at most `_KEPT` groups of frames that follow one another."""
    starts: NDArray[np.intp] = np.unique(
        np.linspace(0, len(times), _KEPT, endpoint=False).astype(int)
    )
    sizes = np.diff(starts, append=len(times))
    sums = np.add.reduceat(readings, starts, axis=0)
    return np.add.reduceat(times, starts) / sizes, sums / sizes[:, None]
