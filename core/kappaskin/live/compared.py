"""Frames to estimates with another setup too, while that is asked for."""

import math
from concurrent.futures import Executor

from kappaskin.frames import Frame
from kappaskin.live.pipelines import Computed, Side
from kappaskin.live.ring import Ring
from kappaskin.pipeline import Setup
from kappaskin.sensing import Sensor

_LOOKED_AT = 1 / 60  # s between two frames that are computed


class Compared:
    """A `side` that computes as often as it is looked at, and nothing while nobody compares."""

    def __init__(self, ring: Ring, builder: Executor, told: Computed) -> None:
        self.side = Side(ring, builder, told)
        self._wanted, self._seen = False, -math.inf

    @property
    def told(self) -> Computed | None:
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
        if stands or frame.host_time - self._seen >= _LOOKED_AT:
            self._seen = frame.host_time
            self.side.ring.write(pipeline(frame))
        else:
            pipeline.pass_over(frame)
