"""Replay source: a recording played back at any speed, or frame by frame."""

import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, NamedTuple

from kappaskin.contact import NO_CONTACT
from kappaskin.errors import Refusal
from kappaskin.frames import Contact, Estimate, Event, Frame, LocalGeometry
from kappaskin.pipeline import Pipeline, Setup, setup_from_text
from kappaskin.recording import messages as m
from kappaskin.recording.cdr import decode
from kappaskin.recording.reading import RecordedMessage, Recording, event_of
from kappaskin.recording.recompute import RecordedFrames
from kappaskin.sensing import Sensor
from kappaskin.sources import Accounting, InputRecorder, register_scheme

FASTEST = 10.0
"""Largest playback speed, as a multiple of real time."""

_NAP = 0.02  # s
_MOST = 512  # frames given at once
_BACK = 0.25  # s that are looked through at first for frames to step back over
_GAP = 0.5  # s without a message that is a gap
_BRIEF = 0.1  # s of messages between two of them that leave it one
_MOST_LISTED = 500  # gaps, and events, that are listed at most: each status brings them
_LONGEST = 200  # characters of an event


@dataclass(frozen=True)
class Replay:
    """Playback position: `at` s of `length` s, at `speed` times real time, 0 while paused.

    It restarts at its end if `looped`. `gaps` are the times in s, from and to, without
    messages; `events` the first events and their times in s. It was `begun` so many s
    after 1970; one that is not `whole` was never ended, and is played up to where it breaks off.
    It was recorded by the program and revision `made_by`; `shows_recorded` says whether the last
    estimate is the recorded one, not one computed again.
    """

    at: float
    length: float
    speed: float
    looped: bool
    gaps: tuple[tuple[float, float], ...]
    events: tuple[Event, ...]
    begun: float
    whole: bool
    made_by: str = ""
    shows_recorded: bool = False


_RESULTS = {topic.name: topic.kind for topic in (m.CONTACTS, m.SECONDS, m.CURVATURES, m.SHAPES)}
_AHEAD = 10**9  # ns after a frame within which its results were recorded, if at all
_REMEMBERED = 4096  # frames whose results are held for those that are read late


class _RecordedResults:
    """The results in a recording from the chunk number `first` on, each with the setup used."""

    def __init__(self, recording: Recording, first: int, stamp: int) -> None:
        self._recording, self._messages = recording, recording.messages(first)
        self._next = next(self._messages, None)
        self._setup: Setup | None = None
        self._text = ""
        self._found: dict[tuple[int, float], tuple[Setup | None, dict[str, Any]]] = {}
        if message := recording.last_before(m.SETUP, stamp):
            self._take(message)

    def of(self, estimate: Estimate, stamp: int) -> tuple[Setup | None, dict[str, Any]]:
        """The setup and the fields recorded of a frame that came at `stamp`, as far as there are.

        Those of the shape are there only where the curvature was recorded too.
        """
        key = estimate.sequence, estimate.device_time
        while self._next is not None and self._next.stamp <= stamp + _AHEAD:
            if self._next.topic == m.LINES.name and key in self._found:
                break  # all that belongs to the frames before was written before
            self._take(self._next)
            self._next = next(self._messages, None)
        return self._found.get(key, (None, {}))

    def _take(self, message: RecordedMessage) -> None:
        if message.topic == m.SETUP.name:
            text = decode(m.STRING, message.data)["data"]
            if text != self._text:
                self._setup = setup_from_text(text, self._recording.attachment)
                self._text = text
        elif kind := _RESULTS.get(message.topic):
            values = decode(kind, message.data)
            key = values["sequence"], values["device_time"]
            known = self._found.setdefault(key, (self._setup, {}))[1]
            known[message.topic.rpartition("/")[2]] = values
            if len(self._found) > _REMEMBERED:
                self._found.pop(next(iter(self._found)))


class _Ready(NamedTuple):
    """A frame, the device it is of, and the stamp and place of its message and itself in that."""

    mark: tuple[int, int]
    frame: Frame
    sensor: Sensor | None


