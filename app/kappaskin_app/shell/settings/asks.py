"""How a setting is asked for: its words, unit, range and explanation, as every form shows them."""

from dataclasses import dataclass, field
from typing import Any

MILLIMETRES = (1e3, "mm")
PER_METRE = (1.0, "1/m")


@dataclass(frozen=True)
class Range:
    """How a number is asked for: screen value = SI value times `scale`, in `unit`."""

    label: str
    tip: str
    least: float
    most: float
    step: float
    scale: float = 1.0
    unit: str = ""
    decimals: int = 0


@dataclass(frozen=True)
class Choice:
    """How one of several values is asked for: (value, words) pairs."""

    label: str
    tip: str
    options: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Several:
    """How some of several values are asked for, in their order: (value, words) pairs."""

    label: str
    tip: str
    options: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Switch:
    """How yes or no is asked for."""

    label: str
    tip: str


@dataclass(frozen=True)
class Text:
    """How a line of text is asked for."""

    label: str
    tip: str


Ask = Range | Choice | Several | Switch | Text


def asked(default: Any, how: Ask) -> Any:
    """A field of settings that begins as `default`."""
    return field(default=default, metadata={"ask": how})
