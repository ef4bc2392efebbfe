"""Import: files of other programs to recordings of a described sensor."""

import errno
import math
import re
import time
from collections import Counter
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from kappaskin.errors import Refusal
from kappaskin.frames import Frame
from kappaskin.pipeline import Pipeline, Setup, pipeline_for
from kappaskin.recording.disk import ScratchTask, is_there
from kappaskin.recording.foreign import DAMAGES, NO_TIME, FileRow, rows_of
from kappaskin.recording.recorder import Recorder
from kappaskin.sources import (
    ClockState,
    Interpreter,
    RecordedClock,
    fields_of,
    load_description,
    sensor_to_json,
)
from kappaskin.sources.wire import Samples

_EVERY, _THEN = 10_000, 100  # first frames that have a recorded estimate; then one of so many
_TRIED = 1000  # rows, of which one must be a record
_HELD = 2**16  # bytes of bad rows that wait for a good one
_REPORT = 0.05  # s between two reports
_DATES = 1e9, 2.0**31 - 1  # s: from 2001 to 2038 they are since 1970, else since any beginning
_JUMP = 1e9  # s between two records, which is none of a clock that goes on
_SHOWN = 60  # characters of a bad row
_ELSEWHERE = "free space, or choose another folder"
_NAME = re.compile(rb"(?i)(?!nan$|inf$|infinity$)[a-z_\x80-\xff]")


@dataclass(frozen=True)
class ImportRequest:
    """The recording `to` of the rows of a `file`, of a sensor whose description is in `sensor`.

    Of a bag they are the messages of one `topic`; of the only one that fits, if left out. A
    `Refusal` where `to` exists.
    """

    file: Path
    to: Path
    sensor: Path
    topic: str = ""

    def __post_init__(self) -> None:
        if is_there(self.to):
            raise Refusal(f"{self.to}: already exists; choose another name")


@dataclass(frozen=True)
class BadRows:
    """How many rows are no record for one `reason`, and the first of them with its number."""

    reason: str
    count: int
    number: int
    first: str

    @property
    def words(self) -> str:
        many = f"{self.count:,} rows" if self.count > 1 else "1 row"
        return f"{many}: {self.reason}, first row {self.number:,}" + (
            f": {self.first}" if self.first else ""
        )


class Imported(NamedTuple):
    """How many `frames` of so many `seconds` were imported, of `rows` that are no headings.

    `headings` counts these, comments and empty lines. Times went `back` so often, `lost` sequence
    numbers are missing. `bad` are the rows that are no records.
    """

    rows: int
    frames: int
    seconds: float
    headings: int
    back: int
    lost: int
    bad: tuple[BadRows, ...]

    @property
    def words(self) -> str:
        """Counts of what was imported, as text."""
        parts = (
            f"{self.frames:,} of {self.rows:,} rows, {self.seconds:.6g} s",
            f"headings, comments, empty lines: {self.headings:,}" if self.headings else "",
            f"sequence numbers that are missing: {self.lost:,}" if self.lost else "",
            f"times that go back, and continue from there: {self.back:,}" if self.back else "",
        )
        return "; ".join(filter(None, parts))


def import_steps(request: ImportRequest, scratch: Path) -> Generator[float | Imported]:
    """Make the requested recording in the folder `scratch`.

    Now and then the share that is done, and what came of it at the end. A `Refusal` with the row
    where the file is not what it says, or more than half of its rows are no records.
    """
    work, next_report = _Import(request, scratch / request.to.name), 0.0
    with closing(work):
        try:
            for row in rows_of(request.file, work.description, request.topic, scratch):
                work.take(row)
                if time.monotonic() >= next_report:
                    next_report = time.monotonic() + _REPORT
                    yield min(row.share, 1.0)
            work.end()
        except Refusal as refusal:
            words, made = str(refusal), str(work.to)
            if words.startswith(made):  # which nobody knows, and is removed
                why = words.removeprefix(made).removeprefix(".part: ").removeprefix(": ")
                raise Refusal(f"{request.to}: {why.partition(';')[0]}; {_ELSEWHERE}") from refusal
            named = words.startswith(str(request.file))
            raise Refusal(f"{'' if named else f'{request.file}: '}{words}") from refusal
        except DAMAGES as error:
            after = f" after row {work.rows:,}" if work.rows else ""
            why = getattr(error, "strerror", None) or str(error)
            if getattr(error, "errno", None) in (errno.ENOSPC, errno.EDQUOT):
                raise Refusal(f"{request.to}: {why}; {_ELSEWHERE}") from error
            raise Refusal(
                f"{request.file}: cannot be read{after} ({why:.100}); check its name, and that it "
                "is whole"
            ) from error
    yield work.done()


