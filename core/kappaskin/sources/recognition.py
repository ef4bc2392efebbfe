"""Recognition: what the lines of an unknown board are, and the description that follows."""

import json
import math
import re
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from itertools import cycle, groupby
from typing import Any, cast

import numpy as np

from kappaskin._toml import table
from kappaskin.errors import Refusal, SourceError
from kappaskin.frames import Array
from kappaskin.sources.description import Description, description_of
from kappaskin.sources.inputs import UDP, Datagrams
from kappaskin.sources.lines import SEPARATORS, TIMES
from kappaskin.sources.ports import BAUD_RATES, Port, SerialConnection

_KEPT, _JUDGED = 300, 40  # lines whose numbers are held, and by which their form is judged
_LONGEST = 2**16  # bytes of a line
_ALIKE, _TEXT = 0.8, 0.9  # share of lines of one form, and of bytes that are text
_GAP = 0.01  # s at least between two lines of a course
_SPAN = 0.5  # s that times are compared with those of arrival
_SECONDS, _MILLISECONDS = 0.5, 400.0  # steps of a file's times below which they are in these
_OFF = 0.1  # share by which the rate of a clock may differ
_SPOKEN = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "spaces"}
_UNITS = {"time": "s", "time_ms": "ms", "time_us": "\N{MICRO SIGN}s"}
_PRINTED = frozenset(range(32, 127)) | frozenset(b"\t\r\n")

TEXT_RATES = (115_200, 9600, 57_600, 38_400, 19_200, *BAUD_RATES)
"""Baud rates of boards that print text, the usual one first."""

_DWELL, _RETRY = 0.8, 1.0  # s of garbled bytes before another rate; s between two tries to open
_ENOUGH = 64  # bytes by which they are judged
_HEADING = 8  # first lines among which a heading may be

_BINARY = (
    "The bytes are no text: another baud rate, or binary records, which a file describes (guide: "
    "Your own sensor)."
)
_COMMA = "The numbers have a decimal comma; let the board print a point."
_WORDS = "The lines are no numbers; let the board print numbers alone, the same count in each line."


@dataclass(frozen=True, eq=False)
class RecognisedLines:
    """What is recognised of lines: their `kind`, text or json, empty until there are enough.

    Each has a number for each of `labels`, as `numbers` (n, columns) of the newest lines; of JSON
    `paths` has the key of each value and how many numbers it has. `rate` in 1/s is that of lines.
    `roles` are what columns are found to be: a time, `sequence`, empty for a constant beside the
    readings, None for a reading; none at all until there is time enough. `trouble` says what it is
    instead, and what to do.
    """

    kind: str = ""
    separator: str = ""
    labels: tuple[str, ...] = ()
    paths: tuple[tuple[str, int], ...] = ()
    rate: float = math.nan
    numbers: Array = field(default_factory=lambda: np.empty((0, 0)))
    roles: tuple[str | None, ...] = ()
    trouble: str = ""

    @property
    def text(self) -> str:
        """What is recognised, in a sentence."""
        if not self.kind:
            return self.trouble or "Waiting for lines."
        how = f"separated by {_SPOKEN[self.separator]}" if self.separator else "in each line"
        what = "Numbers" if self.kind == "text" else "A JSON object"
        parts = [f"{what} {how}", f"{len(self.labels)} columns"]
        parts += [f"{self.rate:.0f} lines/s"] if math.isfinite(self.rate) else []
        for place, role in enumerate(self.roles):
            if role in TIMES:
                parts.append(f"column {place} is the time in {_UNITS[role]}")
            elif role == "sequence":
                parts.append(f"column {place} counts the lines")
        return "; ".join(parts) + "."


