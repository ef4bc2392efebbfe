"""Lesson files: Markdown with TOML, read and checked."""

import re
import tomllib
import zlib
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, fields
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

from kappaskin._files import open_file
from kappaskin.errors import Refusal
from kappaskin.hand import HANDS
from kappaskin.pipeline import REPORTED
from kappaskin.scenes import SCENES
from kappaskin_app.features.lessons.expression import NUMBER, TRUTH, Expression, expression
from kappaskin_app.features.lessons.figures import KINDS
from kappaskin_app.features.lessons.lesson import (
    UNITS,
    Button,
    ChoiceAnswer,
    Lesson,
    LessonTask,
    NumberAnswer,
    Question,
    Step,
)
from kappaskin_app.shell.settings import SceneSettings, Settings, form_field
from kappaskin_app.shell.settings.form_fields import Choice, FormField, Range, Several, Switch
from kappaskin_app.shell.settings.scene import Scanning
from kappaskin_app.shell.settings.shown import EstimatorSettings, View

_LISTS = ("dead_elements", "region_elements")
_KINDS = (SceneSettings, EstimatorSettings, Scanning, View)
SETTABLE = {field.name for kind in _KINDS for field in fields(kind) if "form" in field.metadata}
"""Settings that a lesson may set, besides lists of elements; none sends data."""


def checked_setting(name: str, value: Any) -> Any:
    """The `value` of the setting `name`; a `Refusal` for one that no form accepts."""
    if name in _LISTS:
        return _elements(name, value)
    if name not in SETTABLE:
        raise Refusal(f"expected the name of a setting, got {name!r}; the guide lists them")
    how = form_field(name)
    if isinstance(how, Range):
        return _checked_number(name, how, value)
    if isinstance(how, Several):
        return _several(name, how, value)
    if not _is_one(how, value):
        choices = [one for one, _ in how.options] if isinstance(how, Choice) else ["true", "false"]
        raise Refusal(f"expected {name} to be one of {', '.join(choices)}; got {value!r}")
    return value


def _is_one(how: FormField, value: Any) -> bool:
    if isinstance(how, Choice):
        return value in [one for one, _ in how.options]
    return isinstance(how, Switch) and isinstance(value, bool)


def _checked_number(name: str, how: Range, value: Any) -> float | int:
    kind = type(getattr(Settings(), name))
    fits = isinstance(value, int | float) and not isinstance(value, bool)
    if not fits or not how.least <= value <= how.most:
        raise Refusal(f"expected {name} from {how.least:g} to {how.most:g}, got {value!r}")
    if kind(value) != value:
        raise Refusal(f"expected {name} to be a whole number, got {value!r}")
    return kind(value)


def _several(name: str, how: Several, value: Any) -> tuple[str, ...]:
    known = [one for one, _ in how.options]
    if not isinstance(value, list) or not all(one in known for one in value):
        raise Refusal(f"expected {name} to be a list of {', '.join(known)}; got {value!r}")
    return tuple(value)


def _elements(name: str, value: Any) -> tuple[int, ...]:
    most = 32 * 32
    if not isinstance(value, list) or not all(
        isinstance(one, int) and not isinstance(one, bool) and 0 <= one < most for one in value
    ):
        raise Refusal(f"expected {name} to be a list of elements, counted from 0; got {value!r}")
    return tuple(value)


_FOLDER = Path(str(files("kappaskin_resources"))) / "lessons"
READY = tuple(sorted(_FOLDER.glob("[0-9]*.md")))
"""The files of the lessons that come with the program, in their order."""

DOCKS = ("curvature", "cost", "stability", "scene", "health", "compare", "hand")
_NUMBERS = (each.header.key for each in REPORTED if each.header is not None)
READOUTS = tuple(f"readout-{name}" for name in ("rate", "contact", *_NUMBERS))
_PLACES = {*DOCKS, *READOUTS, *SETTABLE}

_FORMAT = 1
_LARGEST = 200_000  # bytes of a file
_STEPS, _TEXT, _LINE = 40, 2000, 300  # steps; letters of a step, and of a line of it
_HEAD = re.compile(r"\+\+\+\n(.*?)^\+\+\+\n", re.DOTALL | re.MULTILINE)
_STEP = re.compile(r"^## +(.+)$", re.MULTILINE)
_BLOCK = re.compile(r"^```toml\n(.*?)^```[ \t]*$", re.DOTALL | re.MULTILINE)
_FOREIGN = re.compile(r"!\[|<[a-zA-Z/!?]")  # Qt would read the files that these name
_AT_LINE = re.compile(r"\(at line (\d+), column \d+\)")

_HEAD_KEYS = {"format", "title", "minutes", "learn", "set", "hand"}
_QUESTION_KEYS = {"question", "hint", "explain"}
_WAYS = {
    "choices": {"choices", "right"},
    "number": {"number", "tolerance", "unit"},
    "check": {"check", "solution"},
}
_STEP_KEYS = {"set", "scene", "point", "button", *_QUESTION_KEYS}.union(*_WAYS.values())

_Some = TypeVar("_Some")


