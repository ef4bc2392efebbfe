"""Text: numbers with their errors, and names and messages from outside, made harmless."""

import json
import math
import re
import unicodedata
from typing import Any

# Unicode's categories of what is not seen: controls, formats (which turn the direction of writing,
# or take no room), surrogates, characters that are none, separators of lines and paragraphs.
_UNSEEN = ("Cc", "Cf", "Cs", "Cn", "Zl", "Zp")


def printable(text: str, keep: str = "") -> str:
    r"""The text with escapes such as \x1b for what cannot be seen, except characters in `keep`."""
    if text.isprintable():
        return text
    return "".join(
        c.encode("unicode_escape").decode()
        if unicodedata.category(c) in _UNSEEN and c not in keep
        else c
        for c in text
    )


NONE = "\N{EN DASH}"
"""What is shown where nothing is known."""
NO_FORCE = "edge: no force"
"""What is shown instead of the force of a contact near a held edge, which does not determine it."""
SNAPS = "snaps through: no force"
"""What is shown instead of the force where a curved skin snaps through."""
ONE_SIGMA = "\N{PLUS-MINUS SIGN}1 \u03c3"
"""The error bars of commands, files and messages: one standard deviation."""
_EXACT = 1e-9  # of a value, or of its unit: a smaller error is of rounding
_UNKNOWN = 1e9  # of the unit: a value or an error as large is no result


def rounded(value: float, error: float, digits: int = 3, sign: str = "") -> tuple[str, str]:
    """The texts of a value and of its error, which has two digits; both end at the same place.

    An error of nothing is "exact", an unknown one (NaN) is empty: then the value has so many
    decimal `digits`. Where the value is unknown, or its error infinite, it is a dash. The `sign` is
    "+" to show one always.
    """
    if not abs(value) < _UNKNOWN or error >= _UNKNOWN:
        return NONE, ""
    text = "" if math.isnan(error) else "exact"
    if error > _EXACT * max(1.0, abs(value)):
        # As it will be rounded: 0.0996 is 0.10.
        place = 1 - math.floor(math.log10(float(f"{error:.1e}")))
        value, digits = round(value, place), max(place, 0)
        text = f"{round(error, place):.{digits}f}"
    # Plus zero: no minus before a zero.
    return f"{round(value, digits) + 0.0:{sign}.{digits}f}".replace("-", "\N{MINUS SIGN}"), text


def with_error(
    value: float, error: float = math.nan, unit: str = "", digits: int = 3, sign: str = ""
) -> str:
    """A value with its error and unit, `rounded`: 0.1488 \N{PLUS-MINUS SIGN} 0.0010 N."""
    text, bar = rounded(value, error, digits, sign)
    if text == NONE:
        return NONE
    if bar in ("", "exact"):
        return " ".join(filter(None, (text, unit, bar)))
    return f"{text} \N{PLUS-MINUS SIGN} {bar} {unit}".rstrip()


_RUN = ("=", "+", "-", "@")  # with these begins what a spreadsheet runs


def cell(text: str) -> str:
    """The text for a cell of a table, which no spreadsheet runs: an apostrophe before a formula."""
    text = printable(text)
    return f"'{text}" if text.lstrip().startswith(_RUN) else text


_STRING = re.compile(r'"(?:[^"\\]|\\.)*"')
_BEGINS_CELL = re.compile(r'(?<=[,;"])(\s*)([=+@-])')


def json_cells(value: Any) -> str:
    """JSON of a value, in which no text runs where a spreadsheet cuts it into cells."""
    return _STRING.sub(
        lambda text: _BEGINS_CELL.sub(lambda sign: f"{sign[1]}\\u{ord(sign[2]):04x}", text[0]),
        json.dumps(value),
    )