class Recogniser:
    """Finds out from bytes as they arrive what the lines of a board are; never raises.

    Those of a file have not `arrived`: their times cannot be compared with a clock.
    """

    def __init__(self, arrived: bool = True) -> None:
        self._arrived = arrived
        self.lines = deque[tuple[float, str]](maxlen=_KEPT)
        """The newest lines, with the time of their arrival in s."""
        self._course = deque[tuple[float, str]](maxlen=_KEPT)  # with gaps, for seconds
        self._buffer, self._first, self._head = b"", True, list[str]()
        self._bytes = Counter[bool]()  # whether they are text

    def feed(self, now: float, data: bytes) -> None:
        """Take bytes that arrived at the time `now` in s."""
        self._bytes.update(byte in _PRINTED for byte in data[:_LONGEST])
        *lines, self._buffer = (self._buffer + data).split(b"\n")
        self._buffer = self._buffer[-_LONGEST:]
        for line in lines:
            if not (self._first and self._arrived) and line.strip():
                text = line[:_LONGEST].decode(errors="replace").strip()
                self.lines.append((now, text))
                if not self._course or now - self._course[-1][0] >= _GAP:
                    self._course.append((now, text))
                self._head += [text] * (len(self._head) < _HEADING)
            self._first = False  # of which the beginning may be missing

    @property
    def garbled(self) -> bool:
        """Whether much of what came is no text."""
        return self._bytes.total() >= _ENOUGH and self._bytes[True] < _TEXT * self._bytes.total()

    def found(self) -> RecognisedLines:
        """What is recognised up to now."""
        if self.garbled:
            return RecognisedLines(trouble=_BINARY)
        lines = [line for _, line in (*self._course, *self.lines)]
        if len(self.lines) < 3:
            return RecognisedLines()
        if _decimal_commas(lines[-_JUDGED:]):
            return RecognisedLines(trouble=_COMMA)
        if (found := _json(lines) or _text(lines, self._head)) is not None:
            return self._measured(*found)
        return RecognisedLines(trouble=_WORDS)

    def _measured(
        self,
        kind: str,
        separator: str,
        labels: tuple[str, ...],
        paths: tuple[tuple[str, int], ...],
        rows: list[list[float] | None],
    ) -> RecognisedLines:
        """With the rate, and what the columns are by their course."""
        split, columns = len(self._course), len(labels)
        course, since = _numbers(rows[:split], self._course, columns)
        numbers, times = _numbers(rows[split:], self.lines, columns)
        span = float(times[-1] - times[0]) if len(times) else 0.0
        rate = (len(times) - 1) / span if span > 0 else math.nan
        passed = float(since[-1] - since[0]) if len(since) else 0.0
        roles: tuple[str | None, ...] = ()
        if not self._arrived:
            roles = _roles(numbers, numbers, math.nan)
        elif passed > _SPAN:
            roles = _roles(numbers, course, passed)
        return RecognisedLines(kind, separator, labels, paths, rate, numbers, roles)


def _numbers(
    rows: list[list[float] | None], lines: Iterable[tuple[float, str]], columns: int
) -> tuple[Array, Array]:
    """The numbers (n, columns) of the lines that have them, and the times (n,) of these."""
    there = [(now, row) for row, (now, _) in zip(rows, lines, strict=True) if row is not None]
    numbers = np.array([row for _, row in there], float).reshape(len(there), columns)
    return numbers, np.array([now for now, _ in there])


_Form = tuple[str, str, tuple[str, ...], tuple[tuple[str, int], ...], list[list[float] | None]]


def _number(text: str) -> float | None:
    try:
        return float(text) if "_" not in text else None
    except ValueError:
        return None if text else math.nan


def _text(lines: list[str], head: list[str]) -> _Form | None:
    """Lines of numbers by the separator that gives most of them; a heading may be in the `head`."""
    best: tuple[int, str] | None = None
    for separator in SEPARATORS:
        counts = Counter(
            len(row) for line in lines[-_JUDGED:] if (row := _row(line, separator)) is not None
        )
        if not counts:
            continue
        count, often = counts.most_common(1)[0]
        if often >= _ALIKE * len(lines[-_JUDGED:]) and (best is None or count > best[0]):
            best = count, separator
    if best is None:
        return None
    count, separator = best
    rows = [
        row if row and len(row) == count else None for row in (_row(x, separator) for x in lines)
    ]
    return "text", separator, _headed(head, separator, count), (), rows


