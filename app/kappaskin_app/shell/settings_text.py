"""Settings to text that a person can read, and back."""

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

from kappaskin.errors import Refusal
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import Written

VERSION = 1
OF_SENSORS = ("calibration", "tare")
"""They belong to a sensor, and have files of their own."""
_BEGUN = Settings()


def settings_text(settings: Settings) -> str:
    """JSON of all settings but those that belong to a sensor."""
    said = {f.name: getattr(settings, f.name) for f in fields(settings)}
    written = said["written"]
    said["written"] = written and {"text": written.text, "file": str(written.file)}
    for name in OF_SENSORS:
        del said[name]
    return json.dumps({"version": VERSION, "settings": said}, indent=1)


def settings_in(text: str) -> Settings:
    """The settings that a text says; the ready ones for what it does not say."""
    try:
        found = json.loads(text)
        version, said = found["version"], dict(found["settings"])
    except (ValueError, KeyError, TypeError) as error:
        raise Refusal(
            f"expected settings as JSON, got {text!r:.40}; choose another file"
        ) from error
    if version != VERSION:
        raise Refusal(
            f"expected settings of version {VERSION}, got {version!r:.20}; update Kappaskin"
        )
    known = [f.name for f in fields(Settings) if f.name not in OF_SENSORS]
    return Settings(**{name: _value(name, said[name]) for name in known if name in said})


def _value(name: str, value: Any) -> Any:
    """What a setting is from what JSON made of it."""
    was = getattr(_BEGUN, name)
    if name == "written":
        try:
            return value and Written(str(value["text"]), Path(value["file"]))
        except (TypeError, KeyError) as error:
            raise Refusal(
                f"{name}: expected text and file, got {value!r:.40}; leave it out"
            ) from error
    if isinstance(was, tuple) and isinstance(value, list):
        return tuple(value)
    if isinstance(was, float) and type(value) is int:
        return float(value)
    if type(value) is not type(was):
        raise Refusal(f"{name}: expected {type(was).__name__}, got {value!r:.40}; leave it out")
    return value
