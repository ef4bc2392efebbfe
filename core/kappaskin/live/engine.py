"""Engine: starts the engine process, sends requests, reads status and estimates; of a hand each."""

import math
import multiprocessing
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from kappaskin._processes import starting_process
from kappaskin.errors import Refusal
from kappaskin.estimation import Region
from kappaskin.frames import Array, Estimate, Event
from kappaskin.live.differences import newest_pair
from kappaskin.live.loop import serve
from kappaskin.live.requests import (
    Action,
    Note,
    Requested,
    RequestSender,
    RestartEffects,
    Seek,
    StepFrames,
    TakeTare,
    Update,
)
from kappaskin.live.resume import ResumedProcess, ResumeInfo, resume_process
from kappaskin.live.ring import Ring
from kappaskin.live.status import LOST, STREAMING, Status
from kappaskin.pipeline import Setup
from kappaskin.publish import access_of, of_finger, targets_of
from kappaskin.recording import HandPart, HandRecorder, RecordingStatus, ReplayedSource, unused
from kappaskin.scenes import Playback, Scene

LONGEST_NOTE = 500
"""Characters of a note."""

_ORDERLY, _WRITTEN = 2.0, 10.0  # s for an end, and where a recording is to be ended first
_PATIENCE = 1800.0  # s that a recording continues without a window
_PREPARING = 0.2  # share of its silence that counts while it prepares a setup, which delays it
_SILENT = 2.0  # s without a report, of an engine that reports ten times a second
_POLL = 1.0  # s between two polls at most that count as silence: this process may have been stopped
_TOGETHER = 0.3  # s within which every engine has a request
_DEATHS, _WITHIN = 3, 10.0  # so many in so many s, and the process is not started again

_OF_SOURCE = "source", "trust", "scene", "speed", "looped", "recomputes"  # which it comes with

_AGAIN = "the engine process ended unexpectedly and was started again"
_DIED = "the engine process ended unexpectedly; connect again to restart it"
_HANGS = "the engine process has not reported for {:.0f} s; connect again if it does not continue"
_GIVEN_UP = (
    f"the engine process ended {_DEATHS} times within {_WITHIN:g} s and is not started again by "
    "itself; choose a simpler scene or fewer functions, then connect again; the cause is on "
    "the terminal from which the program was started"
)


