"""Common parts of commands: exit codes, stop signals, pairs of numbers, progress, JSON, files."""

import json
import math
import os
import re
import signal
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from cyclopts import Parameter, Token

from kappaskin._text import printable
from kappaskin.errors import Refusal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kappaskin.live import Engine, Status
    from kappaskin.pipeline import Setup

_Kind = TypeVar("_Kind")

FAILED = 1
"""Exit code of a command that was completed, but part of its result failed."""

REFUSED = 2
"""Exit code of a command that was refused, with the reason on standard error."""

Switch = Annotated[bool, Parameter(negative="")]
"""An option that is there or not."""

Limit = Annotated[
    str,
    Parameter(help="Memory and work that reading the file may take, such as 2GB."),
]
"""An option for `allow`."""

Described = Annotated[
    Path | None,
    Parameter(
        help="TOML file that describes a sensor with a line format of its own; the source may then "
        "also be udp://:PORT, - for standard input, or a file to play."
    ),
]
"""An option for `of_sensor`."""


def _source(_: type, tokens: Sequence[Token]) -> str:
    name = tokens[0].value
    if name.startswith("-") and name != "-":
        raise ValueError(f"expected a source, or - for standard input, got the option {name}")
    return name


SourceName = Annotated[str, Parameter(allow_leading_hyphen=True, converter=_source)]
"""The name of a source; - is standard input, and no option."""

Sources = Annotated[
    list[str] | None,
    Parameter(name="--source", negative="", allow_leading_hyphen=True),
]
"""An option for `fingers_of`."""

DescribedFingers = Annotated[
    list[str] | None,
    Parameter(
        name="--sensor",
        negative="",
        help="TOML file that describes a sensor with a line format of its own; the source may then "
        "also be udp://:PORT, - for standard input, or a file to play. Of one finger alone as "
        "NAME=FILE; may be given several times.",
    ),
]
"""An option for `fingers_of`."""

_UNITS = {"kB": 1e3, "MB": 1e6, "GB": 1e9, "TB": 1e12}


def _whole(_: type, tokens: Sequence[Token]) -> int:
    text = tokens[0].value
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"expected a whole number such as 2, got {text!r}") from None


Whole = Annotated[int, Parameter(converter=_whole)]
"""A whole number; without the converter the command line would accept 2.5 as 2."""

Pair = Annotated[str, Parameter(allow_leading_hyphen=True)]
"""Two numbers such as 8x8; a leading hyphen is accepted so that -1x8 is refused clearly."""


def pair(text: str, what: str) -> tuple[int, int]:
    """The two numbers of `text`; raises a `Refusal` that names `what` was expected."""
    try:
        first, second = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise Refusal(f"expected {what} as two numbers such as 8x8, got {text!r}") from None
    return first, second


def allow(limit: str) -> None:
    """Let reading a file take up to a `limit` such as 2GB; as usual where that is empty."""
    from kappaskin._files import LIMIT

    if not limit:
        return
    number, unit = limit[:-2].strip(), limit[-2:]
    if not (unit in _UNITS and re.fullmatch(r"\d{1,6}(\.\d{1,6})?", number)):
        raise Refusal(f"expected a limit such as 500MB or 2GB, got {limit!r}")
    os.environ[LIMIT] = str(round(float(number) * _UNITS[unit]))


def of_sensor(source: str, sensor: Path | None) -> str:
    """The name of `source` where it has the description in the file `sensor`, if there is one."""
    if sensor is None:
        if source == "-" or source.startswith("udp://"):
            raise Refusal(f"expected --sensor FILE, which describes the lines of {source}; give it")
        return source
    if source == "-" and (sys.stdin is None or sys.stdin.closed):
        raise Refusal("expected a source, but standard input (-) is closed; pipe something to it")
    from kappaskin.sources import described_source, load_description

    described = described_source(sensor, source)
    load_description(sensor)  # or refused here
    return described


def fingers_of(
    source: str | None, sources: list[str] | None, sensors: list[str] | None
) -> dict[str, str]:
    """The source of each finger by its name, empty where there is one without, and no other.

    One source alone may name a hand by its description, or a recording of one. Each has the
    description of its own in `sensors`, or the one without a name.
    """
    from kappaskin.hand import named_hand
    from kappaskin.recording import Recording, ReplayedSource
    from kappaskin.sources import named_sources

    if (source is None) == (not sources):
        raise Refusal(
            "expected a source such as sim:, or --source NAME=SOURCE for each finger of a hand; "
            f"got {'none' if source is None else 'both'}"
        )
    named = named_sources(sources or [source or ""])
    only = named.get("", "")
    if only.startswith(ReplayedSource.SCHEME) and Path(only.partition(":")[2]).exists():
        with Recording(Path(only.partition(":")[2])) as recording:
            if len(recording.fingers) > 1:
                named = {finger: f"{only}#{finger}" for finger in recording.fingers}
    elif (hand := named_hand(only)) is not None:
        named = hand.sources
    files = dict[str, Path]()
    for text in sensors or ():
        finger, found, file = text.partition("=")
        finger, file = (finger, file) if found and finger in named else ("", text)
        files[finger] = Path(file)
    return {
        finger: of_sensor(each, files.get(finger, files.get(""))) for finger, each in named.items()
    }


