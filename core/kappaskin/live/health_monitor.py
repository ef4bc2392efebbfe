"""Frames to the health of a sensor's channels, and to fits that do without those not well."""

import numpy as np

from kappaskin.frames import Array, Frame
from kappaskin.health import Health, Monitor
from kappaskin.live.pipelines import PipelineHost
from kappaskin.pipeline import Pipeline
from kappaskin.scenes import Scene
from kappaskin.sensing import Sensor


class LiveHealthMonitor:
    """Looks after the channels of the sensor it met last; without one there is nothing to see."""

    def __init__(self) -> None:
        self._monitor: Monitor | None = None
        self._spoilt: object = None  # by what, in a simulated scene

    def meet(self, sensor: Sensor | None) -> None:
        self._monitor = None if sensor is None else Monitor(sensor)

    def spoil(self, scene: Scene) -> None:
        """Begin anew where other effects are simulated: they may shift every channel."""
        spoilt = (scene.effects, scene.choice, scene.seed)
        if spoilt != self._spoilt and self._monitor is not None:
            self._monitor.begin_anew()
        self._spoilt = spoilt

    def __call__(self, frame: Frame) -> bool:
        """Take in the next frame; whether other channels than before may not be well."""
        return self._monitor is not None and self._monitor(frame)

    def leave_out(self, side: PipelineHost) -> bool:
        """Let a side fit without those that are not well; whether they are others than before."""
        return self._monitor is not None and side.leave_out(self._monitor)

    def health(self, pipeline: Pipeline | None, place: Array) -> Health:
        """What is found, and what it costs a `pipeline`, also at `place` (2,) in m."""
        if self._monitor is None or pipeline is None:
            return Health()
        out, kinds = pipeline.left_out, self._monitor.kinds
        kept = out.kept.ravel()
        return Health(
            self._monitor.findings(kept),
            int(np.count_nonzero(kinds)),
            int(np.count_nonzero(kept)),
            out.cost,
            out.cost_at(place),
        )
