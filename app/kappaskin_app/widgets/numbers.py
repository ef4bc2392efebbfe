"""Round numbers for limits and scales, and the digits that they are written with."""

import math


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
