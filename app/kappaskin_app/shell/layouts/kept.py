"""What the window keeps for its next start, in a text file."""

import itertools
import os
import tempfile
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

import tomlkit
from PySide6.QtCore import QLockFile

from kappaskin.errors import Refusal
from kappaskin_app.shell.layouts.layout import AREAS, FLOATING, Layout, Place
from kappaskin_app.shell.settings import form_field
from kappaskin_app.shell.settings.form_fields import Range
from kappaskin_app.theme import THEMES

FORMAT = 1
_LONGEST = 200  # characters of a name
_MOST = 100  # of anything that is listed
_PX = 100_000  # px, more than any screen has
_HEAD = "What the window of Kappaskin was like. It may be edited while no window is open."
_WAYS, _SHARES = ("tabbed", "front", "beside"), ("share", "along")
_Some = TypeVar("_Some")


@dataclass(frozen=True)
class Kept:
    """What a person chose of the window; all but the theme begins as if nothing ever was.

    `place` is (x, y, width, height) in px, `keys` are the shortcuts changed, `done` and `files`
    what was done and opened last, `own` the layouts saved under a name, `now` the last one,
    `start` whether ways to begin are offered, and `letters` how large they are, in percent.
    """

    theme: str = ""
    place: tuple[int, int, int, int] | None = None
    full: bool = False
    keys: Mapping[str, str] = field(default_factory=dict)
    done: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    now: Layout | None = None
    own: Mapping[str, Layout] = field(default_factory=dict)
    start: bool = True
    letters: float = 100.0


def merged(mine: Kept, before: Kept, theirs: Kept) -> Kept:
    """What another window keeps, `theirs`, but for what was changed in `mine` since `before`."""
    three = [
        {f.name: getattr(kept, f.name) for f in fields(Kept)} for kept in (mine, before, theirs)
    ]
    return Kept(**_merged(*three))


def _merged(
    mine: Mapping[str, Any], before: Mapping[str, Any], theirs: Mapping[str, Any]
) -> dict[str, Any]:
    found = {key: value for key, value in theirs.items() if key in mine or key not in before}
    for key, value in mine.items():
        was, other = before.get(key), theirs.get(key)
        if isinstance(value, Mapping) and isinstance(was, Mapping) and isinstance(other, Mapping):
            found[key] = _merged(value, was, other)
        elif value != was:
            found[key] = value
    return found


# To text.


def to_text(kept: Kept) -> str:
    """The file's text."""
    document = tomlkit.document()
    document.add(tomlkit.comment(_HEAD))
    document["format"] = FORMAT
    document["window"] = _window(kept)
    document["shortcuts"] = dict(kept.keys)
    if kept.now is not None:
        document["layout"] = _said(kept.now)
    document["layouts"] = {name: _said(layout) for name, layout in kept.own.items()}
    return tomlkit.dumps(document)


def _window(kept: Kept) -> dict[str, Any]:
    said: dict[str, Any] = {"theme": kept.theme, "start": kept.start, "full": kept.full}
    said["letters"] = kept.letters
    said |= {"done": list(kept.done), "files": list(kept.files)}
    return said | ({"place": list(kept.place)} if kept.place else {})


def _said(layout: Layout) -> Any:
    table = tomlkit.table()
    table["page"] = layout.page
    for name, place in layout.docks:
        line = tomlkit.inline_table()
        line.update(_said_of(place))
        table[name] = line
    return table


def _said_of(place: Place) -> dict[str, Any]:
    said: dict[str, Any] = {"area": place.area, "shown": place.shown}
    said |= {name: True for name in _WAYS if getattr(place, name)}
    said |= {name: share for name in _SHARES if (share := getattr(place, name))}
    return said | ({"at": list(place.at)} if place.at else {})


# From text.


def from_text(text: str) -> Kept:
    """What the file tells; refused where it is damaged, or of a later version."""
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise Refusal(f"it is no TOML ({error})") from error
    if (version := document.get("format")) != FORMAT:
        raise Refusal(f"expected format {FORMAT}, got {version!r}: another version wrote it")
    window = _part(document, "window", dict, {})
    return Kept(
        _one_of(_part(window, "theme", str, ""), ("", *THEMES)),
        _rectangle(window, "place"),
        _part(window, "full", bool, False),
        {_name(k): _name(v) for k, v in _few(_part(document, "shortcuts", dict, {})).items()},
        _names(window, "done"),
        _names(window, "files"),
        _layout(_part(document, "layout", dict, {})) if "layout" in document else None,
        _layouts(document),
        _part(window, "start", bool, True),
        _letters(window),
    )


def _part(table: Mapping[str, Any], key: str, kind: type[_Some], otherwise: _Some) -> _Some:
    value = table.get(key, otherwise)
    if type(value) is not kind:
        raise Refusal(f"expected {key} to be a {kind.__name__}, got {value!r:.60}")
    return value


def _letters(window: Mapping[str, Any]) -> float:
    how, percent = form_field("letters"), window.get("letters", 100.0)
    if type(percent) not in (int, float) or not (
        isinstance(how, Range) and how.least <= percent <= how.most
    ):
        raise Refusal(f"expected letters from 80 to 200 %, got {percent!r:.60}")
    return float(percent)


