"""The engine's loop: reads a source, computes, records, publishes and reports."""

import gc
import math
import multiprocessing
import os
import signal
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from kappaskin._processes import ProcessPriority
from kappaskin.errors import EndedSource, Refusal, SourceError
from kappaskin.frames import Event, Frame
from kappaskin.hand import load_hand as load_hand  # registers hand:
from kappaskin.live.pipelines import (
    ComparedPipeline,
    LiveHealthMonitor,
    NoiseCheck,
    NoisyPipeline,
    PipelineHost,
    PipelineStatus,
)
from kappaskin.live.recorder import LiveRecorder
from kappaskin.live.region_tracking import SerialTracking, SimulatedTracking, track_region
from kappaskin.live.requests import Action, Note, RestartEffects, Seek, StepFrames, TakeTare, Update
from kappaskin.live.resume import RequestReceiver
from kappaskin.live.ring import Ring
from kappaskin.live.status import LOST, STREAMING, WAITING, Status
from kappaskin.live.tare_taking import TareCapture
from kappaskin.live.timing import ArrivalTimes, ComputingTimes, RateLimit
from kappaskin.pipeline import QUANTITIES, Pipeline, Setup
from kappaskin.publish import Publishing
from kappaskin.recording import ReplayedSource
from kappaskin.scenes import Playback, Scene
from kappaskin.sensing import Sensor
from kappaskin.sources import SimulatedSource, Source, open_source, parts_of

_READ = 0.02  # s a read may wait, and so a command
_REPORT = 0.1  # s between two statuses
_AGAIN = 0.5  # s between two tries to open a port
_AT_CONTACT = "contact", "geometry"  # published and recorded of each frame; the surface is neither


