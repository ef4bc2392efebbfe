"""Positions of touches in a scene's text."""

from collections.abc import Mapping, Sequence
from typing import Any

import tomlkit
from tomlkit.items import AbstractTable

from kappaskin.errors import Refusal
from kappaskin_app.features.scene.scene_text.parsing import parsed

_SIDE = 0.1  # m of the skin that the schema's examples have their places on


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
