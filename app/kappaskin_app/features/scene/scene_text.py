"""Edits of a scene's text: values, tables, effects, places; the rest stays as written.

Each raises `Refusal` for a text that is no TOML, and KeyError or IndexError for a place that there
is not.
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
_SIDE = 0.1  # m of the skin that the schema's examples have their places on


def parsed(text: str) -> Any:
    """The TOML document that can be changed and written again; raises `Refusal` for no TOML."""
    try:
        return tomlkit.parse(text)
    except TOMLKitError as error:
        raise Refusal(
            f"expected a scene in TOML to change, got a mistake in it: {error}; mend its text first"
        ) from error


def put(text: str, place: Place, value: Any) -> str:
    """The text with another value at `place`, where there is one."""
    document = parsed(text)
    owner, key = _at(document, place[:-1]), place[-1]
    old = owner[key]
    if old == value:
        return text  # however it is written
    if isinstance(value, list) and isinstance(old, list) and len(value) == len(old):
        for index, one in enumerate(value):
            if one != old[index]:
                old[index] = one
    else:
        owner[key] = value
    return tomlkit.dumps(document)


def put_in(text: str, place: Place, key: str, value: Any) -> str:
    """The text with `key` in the table at `place`, which is made when there is none."""
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
    """A table to put into `owner`: into its line, if it stands in one."""
    if isinstance(owner, InlineTable):
        return tomlkit.inline_table()
    return tomlkit.table(is_super_table=is_super)


def remove(text: str, place: Place) -> str:
    """The text without what stands at `place`, nor the array or table that this leaves empty."""
    document = parsed(text)
    owner = _at(document, place[:-1])
    del owner[place[-1]]
    if not owner and isinstance(place[-1], int):
        del _at(document, place[:-2])[place[-2]]
    if place[0] == "effects":
        _unname(document, str(place[-1]))
    return _tidy(text, document)


def add_table(text: str, place: Place, values: dict[str, Any]) -> str:
    """The text with the table at `place` that says this."""
    document = parsed(text)
    owner: Any = document
    for name in place[:-1]:
        if name not in owner:
            owner[name] = tomlkit.table(is_super_table=True)
        owner = owner[name]
    owner[str(place[-1])] = _item(values) if isinstance(owner, InlineTable) else _table(values)
    return _tidy(text, document)


def add_touch(text: str, kind: str) -> str:
    """The text with one more touch of this kind, at a like place of the skin that is there."""
    values = placed(PARTS["touch"].needed(kind), parsed(text).get("skin"))
    return _add(text, ("touch",), {"what": kind} | values)


def add_step(text: str, path: Place, kind: str) -> str:
    """The text with one more step of this kind at the end of `path`.

    It comes before a last release: a path has to end lifted.
    """
    many = _at(parsed(text), path)
    before = isinstance(many, list) and many and _lifts(many[-1]) and not _lifts({"step": kind})
    return _add(
        text, path, {"step": kind} | PARTS["step"].needed(kind), len(many) - 1 if before else None
    )


def _lifts(step: Any) -> bool:
    return isinstance(step, Mapping) and step.get("step") in ("release", "tap")


def change_kind(text: str, place: Place, part: str, kind: str) -> str:
    """The text with the key at `place`, by which a `part` is of a kind, naming another one.

    What that kind does not know goes, what it needs comes, all else is kept.
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
    """Whether two values are of a kind, as far as a form is concerned."""
    numbers = [isinstance(one, int | float) and not isinstance(one, bool) for one in (value, other)]
    return all(numbers) or (not any(numbers) and type(value) is type(other))


def forced(text: str, effect: str, how: str) -> str:
    """The text with an effect forced `ON` or `OFF`, or `PLANNED`: left to the plan.

    Where the text lists the effects that there are, it is in that list or not.
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
    """Have the list at `key` name the effect, or not; an empty one goes unless it chooses all."""
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
    """Make the table at `place` say this, in the order that it has."""
    owner = _at(document, place)
    if isinstance(owner, InlineTable):  # made anew, or its last comma stands without a space
        _at(document, place[:-1])[place[-1]] = _item({k: _plain(v) for k, v in values.items()})
        return
    for key in list(owner):
        if key not in values:
            del owner[key]
    for key, value in values.items():
        if key not in owner or owner[key] != value:
            owner[key] = _item(value)


def _add(text: str, place: Place, values: dict[str, Any], index: int | None = None) -> str:
    """The text with one more table in the array at `place`, at its end or at `index`."""
    document = parsed(text)
    owner = _at(document, place[:-1])
    if place[-1] not in owner:
        owner.append(place[-1], tomlkit.aot())
    many = owner[place[-1]]
    if isinstance(many, AbstractTable):  # one table, which a reader takes for an array of one
        kept = many.unwrap()
        del owner[place[-1]]
        many = owner[place[-1]] = tomlkit.aot()
        many.append(_table(kept))
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
    """The value as parts of a scene are written: tables in a line, arrays of them in several."""
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
    """Name an effect no longer that is not there any more."""
    values = document.get("effects", {})
    for key in ("choose", "on", "off"):
        if isinstance(named := values.get(key), list) and effect in named:
            named.remove(effect)


def _tidy(text: str, document: Any) -> str:
    """An empty line before each heading that has another line before it than it had in `text`."""
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


# Places of touches


def placed(values: dict[str, Any], skin: Any) -> dict[str, Any]:
    """The `values` of a touch, its places moved to where they are on the skin that there is."""
    sides = _sides(skin)
    return {
        key: float(f"{value * sides[key[0] == 'y'] / _SIDE:.4g}") if key[0] in "xy" else value
        for key, value in values.items()
    }


def _sides(skin: Any) -> tuple[float, float]:
    """Lengths of the skin in m along x and y, as far as the text tells them."""
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
    """The text with a touch, counted from zero, moved by (dx, dy) in m, to a micrometre.

    Raises `Refusal` for a text that is no TOML, or has no such touch.
    """
    document = parsed(text)
    values = _touch(document, touch)
    for key, by in (("x", dx), ("y", dy), ("x0", dx), ("y0", dy), ("x1", dx), ("y1", dy)):
        if key in values:
            values[key] = round(float(values[key]) + by, 6)
    return tomlkit.dumps(document)


def pressed(text: str, touch: int, times: float) -> str:
    """The text with a touch, counted from zero, pressing so many `times` as hard.

    Raises `Refusal` for a text that is no TOML, or has no such touch.
    """
    document = parsed(text)
    values = _touch(document, touch)
    for key in ("force", "depth", "displacement"):
        if key in values:
            values[key] = float(f"{float(values[key]) * times:.4g}")
    return tomlkit.dumps(document)


def instead(text: str, touch: int, values: Mapping[str, Any]) -> str:
    """The text with a touch, counted from zero, that says this and nothing else.

    Raises `Refusal` for a text that is no TOML, or has no such touch.
    """
    document = parsed(text)
    table = _touch(document, touch)
    for key in list(table):
        del table[key]
    for key, value in values.items():
        table[key] = value
    return tomlkit.dumps(document)


def _touch(document: Any, touch: int) -> Any:
    many = document.get("touch", ())
    each = [many] if isinstance(many, AbstractTable) else many  # one by itself is an array of one
    if not touch < len(each):
        raise Refusal(f"expected a touch {touch + 1} to change, got a text with {len(each)}")
    return each[touch]
