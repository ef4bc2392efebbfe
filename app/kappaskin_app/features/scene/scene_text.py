"""Edits of a scene's TOML text, which keep its comments and layout.

Each raises `Refusal` for a text that is not TOML, and KeyError or IndexError for a place that does
not exist.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AbstractTable, AoT, InlineTable, Table

from kappaskin.errors import Refusal
from kappaskin.scenes import PARTS

Place = tuple[str | int, ...]

ON, OFF, PLANNED = "on", "off", "planned"
_SIDE = 0.1  # m, side of the skin of the schema's examples


def parsed(text: str) -> Any:
    """The TOML document of a text; raises `Refusal` for invalid TOML."""
    try:
        return tomlkit.parse(text)
    except TOMLKitError as error:
        raise Refusal(
            f"expected a scene in TOML, got an error in it: {error}; correct the text first"
        ) from error


def put(text: str, place: Place, value: Any) -> str:
    """The text with another value at an existing `place`."""
    document = parsed(text)
    owner, key = _at(document, place[:-1]), place[-1]
    old = owner[key]
    if old == value:
        return text  # in its present notation
    if isinstance(value, list) and isinstance(old, list) and len(value) == len(old):
        for index, one in enumerate(value):
            if one != old[index]:
                old[index] = one
    else:
        owner[key] = value
    return tomlkit.dumps(document)


def put_in(text: str, place: Place, key: str, value: Any) -> str:
    """The text with `key` in the table at `place`, which is added if missing."""
    document = parsed(text)
    owner: Any = document
    for name in place:
        if isinstance(name, str) and name not in owner:
            owner[name] = _new(owner, is_super=name != place[-1])
        owner = owner[name]
    instead = PARTS[str(place[0])].instead_of(key) if place else set[str]()
    values = {name: one for name, one in owner.items() if name not in instead}
    _set(document, place, values | {key: value})
    return _tidy(text, document)


def _new(owner: Any, is_super: bool) -> Any:
    """A new table for `owner`, an inline one if that is inline."""
    if isinstance(owner, InlineTable):
        return tomlkit.inline_table()
    return tomlkit.table(is_super_table=is_super)


def remove(text: str, place: Place) -> str:
    """The text without the value at `place`, nor an array or table that becomes empty."""
    document = parsed(text)
    owner = _at(document, place[:-1])
    del owner[place[-1]]
    if not owner and isinstance(place[-1], int):
        del _at(document, place[:-2])[place[-2]]
    if place[0] == "effects":
        _unname(document, str(place[-1]))
    return _tidy(text, document)


def add_table(text: str, place: Place, values: dict[str, Any]) -> str:
    """The text with a table of `values` at `place`."""
    document = parsed(text)
    owner: Any = document
    for name in place[:-1]:
        if name not in owner:
            owner[name] = tomlkit.table(is_super_table=True)
        owner = owner[name]
    owner[str(place[-1])] = _item(values) if isinstance(owner, InlineTable) else _table(values)
    return _tidy(text, document)


def add_touch(text: str, kind: str) -> str:
    """The text with another touch of this `kind`, at the default relative position."""
    values = placed(PARTS["touch"].needed(kind), parsed(text).get("skin"))
    return _add(text, ("touch",), {"what": kind} | values)


def add_step(text: str, path: Place, kind: str) -> str:
    """The text with another step of this `kind` at the end of `path`.

    It precedes a last release: a path must end without contact.
    """
    many = _at(parsed(text), path)
    before = isinstance(many, list) and many and _lifts(many[-1]) and not _lifts({"step": kind})
    return _add(
        text, path, {"step": kind} | PARTS["step"].needed(kind), len(many) - 1 if before else None
    )


def _lifts(step: Any) -> bool:
    return isinstance(step, Mapping) and step.get("step") in ("release", "tap")


def change_kind(text: str, place: Place, part: str, kind: str) -> str:
    """The text with another `kind` at `place`, the key that defines the kind of a `part`.

    Keys unknown to the new kind are removed, its required ones added, all others unchanged.
    """
    document = parsed(text)
    at, key = place[:-1], str(place[-1])
    owner = _at(document, at)
    may = PARTS[part].known(kind)
    values = {
        name: value
        for name, value in owner.items()
        if name == key or (name in may and _alike(_plain(value), may[name]))
    }
    more = PARTS[part].missing(kind, values)
    if part == "touch":
        more = placed(more, document.get("skin"))
    _set(document, at, values | {key: kind} | more)
    return _tidy(text, document)


def _alike(value: Any, other: Any) -> bool:
    """Whether two values have the same kind of editor."""
    numbers = [isinstance(one, int | float) and not isinstance(one, bool) for one in (value, other)]
    return all(numbers) or (not any(numbers) and type(value) is type(other))


def forced(text: str, effect: str, how: str) -> str:
    """The text with an effect forced `ON` or `OFF`, or `PLANNED`: selected by the plan.

    Where the text lists the effects (`choose`), it is added to the list or removed.
    """
    document = parsed(text)
    if "effects" not in document:
        document["effects"] = tomlkit.table()
    table = document["effects"]
    if isinstance(table.get("choose"), list):
        _name(table, "choose", effect, how == ON)
    else:
        for key in (ON, OFF):
            _name(table, key, effect, how == key)
    return tomlkit.dumps(document)


def _name(table: Any, key: str, effect: str, there: bool) -> None:
    """Add the effect to the list at `key` or remove it, and an empty list except `choose`."""
    names = [one for one in table.get(key, ()) if one != effect] + [effect] * there
    if names or key == "choose":
        table[key] = names
    elif key in table:
        del table[key]


def _at(document: Any, place: Place) -> Any:
    for name in place:
        document = document[name]
    return document


def _plain(value: Any) -> Any:
    return value.unwrap() if hasattr(value, "unwrap") else value


def _set(document: Any, place: Place, values: dict[str, Any]) -> None:
    """Set the values of the table at `place`, which keeps its order."""
    owner = _at(document, place)
    if isinstance(owner, InlineTable):  # replaced, or a space is missing after a comma
        _at(document, place[:-1])[place[-1]] = _item({k: _plain(v) for k, v in values.items()})
        return
    for key in list(owner):
        if key not in values:
            del owner[key]
    for key, value in values.items():
        if key not in owner or owner[key] != value:
            owner[key] = _item(value)


def _add(text: str, place: Place, values: dict[str, Any], index: int | None = None) -> str:
    """The text with another table in the array at `place`, at its end or at `index`."""
    document = parsed(text)
    owner = _at(document, place[:-1])
    if place[-1] not in owner:
        owner.append(place[-1], tomlkit.aot())
    many = owner[place[-1]]
    if isinstance(many, AbstractTable):  # a single table is read as an array of one
        first = many.unwrap()
        del owner[place[-1]]
        many = owner[place[-1]] = tomlkit.aot()
        many.append(_table(first))
    many.insert(
        len(many) if index is None else index,
        _table(values) if isinstance(many, AoT) else _item(values),
    )
    return _tidy(text, document)


def _table(values: Mapping[str, Any]) -> Table:
    table = tomlkit.table()
    for key, value in values.items():
        table[key] = _item(value)
    return table


def _item(value: Any) -> Any:
    """A value in the notation of scenes: inline tables, arrays of tables on several lines."""
    return tomlkit.parse(f"value = {_written(value)}\n")["value"]


def _written(value: Any) -> str:
    if isinstance(value, Mapping):
        inside = ", ".join(
            f"{tomlkit.key(k).as_string()} = {_written(v)}" for k, v in value.items()
        )
        return f"{{ {inside} }}"
    if isinstance(value, list) and any(isinstance(one, Mapping) for one in value):
        return "[\n" + "".join(f"    {_written(one)},\n" for one in value) + "]"
    return tomlkit.item(_plain(value)).as_string()


def _unname(document: Any, effect: str) -> None:
    """Remove a deleted effect from the lists of names."""
    values = document.get("effects", {})
    for key in ("choose", "on", "off"):
        if isinstance(named := values.get(key), list) and effect in named:
            named.remove(effect)


def _tidy(text: str, document: Any) -> str:
    """The document's text with an empty line before each heading that moved against `text`."""
    before = set(pairwise(text.splitlines()))
    lines = tomlkit.dumps(document).rstrip("\n").splitlines()
    tidy = lines[:1]
    for last, line in pairwise(lines):
        crowded = line.startswith("[") and last.strip() and not last.startswith("#")
        if crowded and (last, line) not in before:
            tidy.append("")
        elif not line.strip() and not last.strip() and (last, line) not in before:
            continue
        tidy.append(line)
    return "\n".join(tidy) + "\n"


