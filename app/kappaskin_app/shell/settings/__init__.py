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
from kappaskin_app.shell.settings.designed import Designed as Designed
from kappaskin_app.shell.settings.publishing import Sending as Sending
from kappaskin_app.shell.settings.scene import FREE_CASES as FREE_CASES
from kappaskin_app.shell.settings.scene import LOAD_CASES as LOAD_CASES
from kappaskin_app.shell.settings.scene import READY_CASES as READY_CASES
from kappaskin_app.shell.settings.scene import SIZES as SIZES
from kappaskin_app.shell.settings.scene import SPREAD_CASES as SPREAD_CASES
from kappaskin_app.shell.settings.scene import TABLE_1_CASES as TABLE_1_CASES
from kappaskin_app.shell.settings.scene import TWO_ENDED as TWO_ENDED
from kappaskin_app.shell.settings.scene import Electronics as Electronics
from kappaskin_app.shell.settings.scene import LoadSettings, Noise, Own, Skin
from kappaskin_app.shell.settings.scene import Scanning as Scanning
from kappaskin_app.shell.settings.scene import Spoils as Spoils
from kappaskin_app.shell.settings.scene import Written as Written
from kappaskin_app.shell.settings.shown import COLOURS as COLOURS
from kappaskin_app.shell.settings.shown import METHOD_SHORT as METHOD_SHORT
from kappaskin_app.shell.settings.shown import Compared as Compared
from kappaskin_app.shell.settings.shown import EstimatorSettings as EstimatorSettings
from kappaskin_app.shell.settings.shown import Looked, Reading, View


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


_ARROW = "\N{RIGHTWARDS ARROW}"
_PANELS = {
    LoadSettings: "load",
    Noise: "noise",
    Scanning: "scan",
    Sending: "publish",
    Compared: "B",
}
"""Where a label says too little without its panel."""
_LONGEST = 30  # characters of a text
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
    return _told(name, field.metadata.get("ask"), getattr(before, name), getattr(after, name))


def _told(name: str, ask: Ask | None, before: Any, after: Any) -> str:
    """The setting `name`, asked for by `ask`, with both its values: "noise RMS 1.000 to 2.000"."""
    if ask is None:
        return "colour range" if name.startswith("range_") else name
    panel = next((w for kind, w in _PANELS.items() if name in {f.name for f in fields(kind)}), "")
    label = ask.label if ask.label.isupper() else ask.label[:1].lower() + ask.label[1:]
    words = f"{panel} {label}" if panel and panel != label else label
    if isinstance(ask, Switch):
        return f"{words} {'on' if after else 'off'}"
    if isinstance(ask, Range | Choice | Text):
        unit = f" {ask.unit}" if isinstance(ask, Range) and ask.unit else ""
        return f"{words} {_value(ask, before)} {_ARROW} {_value(ask, after)}{unit}"
    return words


def _value(ask: Range | Choice | Text, value: Any) -> str:
    """A value as its editor shows it."""
    if isinstance(ask, Range):
        return f"{value * ask.scale:.{ask.decimals}f}"
    words = dict(ask.options)[value] if isinstance(ask, Choice) else value or "nothing"
    return words if len(words) <= _LONGEST else f"{words[: _LONGEST - 1]}\N{HORIZONTAL ELLIPSIS}"
