"""Recomputation of recorded frames and estimates, and their verification."""

import math
from collections import deque
from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kappaskin._state import StateArrays
from kappaskin.bases import check_edge
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Estimate, Frame, Truth
from kappaskin.pipeline import (
    REPORTED,
    REVISION,
    Getter,
    Pipeline,
    Reported,
    Setup,
    getters,
    setup_from_text,
)
from kappaskin.recording import messages as m
from kappaskin.recording.cdr import decode
from kappaskin.recording.reading import RecordedMessage, Recording, made_by
from kappaskin.sensing import Sensor
from kappaskin.sources import (
    Accounting,
    ClockState,
    Decoder,
    Interpreter,
    LineDecoder,
    RecordedClock,
    decoder_of,
    wire,
)

_UNREAD = 2**16  # messages buffered until the device's information is read
_FUNCTIONS = 128  # of a truth along one side, at most
_SETUPS = 500  # of a recording, the first of more


class RecordedFrames:
    """Takes the messages of the recording called `name` as they were written.

    Sensors `made` by another of the same recording are the same ones here.
    """

    def __init__(self, name: str, made: dict[str, Sensor] | None = None) -> None:
        self._decoder: Decoder | LineDecoder = Decoder()
        self._times = RecordedClock()
        self._means = Interpreter(name, made)
        self._means.begin(self._times)
        self._pending: deque[tuple[float, wire.FromDevice]] = deque(maxlen=_UNREAD)
        self._truth: Truth | None = None

    @property
    def sensor(self) -> Sensor | None:
        return self._means.sensor

    @property
    def trouble(self) -> str:
        """Why the recording cannot be used; empty if it can."""
        return self._means.unusable

    def accounting(self) -> Accounting:
        return self._decoder.accounting()

    def begin_with(self, message: RecordedMessage) -> None:
        """Start in the middle of a recording with the last message on a device, clock or truth."""
        if message.topic == m.CLOCKS.name:
            self._map(decode(m.CLOCK, message.data) | {"since": math.nan})
        elif message.topic == m.TRUTHS.name:
            self._truth = _truth(decode(m.TRUTH, message.data), self.sensor)
        else:
            self._learn(decode(m.STRING, message.data)["data"])

    def _learn(self, text: str) -> None:
        """Take the device's information, and read its bytes as that says from now on."""
        before = self.sensor
        self._means.learn(text)
        after = self.sensor
        if after is not before and after and (after.description or (before and before.description)):
            self._decoder = decoder_of(after, text)

    def __call__(self, message: RecordedMessage) -> Iterator[Frame]:
        """The frames that came with one message, each of the `sensor` that there is then.

        A `Refusal` when it is none of its topic.
        """
        if message.topic == m.LINES.name:
            host_time, sent, data = m.unpack_line(message.data)
            if not sent and data:
                yield from self._came(host_time, data)
            elif not sent:
                self._ended()
        elif message.topic == m.DEVICE.name:
            self._learn(decode(m.STRING, message.data)["data"])
        elif message.topic == m.CLOCKS.name:
            self._map(decode(m.CLOCK, message.data))
        elif message.topic == m.TRUTHS.name:
            self._truth = _truth(decode(m.TRUTH, message.data), self.sensor)

    def _ended(self) -> None:
        self._decoder.line_ended()
        self._decoder.sequence.interrupt()
        self._pending.clear()
        self._times, self._truth = RecordedClock(), None
        self._means.begin(self._times)
        if self.sensor and self.sensor.description:  # it never sends its information
            self._learn(self._means.text)

    def _map(self, fields: dict[str, Any]) -> None:
        numbers = (fields[name] for name in ("at", "offset", "half", "drift", "spread"))
        known = ClockState(
            (*numbers, bool(fields["doubted"])), int(fields["wraps"]), fields["last"]
        )
        if math.isnan(fields["since"]):
            self._times.restore(known)
        else:
            self._times.changes.append((fields["since"], known))

    def _came(self, now: float, data: bytes) -> Iterator[Frame]:
        messages = self._decoder.feed(data)
        self._pending += [(now, got) for got in messages if not isinstance(got, wire.Command)]
        if not self._means.known and not self._introduced():
            return
        while self._pending:
            now, message = self._pending.popleft()
            if isinstance(message, wire.Information):
                self._means.learn(message.text)
            elif isinstance(message, wire.Samples) and (frame := self._means.frame(message, now)):
                yield replace(frame, truth=self._truth)

    def _introduced(self) -> bool:
        """Whether the device is known from the messages so far."""
        for _, message in self._pending:
            if isinstance(message, wire.Information):
                self._means.learn(message.text)
                break
        return self._means.known


