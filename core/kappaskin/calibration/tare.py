"""Tare: the reading of a skin at rest, taken as its zero, and the drift since then.

A tare is refused while the skin moves or is loaded. `LoadDetector` documents the smallest load:
against the previous tare, or a calibration, a load need only exceed the drift since then. Where
neither is known, it must exceed the offsets of the elements: a smaller one is taken for offsets.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property
from typing import Any

import numpy as np

from kappaskin.calibration.calibration import FARTHEST, digest, fingerprint
from kappaskin.contact import LoadDetector
from kappaskin.errors import Refusal
from kappaskin.frames import OVERTAKEN, Array
from kappaskin.sensing import Sensor

_MOST_CHANNELS = 2**16  # whose numbers the engine can send with every status

_PLAIN = ("name", "serial_number", "layout", "date", "temperature", "frames", "seconds")

SECONDS = 1.0
"""Averaging time of a tare in s, by the device's clock."""

_PATIENCE = 5.0  # s after which a tare is given up
_FEWEST = 20  # frames
_MOST = 500  # frames, kept evenly: more add nothing
_MOST_NUMBERS = 2**23
_ROUNDING = 0.999  # of the time between two that are kept
_PARTS = 8  # of the time, that are compared with each other
_OFTEN = 0.9  # of the frames that a channel must be in
_BLIND = 0.1  # of the channels that may read nothing
_STIR = 2.0  # times the noise of a frame, by which no part may be off
_TAU = 2.0  # s over which a drift is averaged
_EVERY = 0.02  # s between two frames that count
_CHECK = 0.5  # s between two checks for a load


@dataclass(frozen=True, eq=False)
class Tare:
    """What each of C channels of one device read at rest: `offset` (C,) in their units (Eq. 8).

    It is an offset of the reading, before gain, creep and loops are undone, because what wanders is
    the bridge and the amplifier: the same shift of the voltage whatever the skin does. Loops are
    then entered where they were when they were calibrated; a shift taken off behind them would be
    one that depends on how far the skin is bent. In a calibrated skin it stands in for the
    calibration's own offset, and what the loops still hold of earlier bends is not in it.

    `offset_sd` (C,) are standard errors; both are NaN where a channel read nothing. `layout` is the
    `fingerprint` of the skin, `temperature` in degrees Celsius or None. It was taken at `date` from
    `frames` frames over `seconds`. Tares of the same content are equal.
    """

    name: str
    serial_number: str
    layout: str
    date: datetime
    temperature: float | None
    frames: int
    seconds: float
    offset: Array
    offset_sd: Array

    def __post_init__(self) -> None:
        if self.date.utcoffset() is None:
            raise Refusal(f"expected a date with its time zone, got {self.date}")
        shape = self.offset.shape
        if len(shape) != 1 or self.offset_sd.shape != shape or not 0 < len(self) <= _MOST_CHANNELS:
            raise Refusal(
                f"expected an offset and its error for each of 1 to {_MOST_CHANNELS} channels, got "
                f"shapes {shape} and {self.offset_sd.shape}"
            )
        known = np.isfinite(self.offset)
        far = (np.abs(self.offset) > FARTHEST).any()
        if far or not (self.offset_sd[known] >= 0).all() or not known.any():
            raise Refusal(
                f"expected finite offsets of at most {FARTHEST:g} 1/m with errors of at least 0, "
                "or NaN"
            )
        if not (self.frames > 0 and 0 <= self.seconds < np.inf):
            raise Refusal(f"expected a tare of frames, got {self.frames} over {self.seconds} s")
        if self.temperature is not None and not np.isfinite(self.temperature):
            raise Refusal(f"expected a temperature or none, got {self.temperature}")

    def __len__(self) -> int:
        return len(self.offset)

    @property
    def content(self) -> dict[str, Any]:
        """Everything in it, by key, as text, dates, numbers and lists of numbers."""
        content: dict[str, Any] = {key: getattr(self, key) for key in _PLAIN}
        if self.temperature is None:
            del content["temperature"]
        return content | {key: getattr(self, key).tolist() for key in ("offset", "offset_sd")}

    @cached_property
    def digest(self) -> str:
        return digest({"tare": self.content})

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Tare) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def check(self, sensor: Sensor) -> None:
        """Refuse a sensor that is not the one that was tared."""
        if sensor.serial_number != self.serial_number:
            raise Refusal(
                f"this tare belongs to {self.name} {self.serial_number}, not to {sensor.name} "
                f"{sensor.serial_number}; tare this sensor"
            )
        if (fingerprint(sensor.layout), sensor.channels) != (self.layout, len(self)):
            raise Refusal(
                f"{sensor.name} {sensor.serial_number} has {sensor.layout} at other positions than "
                "when it was tared; tare it again"
            )


@dataclass(frozen=True, eq=False)
class Rest:
    """The expected readings of a skin at rest: `zero` (C,) in 1/m, by the `tare` if there is one.

    Hysteresis and creep add `remanence` (C,) for a while.
    """

    zero: Array
    remanence: Array
    tare: Tare | None


