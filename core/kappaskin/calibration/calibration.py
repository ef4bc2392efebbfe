"""Calibration of one device: gains, offsets, hysteresis and creep."""

import copy
import hashlib
import json
import math
import os
import tomllib
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np

from kappaskin._files import open_file, write_whole
from kappaskin._state import Stateful
from kappaskin._text import ONE_SIGMA, with_error
from kappaskin._toml import table
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics import Plate
from kappaskin.sensing import PrandtlIshlinskii, Sensor, SensorLayout, StandardLinearSolid

_MOST_CHANNELS = 2**14  # whose numbers the engine can send with every status
_STEEPEST = 1e9  # gain, 1 being nominal
FARTHEST = 1e12  # 1/m, of an offset: a thousand times what any electronics read
_STEPS = 200  # towards the reading of a straight skin; a quarter of the rest or more goes in each
_REST = 1e-6  # 1/m, as near as it need be

GRAVITY = 9.80665
"""Newtons per kilogram (standard gravity)."""

LIMIT = 0.05
"""Share of a weight by which it may be told wrong by a fit to the others."""

FEWEST_WEIGHTS = 3

FORMAT = 1
OLDEST = timedelta(days=180)
"""Age beyond which a calibration is not trusted: the adhesive keeps changing."""

_AHEAD = timedelta(days=1)  # that the clock of the machine that calibrated may have been ahead
_LARGEST = 2**26  # bytes
_LINE = ("gain", "offset", "gain_sd", "offset_sd")
_KEYS = {
    "device": {"name", "serial_number", "firmware", "layout", "date"},
    "line": set(_LINE),
    "hysteresis": {"thresholds", "weights", "linear", "stretch"},
    "creep": {"share", "time_constant"},
    "unseen": {"error"},
    "weights": {
        *("rigidity", "rigidity_sd", "thickness", "rim_stiffness", "deepest"),
        *("weights", "told", "left_out"),
    },
}

_OPTIONAL = {"hysteresis", "creep", "unseen", "weights"}
_AGAIN = "calibrate again, or restore the file from a copy"


def fingerprint(layout: SensorLayout) -> str:
    """A hash of the skin's sides and of where its elements are, to a nanometre.

    Not of its radius: a skin is calibrated flat, and then mounted (paper, section 5). Of a sensor
    that reads other than xx, yy and xy, of what it reads too.
    """
    sides = (layout.patch.a, layout.patch.b)
    where = np.rint(np.array([sides, *layout.positions]) * 1e9).astype("<i8")
    found = hashlib.sha256(where.tobytes())
    if layout.reads:
        each = zip(layout.element.tolist(), layout.kind.tolist(), strict=True)
        found.update(repr((layout.directed[0], *each)).encode())
    return found.hexdigest()