class ReplayedSource:
    """Yields the frames of the recording at `path` when they are due, of one `finger` of a hand.

    Opening raises a `Refusal` where it is none, or has several fingers of which none is named.
    """

    SCHEME = "replay:"
    """Prefix of the names of these sources."""

    def __init__(
        self,
        path: Path,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
        finger: str | None = None,
    ) -> None:
        self._clock, self._sleep, self._finger = clock, sleep, finger
        self._recording = Recording(path, finger)
        try:
            self._begin()
        except Refusal:
            self.close()
            raise

    def _begin(self) -> None:
        recording = self._recording
        if self._finger is None and len(recording.fingers) > 1:
            raise Refusal(
                f"{recording.path}: has the fingers {', '.join(recording.fingers)}; play one, such "
                f"as {self.SCHEME}{recording.path}#{recording.fingers[0]}"
            )
        if not recording.counts.get(m.LINES.name):
            raise Refusal(
                f"{recording.path}: expected a recording with bytes of a device, got none in it"
            )
        self._first = recording.first
        self.length = recording.seconds(recording.last)
        self._gaps, self._all_events = self._landmarks()
        self._speed, self._looped = 1.0, False
        self._sensor: Sensor | None = None
        self._made: dict[str, Sensor] = {}
        self._events: list[Event] = []
        self._last: _Ready | None = None  # the frame given last
        self._steps, self._moves = 0, False  # frames to give at once, and go on from there
        self._back = 0  # frames before the last one given, from which these are
        self.recomputes, self._shows_recorded = False, False
        self._go_to(0.0)

    def _landmarks(self) -> tuple[tuple[tuple[float, float], ...], tuple[Event, ...]]:
        gaps: list[tuple[float, float]] = []
        for a, b in pairwise(self._recording.chunks):
            begin, end = self._recording.seconds(a.last), self._recording.seconds(b.first)
            if end - begin > _GAP:
                # An answer about the device's clock alone is no end of a gap.
                brief = gaps and begin - gaps[-1][1] < _BRIEF
                gaps.append((gaps.pop()[0] if brief else begin, end))
        events: list[Event] = []
        with suppress(Refusal):  # damage is reported when it is played
            for event in islice(self._recording.events(), _MOST_LISTED):
                events.append(_brief(event))
        return tuple(gaps[:_MOST_LISTED]), tuple(events)

    # Position.

    @property
    def replay(self) -> Replay:
        where = min(max(self._at(), 0.0), self.length)
        rest = self._speed, self._looped, self._gaps, self._all_events
        begun, whole, made_by = self._first * 1e-9, self._recording.whole, self._recording.made_by
        return Replay(where, self.length, *rest, begun, whole, made_by, self._shows_recorded)

    def as_recorded(self, estimate: Estimate, pipeline: Pipeline) -> Estimate:
        """What was recorded of the frame of an `estimate`, as far as it was.

        As it is where nothing was recorded of it, or with other settings than those of the
        `pipeline`, or where this source `recomputes`. A shape that was not recorded, as those
        between 50 a second, stays as it is.
        """
        setup, found = None, dict[str, Any]()
        if not self.recomputes and self._last is not None:
            with suppress(Refusal):  # damage is reported when it is played
                setup, found = self._results.of(estimate, self._last.mark[0])
        self._shows_recorded = "contact" in found and _same_estimator(setup, pipeline.setup)
        return recorded_estimate(estimate, found, pipeline) if self._shows_recorded else estimate

    def _at(self) -> float:
        return self._from + (self._clock() - self._since) * self._speed

    def _go_to(self, at: float) -> None:
        """Continue at `at` s."""
        self._from, self._since = at, self._clock()
        self._frames = RecordedFrames(str(self._recording.path), self._made)
        self._ready: deque[_Ready] = deque()
        stamp = self._first + round(at * 1e9)
        # From the chunk before, so that no message is begun in its middle.
        chunks = self._recording.chunks
        later = next((n for n, chunk in enumerate(chunks) if chunk.last >= stamp), len(chunks))
        since = 0
        for topic in (m.DEVICE, m.CLOCKS, m.TRUTHS):
            message = self._recording.last_before(topic, stamp)
            if message is not None and message.stamp >= since:
                self._frames.begin_with(message)
            if message is not None and topic is m.DEVICE:
                since = message.stamp  # what is older is of another device
        self._results = _RecordedResults(self._recording, max(later - 1, 0), stamp)
        self._messages: Iterator[RecordedMessage] = self._recording.messages(max(later - 1, 0))
        self._next: RecordedMessage | None = next(self._messages, None)
        while self._next is not None and self._next.stamp < stamp:
            self._take(self._next)
        self._ready.clear()

    def seek(self, at: float | None, speed: float, looped: bool | None = None) -> None:
        """Continue at `at` s, or at the present time, at a `speed` of at most `FASTEST`; 0 pauses.

        Standing, it gives the one frame that is next.
        """
        now = self._at() if at is None else at
        self._speed = min(max(speed, 0.0), FASTEST)
        self._looped = self._looped if looped is None else looped
        self._steps, self._moves = 0, False
        if at is None:
            self._from, self._since = min(now, self.length), self._clock()
        else:
            self._go_to(min(max(at, 0.0), self.length))
            self._steps = 0 if self._speed else 1

    def step(self, frames: int) -> None:
        """Pause so many `frames` further on, or back if negative.

        Those that were asked for the same way before, and were not given yet, are added.
        """
        forward, back = (self._steps, self._back) if self._moves and self._steps else (0, 0)
        self.seek(None, 0.0)
        if self._ready and self._ready[0] is self._last:  # asked for again, and not given yet
            self._ready.popleft()
        self._back = back - frames if frames < 0 else 0
        if self._back:
            self._go_back(self._back)
        self._steps, self._moves = 1 if self._back else forward + max(frames, 1), True

    @property
    def ended(self) -> bool:
        """Whether there are no more frames."""
        return self._next is None and not self._ready

    @property
    def stands(self) -> bool:
        """Whether it is paused or at its end."""
        return not self._speed or self._next is None

    def again(self) -> None:
        """Return the shown frame once more, if paused or at the end."""
        if self._last is not None and not self._steps and self.stands:
            self._ready.appendleft(self._last)
            self._steps, self._moves = 1, False

    def _go_back(self, frames: int) -> None:
        """Pause before the frame that was returned so many before the last one."""
        here, back = self._last.mark if self._last else (self._first, 0), _BACK
        marks, start = deque[tuple[int, int]](), 1.0
        while len(marks) < frames and start > 0:
            start, back = max(self._recording.seconds(here[0]) - back, 0.0), 4 * back
            self._go_to(start)
            marks = deque((ready.mark for ready in self._until(here)), frames)
        if marks:
            self._go_to(self._recording.seconds(marks[0][0]))
            deque(self._until(marks[0]), 0)
        self._events.clear()

    def _until(self, mark: tuple[int, int]) -> Iterator[_Ready]:
        """The frames before one, which is then the next."""
        while self._fill() and self._ready[0].mark < mark:
            yield self._ready.popleft()

    # Frames.

    def _take(self, message: RecordedMessage) -> None:
        """Take one message."""
        for n, frame in enumerate(self._frames(message)):
            self._ready.append(_Ready((message.stamp, n), frame, self._frames.sensor))
        self._next = next(self._messages, None)

    def _fill(self, until: float = float("inf")) -> bool:
        """Prepare the next frame due by `until` s; whether there is one."""
        while not self._ready and self._next is not None:
            if self._recording.seconds(self._next.stamp) > until:
                break
            self._add_event(self._next)
            self._take(self._next)
        return bool(self._ready) and self._recording.seconds(self._ready[0].mark[0]) <= until

    def _add_event(self, message: RecordedMessage) -> None:
        if message.topic == m.EVENTS.name:
            self._events.append(_brief(event_of(message, self._clock())))

    def read(self, timeout: float) -> list[Frame]:
        """The frames that are due, after at most `timeout` s."""
        frames = self._due()
        if not frames and self._over():
            self._go_to(0.0)
        elif not frames:
            self._sleep(min(timeout, self._pause()))
            frames = self._due()
        return frames

    def _pause(self) -> float:
        """s until the next message is due."""
        if self._next is None or not self._speed:
            return _NAP
        return max(self._recording.seconds(self._next.stamp) - self._at(), 0.0) / self._speed

    def _over(self) -> bool:
        return self._looped and self._speed > 0 and self._at() >= self.length

    def _due(self) -> list[Frame]:
        until = float("inf") if self._steps else self._at()
        most = self._steps or (_MOST if self._speed else 0)
        frames: list[Frame] = []
        while len(frames) < most and self._fill(until):
            if frames and self._ready[0].sensor is not self._sensor:
                break
            frames.append(self._give(self._ready.popleft()))
        if self._steps and self._last is not None:
            self._steps = 0 if self.ended else self._steps - len(frames)
            if self._moves:
                self._from, self._since = self._recording.seconds(self._last.mark[0]), self._clock()
        return frames

    def _give(self, ready: _Ready) -> Frame:
        """The frame, with the times at which it was due."""
        self._sensor, frame = ready.sensor, ready.frame
        self._last = ready
        came = self._clock()
        if self._speed:
            came = self._since + (self._recording.seconds(ready.mark[0]) - self._from) / self._speed
        return replace(frame, host_time=came, taken=came - (frame.host_time - frame.taken))

    @property
    def sensor(self) -> Sensor | None:
        return self._sensor or self._frames.sensor

    @property
    def patient(self) -> bool:
        return True

    @property
    def trouble(self) -> str:
        return self._frames.trouble

    @property
    def temperature(self) -> float:
        """NaN: not recorded."""
        return float("nan")

    def events(self) -> list[Event]:
        """Events up to the playback position."""
        events, self._events = self._events, []
        return events

    def record(self, recorder: InputRecorder | None) -> None:
        """No effect: a recording is not recorded again."""

    def accounting(self) -> Accounting:
        return self._frames.accounting()

    def close(self) -> None:
        self._recording.close()


