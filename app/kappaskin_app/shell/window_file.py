"""The window file: shortcuts, layouts, last files and place of the window."""

import itertools
import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

import tomlkit
from PySide6.QtCore import QLockFile, QObject, QRect
from PySide6.QtGui import QGuiApplication

from kappaskin._files import replacing
from kappaskin.errors import Refusal
from kappaskin_app.guard import guarded
from kappaskin_app.shell.arrangement import AREAS, FLOATING, Layout, Place
from kappaskin_app.shell.background import BackgroundSave
from kappaskin_app.shell.menus import Menus
from kappaskin_app.shell.parts import Parts
from kappaskin_app.shell.settings import form_field
from kappaskin_app.shell.settings.form_fields import Range
from kappaskin_app.theme import THEMES
from kappaskin_app.widgets.text import ERROR_BARS

FORMAT = 1
_LONGEST = 200  # characters of a name
_MOST = 100  # of anything that is listed
_LESSONS, _PROGRESS = 40, 20_000  # lessons of which the progress is kept; characters of one
_PX = 100_000  # px, larger than any screen
_HEAD = "The state of Kappaskin's window. It may be edited while no window is open."
_WAYS, _SHARES = ("tabbed", "front", "beside"), ("share", "along")
_Some = TypeVar("_Some")


@dataclass(frozen=True)
class WindowState:
    """The state of a window in its file; the defaults are those of a first start.

    `place` is (x, y, width, height) in px, `keys` are the changed shortcuts, `done` and `files`
    the recent commands and files, `own` the saved layouts, `now` the present one, `start` whether
    the welcome banner is shown, `letters` the size of the font in percent, `error_bars` those that
    are shown, `folded` the collapsed panels of settings, and `lessons` the progress in each lesson.
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
    error_bars: str = "sigma"
    folded: tuple[str, ...] = ()
    lessons: Mapping[str, str] = field(default_factory=dict)


def merged(mine: WindowState, before: WindowState, theirs: WindowState) -> WindowState:
    """The state `theirs` of another window with what changed in `mine` since `before`."""
    three = [
        {f.name: getattr(state, f.name) for f in fields(WindowState)}
        for state in (mine, before, theirs)
    ]
    return WindowState(**_merged(*three))


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


def to_text(state: WindowState) -> str:
    """The file's text."""
    document = tomlkit.document()
    document.add(tomlkit.comment(_HEAD))
    document["format"] = FORMAT
    document["window"] = _window(state)
    document["shortcuts"] = dict(state.keys)
    document["lessons"] = dict(state.lessons)
    if state.now is not None:
        document["layout"] = _layout_table(state.now)
    document["layouts"] = {name: _layout_table(layout) for name, layout in state.own.items()}
    return tomlkit.dumps(document)


def _window(state: WindowState) -> dict[str, Any]:
    table: dict[str, Any] = {"theme": state.theme, "start": state.start, "full": state.full}
    table |= {"letters": state.letters, "error_bars": state.error_bars}
    table |= {name: list(getattr(state, name)) for name in ("done", "files", "folded")}
    return table | ({"place": list(state.place)} if state.place else {})


def _layout_table(layout: Layout) -> Any:
    table = tomlkit.table()
    table["page"] = layout.page
    for name, place in layout.docks:
        line = tomlkit.inline_table()
        line.update(_place_table(place))
        table[name] = line
    return table


def _place_table(place: Place) -> dict[str, Any]:
    table: dict[str, Any] = {"area": place.area, "shown": place.shown}
    table |= {name: True for name in _WAYS if getattr(place, name)}
    table |= {name: share for name in _SHARES if (share := getattr(place, name))}
    return table | ({"at": list(place.at)} if place.at else {})


# From text.