class EngineLoop:
    """The engine's loop: takes requests, reads, computes, records, publishes and reports."""

    def __init__(self, requests: RequestReceiver, ring: Ring, compared: Ring) -> None:
        self._requests, self._ring = requests, ring
        self._source: Source | None = None
        self._next: Source | None = None  # requested, and has not answered yet
        self._health, self._noise = LiveHealthMonitor(), NoiseCheck()
        self._place = np.full(2, math.nan)  # of the last contact, in m
        self._status: Status = ring.read_status() or Status()
        self._recorder = LiveRecorder(self._status.recording)
        self._tracking: SimulatedTracking | SerialTracking | None = None
        # Two, so that one given up in the middle of a large basis does not hold up the next.
        self._builder = ThreadPoolExecutor(2, "pipeline-builder")
        status = self._status
        self._main = PipelineHost(
            ring, self._builder, PipelineStatus(status.setup, status.generation)
        )
        self._compared = ComparedPipeline(
            compared, self._builder, status.compared or PipelineStatus()
        )
        self._noisy = NoisyPipeline(self._builder)
        self._tare = TareCapture(self._builder, self._status.tare)
        self._publishing, self._reported_events = Publishing(), self._status.event_count
        self._haste = ProcessPriority()
        self._arrivals, self._rate_limit = ArrivalTimes(), RateLimit()
        self._computing = ComputingTimes()
        self._changing, self._again = False, math.inf

    def run(self) -> None:
        """Serve until the window ends it, or is gone and none resumes this engine."""
        while True:
            for request in self._requests.receive(0.05 if self._source is None else 0.0):
                self._carry_out(request)
            if not self._may_continue():
                break
            if self._source is not None:
                self._read(self._source)
            elif time.monotonic() >= self._again:
                self._open(self._status.source)
            if self._next is not None:
                self._try_next(self._next)
            self._swap()
            pipeline, source = self._main.pipeline, self._source
            if pipeline is not None and source and self._tare.update(pipeline, source):
                self._add_event(Event(time.monotonic(), "tare", "Tare taken"))
            if time.monotonic() - self._status.reported >= _REPORT:
                self._report()
        self._drop_next()
        self._close()
        self.end_recording()
        self._publishing.close()
        self._builder.shutdown(wait=False, cancel_futures=True)

    def _may_continue(self) -> bool:
        """Whether there is a window, or one may come yet for what is recorded."""
        if change := self._requests.check(self._recorder.active):
            self._add_event(Event(time.monotonic(), "engine", change))
            self._report()
        return not self._requests.over

    @property
    def may_be_resumed(self) -> bool:
        """Whether it continues without a window."""
        return self._requests.resumable and self._recorder.active

    def _carry_out(self, request: str | Action) -> None:
        """Apply the setting of `Requested` of this name, or carry out an action."""
        requested = self._requests.requested
        match request:
            case "setup":
                self._main.request(requested.setup)
            case "compared":
                self._compared.request(requested.compared, self._status.sensor)
            case "region":
                self._status = replace(self._status, region=requested.region)
                self._track_region()
            case "targets":
                self._publishing.request(requested.targets, requested.access, requested.finger)
                self._haste(self._publishing.active)
            case "source":
                self._go_to(requested.source)
            case "scene":
                self._play(requested.scene)
            case "recomputes":
                self._recompute()
            case "added_noise":
                self._noisy.rms = requested.added_noise
            case "recording":
                self._recorder.begin(requested.recording, self._source, self._main)
            case Seek() | StepFrames():
                self._move(request)
            case TakeTare():
                streams = self._status.state == STREAMING
                self._tare.begin(self._status.sensor if streams else None)
            case RestartEffects() if requested.scene is not None:
                self._play(replace(requested.scene, effects=()))
                self._play(requested.scene)
            case Note():
                self._add_event(Event(time.monotonic(), "note", request.text))
            case _:
                return
        self._report()

    def _go_to(self, name: str | None) -> None:
        """Open a source; the one in use streams on until the other one answers."""
        now = self._status
        returns = now.connecting or now.source_refusal
        self._drop_next()
        if returns and name == now.source:
            return
        # A port is opened once: the same one with another description must be closed before.
        if name is None or now.state != STREAMING or _place(name) == _place(now.source):
            self._close()
            self._status = self._status.without_source()
            if name is not None:
                self._open(name)
            return
        try:
            self._next = open_source(name, self._requests.requested.trust)
        except Refusal as refusal:
            self._status = replace(self._status, source_refusal=str(refusal))
            return
        self._status = replace(self._status, connecting=name)
        self._try_next(self._next)

    def _drop_next(self, refusal: str = "") -> None:
        """Close the source that has not answered, on a `refusal` or without."""
        if self._next is not None:
            self._next.close()
        self._next = None
        self._status = replace(self._status, connecting="", source_refusal=refusal)

    def _try_next(self, source: Source) -> None:
        """Use the requested source as soon as it answers, or the one in use is lost."""
        try:
            if source.sensor is None:
                source.read(0.0)
        except Refusal as refusal:
            self._drop_next(str(refusal))
            self._report()
            return
        now, trouble = self._status, source.trouble
        if source.sensor is not None or now.state != STREAMING:
            self._next = None
            self._close()
            self._status = self._status.without_source()
            self._use(source, now.connecting)
        elif trouble != now.source_refusal:
            self._status = replace(now, source_refusal=trouble)

    def _open(self, name: str) -> None:
        """Open the source; `status` says why it cannot be, and a port is then retried."""
        self._again = math.inf
        try:
            self._use(open_source(name, self._requests.requested.trust), name)
        except SourceError as error:
            self._again = time.monotonic() + _AGAIN
            self._status = replace(self._status, state=LOST, source=name, message=str(error))
        except Refusal as refusal:
            self._status = replace(self._status, state=LOST, source=name, message=str(refusal))

    def _use(self, source: Source, name: str) -> None:
        """Take frames from the `source` of this `name`, which is open."""
        self._source = source
        self._recorder.connect(source)
        self._recompute()
        self._status = replace(self._status, state=WAITING, source=name, message="")

    def _recompute(self) -> None:
        """Let a recording show its recorded estimates, or such as are computed again."""
        if isinstance(self._source, ReplayedSource):
            self._source.recomputes = self._requests.requested.recomputes
            self._source.again()

    def _move(self, request: Seek | StepFrames) -> None:
        """Move to another position in the source."""
        source = self._source
        try:
            if isinstance(request, StepFrames):
                if isinstance(source, ReplayedSource):
                    source.step(request.frames)
            elif isinstance(source, ReplayedSource):
                source.seek(request.at, request.speed, request.looped, request.since)
            elif isinstance(source, SimulatedSource):
                source.seek(request.at, request.speed)
        except Refusal as refusal:  # a file that is damaged there, or gone
            self._lose(str(refusal))

    def _play(self, scene: Scene | None) -> None:
        if scene is None or not isinstance(self._source, SimulatedSource):
            return
        message, self._changing = "", True
        self._report()  # another skin may take a while
        try:
            self._source.play(scene)
            self._health.follow_scene(scene)
            self._recorder.add_scene(self._source)
        except Refusal as refusal:
            message = str(refusal)
        self._changing = False
        self._status = replace(self._status, message=message)

    def _track_region(self) -> None:
        """Let the source scan the requested region; `status` says why it does not."""
        self._tracking, refusal = None, ""
        if self._source is not None and self._status.sensor is not None:
            try:
                self._tracking = track_region(self._source, self._status.region)
            except Refusal as reason:
                refusal = str(reason)
        self._status = replace(self._status, region_refusal=refusal)

    def _close(self) -> None:
        self._tare.cancel("the connection ended; connect again, then tare")
        if self._source is not None:
            self._source.close()
            self._recorder.source_ended()
        self._source = None
        for host in (self._main, self._compared.host):
            host.disconnect()
        self._tracking = None
        self._health.connect(None)
        self._arrivals.clear()
        self._again = math.inf

    def _swap(self) -> None:
        """Use the pipelines that have been built."""
        was = self._main.pipeline
        if self._main.swap():
            if self._main.pipeline is not was:
                self._recorder.set_up(self._main)
                self._exclude(self._main)
            self._show_again()
            self._report()
        if self._compared.host.swap():
            self._exclude(self._compared.host)
            self._show_again()
            self._report()

    def _show_again(self) -> None:
        """Compute the frame at which a recording is paused once more, with another setup."""
        if isinstance(self._source, ReplayedSource):
            self._source.again()

    def _read(self, source: Source) -> None:
        try:
            frames = source.read(_READ)
        except Refusal as error:  # a scene that leaves its skin, a file that is gone
            self._lose(str(error), isinstance(error, EndedSource))
            return
        self._follow(source)
        self._arrivals.read(frames)
        if self._main.pipeline is not None:
            self._compute(frames, self._main.pipeline)
        # Afterwards: what is left out is left out from the next frame that is read.
        for frame in frames:
            self._check_health(frame)

    def _lose(self, message: str, ended: bool = False) -> None:
        """Close a source that failed, or `ended`."""
        if self._source is not None:
            self._status = replace(self._status, accounting=self._source.accounting())
        self._close()
        lost = {"state": LOST, "message": message, "ended": ended}
        self._status = replace(self._status, **lost, rate=0.0, replay=None)
        self._report()

    def _compute(self, frames: list[Frame], pipeline: Pipeline) -> None:
        """Compute the newest frames, as many as there is time for."""
        source = self._source
        paused = isinstance(source, ReplayedSource) and source.stands
        least = min(len(frames), int(paused))  # or a requested frame would not be shown
        affordable = self._rate_limit.affordable(len(frames), self._publishing.active)
        late = len(frames) - max(affordable, least)
        if late:
            self._status = replace(self._status, skipped=self._status.skipped + late)
        for frame in frames[:late]:
            pipeline.pass_over(frame)
            self._noisy.pass_over(frame)
            self._compared.pass_over(frame)
            self._arrivals.used(frame)
        pipeline.wanted = self._wanted(pipeline.setup)
        began = time.monotonic()
        for frame in frames[late:]:
            begun = time.monotonic()
            estimate = pipeline(frame)
            if isinstance(source, ReplayedSource):
                estimate = source.as_recorded(estimate, pipeline)
            estimated = time.monotonic()
            self._publishing.send(estimate, pipeline, begun)
            published = time.monotonic()
            seen, shown = self._noisy(frame, estimate, pipeline)
            self._main.ring.write(shown)
            self._tare.take(estimate)
            self._arrivals.used(frame)
            self._place = estimate.contact.position
            if self._tracking is not None:
                self._tracking(estimate.contact, pipeline.fit)
            self._recorder.take(frame, estimate)
            self._compared.take(seen, paused)
            kept = time.monotonic() - published
            self._computing.add(estimated - begun, published - estimated, kept)
        self._rate_limit.spend(len(frames) - late, time.monotonic() - began)

    def _wanted(self, setup: Setup) -> frozenset[str]:
        """The quantities that the setup names, and those that receivers, files and scans need."""
        used = self._publishing.active or self._recorder.active or self._tracking is not None
        return frozenset((*setup.quantities, *(_AT_CONTACT if used else ())))

    def _follow(self, source: Source) -> None:
        """Update the status of the source and of the device on it."""
        trouble, was = source.trouble, self._status
        if source.sensor is not was.sensor:
            self._connected(source.sensor)
        state = LOST if trouble else WAITING if source.sensor is None else STREAMING
        if state != was.state or ((trouble or was.state == LOST) and trouble != was.message):
            self._status = replace(self._status, state=state, message=trouble)
        events = source.events()
        self._status = self._status.after(events)
        self._recorder.add_events(events)
        same = self._tracking is None or self._tracking.refusal == was.region_refusal
        if self._tracking is not None and not same:
            self._status = replace(self._status, region_refusal=self._tracking.refusal)
        if state != was.state or events or not same:
            self._report()

    def _check_health(self, frame: Frame) -> None:
        """Check the health of the channels, and exclude faulty ones from the fit."""
        # On a mesh a monitor needs functions, which the pipeline has made by then.
        if self._main.pipeline is not None and self._health(frame):
            self._exclude(self._main)
            self._exclude(self._compared.host)

    def _exclude(self, host: PipelineHost) -> None:
        if self._health.exclude(host) and host is self._main:
            self._recorder.exclude(host)

    def _add_event(self, event: Event) -> None:
        """Report and record an event."""
        self._status = self._status.after([event])
        self._recorder.add_event(event)

    def end_recording(self) -> None:
        """End the file, if one is recorded to, and wait until it is on the disk."""
        self._recorder.close()

    def _connected(self, sensor: Sensor | None) -> None:
        """A device is connected, or none any more: build the pipelines for it."""
        self._tare.cancel("another device was connected, or the same one restarted; tare again")
        self._health.connect(sensor)
        self._status = replace(
            self._status,
            sensor=sensor,
            connections=self._status.connections + (sensor is not None),
        )
        self._main.connect(sensor)
        self._compared.connect(sensor)
        if sensor is not None:
            self._track_region()

    def _report(self) -> None:
        if trouble := self._recorder.check(self._source):
            self._add_event(Event(time.monotonic(), "recording", trouble))
        now, source, status = time.monotonic(), self._source, self._status
        if source is not None:
            pipeline = self._main.pipeline
            watch, fit = (pipeline.drift, pipeline.fitted) if pipeline else (None, None)
            if fit and (doubt := self._noise(fit)):
                self._add_event(Event(now, "noise", doubt))
                status = self._status
            status = replace(
                status,
                accounting=source.accounting(),
                temperature=source.temperature,
                drift=watch.current() if watch else None,
                rate=self._arrivals.rate(now),
                computed=self._computing.means(),
                quantities=tuple(n for n in QUANTITIES if pipeline and n in pipeline.wanted),
                reader_gap=self._arrivals.gap(now),
                last_frame=self._arrivals.last,
                playing=source.playing if isinstance(source, SimulatedSource) else Playback(),
                pace=source.pace if isinstance(source, SimulatedSource) else 1.0,
                health=self._health.health(pipeline, self._place),
                replay=source.replay if isinstance(source, ReplayedSource) else None,
                slope=fit.neglected_slope if fit else 0.0,
                added_noise=self._noisy.added,
            )
        self._publishing.report(status.source_status(self._reported_events))
        self._reported_events = status.event_count
        computed = self._main.status
        self._status = replace(
            status,
            reported=now,
            tare=self._tare.status,
            setup=computed.setup,
            generation=computed.generation,
            slot=computed.slot,
            refusal=computed.refusal,
            computing=computed.computing or self._changing,
            publishing=self._publishing.status,
            recording=self._recorder.status,
            compared=self._compared.status,
            requested=self._requests.requested.number,
        )
        self._ring.write_status(self._status)