def _few(values: Any) -> Any:
    if len(values) > _MOST:
        raise Refusal(f"expected at most {_MOST} of a kind, got {len(values)}")
    return values


def _name(value: Any, longest: int = _LONGEST) -> str:
    if not isinstance(value, str) or len(value) > longest:
        raise Refusal(f"expected a text of at most {longest} characters, got {value!r:.60}")
    return value


def _names(table: Mapping[str, Any], key: str) -> tuple[str, ...]:
    return tuple(_name(value, 4096) for value in _few(_part(table, key, list, [])))


def _one_of(value: str, known: tuple[str, ...]) -> str:
    if value not in known:
        raise Refusal(f"expected one of {', '.join(filter(None, known))}, got {value!r:.60}")
    return value


def _rectangle(table: Mapping[str, Any], key: str) -> tuple[int, int, int, int] | None:
    if key not in table:
        return None
    sides = _part(table, key, list, [])
    if len(sides) != 4 or not all(type(n) is int and abs(n) <= _PX for n in sides):
        raise Refusal(f"expected {key} as [x, y, width, height] in px, got {sides!r:.60}")
    if min(sides[2:]) <= 0:
        raise Refusal(f"expected {key} with a width and a height above 0, got {sides!r:.60}")
    return (sides[0], sides[1], sides[2], sides[3])


def _layouts(document: Mapping[str, Any]) -> dict[str, Layout]:
    own = _few(_part(document, "layouts", dict, {}))
    return {_name(name): _layout(_part(own, name, dict, {})) for name in own}


def _layout(table: Mapping[str, Any]) -> Layout:
    page = _part(table, "page", int, 0)
    if not 0 <= page < _MOST:
        raise Refusal(f"expected a page counted from 0, got {page}")
    names = [_name(name) for name in _few(table) if name != "page"]  # a later version has more
    return Layout(page, tuple((name, _place(_part(table, name, dict, {}))) for name in names))


def _place(table: Mapping[str, Any]) -> Place:
    area = _one_of(_part(table, "area", str, ""), AREAS)
    tabbed, front, beside = (_part(table, name, bool, False) for name in _WAYS)
    share, along = (_share(table, name) for name in _SHARES)
    at = _rectangle(table, "at") if area == FLOATING else None
    return Place(area, _part(table, "shown", bool, True), tabbed, front, beside, share, along, at)


def _share(table: Mapping[str, Any], key: str) -> float:
    share = table[key] if type(table.get(key)) in (int, float) else 0.0
    if not 0 <= share <= 1:
        raise Refusal(f"expected a share of the window from 0 to 1, got {share!r:.60}")
    return float(share)


_LARGEST = 1_000_000  # bytes
_PATIENCE = 500  # ms that another window may take to write


@dataclass(frozen=True)
class KeptFile:
    """What is kept at `path`; whatever is wrong with it is told, and never raised."""

    path: Path

    def read(self) -> tuple[Kept, str]:
        """What is kept, and what went wrong: then the file is put aside, and nothing is kept."""
        try:
            if not self.path.exists():
                return Kept(), ""
            return from_text(self._text()), ""
        except (OSError, UnicodeDecodeError, Refusal) as error:
            return Kept(), f"{self.path}: {error}; {self._put_aside()}, the window begins anew"

    def _text(self) -> str:
        if self.path.stat().st_size > _LARGEST:
            raise Refusal(f"expected at most {_LARGEST} bytes")
        return self.path.read_text(encoding="utf-8")

    def _put_aside(self) -> str:
        """Give the file another name, so that it is not written over; what was done."""
        numbered = (self.path.with_suffix(f".toml.{n}.aside") for n in itertools.count(1))
        try:
            aside = next(path for path in numbered if not path.exists())
            os.replace(self.path, aside)
        except OSError as error:
            return f"it cannot be put aside ({error.strerror})"
        return f"it is {aside.name} now"

    def write(self, kept: Kept) -> str:
        """Write the file whole or not at all; what went wrong."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._write(to_text(kept).encode())
        except (OSError, UnicodeEncodeError) as error:
            return f"{self.path}: cannot be written ({error}); the window will not be as it is now"
        return ""

    def merge(self, kept: Kept, before: Kept) -> str:
        """Write what was changed since `before`, and leave the rest as another window wrote it."""
        if not self.path.exists():
            return self.write(kept)
        lock = QLockFile(f"{self.path}.lock")
        lock.tryLock(_PATIENCE)  # or without: the file is whole at any time
        theirs, wrong = self.read()
        wrong = self.write(kept if wrong else merged(kept, before, theirs)) or wrong
        lock.unlock()
        return wrong

    def _write(self, data: bytes) -> None:
        # Each under a name of its own: another window may be writing the same file.
        opened, name = tempfile.mkstemp(".part", f".{self.path.name}.", self.path.parent)
        try:
            with os.fdopen(opened, "wb") as part:
                part.write(data)
            os.replace(name, self.path)
        except OSError:
            Path(name).unlink(missing_ok=True)
            raise