def _truth(fields: dict[str, Any], sensor: Sensor | None) -> Truth | None:
    """The truth of the following frames; None without one."""
    shape, coefficients = tuple(fields["shape"].tolist()), fields["coefficients"]
    if sensor is None or not coefficients.size:
        return None
    check_edge(sensor.layout.patch, fields["edge"])
    if math.prod(shape) != coefficients.size or max(shape) > _FUNCTIONS:
        raise Refusal(f"expected a truth of shape {shape}, got {coefficients.size} numbers")
    return Truth(coefficients.reshape(shape), fields["contact"], fields["edge"])


_WAITING = 2**14  # frames that wait until one is asked for, at most


class Recomputation:
    """Takes the messages of a `recording` as they were written, and works out what is asked for.

    Frames go through the `pipeline` of their time, whose generation counts those recorded from 0;
    with a `setup` through one of that instead, which begins at rest, and leaves out what was left
    out. A frame of which no estimate is asked for is remembered, as the live process does.
    """

    def __init__(self, recording: Recording, setup: Setup | None = None) -> None:
        self._recording, self._setup = recording, setup
        self._frames = RecordedFrames(str(recording.path))
        self.sensor: Sensor | None = None
        self.pipeline: Pipeline | None = None
        self._memory: StateArrays = {}
        self._made = 0
        self._waiting: deque[Frame] = deque()
        self._last: Estimate | None = None

    def __call__(self, message: RecordedMessage) -> Iterator[Frame]:
        """The frames that came with one message; what it says otherwise is done when they are out.

        A `Refusal` when it is none of its topic.
        """
        for frame in self._frames(message):
            self._follow_device()
            if len(self._waiting) == _WAITING:
                self._pass_over(1)
            self._waiting.append(frame)
            yield frame
        self._follow_device()
        self._take(message)

    def _take(self, message: RecordedMessage) -> None:
        if message.topic == m.DEVICE.name:
            self.sensor = None  # another source, if of the same device: it begins at rest
            self._follow_device()
        elif message.topic == m.LEFT_OUTS.name:
            self._leave_out(decode(m.LEFT_OUT, message.data))
        elif self._setup is not None:
            return
        elif message.topic == m.SETUP.name:
            text = decode(m.STRING, message.data)["data"]
            self._set_up(setup_from_text(text, self._recording.attachment))
        elif message.topic == m.MEMORIES.name:
            fields = decode(m.MEMORY, message.data)
            self._memory[fields["name"]] = _shaped(fields)

    def _leave_out(self, fields: dict[str, Any]) -> None:
        self._pass_over(len(self._waiting))
        if self.pipeline is None:
            return
        C, sizes = self.pipeline.sensor.channels, {fields["kinds"].size, fields["badness"].size}
        if sizes != {C}:
            raise Refusal(f"expected {C} channels of which some are left out, got {sizes}")
        self.pipeline.leave_out(fields["kinds"], fields["badness"])

    def _follow_device(self) -> None:
        """Drop the pipeline if the next frame is of another device."""
        if self._frames.sensor is self.sensor:
            return
        self.sensor, self.pipeline, self._last = self._frames.sensor, None, None
        self._waiting.clear()
        self._memory.clear()
        if self._setup is not None and self.sensor is not None:
            self.pipeline = Pipeline(self.sensor, self._setup, budget=self._recording.budget)

    def _set_up(self, setup: Setup) -> None:
        if self.sensor is None:
            raise Refusal(
                self._frames.trouble
                or f"{self._recording.path}: expected a device before a setup; `kappaskin repair` "
                "saves the intact messages"
            )
        self._pass_over(len(self._waiting))
        budget = self._recording.budget
        was, made = self.pipeline, Pipeline(self.sensor, setup, self._made, budget=budget)
        if was is not None:
            made.continue_from(was)
        self.pipeline, self._made = made, self._made + 1

    def _pass_over(self, count: int) -> None:
        """Apply the first `count` of the waiting frames to the pipeline's state."""
        if self.pipeline is not None and self._memory:
            self.pipeline.restore(self._memory)
            self._memory = {}
        for _ in range(count):
            frame = self._waiting.popleft()
            if self.pipeline is not None:
                self.pipeline.pass_over(frame)

    def estimate(self, sequence: int) -> Estimate | None:
        """Of the frame `sequence`, the last one asked for or one since then; None of any other."""
        if self._last is not None and self._last.sequence == sequence:
            return self._last
        places = (n for n, frame in enumerate(self._waiting) if frame.sequence == sequence)
        return self._worked_out(next(places, -1))

    def newest(self) -> Estimate | None:
        """The estimate of the last frame; None if no pipeline computed it."""
        return self._worked_out(len(self._waiting) - 1)

    def _worked_out(self, place: int) -> Estimate | None:
        if self.pipeline is None or place < 0:
            return None
        self._pass_over(place)
        self._last = self.pipeline(self._waiting.popleft())
        return self._last