class TareMeasurement:
    """Collects frames from `begun` on, in s on the host's clock, until they suffice for a tare."""

    def __init__(self, sensor: Sensor, begun: float) -> None:
        self.sensor, self._begun = sensor, begun
        self._most = max(_FEWEST, min(_MOST, _MOST_NUMBERS // sensor.channels))
        self._times: list[float] = []
        self._readings: list[Array] = []

    def take(self, device_time: float, host_time: float, nominal: Array) -> None:
        """Take the readings of a frame, `nominal` (3, P) in 1/m, unless it is too early.

        Refused when the device's clock went back.
        """
        if host_time < self._begun:
            return
        if self._times:
            after = device_time - self._times[-1]
            if after < -OVERTAKEN:
                raise Refusal("the device's clock went back: it restarted; tare again")
            if after < _ROUNDING * SECONDS / self._most:
                return
        self._times.append(device_time)
        self._readings.append(nominal.ravel())

    def done(self, now: float) -> bool:
        """Whether there are enough frames, or it took too long."""
        span = self._times[-1] - self._times[0] if self._times else 0.0
        enough = span >= SECONDS and len(self._times) >= _FEWEST
        return enough or now > self._begun + _PATIENCE

    def tare(self, seeker: LoadDetector, rest: Rest, date: datetime, temperature: float) -> Tare:
        """The tare, or a `Refusal` that says why there is none; temperature NaN if not known."""
        n = len(self._times)
        if n < _FEWEST:
            raise Refusal(
                f"expected at least {_FEWEST} frames within {_PATIENCE:g} s, got {n}; make "
                "sure that the device is sending, then tare again"
            )
        readings = _known(self.sensor, np.array(self._readings))
        found = _still(self.sensor, seeker, readings)
        _check_unloaded(self.sensor, seeker, found, rest)
        known = math.isfinite(temperature)
        return Tare(
            self.sensor.name,
            self.sensor.serial_number,
            fingerprint(self.sensor.layout),
            date,
            round(temperature, 2) if known else None,
            n,
            round(self._times[-1] - self._times[0], 6),
            found.mean - rest.remanence,
            found.error,
        )


def _known(sensor: Sensor, readings: Array) -> Array:
    """The readings (n, C), all NaN where a channel was seldom read; refused if too many were."""
    live = sensor.layout.live.ravel()
    blind = np.isfinite(readings).mean(axis=0) < _OFTEN
    if np.count_nonzero(blind & live) > _BLIND * np.count_nonzero(live):
        raise Refusal(
            f"{np.count_nonzero(blind & live)} of {np.count_nonzero(live)} channels read nothing, "
            f"expected at most {100 * _BLIND:.0f} %: they are saturated, or not scanned; lift what "
            "touches the skin, scan all elements, or lower the amplifier's gain"
        )
    return np.where(blind | ~live, np.nan, readings)


@dataclass(frozen=True, eq=False)
class _Found:
    """Mean (C,) and its standard error; `noise` of one frame in units of `LoadDetector.sigma`."""

    mean: Array
    error: Array
    noise: float


def _still(sensor: Sensor, seeker: LoadDetector, readings: Array) -> _Found:
    """The mean of `readings` (n, C), refused if they move by more than noise."""
    readings = readings / seeker.sigma
    used = ~np.isnan(readings).all(axis=0)
    # A channel may be missing in a frame or two: its mean stands for it.
    mean = np.full(readings.shape[1], np.nan)
    mean[used] = np.nanmean(readings[:, used], axis=0)
    filled = np.where(np.isnan(readings), mean, readings)
    # From one frame to the next, so that a slow motion does not count as noise.
    noise = math.sqrt(float(np.mean(np.diff(filled[:, used], axis=0) ** 2)) / 2)
    parts = _parts(filled, _PARTS) - mean
    for off in (parts, _parts(filled, 2) - mean):
        _check_still(sensor, seeker, off, noise, len(readings) / len(off))
    error = parts.std(axis=0, ddof=1) / math.sqrt(_PARTS)
    return _Found(seeker.sigma * mean, seeker.sigma * error, noise)


def _parts(readings: Array, count: int) -> Array:
    """The means (count, C) over so many parts of the time."""
    return np.array([part.mean(axis=0) for part in np.array_split(readings, count)])


def _check_still(
    sensor: Sensor, seeker: LoadDetector, off: Array, noise: float, frames: float
) -> None:
    """Refuse when a part of the time, of so many `frames`, is too far `off` (n, C) the mean.

    In units of `LoadDetector.sigma`.
    """
    squares = np.nanmean(off**2, axis=1)
    part = off[int(squares.argmax())]
    by_noise = noise / math.sqrt(frames)
    allowed = _STIR * noise + float((sensor.transduction.resolution / seeker.sigma).max())
    # Offsets of elements are constant: what changes is noise, or a load.
    load = seeker(seeker.sigma * part, by_noise**2, share=0.0)
    if squares.max() > allowed**2 or load is not None:
        channel = int(np.nanargmax(np.abs(part)))
        layout, one = sensor.layout, float(seeker.sigma[channel])
        unit = layout.kind_units[int(layout.kind[channel])]
        raise Refusal(
            f"the readings move: {_named(sensor, channel)} was off its mean by "
            f"{one * abs(part[channel]):.2g} {unit} for {SECONDS / len(off):.2g} s, where noise "
            f"causes {one * by_noise:.2g}; let the skin come to rest, then tare again"
        )


def _named(sensor: Sensor, channel: int) -> str:
    layout = sensor.layout
    x, y = 1e3 * layout.positions[layout.element[channel]]
    return f"{layout.reading_name(channel)} at ({x:.0f}, {y:.0f}) mm"


def _check_unloaded(sensor: Sensor, seeker: LoadDetector, found: _Found, rest: Rest) -> None:
    load = seeker(found.mean - rest.zero - rest.remanence, found.noise**2)
    if load is None:
        return
    x, y = 1e3 * load.position
    simulated = "play a scene without a load, or set its force to 0"
    then = f"{simulated if sensor.simulated else 'lift what touches the skin'}, then tare again"
    if rest.tare is not None:
        then += (
            "; if nothing touches it, it was bent or mounted again since the tare of "
            f"{rest.tare.date:%Y-%m-%d %H:%M}: undo that tare first"
        )
    raise Refusal(
        f"the skin is loaded: {load.force:.3g} N at ({x:.0f}, {y:.0f}) mm; this contact explains "
        f"{100 * load.share:.0f} % of the signal; {then}"
    )


@dataclass(frozen=True)
class Drift:
    """The drift of the tared readings of an unloaded skin.

    `curvature`, the RMS over the channels in the unit of the readings, or in their given noise
    where they differ in unit; `displacement` in m, the farthest that the estimated surface has
    moved; `device_time` in s when. `loaded` says that the skin is now: the
    drift is the last from before. It is shown, never subtracted.
    """

    curvature: float = math.nan
    displacement: float = math.nan
    device_time: float = math.nan
    loaded: bool = False


class DriftMonitor:
    """Averages the readings of a tared skin, and gives their drift while nothing presses.

    `surface` is the map from coefficients (Ni, Nj) to displacements (ny, nx) in m.
    """

    def __init__(self, seeker: LoadDetector, surface: Callable[[Array], Array]) -> None:
        self._seeker, self._surface = seeker, surface
        self._drift = Drift()
        self._next: Drift | None = None
        self._loaded, self._checked, self._frames = False, -math.inf, 0
        self._begin(math.nan, np.empty(0), np.empty(0), math.nan)

    def _begin(self, time: float, curvature: Array, shape: Array, noise: float) -> None:
        self._begun = self._time = time
        self._mean, self._shape = curvature.copy(), np.nan_to_num(shape)
        self._noise, self._variance = noise, noise**2
        self._frames = 1

    def follow(self, device_time: float, curvature: Array, shape: Array, noise: float) -> None:
        """Take the readings (3, P) in 1/m of a frame, their `noise`, and coefficients (Ni, Nj)."""
        elapsed = device_time - self._time
        if -OVERTAKEN <= elapsed < _EVERY or not math.isfinite(noise):  # too soon, or overtaken
            return
        if not (self._frames and 0 <= elapsed < _TAU):
            # A first frame, one after a gap, or a clock that went back.
            self._begin(device_time, curvature, shape, noise)
            return
        self._time, self._noise, self._frames = device_time, noise, self._frames + 1
        a = max(elapsed / _TAU, 1 / self._frames)
        np.copyto(self._mean, curvature, where=np.isnan(self._mean))
        self._mean += a * np.nan_to_num(curvature - self._mean)
        self._shape += a * (np.nan_to_num(shape) - self._shape)
        self._variance = (1 - a) ** 2 * self._variance + (a * noise) ** 2

    def current(self) -> Drift:
        """The drift, as far as it is known."""
        if not (self._frames and self._time - max(self._begun + _TAU, self._checked + _CHECK) >= 0):
            return self._drift
        self._checked = self._time
        mean = self._mean.ravel()
        weighted = mean / self._seeker.sigma
        # As a frame shows it: a fainter trace of a load than one would see is drift, too.
        loaded = self._seeker(mean, self._noise**2) is not None
        if loaded or self._loaded:
            # The average just after a load holds some of it still, as does the one before it shows.
            self._loaded, self._next, self._frames = loaded, None, 0
            self._drift = replace(self._drift, loaded=True)
            return self._drift
        self._drift = self._next or self._drift
        square = float(np.nanmean(weighted**2)) - self._variance
        farthest = float(np.nanmax(np.abs(self._surface(self._shape))))
        self._next = Drift(math.sqrt(max(square, 0.0)), farthest, self._time)
        return self._drift
