"""Storage of the tares of every sensor."""

import hashlib
import re
import tomllib
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs

from kappaskin._files import open_file, replacing, user_folder
from kappaskin._toml import table
from kappaskin.calibration.calibration import digest
from kappaskin.calibration.tare import Tare
from kappaskin.errors import Refusal
from kappaskin.sensing import Sensor

FORMAT = 1
MOST_SAVED = 10
"""How many tares of one sensor are saved, the newest."""

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


class TareStore:
    """The tares saved in a `folder`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @staticmethod
    def user_folder() -> Path:
        """The folder of this user's tares."""
        return user_folder(platformdirs.user_data_path) / "tares"

    def path(self, serial_number: str) -> Path:
        """The file of a sensor of any serial number.

        Characters other than letters, digits, dashes and underscores are left out; a hash
        distinguishes names that are then the same.
        """
        plain = re.sub(r"[^A-Za-z0-9_-]+", "", serial_number)[:40]
        mark = hashlib.sha256(serial_number.encode(errors="surrogatepass")).hexdigest()[:12]
        return self.folder / f"{plain or 'sensor'}-{mark}.toml"

    def load(self, serial_number: str) -> SavedTares:
        """The tares of a sensor, none without a file; a file that is damaged is refused."""
        path = self.path(serial_number)
        try:
            with open_file(path) as file:
                data = file.read(_LARGEST + 1)
        except (FileNotFoundError, NotADirectoryError):
            return SavedTares()
        except OSError as error:
            raise Refusal(f"{path}: cannot be read ({error}); check its permissions") from error
        try:
            return _parsed(data, serial_number)
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
            raise Refusal(
                f"{path}: contains no valid tares ({error!s:.120}); delete it, then tare again"
            ) from error

    def add(self, tare: Tare) -> None:
        """Save a new tare, and use it; it replaces a damaged file."""
        try:
            before = self.load(tare.serial_number).tares
        except Refusal:
            before = ()
        others = [saved for saved in before if saved != tare]
        self._write(tare.serial_number, SavedTares((*others, tare)[-MOST_SAVED:], tare))

    def use(self, serial_number: str, tare: Tare | None) -> None:
        """Use a saved tare, or none; nothing is written where nothing changes."""
        saved = self.load(serial_number)
        if tare is not None and tare not in saved.tares:
            self.add(tare)
        elif tare != saved.used:
            self._write(serial_number, SavedTares(saved.tares, tare))

    def _write(self, serial_number: str, saved: SavedTares) -> None:
        path = self.path(serial_number)
        with replacing(path, "free disk space, or check its permissions") as part:
            self.folder.mkdir(parents=True, exist_ok=True)
            part.write_text(_text(saved), "utf-8")

    @staticmethod
    def to_toml(tare: Tare) -> str:
        """The text of a file with one tare."""
        return _text(SavedTares((tare,), tare))

    @staticmethod
    def from_toml(data: bytes, name: str) -> Tare:
        """The tare in the `data` that `to_toml` made, of a file that refusals call `name`."""
        try:
            saved = _parsed(data, None)
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
            raise Refusal(
                f"{name}: is not a tare ({error!s:.120}); expected an unchanged file"
            ) from error
        if saved.used is None:
            raise Refusal(f"{name}: expected one tare that is in use, got {len(saved.tares)}")
        return saved.used


def _content(saved: SavedTares) -> dict[str, Any]:
    used = saved.used.digest if saved.used else ""
    return {"used": used, "tare": [tare.content for tare in saved.tares]}


def _text(saved: SavedTares) -> str:
    content = _content(saved)
    head = {"format": FORMAT, "sha256": digest(content), "used": content["used"]}
    return "\n".join([table("", head), *(table("[[tare]]", values) for values in content["tare"])])


def _parsed(data: bytes, serial_number: str | None) -> SavedTares:
    """The tares in a file of the sensor of this number, or of whichever."""
    if len(data) > _LARGEST:
        raise ValueError(f"it has more than {_LARGEST} bytes")
    values = tomllib.loads(data.decode())
    if values.get("format") != FORMAT:
        raise ValueError(f"it has format {values.get('format')!r:.40}, expected {FORMAT}")
    if set(values) - {"tare"} != _KEYS - {"tare"}:
        raise ValueError(f"it has the keys {sorted(values)}, expected {sorted(_KEYS)}")
    content = {"used": values["used"], "tare": values.get("tare", [])}
    if digest(content) != values["sha256"]:
        raise ValueError("it is damaged or was edited, its SHA-256 differs")
    tares = tuple(_tare(one) for one in content["tare"])
    if serial_number is not None and any(t.serial_number != serial_number for t in tares):
        raise ValueError("it belongs to another sensor")
    return SavedTares(tares, next((tare for tare in tares if tare.digest == values["used"]), None))


def _tare(values: dict[str, Any]) -> Tare:
    name, serial_number, layout = texts = [values[k] for k in ("name", "serial_number", "layout")]
    if not all(isinstance(text, str) for text in texts):
        raise TypeError(f"expected texts, got {texts}")
    if not isinstance(values["date"], datetime):
        raise TypeError(f"expected a date, got {values['date']}")
    temperature = values.get("temperature")
    return Tare(
        name,
        serial_number,
        layout,
        values["date"],
        None if temperature is None else float(temperature),
        int(values["frames"]),
        float(values["seconds"]),
        np.array(values["offset"], float),
        np.array(values["offset_sd"], float),
    )
