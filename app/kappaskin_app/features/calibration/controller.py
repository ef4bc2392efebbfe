"""Estimates, taken cylinder by cylinder, to a calibration that a person may use, save or load."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal

from kappaskin.calibration import (
    CalibrationReport,
    Procedure,
    Sweep,
    calibrate,
    load_calibration,
)
from kappaskin.errors import Refusal
from kappaskin.frames import OVERTAKEN, Estimate
from kappaskin.live import Status
from kappaskin.scenes.cylinders import CylinderStep, schedule
from kappaskin.sensing import Sensor
from kappaskin_app.shell.background import BackgroundTask, Cancelled, Tasks
from kappaskin_app.shell.history import History

Array = NDArray[np.float64]

_SETTLE = 0.2  # s after asking for a step that its readings begin to count
_SILENCE = 5.0  # s without a reading after which a step is given up
_FEWEST_FRAMES = 10  # of one step, however short: their spread tells the noise
_MOST_FRAMES = 5000  # kept of one step, evenly: more tell no more
_LONGEST = 3600.0  # s on one step
_STOPPED = "Cancelled while it was computed; what was taken is forgotten."


@dataclass(frozen=True, eq=False)
class Result:
    """What came of a procedure with `sensor`."""

    sensor: Sensor
    sweep: Sweep
    report: CalibrationReport


def parsed_radii(text: str) -> tuple[float, ...]:
    """Radii in m from a list in mm; refused when it is none."""
    try:
        return tuple(float(word) / 1e3 for word in text.replace(",", " ").replace(";", " ").split())
    except ValueError as error:
        raise Refusal(f"expected radii in mm, such as 100, 50, 33; got {text!r:.60}") from error


class Calibrating(QObject):
    """A calibration as a person goes through it.

    It has a `procedure` while steps are taken, is `computing` after the last, and then has a
    `result`; `message` says why a step or the whole was refused, `file_refused` why a file was, and
    `done` what else was done with the result. `changed` tells of anything new,
    `laid` of the step that a simulated skin is to lie on, None when it need not any more, `used`
    of a file that was loaded or saved. From the first to the last, readings are to come without
    any calibration.
    """

    changed = Signal()
    laid = Signal(object)
    used = Signal(object)

    def __init__(
        self,
        history: History,
        tasks: Tasks,
        parent: QObject | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(parent)
        self._history, self._clock = history, clock
        self._status = Status()
        self._meeting = 0
        self.seconds = 1.0
        self.procedure: Procedure | None = None
        self.result: Result | None = None
        self.message = self.done = self.file_refused = ""
        self.unattended = False
        self._kept: list[Estimate] | None = None  # of the step that is being taken
        self._begun = self._heard = 0.0
        self._task = BackgroundTask(
            tasks, "Computing the calibration", self._finish, self._refuse, cancelled=_STOPPED
        )

    # What is so.

    @property
    def step(self) -> CylinderStep | None:
        """What to lay the skin on now, None when nothing is to be."""
        return self.procedure.step if self.procedure else None

    @property
    def computing(self) -> bool:
        return self._task.running

    @property
    def taking(self) -> bool:
        """Whether the readings of the present step are coming in."""
        return self._kept is not None

    @property
    def share(self) -> float:
        """How much of the present step's time is over, 0 to 1."""
        if self._kept is None:
            return 0.0
        return min(1.0, max(0.0, (self._heard - self._begun) / self._wanted()))

    # Requests of the user.

    def begin(self, radii: tuple[float, ...], seconds: float, hold: float = 0.0) -> None:
        """Begin with cylinders of `radii` in m, and take `seconds` of each step's readings."""
        try:
            sensor = self._status.sensor
            if sensor is None or self._status.state != "streaming":
                raise Refusal("no sensor is connected; connect one, then begin")
            if not 0 < seconds <= _LONGEST:
                raise Refusal(f"expected a time above zero and at most {_LONGEST:g} s")
            steps = schedule(radii, hold, sensor.layout.patch.strip)
            self.procedure = Procedure(sensor, steps)
        except Refusal as refusal:
            self._tell(str(refusal))
            return
        self.seconds, self._meeting, self.result = seconds, self._status.meetings, None
        self._lay()
        self._tell("")

    def take(self) -> None:
        """Take the readings that come from now on as those of the present step."""
        step = self.step
        if step is None or self._kept is not None:
            return
        self._kept = []
        # A hold counts from the moment it is laid on: how it begins shows the creep.
        self._begun = self._clock() + (0.0 if step.hold else _SETTLE)
        self._heard = self._clock()
        if step.hold:
            self.laid.emit(step)
        self._tell("")

    def take_all(self) -> None:
        """Take this and all further steps, where nobody needs to lay the skin on them."""
        self.unattended = True
        self.take()

    def pause(self) -> None:
        """Go on step by step after this one."""
        self.unattended = False
        self.changed.emit()

    def redo(self) -> None:
        """Give up the present step and take the one before it again."""
        if self.procedure is None or not self.procedure.taken:
            return
        self._kept, self.unattended = None, False
        self.procedure.redo()
        self._lay()
        self._tell("")

    def cancel(self, why: str = "") -> None:
        """End the procedure, and forget what was taken."""
        self._kept, self.unattended = None, False
        self._task.stop()
        was, self.procedure = self.procedure, None
        if was is not None:
            self.laid.emit(None)
        self._tell(why)

    def leave(self) -> None:
        """Forget the result."""
        self.result = None
        self._tell("")

    def use(self) -> None:
        if self.result is not None:
            self._apply("Use the calibration", self.result.report)

    def stop_using(self) -> None:
        self._history.change("Use no calibration", calibration=None)

    def save(self, path: Path) -> None:
        if self.result is not None:
            try:
                self.result.report.calibration.save(path)
                self.used.emit(path)
                self._tell("", f"saved as {path}")
            except Refusal as refusal:
                self._tell(str(refusal))

    def load(self, path: Path) -> None:
        """Use the calibration in `path`, if it is one of the sensor that is connected."""
        try:
            if self._status.sensor is None:
                raise Refusal(f"{path}: no sensor is connected; connect the one it is of, first")
            now = datetime.now(UTC)
            calibration = load_calibration(path, self._status.sensor, now)
        except Refusal as refusal:
            self.file_refused = str(refusal)
            self.changed.emit()
            return
        self._history.change("Load a calibration", calibration=calibration)
        self.used.emit(path)
        self._tell("")

    # News.

    def follow(self, status: Status) -> None:
        """Take note of how the engine is doing, as often as it is told."""
        self._status = status
        if self.procedure is None or self.computing:
            return
        if why := self._ended_by(status):
            self.cancel(why)
        elif self._kept is not None and self._clock() - max(self._heard, self._begun) > _SILENCE:
            self._give_up(f"no reading came for {_SILENCE:g} s; is the device still sending?")

    def receive(self, estimate: Estimate) -> None:
        """Take in one of the readings of the present step, and the step when it was the last."""
        kept, status = self._kept, self._status
        setup = status.setup
        plain = setup.calibration is None and setup.tare is None
        nominal = plain and estimate.generation == status.generation
        if kept is None or not nominal or estimate.host_time < self._begun:
            return
        after = estimate.device_time - kept[-1].device_time if kept else math.inf
        if after < -OVERTAKEN:
            self.cancel("The device's clock went back: it restarted. Begin anew.")
            return
        self._heard = estimate.host_time
        if after >= self._wanted() / _MOST_FRAMES:  # one that was overtaken is left out
            kept.append(estimate)
        if self._heard - self._begun >= self._wanted() and len(kept) >= _FEWEST_FRAMES:
            self._take(kept)
        else:
            self.changed.emit()

    # How.

    def _tell(self, message: str, done: str = "") -> None:
        self.message, self.done, self.file_refused = message, done, ""
        self.changed.emit()

    def _apply(self, text: str, report: CalibrationReport) -> None:
        self._history.change(text, calibration=report.calibration)
        self.changed.emit()

    def _wanted(self) -> float:
        """How long the readings of the present step are to be, in s."""
        return max(self.seconds, self.step.hold if self.step else 0.0)

    def _lay(self) -> None:
        """Have the next step laid, unless it is a hold, which begins when it is taken."""
        step = self.step
        if step is not None and not step.hold:
            self.laid.emit(step)

    def _ended_by(self, status: Status) -> str:
        """Why the procedure cannot go on, or nothing."""
        if status.meetings != self._meeting:
            return (
                "Another device answered, or the same one restarted or changed. What was taken is "
                "not of this one: begin anew."
            )
        if status.state != "streaming":
            why = f": {status.message}" if status.message else ""
            return f"The connection ended{why}. Once it is back, begin anew."
        return ""

    def _give_up(self, why: str) -> None:
        self._kept, self.unattended = None, False
        self._tell(f"{why[:1].upper()}{why[1:]} The same step again.")

    def _take(self, kept: list[Estimate]) -> None:
        procedure = self.procedure
        if procedure is None:
            return
        times = np.array([estimate.device_time for estimate in kept])
        readings = np.array([estimate.curvature.ravel() for estimate in kept])
        clock_went_back = bool(procedure.taken) and times[0] < procedure.taken[-1].time
        if clock_went_back:
            self.cancel("The device's clock went back: it restarted. Begin anew.")
            return
        try:
            procedure.take(times, readings)
        except Refusal as refusal:
            self._give_up(f"{refusal}.")
            return
        self._kept = None
        if procedure.done:
            self._compute(procedure)
            return
        self._lay()
        if self.unattended:
            self.take()
        self._tell("")

    def _compute(self, procedure: Procedure) -> None:
        """Begin to work it out, beside the drawing."""
        self._task.run(calibrate, procedure.sweep(), procedure.sensor, datetime.now(UTC))
        self.unattended = False
        self._tell("")

    def _finish(self, report: CalibrationReport) -> None:
        if self.procedure is not None:
            self.result = Result(self.procedure.sensor, self.procedure.sweep(), report)
        self.cancel()

    def _refuse(self, error: Exception) -> None:
        why = f"No calibration came of it: {error or type(error).__name__}."
        self.cancel(str(error) if isinstance(error, Cancelled) else why)