# Positions of touches


def placed(values: dict[str, Any], skin: Any) -> dict[str, Any]:
    """The `values` of a touch, its positions scaled to the `skin`."""
    sides = _sides(skin)
    return {
        key: float(f"{value * sides[key[0] == 'y'] / _SIDE:.4g}") if key[0] in "xy" else value
        for key, value in values.items()
    }


def _sides(skin: Any) -> tuple[float, float]:
    """Lengths of the skin in m along x and y; the default where the text does not define them."""
    values = skin if isinstance(skin, Mapping) else {}
    corners = values.get("outline")
    if isinstance(radius := values.get("rim_radius"), int | float):
        sides: Any = (2 * radius, 2 * radius)
    elif isinstance(corners, list) and corners and all(isinstance(c, Sequence) for c in corners):
        sides = [max((c[axis] for c in corners if len(c) == 2), default=0) for axis in (0, 1)]
    else:
        sides = values.get("size")
    usable = isinstance(sides, Sequence) and len(sides) == 2
    if not (usable and all(isinstance(a, int | float) and 0 < a < 1e3 for a in sides)):
        return _SIDE, _SIDE
    return sides[0], sides[1]


def shifted(text: str, touch: int, dx: float, dy: float) -> str:
    """The text with a touch, counted from zero, moved by (dx, dy) in m, to a micrometre, at rest.

    Raises `Refusal` for a text that is no TOML, or has no such touch.
    """
    document = parsed(text)
    values = _touch(document, touch)
    for key, by in (("x", dx), ("y", dy), ("x0", dx), ("y0", dy), ("x1", dx), ("y1", dy)):
        if key in values:
            values[key] = round(float(values[key]) + by, 6)
    for motion in ("orbit", "path", "recorded"):
        values.pop(motion, None)
    return tomlkit.dumps(document)