def _shaped(fields: dict[str, Any]) -> Array:
    try:
        return fields["values"].reshape(fields["shape"])
    except ValueError as error:
        raise Refusal(f"expected a recorded state of the right shape: {error!s:.80}") from error


def recorded_setups(recording: Recording) -> list[tuple[float, Setup]]:
    """The setups in a recording, each with the time in s from its beginning on which it was used.

    A `Refusal` where one is none.
    """
    return [
        (since, setup_from_text(text, recording.attachment))
        for since, text in islice(recording.setups(), _SETUPS)
    ]


@dataclass(frozen=True)
class RecordingSummary:
    """Overview of the recording at `path` before it is played; `length` in s.

    `setups` it was made with, each from a time in s on, and why they cannot be read.
    """

    path: Path
    length: float = 0.0
    whole: bool = True
    setups: tuple[tuple[float, Setup], ...] = ()
    trouble: str = ""

    def setup_at(self, at: float) -> Setup | None:
        """The setup in use at `at` s; before the first setup, that one."""
        used = [setup for since, setup in self.setups if since <= at] or [
            setup for _, setup in self.setups[:1]
        ]
        return used[-1] if used else None


def summary_of(path: Path) -> RecordingSummary:
    """Contents of the file at `path`; a `Refusal` where it is no recording."""
    with Recording(path) as recording:
        length = recording.seconds(recording.last)
        try:
            setups = tuple(recorded_setups(recording))
        except Refusal as refusal:
            return RecordingSummary(path, length, recording.whole, (), str(refusal))
        return RecordingSummary(path, length, recording.whole, setups)


_COMPARED = {
    m.CONTACTS.name: m.CONTACT,
    m.SECONDS.name: m.SECOND_CONTACT,
    m.CURVATURES.name: m.CURVATURE,
    m.SHAPES.name: m.COEFFICIENTS,
}
_REPORTED = 1000  # messages between two reports of the share done


_GETTERS: dict[str, Getter] = {**getters(), "shape": attrgetter("estimate.coefficients.shape")}
_UNITS = {f"{each.name}{suffix}": each.unit for each in REPORTED for suffix, _, _ in each.forms}


@dataclass(frozen=True)
class QuantityDifference:
    """How the quantity `name`, in a `unit`, differs in `different` results.

    `largest` is the largest difference of two numbers, `scale` the largest recorded number in those
    results. In `unlike` ones only one has a number there, or they are other values than numbers.
    """

    name: str
    unit: str
    different: int = 0
    unlike: int = 0
    largest: float = 0.0
    scale: float = 0.0

    def after(self, was: "NDArray[Any]", now: "NDArray[Any]") -> "QuantityDifference":
        """With another result that differs: it `was` recorded, and is another one `now`."""
        numbers = was.dtype.kind == now.dtype.kind == "f" and was.shape == now.shape
        both = np.isfinite(was) & np.isfinite(now) if numbers else np.zeros(0, bool)
        was, apart = (was[both], np.abs(was[both] - now[both])) if numbers else (both, both)
        return replace(
            self,
            different=self.different + 1,
            unlike=self.unlike + (not apart.any()),
            largest=max(self.largest, float(np.max(apart, initial=0.0))),
            scale=max(self.scale, float(np.max(np.abs(was), initial=0.0))),
        )

    @property
    def words(self) -> str:
        """The largest difference with its unit, and in how many results."""
        parts = list[str]()
        if self.largest:
            share = self.largest / self.scale if self.scale else math.inf
            number = f"{self.largest:.3g} {self.unit}".rstrip()
            parts.append(f"{number} at most, {share:.2g} of the largest recorded number")
        if self.unlike:
            parts.append(f"another value, or a number in one only, in {self.unlike:,}")
        return f"{self.name}: {'; '.join(parts)} ({self.different:,} differ)"


def _same(was: "NDArray[Any]", now: "NDArray[Any]") -> bool:
    """Whether they are the same, real numbers bit for bit."""
    real = was.dtype.kind == now.dtype.kind == "f" and was.shape == now.shape
    return was.tobytes() == now.tobytes() if real else np.array_equal(was, now)


