"""A setup as text that names the files of its calibration and tare, and back."""

import json
from collections.abc import Callable
from dataclasses import fields
from itertools import islice
from pathlib import Path
from typing import Any, cast

from kappaskin.calibration import Calibration, TareStore
from kappaskin.errors import Refusal
from kappaskin.estimation import METHODS
from kappaskin.pipeline import Setup
from kappaskin.recording.reading import Recording

_WHOLE, _REAL, _TEXT = ("Ni", "Nj", "nx", "ny"), ("hold", "rim_sd"), ("edge", "method")
_MOST = 4096  # functions or points along one side
_LONGEST = 2**16
_SETUPS = 500  # of a recording, the first of more


def setup_to_text(setup: Setup) -> tuple[str, dict[str, bytes]]:
    """The text, and by name the files that it names."""
    keys: dict[str, Any] = {name: getattr(setup, name) for name in (*_WHOLE, *_REAL, *_TEXT)}
    files: dict[str, bytes] = {}
    if setup.calibration is not None:
        keys["calibration"] = f"calibration-{setup.calibration.digest[:16]}.toml"
        files[keys["calibration"]] = setup.calibration.to_toml().encode()
    if setup.tare is not None:
        keys["tare"] = f"tare-{setup.tare.digest[:16]}.toml"
        files[keys["tare"]] = TareStore.to_toml(setup.tare).encode()
    return json.dumps(keys), files


def setup_from_text(text: str, file: Callable[[str], bytes]) -> Setup:
    """The setup that `text` tells of, `file` giving what a name stands for.

    A `Refusal` when it is none.
    """
    try:
        if len(text) > _LONGEST:
            raise ValueError(f"it is {len(text)} characters long")
        keys: Any = json.loads(text)
        if not isinstance(keys, dict):
            raise TypeError("it has no keys")
        keys = cast("dict[str, Any]", keys)
        if unknown := set(keys) - {field.name for field in fields(Setup)}:
            raise ValueError(f"it has unknown keys {sorted(unknown)}")
        values = _checked(keys)
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise Refusal(f"expected a setup as it was recorded: {error!s:.120}") from error
    if name := keys.get("calibration"):
        values["calibration"] = Calibration.from_toml(file(str(name)), Path(str(name)))
    if name := keys.get("tare"):
        values["tare"] = TareStore.from_toml(file(str(name)), str(name))
    return Setup(**values)


def recorded_setups(recording: Recording) -> list[tuple[float, Setup]]:
    """The setups in a recording, each with the time in s from its beginning on which it was used.

    A `Refusal` where one is none.
    """
    return [
        (since, setup_from_text(text, recording.attachment))
        for since, text in islice(recording.setups(), _SETUPS)
    ]


def _checked(keys: dict[str, Any]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for name in _WHOLE:
        values[name] = keys[name]
        if type(keys[name]) is not int or not 0 < keys[name] <= _MOST:
            raise ValueError(f"{name} is {keys[name]!r:.40}")
    for name in _REAL:
        values[name] = float(keys[name])
    for name in _TEXT:
        values[name] = keys[name]
        if not isinstance(keys[name], str):
            raise TypeError(f"{name} is {keys[name]!r:.40}")
    if values["method"] not in METHODS:
        raise ValueError(f"method is {values['method']!r:.40}, expected one of {list(METHODS)}")
    return values
