"""Number boxes: values in the unit of the screen, with the digits that they need."""

import math
import re
from decimal import Decimal
from typing import Any

from PySide6.QtCore import QLocale

from kappaskin.scenes import Key, Unit
from kappaskin_app.features.scene.scene_form.kinds import MOST, MOST_WHOLE
from kappaskin_app.shell.form import RealBox, WholeBox

_DIGITS = 6  # of a number that are shown


def shown(value: float, unit: Unit) -> str:
    """A value in the unit that it is shown in, with as few digits as it needs."""
    text = f"{value / unit.scale:.{_DIGITS}g}"
    plain = f"{Decimal(text):f}" if "e" in text else text
    return "0" if float(plain) == 0 else plain


def meant(number: float, unit: Unit) -> float:
    """The value that a number shown stands for, without the rounding of its scale."""
    return float(f"{number * unit.scale:.10g}")


def read_numbers(text: str, before: list[Any], unit: Unit, whole: bool) -> list[Any]:
    """The numbers of a text; those that read as before are as before, to the last digit."""
    befores = [*before, *([None] * len(text))]
    found = list[Any]()
    for word, old in zip(filter(None, re.split(r"[,;\s]+", text)), befores, strict=False):
        if old is not None and word == shown(old, unit):
            found.append(old)
        else:
            number = float(word)
            found.append(int(number) if whole and number.is_integer() else meant(number, unit))
    if not all(map(math.isfinite, found)):
        raise ValueError("expected finite numbers")
    return found


class NumberBox(RealBox):
    """A number with as few digits as it needs, whose steps are as large as it is."""

    def __init__(self, key: Key, usual: Any) -> None:
        super().__init__()
        self._unit = unit = key.unit
        size = abs(usual / unit.scale) if isinstance(usual, int | float) and usual else 1.0
        self._step = _tenth(size)
        self.setLocale(QLocale.c())
        self.setDecimals(12)
        self.setRange(*(min(max(end / unit.scale, -MOST), MOST) for end in key.bounds))

    def show_value(self, value: float) -> None:
        """Show a value, in the unit that it is asked for in; one out of the range as well."""
        at = float(shown(value, self._unit))
        self.setRange(min(self.minimum(), at), max(self.maximum(), at))
        self.setValue(at)

    def textFromValue(self, value: float) -> str:
        return shown(value * self._unit.scale, self._unit)

    def stepBy(self, steps: int) -> None:
        value = self.value()
        # Seen from where it goes: below 10 steps are those of 9.
        size = abs(value) * (1 - 1e-9 * math.copysign(1, -value * steps))
        step = max(_tenth(size), self._step / 10) if value else self._step
        self.setValue(float(f"{value + steps * step:.10g}"))


def _tenth(size: float) -> float:
    return 10.0 ** (math.floor(math.log10(size)) - 1)


class WholeNumberBox(WholeBox):
    """A whole number."""

    def __init__(self, key: Key) -> None:
        super().__init__()
        low, high = (min(max(end, -MOST_WHOLE), MOST_WHOLE) for end in key.bounds)
        self.setRange(int(low), int(high))

    def show_value(self, value: int) -> None:
        """Show a value; one out of the range as well."""
        self.setRange(min(self.minimum(), value), max(self.maximum(), value))
        self.setValue(value)
