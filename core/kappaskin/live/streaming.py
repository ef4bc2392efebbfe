"""Stream: the estimates of a source, in a loop of a program."""

import os
import time
import weakref
from collections import deque
from pathlib import Path

from kappaskin.errors import EndedSource, Refusal, SourceError
from kappaskin.frames import Estimate, Frame
from kappaskin.health import HealthMonitor
from kappaskin.pipeline import Pipeline, Setup, pipeline_for, usual_setup
from kappaskin.recording import ReplayedSource
from kappaskin.sensing import Sensor
from kappaskin.sources import described_source, open_source

_READ = 0.1  # s that a read may wait
_WAITING = 64  # frames that wait to be taken at most


class Stream:
    """The estimates of a source, each as soon as its frame has arrived; iterate over it once.

    Of the frames that the loop has not taken, the newest 64 wait; `dropped` counts the others. A
    source that waits itself, such as a file, drops none. `sensor` is the one connected, None until
    it is known. The loop ends with its source; it raises a `SourceError` where the connection is
    lost, nothing usable has come for three seconds, or the source ended without a record. Estimates
    of a recording are computed anew.
    """

    def __init__(self, source: str, setup: Setup | None, trust: bool) -> None:
        self._source, self._setup = open_source(source, trust), setup
        self._finish = weakref.finalize(self, self._source.close)
        self._waiting = deque[Frame]()
        self._failure: Refusal | None = None
        self.sensor: Sensor | None = None
        self._pipeline: Pipeline | None = None
        self._health: HealthMonitor | None = None
        self.dropped = 0
        self._follow()

    def __iter__(self) -> "Stream":
        return self

    def __next__(self) -> Estimate:
        self._receive()
        while self._finish.alive and not self._waiting:
            self._receive()
        if self._waiting and self._pipeline is not None and self._health is not None:
            frame = self._waiting.popleft()
            estimate = self._pipeline(frame)
            if self._health(frame):
                self._pipeline.leave_out(self._health.kinds, self._health.badness)
            return estimate
        failure, self._failure = self._failure, None
        raise failure or StopIteration

    def _receive(self) -> None:
        """Read what has arrived up to now; wait for it where nothing else waits."""
        if not self._finish.alive or (self._waiting and self._source.patient):
            return
        began = time.monotonic()
        try:
            frames = self._take(0.0 if self._waiting else _READ)
            while frames and frames[-1].host_time < began and not self._source.patient:
                frames = self._take(0.0)
            if isinstance(self._source, ReplayedSource) and self._source.ended:
                self.close()
        except Refusal as reason:
            self._failure = reason
            if isinstance(reason, EndedSource):
                none = SourceError(f"{reason}; expected records as its description says, got none")
                self._failure = None if self._source.accounting().accepted else none
            self.close()

    def _take(self, timeout: float) -> list[Frame]:
        """Read frames after at most `timeout` s, and let the newest wait."""
        frames = self._source.read(timeout)
        self._follow()
        self._waiting += frames
        while self._pipeline and len(self._waiting) > _WAITING and not self._source.patient:
            self._pipeline.pass_over(self._waiting.popleft())
            self.dropped += 1
        if trouble := self._source.trouble:
            raise SourceError(trouble)
        return frames

    def _follow(self) -> None:
        """Set up for the sensor that is connected now."""
        if (sensor := self._source.sensor) is self.sensor or sensor is None:
            return
        self.dropped += len(self._waiting)
        self._waiting.clear()
        setup, usual = self._setup or usual_setup(sensor), self._setup is None
        self._pipeline, _ = pipeline_for(sensor, setup, smaller=usual)
        self.sensor, self._health = sensor, HealthMonitor(sensor)

    def close(self) -> None:
        """Close the source; the frames that wait can still be taken."""
        self._finish()

    def __enter__(self) -> "Stream":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def stream(
    source: str,
    sensor: str | os.PathLike[str] | None = None,
    setup: Setup | None = None,
    trust: bool = False,
) -> Stream:
    """The estimates of a `source`: `sim:SCENE`, `replay:FILE`, `feed:NAME`, a port or a URL.

    `sensor` is a file that describes a sensor with a line format of its own. Without a `setup`, it
    is the usual one with the tare that is saved of this sensor, and as many functions as the sensor
    determines. With `trust` a scene may name files
    outside its folder. Raises a `SourceError` where the source cannot be opened, and a `Refusal`
    for a setup that the sensor does not allow.
    """
    name = source if sensor is None else described_source(Path(sensor).absolute(), source)
    return Stream(name, setup, trust)
