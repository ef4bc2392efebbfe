"""Pipelines of the engine, built in the background, and the faulty channels they exclude."""

import math
from collections import deque
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field, replace

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.estimation import Fit, sigma_warning
from kappaskin.frames import Array, Estimate, Frame
from kappaskin.health import FaultCodes, Health, HealthMonitor
from kappaskin.live.ring import Ring, slot_type
from kappaskin.pipeline import Pipeline, Setup, pipeline_for
from kappaskin.scenes import Scene
from kappaskin.sensing import Sensor


@dataclass(frozen=True)
class PipelineStatus:
    """What is computed: with a `setup` of this `generation`, estimates that fill a `slot`.

    `refusal` says why the setup is not the requested one, `computing` that another is being
    prepared. Without a slot there are no estimates yet.
    """

    setup: Setup = field(default_factory=Setup)
    generation: int = 0
    slot: "np.dtype[np.void] | None" = None
    refusal: str = ""
    computing: bool = False


class PipelineHost:
    """Holds the pipeline of the requested setup, or of as much of it as a sensor allows.

    `pipeline` is the one in use, None without a sensor, `status` how it is, and `excluded` the
    kinds and badness of the channels that it leaves out. Its estimates go to `ring`. Pipelines are
    built by `builder`, and those that are overtaken meanwhile are dropped.
    """

    def __init__(self, ring: Ring, builder: Executor, status: PipelineStatus) -> None:
        self.ring, self._builder, self.status = ring, builder, status
        self.pipeline: Pipeline | None = None
        self._sensor: Sensor | None = None
        self._requested = status.setup
        self._building: Future[_Built] | None = None
        self.excluded: tuple[FaultCodes, Array] | None = None

    def request(self, setup: Setup) -> None:
        """Begin to build a pipeline for another setup, while the present one runs on.

        Where a sensor allows fewer functions than were requested, and as many are requested again,
        as with a tare, it has fewer too.
        """
        was, self._requested = self._requested, setup
        used = self.pipeline.setup if self.pipeline else was
        fewer = (used.Ni, used.Nj) != (was.Ni, was.Nj) == (setup.Ni, setup.Nj)
        self._build(smaller=fewer)

    def connect(self, sensor: Sensor | None) -> None:
        """Begin with another sensor; estimates of the last one are no longer shown."""
        self._sensor, self.pipeline = sensor, None
        self.status = replace(self.status, slot=None)
        if sensor is not None:
            self._build(smaller=True)

    def disconnect(self) -> None:
        """Let go of the sensor, and of what is being built."""
        self._building = self._sensor = self.pipeline = None
        self.status = replace(self.status, computing=False, slot=None)

    def _build(self, smaller: bool) -> None:
        if self._sensor is None:
            self.status = replace(self.status, setup=self._requested, refusal="")
        elif self._building is None:
            job = (_built, self._sensor, self._requested, self.status.generation + 1, smaller)
            self._building = self._builder.submit(*job)
            self.status = replace(self.status, computing=True)

    def swap(self) -> bool:
        """Use the pipeline that was built, if one was; whether there was one, or a refusal."""
        if self._building is None or not self._building.done():
            return False
        made, self._building = self._building.result(), None
        self.status = replace(self.status, computing=False)
        if made.requested != self._requested or made.sensor is not self._sensor:
            self._build(smaller=self.pipeline is None or made.smaller)  # overtaken meanwhile
            return False
        self.status = replace(self.status, refusal=made.refusal)
        if made.pipeline is not None:
            self._use(made.pipeline)
        return True

    def _use(self, pipeline: Pipeline) -> None:
        slot = slot_type(pipeline)
        try:
            self.ring.lay_out(pipeline.generation, slot)
        except Refusal as refusal:
            self.status = replace(self.status, refusal=str(refusal))
            return
        if self.pipeline is not None:
            pipeline.continue_from(self.pipeline)
        self.pipeline, self.excluded = pipeline, None
        self.status = replace(
            self.status, setup=pipeline.setup, generation=pipeline.generation, slot=slot
        )

    def exclude(self, monitor: HealthMonitor) -> bool:
        """Fit without the faulty channels; whether those are others than before."""
        if self.pipeline is None:
            return False
        was = self.pipeline.left_out
        self.pipeline.leave_out(monitor.kinds, monitor.badness)
        if self.pipeline.left_out is was:
            return False
        self.excluded = monitor.kinds.copy(), monitor.badness.copy()
        return True


_JUDGED = 50  # fits by which a noise is judged


class NoiseCheck:
    """Says once of each estimator that the readings scatter other than the sensor tells."""

    def __init__(self) -> None:
        self._last: Fit | None = None
        self._ratios, self._said = deque[float](maxlen=_JUDGED), False

    def __call__(self, fit: Fit) -> str:
        """What to say, now that there is this `fit`; mostly nothing."""
        if fit is self._last:
            return ""
        if self._last is None or fit.estimator is not self._last.estimator:
            self._ratios.clear()
            self._said = False
        self._last = fit
        self._ratios.append(fit.sigma_ratio)
        if self._said or len(self._ratios) < _JUDGED:
            return ""
        text = sigma_warning(float(np.median(self._ratios)))
        self._said = bool(text)
        return text


