"""Health monitor of the engine: faulty channels, which the fits then exclude."""

import numpy as np

from kappaskin.frames import Array, Frame
from kappaskin.health import Health, HealthMonitor
from kappaskin.live.pipelines import PipelineHost
from kappaskin.pipeline import Pipeline
from kappaskin.scenes import Scene
from kappaskin.sensing import Sensor


class LiveHealthMonitor:
    """Monitors the channels of the sensor that is connected."""

    def __init__(self) -> None:
        self._monitor: HealthMonitor | None = None
        self._effects: object = None  # of a simulated scene

    def connect(self, sensor: Sensor | None) -> None:
        self._monitor = None if sensor is None else HealthMonitor(sensor)

    def follow_scene(self, scene: Scene) -> None:
        """Restart where other effects are simulated: they may shift every channel."""
        effects = (scene.effects, scene.choice, scene.seed)
        if effects != self._effects and self._monitor is not None:
            self._monitor.reset()
        self._effects = effects

    def __call__(self, frame: Frame) -> bool:
        """Take the next frame; whether other channels than before may be faulty."""
        return self._monitor is not None and self._monitor(frame)

    def exclude(self, host: PipelineHost) -> bool:
        """Let a pipeline fit without the faulty ones; whether they are others than before."""
        return self._monitor is not None and host.exclude(self._monitor)

    def health(self, pipeline: Pipeline | None, place: Array) -> Health:
        """Findings, and what they cost a `pipeline` in accuracy, also at `place` (2,) in m."""
        if self._monitor is None or pipeline is None:
            return Health()
        out, kinds = pipeline.left_out, self._monitor.kinds
        kept = out.retained.ravel()
        return Health(
            self._monitor.findings(kept),
            int(np.count_nonzero(kinds)),
            int(np.count_nonzero(kept)),
            out.cost,
            out.cost_at(place),
        )