class FingerMonitor:
    """Follows a finger of a hand: uses its saved tare, and prints what happens to it, each once.

    Called now and then, it returns the status; `slope` is the largest that was neglected though it
    matters. Without `tares` another one decides on the setup.
    """

    def __init__(self, finger: str, engine: "Engine") -> None:
        self._finger, self._engine = finger, engine
        self.tared, self.slope = UsedTare(engine), 0.0
        self._printed = set[str]()

    def __call__(self, tares: bool = True) -> "Status":
        from kappaskin.live import LOST

        status = self._engine.status()
        if tares:
            self.tared(status)
        self.slope = max(self.slope, status.slope)
        notices = [event.text for event in status.events if event.kind in ("noise", "engine")]
        if status.state == LOST or self._engine.silent:
            notices.append(status.message)
        for text in filter(None, (*notices, status.refusal)):
            words = "".join(filter(str.isalpha, text))  # it may count seconds
            if words not in self._printed:
                self._printed.add(words)
                show(f"kappaskin: {self._finger and f'{self._finger}: '}{text}", error=True)
        return status


class UsedTare:
    """Lets an `engine` use the saved tare of each sensor; called with every status.

    `connections` are those whose tare is in use.
    """

    def __init__(self, engine: "Engine") -> None:
        self._engine, self.connections = engine, 0
        self._usual: Setup | None = None

    def __call__(self, status: "Status") -> None:
        from kappaskin.pipeline import usual_setup

        if status.connections != self.connections and status.sensor is not None:
            asked = self._engine.requested.setup.quantities
            self.connections = status.connections
            self._usual = replace(usual_setup(status.sensor), quantities=asked)
            if not status.sensor.simulated:
                self._engine.set_up(self._usual)
        usual, used = self._usual, status.setup
        if usual and status.refusal and used == replace(usual, Ni=used.Ni, Nj=used.Nj) != usual:
            self._engine.set_up(used)  # as many as the elements determine: nobody asked for more
            self._usual = None


def stops() -> list[int]:
    """List that receives the stop signals (Ctrl+C, end of a service) from now on."""
    stopped: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda got, _: stopped.append(got))
    return stopped


def check_time(seconds: float, what: str) -> None:
    """Raise a `Refusal` unless there is time to do `what`."""
    if not seconds > 0:
        raise Refusal(f"expected a time above 0 s ({what}), got {seconds:g}")


def check_output(out: Path, *read: str | Path) -> None:
    """Raise a `Refusal` where the file `out` is one of those that are `read`."""
    for file in map(Path, read):
        try:
            same = out.samefile(file)
        except (OSError, ValueError):  # there is none, or it is the name of something else
            same = False
        if same:
            raise Refusal(f"{out}: is also the input; choose another file to write to")


def show(*lines: object, error: bool = False, end: str = "\n") -> None:
    """Print lines at once, on standard error if `error`; what cannot be seen in them as escapes."""
    for line in lines:
        print(printable(str(line)), end=end, file=sys.stderr if error else sys.stdout, flush=True)


class ProgressLine:
    """Progress on standard error: a line that changes on a terminal, elsewhere one now and then.

    A context manager; `log_every` are the seconds between two lines where there is no terminal.
    """

    def __init__(self, log_every: float = math.inf) -> None:
        self._terminal = sys.stderr.isatty()
        self._log_every, self._logged = log_every, time.monotonic()

    def __call__(self, line: str) -> None:
        if self._terminal:
            print("\r\x1b[K", end="", file=sys.stderr)
            show(line, error=True, end="")
        elif time.monotonic() - self._logged > self._log_every:
            self._logged = time.monotonic()
            show(line, error=True)

    def __enter__(self) -> "ProgressLine":
        return self

    def __exit__(self, *_: object) -> None:
        if self._terminal:
            show("", error=True)


def result_of(items: Iterable[object], kind: type[_Kind]) -> _Kind:
    """The result, of a `kind`, at the end of work that reports the share done until then."""
    with ProgressLine() as show_progress:
        for item in items:
            if isinstance(item, kind):
                return item
            show_progress(f"{item:4.0%}")
    raise Refusal("the task ended without a result; try again")


def print_json(value: Any) -> None:
    """Print one JSON value on a line."""
    show(json.dumps(value, allow_nan=False))


def print_result(value: Any, as_json: bool, text: Callable[[], str]) -> None:
    """Print a value as JSON, or as the `text` that people read."""
    if as_json:
        print_json(value)
    else:
        show(*text().split("\n"))


def lined(lines: Iterable[str]) -> str:
    """The lines as a text; a line break in one of them is an escape."""
    return "\n".join(map(printable, lines))


def save_arrays(out: Path, arrays: "Mapping[str, NDArray[Any]]") -> None:
    """Write an NPZ; raises a `Refusal` where that cannot be."""
    import numpy as np

    from kappaskin._files import replacing

    with replacing(out) as part, part.open("wb") as file:
        np.savez(file, **arrays)  # pyright: ignore[reportArgumentType]
