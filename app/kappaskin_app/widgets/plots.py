"""Plots: a logarithmic axis, and what an empty plot says."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QPainter

from kappaskin_app.theme import current

_ROUND = (1.0, 2.0, 5.0)
_FEW = 2.5  # decades, up to which 2 and 5 are written too


@dataclass(frozen=True)
class LogAxis:
    """From `least` to `most`, both above zero."""

    least: float
    most: float

    @classmethod
    def around(cls, values: Iterable[float]) -> "LogAxis":
        """Round limits beyond all `values` that are above zero and finite, with some room."""
        known = [value for value in values if 0 < value < math.inf]
        low, high = (min(known), max(known)) if known else (1.0, 10.0)
        return cls(_rounded(low / 1.15, down=True), _rounded(high * 1.15, down=False))

    def share(self, value: float) -> float:
        """How far along the axis a value is, from 0 to 1; at its ends what lies beyond."""
        if not value > 0:
            return 0.0
        along = math.log(value / self.least) / math.log(self.most / self.least)
        return min(max(along, 0.0), 1.0)

    def at(self, share: float) -> float:
        """The value that far along the axis."""
        return self.least * (self.most / self.least) ** share

    def ticks(self) -> list[tuple[float, bool]]:
        """Round values on the axis, and whether each is to be written."""
        every = math.log10(self.most / self.least) <= _FEW
        first, last = (math.floor(math.log10(end) + 1e-9) for end in (self.least, self.most))
        return [
            (value, every or digit == 1)
            for power in range(first, last + 1)
            for digit in _ROUND
            if self.least * (1 - 1e-9) <= (value := digit * 10.0**power) <= self.most * (1 + 1e-9)
        ]


def _rounded(value: float, down: bool) -> float:
    """The nearest of 1, 2, 5 times a power of ten below `value`, or above."""
    power = 10.0 ** math.floor(math.log10(value))
    if down:
        return max(d * power for d in _ROUND if d * power <= value * (1 + 1e-9))
    return min(d * power for d in (*_ROUND, 10.0) if d * power >= value * (1 - 1e-9))


def paint_empty(painter: QPainter, area: QRectF, text: str) -> None:
    """Write a text in the middle of a plot without values."""
    painter.setPen(QColor(current().faint))
    flags = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
    painter.drawText(area.adjusted(6, 2, -6, -2), flags, text)
