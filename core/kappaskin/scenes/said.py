"""A part of a scene to what its table in a file says of it."""

from dataclasses import fields
from typing import Any, cast, get_args, get_origin, get_type_hints


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