@lru_cache(2 * len(SEPARATORS) * _KEPT)  # lines are looked at again with each new one
def _row(line: str, separator: str) -> list[float] | None:
    """The numbers of a line; None where it has anything else."""
    parts = line.split() if separator == " " else line.split(separator)
    numbers = [_number(part.strip()) for part in parts]
    return None if None in numbers else cast("list[float]", numbers)


def _headed(lines: list[str], separator: str, count: int) -> tuple[str, ...]:
    """The names of columns in a heading, if there was one, else their numbers."""
    for line in lines:
        parts = [part.strip(' "') for part in line.split(separator if separator != " " else None)]
        if len(parts) == count and all(part and _number(part) is None for part in parts):
            return tuple(parts)
    return tuple(str(place) for place in range(count))


def _json(lines: list[str]) -> _Form | None:
    """Lines with a JSON object, by the keys of its numbers and lists of them."""
    found = [_leaves(line) for line in lines]
    forms = Counter(tuple((p, len(v)) for p, v in leaves) for leaves in found[-_JUDGED:] if leaves)
    if not forms:
        return None
    paths, often = forms.most_common(1)[0]
    if often < _ALIKE * len(found[-_JUDGED:]):
        return None
    labels = [path if count == 1 else f"{path}[{k}]" for path, count in paths for k in range(count)]
    rows = [
        [number for _, values in leaves for number in values]
        if leaves and tuple((p, len(v)) for p, v in leaves) == paths
        else None
        for leaves in found
    ]
    return "json", "", tuple(labels), paths, rows


@lru_cache(2 * _KEPT)
def _leaves(line: str) -> list[tuple[str, list[float]]] | None:
    """Every number, or list of numbers, of an object with the path of its keys."""
    try:
        value = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(value, dict):
        return None
    found: list[tuple[str, list[float]]] = []
    waiting: list[tuple[str, Any]] = [("", value)]
    while waiting:
        path, value = waiting.pop(0)
        values = cast("list[Any]", value if isinstance(value, list) else [value])
        if isinstance(value, dict):
            inside = cast("dict[str, Any]", value)
            waiting += [(f"{path}.{key}" if path else key, inside[key]) for key in inside]
        elif values and all(type(each) in (int, float) or each is None for each in values):
            found.append((path, [math.nan if v is None else float(v) for v in values]))
    return found or None


_DECIMAL = re.compile(r"[-+]?\d+(?:,\d+)?")


def _decimal_commas(lines: list[str]) -> bool:
    """Whether the lines are numbers with a comma in place of the point.

    Either another separator, such as a comma with a space, shows which commas these are; or every
    second number is as the digits behind a comma: always as many, and some begin with 0.
    """
    for separator in (";", "\t", ", ", " "):
        parts = [[part.strip() for part in line.split(separator)] for line in lines]
        each = [part for line in parts for part in line if part]
        several = all(len(line) > 1 for line in parts)
        if several and any("," in p for p in each) and all(map(_DECIMAL.fullmatch, each)):
            return True
    fields = [line.split(",") for line in lines]
    behind = [part.strip() for line in fields for part in line[1::2]]
    digits = {len(part) for part in behind}
    return (
        all(len(line) % 2 == 0 for line in fields)
        and len(digits) == 1
        and digits.pop() > 1
        and all(map(str.isdigit, behind))
        and any(part.startswith("0") for part in behind)
    )


