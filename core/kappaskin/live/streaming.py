"""Stream: the estimates of a source, in a loop of a program."""

import os
import time
import weakref
from collections import deque
from collections.abc import Generator, Iterator, Mapping
from pathlib import Path
from typing import overload

from kappaskin.errors import EndedSource, Refusal, SourceError
from kappaskin.frames import Estimate, Frame
from kappaskin.health import HealthMonitor
from kappaskin.pipeline import Pipeline, Setup, pipeline_for, usual_setup
from kappaskin.recording import ReplayedSource
from kappaskin.sensing import Sensor
from kappaskin.sources import described_source, open_source

_READ = 0.1  # s that a read may wait
_NAP = 1e-3  # s between two reads where no finger has a frame
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
        estimate = self.poll(_READ)
        while estimate is None:
            estimate = self.poll(_READ)
        return estimate

    def poll(self, timeout: float = 0.0) -> Estimate | None:
        """The next estimate, where its frame comes within `timeout` s; else None.

        A `StopIteration` at the end, and what the loop raises.
        """
        self._receive(timeout)
        if self._finish.alive and not self._waiting:
            return None
        if self._waiting and self._pipeline is not None and self._health is not None:
            frame = self._waiting.popleft()
            estimate = self._pipeline(frame)
            if self._health(frame):
                self._pipeline.leave_out(self._health.kinds, self._health.badness)
            return estimate
        failure, self._failure = self._failure, None
        raise failure or StopIteration

    def _receive(self, timeout: float) -> None:
        """Read what has arrived up to now; wait for it for `timeout` s where nothing else waits."""
        if not self._finish.alive or (self._waiting and self._source.patient):
            return
        began = time.monotonic()
        try:
            frames = self._take(0.0 if self._waiting else timeout)
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


class HandStream:
    """The estimates of several fingers, each with the name of its finger; iterate over it once.

    `streams` are those of the fingers. One that fails, as by a connection that is lost, ends and
    leaves the others alone: `failures` says why. The loop ends with the last of them; it raises the
    first failure where no finger ended otherwise.
    """

    def __init__(self, streams: Mapping[str, Stream]) -> None:
        self.streams = dict(streams)
        self.failures: dict[str, Refusal] = {}
        self._open = dict(streams)

    def __iter__(self) -> Generator[tuple[str, Estimate]]:
        while self._open:
            found = [each for finger in tuple(self._open) for each in self._next(finger)]
            yield from found
            if not found and self._open:
                time.sleep(_NAP)
        if self.failures and self.failures.keys() == self.streams.keys():
            raise next(iter(self.failures.values()))

    def _next(self, finger: str) -> Iterator[tuple[str, Estimate]]:
        """The next estimate of a finger, where a frame of it has come."""
        try:
            estimate = self._open[finger].poll()
        except StopIteration:
            del self._open[finger]
        except Refusal as failure:
            self.failures[finger] = failure
            del self._open[finger]
        else:
            if estimate is not None:
                yield finger, estimate

    def close(self) -> None:
        """Close all sources; the frames that wait can still be taken."""
        for each in self.streams.values():
            each.close()

    def __enter__(self) -> "HandStream":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@overload
def stream(
    source: str,
    sensor: str | os.PathLike[str] | None = None,
    setup: Setup | None = None,
    trust: bool = False,
) -> Stream: ...


@overload
def stream(
    source: Mapping[str, str],
    sensor: None = None,
    setup: Setup | None = None,
    trust: bool = False,
) -> HandStream: ...


def stream(
    source: str | Mapping[str, str],
    sensor: str | os.PathLike[str] | None = None,
    setup: Setup | None = None,
    trust: bool = False,
) -> Stream | HandStream:
    """The estimates of a `source`: `sim:SCENE`, `replay:FILE`, `feed:NAME`, a port or a URL.

    `sensor` is a file that describes a sensor with a line format of its own. Without a `setup`, it
    is the usual one with the tare that is saved of this sensor, and as many functions as the sensor
    determines. With `trust` a scene may name files
    outside its folder. Raises a `SourceError` where the source cannot be opened, and a `Refusal`
    for a setup that the sensor does not allow.

    Of a hand, sources by the names of fingers, `stream({"thumb": "sim:", "index": "sim:"})`, it is
    the estimates of all, each with the name of its finger before it, in the order in which they
    come. All are on one clock: the scan began at `taken` +- `taken_sd`.
    """
    if not isinstance(source, str):
        streams = dict[str, Stream]()
        try:
            for finger, each in source.items():
                streams[finger] = Stream(each, setup, trust)
        except BaseException:
            HandStream(streams).close()
            raise
        return HandStream(streams)
    name = source if sensor is None else described_source(Path(sensor).absolute(), source)
    return Stream(name, setup, trust)