@dataclass(frozen=True)
class KnownWeights:
    """What known weights say of a skin, and how well.

    `rigidity` D and its standard error in N m; `thickness` in m by which the skin stretches, 0
    where no stiffening was seen; `rim_stiffness` in N/m^2 of an elastic edge, 0 of any other.
    `weights` (n,) in N were laid on, `told` (n,) is what the fit makes of their readings, and
    `left_out` (n,) by how much of itself each is told wrong by the fit to the others. No
    displacement was beyond `deepest` in m.
    """

    rigidity: float
    rigidity_sd: float
    thickness: float
    rim_stiffness: float
    weights: tuple[float, ...]
    told: tuple[float, ...]
    left_out: tuple[float, ...]
    deepest: float

    def __post_init__(self) -> None:
        numbers = (self.rigidity, self.rigidity_sd, self.thickness, self.rim_stiffness)
        if not (all(map(math.isfinite, numbers)) and self.rigidity > 0 and min(numbers) >= 0):
            raise Refusal(f"expected a rigidity above zero and finite numbers, got {numbers}")
        if not len(self.weights) == len(self.told) == len(self.left_out) >= FEWEST_WEIGHTS:
            raise Refusal(f"expected at least {FEWEST_WEIGHTS} weights, got {len(self.weights)}")

    @property
    def passed(self) -> bool:
        """Whether each weight is told by the others within `LIMIT`."""
        return max(map(abs, self.left_out)) <= LIMIT

    def plate(self, plate: Plate) -> Plate:
        """The skin as the weights found it: all that resists, by the same share stiffer."""
        ratio = self.rigidity / plate.rigidity
        return replace(
            plate,
            rigidity=self.rigidity,
            tension=ratio * plate.tension,
            foundation=ratio * plate.foundation,
            axial_stiffness=plate.axial_stiffness and ratio * plate.axial_stiffness,
            rim_stiffness=self.rim_stiffness or ratio * plate.rim_stiffness,
            thickness=self.thickness or plate.thickness,
            unknown_material=False,
        )

    def lines(self) -> list[str]:
        """A summary and a line for each weight."""
        worst = max(range(len(self.weights)), key=lambda n: abs(self.left_out[n]))
        verdict = (
            f"passed: the fit to the others estimates every weight within {100 * LIMIT:g} %"
            if self.passed
            else f"failed: the fit to the others estimates weight {worst + 1} with an error of "
            f"{100 * self.left_out[worst]:+.1f} %, more than {100 * LIMIT:g} %; check its mass, or "
            "take a lighter one"
        )
        stiff = (
            f"it stretches as a sheet of {1e3 * self.thickness:.3g} mm"
            if self.thickness
            else f"no stiffening down to {1e3 * self.deepest:.2g} mm"
        )
        if self.rim_stiffness:
            stiff = f"its edge gives: {self.rim_stiffness:.3g} N/m^2"
        rigidity = with_error(self.rigidity, self.rigidity_sd, "N m")
        head = f"rigidity {rigidity} ({ONE_SIGMA}); {stiff}"
        each = zip(self.weights, self.told, self.left_out, strict=True)
        return [
            head,
            *(
                f"  weight {n}  {1e3 * laid / GRAVITY:8.2f} g  {laid:.4f} N  "
                f"estimated {told:.4f} N ({100 * (told / laid - 1):+.2f} %), "
                f"by the others {100 * left:+.2f} %"
                for n, (laid, told, left) in enumerate(each, 1)
            ),
            verdict,
        ]

    def to_json(self) -> dict[str, Any]:
        """Everything in it, and the verdict, for `--json`."""
        names = ("rigidity", "rigidity_sd", "thickness", "rim_stiffness", "deepest")
        lists = {name: list(getattr(self, name)) for name in ("weights", "told", "left_out")}
        return {name: getattr(self, name) for name in names} | lists | {"passed": self.passed}


