"""Procedures of a calibration: their steps, and the result to use, save or load."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Generic, Protocol, TypeVar

import numpy as np
from PySide6.QtCore import QObject, Signal

from kappaskin.calibration import (
    Calibration,
    CalibrationReport,
    KnownWeights,
    Procedure,
    Sweep,
    Tare,
    Weighing,
    WeightFit,
    calibrate,
    load_calibration,
)
from kappaskin.errors import Refusal
from kappaskin.frames import OVERTAKEN, Array, Estimate
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
_RESTARTED = "The device's clock went back: it restarted. Start again."
_STOPPED = "Computation cancelled; the captured steps are discarded."


@dataclass(frozen=True, eq=False)
class Result:
    """Data and report of a completed procedure with `sensor`."""

    sensor: Sensor
    sweep: Sweep
    report: CalibrationReport


def parsed(text: str, what: str) -> tuple[float, ...]:
    """The numbers in `text`; raises Refusal for other text, with `what` was expected."""
    try:
        return tuple(float(word) for word in text.replace(",", " ").replace(";", " ").split())
    except ValueError as error:
        raise Refusal(f"expected {what}; got {text!r:.60}") from error


def parsed_radii(text: str) -> tuple[float, ...]:
    """Radii in m from a list in mm; raises Refusal for other text."""
    return tuple(radius / 1e3 for radius in parsed(text, "radii in mm, such as 100, 50, 33"))


class Steps(Protocol):
    """A procedure that is taken in steps."""

    @property
    def done(self) -> bool: ...

    @property
    def taken(self) -> Sequence[object]: ...

    def redo(self) -> None: ...


P = TypeVar("P", bound=Steps)
R = TypeVar("R")


class StepController(QObject, Generic[P, R]):
    """A procedure by a user, each step with readings of some seconds.

    There is a `procedure` while steps are captured; it is `computing` after the last, and then has
    a `result`. `message` is the reason why a step or the procedure was refused, and `done` what
    else was done with the result. `changed` reports any change, `step_requested` the step for a
    simulated skin (None at the end), and `used` a file loaded or saved.
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
        self.procedure: P | None = None
        self.result: R | None = None
        self.message = self.done = ""
        self.automatic = False
        self._captured: list[Estimate] | None = None  # of the present step
        self._begin_time = self._last_time = 0.0
        words = "Computing the calibration"
        self._task = BackgroundTask(tasks, words, self._finish, self._refuse, cancelled=_STOPPED)

    # What a procedure has of its own.

    @property
    def calibration(self) -> Calibration | None:
        """The calibration with the result."""
        raise NotImplementedError

    @property
    def _hold(self) -> float:
        """The time in s for which the present step is held from its beginning; usually zero."""
        return 0.0

    def _belongs(self, estimate: Estimate) -> bool:
        """Whether an estimate has the readings that the procedure wants."""
        raise NotImplementedError

    def _take(self, procedure: P, times: Array, readings: Array) -> None:
        raise NotImplementedError

    def _request_step(self) -> None:
        """Request the present step."""
        raise NotImplementedError

    def _compute(self, procedure: P) -> None:
        """Compute the result in the background."""
        raise NotImplementedError

    def _result(self, procedure: P, found: object) -> R:
        raise NotImplementedError

    # State.

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

    def _start(self, make: Callable[[Sensor], P], seconds: float) -> None:
        """Start the procedure that `make` returns for the sensor, or report why not."""
        try:
            sensor = self._status.sensor
            if sensor is None or self._status.state != "streaming":
                raise Refusal("no sensor is connected; connect one, then start")
            if not 0 < seconds <= _LONGEST:
                raise Refusal(f"expected a time above zero and at most {_LONGEST:g} s")
            self.procedure = make(sensor)
        except Refusal as refusal:
            self._report(str(refusal))
            return
        self.seconds, self._connection, self.result = seconds, self._status.connections, None
        self._request_step()
        self._report("")

    def capture(self) -> None:
        """Capture the readings of the present step from now on."""
        if self.procedure is None or self.procedure.done or self._captured is not None:
            return
        self._captured = []
        # A hold is captured from its beginning, which shows the creep.
        self._begin_time = self._clock() + (0.0 if self._hold else _SETTLE)
        self._last_time = self._clock()
        if self._hold:
            self._request_step()
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
        """Use the calibration with the result."""
        if self.calibration is not None:
            self._history.change("Use the calibration", calibration=self.calibration)
            self.changed.emit()

    def save(self, path: Path) -> None:
        """Write the calibration with the result to a file."""
        if self.calibration is not None:
            try:
                self.calibration.save(path)
                self.used.emit(path)
                self._report("", f"saved as {path}")
            except Refusal as refusal:
                self._report(str(refusal))

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
        captured = self._captured
        if captured is None or estimate.host_time < self._begin_time:
            return
        if estimate.generation != self._status.generation or not self._belongs(estimate):
            return
        after = estimate.device_time - captured[-1].device_time if captured else math.inf
        if after < -OVERTAKEN:
            self.cancel(_RESTARTED)
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
        self.message, self.done = message, done
        self.changed.emit()

    def _duration(self) -> float:
        """Duration of the present step in s."""
        return max(self.seconds, self._hold)

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
        try:
            self._take(procedure, times, readings)
        except Refusal as refusal:
            self._refuse_step(f"{refusal}.")
            return
        if self.procedure is None:  # cancelled by what was taken
            return
        self._captured = None
        if procedure.done:
            self._compute(procedure)
            self.automatic = False
        else:
            self._request_step()
            if self.automatic:
                self.capture()
        self._report("")

    def _finish(self, found: object) -> None:
        if self.procedure is not None:
            self.result = self._result(self.procedure, found)
        self.cancel()

    def _refuse(self, error: Exception) -> None:
        why = f"No calibration: {error or type(error).__name__}."
        self.cancel(str(error) if isinstance(error, Cancelled) else why)