def _same_estimator(setup: Setup | None, used: Setup) -> bool:
    """Whether the settings are the same but for the points of the surface, and what is computed."""
    alike = {name: getattr(used, name) for name in ("nx", "ny", "quantities")}
    return setup is not None and replace(setup, **alike) == used


def recorded_estimate(estimate: Estimate, found: dict[str, Any], pipeline: Pipeline) -> Estimate:
    """An `estimate` with the numbers `found` in the recording instead of those computed again."""
    recorded = found["contact"]
    contact = {each.name: recorded[each.name] for each in fields(Contact) if each.name in recorded}
    second = {
        name.removeprefix("second_"): value
        for name, value in found.get("second_contact", {}).items()
        if name.startswith("second_")
    }
    geometry = LocalGeometry(
        recorded["point"],
        recorded["frame"].reshape(3, 3),
        recorded["metric"].reshape(2, 2),
        recorded["curvature_form"].reshape(2, 2),
        recorded["torsion_form"],
        recorded["covariance"].reshape(3, 3),
    )
    shown = replace(
        estimate,
        contact=Contact(**contact),
        second=Contact(**second, single=False) if second else NO_CONTACT,
        geometry=geometry,
        noise=recorded["noise"],
        converged=recorded["converged"],
    )
    shape, readings = found.get("coefficients"), found.get("curvature")
    if shape is None or readings is None:
        return shown
    coefficients = shape["coefficients"].reshape(estimate.coefficients.shape)
    curvature = readings["curvature"].reshape(estimate.curvature.shape)
    return replace(
        shown,
        curvature=curvature,
        coefficients=coefficients,
        suspect=readings["suspect"],
        **pipeline.shape_quantities(curvature, coefficients, estimate),
    )


def _brief(event: Event) -> Event:
    return Event(event.time, event.kind[:_LONGEST], event.text[:_LONGEST])


def _opened(name: str, _: bool) -> ReplayedSource:
    """The recording FILE, or one finger of it, as FILE#FINGER."""
    file, found, finger = name.rpartition("#")
    if found and not Path(name).exists():
        return ReplayedSource(Path(file), finger=finger)
    return ReplayedSource(Path(name))


register_scheme(ReplayedSource.SCHEME, _opened)
