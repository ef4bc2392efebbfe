"""Messages of an estimate as numbers and as JSON.

`CONTACT` lists the numbers of the message about the contact; the guide to it and to the others is
`publishing/messages.md` among the resources. What is not known is null: JSON has no NaN.
"""

import json
import math
import time
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from kappaskin._text import printable
from kappaskin.estimation import Fit
from kappaskin.frames import Estimate, Event
from kappaskin.pipeline import REPORTED, Number, Pipeline, Reported, ReportedQuantity, numbers_of
from kappaskin.sensing import Sensor

VERSION = 1
"""Version of the format; it changes when the meaning of a key changes."""

LARGEST = 2000
"""Largest datagram in bytes: PlotJuggler reads 2048 and discards the rest."""

MOST_FUNCTIONS = 80
"""Largest number of coefficients with error bars that always fit into a datagram."""

_LONGEST = 300  # characters of a text


_HEAD = (
    Number(
        "timestamp",
        "%.6f",
        "when the scan began or, if unknown, when it was read; s since 1970 by the sender's clock",
    ),
    Number("number", "%d", "count of the messages about contacts; a gap is a loss on the network"),
    Number("sequence", "%d", "scan number of the device; a gap was lost or not computed"),
    Number("generation", "%d", "number of the settings used"),
)
_AGE = Number("age_s", "%.6f", "time from timestamp until this message was sent")


def _published(group: str) -> tuple[ReportedQuantity, ...]:
    return tuple(q for q in REPORTED if q.group == group and q.kind != "?" and q.published)


def _of(quantities: Iterable[ReportedQuantity]) -> tuple[Number, ...]:
    return tuple(number for quantity in quantities for number in quantity.published)


_FRAME, _FIT, _AT_CONTACT, _AT_SECOND = map(_published, ("frame", "fit", "contact", "second"))
_FLAGS = tuple(q for q in REPORTED if q.kind == "?" and q.published)

CONTACT = (*_HEAD, *_of(_FRAME), _AGE, *_of(_FIT), *_of(_AT_CONTACT))
"""The numbers of a message about the contact, in order."""

SECOND = _of(_AT_SECOND)
"""The numbers of its object `second`, which is null where there is no second contact."""

SWITCHES = {number.key: number.text for number in _of(_FLAGS)} | {
    "shape_follows": "whether a message of kind shape follows in a datagram of its own",
}
"""What a message about the contact says with true or false."""

# Made once of the table, since they are called for every frame.
_frame_numbers, _fit_numbers, _contact_numbers, _second_numbers, _flags = map(
    numbers_of, (_FRAME, _FIT, _AT_CONTACT, _AT_SECOND, _FLAGS)
)
_NOTHING = [math.nan] * len(_of(_AT_CONTACT))
_FLAGS_TEXT = ",".join(f'"{key}":%s' for key in SWITCHES)


STATUS_NUMBERS = (
    "rate_per_s",
    "since_last_frame_s",
    "width_x_m",
    "width_y_m",
    "base_curvature_per_m",
    "base_curvature_y_per_m",
)
"""The numbers of a message about the source, besides its timestamp; null without a sensor."""


def text_of(numbers: Iterable[float], form: str) -> str:
    """Numbers as the inside of a JSON array."""
    values = tuple(numbers)
    if math.isfinite(sum(values)):
        return ",".join([form] * len(values)) % values
    return ",".join(form % v if math.isfinite(v) else "null" for v in values)


def epoch() -> float:
    """Zero of this machine's monotonic clock in s since 1970, by its present wall clock."""
    best = math.inf, 0.0
    for _ in range(3):  # of which the system interrupts one at most
        before, now, after = time.monotonic(), time.time(), time.monotonic()
        best = min(best, (after - before, now - (before + after) / 2))
    return best[1]


def template(fields: Iterable[Number]) -> str:
    """The numbers as the inside of a JSON object, each to be filled in."""
    return ",".join(f'"{field.key}":{field.form}' for field in fields)


_WHOLE, _HEAD_WHOLE, _SECOND = template(CONTACT), template(_HEAD), template(SECOND)


def numbers_text(values: list[float], numbers: tuple[Number, ...], whole: str) -> str:
    """The values of `numbers` with their keys; `whole` is the `template` of these."""
    # A sum is finite only if every number is, and takes a third of the time.
    if math.isfinite(sum(values)):
        return whole % tuple(values)
    return ",".join(
        f'"{field.key}":{field.form % value if math.isfinite(value) else "null"}'
        for field, value in zip(numbers, values, strict=True)
    )


def _yes(value: float) -> str:
    return "true" if value else "false"


