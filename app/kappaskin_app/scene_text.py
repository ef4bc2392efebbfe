"""The text of a scene to the text of one a little different; comments and order stay."""

from typing import Any

import tomlkit

ON, OFF, PLANNED = "on", "off", "planned"


def forced(text: str, effect: str, how: str) -> str:
    """The scene with an effect forced on or off, or left to the plan; where it lists, in the list.

    Raises tomlkit's `ParseError` for a text that is no TOML.
    """
    document: Any = tomlkit.parse(text)
    if "effects" not in document:
        document["effects"] = tomlkit.table()
    table = document["effects"]
    if isinstance(table.get("choose"), list):
        _list(table, "choose", effect, how == ON)
    else:
        for key in (ON, OFF):
            _list(table, key, effect, how == key)
    return tomlkit.dumps(document)


def _list(table: Any, key: str, name: str, there: bool) -> None:
    names = [one for one in table.get(key, ()) if one != name] + [name] * there
    if names or key == "choose":
        table[key] = names
    elif key in table:
        del table[key]


def shifted(text: str, touch: int, dx: float, dy: float) -> str:
    """The scene with a touch, counted from zero, moved by (dx, dy) in m."""
    document: Any = tomlkit.parse(text)
    touches = document["touch"]
    table = touches[touch] if isinstance(touches, list) else touches  # one may be no array
    for key, by in (("x", dx), ("y", dy), ("x0", dx), ("y0", dy), ("x1", dx), ("y1", dy)):
        if key in table:
            table[key] = round(float(table[key]) + by, 6)  # to a micrometre
    return tomlkit.dumps(document)
