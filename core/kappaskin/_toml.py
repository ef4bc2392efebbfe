"""TOML and JSON read strictly, with line numbers in refusals; readable TOML written."""

import difflib
import json
import math
import re
import textwrap
import tomllib
from collections.abc import Callable, Container, Generator, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import MISSING, fields
from datetime import datetime
from pathlib import Path
from types import MappingProxyType, NoneType, UnionType
from typing import Any, TypeVar, cast, get_args, get_origin, get_type_hints

from kappaskin.errors import Refusal

# Reading

_Made = TypeVar("_Made")

REQUIRED = object()
"""The default of a key that has none."""

_KINDS: dict[Any, str] = {
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    str: "a text",
}

# A name begins and ends with what is no space: else a line of spaces is tried in every way.
_HEADER = re.compile(r"\s*(\[\[?)\s*([\w.\-\"']+(?: +[\w.\-\"']+)*)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(r"""\s*("[^"]*"|'[^']*'|[\w\-"'.]+)\s*=""")
_DEEP_TABLES = re.compile(r"(?:\.[\w\"'-]+){64}")  # tables in tables, which take long to read

Place = tuple[str | int, ...]
"""The way to a value: keys, and numbers from 0 where tables come in arrays."""


def _names(dotted: str) -> list[str]:
    if dotted[0] == dotted[-1] and dotted.count(dotted[0]) == 2 and dotted[0] in "\"'":
        return [dotted[1:-1]]
    return [name.strip().strip("\"'") for name in dotted.split(".")]


def parsed(text: str, file: Path, what: str = "a scene") -> dict[str, Any]:
    """What the TOML `text` of `file`, which is to be `what`, says."""
    try:
        if _DEEP_TABLES.search(text):
            raise RecursionError
        return tomllib.loads(text)
    except ValueError as error:  # a whole number of thousands of digits is one of these, too
        raise Refusal(f"{file}: expected {what} in TOML, got an error in it: {error}") from error
    except RecursionError as error:
        raise Refusal(f"{file}: expected {what}, got tables or lists nested too deep") from error


def json_table(text: str, floats_may_be_whole: bool = False) -> "TomlTable":
    """The object that the JSON `text` is; a `Refusal` for another, and for what is no number.

    With `floats_may_be_whole` a whole number may be written 16.0, as others' writers do.
    """

    def number(text: str) -> float:
        value = _finite(text)
        return int(value) if floats_may_be_whole and value.is_integer() else value

    try:
        found = json.loads(text, parse_float=number, parse_constant=_finite)
    except (ValueError, RecursionError) as error:
        raise Refusal(str(error)) from error
    if not isinstance(found, dict):
        raise Refusal(f"expected an object with keys, got {found!r:.80}")
    return TomlTable(cast("dict[str, Any]", found))


def _finite(text: str) -> float:
    """The number in `text`; JSON has no infinity and no NaN."""
    if not math.isfinite(value := float(text)):
        raise ValueError(f"expected a number, got {text}")
    return value


class _LineNumbers:
    """Where the keys of a file stand; of what is inside a value, where the value begins."""

    def __init__(self, text: str) -> None:
        self._lines: dict[Place, int] = {(): 1}
        within, counts = list[str | int](), dict[str, int]()
        in_text = False  # of several lines
        for number, line in enumerate(text.split("\n"), 1):
            was_in_text, quotes = in_text, line.count('"""') + line.count("'''")
            in_text ^= quotes % 2 == 1
            if was_in_text:
                continue
            if header := _HEADER.match(line):
                if header[1] == "[[":
                    counts[header[2]] = counts.get(header[2], -1) + 1
                    for inner in [name for name in counts if name.startswith(f"{header[2]}.")]:
                        del counts[inner]  # a new table has none yet
                within = self._counted(_names(header[2]), counts)
                self._lines[tuple(within)] = number
            elif key := _KEY.match(line):
                self._lines.setdefault((*within, *_names(key[1])), number)

    @staticmethod
    def _counted(names: list[str], counts: dict[str, int]) -> list[str | int]:
        """The names with the number of the last table after those that are arrays of tables."""
        place, dotted = list[str | int](), list[str]()
        for name in names:
            dotted.append(name)
            place.append(name)
            if ".".join(dotted) in counts:
                place.append(counts[".".join(dotted)])
        return place

    def of(self, place: Place) -> int:
        """The line of what is at `place`, or of the nearest thing around it."""
        while place not in self._lines:
            place = place[:-1]
        return self._lines[place]


class _Placed(Refusal):
    """A refusal that says already where in the file it stands."""


class TomlTable:
    """What a file says at one `place`; it is refused where it says what nobody asks for."""

    def __init__(
        self,
        values: dict[str, Any],
        text: "str | _LineNumbers | None" = None,
        name: str = "",
        place: Place = (),
    ) -> None:
        """The `values` that the `text` of a file of this `name` has at `place`.

        Without a text no refusal names a line.
        """
        self._lines = _LineNumbers(text) if isinstance(text, str) else text
        self._values, self._name, self.place = values, name, place
        self._asked: set[str] = set()

    def refusal(self, why: str, key: str = "") -> Refusal:
        """The refusal of what stands at `key`, with its line."""
        place = (*self.place, key) if key else self.place
        line = f"{self._name}, line {self._lines.of(place)}: " if self._lines else ""
        return _Placed(f"{line}{_dotted(place)}{why}")

    @contextmanager
    def blamed(self, key: str = "") -> Generator[None]:
        """Say of what is refused meanwhile where it stands in the file."""
        try:
            yield
        except _Placed:
            raise
        except Refusal as refusal:
            raise self.refusal(str(refusal), key) from refusal

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def is_table(self, key: str) -> bool:
        """Whether there is a table at `key`."""
        return isinstance(self._values[key], dict)

    def listed(self, key: str) -> list[Any]:
        """The list at `key`, of values of any kind."""
        self._asked.add(key)
        if not isinstance(value := self._values[key], list):
            raise self.refusal(f"expected a list, got {value!r:.60}", key)
        return cast("list[Any]", value)

    def get(
        self, key: str, kind: Any, default: Any = REQUIRED, within: Container[object] | None = None
    ) -> Any:
        """The value at `key`, of `kind`: float, int, bool, str, or a tuple of them.

        Its numbers must be `within` a range, if one is given.
        """
        self._asked.add(key)
        if key in self._values:
            value: Any = self._as(self._values[key], kind, key)
            if within is not None and not _all_within(value, within):
                raise self.refusal(f"expected {within}, got {self._values[key]!r:.60}", key)
            return value
        if default is REQUIRED:
            raise self.refusal(f"expected {key} = {_expected(kind)}, got none")
        return default

    def _as(self, value: Any, kind: Any, key: str) -> Any:
        whole = kind
        if isinstance(kind, UnionType):
            if value is None and NoneType in get_args(kind):
                return None
            listed = isinstance(value, list)
            kind = next((k for k in get_args(kind) if listed == (get_origin(k) is tuple)), kind)
        if get_origin(kind) is tuple and isinstance(value, list):
            kinds, values = get_args(kind), cast("list[Any]", value)
            each = kinds[:1] * len(values) if kinds[1:] == (...,) else kinds
            if len(each) == len(values):
                return tuple(self._as(v, k, key) for v, k in zip(values, each, strict=True))
        elif kind is float and isinstance(value, int | float) and not isinstance(value, bool):
            with suppress(OverflowError):  # of a whole number of hundreds of digits
                return float(value)
        elif type(value) is kind:
            return value
        raise self.refusal(f"expected {_expected(whole)}, got {value!r:.60}", key)

    def table(self, key: str) -> "TomlTable":
        """The table at `key`; an empty one when there is none."""
        self._asked.add(key)
        value = self._values.get(key, {})
        if not isinstance(value, dict):
            raise self.refusal(f"expected a table [{key}], got {value!r:.60}", key)
        return self._inside(value, key)

    def tables(self, key: str) -> "list[TomlTable]":
        """The tables of the array [[key]]."""
        self._asked.add(key)
        value = self._values.get(key, [])
        many = cast("list[Any]", value) if isinstance(value, list) else [value]
        if not all(isinstance(one, dict) for one in many):
            raise self.refusal(f"expected an array of tables [[{key}]], got {value!r:.60}", key)
        return [self._inside(one, key, n) for n, one in enumerate(many)]

    def _inside(self, values: Any, *place: str | int) -> "TomlTable":
        """A table in this one, of these `values`."""
        return TomlTable(values, self._lines, self._name, (*self.place, *place))

    def make(
        self,
        kind: Callable[..., _Made],
        limits: Mapping[str, Container[object]] | None = None,
        complete: bool = False,
        **given: Any,
    ) -> _Made:
        """An instance of the dataclass `kind`, its fields as the table says, or as `given`.

        Numbers must be within their `limits`, by key; a `complete` table leaves out no field.
        """
        hints, values = get_type_hints(kind), dict(given)
        for field in fields(cast("Any", kind)):
            if field.init and field.name not in given:
                usual = field.default is not MISSING or field.default_factory is not MISSING
                if complete or not usual or field.name in self:
                    values[field.name] = self.get(
                        field.name, hints[field.name], within=(limits or {}).get(field.name)
                    )
                self._asked.add(field.name)
        with self.blamed():
            return kind(**values)

    def choose(self, key: str, among: dict[str, _Made], default: Any = REQUIRED) -> _Made:
        """What the name at `key` stands for."""
        return self.stands_for(self.get(key, str, default), key, among)

    def stands_for(self, name: str, key: str, among: dict[str, _Made]) -> _Made:
        """What a `name` that stands at `key` stands for."""
        if name not in among:
            near = "".join(f"; did you mean {one!r}?" for one in _nearest(name, list(among)))
            raise self.refusal(f"expected one of {', '.join(among)}, got {name!r}{near}", key)
        return among[name]

    def done(self, *others: str) -> None:
        """Refuse a key that nobody asked for; it may be meant as one of those or of `others`."""
        for key in self._values:
            if key not in self._asked:
                near = "".join(
                    f"; did you mean {one}?" for one in _nearest(key, [*self._asked, *others])
                )
                known = near or f"; valid keys are {', '.join(sorted(self._asked))}"
                raise self.refusal(f"expected no such key{known}", key)


def _all_within(value: Any, within: Container[object]) -> bool:
    each = cast("tuple[Any, ...]", value) if isinstance(value, tuple) else (value,)
    return all(one in within for one in each)


def _nearest(name: str, known: list[str]) -> list[str]:
    return difflib.get_close_matches(name, known, 1)


def _dotted(place: Place) -> str:
    """The path of a value as text: keys joined by points, tables numbered from 1."""
    text = ""
    for part in place:
        text += f"[{part + 1}]" if isinstance(part, int) else f".{part}"
    return f"{text[1:]}: " if text else ""


def _expected(kind: Any) -> str:
    if isinstance(kind, UnionType):
        return " or ".join(_expected(one) for one in get_args(kind) if one is not NoneType)
    if get_origin(kind) is not tuple:
        return _KINDS.get(kind, str(kind))
    kinds = get_args(kind)
    what = _KINDS.get(kinds[0], "value").removeprefix("a ")
    return f"a list of {what}s" if kinds[1:] == (...,) else f"a list of {len(kinds)} {what}s"


# Writing

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
            inside = cast("dict[str, Any]", value)
            each = (f"{_key(key)} = {_value(one)}" for key, one in inside.items())
            return f"{{ {', '.join(each)} }}"
        case datetime():
            return value.isoformat()
        case list():
            return _list([_value(each) for each in cast("list[Any]", value)])
        case _:
            return repr(value).replace("e-0", "e-")


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _text(key)


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
