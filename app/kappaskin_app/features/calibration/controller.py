"""Calibration controller: steps of the procedure, and the calibration to use, save or load."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
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

_SETTLE = 0.2  # s from the start of a step to its first reading
_SILENCE = 5.0  # s without a reading after which a step is aborted
_FEWEST_FRAMES = 10  # of one step, to determine the noise
_MOST_FRAMES = 5000  # stored of one step, evenly spaced
_LONGEST = 3600.0  # s, longest step
_STOPPED = "Computation cancelled; the captured steps are discarded."


@dataclass(frozen=True, eq=False)
class Result:
    """Data and report of a completed procedure with `sensor`."""

    sensor: Sensor
    sweep: Sweep
    report: CalibrationReport


def parsed_radii(text: str) -> tuple[float, ...]:
    """Radii in m from a list in mm; raises Refusal for other text."""
    try:
        return tuple(float(word) / 1e3 for word in text.replace(",", " ").replace(";", " ").split())
    except ValueError as error:
        raise Refusal(f"expected radii in mm, such as 100, 50, 33; got {text!r:.60}") from error


class CalibrationController(QObject):
    """Calibration by a user.

    There is a `procedure` while steps are captured; it is `computing` after the last, and then has
    a `result`. `message` is the reason why a step or the procedure was refused, `file_refused` that
    of a file, and `done` what else was done with the result. `changed` reports any change,
    `step_requested` the step for a simulated skin (None at the end), and `used` a file loaded or
    saved. During the procedure readings are to come without a calibration.
    """

    changed = Signal()
    step_requested = Signal(object)
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
        self._connection = 0
        self.seconds = 1.0
        self.procedure: Procedure | None = None
        self.result: Result | None = None
        self.message = self.done = self.file_refused = ""
        self.automatic = False
        self._captured: list[Estimate] | None = None  # of the present step
        self._begin_time = self._last_time = 0.0
        self._task = BackgroundTask(
            tasks, "Computing the calibration", self._finish, self._refuse, cancelled=_STOPPED
        )

    # State.

    @property
    def step(self) -> CylinderStep | None:
        """The present step, None without a procedure or after the last."""
        return self.procedure.step if self.procedure else None

    @property
    def computing(self) -> bool:
        return self._task.running

    @property
    def capturing(self) -> bool:
        """Whether the readings of the present step are being captured."""
        return self._captured is not None

    @property
    def share(self) -> float:
        """Progress of the present step, 0 to 1."""
        if self._captured is None:
            return 0.0
        return min(1.0, max(0.0, (self._last_time - self._begin_time) / self._duration()))

    # Requests of the user.

    def begin(self, radii: tuple[float, ...], seconds: float, hold: float = 0.0) -> None:
        """Start with cylinders of `radii` in m, and `seconds` of readings per step."""
        try:
            sensor = self._status.sensor
            if sensor is None or self._status.state != "streaming":
                raise Refusal("no sensor is connected; connect one, then start")
            if not 0 < seconds <= _LONGEST:
                raise Refusal(f"expected a time above zero and at most {_LONGEST:g} s")
            steps = schedule(radii, hold, sensor.layout.patch.strip)
            self.procedure = Procedure(sensor, steps)
        except Refusal as refusal:
            self._report(str(refusal))
            return
        self.seconds, self._connection, self.result = seconds, self._status.connections, None
        self._request_step()
        self._report("")

    def capture(self) -> None:
        """Capture the readings of the present step from now on."""
        step = self.step
        if step is None or self._captured is not None:
            return
        self._captured = []
        # A hold is captured from its beginning, which shows the creep.
        self._begin_time = self._clock() + (0.0 if step.hold else _SETTLE)
        self._last_time = self._clock()
        if step.hold:
            self.step_requested.emit(step)
        self._report("")

    def capture_all(self) -> None:
        """Capture all further steps automatically, for a simulated skin."""
        self.automatic = True
        self.capture()

    def pause(self) -> None:
        """Continue step by step after the present one."""
        self.automatic = False
        self.changed.emit()

    def redo(self) -> None:
        """Abort the present step and repeat the one before it."""
        if self.procedure is None or not self.procedure.taken:
            return
        self._captured, self.automatic = None, False
        self.procedure.redo()
        self._request_step()
        self._report("")

    def cancel(self, why: str = "") -> None:
        """End the procedure, and discard the captured steps."""
        self._captured, self.automatic = None, False
        self._task.stop()
        was, self.procedure = self.procedure, None
        if was is not None:
            self.step_requested.emit(None)
        self._report(why)

    def discard(self) -> None:
        """Discard the result."""
        self.result = None
        self._report("")

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
                self._report("", f"saved as {path}")
            except Refusal as refusal:
                self._report(str(refusal))

    def load(self, path: Path) -> None:
        """Use the calibration in `path`, if it belongs to the connected sensor."""
        try:
            if self._status.sensor is None:
                raise Refusal(
                    f"{path}: no sensor is connected; connect the one it belongs to first"
                )
            now = datetime.now(UTC)
            calibration = load_calibration(path, self._status.sensor, now)
        except Refusal as refusal:
            self.file_refused = str(refusal)
            self.changed.emit()
            return
        self._history.change("Load a calibration", calibration=calibration)
        self.used.emit(path)
        self._report("")

    # Input.

    def follow(self, status: Status) -> None:
        """Store the status of the engine; end or refuse what it makes impossible."""
        self._status = status
        if self.procedure is None or self.computing:
            return
        if why := self._ended_by(status):
            self.cancel(why)
        elif (
            self._captured is not None
            and self._clock() - max(self._last_time, self._begin_time) > _SILENCE
        ):
            self._refuse_step(f"no reading for {_SILENCE:g} s; check the device.")

    def receive(self, estimate: Estimate) -> None:
        """Capture an estimate of the present step, and finish the step after its last."""
        captured, status = self._captured, self._status
        setup = status.setup
        plain = setup.calibration is None and setup.tare is None
        nominal = plain and estimate.generation == status.generation
        if captured is None or not nominal or estimate.host_time < self._begin_time:
            return
        after = estimate.device_time - captured[-1].device_time if captured else math.inf
        if after < -OVERTAKEN:
            self.cancel("The device's clock went back: it restarted. Start again.")
            return
        self._last_time = estimate.host_time
        if after >= self._duration() / _MOST_FRAMES:  # late frames are excluded
            captured.append(estimate)
        if (
            self._last_time - self._begin_time >= self._duration()
            and len(captured) >= _FEWEST_FRAMES
        ):
            self._finish_step(captured)
        else:
            self.changed.emit()

    # Steps.

    def _report(self, message: str, done: str = "") -> None:
        self.message, self.done, self.file_refused = message, done, ""
        self.changed.emit()

    def _apply(self, text: str, report: CalibrationReport) -> None:
        self._history.change(text, calibration=report.calibration)
        self.changed.emit()

    def _duration(self) -> float:
        """Duration of the present step in s."""
        return max(self.seconds, self.step.hold if self.step else 0.0)

    def _request_step(self) -> None:
        """Request the next step, unless it is a hold, which begins with its capture."""
        step = self.step
        if step is not None and not step.hold:
            self.step_requested.emit(step)

    def _ended_by(self, status: Status) -> str:
        """Why the procedure cannot go on, or nothing."""
        if status.connections != self._connection:
            return (
                "Another device was connected, or the same one restarted or changed. The captured "
                "steps do not belong to it: start again."
            )
        if status.state != "streaming":
            why = f": {status.message}" if status.message else ""
            return f"The connection ended{why}. Reconnect, then start again."
        return ""

    def _refuse_step(self, why: str) -> None:
        self._captured, self.automatic = None, False
        self._report(f"{why[:1].upper()}{why[1:]} Repeat this step.")

    def _finish_step(self, captured: list[Estimate]) -> None:
        procedure = self.procedure
        if procedure is None:
            return
        times = np.array([estimate.device_time for estimate in captured])
        readings = np.array([estimate.curvature.ravel() for estimate in captured])
        clock_went_back = bool(procedure.taken) and times[0] < procedure.taken[-1].time
        if clock_went_back:
            self.cancel("The device's clock went back: it restarted. Start again.")
            return
        try:
            procedure.take(times, readings)
        except Refusal as refusal:
            self._refuse_step(f"{refusal}.")
            return
        self._captured = None
        if procedure.done:
            self._compute(procedure)
            return
        self._request_step()
        if self.automatic:
            self.capture()
        self._report("")

    def _compute(self, procedure: Procedure) -> None:
        """Compute the calibration in the background."""
        self._task.run(calibrate, procedure.sweep(), procedure.sensor, datetime.now(UTC))
        self.automatic = False
        self._report("")

    def _finish(self, report: CalibrationReport) -> None:
        if self.procedure is not None:
            self.result = Result(self.procedure.sensor, self.procedure.sweep(), report)
        self.cancel()

    def _refuse(self, error: Exception) -> None:
        why = f"No calibration: {error or type(error).__name__}."
        self.cancel(str(error) if isinstance(error, Cancelled) else why)
