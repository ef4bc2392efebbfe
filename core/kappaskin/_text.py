"""Text from outside: names, notes and messages, made harmless where they leave the program."""

import json
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