@dataclass(frozen=True)
class Verification:
    """Counts of contacts, curvatures and shapes `compared`, of `frames`, and `different`.

    `first` describes the first difference, `largest` is the largest as a share of the largest
    number in the same array. `missing` counts recorded results whose frames are missing. It was
    recorded by the program and revision `made_by`, of `another` revision than this one, whose
    `changes` are the quantities that differ.
    """

    frames: int
    compared: int
    missing: int
    different: int
    first: str
    largest: float
    made_by: str
    another: bool
    changes: tuple[QuantityDifference, ...]

    @property
    def same(self) -> bool:
        return self.compared > 0 and not (self.different or self.missing)

    @property
    def passed(self) -> bool:
        """Whether all results are the same, as far as they are of the same revision."""
        return self.same or (self.another and self.compared > 0 and not self.missing)

    @property
    def words(self) -> str:
        """The verdict as a sentence or two; a line for each quantity that changed."""
        counts = f"{self.compared:,} recorded results of {self.frames:,} frames"
        if not self.compared:
            return f"{counts}: nothing to compare"
        parts = [f"{counts}: {self._verdict}"]
        if self.different and not self.another:
            parts.append(f"{self.different:,} differ, by {self.largest:.1g} of the largest number")
            parts.append(f"first difference: {self.first}")
        if self.missing:
            parts.append(f"the frames of {self.missing:,} further results are missing")
        return "; ".join(parts)

    @property
    def _verdict(self) -> str:
        same = "the same bit for bit" if self.same else "not the same"
        if not self.another:
            return same
        of = f"recomputed by another revision: recorded by {self.made_by}, recomputed by "
        return f"{of}{made_by()}" + ("" if self.different else "; the same bit for bit")

    @property
    def changed(self) -> tuple[str, ...]:
        """A line for each quantity that another revision changed."""
        return tuple(change.words for change in self.changes) if self.another else ()

    @staticmethod
    def steps(path: Path, finger: str | None = None) -> "Generator[float | Verification]":
        """Recompute all results recorded in `path`, of one `finger` of a hand, and compare.

        Yields the share that is done now and then, and the verdict at the end. To be run in one
        thread, as the engine is: several sum in another order. A `Refusal` where it is no
        recording.
        """
        with Recording(path, finger) as recording:
            worker = _Worker(recording)
            span = max(recording.last - recording.first, 1)
            for n, message in enumerate(recording.messages()):
                worker(message)
                if n % _REPORTED == 0:
                    yield (message.stamp - recording.first) / span
            yield worker.verdict()


class _Worker:
    """Processes messages in the order in which they were written."""

    def __init__(self, recording: Recording) -> None:
        self._recording, self._recomputation = recording, Recomputation(recording)
        self._frames = self._compared = self._missing = self._different = 0
        self._first, self._largest = "", 0.0
        self._changes: dict[str, QuantityDifference] = {}

    def __call__(self, message: RecordedMessage) -> None:
        if kind := _COMPARED.get(message.topic):
            self._compare(decode(kind, message.data))
            return
        for _ in self._recomputation(message):
            self._frames += 1

    def _compare(self, recorded: dict[str, Any]) -> None:
        """Recompute the frame of a recorded estimate, and compare the two."""
        estimate = self._recomputation.estimate(recorded["sequence"])
        if estimate is None:
            self._missing += 1
            return
        self._compared += 1
        names = (name for name in recorded if not name.startswith("header."))
        differences = [
            d for name in names if (d := self._difference(name, recorded[name], estimate))
        ]
        self._different += bool(differences)
        self._first = self._first or "; ".join(differences[:1])

    def _difference(self, name: str, value: Any, estimate: Estimate) -> str:
        """How a number, or list of numbers, differs from the recorded one; empty if it does not."""
        again = _GETTERS[name](Reported(estimate))
        was, now = np.asarray(value).ravel(), np.asarray(again).ravel()
        if _same(was, now):
            return ""
        change = self._changes.get(name) or QuantityDifference(name, _UNITS.get(name, ""))
        self._changes[name] = change.after(was, now)
        real = was.dtype.kind == now.dtype.kind == "f" and was.shape == now.shape
        scale = float(np.max(np.abs(was), initial=0.0)) if real else math.nan
        share = float(np.max(np.abs(was - now))) / scale if scale > 0 else math.inf
        self._largest = max(self._largest, share if share == share else math.inf)
        return (
            f"frame {estimate.sequence} at {estimate.device_time:.6f} s: {name} was "
            f"{_short(was)}, and is {_short(now)} now"
        )

    def verdict(self) -> Verification:
        return Verification(
            self._frames,
            self._compared,
            self._missing,
            self._different,
            self._first,
            self._largest,
            self._recording.made_by,
            self._recording.revision != REVISION,
            tuple(self._changes.values()),
        )


def _short(values: "NDArray[Any]") -> str:
    return ", ".join(f"{value!r}" for value in values[:4].tolist()) + ", ..." * (len(values) > 4)