class Engine:
    """The engine process, controlled from the window; no call here waits for it.

    All requests are one value, `Requested`, which is sent to the engine. The process ends when
    `close` is called, or within a second after this process ended. With a folder to `resume_from`,
    a process that records continues for `patience` s instead, and the next `Engine` with that
    folder resumes it instead of starting one: `resumed` describes it. Messages name the `finger`.
    """

    def __init__(
        self,
        setup: Setup | None = None,
        resume_from: Path | None = None,
        patience: float = _PATIENCE,
        finger: str = "",
    ) -> None:
        self._resume_from, self._patience = resume_from, patience
        process = resume_process(resume_from) if resume_from else None
        first = Requested().changing(setup=setup or Setup(), finger=finger)
        self._begin(process.info.requested if process else first, process)

    def _begin(self, first: Requested, process: ResumedProcess | None = None) -> None:
        """Start a process with what is requested at `first`, or resume one."""
        self._deaths: list[float] = []
        self._seen, self._polled = Status(), time.monotonic()
        self.silent = 0.0
        """For how long in s an engine that streams has not reported, as far as it was polled."""
        self._process: BaseProcess | ResumedProcess | None = None
        self.resumed: ResumeInfo | None = None
        self._borrows = process is not None  # its memory
        self._in_use = Requested()  # as it was before the newest source was requested
        self._requests = RequestSender(first)
        if process is not None:
            self._resume(process)
            return
        self._ring, self._compared_ring = Ring.pair()
        try:
            self._start(Status(setup=first.setup))
        except BaseException:
            self._release_memory()
            raise

    @property
    def requested(self) -> Requested:
        """What is requested of the engine now."""
        return self._requests.requested

    def _resume(self, process: ResumedProcess) -> None:
        self._process, self.resumed = process, process.info
        self._ring, self._compared_ring = map(Ring.borrow, process.info.rings)
        self._requests.connect(process.line, known=process.info.requested.number)

    def _start(self, status: Status) -> None:
        self.silent = 0.0
        self._ring.write_status(status)
        names = self._ring.name, self._compared_ring.name
        with starting_process() as context:
            theirs, ours = multiprocessing.Pipe(duplex=False)
            self._process = context.Process(
                target=self._serve,
                args=(theirs, names, *self._serves_with()),
                name="kappaskin-engine",
                daemon=True,
            )
            self._process.start()
        theirs.close()
        self._requests.connect(cast("Connection[Update, Any]", ours), self._known())

    _serve: Callable[..., None] = staticmethod(serve)
    """What the process runs, with the line of requests, the names of the rings and more."""

    def _serves_with(self) -> tuple[object, ...]:
        return self._resume_from, self._patience

    def _known(self) -> int:
        """The number of the request that the process begins with."""
        return 0

    def _start_again(self, *events: Event) -> None:
        """Start another process, which continues the counts: no generation is used twice."""
        self._reap()
        # One killed while it wrote left no status that can be read.
        was = self._ring.read_status() or self._seen
        if self._borrows:
            self._release_memory()
            self._ring, self._compared_ring, self.resumed = *Ring.pair(), None
            self._borrows = False
        setup, source = self.requested.setup, self.requested.source
        fresh = Status(
            setup=setup,
            generation=was.generation,
            connections=was.connections,
            tare=was.tare,
            recording=was.recording.broken_off(),
        )
        if events and source is not None:
            fresh = replace(fresh, state=LOST, source=source, message=events[-1].text)
        self._start(replace(fresh, events=was.events, event_count=was.event_count).after(events))

    def revive(self) -> None:
        """Restart a process that died, with all that is requested; `status` says so.

        To be called now and then. The position in a scene is lost. After the third death within ten
        seconds it stays dead until `connect`, and `status` says why.
        """
        if self._process is None or self.alive or self.given_up:
            return
        now = time.monotonic()
        self._deaths = [when for when in self._deaths if now - when < _WITHIN] + [now]
        if self.given_up:
            was = self._ring.read_status() or self._seen
            self._ring.write_status(was.after((Event(now, "engine", _GIVEN_UP),)))
            return
        requested = self.requested
        if isinstance(requested.recording, Path):
            # Beside the one that broke off, which `repair` makes whole.
            self._requests.change(recording=unused(requested.recording))
        self._start_again(Event(now, "engine", _AGAIN))
        if (requested.speed, requested.looped) != (1.0, False):
            self._requests.act(Seek(None, requested.speed, requested.looped))

    @property
    def given_up(self) -> bool:
        """Whether the process has died so often that it is not restarted; `status` says so."""
        return len(self._deaths) >= _DEATHS

    @property
    def engines(self) -> "dict[str, Engine]":
        """Itself, without a name: those of a hand of one."""
        return {"": self}

    @property
    def source(self) -> str | None:
        """The source that is requested, None where there is to be none."""
        return self.requested.source

    @property
    def pid(self) -> int | None:
        return self._process.pid if self._process else None

    @property
    def alive(self) -> bool:
        return self._process is not None and self._process.is_alive()

    def connect(self, source: str, trust: bool = False) -> None:
        """Take frames from `source` instead of the present one; replaces a process that hangs.

        A source that streams stays in use until the other one answers; where that cannot be opened,
        `status` says why. With `trust` a scene may name files outside its folder.
        """
        if self._process is not None and self.silent >= _SILENT:
            self._process.kill()
            self._process.join()
        dead = not self.alive
        if dead:
            self._deaths = []
            self._requests.disconnect()
            self._requests.change(recording=None)
        if self._seen.source == self.requested.source:
            self._in_use = self.requested
        played = {"speed": 1.0, "looped": False, "recomputes": False}
        self._requests.change(source=source, trust=trust, scene=None, **played)
        if dead:
            self._start_again()

    def withdraw(self) -> None:
        """Request the source in use again, instead of one that is refused or does not answer."""
        if self._in_use.source == self._seen.source:
            changed = self.requested.changed
            unchanged = (n for n in _OF_SOURCE if changed[n] == changed["source"])
            self._requests.change(**{name: getattr(self._in_use, name) for name in unchanged})
        else:
            self._requests.change(source=self._seen.source or None)

    def disconnect(self) -> None:
        self._requests.change(source=None, scene=None, speed=1.0, looped=False)

    def set_up(self, setup: Setup) -> None:
        """Compute with another setup; a refused one leaves the present one, `status` says why."""
        self._requests.change(setup=setup)

    def compare(self, setup: Setup | None) -> None:
        """Compute with another setup too, of the same frames; None ends that."""
        self._requests.change(compared=setup)

    def play(self, scene: Scene) -> None:
        """Continue a simulated source with `scene`; no effect on any other source."""
        self._requests.change(scene=scene)

    def seek(
        self,
        at: float | None = None,
        speed: float = 1.0,
        looped: bool | None = None,
        since: float | None = None,
    ) -> None:
        """Continue a simulated scene or a recording from time `at` in s; by default from now.

        A recording is there when the monotonic clock is `since` s, by default now.

        It plays at `speed` times real time, at most ten; at zero it is paused, while a scene is
        still read. A recording that is `looped` restarts at its end. `status` has the position.
        """
        Playback(at or 0.0, 0.0, speed)  # or refused here
        after = self.requested.looped if looped is None else looped
        self._requests.act(Seek(at, speed, looped, since), speed=speed, looped=after)

    def restart_effects(self) -> None:
        """Restart the simulated sensor's effects, as from rest."""
        self._requests.act(RestartEffects())

    def recompute(self, on: bool) -> None:
        """Show of a recording what is computed again of its readings, or what was recorded."""
        self._requests.change(recomputes=on)

    def add_noise(self, rms: float) -> None:
        """Add normal noise of `rms` in 1/m to the readings of `latest`, `recent` and `compared`.

        What is recorded or published has none of it. Raises a `Refusal` below zero.
        """
        if not 0 <= rms < math.inf:
            raise Refusal(f"expected a noise of at least 0 1/m, got {rms}; use 0 for none")
        self._requests.change(added_noise=rms)

    def step(self, frames: int) -> None:
        """Pause a recording, so many `frames` further on, or back if negative."""
        self._requests.act(StepFrames(frames), speed=0.0)

    def scan(self, region: Region) -> None:
        """Scan only `region` in every frame; where this is impossible, `status` says why."""
        self._requests.change(region=region)

    def publish(self, targets: Sequence[str], origins: Sequence[str] = ()) -> None:
        """Send estimates to `targets` from now on, such as udp://127.0.0.1:9870 or foxglove://.

        cue://127.0.0.1:9871?force=2 is a haptic device that gets what is to be felt, 2 N at most.
        Web pages of this machine and of `origins`, such as https://app.foxglove.dev, may connect to
        a server. Earlier targets receive no more; `status` has the state of each. Raises a
        `Refusal` for an invalid target or origin.
        """
        names = tuple(str(target) for target in targets_of(targets))
        self._requests.change(targets=names, access=access_of(origins))

    def tare(self) -> None:
        """Take a tare; `status` has the result, which is in use once a setup contains it."""
        self._requests.act(TakeTare())

    def record(self, path: Path | HandPart | None) -> None:
        """Record to `path` from now on, or end recording with None; `status` has the result.

        It may be the part of this finger in the recording of a hand, `HandRecorder.part`.
        """
        self._requests.change(recording=path.absolute() if isinstance(path, Path) else path)

    def store_window_state(self, data: bytes) -> None:
        """Store `data` in the engine for a window that resumes it."""
        self._requests.change(window_state=data)

    def note(self, text: str) -> None:
        """Add `text` to the events, and record it with them."""
        if len(text) > LONGEST_NOTE:
            raise Refusal(
                f"expected a note of at most {LONGEST_NOTE} characters, got {len(text)}; split it"
            )
        self._requests.act(Note(text))

    def request(self, settings: Mapping[str, Any], actions: Iterable[Action] = ()) -> int:
        """Request settings of `Requested` and actions; the number that `status` then reports."""
        if settings:
            self._requests.change(**settings)
        for action in actions:
            self._requests.act(action)
        return self.requested.number

    def newest_records(self, status: Status) -> tuple[int, Any, Any] | None:
        """The newest estimate of the generation in `status`, as its number and its record.

        And that of the same frame with the other setup, None without one.
        """
        found = self._ring.newest(status.generation, status.slot) if status.slot else None
        if found is None:
            return None
        other, also = status.compared, None
        if other is not None and other.slot is not None:
            frame = int(found[1]["sequence"])
            also = self._compared_ring.newest(other.generation, other.slot, frame)
        return *found, also and also[1]

    def status(self) -> Status:
        # While one is being written there is none to read: then the last one is used.
        read, was = self._ring.read_status() or self._seen, self._seen
        self._seen = read
        self._requests.acknowledge(read.requested, read.reported)
        if not self.alive:
            message, recording = _GIVEN_UP if self.given_up else _DIED, read.recording.broken_off()
            return replace(read, state=LOST, rate=0.0, message=message, recording=recording)
        now = time.monotonic()
        passed, self._polled = min(now - self._polled, _POLL), now
        hangs = read.reported <= was.reported and read.state == STREAMING
        weight = _PREPARING if read.computing else 1.0
        self.silent = self.silent + weight * passed if hangs else 0.0
        if self.silent < _SILENT:
            return read
        return replace(read, rate=0.0, message=_HANGS.format(self.silent))

    def latest(self, status: Status, sequence: int | None = None) -> Estimate | None:
        """The newest estimate of the generation in `status`, or that of the frame `sequence`.

        None if it is not available: at most the last 64 estimates are.
        """
        if status.slot is None:
            return None
        return self._ring.read(status.generation, status.slot, sequence)

    def recent(
        self, status: Status, after: int, paths: Sequence[str]
    ) -> tuple[Array, list[Array], int]:
        """Device times (T,) in s and fields (T, ...) of the estimates since `after`.

        The fields are those at `paths`, such as "contact.force", as far as an estimate stores them;
        none before the first. `after` is the number that the last call returned, 0 at first; at
        most the last 64 estimates.
        """
        if status.slot is None:
            return np.empty(0), [], 0
        return self._ring.recent(status.generation, status.slot, after, paths)

    def pair(self, status: Status) -> tuple[Estimate, Estimate] | None:
        """The newest frame that was computed with both setups, None where none is available."""
        return newest_pair(self._ring, self._compared_ring, status)

    @property
    def rings(self) -> tuple[Callable[[str], Ring], str, str]:
        """For `difference_errors`: how a process opens the memory of both, and its names."""
        opened = Ring.borrow if self._borrows else Ring.attach
        return opened, self._ring.name, self._compared_ring.name

    def __enter__(self) -> "Engine":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _reap(self) -> None:
        """Wait for the process to end; kill it after a time limit."""
        if self._process is not None:
            self._process.join(_ORDERLY if self.requested.recording is None else _WRITTEN)
            if self._process.is_alive():
                self._process.kill()
                self._process.join()
            self._process.close()
        self._requests.disconnect()
        self._process = None

    def _release_memory(self) -> None:
        for ring in (self._ring, self._compared_ring):
            if self._borrows:
                ring.close()  # the resumed process releases it
            else:
                ring.destroy()

    def close(self) -> None:
        """End the process and release the memory."""
        self._requests.say_goodbye()
        self._reap()
        self._release_memory()