def read_lesson(file: Path) -> Lesson:
    """The lesson in `file`; a `Refusal` names the error and its line."""
    try:
        with open_file(file) as opened:
            data = opened.read(_LARGEST + 1)
        text = data.decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise Refusal(f"{file}: expected a lesson in UTF-8 text: {error}") from error
    return lesson_of(text, file.name)


def lesson_called(name: str) -> Lesson:
    """The lesson with this number among those of the program, or in the file `name`."""
    if not name.isdecimal():
        return read_lesson(Path(name))
    if not 1 <= int(name) <= len(READY):
        raise Refusal(f"expected a lesson from 1 to {len(READY)}, or a lesson file, got {name}")
    return read_lesson(READY[int(name) - 1])


def lesson_of(text: str, name: str) -> Lesson:
    """The lesson in a `text`, called `name`."""
    if len(text) > _LARGEST:
        raise Refusal(f"{name}: expected a lesson of at most {_LARGEST} characters, got more")
    text = text.replace("\r\n", "\n")
    head = _HEAD.match(text)
    if head is None:
        raise Refusal(f"{name}, line 1: expected a header between two lines +++; see the guide")
    table = _Table.parse(name, head[1], 2)
    table.only(_HEAD_KEYS)
    if table.get("format", int) != _FORMAT:
        raise table.refusal("format", f"{_FORMAT}, which this version reads")
    usual = table.settings("set")
    hand = table.one_of("hand", HANDS)
    begins = list(_STEP.finditer(text, head.end()))
    if not 1 <= len(begins) <= _STEPS:
        raise Refusal(
            f"{name}: expected 1 to {_STEPS} steps, each below a line '## Title', got {len(begins)}"
        )
    if text[head.end() : begins[0].start()].strip():
        line = _line(text, head.end()) + 1
        raise Refusal(f"{name}, line {line}: expected a line '## Title' before any text")
    ends = [*(match.start() for match in begins[1:]), len(text)]
    steps = tuple(
        _step(name, match[1].strip(), text, match.end(), end, usual)
        for match, end in zip(begins, ends, strict=True)
    )
    if hand and (usual or any(step.buttons or step.sets is not None for step in steps)):
        raise Refusal(
            f"{name}: expected a lesson on a hand without set, scene and button, got some; leave "
            "them out: they change the simulated skin, and a hand has its own"
        )
    return Lesson(
        name,
        table.words("title"),
        table.within("minutes", 1, 120),
        table.words("learn"),
        steps,
        hand,
        zlib.crc32(text.encode()),
    )


def _line(text: str, at: int) -> int:
    return text.count("\n", 0, at) + 1


def _step(name: str, title: str, text: str, begin: int, end: int, usual: dict[str, Any]) -> Step:
    body = text[begin:end]
    blocks = list(_BLOCK.finditer(body))
    line = _line(text, begin)
    if len(blocks) > 1 or (not blocks and "```toml" in body):
        raise Refusal(
            f"{name}, line {line}: expected one block ```toml in a step, closed by ```, got "
            f"{len(blocks)}"
        )
    words = (body if not blocks else body[: blocks[0].start()] + body[blocks[0].end() :]).strip()
    if not 1 <= len(words) <= _TEXT:
        raise Refusal(
            f"{name}, line {line}: expected a text of 1 to {_TEXT} characters, got {len(words)}"
        )
    if found := _FOREIGN.search(words):
        raise Refusal(
            f"{name}, line {line}: expected a text without pictures and HTML, got {found[0]}; "
            "leave it out, or write a space after <"
        )
    at = line if not blocks else _line(text, begin + blocks[0].start(1))
    table = _Table.parse(name, blocks[0][1] if blocks else "", at)
    table.only(_STEP_KEYS)
    sets = usual | table.placed() if {"set", "scene"} & set(table.values) else None
    buttons = table.get("button", list, [])
    return Step(
        title,
        words,
        sets,
        table.places(),
        tuple(_button(table, one, dict(sets or usual)) for one in buttons),
        _question(table) if _question_keys(table) else None,
    )


def _button(table: "_Table", values: Any, on: Mapping[str, Any]) -> Button:
    if not isinstance(values, dict):
        raise table.refusal("button", "a table [[button]]")
    inner = _Table(table.name, table.text, table.line, values)
    inner.only({"label", "set", "scene"})
    return Button(inner.words("label"), {**on, **inner.placed()})


def _question_keys(table: "_Table") -> set[str]:
    return set(table.values) & (_QUESTION_KEYS | set[str]().union(*_WAYS.values()))


def _question(table: "_Table") -> Question:
    ways = [way for way in _WAYS if way in table.values]
    if len(ways) != 1:
        raise table.refusal("question", "one of choices, number or check with a question")
    others = _question_keys(table) - _QUESTION_KEYS - _WAYS[ways[0]]
    if others:
        raise table.refusal(min(others), f"only {', '.join(sorted(_WAYS[ways[0]]))} beside it")
    how: Callable[[_Table], ChoiceAnswer | NumberAnswer | LessonTask] = {
        "choices": _choice,
        "number": _number,
        "check": _task,
    }[ways[0]]
    return Question(
        table.words("question"), how(table), table.words("hint"), table.words("explain")
    )