def _place(source: str) -> str:
    """The port, URL or file of a source, the same for each name of a port."""
    return os.path.normcase(os.path.realpath(parts_of(source)[1] or source))


_SWITCH = 2e-4  # s that one thread may keep the interpreter from another
_GRACE = 0.5  # s for an orderly end once the parent is gone


def serve(
    requests: "Connection[Update, Update]",
    names: tuple[str, str],
    resume_from: Path | None,
    patience: float,
) -> None:
    """Run the engine by the `requests`, with the rings of these `names`, until it is to end."""
    # The thread that reads the line needs the interpreter three times for 4 KiB: with Python's 5 ms
    # for each, a loop that always computes would starve it below the rate of the line.
    sys.setswitchinterval(_SWITCH)
    gc.freeze()  # what was imported is no garbage: to look through it takes 27 ms each time
    # Ctrl+C and a terminal that closes are the parent's: it ends this process, or is gone.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    rings = Ring.attach(names[0]), Ring.attach(names[1])
    try:
        loop = EngineLoop(RequestReceiver(requests, names, resume_from, patience), *rings)
        watcher = threading.Thread(target=_end_with_parent, args=(loop,), name="parent-watcher")
        watcher.daemon = True
        watcher.start()
        loop.run()
    finally:
        parent = multiprocessing.parent_process()
        for ring in rings:
            if parent and parent.is_alive():
                ring.close()
            else:
                ring.destroy()


def _end_with_parent(loop: EngineLoop) -> None:
    """End this process soon after the one that started it, whatever is being computed.

    A recording is ended first, unless another window may resume it.
    """
    if parent := multiprocessing.parent_process():
        parent.join()
        time.sleep(_GRACE)
        if not loop.may_be_resumed:
            loop.end_recording()
            os._exit(1)
