"""A setting as a lesson says it to its value, refused where a person could not choose it."""

from dataclasses import fields
from typing import Any

from kappaskin.errors import Refusal
from kappaskin_app.shell.settings import SceneSettings, Settings, form_field
from kappaskin_app.shell.settings.form_fields import Choice, FormField, Range, Several, Switch
from kappaskin_app.shell.settings.scene import Scanning
from kappaskin_app.shell.settings.shown import EstimatorSettings, View

_OWN = ("theme", "show_start")  # matters of taste
_LISTS = ("dead_elements", "region_elements")
_KINDS = (SceneSettings, EstimatorSettings, Scanning, View)
SETTABLE = {
    field.name
    for kind in _KINDS
    for field in fields(kind)
    if "form" in field.metadata and field.name not in _OWN
}
"""What a lesson may set, besides lists of elements: nothing that leaves this machine."""


def checked_setting(name: str, value: Any) -> Any:
    """The `value` of the setting `name`; a `Refusal` for what no person could choose."""
    if name in _LISTS:
        return _elements(name, value)
    if name not in SETTABLE:
        raise Refusal(f"expected the name of a setting, got {name!r}; the guide lists them")
    how = form_field(name)
    if isinstance(how, Range):
        return _number(name, how, value)
    if isinstance(how, Several):
        return _several(name, how, value)
    if not _is_one(how, value):
        choices = [one for one, _ in how.options] if isinstance(how, Choice) else ["true", "false"]
        raise Refusal(f"expected {name} to be one of {', '.join(choices)}; got {value!r}")
    return value


def _is_one(how: FormField, value: Any) -> bool:
    if isinstance(how, Choice):
        return value in [one for one, _ in how.options]
    return isinstance(how, Switch) and isinstance(value, bool)


def _number(name: str, how: Range, value: Any) -> float | int:
    kind = type(getattr(Settings(), name))
    fits = isinstance(value, int | float) and not isinstance(value, bool)
    if not fits or not how.least <= value <= how.most:
        raise Refusal(f"expected {name} from {how.least:g} to {how.most:g}, got {value!r}")
    if kind(value) != value:
        raise Refusal(f"expected {name} to be a whole number, got {value!r}")
    return kind(value)


def _several(name: str, how: Several, value: Any) -> tuple[str, ...]:
    known = [one for one, _ in how.options]
    if not isinstance(value, list) or not all(one in known for one in value):
        raise Refusal(f"expected {name} to be a list of {', '.join(known)}; got {value!r}")
    return tuple(value)


def _elements(name: str, value: Any) -> tuple[int, ...]:
    most = 32 * 32
    if not isinstance(value, list) or not all(
        isinstance(one, int) and not isinstance(one, bool) and 0 <= one < most for one in value
    ):
        raise Refusal(f"expected {name} to be a list of elements, counted from 0; got {value!r}")
    return tuple(value)
