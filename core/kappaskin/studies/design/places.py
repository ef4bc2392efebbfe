"""What a file says, and the dotted place of one value in it, to the same with another value."""

import copy
import re
from itertools import pairwise
from typing import Any, cast

from kappaskin.errors import Refusal

_PART = re.compile(r"([\w-]+)(?:\[([1-9]\d{0,8})\])?")


def parts_of(place: str) -> list[str | int]:
    """The keys of a place such as touch[1].x, tables of an array counted from one there."""
    found = list[str | int]()
    for part in place.split("."):
        if not (match := _PART.fullmatch(part)):
            raise Refusal(
                f"expected a place in this file such as elements.grid or touch[1].x, got {place!r}"
            )
        found.append(match[1])
        if match[2]:
            found.append(int(match[2]) - 1)
    return found


def put(said: dict[str, Any], place: str, value: Any) -> None:
    """Have `said` say `value` at `place`; tables on the way there are made."""
    parts, at = parts_of(place), cast("Any", said)
    for part, following in pairwise(parts):
        at = _inside(at, part, place, isinstance(following, int))
    if isinstance(last := parts[-1], int):
        raise Refusal(f"expected the name of a value at the end of {place!r}")
    if not isinstance(at, dict):
        raise Refusal(f"expected a table around {place!r}, got {at!r:.60}")
    at[last] = value


def _inside(at: Any, part: str | int, place: str, array: bool) -> Any:
    """What stands at `part`, which may be an `array` of tables."""
    if isinstance(part, int):
        many = cast("list[Any]", at)
        if not part < len(many):
            raise Refusal(f"expected one of {len(many)} tables in {place!r}, got number {part + 1}")
        return many[part]
    if not isinstance(at, dict):
        raise Refusal(f"expected a table around {part!r} of {place!r}, got {at!r:.60}")
    found = cast("dict[str, Any]", at).setdefault(part, [] if array else {})
    if isinstance(found, list) != array:
        raise Refusal(
            f"expected {part}[1] or another number in {place!r}, for there are several"
            if isinstance(found, list)
            else f"expected no number after {part} in {place!r}, for there is one alone"
        )
    return found


def with_values(said: dict[str, Any], values: dict[str, Any]) -> dict[str, Any]:
    """A copy of `said` with these `values` at their places."""
    changed = copy.deepcopy(said)
    for place, value in values.items():
        put(changed, place, value)
    return changed
