"""Numbers, error bars, lengths, times and dates as text."""

import math
import re
from dataclasses import dataclass
from datetime import datetime
from typing import Any, ClassVar

from kappaskin._text import NONE, ONE_SIGMA

COMMAND = re.compile("`([^`]+)`")
"""A command in a message."""
_LENGTHS = ((0.0, 1e-3, "mm"),)
_MOST_DIGITS = 7  # after the point: a tenth of a nanometre in mm
_TIMES = ((120.0, 60.0, "min"), (1.0, 1.0, "s"), (1e-3, 1e-3, "ms"), (0.0, 1e-6, "\N{MICRO SIGN}s"))


_NORMAL_95 = 1.96  # standard deviations in the half width of a 95 % interval


@dataclass(frozen=True)
class Coverage:
    """What an error bar covers: so many standard deviations; `now` is that of all views."""

    label: str
    title: str
    times: float

    now: ClassVar["Coverage"]

    def of(self, sd: Any, half_width: float = math.nan) -> Any:
        """The error bar of a standard deviation, or of an array of them.

        A known `half_width` of the 95 % interval, as Student's t gives it, is its own error bar.
        """
        return self.times * sd if self.times == 1 or math.isnan(half_width) else half_width

    def of_half_width(self, half_width: float) -> float:
        """The error bar of what has only the half width of a 95 % interval."""
        return half_width * self.times / _NORMAL_95


ERROR_BARS = {
    "sigma": Coverage(ONE_SIGMA, f"{ONE_SIGMA} (68 %)", 1.0),
    "95": Coverage("95 %", "95 %", _NORMAL_95),
}
"""The error bars that may be shown, by the value of the setting."""
Coverage.now = ERROR_BARS["sigma"]


def length(metres: float) -> str:
    """Two digits and the unit; a dash for what is not known."""
    return _with_unit(metres, _LENGTHS)


def duration(seconds: float) -> str:
    """Two digits and the unit; a dash for what is not known."""
    return _with_unit(seconds, _TIMES)


def _with_unit(value: float, units: tuple[tuple[float, float, str], ...]) -> str:
    if not math.isfinite(value):
        return NONE
    # As it will be rounded: 999.7 us are 1 ms.
    value = float(f"{value:.1e}")
    scale, unit = next((scale, unit) for least, scale, unit in units if value >= least * 0.999999)
    shown = value / scale
    digits = max(0, 1 - math.floor(math.log10(shown))) if shown > 0 else 0
    return f"{shown:.{min(digits, _MOST_DIGITS)}f} {unit}"


def elapsed(seconds: float) -> str:
    """A time as m:ss, or h:mm:ss from an hour on."""
    hours, rest = divmod(int(seconds), 3600)
    return f"{hours}:{rest // 60:02d}:{rest % 60:02d}" if hours else f"{rest // 60}:{rest % 60:02d}"


def file_size(count: int) -> str:
    """A number of bytes in few digits."""
    for one, unit in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if count >= one:
            return f"{count / one:.1f} {unit}"
    return f"{count} B"


def day(time: float) -> str:
    """A time in s since 1970 to the minute."""
    return f"{datetime.fromtimestamp(time):%Y-%m-%d %H:%M}"


def round_up(value: float) -> float:
    """The least of 1, 1.5, 2, 3, 5, 7 times a power of ten that is at least `value`."""
    if not value > 0:
        return 0.0
    power = 10.0 ** math.floor(math.log10(value))
    return next(m * power for m in (1, 1.5, 2, 3, 5, 7, 10) if m * power >= value * (1 - 1e-12))


def in_digits(value: float, span: float) -> str:
    """A number of a scale, with the digits that tell it from another a hundredth of `span` off."""
    if not span > 0:
        return f"{value:.3g}".replace("-", "\N{MINUS SIGN}")
    rounded = round(value, max(0, 2 - math.floor(math.log10(span)))) + 0.0  # no minus before a zero
    return f"{rounded:g}".replace("-", "\N{MINUS SIGN}")
