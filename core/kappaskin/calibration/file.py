"""A calibration to a TOML file and back, refused when anything about it is not as it should be."""

import os
import tomllib
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, cast

import numpy as np

from kappaskin._toml import table
from kappaskin.calibration.calibration import Calibration, digest
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.sensing import PrandtlIshlinskii, Sensor, StandardLinearSolid

FORMAT = 1
OLDEST = timedelta(days=180)
"""Age beyond which a calibration is not trusted: glue and bonding go on changing."""

_AHEAD = timedelta(days=1)  # that the clock of the machine that calibrated may have been ahead
_LARGEST = 2**26  # bytes
_KEYS = {
    "device": {"name", "serial_number", "firmware", "layout", "date"},
    "line": {"gain", "offset", "gain_sd", "offset_sd"},
    "hysteresis": {"thresholds", "weights", "linear", "stretch"},
    "creep": {"share", "time_constant"},
}
_OPTIONAL = {"hysteresis", "creep"}


def to_toml(calibration: Calibration) -> str:
    """The text of the file."""
    tables = [table("", {"format": FORMAT, "sha256": calibration.digest})]
    tables += [table(f"[{heading}]", said) for heading, said in calibration.content.items()]
    return "\n".join(tables)


def check_place(path: Path) -> None:
    """Refuse a `path` that no file can be written to, before a person spends minutes on it."""
    place = path.parent
    if path.is_dir() or not (place.is_dir() and os.access(place, os.W_OK)):
        raise Refusal(
            f"{path}: expected a file in a folder that exists and may be written to; choose "
            "another place"
        )


def save_calibration(calibration: Calibration, path: Path) -> None:
    """Write `path` whole or not at all."""
    check_place(path)
    part = path.with_name(f".{path.name}.part")
    try:
        with part.open("w", encoding="utf-8") as file:
            file.write(to_toml(calibration))
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except (OSError, UnicodeEncodeError) as error:
        raise Refusal(f"{path}: cannot be written ({error}); choose another place") from error
    finally:
        part.unlink(missing_ok=True)


def _contents(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
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
        raise Refusal(f"{path}: is no calibration file ({error!s:.120}); {_AGAIN}") from error


_AGAIN = "calibrate again, or restore the file from a copy"


def _checked(path: Path, said: dict[str, Any]) -> dict[str, Any]:
    """The headings of a file that is of our format, complete and as it was written."""
    version = said.pop("format", None)
    if type(version) is not int or version < 1:
        raise Refusal(f"{path}: says no format of calibration, got {version!r:.40}; {_AGAIN}")
    if version > FORMAT:
        raise Refusal(
            f"{path}: has format {version}, this program reads up to {FORMAT}; update kappaskin"
        )
    stated = said.pop("sha256", None)
    expected = set(_KEYS) | {"failures"}
    if unknown := set(said) - expected:
        raise Refusal(f"{path}: has unknown headings {sorted(unknown)}; {_AGAIN}")
    if missing := expected - _OPTIONAL - set(said):
        raise Refusal(f"{path}: lacks the headings {sorted(missing)}; {_AGAIN}")
    for heading, keys in _KEYS.items():
        found: Any = said.get(heading, dict.fromkeys(keys))
        if not isinstance(found, dict):
            raise Refusal(f"{path}: {heading} is no heading; {_AGAIN}")
        names = set(cast("dict[str, Any]", found))
        if names != keys:
            raise Refusal(
                f"{path}: [{heading}] lacks {sorted(keys - names)} and has unknown "
                f"{sorted(names - keys)}; {_AGAIN}"
            )
    if stated != digest(said):
        raise Refusal(f"{path}: is damaged or was edited (its SHA-256 differs); {_AGAIN}")
    return said


def _array(values: Any) -> Array:
    return np.array(values, float)


def from_toml(path: Path) -> Calibration:
    """The calibration in `path`, whosever it is and however old."""
    return calibration_in(_contents(path), path)


def calibration_in(data: bytes, path: Path) -> Calibration:
    """The calibration in the `data` of a file that refusals call `path`."""
    said = _checked(path, _parsed(path, data))
    device, hysteresis, creep = said["device"], said.get("hysteresis"), said.get("creep")
    try:
        if not all(isinstance(device[key], str) for key in _KEYS["device"] - {"date"}):
            raise TypeError(f"expected the device in words, got {device}")
        return Calibration(
            *(device[key] for key in ("name", "serial_number", "firmware", "layout", "date")),
            *(_array(said["line"][key]) for key in ("gain", "offset", "gain_sd", "offset_sd")),
            hysteresis=PrandtlIshlinskii(**{k: _array(v) for k, v in hysteresis.items()})
            if hysteresis
            else None,
            creep=StandardLinearSolid(_array(creep["share"]), float(creep["time_constant"]))
            if creep
            else None,
            failures=tuple((int(c), str(why)) for c, why in said["failures"].items()),
        )
    except (ValueError, TypeError, AttributeError, OverflowError) as error:
        raise Refusal(f"{path}: cannot be used ({error}); {_AGAIN}") from error


def load_calibration(
    path: Path, sensor: Sensor, now: datetime, oldest: timedelta = OLDEST
) -> Calibration:
    """The calibration in `path`, if it is of this `sensor` and at `now` no older than `oldest`."""
    calibration = from_toml(path)
    try:
        calibration.check(sensor)
    except Refusal as refusal:
        raise Refusal(f"{path}: {refusal}") from refusal
    age = now - calibration.date
    if age > oldest:
        raise Refusal(
            f"{path}: is of {calibration.date:%Y-%m-%d}, {age.days} days old; expected at most "
            f"{oldest.days} days; calibrate again"
        )
    if age < -_AHEAD:
        raise Refusal(
            f"{path}: is of {calibration.date:%Y-%m-%d %H:%M}, in the future of "
            f"{now:%Y-%m-%d %H:%M}; set this machine's clock, or calibrate again"
        )
    return calibration