def from_text(text: str) -> WindowState:
    """The state in a text; refused where it is damaged, or of another version."""
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise Refusal(f"it is not TOML ({error})") from error
    if (version := document.get("format")) != FORMAT:
        raise Refusal(f"expected format {FORMAT}, got {version!r}: written by another version")
    window = _part(document, "window", dict, {})
    return WindowState(
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
        _one_of(_part(window, "error_bars", str, "sigma"), tuple(ERROR_BARS)),
        _names(window, "folded"),
        _lessons(_part(document, "lessons", dict, {})),
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
        raise Refusal(f"expected a text size from 80 to 200 %, got {percent!r:.60}")
    return float(percent)


def _lessons(table: Mapping[str, Any]) -> dict[str, str]:
    """The last entries that are of use: a lesson that is changed gets a new one."""
    whole = {k: v for k, v in table.items() if isinstance(v, str) and len(v) <= _PROGRESS}
    return dict(list(whole.items())[-_LESSONS:])


def _few(values: Any) -> Any:
    if len(values) > _MOST:
        raise Refusal(f"expected at most {_MOST} entries of each kind, got {len(values)}")
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
class WindowFile:
    """The window file at `path`; errors are returned as text, never raised."""

    path: Path

    def read(self) -> tuple[WindowState, str]:
        """The state and an error text; a damaged file is renamed, and the state is the default."""
        try:
            if not self.path.exists():
                return WindowState(), ""
            return from_text(self._text()), ""
        except (OSError, UnicodeDecodeError, Refusal) as error:
            return (
                WindowState(),
                f"{self.path}: {error}; {self._rename_damaged()}, the window starts with defaults",
            )

    def _text(self) -> str:
        if self.path.stat().st_size > _LARGEST:
            raise Refusal(f"expected at most {_LARGEST} bytes")
        return self.path.read_text(encoding="utf-8")

    def _rename_damaged(self) -> str:
        """Rename the file, so that it is not overwritten; a text that reports it."""
        numbered = (self.path.with_suffix(f".toml.{n}.aside") for n in itertools.count(1))
        try:
            aside = next(path for path in numbered if not path.exists())
            os.replace(self.path, aside)
        except OSError as error:
            return f"it cannot be renamed ({error.strerror})"
        return f"it was renamed to {aside.name}"

    def write(self, state: WindowState) -> str:
        """Write the file whole or not at all; returns an error text."""
        try:
            with replacing(self.path, "the window's state is not saved") as part:
                self.path.parent.mkdir(parents=True, exist_ok=True)
                part.write_text(to_text(state), "utf-8")
        except Refusal as reason:
            return str(reason)
        return ""

    def merge(self, state: WindowState, before: WindowState) -> str:
        """Write what changed since `before`, the rest as another window wrote it."""
        if not self.path.exists():
            return self.write(state)
        lock = QLockFile(f"{self.path}.lock")
        lock.tryLock(_PATIENCE)  # or without: the file is whole at any time
        theirs, wrong = self.read()
        wrong = self.write(state if wrong else merged(state, before, theirs)) or wrong
        lock.unlock()
        return wrong


class WindowSaver(QObject):
    """Restores a `window` from its file and saves its changes, once `begin` was called."""

    def __init__(self, window: Parts, menus: Menus) -> None:
        super().__init__(window)
        self._window, self._menus = window, menus
        self._file: WindowFile | None = None
        self._saved = WindowState()
        self.lessons: dict[str, str] = {}
        self._save = BackgroundSave(window.tasks, self._merge, window.notify)

    def begin(self, path: Path) -> None:
        """Restore the window from the file at `path`, and save it there from now on."""
        file, window = WindowFile(path), self._window
        state, wrong = file.read()
        refused = self._restore(state)
        self._file, self._saved = file, self._now()
        for changed in (
            self._menus.shortcuts.changed,
            window.layouts.changed,
            window.opening.changed,
        ):
            changed.connect(guarded(self.write))
        if wrong or refused:
            window.notify("; ".join([*([wrong] if wrong else []), *refused]))

    def write(self) -> None:
        """Save the state of the window soon."""
        if self._file is not None:
            self._save(self._now())

    def finish(self) -> None:
        """Save the state of the window, before this returns."""
        self.write()
        self._save.finish()

    def _merge(self, state: WindowState) -> str:
        before, self._saved = self._saved, state
        return self._file.merge(state, before) if self._file else ""

    def _restore(self, state: WindowState) -> list[str]:
        """Restore a state; returns what was refused."""
        window, self.lessons = self._window, dict(state.lessons)
        if state.place is not None:
            screens = [screen.availableGeometry() for screen in QGuiApplication.screens()]
            window.setGeometry(clamped(QRect(*state.place), screens))
        if state.full:
            window.showMaximized()
        chosen: dict[str, Any] = {"show_start": state.start, "letters": state.letters}
        chosen |= {"error_bars": state.error_bars}
        chosen |= {"theme": state.theme} if state.theme else {}
        window.history.change("", **chosen)
        window.opening.recent = [Path(file) for file in state.files]
        self._menus.finder.recent = list(state.done)
        window.layouts.own = dict(state.own)
        window.panels.fold(state.folded)
        window.layouts.apply(state.now or window.layouts.ready())
        return window.actions_by_name.take_keys(dict(state.keys))

    def _now(self) -> WindowState:
        window = self._window
        layout, place = window.layouts.now, window.normalGeometry()
        return WindowState(
            theme=window.history.settings.theme,
            start=window.history.settings.show_start,
            letters=window.history.settings.letters,
            error_bars=window.history.settings.error_bars,
            place=(place.x(), place.y(), place.width(), place.height()),
            full=window.isMaximized(),
            keys=window.actions_by_name.changed_keys(),
            done=tuple(self._menus.finder.recent),
            files=tuple(str(file) for file in window.opening.recent),
            now=layout,
            own=dict(window.layouts.own),
            folded=window.panels.folded,
            lessons=dict(self.lessons),
        )


def clamped(place: QRect, screens: Sequence[QRect]) -> QRect:
    """`place` moved and shrunk into the screen that shows most of it."""
    if not screens:
        return place

    def seen(screen: QRect) -> int:
        both = screen.intersected(place)
        return both.width() * both.height()

    screen = max(screens, key=seen)
    wide, high = min(place.width(), screen.width()), min(place.height(), screen.height())
    x = min(max(place.x(), screen.x()), screen.x() + screen.width() - wide)
    y = min(max(place.y(), screen.y()), screen.y() + screen.height() - high)
    return QRect(x, y, wide, high)