def _choice(table: "_Table") -> ChoiceAnswer:
    options = table.get("choices", list)
    if not 2 <= len(options) <= 6 or not all(isinstance(one, str) for one in options):
        raise table.refusal("choices", "2 to 6 answers, each in quotes")
    return ChoiceAnswer(tuple(options), table.within("right", 1, len(options)) - 1)


def _number(table: "_Table") -> NumberAnswer:
    values = table.values["number"]
    text = values if isinstance(values, str) else repr(table.real("number"))
    unit = table.get("unit", str, "")
    if unit not in UNITS:
        raise table.refusal("unit", f"one of {', '.join(filter(None, UNITS))}, or none")
    tolerance = table.real("tolerance")
    if not tolerance > 0:
        raise table.refusal("tolerance", "a number above zero, in SI units")
    return NumberAnswer(table.expression_of("number", text, NUMBER), tolerance, unit)


def _task(table: "_Table") -> LessonTask:
    check = table.expression_of("check", table.get("check", str), TRUTH)
    return LessonTask(check, table.settings("solution"))


@dataclass(frozen=True)
class _Table:
    """A block of TOML that begins at a `line` of the file called `name`."""

    name: str
    text: str
    line: int
    values: dict[str, Any]

    @classmethod
    def parse(cls, name: str, text: str, line: int) -> "_Table":
        try:
            values = tomllib.loads(text)
            repr(values)  # refused here: a number in hexadecimal that is too long to be shown
            return cls(name, text, line, values)
        except (ValueError, RecursionError) as error:  # also for a number too long to read
            at = _AT_LINE.search(str(error))
            where = line + int(at[1]) - 1 if at else line
            why = _AT_LINE.sub("", str(error)).strip()
            raise Refusal(
                f"{name}, line {where}: expected TOML, got an error in it: {why}"
            ) from error

    def refusal(self, key: str, expected: str) -> Refusal:
        """The error of the value of `key`, with its line."""
        found = re.search(rf"^[ \t\[]*{re.escape(key)}\b", self.text, re.MULTILINE)
        line = self.line + (_line(self.text, found.start()) - 1 if found else 0)
        got = repr(self.values[key]) if key in self.values else "nothing"
        got = got if len(got) <= 80 else got[:77] + "..."
        return Refusal(f"{self.name}, line {line}: expected {key} to be {expected}; got {got}")

    def only(self, keys: set[str]) -> None:
        for key in self.values:
            if key not in keys:
                known = ", ".join(sorted(keys))
                raise self.refusal(key, f"omitted, or one of {known}")

    def get(self, key: str, kind: type[_Some], usual: _Some | None = None) -> _Some:
        value = self.values.get(key, usual)
        if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
            names = {str: "text in quotes", int: "a whole number", list: "a list", dict: "a table"}
            raise self.refusal(key, names.get(kind, kind.__name__))
        return value

    def words(self, key: str) -> str:
        text = self.get(key, str).strip()
        if not 1 <= len(text) <= 2 * _LINE:
            raise self.refusal(key, f"text of 1 to {2 * _LINE} characters")
        return text

    def real(self, key: str) -> float:
        value = self.values.get(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.refusal(key, "a number, in SI units")
        with suppress(OverflowError):
            return float(value)
        raise self.refusal(key, "a smaller number")

    def within(self, key: str, least: int, most: int) -> int:
        value = self.get(key, int)
        if not least <= value <= most:
            raise self.refusal(key, f"from {least} to {most}")
        return value

    def expression_of(self, key: str, text: str, wanted: str) -> Expression:
        try:
            return expression(text, KINDS, wanted)
        except Refusal as refusal:
            raise self.refusal(key, f"a valid expression ({refusal})") from refusal

    def settings(self, key: str) -> dict[str, Any]:
        """The settings in the table `key`, by their names; none where there is none."""
        values = self.get(key, dict, {})
        try:
            return {str(name): checked_setting(str(name), one) for name, one in values.items()}
        except Refusal as refusal:
            raise self.refusal(key, f"a table of valid settings ({refusal})") from refusal

    def placed(self) -> dict[str, Any]:
        """The settings of a step or a button, and the ready scene among them."""
        scene = self.one_of("scene", SCENES)
        return self.settings("set") | ({"scene": scene} if scene else {})

    def one_of(self, key: str, names: Collection[str]) -> str:
        """One of these names, or nothing where the key is left out."""
        name = self.get(key, str, "")
        if key in self.values and name not in names:
            raise self.refusal(key, f"one of {', '.join(names)}")
        return name

    def places(self) -> tuple[str, ...]:
        """The controls that are pointed at."""
        places = self.get("point", list, [])
        for place in places:
            if place not in _PLACES:
                docks = ", ".join((*DOCKS, *READOUTS))
                raise self.refusal("point", f"names of settings, or some of {docks}")
        return tuple(places)
