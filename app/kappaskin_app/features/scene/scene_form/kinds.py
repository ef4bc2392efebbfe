"""Which kind of editor edits a value."""

import math
from typing import Any

from kappaskin.scenes import Key

MOST_WHOLE = 2**31 - 1  # that a box for whole numbers can hold
MOST = 1e12  # of any number shown in a box


def kind_of(value: Any, key: Key) -> str:
    """By what a value is edited of which `key` declares what it may be.

    That is a choice, text, literal, switch, number, whole, numbers, wholes or pairs; or a count of
    numbers or whole ones, as in "2 number".
    """
    if isinstance(value, str):
        plain = "literal" if "\n" in value else "text"
        return "choice" if key.choices else plain
    if isinstance(value, bool):
        return "switch"
    if isinstance(value, list):
        return _kind_of_list(value, key)
    return _kind_of_number(value, key.real) if _is_number(value) else "literal"


def _is_number(value: Any) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and math.isfinite(value)


def _kind_of_number(value: float, real: bool) -> str:
    if isinstance(value, int) and not real:
        return "whole" if abs(value) <= MOST_WHOLE else "literal"
    return "number" if abs(value) <= MOST else "literal"


def _kind_of_list(value: list[Any], key: Key) -> str:
    """That of its numbers with their count, unless they are many, or their number may change."""
    if value and all(isinstance(one, list) and all(map(_is_number, one)) for one in value):
        return "pairs"
    if not all(map(_is_number, value)):
        return "literal"
    if key.listed or len(value) not in (2, 3):
        return "numbers" if key.real else "wholes"
    each = {_kind_of_number(one, key.real) for one in value}
    return f"{len(value)} {each.pop()}" if len(each) == 1 else "numbers"
