"""A source to a calibration: asks for one cylinder after the other, or follows who lays them."""

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from kappaskin.calibration import (
    ADVICE,
    CalibrationReport,
    Presentation,
    Procedure,
    Step,
    Sweep,
    radii_for,
    schedule,
)
from kappaskin.errors import Refusal, SourceError
from kappaskin.frames import COMPONENTS, Array, Frame
from kappaskin.scene import load_scene
from kappaskin.sensor import Sensor
from kappaskin.sources import SIMULATION, SimulatedSource, Source, open_source

_READ = 0.05  # s that one read may wait
_SILENCE = 5.0  # s without a frame after which the source counts as dead
_MOST_FRAMES = 5000  # kept of one step, evenly: more tell no more
_LONGEST = 3600.0  # s on one step
_WORST = 5  # channels that a summary names

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


def _steps(sensor: Sensor, radii: tuple[float, ...] | None, hold: float) -> tuple[Step, ...]:
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
            if time.monotonic() - begun > _SILENCE:
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
    # Not the signed difference: a clock that went back is for the procedure to refuse.
    if not kept or abs(frame.device_time - kept[-1].device_time) >= seconds / _MOST_FRAMES:
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


def _prompt(step: Step, total: int, again: bool) -> str:
    then = "press Enter, then lay it on" if step.hold else "press Enter when it lies still"
    redo = ", or r and Enter to take the last one again" if again else ""
    return f"{step.number}/{total}  {step}: {then}{redo}: "


def _guide(listener: Listener, procedure: Procedure, seconds: float, ask: Ask, tell: Tell) -> None:
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
            _guide(listener, procedure, seconds, ask, tell)
        else:
            _follow(listener, procedure, Presentation(steps, dwell), tell)
        return listener.sensor, procedure.sweep()


def summary(report: CalibrationReport) -> list[str]:
    """What a person wants to know of a calibration, line by line."""
    calibration, P = report.calibration, len(report.noise) // 3

    def spread(values: Array) -> str:
        return f"{values.min():.3g} to {values.max():.3g}"

    lines = [
        f"{calibration.name} {calibration.serial_number}: {int(report.passed.sum())} of "
        f"{int(report.passed.sum()) + len(report.failed)} channels passed; curvature in 1/m",
        f"{'':<11}{'gain':<18}{'offset':<18}{'widest loop (left)':<22}error (of a line alone)",
    ]
    for c, name in enumerate(COMPONENTS):
        here = np.flatnonzero(report.passed[c * P : (c + 1) * P]) + c * P
        if here.size:
            loops = report.gaps[:, here].max(), report.gaps_left[:, here].max()
            errors = report.fitted.left_out[here].max(), report.line.left_out[here].max()
            lines.append(
                f"{name:<11}{spread(report.fitted.gain[here]):<18}"
                f"{spread(report.fitted.offset[here]):<18}"
                f"{'{:.2f} ({:.2f})'.format(*loops):<22}{errors[0]:.3f} ({errors[1]:.2f})"
            )
    if calibration.creep:
        share = float(np.median(calibration.creep.share[report.passed]))
        lines.append(f"creep      {100 * share:.1f} % in {calibration.creep.time_constant:.3g} s")
    worst = np.argsort(np.where(report.passed, -report.fitted.left_out, 0.0))[:_WORST]
    told = (f"{_named(c, P)} {report.fitted.left_out[c]:.3f}" for c in worst)
    lines.append(f"worst      {', '.join(told)}")
    return lines + [f"failed     {_named(c, P)}: {why}" for c, why in report.failed.items()]


def _named(channel: int, elements: int) -> str:
    return f"{COMPONENTS[channel // elements]} of element {channel % elements}"