@dataclass(frozen=True, eq=False)
class Calibration:
    """One device's gains, offsets in 1/m, loops and creep, for its C channels.

    reading = offset + gain * creep(hysteresis(curvature)). `gain` is NaN for the channels that
    failed, and `failures` says why, as (channel, reason). `gain_sd` and `offset_sd` are standard
    errors of these two, of gages whose loops are as fitted; `error` in 1/m is that of corrected
    curvature on a path that the sweep did not take, None in files that do not say. `layout` is the
    `fingerprint` of the skin, `date` when it was calibrated. Calibrations of the same content are
    equal.
    """

    name: str
    serial_number: str
    firmware: str
    layout: str
    date: datetime
    gain: Array
    offset: Array
    gain_sd: Array
    offset_sd: Array
    hysteresis: PrandtlIshlinskii | None = None
    creep: StandardLinearSolid | None = None
    failures: tuple[tuple[int, str], ...] = ()
    weights: KnownWeights | None = None
    error: Array | None = None

    def __post_init__(self) -> None:
        if self.date.utcoffset() is None:
            raise Refusal(f"expected a date with its time zone, got {self.date}")
        C = len(self.gain)
        shapes = [part.shape for part in (self.gain, self.offset, self.gain_sd, self.offset_sd)]
        shapes += [self.hysteresis.linear.shape] if self.hysteresis else []
        shapes += [self.creep.share.shape] if self.creep else []
        shapes += [] if self.error is None else [self.error.shape]
        if not 0 < C <= _MOST_CHANNELS or set(shapes) != {(C,)}:
            raise Refusal(
                f"expected arrays of equal length for 1 to {_MOST_CHANNELS} channels, got "
                f"shapes {shapes}"
            )
        good = np.isfinite(self.gain)
        gains, offsets = self.gain[good], np.abs(self.offset[good])
        if not ((gains >= 1 / _STEEPEST) & (gains <= _STEEPEST) & (offsets <= FARTHEST)).all():
            raise Refusal(
                f"expected gains above zero, from {1 / _STEEPEST:g} to {_STEEPEST:g}, and finite "
                f"offsets of at most {FARTHEST:g} 1/m, where a channel passed"
            )
        failed = sorted(channel for channel, _ in self.failures)
        if failed != np.flatnonzero(~good).tolist():
            raise Refusal(f"expected a reason for every channel without a gain, got {failed}")

    @property
    def content(self) -> dict[str, dict[str, Any]]:
        """Everything in it, by heading and key, as text, dates, numbers and lists of numbers."""
        content: dict[str, dict[str, Any]] = {
            "device": {
                "name": self.name,
                "serial_number": self.serial_number,
                "firmware": self.firmware,
                "layout": self.layout,
                "date": self.date,
            },
            "line": {name: getattr(self, name).tolist() for name in _LINE},
            "failures": {str(channel): reason for channel, reason in self.failures},
        }
        if self.hysteresis:
            names = ("thresholds", "weights", "linear", "stretch")
            content["hysteresis"] = {
                name: getattr(self.hysteresis, name).tolist() for name in names
            }
        if self.creep:
            content["creep"] = {
                "share": self.creep.share.tolist(),
                "time_constant": self.creep.time_constant,
            }
        if self.error is not None:
            content["unseen"] = {"error": self.error.tolist()}
        if self.weights:
            told = self.weights.to_json()
            content["weights"] = {name: told[name] for name in sorted(_KEYS["weights"])}
        return content

    @cached_property
    def digest(self) -> str:
        return digest(self.content)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Calibration) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    @staticmethod
    def nominal(sensor: Sensor, date: datetime) -> "Calibration":
        """What a sensor reads taken as it is, except for its dead channels."""
        dead = ~sensor.layout.live.ravel()
        zero, one = np.zeros(sensor.channels), np.where(dead, np.nan, 1.0)
        return Calibration(
            *(sensor.name, sensor.serial_number, sensor.firmware, fingerprint(sensor.layout), date),
            *(one, zero, zero, zero),
            failures=tuple((c, "dead") for c in np.flatnonzero(dead).tolist()),
        )

    @property
    def is_nominal(self) -> bool:
        """Whether the readings are taken as they are, because no gain was measured."""
        return not (self.gain_sd > 0).any()

    @property
    def noise_gain(self) -> Array:
        """Noise (C,) of a corrected reading over that of the reading; NaN for those that failed.

        Of noise that is small against the loops, which it does not go through.
        """
        return 1 / (self.gain if self.hysteresis is None else self.gain * self.hysteresis.linear)

    def with_weights(self, weights: KnownWeights, now: datetime) -> "Calibration":
        """The same with known weights, laid on `now`; measured gains do not get younger by that."""
        return replace(self, weights=weights, date=now if self.is_nominal else self.date)

    def check(self, sensor: Sensor) -> None:
        """Refuse a sensor that is not the one that was calibrated."""
        if sensor.serial_number != self.serial_number:
            raise Refusal(
                f"this calibration belongs to {self.name} {self.serial_number}, the sensor is "
                f"{sensor.name} {sensor.serial_number}; choose the file of this sensor, or "
                "calibrate it"
            )
        if (fingerprint(sensor.layout), sensor.channels) != (self.layout, len(self.gain)):
            raise Refusal(
                f"{sensor.name} {sensor.serial_number} has {sensor.layout} at other positions than "
                "when it was calibrated; calibrate it again"
            )

    def plate(self, plate: Plate) -> Plate:
        """The skin of `plate` as known weights found it; as it was without them."""
        return self.weights.plate(plate) if self.weights else plate

    def start(self) -> "Corrector":
        """The correction of readings of a skin that was at rest until now."""
        return Corrector(self)

    def to_toml(self) -> str:
        """The text of the file."""
        tables = [table("", {"format": FORMAT, "sha256": self.digest})]
        tables += [table(f"[{heading}]", values) for heading, values in self.content.items()]
        return "\n".join(tables)

    @staticmethod
    def check_writable(path: Path) -> None:
        """Refuse a `path` that cannot be written to, before a person spends minutes on a sweep."""
        place = path.parent
        if path.is_dir() or not (place.is_dir() and os.access(place, os.W_OK)):
            raise Refusal(
                f"{path}: expected a file in a folder that exists and may be written to; choose "
                "another place"
            )

    def save(self, path: Path) -> None:
        """Write `path` whole or not at all."""
        self.check_writable(path)
        write_whole(path, self.to_toml())

    @staticmethod
    def read(path: Path) -> "Calibration":
        """The calibration in `path`, of any sensor and however old."""
        return Calibration.from_toml(_contents(path), path)

    @staticmethod
    def from_toml(data: bytes, path: Path) -> "Calibration":
        """The calibration in the `data` of a file that refusals call `path`."""
        content = _checked(path, _parsed(path, data))
        device, hysteresis, creep = (
            content["device"],
            content.get("hysteresis"),
            content.get("creep"),
        )
        try:
            if not all(isinstance(device[key], str) for key in _KEYS["device"] - {"date"}):
                raise TypeError(f"expected texts for the device, got {device}")
            return Calibration(
                *(device[key] for key in ("name", "serial_number", "firmware", "layout", "date")),
                *(_array(content["line"][key]) for key in _LINE),
                hysteresis=PrandtlIshlinskii(**{k: _array(v) for k, v in hysteresis.items()})
                if hysteresis
                else None,
                creep=StandardLinearSolid(_array(creep["share"]), float(creep["time_constant"]))
                if creep
                else None,
                failures=tuple((int(c), str(why)) for c, why in content["failures"].items()),
                weights=_weights(content["weights"]) if "weights" in content else None,
                error=_array(content["unseen"]["error"]) if "unseen" in content else None,
            )
        except (ValueError, TypeError, AttributeError, OverflowError) as error:
            raise Refusal(f"{path}: cannot be used ({error}); {_AGAIN}") from error


