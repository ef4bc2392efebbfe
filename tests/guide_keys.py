"""The tables of what a scene, a setup and a sensor's description say, from their schemas.

Run `python tests/guide_keys.py` when a key came, went or changed.
"""

import math
from dataclasses import replace
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin

from kappaskin._schema import Key, Part
from kappaskin._toml import REQUIRED
from kappaskin.pipeline import SETUP
from kappaskin.scenes import PARTS
from kappaskin.sources.description import LINE, READINGS, TOP
from kappaskin.sources.information import SENSOR

_PAGES = Path(__file__).parents[1] / "resources" / "kappaskin_resources"
PAGE = _PAGES / "guide" / "scenes.md"
OWN = _PAGES / "guide" / "own-sensor.md"
OTHERS = {_PAGES / "recording" / "recording.md": SETUP, _PAGES / "wire" / "wire.md": SENSOR}
"""Pages that have one table, with what it is of."""
HEADING = "## Every key"
_OPENING = """
Lengths in a file are in metres, whatever unit the window shows. A key without a default is
required, or its alternative: a force or a displacement, a force or a depth.
"""
_PLACES = {
    "scene": "At the top",
    "skin": "`[skin]`",
    "elements": "`[elements]`",
    "readings": "`[readings]`, or `[readings.height]` ...",
    "electronics": "`[electronics]`",
    "bridge": "`[electronics.bridge]`",
    "multiplexer": "`[electronics.multiplexer]`",
    "amplifier": "`[electronics.amplifier]`",
    "converter": "`[electronics.converter]`",
    "touch": "`[[touch]]`, by `what`",
    "orbit": "`orbit` of a touch",
    "step": "Each of the `path` of a touch, by `step`",
    "cylinders": "`[cylinders]`",
    "effects": "`[effects]`",
}
_OWN_OPENING = """
`[skin]` and `[elements]` have the keys of a [scene](scenes.md#every-key).
"""
_OWN_PLACES = {
    "At the top": TOP,
    "`[line]`": LINE,
    "`[readings]`, or `[readings.height]` ...": READINGS,
}
_WORDS = {float: "number", int: "whole number", str: "text", bool: "true or false"}


def told() -> str:
    """The last section of the page."""
    tables = [f"{HEADING}\n{_OPENING}"]
    for part, place in _PLACES.items():
        tables.append(f"### {place}\n\n{_table(PARTS[part])}")
        if part == "effects":
            named = _table(PARTS[part], of_kinds=True)
            tables.append(f"### `[effects.NAME]`, by its name\n\n{named}")
    return "\n".join(tables)


def told_of_own() -> str:
    """The last section of the page on sensors of one's own."""
    tables = [f"### {place}\n\n{_table(part)}" for place, part in _OWN_PLACES.items()]
    return "\n".join([f"{HEADING}\n{_OWN_OPENING}", *tables])


def told_of(page: Path) -> str:
    """A page that has one table, with that as it is to be."""
    text = page.read_text(encoding="utf-8")
    before, _, rest = text.partition("\n| key |")
    after = rest.partition("\n\n")[2]
    return f"{before}\n{_table(OTHERS[page])}\n{after}"


def _table(part: Part, of_kinds: bool = False) -> str:
    """The keys of a part: those that it has of no kind, or of all kinds, too."""
    rows: dict[tuple[str, ...], list[str]] = {}
    of_some = {key for kind in part.kinds for key in _known(part, kind)}
    for key, declared in part.keys.items():
        if not of_kinds and (key not in of_some or not declared.offered):
            rows[_row(key, part.key(key))] = []
    if of_kinds or part is not PARTS["effects"]:
        for kind in part.kinds:
            for key in _known(part, kind):
                declared = part.key(key, kind)
                if key in part.kinds[kind].needs and declared.default == math.inf:
                    declared = replace(declared, default=REQUIRED)
                rows.setdefault(_row(key, declared), []).append(kind)
    there = any(rows.values())
    head = ("key", *(("of",) if there else ()), "value", "unit", "default", "meaning")
    lines = [_line(head), "|---" * len(head) + "|"]
    for row, kinds in rows.items():
        of = (_of(kinds, list(part.kinds)),) if there else ()
        lines.append(_line((row[0], *of, *row[1:])))
    return "\n".join(lines) + "\n"


def _known(part: Part, kind: str) -> list[str]:
    """The keys that a kind of a part has of its own, or shares with some others."""
    of = part.kinds[kind]
    return list(dict.fromkeys([*of.needs, *of.may, *of.keys]))


def _of(kinds: list[str], every: list[str]) -> str:
    """Which kinds have a key: all, all but a few, or some."""
    others = [kind for kind in every if kind not in kinds]
    if not kinds or not others:
        return "all"
    if len(others) < 3 < len(kinds):
        return "all but " + ", ".join(f"`{kind}`" for kind in others)
    return ", ".join(f"`{kind}`" for kind in kinds)


def _row(name: str, key: Key) -> tuple[str, ...]:
    return f"`{name}`", _value(key), key.unit.name, _default(key.default), f"{key.label}. {key.tip}"


def _value(key: Key) -> str:
    """Of what kind a value is, among which or within what range."""
    if key.choices:
        return ", ".join(f"`{name}`" if name else "empty" for name, _ in key.choices)
    if key.kind is None:
        return "steps" if isinstance(key.example, list) else "table"
    bounds = (key.limits.least, key.limits.most) if key.limits else key.bounds
    low, high = (f"{bound:.6g}" for bound in bounds)
    least = "" if low == "-inf" else f", at least {low}"
    within = least if high == "inf" else f", {low} to {high}"
    if key.limits is not None and key.limits.or_zero:
        within = f", 0 or {low} to {high}"
    return _kind(key.kind) + within


def _kind(kind: Any) -> str:
    if isinstance(kind, UnionType):
        return " or ".join(_kind(one) for one in get_args(kind) if one is not type(None))
    if get_origin(kind) is not tuple:
        return _WORDS[kind]
    first, *others = get_args(kind)
    if len(others) == 2:
        return f"three {_kind(first)}s"
    if others != [...]:
        return f"pair of {_kind(first)}s"
    return "list of pairs" if get_origin(first) is tuple else f"list of {_kind(first)}s"


def _default(default: Any) -> str:
    match default:
        case None | () | "":
            return "none"
        case tuple():
            return f"`{list(default)}`"
        case bool():
            return f"`{str(default).lower()}`"
        case float() | int():
            return f"{default:.6g}"
        case str():
            return f"`{default}`"
        case _:
            return ""


def _line(cells: tuple[str, ...]) -> str:
    return f"| {' | '.join(cells)} |".replace("  ", " ")


if __name__ == "__main__":
    for page, section in ((PAGE, told()), (OWN, told_of_own())):
        text = page.read_text(encoding="utf-8").partition(HEADING)[0].rstrip()
        page.write_text(f"{text}\n\n{section}", encoding="utf-8", newline="\n")
    for other in OTHERS:
        other.write_text(told_of(other), encoding="utf-8", newline="\n")