class CalibrationController(StepController[Procedure, Result]):
    """Calibration on cylinders by a user, whose readings are to come without a calibration.

    `file_refused` is the reason why a file could not be loaded.
    """

    file_refused = ""

    @property
    def step(self) -> CylinderStep | None:
        """The present step, None without a procedure or after the last."""
        return self.procedure.step if self.procedure else None

    @property
    def calibration(self) -> Calibration | None:
        """The calibration with the result."""
        return self.result.report.calibration if self.result else None

    def begin(self, radii: tuple[float, ...], seconds: float, hold: float = 0.0) -> None:
        """Start with cylinders of `radii` in m, and `seconds` of readings per step."""

        def procedure(sensor: Sensor) -> Procedure:
            return Procedure(sensor, schedule(radii, hold, sensor.layout.patch.strip))

        self._start(procedure, seconds)

    def stop_using(self) -> None:
        self._history.change("Use no calibration", calibration=None)

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

    def _report(self, message: str, done: str = "") -> None:
        self.file_refused = ""
        super()._report(message, done)

    @property
    def _hold(self) -> float:
        return self.step.hold if self.step else 0.0

    def _belongs(self, estimate: Estimate) -> bool:
        setup = self._status.setup
        return setup.calibration is None and setup.tare is None

    def _take(self, procedure: Procedure, times: Array, readings: Array) -> None:
        if procedure.taken and times[0] < procedure.taken[-1].time:
            self.cancel(_RESTARTED)
            return
        procedure.take(times, readings)

    def _request_step(self) -> None:
        """Request the present step, unless it is a hold, which begins with its capture."""
        if self.step is not None and bool(self._hold) == self.capturing:
            self.step_requested.emit(self.step)

    def _compute(self, procedure: Procedure) -> None:
        self._task.run(calibrate, procedure.sweep(), procedure.sensor, datetime.now(UTC))

    def _result(self, procedure: Procedure, found: CalibrationReport) -> Result:
        return Result(procedure.sensor, procedure.sweep(), found)


class WeightController(StepController[Weighing, KnownWeights]):
    """Known weights laid on by a user, with readings as they are corrected now.

    `step_requested` has the procedure, whose present weight lies on a simulated skin.
    """

    _before: Calibration | None = None
    _tare: Tare | None = None

    @property
    def calibration(self) -> Calibration | None:
        """The calibration in use, or that of the data sheet, with what the weights found."""
        sensor = self._status.sensor
        if self.result is None or sensor is None:
            return None
        now = datetime.now(UTC)
        before = self._before or Calibration.nominal(sensor, now)
        return before.with_weights(self.result, now)

    def begin(self, masses: tuple[float, ...], seconds: float) -> None:
        """Start with weights of `masses` in g, and `seconds` of readings for each."""
        setup = self._status.setup
        self._before, self._tare = setup.calibration, setup.tare
        self._start(lambda sensor: Weighing(sensor, masses, setup.edge), seconds)

    def _ended_by(self, status: Status) -> str:
        setup = status.setup
        if (setup.calibration, setup.tare) != (self._before, self._tare):
            return "The calibration or the tare was changed: start again."
        return super()._ended_by(status)

    def _belongs(self, estimate: Estimate) -> bool:
        return True

    def _take(self, procedure: Weighing, times: Array, readings: Array) -> None:
        procedure.take(readings)

    def _request_step(self) -> None:
        self.step_requested.emit(self.procedure)

    def _compute(self, procedure: Weighing) -> None:
        self._task.compute(
            known_weights,
            procedure.fit.sensor,
            procedure.fit.edge,
            procedure.weights,
            procedure.bent,
        )

    def _result(self, procedure: Weighing, found: KnownWeights) -> KnownWeights:
        return found


def known_weights(
    sensor: Sensor, edge: str, weights: Sequence[float], readings: Sequence[Array]
) -> KnownWeights:
    """What `weights` in N with these `readings` say, computed in a process of its own."""
    return WeightFit(sensor, edge)(weights, readings)