def digest(content: dict[str, dict[str, Any]]) -> str:
    """SHA-256 of `content`, whatever the order of its keys."""
    text = json.dumps(content, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


class Corrector(Stateful):
    """Readings to curvature, frame by frame, with the memory that hysteresis and creep have."""

    STATE = ("_last", "_time", "_restore", "_straighten")

    def __init__(self, calibration: Calibration) -> None:
        failed = np.isnan(calibration.gain)
        self._offset = np.where(failed, 0.0, calibration.offset)
        self._per_gain = 1 / np.where(failed, 1.0, calibration.gain)
        self._blank = np.where(failed, np.nan, 0.0)
        self._last, self._time = self._offset.copy(), math.nan
        self._restore = calibration.creep.start_inverse() if calibration.creep else None
        self._straighten = (
            calibration.hysteresis.inverse.start() if calibration.hysteresis else None
        )
        # The least that a reading changes with the curvature.
        loops = calibration.hysteresis
        self._slope = 1 / self._per_gain
        if loops is not None:
            self._slope = self._slope * loops.linear * np.minimum(loops.stretch, 1 / loops.stretch)

    def __call__(self, reading: Array, time: float) -> Array:
        """Curvature (C,) in 1/m for nominal curvature `reading` (C,), NaN if missing, at `time`.

        `time` is the device's, in s. A missing reading leaves a NaN, and to the memory it is as if
        the channel had stayed where it was.
        """
        missing = None
        if not math.isfinite(float(reading @ reading)):  # faster than to look at each
            missing = ~np.isfinite(reading)
            reading = np.where(missing, self._last, reading)
        self._last, self._time = reading, time
        k = reading - self._offset
        k *= self._per_gain
        if self._restore is not None:
            k = self._restore(k, time)
        if self._straighten is not None:
            k = self._straighten(k)
        k += self._blank
        if missing is not None:
            k[missing] = np.nan
        return k

    def remanence(self) -> Array:
        """What creep and hysteresis have left in the readings (C,) of a straight skin, in 1/m.

        The reading, without the offset, that would now be corrected to no curvature.
        """
        left = np.zeros_like(self._offset)
        if self._restore is None and self._straighten is None:
            return left
        for _ in range(_STEPS):
            corrected = copy.deepcopy(self)(self._offset + left, self._time)
            corrected = np.where(np.isfinite(corrected), corrected, 0.0)
            if np.abs(corrected).max() < _REST:
                break
            left = left - self._slope * corrected
        return left


def _contents(path: Path) -> bytes:
    try:
        with open_file(path) as file:
            return file.read(_LARGEST + 1)
    except FileNotFoundError as error:
        raise Refusal(f"{path}: there is no such file; `kappaskin calibrate` makes one") from error
    except OSError as error:
        raise Refusal(f"{path}: cannot be read ({error}); check its permissions") from error


def _parsed(path: Path, data: bytes) -> dict[str, Any]:
    try:
        if len(data) > _LARGEST:
            raise ValueError(f"it has more than {_LARGEST} bytes")
        return tomllib.loads(data.decode())
    except (ValueError, RecursionError) as error:
        raise Refusal(f"{path}: is not a calibration file ({error!s:.120}); {_AGAIN}") from error


def _checked(path: Path, content: dict[str, Any]) -> dict[str, Any]:
    """The headings of a file of this format, complete and as it was written."""
    version = content.pop("format", None)
    if type(version) is not int or version < 1:
        raise Refusal(f"{path}: expected a calibration format, got {version!r:.40}; {_AGAIN}")
    if version > FORMAT:
        raise Refusal(
            f"{path}: has format {version}, this program reads up to {FORMAT}; update kappaskin"
        )
    stated = content.pop("sha256", None)
    expected = set(_KEYS) | {"failures"}
    if unknown := set(content) - expected:
        raise Refusal(f"{path}: has unknown tables {sorted(unknown)}; {_AGAIN}")
    if missing := expected - _OPTIONAL - set(content):
        raise Refusal(f"{path}: lacks the tables {sorted(missing)}; {_AGAIN}")
    for heading, keys in _KEYS.items():
        found: Any = content.get(heading, dict.fromkeys(keys))
        if not isinstance(found, dict):
            raise Refusal(f"{path}: {heading} is not a table; {_AGAIN}")
        names = set(cast("dict[str, Any]", found))
        if names != keys:
            raise Refusal(
                f"{path}: [{heading}] lacks {sorted(keys - names)} and has unknown "
                f"{sorted(names - keys)}; {_AGAIN}"
            )
    if stated != digest(content):
        raise Refusal(f"{path}: is damaged or was edited (its SHA-256 differs); {_AGAIN}")
    return content


def _weights(table: dict[str, Any]) -> KnownWeights:
    rigidity, rigidity_sd, thickness, rim_stiffness, deepest = (
        float(table[name])
        for name in ("rigidity", "rigidity_sd", "thickness", "rim_stiffness", "deepest")
    )
    weights, told, left_out = (
        tuple(_array(table[name]).tolist()) for name in ("weights", "told", "left_out")
    )
    return KnownWeights(
        *(rigidity, rigidity_sd, thickness, rim_stiffness), weights, told, left_out, deepest
    )


def _array(values: Any) -> Array:
    return np.array(values, float)


def load_calibration(
    path: Path | str, sensor: Sensor, now: datetime, oldest: timedelta = OLDEST
) -> Calibration:
    """The calibration in `path`, if it is of this `sensor` and at `now` no older than `oldest`."""
    calibration = Calibration.read(Path(path))
    try:
        calibration.check(sensor)
    except Refusal as refusal:
        raise Refusal(f"{path}: {refusal}") from refusal
    age = now - calibration.date
    if age > oldest:
        raise Refusal(
            f"{path}: dated {calibration.date:%Y-%m-%d}, {age.days} days old; expected at most "
            f"{oldest.days} days; calibrate again"
        )
    if age < -_AHEAD:
        raise Refusal(
            f"{path}: dated {calibration.date:%Y-%m-%d %H:%M}, later than now, "
            f"{now:%Y-%m-%d %H:%M}; set this machine's clock, or calibrate again"
        )
    return calibration