@dataclass(frozen=True)
class MessageHeader:
    """What the sender adds to a message about an estimate.

    `source` is where the readings come from, live, sim or replay; `epoch` in s since 1970 when this
    machine's monotonic clock began; `number` counts messages. The coefficients go with it if it is
    `with_shape`. Of a hand it names the `finger`.
    """

    source: str
    epoch: float
    number: int
    with_shape: bool
    finger: str = ""

    def begin(self, kind: str) -> str:
        """The beginning of a message of a `kind`."""
        finger = f'"finger":"{self.finger}",' if self.finger else ""
        return f'"kind":"{kind}","version":{VERSION},{finger}'


class EstimateMessage:
    """The messages of one frame, encoded once for all transports, when the first one needs them.

    The `pipeline` made the `estimate` just now, from this `fit`.
    """

    def __init__(
        self, estimate: Estimate, fit: Fit, pipeline: Pipeline, mark: MessageHeader
    ) -> None:
        self.estimate, self.fit, self.pipeline, self.mark = estimate, fit, pipeline, mark
        self._reported = Reported(estimate, fit)
        known = math.isfinite(estimate.taken)
        self._began = estimate.taken if known else estimate.host_time
        self.timestamp = mark.epoch + self._began
        """When the scan began, or was read, in s since 1970."""

    def _head(self) -> tuple[float, int, int, int]:
        estimate = self.estimate
        return self.timestamp, self.mark.number, estimate.sequence, estimate.generation

    @cached_property
    def values(self) -> list[float]:
        """The numbers of `CONTACT`; NaN where they are not known."""
        reported, present = self._reported, self.estimate.contact.present
        return [
            *self._head(),
            *_frame_numbers(reported),
            time.monotonic() - self._began,
            *_fit_numbers(reported),
            *(_contact_numbers(reported) if present else _NOTHING),
        ]

    @property
    def shape_follows(self) -> bool:
        """Whether there are coefficients to go with it, and they fit into one datagram."""
        return self.mark.with_shape and self.estimate.coefficients.size <= MOST_FUNCTIONS

    @cached_property
    def contact(self) -> bytes:
        """The message about the contact, as JSON."""
        flags = [_yes(flag) for flag in _flags(self._reported)]
        text = (
            f'{{{self.mark.begin("contact")}"source":"{self.mark.source}",'
            f"{_FLAGS_TEXT % (*flags, _yes(self.shape_follows))},"
            f"{numbers_text(self.values, CONTACT, _WHOLE)},"
            f'"second":{self._second}}}'
        )
        return text.encode()

    @property
    def _second(self) -> str:
        """The second contact as JSON."""
        if not self.estimate.second.present:
            return "null"
        return f"{{{_SECOND % tuple(_second_numbers(self._reported))}}}"

    @cached_property
    def shape(self) -> bytes:
        """The message about the surface: its coefficients with their error bars, as JSON."""
        fit, pipeline = self.fit, self.pipeline
        edge = pipeline.setup.edge or pipeline.sensor.edge
        Ni, Nj = self.estimate.coefficients.shape
        text = (
            f"{{{self.mark.begin('shape')}{_HEAD_WHOLE % self._head()},"
            f'"edge":"{edge}","functions_x":{Ni},"functions_y":{Nj},'
            f'"coefficients_m":[{text_of(fit.coefficients.ravel().tolist(), "%.6g")}],'
            f'"coefficients_sd_m":[{text_of(fit.sd.ravel().tolist(), "%.3g")}]}}'
        )
        return text.encode()


@dataclass(frozen=True)
class SourceState:
    """How the source is doing, and the `events` since that was last reported.

    `source` is live, sim or replay, empty while there is no sensor; `last_frame` in s on the
    monotonic clock, `rate` in frames/s; `finger` is empty where there is one without a name.
    """

    state: str
    source: str
    message: str
    sensor: Sensor | None
    rate: float
    last_frame: float
    events: tuple[Event, ...] = ()
    finger: str = ""

    def encoded(self) -> bytes:
        """The message about the source, as JSON."""
        age, sensor = time.monotonic() - self.last_frame, self.sensor
        patch = None if sensor is None else sensor.layout.patch
        numbers = (
            round(self.rate, 1),
            round(age, 6) if math.isfinite(age) else None,
            *((patch.a, patch.b, *patch.curvatures) if patch else (None,) * 4),
        )
        fields = {
            "kind": "status",
            "version": VERSION,
            **({"finger": self.finger} if self.finger else {}),
            "timestamp": round(time.time(), 6),
            "state": self.state,
            "source": self.source,
            "message": printable(self.message)[:_LONGEST],
            "sensor": printable(sensor.name)[:_LONGEST] if sensor else "",
            **dict(zip(STATUS_NUMBERS, numbers, strict=True)),
        }
        return json.dumps(fields, allow_nan=False).encode()
