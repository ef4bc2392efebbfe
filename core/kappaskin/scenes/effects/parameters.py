"""The numbers that effects are told by: their ranges and units, and the refusal of others."""

import math
from dataclasses import dataclass, fields
from functools import cache
from numbers import Integral, Real
from typing import Any, get_type_hints

from kappaskin.errors import Refusal


@dataclass(frozen=True)
class Within:
    """Finite numbers from `least` to `most` in `unit`; only `whole` ones if it says so.

    It annotates a field: `rise: Annotated[float, Within(-200, 200, "K")]`.
    """

    least: float
    most: float = math.inf
    unit: str = ""
    whole: bool = False

    def __contains__(self, value: object) -> bool:
        if isinstance(value, bool) or not isinstance(value, Integral if self.whole else Real):
            return False
        try:
            number = float(value)
        except OverflowError:
            return False
        return math.isfinite(number) and self.least <= number <= self.most

    def __str__(self) -> str:
        upward = math.isinf(self.most)
        text = f"at least {self.least:g}" if upward else f"{self.least:g} to {self.most:g}"
        return f"{text} {self.unit}".rstrip() + (", a whole number" if self.whole else "")


@cache
def parameters(effect: type[Any]) -> dict[str, Within]:
    """What each number that tells an effect of this class must be within, by its name."""
    hints = get_type_hints(effect, include_extras=True)
    return {
        field.name: note
        for field in fields(effect)
        for note in getattr(hints[field.name], "__metadata__", ())
        if isinstance(note, Within)
    }


def check(name: str, effect: object) -> None:
    """Refuse an `effect`, called `name`, that is told by a number out of its range."""
    for parameter, within in parameters(type(effect)).items():
        value = getattr(effect, parameter)
        if value not in within:
            raise Refusal(f"expected {name} with {parameter} of {within}, got {value!r:.80}")
