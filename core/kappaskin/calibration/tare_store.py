"""The last tares of every sensor and which of them is in use, in a file for each serial number."""

import hashlib
import os
import re
import tomllib
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs

from kappaskin._toml import table
from kappaskin.calibration.calibration import digest
from kappaskin.calibration.tare import Tare
from kappaskin.errors import Refusal
from kappaskin.sensing import Sensor

FORMAT = 1
MOST_SAVED = 10
"""How many tares of one sensor are kept, the newest."""

_LARGEST = 2**26  # bytes
_KEYS = {"format", "sha256", "used", "tare"}


@dataclass(frozen=True)
class SavedTares:
    """The `tares` of one sensor, the oldest first, and the one `used`, if one is."""

    tares: tuple[Tare, ...] = ()
    used: Tare | None = None

    def fit_for(self, sensor: Sensor) -> Tare | None:
        """The one used, unless the elements of `sensor` are in other places now."""
        if self.used is not None:
            with suppress(Refusal):
                self.used.check(sensor)
                return self.used
        return None


def tare_folder() -> Path:
    """The folder of this user's tares."""
    return platformdirs.user_data_path("kappaskin", appauthor=False) / "tares"


class TareStore:
    """The tares kept in a `folder`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, serial_number: str) -> Path:
        """The file of a sensor, whatever a device says its number is.

        What is no letter, digit, dash or underscore is left out, and a hash tells apart what
        would be the same then.
        """
        plain = re.sub(r"[^A-Za-z0-9_-]+", "", serial_number)[:40]
        mark = hashlib.sha256(serial_number.encode(errors="surrogatepass")).hexdigest()[:12]
        return self.folder / f"{plain or 'sensor'}-{mark}.toml"

    def load(self, serial_number: str) -> SavedTares:
        """What is kept of a sensor; a file that is damaged is refused, none is an empty one."""
        path = self.path(serial_number)
        try:
            with path.open("rb") as file:
                data = file.read(_LARGEST + 1)
        except FileNotFoundError:
            return SavedTares()
        except OSError as error:
            raise Refusal(f"{path}: cannot be read ({error}); check its permissions") from error
        try:
            return _kept(data, serial_number)
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
            raise Refusal(
                f"{path}: holds no tares that can be used ({error!s:.120}); delete it, then tare "
                "again"
            ) from error

    def add(self, tare: Tare) -> None:
        """Keep a new one, and use it; a damaged file makes room for it."""
        try:
            before = self.load(tare.serial_number).tares
        except Refusal:
            before = ()
        others = [kept for kept in before if kept != tare]
        self._write(tare.serial_number, SavedTares((*others, tare)[-MOST_SAVED:], tare))

    def use(self, serial_number: str, tare: Tare | None) -> None:
        """Use one that is kept, or none; nothing is written where nothing changes."""
        kept = self.load(serial_number)
        if tare is not None and tare not in kept.tares:
            self.add(tare)
        elif tare != kept.used:
            self._write(serial_number, SavedTares(kept.tares, tare))

    def _write(self, serial_number: str, kept: SavedTares) -> None:
        """Write the file whole or not at all."""
        path = self.path(serial_number)
        part = path.with_name(f".{path.name}.{os.getpid()}.part")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with part.open("w", encoding="utf-8") as file:
                file.write(_text(kept))
                file.flush()
                os.fsync(file.fileno())
            os.replace(part, path)
        except (OSError, UnicodeEncodeError) as error:
            part.unlink(missing_ok=True)
            raise Refusal(
                f"{path}: cannot be written ({error}); make room, or check its permissions"
            ) from error


def tare_to_toml(tare: Tare) -> str:
    """The text of a file with one tare."""
    return _text(SavedTares((tare,), tare))


def tare_from_toml(data: bytes, name: str) -> Tare:
    """The tare in the `data` that `tare_text` made, of a file that refusals call `name`."""
    try:
        kept = _kept(data, None)
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
        raise Refusal(f"{name}: is no tare ({error!s:.120}); expected it as it was made") from error
    if kept.used is None:
        raise Refusal(f"{name}: expected one tare that is in use, got {len(kept.tares)}")
    return kept.used


def _content(kept: SavedTares) -> dict[str, Any]:
    used = kept.used.digest if kept.used else ""
    return {"used": used, "tare": [tare.content for tare in kept.tares]}


def _text(kept: SavedTares) -> str:
    content = _content(kept)
    head = {"format": FORMAT, "sha256": digest(content), "used": content["used"]}
    return "\n".join([table("", head), *(table("[[tare]]", said) for said in content["tare"])])


def _kept(data: bytes, serial_number: str | None) -> SavedTares:
    """The tares in a file of the sensor of this number, or of whichever."""
    if len(data) > _LARGEST:
        raise ValueError(f"it has more than {_LARGEST} bytes")
    said = tomllib.loads(data.decode())
    if said.get("format") != FORMAT:
        raise ValueError(f"it has format {said.get('format')!r:.40}, expected {FORMAT}")
    if set(said) - {"tare"} != _KEYS - {"tare"}:
        raise ValueError(f"it has the keys {sorted(said)}, expected {sorted(_KEYS)}")
    content = {"used": said["used"], "tare": said.get("tare", [])}
    if digest(content) != said["sha256"]:
        raise ValueError("it is damaged or was edited, its SHA-256 differs")
    tares = tuple(_tare(one) for one in content["tare"])
    if serial_number is not None and any(t.serial_number != serial_number for t in tares):
        raise ValueError("it is of another sensor")
    return SavedTares(tares, next((tare for tare in tares if tare.digest == said["used"]), None))


def _tare(said: dict[str, Any]) -> Tare:
    name, serial_number, layout = texts = [said[k] for k in ("name", "serial_number", "layout")]
    if not all(isinstance(text, str) for text in texts):
        raise TypeError(f"expected texts, got {texts}")
    if not isinstance(said["date"], datetime):
        raise TypeError(f"expected a date, got {said['date']}")
    temperature = said.get("temperature")
    return Tare(
        name,
        serial_number,
        layout,
        said["date"],
        None if temperature is None else float(temperature),
        int(said["frames"]),
        float(said["seconds"]),
        np.array(said["offset"], float),
        np.array(said["offset_sd"], float),
    )
