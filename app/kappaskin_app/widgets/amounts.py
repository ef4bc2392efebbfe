"""Lengths, times and dates in the unit that people read them in."""

import math
import re
from datetime import datetime

NONE = "\N{EN DASH}"
COMMAND = re.compile("`([^`]+)`")
"""What a message tells to type."""
_LENGTHS = ((1e-6, 1e-3, "mm"), (1e-9, 1e-6, "\N{MICRO SIGN}m"), (0.0, 1e-9, "nm"))
_TIMES = ((1.0, 1.0, "s"), (1e-3, 1e-3, "ms"), (0.0, 1e-6, "\N{MICRO SIGN}s"))


def length(metres: float) -> str:
    """Two digits and the unit; a dash for what is not known."""
    return _said(metres, _LENGTHS)


def duration(seconds: float) -> str:
    """Two digits and the unit; a dash for what is not known."""
    return _said(seconds, _TIMES)


def _said(value: float, units: tuple[tuple[float, float, str], ...]) -> str:
    if not math.isfinite(value):
        return NONE
    # As it will be rounded: 999.7 us are 1 ms.
    value = float(f"{value:.1e}")
    scale, unit = next((scale, unit) for least, scale, unit in units if value >= least * 0.999999)
    shown = value / scale
    digits = max(0, 1 - math.floor(math.log10(shown))) if shown > 0 else 0
    return f"{shown:.{digits}f} {unit}"


def day(time: float) -> str:
    """A time in s since 1970 to the minute."""
    return f"{datetime.fromtimestamp(time):%Y-%m-%d %H:%M}"
