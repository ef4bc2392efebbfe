"""TOML tables as text, laid out as a person would write them."""

import json
import textwrap
from collections.abc import Mapping
from datetime import datetime
from types import MappingProxyType
from typing import Any, cast

_WIDTH = 88
_INDENT = "    "


def table(
    header: str, values: Mapping[str, Any], units: Mapping[str, str] = MappingProxyType({})
) -> str:
    """The lines of a table below `header`, "[skin]" say, or of the top where that is empty.

    The values are texts, dates, numbers, booleans, and lists or tables of them; `units`, by key,
    are written as comments.
    """
    lines = [header] if header else []
    for key, value in values.items():
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
        case datetime():
            return value.isoformat()
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
