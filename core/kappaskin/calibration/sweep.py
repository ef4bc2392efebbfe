"""Calibration sweep: the readings of every channel on every cylinder."""

import math
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import Refusal, SourceError
from kappaskin.frames import COMPONENTS, OVERTAKEN, Array, Frame
from kappaskin.scenes import Scene, load_scene
from kappaskin.scenes.cylinders import (
    ADVICE,
    CylinderStep,
    Presentation,
    applied_curvature,
    check_readable,
    check_strain,
    radii_for,
    schedule,
)
from kappaskin.sensing import Sensor
from kappaskin.sources import SimulatedSource, Source, VirtualClock, open_source

_FEWEST_FRAMES = 2  # whose spread gives the noise
_SETTLED = 1.0  # s at the end of a hold that count as its reading
_COURSE_POINTS = 500  # moments that are kept of a hold

_READ = 0.05  # s that one read may wait
_SILENCE = 5.0  # s without a frame after which the source counts as dead
_BEHIND = 1.0  # s that frames may be read late
_MOST_FRAMES = 5000  # kept of one step, evenly: more add nothing
LONGEST = 3600.0  # s on one step
Report = Callable[[str], None]
Prompt = Callable[[str], str]
"""A question to the answer that was typed."""


@dataclass(frozen=True, eq=False)
class StepReadings:
    """The readings of one step: `mean` and `noise` (C,) in 1/m of `frames` frames, at `time` in s.

    NaN marks a channel that was dead or on a rail in any of them. `moments` (T,) in s and `course`
    (T, C) in 1/m are the times and readings during a hold.
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
        parts = [
            f"{name} {_median(mean[c]):+.1f} (cylinder {self.step.curvature[c]:+.1f})"
            for c, name in enumerate(COMPONENTS)
        ]
        missing = int(np.isnan(self.mean).sum())
        return (
            f"{', '.join(parts)} 1/m, noise {_median(noise.ravel()):.2g} 1/m in "
            f"{self.frames} frames" + (f"; {missing} channels dead or saturated" if missing else "")
        )


def _median(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else math.nan


@dataclass(frozen=True, eq=False)
class Sweep:
    """The readings of a skin on every step of a calibration.

    `readings` (S, C) are nominal curvature in 1/m (Eq. 8), NaN where dead or on a rail; `noise`
    (S, C) in 1/m is the standard deviation of one frame; `times` (S,) in s. `moments` (T,) and
    `course` (T, C) are the times and readings during the hold, and are empty without one.
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
                f"expected readings and noise ({S}, C), times ({S},) and a hold (T, C) for {S} "
                f"steps, got {shapes} and {self.course.shape}"
            )
        parts = (self.readings, self.noise, self.times, self.course)
        if any(np.isinf(part).any() for part in parts) or np.isnan(self.times).any():
            raise Refusal("expected finite readings, or NaN for saturated ones; got infinity")

    @property
    def curvature(self) -> Array:
        """The curvature (S, 3) in 1/m of every step."""
        return applied_curvature(self.steps)


