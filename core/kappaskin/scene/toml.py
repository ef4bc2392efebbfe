"""What a scene says at one place to the lines of a TOML table, as a person would write them."""

import json
import textwrap
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, cast, get_args, get_origin, get_type_hints

_WIDTH = 88
_INDENT = "    "


def said_of(owner: object, usual: object = None, without: tuple[str, ...] = ()) -> dict[str, Any]:
    """The fields of a dataclass that are not as `usual`, their defaults when left out."""
    hints = get_type_hints(type(owner))
    said = dict[str, Any]()
    for field in fields(cast("Any", owner)):
        value = getattr(owner, field.name)
        expected = field.default if usual is None else getattr(usual, field.name)
        if field.init and field.name not in without and value != expected:
            said[field.name] = plain(value, hints[field.name])
    return said


def plain(value: Any, kind: Any) -> Any:
    """The `value` as TOML has it: a number where `kind` is float is one, however it came."""
    if get_origin(kind) is tuple:
        return [plain(each, get_args(kind)[0]) for each in value]
    if isinstance(value, bool | str):
        return value
    return float(value) if kind is float or float in get_args(kind) else int(value)


def table(header: str, said: Mapping[str, Any], units: Mapping[str, str]) -> str:
    """The lines of `[header]`, or of the top where that is empty; units stand in comments."""
    lines = [header] if header else []
    for key, value in said.items():
        unit = f"  # {units[key]}" if units.get(key) else ""
        lines.append(f"{key} = {_value(value)}{unit}")
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return _text(value)
        case dict():
            each = (f"{key} = {_value(one)}" for key, one in cast("dict[str, Any]", value).items())
            return f"{{ {', '.join(each)} }}"
        case list():
            return _list([_value(each) for each in cast("list[Any]", value)])
        case _:
            return repr(value).replace("e-0", "e-")


def _list(each: list[str]) -> str:
    """On one line where it fits; else lines full of numbers, or a line for each list or table."""
    flat = ", ".join(each)
    nested = any(one[0] in "[{" for one in each)
    if len(flat) <= _WIDTH and "{" not in flat:
        return f"[{flat}]"
    lines = each if nested else textwrap.wrap(flat, _WIDTH, break_on_hyphens=False)
    return "[\n" + "".join(f"{_INDENT}{line.removesuffix(',')},\n" for line in lines) + "]"


def _text(text: str) -> str:
    # TOML has JSON's escapes, and wants one more character escaped.
    lines = [json.dumps(line, ensure_ascii=False)[1:-1] for line in text.split("\n")]
    escaped = "\n".join(lines).replace("\x7f", "\\u007f")
    if "\n" not in text:
        return f'"{escaped}"'
    quoted = escaped.replace('\\"', '"').replace('"""', '""\\"')
    return f'"""\n{quoted}"""'
