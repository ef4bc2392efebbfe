"""The registry of actions, from which menus, shortcuts and the finder are made."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from PySide6.QtCore import QEvent, QObject
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QMainWindow, QMenu, QWidget

from kappaskin.errors import Refusal
from kappaskin_app.guard import guarded

WITHIN = " > "
"""Separator between the titles of a menu and its submenu."""
_TYPES_NOTHING = re.compile(r".*(Ctrl|Alt|Meta)\+.+|(Shift\+)?F\d+")


_OWN, _SHOWN = "own-tip", "shown-tip"  # properties of a widget: its own tooltip, and the one shown
_NONE = "no shortcut"


class KeyTips(QObject):
    """Updates the keys that the tooltips of a `window` name."""

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self._keys: Mapping[str, str] = {}

    def update_tips(self, keys: Mapping[str, str]) -> None:
        """Replace each default key by the present one, in later tooltips too."""
        if not keys and not self._keys:
            return  # no event filter while all keys are the defaults
        self._keys = keys
        for widget in self._window.findChildren(QWidget):
            if widget.toolTip():
                self._update_tip(widget)
                widget.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ToolTipChange and isinstance(watched, QWidget):
            self._update_tip(watched)
        return False

    def _update_tip(self, widget: QWidget) -> None:
        tip = widget.toolTip()
        own = widget.property(_OWN) if tip == widget.property(_SHOWN) else tip
        current = with_keys(str(own), self._keys)
        if current != tip:
            widget.setProperty(_OWN, own)
            widget.setProperty(_SHOWN, current)
            widget.setToolTip(current)


def with_keys(text: str, keys: Mapping[str, str]) -> str:
    """A text in which each of the `keys` is replaced by its value."""
    named = sorted(filter(None, keys), key=len, reverse=True)
    if not named:
        return text
    any_of = "|".join(map(re.escape, named))
    return re.sub(rf"(?<![\w+])({any_of})(?!\w)", lambda found: keys[found[1]] or _NONE, text)


@dataclass(frozen=True)
class Entry:
    """An action with its menu and its default shortcut."""

    name: str
    menu: str
    action: QAction
    key: str


class Actions:
    """The registry, by name; adding an action also puts it into its menu."""

    def __init__(self, window: QMainWindow, menus: Sequence[str] = ()) -> None:
        self._window = window
        self.entries: dict[str, Entry] = {}
        self._menus: dict[str, QMenu] = {}
        self._why_not: dict[str, str] = {}
        self._tips = KeyTips(window)
        for title in menus:  # in this order, whichever gets the first action
            self._menu(title)

    def add(
        self,
        name: str,
        menu: str,
        text: str,
        act: Callable[[], object],
        shortcut: str = "",
        tip: str = "",
    ) -> QAction:
        """Add an action called `name` that calls `act`."""
        action = QAction(text, self._window)
        if tip:
            action.setToolTip(tip)
        if shortcut:
            action.setShortcut(QKeySequence(shortcut))
        action.triggered.connect(guarded(lambda *_: act()))
        self.register(name, menu, action)
        return action

    def register(self, name: str, menu: str, action: QAction) -> None:
        """Register an action that Qt made (showing a dock)."""
        if name in self.entries:
            raise ValueError(f"expected a new name for an action, got {name!r} twice")
        action.setObjectName(name)
        action.setStatusTip(action.toolTip())
        self.entries[name] = Entry(name, menu, action, action.shortcut().toString())
        self._menu(menu).addAction(action)
        self._window.addAction(action)

    def repeat(self, name: str, menu: str) -> None:
        """Add an action to another menu too."""
        self._menu(menu).addAction(self[name])

    def allow(self, name: str, why_not: str) -> None:
        """Enable an action, or disable it with a reason."""
        action = self[name]
        action.setEnabled(not why_not)
        action.setStatusTip(why_not or action.toolTip())
        self._why_not[name] = why_not

    def why_not(self, name: str) -> str:
        """Why an action is disabled; empty where it is enabled."""
        return "" if self[name].isEnabled() else self._why_not.get(name) or "not now"

    def _menu(self, title: str) -> QMenu:
        """The menu of this title, which may be a submenu."""
        if title not in self._menus:
            around, _, own = title.rpartition(WITHIN)
            bar = self._menu(around) if around else self._window.menuBar()
            self._menus[title] = bar.addMenu(own)
        return self._menus[title]

    def drop_empty_menus(self) -> None:
        """Hide empty menus."""
        for menu in self._menus.values():
            menu.menuAction().setVisible(not menu.isEmpty())

    def __getitem__(self, name: str) -> QAction:
        return self.entries[name].action

    # Shortcuts.

    def key(self, name: str) -> str:
        """The shortcut of an action as text: "Ctrl+S"; empty where it has none."""
        return self[name].shortcut().toString()

    def own_key(self, name: str) -> str:
        """The default shortcut of an action."""
        return self.entries[name].key

    def changed_keys(self) -> dict[str, str]:
        """The shortcuts that differ from the defaults, by name."""
        return {
            name: self.key(name) for name in self.entries if self.key(name) != self.own_key(name)
        }

    def change_key(self, name: str, key: str) -> None:
        """Change or remove a shortcut; refused where another action has it."""
        if why_not := self.why_no_key(name, key):
            raise Refusal(why_not)
        self[name].setShortcut(QKeySequence(key))
        self.update_tips()

    def update_tips(self) -> None:
        """Update the shortcuts named in tooltips."""
        changed = self.changed_keys()
        self._tips.update_tips({self.own_key(name): key for name, key in changed.items()})

    def why_no_key(self, name: str, key: str) -> str:
        """Why an action cannot have a shortcut; empty where it can."""
        if not key:
            return ""
        wanted = QKeySequence(key)
        if wanted.count() != 1 or not _TYPES_NOTHING.fullmatch(key):
            return f"{key} is needed for typing: use a key with Ctrl or Alt, or a function key"
        for other, entry in self.entries.items():
            if other != name and entry.action.shortcut() == wanted:
                return f"{key} belongs to {plain(entry.action.text())}: change that shortcut first"
        return ""

    def take_keys(self, changed: dict[str, str]) -> list[str]:
        """Set all shortcuts, the others to their defaults; returns why some were refused."""
        for name, entry in self.entries.items():
            entry.action.setShortcut(QKeySequence("" if name in changed else entry.key))
        known = {name: key for name, key in changed.items() if name in self.entries}
        refused: list[str] = []
        for name, key in known.items():
            try:
                self.change_key(name, key)
            except Refusal as refusal:
                refused.append(str(refusal))
        self.update_tips()
        return refused


def plain(text: str) -> str:
    """The text of a menu or a button, without & and dots."""
    return text.replace("&", "").rstrip("\N{HORIZONTAL ELLIPSIS}")
