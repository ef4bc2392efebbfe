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

from kappaskin._processes import Haste
from kappaskin.errors import Refusal, SourceError
from kappaskin.frames import Event, Frame
from kappaskin.live.health_monitor import LiveHealthMonitor
from kappaskin.live.pipelines import ComparedPipeline, PipelineHost, PipelineStatus
from kappaskin.live.recorder import LiveRecorder
from kappaskin.live.region_tracking import SerialTracking, SimulatedTracking, track_region
from kappaskin.live.requests import Action, Note, Seek, StepFrames, TakeTare, Update
from kappaskin.live.resume import RequestReceiver
from kappaskin.live.ring import Ring
from kappaskin.live.status import LOST, STREAMING, WAITING, Status
from kappaskin.live.tare_taking import TareCapture
from kappaskin.live.timing import ArrivalTimes, RateLimit
from kappaskin.pipeline import Pipeline
from kappaskin.publish import Publishing
from kappaskin.recording import ReplayedSource
from kappaskin.scenes import FROM_THE_BEGINNING, Scene
from kappaskin.sensing import Sensor
from kappaskin.sources import SimulatedSource, Source, open_source

_READ = 0.02  # s a read may wait, and so a command
_REPORT = 0.1  # s between two statuses
_AGAIN = 0.5  # s between two tries to open a port
_FRESH = 1.5e-3  # s of computing between two reads where receivers wait for the newest


