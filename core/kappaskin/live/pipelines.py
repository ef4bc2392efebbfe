"""Pipelines of the engine: built in the background, then swapped with the one in use."""

import math
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field, replace

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Frame
from kappaskin.health import Kinds, Monitor
from kappaskin.live.ring import Ring, slot_type
from kappaskin.pipeline import Pipeline, Setup
from kappaskin.sensing import Sensor


@dataclass(frozen=True)
class PipelineStatus:
    """What is computed: with a `setup` of this `generation`, estimates that fill a `slot`.

    `refusal` says why the setup is not the one asked for last, `computing` that another is on its
    way. Without a slot there are no estimates yet.
    """

    setup: Setup = field(default_factory=Setup)
    generation: int = 0
    slot: "np.dtype[np.void] | None" = None
    refusal: str = ""
    computing: bool = False


class PipelineHost:
    """Computes with the setup asked for last, as far as a sensor can; one ring of estimates.

    `left` is what the pipeline in use leaves out: the kinds and badness of its channels.

    `pipeline` is the one in use, None without a sensor; `told` says how it is. Pipelines are made
    by `builder`, and those that are overtaken meanwhile are dropped.
    """

    def __init__(self, ring: Ring, builder: Executor, told: PipelineStatus) -> None:
        self.ring, self._builder, self.told = ring, builder, told
        self.pipeline: Pipeline | None = None
        self._sensor: Sensor | None = None
        self._asked = told.setup
        self._building: Future[_Built] | None = None
        self.left: tuple[Kinds, Array] | None = None

    def ask(self, setup: Setup) -> None:
        """Begin to build a pipeline for another setup, beside the running one."""
        self._asked = setup
        self._build(smaller=False)

    def meet(self, sensor: Sensor | None) -> None:
        """Begin with another sensor; what the last one showed is not this one's."""
        self._sensor, self.pipeline = sensor, None
        self.told = replace(self.told, slot=None)
        if sensor is not None:
            self._build(smaller=True)

    def forget(self) -> None:
        """The sensor is gone, and nobody waits for what is built."""
        self._building = self._sensor = self.pipeline = None
        self.told = replace(self.told, computing=False, slot=None)

    def _build(self, smaller: bool) -> None:
        if self._sensor is None:
            self.told = replace(self.told, setup=self._asked, refusal="")
        elif self._building is None:
            job = (_built, self._sensor, self._asked, self.told.generation + 1, smaller)
            self._building = self._builder.submit(*job)
            self.told = replace(self.told, computing=True)

    def swap(self) -> bool:
        """Go over to another pipeline, if one is built; whether there was one, or a refusal."""
        if self._building is None or not self._building.done():
            return False
        made, self._building = self._building.result(), None
        self.told = replace(self.told, computing=False)
        if made.asked != self._asked or made.sensor is not self._sensor:
            self._build(smaller=self.pipeline is None)  # overtaken while it was built
            return False
        self.told = replace(self.told, refusal=made.refusal)
        if made.pipeline is not None:
            self._use(made.pipeline)
        return True

    def _use(self, pipeline: Pipeline) -> None:
        slot = slot_type(pipeline)
        try:
            self.ring.lay_out(pipeline.generation, slot)
        except Refusal as refusal:
            self.told = replace(self.told, refusal=str(refusal))
            return
        if self.pipeline is not None:
            pipeline.go_on_from(self.pipeline)
        self.pipeline, self.left = pipeline, None
        self.told = replace(
            self.told, setup=pipeline.setup, generation=pipeline.generation, slot=slot
        )

    def leave_out(self, monitor: Monitor) -> bool:
        """Fit without the channels that are not well; whether those are others than before."""
        if self.pipeline is None:
            return False
        was = self.pipeline.left_out
        self.pipeline.leave_out(monitor.kinds, monitor.badness)
        if self.pipeline.left_out is was:
            return False
        self.left = monitor.kinds.copy(), monitor.badness.copy()
        return True


@dataclass(frozen=True, eq=False)
class _Built:
    """What came of building a pipeline: `asked` or a smaller one, or none and why."""

    sensor: Sensor
    asked: Setup
    pipeline: Pipeline | None
    refusal: str = ""


def _built(sensor: Sensor, asked: Setup, generation: int, smaller: bool) -> _Built:
    """A pipeline as asked, or if it may be `smaller` with the most functions that it can have."""
    refusal = ""
    most = max(asked.Ni, asked.Nj)
    for limit in range(most, 0 if smaller else most - 1, -1):
        setup = replace(asked, Ni=min(asked.Ni, limit), Nj=min(asked.Nj, limit))
        try:
            return _Built(sensor, asked, Pipeline(sensor, setup, generation), refusal)
        except Refusal as reason:
            refusal = refusal or str(reason)
        except MemoryError:
            refusal = refusal or (
                f"{asked.Ni} x {asked.Nj} functions for {sensor.layout} do not fit in memory; "
                "use fewer"
            )
    return _Built(sensor, asked, None, refusal)


_SHOWN_EVERY = 1 / 60  # s between two frames that are computed


class ComparedPipeline:
    """A `side` that computes as often as it is looked at, and nothing while nobody compares."""

    def __init__(self, ring: Ring, builder: Executor, told: PipelineStatus) -> None:
        self.side = PipelineHost(ring, builder, told)
        self._wanted, self._seen = False, -math.inf

    @property
    def told(self) -> PipelineStatus | None:
        return self.side.told if self._wanted else None

    def ask(self, setup: Setup | None, sensor: Sensor | None) -> None:
        """Compute with this setup of what `sensor` brings; with None no more."""
        self._wanted = setup is not None
        if setup is None:
            self.side.meet(None)
            return
        self.side.ask(setup)
        if self.side.pipeline is None:
            self.side.meet(sensor)

    def meet(self, sensor: Sensor | None) -> None:
        """Begin with another sensor."""
        self.side.meet(sensor if self._wanted else None)

    def pass_over(self, frame: Frame) -> None:
        """Leave out a frame for which there is no time."""
        if self.side.pipeline is not None:
            self.side.pipeline.pass_over(frame)

    def take(self, frame: Frame, stands: bool) -> None:
        """Compute a frame, if the last that was is long ago or the source `stands` at this one."""
        pipeline = self.side.pipeline
        if pipeline is None:
            return
        if stands or frame.host_time - self._seen >= _SHOWN_EVERY:
            self._seen = frame.host_time
            self.side.ring.write(pipeline(frame))
        else:
            pipeline.pass_over(frame)
