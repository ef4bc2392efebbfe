"""The settings of the window, with the label, unit, range and tooltip of each."""

from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import numpy as np

from kappaskin.calibration import Calibration, Tare
from kappaskin_app.shell.settings.designed import DesignSettings as DesignSettings
from kappaskin_app.shell.settings.form_fields import Choice as Choice
from kappaskin_app.shell.settings.form_fields import FormField as FormField
from kappaskin_app.shell.settings.form_fields import Range as Range
from kappaskin_app.shell.settings.form_fields import Several as Several
from kappaskin_app.shell.settings.form_fields import Switch as Switch
from kappaskin_app.shell.settings.form_fields import Text as Text
from kappaskin_app.shell.settings.operation import OperationSettings as OperationSettings
from kappaskin_app.shell.settings.publishing import PublishSettings as PublishSettings
from kappaskin_app.shell.settings.scene import FREE_CASES as FREE_CASES
from kappaskin_app.shell.settings.scene import LOAD_CASES as LOAD_CASES
from kappaskin_app.shell.settings.scene import READY_CASES as READY_CASES
from kappaskin_app.shell.settings.scene import SIZES as SIZES
from kappaskin_app.shell.settings.scene import SPREAD_CASES as SPREAD_CASES
from kappaskin_app.shell.settings.scene import TABLE_1_CASES as TABLE_1_CASES
from kappaskin_app.shell.settings.scene import TWO_ENDED as TWO_ENDED
from kappaskin_app.shell.settings.scene import AddedNoise, LoadSettings, Noise, OwnScene, Skin
from kappaskin_app.shell.settings.scene import Electronics as Electronics
from kappaskin_app.shell.settings.scene import GageEffects as GageEffects
from kappaskin_app.shell.settings.scene import Scanning as Scanning
from kappaskin_app.shell.settings.scene import Written as Written
from kappaskin_app.shell.settings.shown import COLOURS as COLOURS
from kappaskin_app.shell.settings.shown import METHOD_SHORT as METHOD_SHORT
from kappaskin_app.shell.settings.shown import Camera, View
from kappaskin_app.shell.settings.shown import ComparedSettings as ComparedSettings
from kappaskin_app.shell.settings.shown import EstimatorSettings as EstimatorSettings
from kappaskin_app.shell.settings.shown import Look as Look
from kappaskin_app.shell.settings.shown import locked_at as locked_at
from kappaskin_app.shell.settings.shown import locking as locking


@dataclass(frozen=True)
class SceneSettings(Skin, LoadSettings, Noise, Electronics, GageEffects, OwnScene):
    """The settings of the simulated scene."""


@dataclass(frozen=True)
class LastingSettings(Look, OperationSettings):
    """Settings that stay as they are in undo and redo, and when another finger is shown."""


@dataclass(frozen=True)
class Settings(
    SceneSettings,
    AddedNoise,
    EstimatorSettings,
    View,
    Camera,
    LastingSettings,
    Scanning,
    PublishSettings,
    ComparedSettings,
    DesignSettings,
):
    """All settings, in SI units; a change is a new `Settings`.

    `calibration` and `tare` are applied whenever the sensor that they belong to is connected.
    """

    calibration: Calibration | None = None
    tare: Tare | None = None


_EACH = {"noise_seed", "region_elements", "traced"}  # of one finger: its elements, its noise
SHARED = {
    field.name
    for kind in (
        *(EstimatorSettings, View, Noise, AddedNoise, Electronics, GageEffects),
        *(Scanning, PublishSettings),
    )
    for field in fields(kind)
} - _EACH
"""The settings that may be changed of all fingers of a hand at once, by name."""

_ARROW = "\N{RIGHTWARDS ARROW}"
_PANELS = {
    LoadSettings: "load",
    Noise: "noise",
    AddedNoise: "added noise",
    Scanning: "scan",
    PublishSettings: "publish",
    ComparedSettings: "B",
}
"""Panels whose name precedes the label of their settings in the history."""
_LONGEST = 30  # characters of a text
_NAMES = {"written": "the scene's text", "camera": "the view"}
Kind = type[SceneSettings | EstimatorSettings | View | Scanning | PublishSettings | DesignSettings]


def part(settings: Settings, kind: Kind) -> tuple[Any, ...]:
    """The values of the settings that belong to `kind`."""
    return tuple(getattr(settings, field.name) for field in fields(kind))


@cache
def form_field(name: str) -> FormField:
    """The form field of the setting `name`."""
    return next(f.metadata["form"] for f in fields(Settings) if f.name == name)


def calibration_text(calibration: Calibration) -> str:
    """When a calibration was made, how many channels passed, and what known weights found."""
    passed, all_ = int(np.isfinite(calibration.gain).sum()), len(calibration.gain)
    day, known = calibration.date.astimezone(), calibration.weights
    channels = "nominal readings" if calibration.is_nominal else f"{passed} of {all_} channels"
    stiff = f", rigidity {known.rigidity:.3g} N m by {len(known.weights)} weights" if known else ""
    return f"calibrated {day:%Y-%m-%d}, {channels}{stiff}"


def change_text(name: str, before: Settings, after: Settings) -> str:
    """The change of the setting `name`, as the history shows it."""
    if name.startswith("range_"):
        return "colour range"
    if name in _NAMES:
        return _NAMES[name]
    field = next(f for f in fields(Settings) if f.name == name)
    return _change_text(
        name, field.metadata.get("form"), getattr(before, name), getattr(after, name)
    )


def _change_text(name: str, form: FormField | None, before: Any, after: Any) -> str:
    """The label of the setting `name`, with both its values: "noise RMS 1.000 to 2.000"."""
    if form is None:
        return name
    panel = next((w for kind, w in _PANELS.items() if name in {f.name for f in fields(kind)}), "")
    label = form.label if form.label.isupper() else form.label[:1].lower() + form.label[1:]
    words = f"{panel} {label}" if panel and panel != label else label
    if isinstance(form, Switch):
        return f"{words} {'on' if after else 'off'}"
    if isinstance(form, Range | Choice | Text):
        unit = f" {form.unit}" if isinstance(form, Range) and form.unit else ""
        return f"{words} {_value(form, before)} {_ARROW} {_value(form, after)}{unit}"
    return words


def _value(form: Range | Choice | Text, value: Any) -> str:
    """A value as its editor shows it."""
    if isinstance(form, Range):
        return f"{value * form.scale:.{form.decimals}f}"
    words = form.words(value) if isinstance(form, Choice) else value or "nothing"
    return words if len(words) <= _LONGEST else f"{words[: _LONGEST - 1]}\N{HORIZONTAL ELLIPSIS}"