class EngineLoop:
    """The engine's own side: takes requests, reads, computes, writes, reports."""

    def __init__(self, requests: RequestReceiver, ring: Ring, beside: Ring) -> None:
        self._requests, self._ring = requests, ring
        self._source: Source | None = None
        self._watching = LiveHealthMonitor()
        self._place = np.full(2, math.nan)  # of the last contact, in m
        self._keeping = LiveRecorder()
        self._status: Status = ring.read_status() or Status()
        self._steering: SimulatedTracking | SerialTracking | None = None
        # Two, so that one given up in the middle of a large basis does not hold up the next.
        self._builder = ThreadPoolExecutor(2, "pipeline-builder")
        status = self._status
        self._side = PipelineHost(
            ring, self._builder, PipelineStatus(status.setup, status.generation)
        )
        self._compared = ComparedPipeline(beside, self._builder, status.beside or PipelineStatus())
        self._taking = TareCapture(self._builder, self._status.tare)
        self._publishing, self._told = Publishing(), self._status.happened
        self._haste = Haste()
        self._arrivals, self._pace = ArrivalTimes(), RateLimit()
        self._changing, self._again = False, math.inf

    def run(self) -> None:
        """Serve until the window says goodbye, or is gone and none resumes this engine."""
        while True:
            for request in self._requests.receive(0.05 if self._source is None else 0.0):
                self._carry_out(request)
            if not self._goes_on():
                break
            if self._source is not None:
                self._read(self._source)
            elif time.monotonic() >= self._again:
                self._open(self._status.source)
            self._swap()
            if self._side.pipeline is not None and self._source is not None:
                self._taking.go_on(self._side.pipeline, self._source)
            if time.monotonic() - self._status.reported >= _REPORT:
                self._report()
        self._close()
        self.end_recording()
        self._publishing.close()
        self._builder.shutdown(wait=False, cancel_futures=True)

    def _goes_on(self) -> bool:
        """Whether there is a window, or one may come yet for what is recorded."""
        if news := self._requests.check(self._keeping.active):
            self._happen(Event(time.monotonic(), "engine", news))
            self._report()
        return not self._requests.over

    @property
    def may_be_resumed(self) -> bool:
        """Whether it goes on where the window is gone."""
        return self._requests.resumable and self._keeping.active

    def _carry_out(self, request: str | Action) -> None:
        """Go over to the setting of `Requested` of this name, or do what is to be done once."""
        requested = self._requests.requested
        match request:
            case "setup":
                self._side.ask(requested.setup)
            case "compared":
                self._compared.ask(requested.compared, self._status.sensor)
            case "region":
                self._status = replace(self._status, region=requested.region)
                self._steer()
            case "targets":
                self._publishing.ask(requested.targets)
                self._haste(self._publishing.active)
            case "source":
                self._go_to(requested.source)
            case "scene":
                self._play(requested.scene)
            case "recording":
                self._keeping.begin(requested.recording, self._source, self._side)
            case Seek() | StepFrames():
                self._move(request)
            case TakeTare():
                streams = self._status.state == STREAMING
                self._taking.begin(self._status.sensor if streams else None)
            case Note():
                self._happen(Event(time.monotonic(), "note", request.text))
            case _:
                return
        self._report()

    def _go_to(self, source: str | None) -> None:
        """Close the source, and open another one."""
        self._close()
        self._status = self._status.without_source()
        if source is not None:
            self._open(source)

    def _open(self, name: str) -> None:
        """Open the source, or say why not; a port that cannot be is tried again now and then."""
        self._again = math.inf
        try:
            self._source = open_source(name)
            self._keeping.listen(self._source)
            self._status = replace(self._status, state=WAITING, source=name, message="")
        except SourceError as error:
            self._again = time.monotonic() + _AGAIN
            self._status = replace(self._status, state=LOST, source=name, message=str(error))
        except Refusal as refusal:
            self._status = replace(self._status, state=LOST, source=name, message=str(refusal))

    def _move(self, request: Seek | StepFrames) -> None:
        """Go on from another place of the source."""
        source = self._source
        try:
            if isinstance(request, StepFrames):
                if isinstance(source, ReplayedSource):
                    source.step(request.frames)
            elif isinstance(source, ReplayedSource):
                source.seek(request.at, request.speed, request.looped)
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
            self._watching.spoil(scene)
            self._keeping.plays(self._source)
        except Refusal as refusal:
            message = str(refusal)
        self._changing = False
        self._status = replace(self._status, message=message)

    def _steer(self) -> None:
        """Let the source scan the region asked for, or say why it does not."""
        self._steering, refusal = None, ""
        if self._source is not None and self._status.sensor is not None:
            try:
                self._steering = track_region(self._source, self._status.region)
            except Refusal as reason:
                refusal = str(reason)
        self._status = replace(self._status, region_refusal=refusal)

    def _close(self) -> None:
        self._taking.give_up("the connection ended; connect again, then tare")
        if self._source is not None:
            self._source.close()
            self._keeping.ended()
        self._source = None
        for side in (self._side, self._compared.side):
            side.forget()
        self._steering = None
        self._watching.meet(None)
        self._arrivals.clear()
        self._again = math.inf

    def _swap(self) -> None:
        """Go over to what has been built."""
        was = self._side.pipeline
        if self._side.swap():
            if self._side.pipeline is not was:
                self._keeping.set_up(self._side)
                self._leave_out(self._side)
            self._show_again()
            self._report()
        if self._compared.side.swap():
            self._leave_out(self._compared.side)
            self._show_again()
            self._report()

    def _show_again(self) -> None:
        """Let what a recording shows that stands be seen with another setup too."""
        if isinstance(self._source, ReplayedSource):
            self._source.again()

    def _read(self, source: Source) -> None:
        try:
            frames = source.read(_READ)
        except Refusal as error:  # a scene that leaves its skin, a file that is gone
            self._lose(str(error))
            return
        self._follow(source)
        self._arrivals.read(frames)
        if self._side.pipeline is not None:
            self._compute(frames, self._side.pipeline)
        # Afterwards: what is left out is left out from the next frame that is read.
        for frame in frames:
            self._watch(frame)

    def _lose(self, message: str) -> None:
        """Let go of a source of which nothing more comes."""
        if self._source is not None:
            self._status = replace(self._status, accounting=self._source.accounting())
        self._close()
        self._status = replace(self._status, state=LOST, message=message, rate=0.0, replay=None)
        self._report()

    def _compute(self, frames: list[Frame], pipeline: Pipeline) -> None:
        """Work out the newest frames, as many as there is time for."""
        within = (_FRESH,) if self._publishing.active else ()
        source = self._source
        stands = isinstance(source, ReplayedSource) and source.stands
        least = min(len(frames), int(stands))  # or nobody would see what was asked for
        late = len(frames) - max(self._pace.affordable(len(frames), *within), least)
        if late:
            self._status = replace(self._status, skipped=self._status.skipped + late)
        for frame in frames[:late]:
            pipeline.pass_over(frame)
            self._compared.pass_over(frame)
            self._arrivals.used(frame)
        began = time.monotonic()
        for frame in frames[late:]:
            begun = time.monotonic()
            estimate = pipeline(frame)
            self._publishing.send(estimate, pipeline, begun)
            self._side.ring.write(estimate)
            self._taking.receive(estimate)
            self._arrivals.used(frame)
            self._place = estimate.touch.position
            if self._steering is not None:
                self._steering(estimate.touch, pipeline.fit)
            self._keeping.take(frame, estimate)
            self._compared.take(frame, stands)
        self._pace.spend(len(frames) - late, time.monotonic() - began)

    def _follow(self, source: Source) -> None:
        """Say how the source is doing, and who is on it."""
        trouble, was = source.trouble, self._status
        if source.sensor is not was.sensor:
            self._meet(source.sensor)
        state = LOST if trouble else WAITING if source.sensor is None else STREAMING
        if state != was.state or ((trouble or was.state == LOST) and trouble != was.message):
            self._status = replace(self._status, state=state, message=trouble)
        events = source.events()
        self._status = self._status.after(events)
        self._keeping.brought(events)
        told = self._steering is None or self._steering.refusal == was.region_refusal
        if self._steering is not None and not told:
            self._status = replace(self._status, region_refusal=self._steering.refusal)
        if state != was.state or events or not told:
            self._report()

    def _watch(self, frame: Frame) -> None:
        """Look after the health of the channels, and leave out of the fit which are not well."""
        if self._watching(frame):
            self._leave_out(self._side)
            self._leave_out(self._compared.side)

    def _leave_out(self, side: PipelineHost) -> None:
        if self._watching.leave_out(side) and side is self._side:
            self._keeping.leave_out(side)

    def _happen(self, event: Event) -> None:
        """Tell of something that happened."""
        self._status = self._status.after([event])
        self._keeping.happened(event)

    def end_recording(self) -> None:
        """End the file, if one is recorded to, and wait until it is on the disk."""
        self._keeping.close()

    def _meet(self, sensor: Sensor | None) -> None:
        """A device said what it is: make the pipelines for it."""
        self._taking.give_up("another device answered, or the same one anew; tare again")
        self._watching.meet(sensor)
        self._status = replace(
            self._status,
            sensor=sensor,
            meetings=self._status.meetings + (sensor is not None),
        )
        self._side.meet(sensor)
        self._compared.meet(sensor)
        if sensor is not None:
            self._steer()

    def _report(self) -> None:
        if trouble := self._keeping.look(self._source):
            self._happen(Event(time.monotonic(), "recording", trouble))
        now, source, status = time.monotonic(), self._source, self._status
        if source is not None:
            watch = self._side.pipeline.drift if self._side.pipeline else None
            status = replace(
                status,
                accounting=source.accounting(),
                temperature=source.temperature,
                drift=watch.tell() if watch else None,
                rate=self._arrivals.rate(now),
                reader_gap=self._arrivals.gap(now),
                last_frame=self._arrivals.last,
                playing=source.playing
                if isinstance(source, SimulatedSource)
                else FROM_THE_BEGINNING,
                health=self._watching.health(self._side.pipeline, self._place),
                replay=source.replay if isinstance(source, ReplayedSource) else None,
            )
        self._publishing.tell(status.told_since(self._told))
        self._told = status.happened
        told = self._side.told
        self._status = replace(
            status,
            reported=now,
            tare=self._taking.news,
            setup=told.setup,
            generation=told.generation,
            slot=told.slot,
            refusal=told.refusal,
            computing=told.computing or self._changing,
            publishing=self._publishing.news,
            recording=self._keeping.written,
            beside=self._compared.told,
            requested=self._requests.requested.number,
        )
        self._ring.write_status(self._status)


_SWITCH = 2e-4  # s that one thread may keep the interpreter from another
_GRACE = 0.5  # s for an orderly end once the parent is gone


def serve(
    requests: "Connection[Update, Update]",
    names: tuple[str, str],
    orphans: Path | None,
    patience: float,
) -> None:
    """Do as the `requests` say, and write to the rings of these `names`, until that is over."""
    # The thread that reads the line needs the interpreter three times for 4 KiB: with Python's 5 ms
    # for each, a loop that always computes would starve it below the rate of the line.
    sys.setswitchinterval(_SWITCH)
    gc.freeze()  # what was imported is no garbage: to look through it takes 27 ms each time
    # Ctrl+C and a terminal that closes are the parent's: it says goodbye, or is gone.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    rings = Ring.attach(names[0]), Ring.attach(names[1])
    try:
        loop = EngineLoop(RequestReceiver(requests, names, orphans, patience), *rings)
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

    What was recorded is ended first. What is being recorded, and may be adopted, goes on.
    """
    if parent := multiprocessing.parent_process():
        parent.join()
        time.sleep(_GRACE)
        if not loop.may_be_resumed:
            loop.end_recording()
            os._exit(1)
