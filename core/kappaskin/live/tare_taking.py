"""Tare of the running engine: taken from the estimates while it streams."""

import time
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from datetime import datetime

from kappaskin.calibration import Tare, TareMeasurement
from kappaskin.contact import LoadDetector
from kappaskin.errors import Refusal
from kappaskin.frames import Estimate
from kappaskin.pipeline import Pipeline
from kappaskin.sensing import Sensor
from kappaskin.sources import Source


@dataclass(frozen=True)
class TareStatus:
    """State of tares: whether one is being taken, the number ended, and the last result.

    A `tare` that was taken is not in use before a setup has it.
    """

    taking: bool = False
    ended: int = 0
    tare: Tare | None = None
    refusal: str = ""


class TareCapture:
    """Takes one tare at a time, which the `worker` computes in the background.

    `status` continues the one `before`, of an engine that may have died taking a tare.
    """

    def __init__(self, worker: Executor, before: TareStatus) -> None:
        self._worker = worker
        self._taring: TareMeasurement | None = None
        self._found: Future[Tare] | None = None
        self.status = before
        if before.taking:
            self._end("the engine ended during the tare; tare again")

    def begin(self, sensor: Sensor | None) -> None:
        """Take a tare of `sensor` from the next frames; None when nothing streams."""
        if sensor is None:
            self._end("no readings arrive: connect a sensor, then tare")
            return
        self._taring, self._found = TareMeasurement(sensor, time.monotonic()), None
        self.status = TareStatus(True, self.status.ended)

    def take(self, estimate: Estimate) -> None:
        """Take an estimate, while a tare is being taken."""
        if self._taring is not None and self._found is None:
            try:
                self._taring.take(estimate.device_time, estimate.host_time, estimate.nominal)
            except Refusal as refusal:
                self._end(str(refusal))

    def update(self, pipeline: Pipeline, source: Source) -> bool:
        """Compute the tare once there are enough estimates; whether `status` has it now."""
        if self._found is not None and self._found.done():
            try:
                self._end("", self._found.result())
            except Refusal as refusal:
                self._end(str(refusal))
            return self.status.tare is not None
        taring = self._taring
        if taring is None or self._found is not None or not taring.done(time.monotonic()):
            return False
        edge, temperature = pipeline.setup.edge, source.temperature
        rest, now = pipeline.rest(), datetime.now().astimezone()
        self._found = self._worker.submit(
            lambda: taring.tare(LoadDetector(taring.sensor, edge), rest, now, temperature)
        )
        return False

    def cancel(self, why: str) -> None:
        """End the tare that is being taken, if one is."""
        if self._taring is not None:
            self._end(why)

    def _end(self, refusal: str, tare: Tare | None = None) -> None:
        self._taring, self._found = None, None
        self.status = TareStatus(False, self.status.ended + 1, tare, refusal)
