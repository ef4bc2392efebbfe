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

from kappaskin.estimation import Fit
from kappaskin.frames import Estimate, Event
from kappaskin.pipeline import Pipeline
from kappaskin.sensing import Sensor

UNKNOWN = math.pi / math.sqrt(12)
"""In rad, the spread of a line that may point anywhere: an error bar of a direction at most."""

VALUES = (
    ("x_m", "%.7g", "where the contact is, along the skin"),
    ("y_m", "%.7g", "where the contact is, across the skin"),
    ("x_sd_m", "%.3g", "standard deviation of x_m"),
    ("y_sd_m", "%.3g", "standard deviation of y_m"),
    ("force_N", "%.6g", "of the contact, above zero where it presses"),
    ("force_sd_N", "%.3g", "standard deviation of force_N"),
    ("displacement_m", "%.6g", "of the skin at the contact, above zero inward"),
    ("displacement_sd_m", "%.3g", "standard deviation of displacement_m"),
    ("position_x_m", "%.7g", "the contact's place in space, on the deflected skin"),
    ("position_y_m", "%.7g", "see position_x_m"),
    ("position_z_m", "%.7g", "see position_x_m; z is 0 at the top of the skin at rest"),
    ("position_x_sd_m", "%.3g", "standard deviation of position_x_m"),
    ("position_y_sd_m", "%.3g", "standard deviation of position_y_m"),
    ("position_z_sd_m", "%.3g", "standard deviation of position_z_m"),
    ("normal_x", "%.6f", "outward unit normal of the deflected skin at the contact"),
    ("normal_y", "%.6f", "see normal_x"),
    ("normal_z", "%.6f", "see normal_x"),
    ("normal_sd_rad", "%.3g", "standard deviation of the normal's tilt"),
    ("curvature_1_per_m", "%.6g", "larger principal curvature of the skin at the contact"),
    ("curvature_1_sd_per_m", "%.3g", "standard deviation of curvature_1_per_m"),
    ("curvature_2_per_m", "%.6g", "smaller principal curvature"),
    ("curvature_2_sd_per_m", "%.3g", "standard deviation of curvature_2_per_m"),
    ("direction_1_x", "%.6f", "unit vector along the larger principal curvature"),
    ("direction_1_y", "%.6f", "see direction_1_x"),
    ("direction_1_z", "%.6f", "see direction_1_x"),
    ("direction_2_x", "%.6f", "unit vector along the smaller principal curvature"),
    ("direction_2_y", "%.6f", "see direction_2_x"),
    ("direction_2_z", "%.6f", "see direction_2_x"),
    ("direction_sd_rad", "%.3g", "standard deviation of both about the normal; at most 0.907"),
)
"""Key, how it is written, and what it says, of each number of a contact."""

_NOTHING = [math.nan] * len(VALUES)


def contact_values(estimate: Estimate, fit: Fit) -> list[float]:
    """The numbers of `VALUES`, NaN when there is no contact; `fit` is what they rest on."""
    touch = estimate.touch
    if not touch.present:
        return _NOTHING
    return [
        *touch.position.tolist(),
        *touch.position_sd.tolist(),
        touch.force,
        touch.force_sd,
        touch.displacement,
        touch.displacement_sd,
        *_in_space(estimate, fit),
        *_principal(estimate),
    ]


def _in_space(estimate: Estimate, fit: Fit) -> list[float]:
    """Position (3) and its error bars (3) in m, normal (3), and in rad how far it may be tilted.

    To first order, from what the readings' noise makes of the displacement f and its slopes there,
    and of the place x, y itself, as if these were independent:
        dr = r_x dx + r_y dy - n0 df,    |dn| = |d(f_x, f_y) + K [metric] (dx, dy)|,
    where [r_x r_y] = [t e] [metric] and n0 is the normal of the skin at rest.
    """
    geometry, patch = estimate.geometry, fit.estimator.basis.patch
    x, y = estimate.touch.position.tolist()
    x_sd, y_sd = estimate.touch.position_sd.tolist()
    f_sd, *slopes_sd = fit.sd_of(fit.estimator.basis.jet(x, y)[:3]).tolist()
    t, e, normal = geometry.frame.tolist()
    (L, m), (_, k) = geometry.metric.tolist()
    (xx, xy), (_, yy) = geometry.curvature_form.tolist()
    angle = (x - patch.a / 2) * patch.base_curvature
    n0 = math.sin(angle), 0.0, math.cos(angle)
    spread = [
        math.hypot(L * t[i] * x_sd, (m * t[i] + k * e[i]) * y_sd, n0[i] * f_sd) for i in range(3)
    ]
    tilt = L * xx * x_sd, L * xy * x_sd, (m * xx + k * xy) * y_sd, (m * xy + k * yy) * y_sd
    return [
        *geometry.position.tolist(),
        *spread,
        *normal,
        math.hypot(*slopes_sd, *tilt),
    ]


