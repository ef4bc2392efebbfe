"""How a setting is asked for: its words, unit, range and explanation, as every form shows them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from kappaskin._schema import Key
from kappaskin.pipeline import SETUP, Setup

MILLIMETRES = (1e3, "mm")
PER_METRE = (1.0, "1/m")


@dataclass(frozen=True)
class Ask:
    """How a setting is asked for: its words beside the editor, and what a tooltip says of it."""

    label: str
    tip: str


@dataclass(frozen=True)
class Range(Ask):
    """How a number is asked for: screen value = SI value times `scale`, in `unit`."""

    least: float
    most: float
    step: float
    scale: float = 1.0
    unit: str = ""
    decimals: int = 0


@dataclass(frozen=True)
class Choice(Ask):
    """How one of several values is asked for: (value, words) pairs."""

    options: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Several(Ask):
    """How some of several values are asked for, in their order: (value, words) pairs."""

    options: tuple[tuple[str, str], ...]


class Switch(Ask):
    """How yes or no is asked for."""


class Text(Ask):
    """How a line of text is asked for."""


def asked(default: Any, how: Ask) -> Any:
    """A field of settings that begins as `default`."""
    return field(default=default, metadata={"ask": how})


def asked_as(
    key: Key, default: Any, step: float = 1.0, decimals: int = 0, setup: str = "", **other: Any
) -> Any:
    """A field of settings that is asked for as a `key` of a file, but for what is `other` of it.

    It makes the field `setup` of a setup, if one is named.
    """
    key = replace(key, **other)
    how: Ask = Switch(key.label, key.tip)
    if key.choices:
        how = Choice(key.label, key.tip, key.choices)
    elif key.kind is not bool:
        shown = step, 1 / key.unit.scale, key.unit.shown, decimals
        how = Range(key.label, key.tip, *key.bounds, *shown)
    return field(default=default, metadata={"ask": how, "setup": setup})


def asked_of_setup(name: str, default: Any = None) -> Any:
    """A field of settings that makes the field `name` of a setup."""
    usual = getattr(Setup(), name) if default is None else default
    return asked_as(SETUP.key(name), usual, setup=name)


def setup_values(settings: Any, kind: type[Any]) -> dict[str, Any]:
    """The fields of a setup as the settings that belong to `kind` say them."""
    made = ((each.metadata.get("setup"), each.name) for each in fields(kind))
    return {field: getattr(settings, name) for field, name in made if field}


def settings_from(setup: Mapping[str, Any], kind: type[Any]) -> dict[str, Any]:
    """The settings that belong to `kind` as the fields of a `setup` say them."""
    made = ((each.metadata.get("setup"), each.name) for each in fields(kind))
    return {name: setup[field] for field, name in made if field}