@dataclass(frozen=True, eq=False)
class _Built:
    """A pipeline as `requested`, or a smaller one, or none and why."""

    sensor: Sensor
    requested: Setup
    smaller: bool
    pipeline: Pipeline | None
    refusal: str = ""


def _built(sensor: Sensor, requested: Setup, generation: int, smaller: bool) -> _Built:
    """A pipeline as requested, or if it may be `smaller` with as many functions as possible."""
    try:
        made = pipeline_for(sensor, requested, generation, smaller)
        return _Built(sensor, requested, smaller, *made)
    except Refusal as reason:
        return _Built(sensor, requested, smaller, None, str(reason))


_SHOWN_EVERY = 1 / 60  # s between two frames that are computed


class ComparedPipeline:
    """Computes with a second setup as often as the screen shows it, while one is requested."""

    def __init__(self, ring: Ring, builder: Executor, status: PipelineStatus) -> None:
        self.host = PipelineHost(ring, builder, status)
        self._active, self._last = False, -math.inf

    @property
    def status(self) -> PipelineStatus | None:
        return self.host.status if self._active else None

    def request(self, setup: Setup | None, sensor: Sensor | None) -> None:
        """Compute frames of `sensor` with this setup too; None ends that."""
        self._active = setup is not None
        if setup is None:
            self.host.connect(None)
            return
        self.host.request(setup)
        if self.host.pipeline is None:
            self.host.connect(sensor)

    def connect(self, sensor: Sensor | None) -> None:
        """Begin with another sensor."""
        self.host.connect(sensor if self._active else None)

    def pass_over(self, frame: Frame) -> None:
        """Leave out a frame for which there is no time."""
        if self.host.pipeline is not None:
            self.host.pipeline.pass_over(frame)

    def take(self, frame: Frame, paused: bool) -> None:
        """Compute a frame, if the last one is long ago or the source is `paused` at this one."""
        pipeline = self.host.pipeline
        if pipeline is None:
            return
        if paused or frame.host_time - self._last >= _SHOWN_EVERY:
            self._last = frame.host_time
            self.host.ring.write(pipeline(frame))
        else:
            pipeline.pass_over(frame)


class NoisyPipeline:
    """Computes what the window shows while noise of `rms` in 1/m is added to the readings.

    It has a state of its own, so that what is recorded and published has none of the noise; `added`
    is the RMS of the noise in the last estimate.
    """

    def __init__(self, builder: Executor) -> None:
        self._builder, self._random = builder, np.random.default_rng()
        self._of: Pipeline | None = None
        self._made: Future[Pipeline] | None = None
        self.rms = self.added = 0.0

    def pass_over(self, frame: Frame) -> None:
        """Leave out a frame for which there is no time."""
        if self._made is not None and self.added:
            self._made.result().pass_over(frame)

    def __call__(
        self, frame: Frame, estimate: Estimate, pipeline: Pipeline
    ) -> tuple[Frame, Estimate]:
        """The frame and the estimate to show, of an `estimate` by the `pipeline` without noise."""
        if pipeline is not self._of or not self.rms:
            self._of, self._made, self.added = pipeline, None, 0.0
        if not self.rms:
            return frame, estimate
        if self._made is None:
            job = (Pipeline, pipeline.sensor, pipeline.setup, pipeline.generation)
            self._made = self._builder.submit(*job)
        if not self._made.done() or self._made.exception() is not None:  # of too little memory
            return frame, estimate
        noisy = self._made.result()
        if not self.added:
            noisy.restore(pipeline.state())
        self.added, noisy.wanted, noisy.left_out = self.rms, pipeline.wanted, pipeline.left_out
        seen = self._with_noise(frame, pipeline.sensor)
        return seen, noisy(seen)

    def _with_noise(self, frame: Frame, sensor: Sensor) -> Frame:
        """A frame with noise; a reading on a rail, or none, stays there."""
        chain, counts = sensor.transduction, frame.counts
        noise = self._random.normal(0.0, self.rms / chain.resolution, counts.shape)
        noisy = np.clip(np.rint(counts + noise), *chain.limits).astype(counts.dtype)
        return replace(frame, counts=np.where(chain.saturated(counts), counts, noisy))


class LiveHealthMonitor:
    """Monitors the channels of the sensor that is connected."""

    def __init__(self) -> None:
        self._sensor: Sensor | None = None
        self._monitor: HealthMonitor | None = None
        self._effects: object = None  # of a simulated scene

    def connect(self, sensor: Sensor | None) -> None:
        """Begin with another sensor, at the first frame."""
        self._sensor, self._monitor = sensor, None

    def follow_scene(self, scene: Scene) -> None:
        """Restart where other effects are simulated: they may shift every channel."""
        effects = (scene.effects, scene.choice, scene.seed)
        if effects != self._effects and self._monitor is not None:
            self._monitor.reset()
        self._effects = effects

    def __call__(self, frame: Frame) -> bool:
        """Take the next frame; whether other channels than before may be faulty."""
        if self._monitor is None and self._sensor is not None:
            self._monitor = HealthMonitor(self._sensor)
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