def _roles(numbers: Array, course: Array, passed: float) -> tuple[str | None, ...]:
    """What each column is by the newest `numbers` (n, columns) and its `course` (m, columns).

    `passed` are the s of the course. Where that is not known, NaN, steps of 1 count, smaller ones
    are s and larger ones ms or us. Readings may rest: constants are ignored only before and behind
    those that vary, and where these are more.
    """
    roles = [
        _clock(recent, whole, passed) for recent, whole in zip(numbers.T, course.T, strict=True)
    ]
    for single in (TIMES, ("sequence",)):
        for place in [place for place, role in enumerate(roles) if role in single][1:]:
            roles[place] = ""
    lows, highs = (function(course, axis=0) for function in (np.fmin.reduce, np.fmax.reduce))
    left = [place for place, role in enumerate(roles) if role is None]
    varying = [place for place in left if lows[place] < highs[place]]
    if 2 * len(varying) > len(left):
        for place in left:
            if not varying[0] <= place <= varying[-1]:
                roles[place] = ""
    return tuple(roles)


def _clock(recent: Array, course: Array, passed: float) -> str | None:
    """The unit of time that a column goes by, or `sequence`; None for others."""
    steps = np.diff(course)
    if not (len(steps) and np.isfinite(course).all() and np.all(steps >= 0) and steps.any()):
        return None
    counts = len(recent) > 1 and bool(np.all(np.diff(recent) == 1))
    if math.isnan(passed):
        if counts or np.any(steps == 0):
            return "sequence" if counts else None
        step = float(np.median(steps))
        return "time" if step < _SECONDS else "time_ms" if step < _MILLISECONDS else "time_us"
    gone = float(course[-1] - course[0])
    near = {name: abs(gone * unit / passed - 1) for name, unit in TIMES.items()}
    name = min(near, key=near.__getitem__)
    return name if near[name] < _OFF else "sequence" if counts else None


READS: Mapping[str, tuple[str, ...]] = {
    "Heights": ("height",),
    "Slopes along x": ("slope@0",),
    "Slopes along x and y": ("slope@0", "slope@90"),
    "Curvatures along x": ("xx",),
    "Curvatures xx and yy": ("xx", "yy"),
    "Curvatures xx, yy and xy": ("xx", "yy", "xy"),
}
"""What the elements of a sensor usually read, by its name on the screen."""


def by_rows(columns: Sequence[str], grid: tuple[int, int]) -> tuple[str, ...]:
    """The columns of elements that are counted along x first, as of such along y first."""
    m, n = grid

    def renamed(column: str) -> str:
        what, found, element = column.partition(":")
        row, place = divmod(int(element or 0), m)
        return f"{what}:{place * n + row}" if found else column

    return tuple(map(renamed, columns))


