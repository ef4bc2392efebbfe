"""What a person may change, with the unit, range and explanation that every form shows."""

from dataclasses import dataclass, fields
from typing import Any

from kappaskin.calibration import Calibration, Tare
from kappaskin_app.shell.settings.asks import Ask as Ask
from kappaskin_app.shell.settings.asks import Choice as Choice
from kappaskin_app.shell.settings.asks import Range as Range
from kappaskin_app.shell.settings.asks import Several as Several
from kappaskin_app.shell.settings.asks import Switch as Switch
from kappaskin_app.shell.settings.asks import Text as Text
from kappaskin_app.shell.settings.compared import Compared as Compared
from kappaskin_app.shell.settings.designed import Designed as Designed
from kappaskin_app.shell.settings.load import FREE_CASES as FREE_CASES
from kappaskin_app.shell.settings.load import LOAD_CASES as LOAD_CASES
from kappaskin_app.shell.settings.load import READY_CASES as READY_CASES
from kappaskin_app.shell.settings.load import SIZES as SIZES
from kappaskin_app.shell.settings.load import SPREAD_CASES as SPREAD_CASES
from kappaskin_app.shell.settings.load import TABLE_1_CASES as TABLE_1_CASES
from kappaskin_app.shell.settings.load import TWO_ENDED as TWO_ENDED
from kappaskin_app.shell.settings.load import LoadSettings, Noise, Own
from kappaskin_app.shell.settings.load import Written as Written
from kappaskin_app.shell.settings.publishing import Sending as Sending
from kappaskin_app.shell.settings.sensor import Electronics as Electronics
from kappaskin_app.shell.settings.sensor import Scanning as Scanning
from kappaskin_app.shell.settings.sensor import Spoils as Spoils
from kappaskin_app.shell.settings.shown import COLOURS as COLOURS
from kappaskin_app.shell.settings.shown import METHOD_NAMES as METHOD_NAMES
from kappaskin_app.shell.settings.shown import METHOD_SHORT as METHOD_SHORT
from kappaskin_app.shell.settings.shown import EstimatorSettings as EstimatorSettings
from kappaskin_app.shell.settings.shown import Looked, Reading, View
from kappaskin_app.shell.settings.skin import Skin
from kappaskin_app.shell.settings.telling import told


@dataclass(frozen=True)
class SceneSettings(Skin, LoadSettings, Noise, Electronics, Spoils, Own):
    """Those that make the simulated scene."""


@dataclass(frozen=True)
class Settings(
    SceneSettings,
    EstimatorSettings,
    View,
    Looked,
    Reading,
    Scanning,
    Sending,
    Compared,
    Designed,
):
    """Everything a person may change, in SI units; a change is a new `Settings`.

    `calibration` and `tare` are in use whenever the sensor that they are of is connected.
    """

    calibration: Calibration | None = None
    tare: Tare | None = None


_WORDS = {"written": "the scene's text", "camera": "the view"}
Kind = type[SceneSettings | EstimatorSettings | View | Scanning | Sending | Designed]


def part(settings: Settings, kind: Kind) -> tuple[Any, ...]:
    """The values of the settings that belong to `kind`."""
    return tuple(getattr(settings, field.name) for field in fields(kind))


def ask_of(name: str) -> Ask:
    """How the setting called `name` is asked for."""
    return next(f.metadata["ask"] for f in fields(Settings) if f.name == name)


def change_told(name: str, before: Settings, after: Settings) -> str:
    """What became of the setting called `name`, in words."""
    if name in _WORDS:
        return _WORDS[name]
    field = next(f for f in fields(Settings) if f.name == name)
    return told(name, field.metadata.get("ask"), getattr(before, name), getattr(after, name))