class _Import:
    """Takes rows in order, as a source takes the records of a device, at their own times."""

    def __init__(self, request: ImportRequest, to: Path) -> None:
        self._request, self.to = request, to
        self.description = load_description(request.sensor)
        self._decoder = self.description.decoder(whole=True)
        self._timed = self._decoder.timed
        self._interpreter = Interpreter(str(request.file))
        self._clock = RecordedClock()
        self._interpreter.begin(self._clock)
        self._recorder: Recorder | None = None
        self._pending = self._decoder.held  # bytes to record with the next record
        self._pipeline: Pipeline | None = None
        self.rows = self._headings = self._frames = self._back = 0
        self._heading = b""
        self._base = self._last = self._now = self._room = 0.0  # s
        self._since = set[int]()  # sequence numbers since the last estimate
        self._bad, self._first = Counter[str](), dict[str, tuple[int, str]]()

    def take(self, row: FileRow) -> None:
        """Take one row."""
        self.rows += 1
        data = row.data
        if isinstance(data, list):
            try:
                data = self._decoder.record(data)
            except ValueError as error:
                data = f"no number of the record: {error}"
        if isinstance(data, str):
            reason, _, first = data.partition(": ")
            self._discard(reason, first)
        elif not self._is_heading(data):
            self._feed(data, row.time)
        if not self._frames and self._bad.total() >= _TRIED:
            self._refuse()

    def _is_heading(self, line: bytes) -> bool:
        """Whether a line is a comment, empty, or the names of columns; numbers of columns too."""
        if self.description.kind != "text":
            return self.description.kind == "json" and not line.strip()
        text = line.strip()
        found = not text or text.startswith((b"#", b"%", b"//")) or text == self._heading
        if not found and not (self._frames or self._heading):
            fields = [field.strip(b' "') for field in fields_of(text)]
            counted = [b"%d" % n for n in range(len(fields))]
            found = fields in (counted, [b"", *counted[:-1]]) or any(map(_NAME.match, fields))
            self._heading = text if found else b""
        self._headings += found
        return found

    def _feed(self, data: bytes, seconds: float) -> None:
        decoder, duplicates = self._decoder, self._decoder.sequence.duplicate
        samples = decoder.feed(data)
        last, decoder.last = decoder.last, ""
        self._pending += data
        for each in samples:
            self._add(each, seconds)
        if decoder.sequence.duplicate > duplicates:
            self._discard("duplicate", "")
        elif last and not samples:
            reason, _, first = last.partition(": ")
            self._discard(reason, first)
        if self._recorder and len(self._pending) > _HELD:
            self._record(self._recorder)

    def _record(self, recorder: Recorder) -> None:
        """Record the bytes that are pending, at the present time."""
        recorder.received(self._now, self._pending)
        self._pending = b""
        recorder.wait()
        if not recorder.written.active:
            raise Refusal(recorder.written.trouble)

    def _discard(self, reason: str, first: str) -> None:
        if reason not in self._bad:
            self._first[reason] = self.rows, first
        self._bad[reason] += 1

    def _add(self, samples: Samples, seconds: float) -> None:
        """Record a record, at its time or that of its row in s."""
        if not self._timed and math.isnan(seconds):
            if not (rate := self.description.rate):
                raise Refusal(f"expected times of its records, got none; {NO_TIME}")
            seconds = self._frames / rate
        # The interpreter unwraps it once more, which changes nothing.
        at = self._clock.unwrap(samples.time) if self._timed else seconds
        recorder = self._recorder or self._begin(at, seconds)
        if at < self._last or at - self._last > _JUMP:
            self._back += 1
            self._base = at - self._now
            self._map(recorder, at)
        self._last, self._now = at, at - self._base
        if self._now > self._room:
            raise Refusal(
                f"row {self.rows:,}: expected a time before 2038, where those of recordings end, "
                f"got one {self._now:.6g} s after the first; check its unit: s, or that of "
                "a column time_ms or time_us"
            )
        self._record(recorder)
        if frame := self._interpreter.frame(samples, self._now):
            self._estimate(recorder, frame)
            self._frames += 1

    def _begin(self, at: float, seconds: float) -> Recorder:
        """Begin a recording whose first record is of the time `at`, in a row of `seconds`, in s."""
        self._base = self._last = at
        first, last = _DATES
        dated = next((s for s in (at, seconds) if first < s < last), time.time())
        self._room = last - dated
        recorder = self._recorder = Recorder(self.to, 0.0, zero=round(dated * 1e9))
        self._interpreter.learn(text := sensor_to_json(self.description.sensor))
        recorder.connected(text)
        self._map(recorder, at)
        if self._interpreter.sensor is not None:
            self._pipeline, _ = pipeline_for(self._interpreter.sensor, Setup(), smaller=True)
            recorder.set_up(self._pipeline)
        return recorder

    def _map(self, recorder: Recorder, at: float) -> None:
        """Map the sensor's times exactly; how late they are is not known."""
        state, offset = self._clock.state, -self._base if self._timed else 0.0
        state = ClockState((at, offset, math.inf, 0.0, 0.0, False), state.wraps, state.last)
        self._clock.restore(state)
        recorder.clock(math.nan, state)

    def _estimate(self, recorder: Recorder, frame: Frame) -> None:
        """Record an estimate of a frame, of the first ones and now and then.

        It is found by its number alone: of two with the same one only the first has one.
        """
        if (pipeline := self._pipeline) is None:
            return
        due = self._frames < _EVERY or not self._frames % _THEN
        if due and frame.sequence not in self._since:
            recorder.take(frame, pipeline(frame))
            self._since.clear()
        else:
            pipeline.pass_over(frame)
        self._since.add(frame.sequence)

    def _refuse(self) -> None:
        """Raise the refusal of a file of which too little is a record."""
        description, path = self.description, self._request.file
        if not self._bad:
            raise Refusal(f"{path}: expected rows with numbers, got none")
        reason = max(self._bad, key=self._bad.__getitem__)
        number, first = self._first[reason]
        raise Refusal(
            f"{path}: row {number:,}: {reason}"
            + (f": {first}" if first else "")
            + f"; expected {len(description.columns)} numbers as in [line] of "
            f"{self._request.sensor.name}, but {self._bad.total():,} of "
            f"{self.rows - self._headings:,} rows are no such records"
        )

    def end(self) -> None:
        """End the recording; a `Refusal` where most rows were bad."""
        if self._decoder.held.strip(b"\n"):
            self._discard("cut off", "")
        if not self._frames or 2 * self._bad.total() > self.rows - self._headings:
            self._refuse()
        if (recorder := self._recorder) is None:
            return
        if self._pending:
            self._record(recorder)
        recorder.disconnected(self._now)
        recorder.close()
        if recorder.written.trouble or recorder.written.lost:
            raise Refusal(recorder.written.trouble or f"{self.to}: the disk is slow")

    def close(self) -> None:
        """Close what is open."""
        if self._recorder is not None:
            self._recorder.close()

    def done(self) -> Imported:
        """What came of it."""
        return Imported(
            self.rows - self._headings,
            self._frames,
            self._now,
            self._headings,
            self._back,
            self._decoder.accounting().lost,
            tuple(BadRows(reason, n, *self._first[reason]) for reason, n in self._bad.items()),
        )


class ImportTask(ScratchTask[Imported]):
    """Makes the requested recording."""

    def __init__(self, request: ImportRequest) -> None:
        self.request = request
        super().__init__(
            "kappaskin-import", request.to, (request.to,), Imported, import_steps, request
        )