def columns_of(
    found: RecognisedLines, reads: tuple[str, ...], interleaved: bool
) -> tuple[str, ...]:
    """The meaning of each column where its elements read `reads`, and times are as recognised.

    All readings of one kind stand together, or all of one element where they are `interleaved`.
    Columns beyond a whole number of elements are ignored.
    """
    roles = found.roles or (None,) * len(found.labels)
    places = [place for place, role in enumerate(roles) if role is None]
    count, columns = len(places) // len(reads), [role or "" for role in roles]
    for n, place in enumerate(places[: count * len(reads)]):
        kind, element = (n % len(reads), n // len(reads)) if interleaved else divmod(n, count)
        columns[place] = f"{reads[kind]}:{element}"
    return tuple(columns)


@dataclass(frozen=True)
class NewSensor:
    """What a person says of a sensor: its `title`, `size` (2,) in m, `grid`, `columns`.

    A reading is `scale` times the number, in SI. Without a `rigidity` in N m its material is
    unknown; with a `free` zero each frame has an unknown offset. `rate` in 1/s is that of a file
    without times.
    """

    title: str
    size: tuple[float, float]
    grid: tuple[int, int]
    columns: tuple[str, ...]
    scale: float = 1.0
    rigidity: float | None = None
    free: bool = False
    baud: int = 115_200
    rate: float | None = None


def description_text(found: RecognisedLines, sensor: NewSensor) -> str:
    """The text of the description of a `sensor` whose lines are as `found`, checked.

    A `Refusal` names what is wrong with it.
    """
    line: dict[str, Any] = {"kind": found.kind}
    if found.kind == "json":
        at, fields = 0, dict[str, str]()
        for path, count in found.paths:
            joined = _joined(sensor.columns[at : at + count])
            if len(joined) > 1:
                raise Refusal(
                    f"expected readings of one kind in {path}, of elements in their order along y "
                    f"first, got {', '.join(joined):.60}"
                )
            if joined[0] or count > 1:
                fields[path] = joined[0]
            at += count
        line["fields"] = {key: text for key, text in fields.items() if text}
    else:
        line |= {"separator": found.separator, "columns": _joined(sensor.columns)}
    skin = {"size": list(sensor.size)} | (
        {} if sensor.rigidity is None else {"rigidity": sensor.rigidity}
    )
    readings: dict[str, Any] = {"scale": sensor.scale}
    if sensor.free:
        readings["datum"] = "free"
    parts = (
        table("", {"format": 1, "title": sensor.title}),
        table("[skin]", skin, {"size": "m", "rigidity": "N m"}),
        table("[elements]", {"grid": list(sensor.grid)}),
        table("[line]", line | ({"rate": sensor.rate} if sensor.rate else {"baud": sensor.baud})),
        table("[readings]", readings),
    )
    text = "\n".join(parts)
    described(text)
    return text


def described(text: str) -> Description:
    """The description with this text, of no file yet; a `Refusal` where it is none."""
    return description_of(text, "new sensor")


def _joined(columns: tuple[str, ...]) -> list[str]:
    """The columns with ranges of elements, as a description has them."""
    joined: list[str] = []

    def run(each: tuple[int, str]) -> tuple[str, int]:
        what, found, element = each[1].partition(":")
        return what, each[0] - int(element) if found else -1 - each[0]

    for (what, _), group in groupby(enumerate(columns), run):
        names = [name for _, name in group]
        first, last = (name.partition(":")[2] for name in (names[0], names[-1]))
        joined.append(f"{what}:{first}..{last}" if len(names) > 1 else names[0])
    return joined


class RawLines:
    """Lines of an unknown board on a port, or at a URL; opened again whenever it is gone.

    `recogniser` has what came since it was there, at the `baud` rate that gave text. `poll` is to
    be called a few times a second; `trouble` says why nothing comes.
    """

    def __init__(self, url: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.url, self._clock, self._plug = url, clock, Port.named(url)
        self.recogniser, self.trouble = Recogniser(), ""
        self._rates = cycle(TEXT_RATES)
        self.baud = next(self._rates)
        self._connection: SerialConnection | None = None
        self._next_try = self._since = -math.inf

    def poll(self) -> None:
        """Take what arrived."""
        now = self._clock()
        if self._connection is None:
            if now >= self._next_try:
                self._open(now)
            return
        lost = self._connection.lost
        for arrived, data in self._connection.take(0.0):
            self.recogniser.feed(arrived, data)
        if lost and self._connection.empty:
            self.trouble = f"{self.url}: connection lost; plug the board in again."
            self.close()
        elif self.recogniser.garbled and now - self._since > _DWELL:
            self.baud, self._since = next(self._rates), now
            self._connection.set_baud_rate(self.baud)
            self.recogniser = Recogniser()

    def _open(self, now: float) -> None:
        self._next_try, self._since = now + _RETRY, now
        if self.trouble and self._plug.serial_number:  # perhaps under another name
            same = (port.port for port in Port.found() if port.same_plug(self._plug))
            self.url = next(same, self.url)
        opened = partial(Datagrams, self.url, self._clock) if self.url.startswith(UDP) else None
        try:
            self._connection = SerialConnection(self.url, self._clock, self.baud, opened)
        except SourceError as error:
            self.trouble = f"{error}; retrying."
            return
        self.trouble = ""
        self.recogniser = Recogniser()

    def close(self) -> None:
        """Let go of the port."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None