class Procedure:
    """A calibration in progress: the next step, and the readings of those before it."""

    def __init__(self, sensor: Sensor, steps: tuple[CylinderStep, ...]) -> None:
        sensor.layout.check_curvature_sensor("a calibration with cylinders")
        check_strain(steps, sensor)
        check_readable(steps, sensor)
        self.sensor, self.steps = sensor, steps
        self.taken: list[StepReadings] = []

    @property
    def step(self) -> CylinderStep | None:
        """What to lay the skin on now; None when all is done."""
        return None if self.done else self.steps[len(self.taken)]

    @property
    def done(self) -> bool:
        return len(self.taken) == len(self.steps)

    def take(self, times: Array, readings: Array) -> StepReadings:
        """Take the present step's frames and go on to the next.

        `times` (n,) are device times in s, `readings` (n, C) nominal curvature in 1/m, NaN where
        dead or on a rail. A refusal leaves the step as it is.
        """
        step = self.step
        if step is None:
            raise Refusal("all steps are captured; go back by one step to repeat it")
        self._check(step, times, readings)
        late = times >= times[-1] - _SETTLED if step.hold else np.ones(len(times), bool)
        if np.count_nonzero(late) < _FEWEST_FRAMES:
            late[-_FEWEST_FRAMES:] = True
        read = readings[late]
        held = (
            _course(times, readings) if step.hold else (np.empty(0), np.empty((0, read.shape[1])))
        )
        taken = StepReadings(
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
                f"the device's clock went back on step {step.number}: it restarted; start again"
            )
        if np.isnan(readings).any(axis=0).all():
            raise Refusal(
                f"on step {step.number} every channel is dead or saturated ({step}); lower the "
                "amplifier's gain, or leave out the smallest cylinders"
            )

    def redo(self) -> None:
        """Go back by one step."""
        if not self.taken:
            raise Refusal("there is no step to repeat: this is the first")
        self.taken.pop()

    def sweep(self) -> Sweep:
        """All that was read, once every step is done."""
        if not self.done:
            raise Refusal(f"{len(self.steps) - len(self.taken)} steps are not captured yet")
        return Sweep(
            self.steps,
            np.stack([taken.mean for taken in self.taken]),
            np.stack([taken.noise for taken in self.taken]),
            np.array([taken.time for taken in self.taken]),
            np.concatenate([taken.moments for taken in self.taken]),
            np.concatenate([taken.course for taken in self.taken]),
        )


def _course(times: Array, readings: Array) -> tuple[Array, Array]:
    """The means of at most `_COURSE_POINTS` groups of frames that follow one another."""
    starts: NDArray[np.intp] = np.unique(
        np.linspace(0, len(times), _COURSE_POINTS, endpoint=False).astype(int)
    )
    sizes = np.diff(starts, append=len(times))
    sums = np.add.reduceat(readings, starts, axis=0)
    return np.add.reduceat(times, starts) / sizes, sums / sizes[:, None]


def _steps(
    sensor: Sensor, radii: tuple[float, ...] | None, hold: float
) -> tuple[CylinderStep, ...]:
    return schedule(radii or radii_for(sensor), hold, sensor.layout.patch.strip)


def _laid(scene: Scene, radii: tuple[float, ...] | None, hold: float, dwell: float) -> Source:
    """The scene, laid on the cylinders as fast as it can be computed."""
    clock = VirtualClock()
    laid = Presentation(_steps(scene.sensor(), radii, hold), dwell)
    return SimulatedSource(scene.laid_on(laid), clock, clock.sleep)


class DeviceReadings:
    """The frames of one device, as nominal curvature."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._frames: list[Frame] = []
        while source.sensor is None:
            self._frames = self._read()
        self.sensor: Sensor = source.sensor

    def _read(self) -> list[Frame]:
        frames = self._source.read(_READ)
        if self._source.trouble:
            raise SourceError(self._source.trouble)
        return frames

    def frames(self) -> list[Frame]:
        """The next frames, refused when none come or another device answers."""
        found, self._frames = self._frames, []
        begun = time.monotonic()
        while not found:
            found = self._read()
            if not found and time.monotonic() - begun > _SILENCE:
                raise Refusal(f"no frame for {_SILENCE:g} s; check that the device is sending")
        if self._source.sensor is not self.sensor:
            raise Refusal("another device was connected meanwhile; start again with it")
        return found

    def read(self, frames: list[Frame]) -> tuple[Array, Array]:
        """Device times (n,) in s and readings (n, C) in 1/m."""
        readings = [self.sensor.nominal(frame) for frame in frames]
        times = np.array([frame.device_time for frame in frames])
        return times, np.array(readings).reshape(len(frames), self.sensor.channels)


def _add_frame(collected: list[Frame], frame: Frame, seconds: float) -> None:
    """Add `frame` to those `collected` of a step of so many `seconds`, unless it is too early."""
    after = frame.device_time - collected[-1].device_time if collected else math.inf
    # One that others overtook is left out; a clock that went back is refused by the procedure.
    if after >= seconds / _MOST_FRAMES or after < -OVERTAKEN:
        collected.append(frame)


def _follow(
    listener: DeviceReadings, procedure: Procedure, laid: Presentation, report: Report
) -> None:
    """Take the steps as they are presented, by the device's own clock."""
    collected: list[Frame] = []
    while not procedure.done:
        for frame in listener.frames():
            index, step = laid.index(frame.device_time), procedure.step
            if step and index == step.number and collected:
                taken = procedure.take(*listener.read(collected))
                report(f"{step.number}/{len(laid.steps)}  {step}\n    {taken}")
                collected, step = [], procedure.step
            if step is None:
                return
            if index != step.number - 1:
                raise Refusal(
                    f"step {step.number} was missed: the device is at step {index + 1}; "
                    "restart it, then run this command at once"
                )
            if laid.settled(frame.device_time):
                _add_frame(collected, frame, max(laid.dwell, step.hold))