def scaled(text: str, touch: int, times: float) -> str:
    """The text with `times` the force or depth of a touch, counted from zero.

    Raises `Refusal` for a text that is no TOML, or has no such touch.
    """
    document = parsed(text)
    values = _touch(document, touch)
    for key in ("force", "depth", "displacement"):
        if key in values:
            values[key] = float(f"{float(values[key]) * times:.4g}")
    return tomlkit.dumps(document)


def replaced(text: str, touch: int, values: Mapping[str, Any]) -> str:
    """The text with the `values` instead of those of a touch, counted from zero.

    Raises `Refusal` for a text that is no TOML, or has no such touch.
    """
    document = parsed(text)
    table = _touch(document, touch)
    for key in list(table):
        del table[key]
    for key, value in values.items():
        table[key] = value
    return tomlkit.dumps(document)


def named(text: str) -> list[tuple[Place, str]]:
    """The files that a scene names, each with its place; raises `Refusal` for invalid TOML."""
    document = parsed(text)
    many = document.get("touch", ())
    each = {("touch",): many} if isinstance(many, Mapping) else {}
    each |= {("touch", n): one for n, one in enumerate(many)} if not each else {}
    each[("skin",)] = document.get("skin")
    return [
        ((*place, key), str(one[key]))
        for place, one in each.items()
        for key in ("file", "recorded")
        if isinstance(one, Mapping) and isinstance(one.get(key), str)
    ]


def _touch(document: Any, touch: int) -> Any:
    many = document.get("touch", ())
    each = [many] if isinstance(many, AbstractTable) else many  # a single table is an array of one
    if not touch < len(each):
        raise Refusal(f"expected a scene with touch {touch + 1}, got one with {len(each)} touches")
    return each[touch]