def _principal(estimate: Estimate) -> list[float]:
    """Both principal curvatures, each with its error bar; both directions, and theirs in rad.

    As `LocalGeometry` tells them, written out in numbers: this is done for every frame.
    """
    geometry = estimate.geometry
    (xx, xy), (_, yy) = geometry.curvature_form.tolist()
    C = geometry.covariance.tolist()
    (ax, ay, az), (bx, by, bz), _ = geometry.frame.tolist()
    d, mean = (xx - yy) / 2, (xx + yy) / 2
    h, angle = math.hypot(d, xy), math.atan2(xy, d) / 2
    c, s = math.cos(angle), math.sin(angle)
    turn = _root(C, -xy, xy, 2 * d)
    return [
        mean + h,
        _root(C, c * c, s * s, 2 * c * s),
        mean - h,
        _root(C, s * s, c * c, -2 * c * s),
        *(c * ax + s * bx, c * ay + s * by, c * az + s * bz),
        *(c * bx - s * ax, c * by - s * ay, c * bz - s * az),
        min(UNKNOWN, turn / (4 * h * h)) if h else UNKNOWN,
    ]


def _root(C: list[list[float]], xx: float, yy: float, xy: float) -> float:
    """Standard deviation of what changes with xx, yy and xy so much, by their covariance."""
    (a, b, c), (_, d, e), (_, _, f) = C
    diagonal = a * xx * xx + d * yy * yy + f * xy * xy
    return math.sqrt(max(0.0, diagonal + 2 * (b * xx * yy + c * xx * xy + e * yy * xy)))


VERSION = 1
"""Of the format: another one where a key of this one says something else."""

LARGEST = 2000
"""Bytes of a datagram at most: PlotJuggler reads 2048, and what is longer is cut off."""

MOST_FUNCTIONS = 80
"""So many coefficients with their error bars are sure to fit into a datagram."""

_LONGEST = 300  # characters of a text


@dataclass(frozen=True)
class MessageNumber:
    """A number of a message: its key, which ends in its unit, how it is written, what it says."""

    key: str
    form: str
    words: str


_HEAD = (
    MessageNumber(
        "timestamp",
        "%.6f",
        "when the scan began, or where nothing tells that, when it was read; s since 1970 by the "
        "sender's clock",
    ),
    MessageNumber(
        "number", "%d", "counts the messages about contacts; a gap was lost on the network"
    ),
    MessageNumber(
        "sequence", "%d", "of the scan, as the device counts; a gap was lost or not computed"
    ),
    MessageNumber("generation", "%d", "of the settings that it was computed with"),
)

CONTACT = (
    *_HEAD,
    MessageNumber("device_time_s", "%.6f", "when the scan began on the device's clock"),
    MessageNumber(
        "taken_sd_s", "%.3g", "standard deviation of timestamp; null where nothing tells"
    ),
    MessageNumber("age_s", "%.6f", "from timestamp until this was sent"),
    MessageNumber("noise_per_m", "%.3g", "standard deviation of one reading"),
    *(MessageNumber(*row) for row in VALUES),
)
"""The numbers of a message about the contact, in order."""

SWITCHES = {
    "present": "whether the readings hold a contact; without one its numbers are null",
    "single": "whether one point load explains the readings as well as the shape does",
    "near_rim": "whether it is too near a held edge for its place and force to be trusted",
    "shape_follows": "whether a message of kind shape follows in a datagram of its own",
}
"""What a message about the contact says with true or false."""


STATUS_NUMBERS = (
    "rate_per_s",
    "since_last_frame_s",
    "width_x_m",
    "width_y_m",
    "base_curvature_per_m",
)
"""The numbers of a message about the source, besides its timestamp; null without a sensor."""


def text_of(numbers: Iterable[float], form: str) -> str:
    """Numbers as the inside of a JSON array."""
    values = tuple(numbers)
    if all(map(math.isfinite, values)):
        return ",".join([form] * len(values)) % values
    return ",".join(form % v if math.isfinite(v) else "null" for v in values)