def recorded(listener: DeviceReadings, seconds: float, virtual: bool = False) -> list[Frame]:
    """The frames of the next `seconds`: what came before was read while the skin was moved.

    On a `virtual` clock nothing was.
    """
    if virtual:
        first = listener.frames()
        collected = first[:1]
        while collected[-1].device_time < first[0].device_time + seconds:
            for frame in listener.frames():
                _add_frame(collected, frame, seconds)
        return collected
    begun = now = time.monotonic()
    collected: list[Frame] = []
    while now < begun + seconds and time.monotonic() < begun + seconds + _BEHIND:
        for frame in listener.frames():
            now = frame.host_time
            if now >= begun:
                _add_frame(collected, frame, seconds)
    return collected


def _prompt(step: CylinderStep, total: int, again: bool) -> str:
    then = "press Enter, then lay the skin on" if step.hold else "press Enter when at rest"
    redo = ", or r and Enter to repeat the last step" if again else ""
    return f"{step.number}/{total}  {step}: {then}{redo}: "


def _prompt_steps(
    listener: DeviceReadings, procedure: Procedure, seconds: float, prompt: Prompt, report: Report
) -> None:
    """Ask for each step and take it, until all are done."""
    report(ADVICE)
    while step := procedure.step:
        answer = prompt(_prompt(step, len(procedure.steps), bool(procedure.taken)))
        if answer.strip().lower() == "r" and procedure.taken:
            procedure.redo()
            continue
        frames = recorded(listener, max(seconds, step.hold))
        try:
            report(f"    {procedure.take(*listener.read(frames))}")
        except Refusal as refusal:
            report(f"    {refusal}; repeat this step")


def take_sweep(
    name: str,
    radii: tuple[float, ...] | None,
    prompt: Prompt,
    report: Report,
    *,
    seconds: float = 1.0,
    hold: float = 0.0,
    dwell: float | None = None,
    trust: bool = False,
) -> tuple[Sensor, Sweep]:
    """The sensor of the source called `name`, and its sweep over cylinders of `radii` in m.

    Without radii they are those that it can read (`radii_for`). Prompts for each cylinder and
    averages `seconds` of frames on it. There is no prompt when the source goes through the steps
    by itself, from its own time 0 on and for `dwell` s each, as a simulation does. With `trust` a
    scene may name files outside its folder.
    """
    for what, value in (("seconds", seconds), ("dwell", dwell or seconds), ("hold", hold or 1.0)):
        if not 0 < value <= LONGEST:
            raise Refusal(f"expected {what} above zero and at most {LONGEST:g} s, got {value}")
    simulated = name.startswith(SimulatedSource.SCHEME)
    if simulated:
        dwell = dwell or seconds
        scene = load_scene(name.removeprefix(SimulatedSource.SCHEME), trust)
        source = _laid(scene, radii, hold, dwell)
    else:
        source = open_source(name)
    with closing(source):
        listener = DeviceReadings(source)
        steps = _steps(listener.sensor, radii, hold)
        procedure = Procedure(listener.sensor, steps)
        if dwell is None:
            _prompt_steps(listener, procedure, seconds, prompt, report)
        else:
            _follow(listener, procedure, Presentation(steps, dwell), report)
        return listener.sensor, procedure.sweep()
