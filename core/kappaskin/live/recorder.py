"""Recorder of the engine: the source's input and the pipeline's results, to a file."""

import time
from collections.abc import Sequence
from pathlib import Path

from kappaskin.errors import Refusal
from kappaskin.frames import Estimate, Event, Frame
from kappaskin.live.pipelines import PipelineHost
from kappaskin.recording import HandPart, Recorder, RecordingStatus, ReplayedSource
from kappaskin.sources import SimulatedSource, Source


class LiveRecorder:
    """Records the input of a source and the results of a pipeline; `status` has its state.

    No call does anything until `begin`, `status` is the one `before`. Only `close` waits for the
    disk.
    """

    def __init__(self, before: RecordingStatus | None = None) -> None:
        self._recorder: Recorder | None = None
        self._newest: Recorder | None = None  # that `status` is of, until it has ended
        self._ending: list[Recorder] = []
        self._live = True  # what a recording brings is not recorded again
        self.status = before or RecordingStatus()

    @property
    def active(self) -> bool:
        return self._recorder is not None

    def begin(
        self, path: Path | HandPart | None, source: Source | None, host: PipelineHost
    ) -> None:
        """Record to `path` from now on, instead of to the file before; to none if None."""
        self.end(source)
        if path is None:
            return
        self._newest = None
        try:
            if isinstance(source, ReplayedSource):
                raise Refusal("expected a live source to record, got a recording; copy its file")
            recorder = self._recorder = self._newest = Recorder(path, time.monotonic())
        except Refusal as refusal:
            self.status = RecordingStatus(str(Path(path)), trouble=str(refusal))
            return
        self.connect(source)
        if host.pipeline is not None:
            recorder.set_up(host.pipeline)
            recorder.add_memory(host.pipeline.state())
            if host.excluded is not None:
                recorder.left_out(*host.excluded)

    def connect(self, source: Source | None) -> None:
        """Record the input of `source` from now on; nothing if it is a recording."""
        self._live = not isinstance(source, ReplayedSource)
        if self._recorder is not None and source is not None:
            self._recorder.resume(time.monotonic())
            source.record(self._recorder)
            self.add_scene(source)

    def add_scene(self, source: Source) -> None:
        """Record the scene that is simulated from now on."""
        if self._recorder is not None and isinstance(source, SimulatedSource):
            self._recorder.plays(source.scene)

    def source_ended(self) -> None:
        """Record that the source ended."""
        if self._recorder is not None and self._live:
            self._recorder.disconnected(time.monotonic())

    def set_up(self, host: PipelineHost) -> None:
        """Record that another pipeline is in use."""
        if self._recorder is not None and host.pipeline is not None and self._live:
            self._recorder.set_up(host.pipeline)

    def exclude(self, host: PipelineHost) -> None:
        """Record that other channels are excluded."""
        if self._recorder is not None and host.excluded is not None and self._live:
            self._recorder.left_out(*host.excluded)

    def add_events(self, events: Sequence[Event]) -> None:
        """Record events of the source."""
        for event in events if self._live else ():
            self.add_event(event)

    def add_event(self, event: Event) -> None:
        if self._recorder is not None:
            self._recorder.add_event(event)

    def take(self, frame: Frame, estimate: Estimate) -> None:
        if self._recorder is not None and self._live:
            self._recorder.take(frame, estimate)

    def end(self, source: Source | None) -> None:
        """Begin to end the file."""
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            if source is not None:
                source.record(None)
            recorder.end()
            self._ending.append(recorder)

    def check(self, source: Source | None) -> str:
        """Why it ended by itself, if it did since the last check; updates `status`."""
        if self._newest is not None:
            self.status = self._newest.written
        # Each holds all that its last frames went through.
        self._ending = [one for one in self._ending if one.written.active]
        if self.status.active:
            return ""
        self._newest = None
        if self._recorder is None:
            return ""
        self.end(source)
        return self.status.trouble

    def close(self) -> None:
        """End every file, and wait until it is on the disk."""
        self.end(None)
        for recorder in self._ending:
            recorder.close()
