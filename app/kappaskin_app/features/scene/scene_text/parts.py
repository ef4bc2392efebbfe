"""What a scene's forms can put in: parts.toml to tables of values to begin with."""

import tomllib
from collections.abc import Collection
from importlib.resources import files
from typing import Any

_PARTS = tomllib.loads((files("kappaskin_resources") / "parts.toml").read_text(encoding="utf-8"))

_EITHER = (("force", "displacement"), ("force", "depth"), ("grid", "positions"))
_MOTIONS = ("orbit", "path", "recorded")


def kinds(part: str) -> tuple[str, ...]:
    """What there is of a part: of a touch, a step, an effect, or shapes of a skin."""
    return tuple(_PARTS["needed"].get(part, {}))


def needed(part: str, kind: str) -> dict[str, Any]:
    """What this kind of a part cannot do without."""
    return dict(_PARTS["needed"].get(part, {}).get(kind, {}))


def optional(part: str, kind: str = "") -> dict[str, Any]:
    """What this kind of a part may have besides."""
    said = _PARTS["optional"].get(part, {})
    common = {key: value for key, value in said.items() if key not in kinds(part)}
    return common | (said.get(kind, {}) if kind in kinds(part) else {})


def known(part: str, kind: str = "") -> dict[str, Any]:
    """All that this kind of a part may say."""
    return needed(part, kind) | optional(part, kind)


def instead_of(key: str) -> set[str]:
    """The keys that cannot stand beside `key`."""
    groups = [group for group in (*_EITHER, _MOTIONS) if key in group]
    return {other for group in groups for other in group} - {key}


def missing(part: str, kind: str, there: Collection[str]) -> dict[str, Any]:
    """What this kind of a part needs and lacks, nothing else being there in its stead."""
    return {
        key: value
        for key, value in needed(part, kind).items()
        if key not in there and not instead_of(key) & set(there)
    }


def alike(value: Any, other: Any) -> bool:
    """Whether two values are of a kind, as far as a form is concerned."""
    numbers = [isinstance(one, int | float) and not isinstance(one, bool) for one in (value, other)]
    return all(numbers) or (not any(numbers) and type(value) is type(other))
