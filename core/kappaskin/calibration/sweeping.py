"""A source to a sweep: asks for one cylinder after the other, or follows who lays them."""

import math
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from kappaskin.calibration.procedure import Procedure, Sweep
from kappaskin.errors import Refusal, SourceError
from kappaskin.frames import OVERTAKEN, Array, Frame
from kappaskin.scenes import ADVICE, CylinderStep, Presentation, load_scene, radii_for, schedule
from kappaskin.sensing import Sensor
from kappaskin.sources import SIMULATION, SimulatedSource, Source, open_source

_READ = 0.05  # s that one read may wait
_SILENCE = 5.0  # s without a frame after which the source counts as dead
_MOST_FRAMES = 5000  # kept of one step, evenly: more tell no more
_LONGEST = 3600.0  # s on one step

Tell = Callable[[str], None]
Ask = Callable[[str], str]
"""A question to the answer that was typed."""


@dataclass
class Virtual:
    """A clock that whoever sleeps by it moves: a simulation need not be waited for."""

    now: float = 0.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


def _steps(
    sensor: Sensor, radii: tuple[float, ...] | None, hold: float
) -> tuple[CylinderStep, ...]:
    return schedule(radii or radii_for(sensor), hold, sensor.layout.patch.strip)


def _simulated(name: str, radii: tuple[float, ...] | None, hold: float, dwell: float) -> Source:
    """The scene called `name`, laid on the cylinders as fast as it can be computed."""
    clock, scene = Virtual(), load_scene(name)
    laid = Presentation(_steps(scene.sensor(), radii, hold), dwell)
    return SimulatedSource(scene.laid_on(laid), clock, clock.sleep)


class Listener:
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
                raise Refusal(f"no frame came for {_SILENCE:g} s; is the device still sending?")
        if self._source.sensor is not self.sensor:
            raise Refusal("another device answered in the middle; begin anew with this one")
        return found

    def read(self, frames: list[Frame]) -> tuple[Array, Array]:
        """Device times (n,) in s and readings (n, C) in 1/m."""
        readings = [self.sensor.nominal(frame) for frame in frames]
        times = np.array([frame.device_time for frame in frames])
        return times, np.array(readings).reshape(len(frames), self.sensor.channels)


def _keep(kept: list[Frame], frame: Frame, seconds: float) -> None:
    """Add `frame` to those `kept` of a step of so many `seconds`, unless it comes too soon."""
    after = frame.device_time - kept[-1].device_time if kept else math.inf
    # One that others overtook is left out; a clock that went back is for the procedure to refuse.
    if after >= seconds / _MOST_FRAMES or after < -OVERTAKEN:
        kept.append(frame)


def _follow(listener: Listener, procedure: Procedure, laid: Presentation, tell: Tell) -> None:
    """Take the steps as they are presented, by the device's own clock."""
    kept: list[Frame] = []
    while not procedure.done:
        for frame in listener.frames():
            index, step = laid.index(frame.device_time), procedure.step
            if step and index == step.number and kept:
                taken = procedure.take(*listener.read(kept))
                tell(f"{step.number}/{len(laid.steps)}  {step}\n    {taken}")
                kept, step = [], procedure.step
            if step is None:
                return
            if index != step.number - 1:
                raise Refusal(
                    f"step {step.number} was not seen: the device presents step {index + 1}; start "
                    "it anew, then this command at once"
                )
            if laid.settled(frame.device_time):
                _keep(kept, frame, max(laid.dwell, step.hold))


def _recorded(listener: Listener, seconds: float) -> list[Frame]:
    """The frames of the next `seconds`: what came before was read while the skin was moved."""
    begun = now = time.monotonic()
    kept: list[Frame] = []
    while now < begun + seconds:
        for frame in listener.frames():
            now = frame.host_time
            if now >= begun:
                _keep(kept, frame, seconds)
    return kept


def _prompt(step: CylinderStep, total: int, again: bool) -> str:
    then = "press Enter, then lay it on" if step.hold else "press Enter when it lies still"
    redo = ", or r and Enter to take the last one again" if again else ""
    return f"{step.number}/{total}  {step}: {then}{redo}: "


def _asking(listener: Listener, procedure: Procedure, seconds: float, ask: Ask, tell: Tell) -> None:
    """Ask for each step and take it, until all are done."""
    tell(ADVICE)
    while step := procedure.step:
        answer = ask(_prompt(step, len(procedure.steps), bool(procedure.taken)))
        if answer.strip().lower() == "r" and procedure.taken:
            procedure.redo()
            continue
        frames = _recorded(listener, max(seconds, step.hold))
        try:
            tell(f"    {procedure.take(*listener.read(frames))}")
        except Refusal as refusal:
            tell(f"    {refusal}; the same step again")


def take_sweep(
    name: str,
    radii: tuple[float, ...] | None,
    ask: Ask,
    tell: Tell,
    *,
    seconds: float = 1.0,
    hold: float = 0.0,
    dwell: float | None = None,
) -> tuple[Sensor, Sweep]:
    """What the source called `name` says it is, and what it reads on cylinders of `radii` in m.

    Without radii they are those that it can read (`radii_for`). Asks for each cylinder and averages
    `seconds` of frames on it. Nobody is asked when the source goes through the steps by itself,
    from its own time 0 on and for `dwell` s each, as a simulation does.
    """
    for what, value in (("seconds", seconds), ("dwell", dwell or seconds), ("hold", hold or 1.0)):
        if not 0 < value <= _LONGEST:
            raise Refusal(f"expected {what} above zero and at most {_LONGEST:g} s, got {value}")
    simulated = name.startswith(SIMULATION)
    if simulated:
        dwell = dwell or seconds
        source = _simulated(name.removeprefix(SIMULATION), radii, hold, dwell)
    else:
        source = open_source(name)
    with closing(source):
        listener = Listener(source)
        steps = _steps(listener.sensor, radii, hold)
        procedure = Procedure(listener.sensor, steps)
        if dwell is None:
            _asking(listener, procedure, seconds, ask, tell)
        else:
            _follow(listener, procedure, Presentation(steps, dwell), tell)
        return listener.sensor, procedure.sweep()