def epoch() -> float:
    """When this machine's monotonic clock began, in s since 1970, as its other clock tells now."""
    best = math.inf, 0.0
    for _ in range(3):  # of which the system interrupts one at most
        before, now, after = time.monotonic(), time.time(), time.monotonic()
        best = min(best, (after - before, now - (before + after) / 2))
    return best[1]


def _template(fields: Iterable[MessageNumber]) -> str:
    return ",".join(f'"{field.key}":{field.form}' for field in fields)


_WHOLE, _HEAD_WHOLE = _template(CONTACT), _template(_HEAD)


def _numbers(values: list[float]) -> str:
    """Every number of `CONTACT` with its key."""
    if all(map(math.isfinite, values)):
        return _WHOLE % tuple(values)
    return ",".join(
        f'"{field.key}":{field.form % value if math.isfinite(value) else "null"}'
        for field, value in zip(CONTACT, values, strict=True)
    )


def _yes(value: bool) -> str:
    return "true" if value else "false"


@dataclass(frozen=True)
class MessageHeader:
    """What a message has from who sends it, besides the estimate.

    `source` is where the readings come from, live, sim or replay; `epoch` in s since 1970 when this
    machine's monotonic clock began; `number` counts messages. The coefficients go with it if it is
    `with_shape`.
    """

    source: str
    epoch: float
    number: int
    with_shape: bool


class EstimateMessage:
    """What one frame has to say, encoded once for all who send it, when the first one asks.

    The `pipeline` made the `estimate` just now, from this `fit`.
    """

    def __init__(
        self, estimate: Estimate, fit: Fit, pipeline: Pipeline, mark: MessageHeader
    ) -> None:
        self.estimate, self.fit, self.pipeline, self.mark = estimate, fit, pipeline, mark
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
        estimate = self.estimate
        return [
            *self._head(),
            estimate.device_time,
            estimate.taken_sd if math.isfinite(estimate.taken) else math.nan,
            time.monotonic() - self._began,
            estimate.noise,
            *contact_values(estimate, self.fit),
        ]

    @property
    def shape_follows(self) -> bool:
        """Whether there are coefficients to go with it, and they fit into one datagram."""
        return self.mark.with_shape and self.estimate.coefficients.size <= MOST_FUNCTIONS

    @cached_property
    def contact(self) -> bytes:
        """The message about the contact, as JSON."""
        touch = self.estimate.touch
        text = (
            f'{{"kind":"contact","version":{VERSION},"source":"{self.mark.source}",'
            f'"present":{_yes(touch.present)},"single":{_yes(touch.single)},'
            f'"near_rim":{_yes(touch.near_rim)},"shape_follows":{_yes(self.shape_follows)},'
            f"{_numbers(self.values)}}}"
        )
        return text.encode()

    @cached_property
    def shape(self) -> bytes:
        """The message about the surface: its coefficients with their error bars, as JSON."""
        fit, pipeline = self.fit, self.pipeline
        edge = pipeline.setup.edge or pipeline.sensor.edge
        Ni, Nj = self.estimate.coefficients.shape
        text = (
            f'{{"kind":"shape","version":{VERSION},{_HEAD_WHOLE % self._head()},'
            f'"edge":"{edge}","functions_x":{Ni},"functions_y":{Nj},'
            f'"coefficients_m":[{text_of(fit.coefficients.ravel().tolist(), "%.6g")}],'
            f'"coefficients_sd_m":[{text_of(fit.sd.ravel().tolist(), "%.3g")}]}}'
        )
        return text.encode()


@dataclass(frozen=True)
class SourceState:
    """How the source is doing, and the `events` since that was last told.

    `source` is live, sim or replay, empty while there is no sensor; `last_frame` in s on the
    monotonic clock, `rate` in frames/s.
    """

    state: str
    source: str
    message: str
    sensor: Sensor | None
    rate: float
    last_frame: float
    events: tuple[Event, ...] = ()

    def encoded(self) -> bytes:
        """The message about the source, as JSON."""
        age, sensor = time.monotonic() - self.last_frame, self.sensor
        patch = None if sensor is None else sensor.layout.patch
        numbers = (
            round(self.rate, 1),
            round(age, 6) if math.isfinite(age) else None,
            *((patch.a, patch.b, patch.base_curvature) if patch else (None, None, None)),
        )
        told = {
            "kind": "status",
            "version": VERSION,
            "timestamp": round(time.time(), 6),
            "state": self.state,
            "source": self.source,
            "message": self.message[:_LONGEST],
            "sensor": sensor.name[:_LONGEST] if sensor else "",
            **dict(zip(STATUS_NUMBERS, numbers, strict=True)),
        }
        return json.dumps(told, allow_nan=False).encode()