class Fingers:
    """The engines of the fingers of a hand by their names, each a process with a source of its own.

    One that is lost, stalls or dies leaves the others alone; `revive` starts one that died again. A
    hand of one has a finger without a name. All frames are on one clock, this machine's monotonic
    one: the scan of an estimate began at `taken` +- `taken_sd`.
    """

    def __init__(self, fingers: Iterable[str], setup: Setup | None = None) -> None:
        self.engines: dict[str, Engine] = {}
        self._recorder: HandRecorder | None = None
        self._opening = False  # recordings, which begin together
        try:
            for finger in fingers:
                self.engines[finger] = Engine(setup, finger=finger)
        except BaseException:
            self.close()
            raise

    def connect(self, sources: Mapping[str, str], trust: bool = False) -> None:
        """Take frames of each finger from its source."""
        for finger, source in sources.items():
            self.engines[finger].connect(source, trust)
        played = (source.startswith(ReplayedSource.SCHEME) for source in sources.values())
        self._opening = len(sources) > 1 and all(played)

    def record(self, to: Path | HandRecorder) -> None:
        """Record all fingers to one file from now on; a `Refusal` where there can be none.

        Or by a recorder that has been made elsewhere, as in a thread: that takes a while.
        """
        made = to if isinstance(to, HandRecorder) else HandRecorder(to.absolute(), [*self.engines])
        self._recorder = made
        for finger, engine in self.engines.items():
            engine.record(self._recorder.part(finger))

    def publish(self, targets: Sequence[str], origins: Sequence[str] = ()) -> None:
        """Send estimates of all fingers to `targets`, as `Engine.publish` does.

        Messages name the finger. Of servers each finger has one, at ports that follow each other.
        """
        for number, engine in enumerate(self.engines.values()):
            engine.publish(of_finger(targets, number), origins)

    @property
    def recording(self) -> RecordingStatus:
        """The state of the file of all fingers."""
        return self._recorder.poll() if self._recorder else RecordingStatus()

    def revive(self) -> None:
        """Start each process that died again; to be called now and then.

        Recordings begin together once all are open: fingers are then as far apart in time as they
        were.
        """
        for engine in self.engines.values():
            engine.revive()
        statuses = self.status().values() if self._opening else ()
        if statuses and all(each.replay or each.state == LOST for each in statuses):
            self._opening, since = False, time.monotonic() + _TOGETHER
            for engine in self.engines.values():
                engine.seek(0.0, since=since)

    def status(self) -> dict[str, Status]:
        return {finger: engine.status() for finger, engine in self.engines.items()}

    def aligned(self, statuses: Mapping[str, Status]) -> dict[str, Estimate]:
        """An estimate of each finger that streams, all of scans nearest to one time.

        That is the newest time which all of them have reached. Each began at `taken` +- `taken_sd`
        in s on this machine's clock, within a scan's period of that time; a finger whose clock is
        not known yet has none.
        """
        taken = dict[str, tuple[NDArray[Any], NDArray[Any]]]()
        for finger, status in statuses.items():
            _, fields, _ = self.engines[finger].recent(status, 0, ["taken", "sequence"])
            if status.state == STREAMING and fields and np.isfinite(fields[0]).any():
                taken[finger] = fields[0], fields[1]
        at = min((float(np.nanmax(times)) for times, _ in taken.values()), default=math.nan)
        found = dict[str, Estimate]()
        for finger, (times, sequences) in taken.items():
            nearest = int(sequences[np.nanargmin(np.abs(times - at))])
            estimate = self.engines[finger].latest(statuses[finger], nearest)
            if estimate is not None:
                found[finger] = estimate
        return found

    def stop_recording(self) -> None:
        """End the file; `recording` says when it is whole."""
        for engine in self.engines.values():
            engine.record(None)
        if self._recorder is not None:
            self._recorder.end()

    def end_recording(self, within: float = _WRITTEN) -> RecordingStatus:
        """End the file, and wait until it is whole, for `within` s at most; its last state."""
        self.stop_recording()
        if self._recorder is None:
            return RecordingStatus()
        self._recorder.close(within)
        return self._recorder.written

    def __enter__(self) -> "Fingers":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End all processes; what is recorded is whole then."""
        for engine in self.engines.values():
            engine.close()
        if self._recorder is not None:
            self._recorder.close(_WRITTEN)
