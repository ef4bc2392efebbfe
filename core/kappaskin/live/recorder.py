"""What is live to a recording, while one is asked for."""

import time
from collections.abc import Sequence
from pathlib import Path

from kappaskin.errors import Refusal
from kappaskin.frames import Estimate, Event, Frame
from kappaskin.live.pipelines import PipelineHost
from kappaskin.recording import Recorder, RecordingStatus, ReplayedSource
from kappaskin.sources import SimulatedSource, Source


class LiveRecorder:
    """Keeps what a source brings and what one side makes of it; `written` tells how that does.

    Nothing is kept, and no call does anything, until `begin`. Only `close` waits for the disk.
    """

    def __init__(self) -> None:
        self._recorder: Recorder | None = None
        self._newest: Recorder | None = None  # that `written` is of, until it has ended
        self._ending: list[Recorder] = []
        self._live = True  # what a recording brings is not recorded again
        self.written = RecordingStatus()

    @property
    def active(self) -> bool:
        return self._recorder is not None

    def begin(self, path: Path | None, source: Source | None, side: PipelineHost) -> None:
        """Record to `path` from now on, instead of to where it was; nowhere if None."""
        self.end(source)
        if path is None:
            return
        self._newest = None
        try:
            if isinstance(source, ReplayedSource):
                raise Refusal("expected a live source to record, got a recording; copy its file")
            recorder = self._recorder = self._newest = Recorder(path, time.monotonic())
        except Refusal as refusal:
            self.written = RecordingStatus(str(path), trouble=str(refusal))
            return
        self.listen(source)
        if side.pipeline is not None:
            recorder.set_up(side.pipeline)
            recorder.remembered(side.pipeline.remembered())
            if side.left is not None:
                recorder.left_out(*side.left)

    def listen(self, source: Source | None) -> None:
        """Take down what `source` brings, from now on; nothing of a recording."""
        self._live = not isinstance(source, ReplayedSource)
        if self._recorder is not None and source is not None:
            self._recorder.goes_on(time.monotonic())
            source.record(self._recorder)
            self.plays(source)

    def plays(self, source: Source) -> None:
        """Another scene may be simulated from now on."""
        if self._recorder is not None and isinstance(source, SimulatedSource):
            self._recorder.plays(source.scene)

    def ended(self) -> None:
        """The source brings nothing more."""
        if self._recorder is not None and self._live:
            self._recorder.ended(time.monotonic())

    def set_up(self, side: PipelineHost) -> None:
        """Another pipeline is in use."""
        if self._recorder is not None and side.pipeline is not None and self._live:
            self._recorder.set_up(side.pipeline)

    def leave_out(self, side: PipelineHost) -> None:
        """Other channels are left out."""
        if self._recorder is not None and side.left is not None and self._live:
            self._recorder.left_out(*side.left)

    def brought(self, events: Sequence[Event]) -> None:
        """The source tells what happened."""
        for event in events if self._live else ():
            self.happened(event)

    def happened(self, event: Event) -> None:
        if self._recorder is not None:
            self._recorder.happened(event)

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

    def look(self, source: Source | None) -> str:
        """Why it ended by itself, when it did since the last look; `written` is new."""
        if self._newest is not None:
            self.written = self._newest.written
        # Each holds all that its last frames went through.
        self._ending = [one for one in self._ending if one.written.active]
        if self.written.active:
            return ""
        self._newest = None
        if self._recorder is None:
            return ""
        self.end(source)
        return self.written.trouble

    def close(self) -> None:
        """End what is kept, and wait until it is on the disk."""
        self.end(None)
        for recorder in self._ending:
            recorder.close()
