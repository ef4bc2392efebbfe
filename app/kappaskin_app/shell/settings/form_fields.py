"""Form fields of settings: label, tooltip, unit and range."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from kappaskin._schema import Key
from kappaskin.pipeline import SETUP, Setup

MILLIMETRES = (1e3, "mm")
PER_METRE = (1.0, "1/m")


@dataclass(frozen=True)
class FormField:
    """The label of a setting, and its tooltip."""

    label: str
    tip: str


@dataclass(frozen=True)
class Range(FormField):
    """A number: screen value = SI value times `scale`, in `unit`."""

    least: float
    most: float
    step: float
    scale: float = 1.0
    unit: str = ""
    decimals: int = 0


@dataclass(frozen=True)
class Options(FormField):
    """Several values: `options` are (value, label) pairs."""

    options: tuple[tuple[str, str], ...]

    def words(self, value: str) -> str:
        """The label of a value; of a quantity that only some sensors read, its name."""
        return dict(self.options).get(value, value)


class Choice(Options):
    """One of several values."""


class Several(Options):
    """A subset of several values, in their order."""


class Switch(FormField):
    """A value that is on or off."""


class Text(FormField):
    """A line of text."""


def setting(default: Any, form: FormField) -> Any:
    """A setting with its `default` value and its form field."""
    return field(default=default, metadata={"form": form})


def setting_of_key(
    key: Key, default: Any, step: float = 1.0, decimals: int = 0, setup: str = "", **other: Any
) -> Any:
    """A setting whose form field is that of a file's `key`, except for the values in `other`.

    It is the field `setup` of a setup, if one is named.
    """
    key = replace(key, **other)
    form: FormField = Switch(key.label, key.tip)
    if key.choices:
        form = Choice(key.label, key.tip, key.choices)
    elif key.kind is not bool:
        shown = step, 1 / key.unit.scale, key.unit.shown, decimals
        form = Range(key.label, key.tip, *key.bounds, *shown)
    return field(default=default, metadata={"form": form, "setup": setup})


def setting_of_setup(name: str, default: Any = None) -> Any:
    """A setting that is the field `name` of a setup."""
    value = getattr(Setup(), name) if default is None else default
    return setting_of_key(SETUP.key(name), value, setup=name)


def setup_values(settings: Any, kind: type[Any]) -> dict[str, Any]:
    """The fields of a setup, from the settings of the class `kind`."""
    made = ((each.metadata.get("setup"), each.name) for each in fields(kind))
    return {field: getattr(settings, name) for field, name in made if field}


def settings_from(setup: Mapping[str, Any], kind: type[Any]) -> dict[str, Any]:
    """The settings of the class `kind`, from the fields of a `setup`."""
    made = ((each.metadata.get("setup"), each.name) for each in fields(kind))
    return {name: setup[field] for field, name in made if field}
