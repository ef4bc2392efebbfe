"""Every action a person can take, registered once: menus, shortcuts and palette come from here."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from PySide6.QtCore import QEvent, QObject
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QMainWindow, QMenu, QWidget

from kappaskin.errors import Refusal
from kappaskin_app.guard import guarded

WITHIN = " > "
"""Between the title of a menu and that of one in it."""
_TYPES_NOTHING = re.compile(r".*(Ctrl|Alt|Meta)\+.+|(Shift\+)?F\d+")


_OWN, _SHOWN = "own-tip", "shown-tip"  # properties of a widget: its tooltip, and as it was retold
_NONE = "no shortcut"


class KeyTips(QObject):
    """Has the tooltips of a `window` name its keys as they are now."""

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self._keys: Mapping[str, str] = {}

    def retell(self, keys: Mapping[str, str]) -> None:
        """Name each of the `keys` as it is now, in what tooltips say next too."""
        if not keys and not self._keys:
            return  # of a window whose keys are its own no event is looked at
        self._keys = keys
        for widget in self._window.findChildren(QWidget):
            if widget.toolTip():
                self._retell(widget)
                widget.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ToolTipChange and isinstance(watched, QWidget):
            self._retell(watched)
        return False

    def _retell(self, widget: QWidget) -> None:
        tip = widget.toolTip()
        own = widget.property(_OWN) if tip == widget.property(_SHOWN) else tip
        told = in_words(str(own), self._keys)
        if told != tip:
            widget.setProperty(_OWN, own)
            widget.setProperty(_SHOWN, told)
            widget.setToolTip(told)


def in_words(text: str, keys: Mapping[str, str]) -> str:
    """A text with each of the `keys` that it names as it is now."""
    named = sorted(filter(None, keys), key=len, reverse=True)
    if not named:
        return text
    any_of = "|".join(map(re.escape, named))
    return re.sub(rf"(?<![\w+])({any_of})(?!\w)", lambda found: keys[found[1]] or _NONE, text)


@dataclass(frozen=True)
class Entry:
    """An action with the menu it stands in, and the shortcut that it has by itself."""

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
        for title in menus:  # in this order, whoever is first to have an action in one
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
        """An action called `name` that calls `act`."""
        action = QAction(text, self._window)
        if tip:
            action.setToolTip(tip)
        if shortcut:
            action.setShortcut(QKeySequence(shortcut))
        action.triggered.connect(guarded(lambda *_: act()))
        self.register(name, menu, action)
        return action

    def register(self, name: str, menu: str, action: QAction) -> None:
        """Take in an action that Qt made (undo, redo, showing a dock)."""
        if name in self.entries:
            raise ValueError(f"expected a new name for an action, got {name!r} twice")
        action.setObjectName(name)
        action.setStatusTip(action.toolTip())
        self.entries[name] = Entry(name, menu, action, action.shortcut().toString())
        self._menu(menu).addAction(action)
        self._window.addAction(action)

    def repeat(self, name: str, menu: str) -> None:
        """Have an action in another menu too."""
        self._menu(menu).addAction(self[name])

    def allow(self, name: str, why_not: str) -> None:
        """Let an action be taken, or say why it cannot be now."""
        action = self[name]
        action.setEnabled(not why_not)
        action.setStatusTip(why_not or action.toolTip())
        self._why_not[name] = why_not

    def why_not(self, name: str) -> str:
        """Why an action cannot be taken now; empty where it can."""
        return "" if self[name].isEnabled() else self._why_not.get(name) or "not now"

    def _menu(self, title: str) -> QMenu:
        """The menu of this title, which may stand within another."""
        if title not in self._menus:
            around, _, own = title.rpartition(WITHIN)
            bar = self._menu(around) if around else self._window.menuBar()
            self._menus[title] = bar.addMenu(own)
        return self._menus[title]

    def drop_empty_menus(self) -> None:
        """Leave out menus in which nothing stands."""
        for menu in self._menus.values():
            menu.menuAction().setVisible(not menu.isEmpty())

    def __getitem__(self, name: str) -> QAction:
        return self.entries[name].action

    # Shortcuts.

    def key(self, name: str) -> str:
        """The shortcut of an action, as it is written: "Ctrl+S"; empty where it has none."""
        return self[name].shortcut().toString()

    def own_key(self, name: str) -> str:
        """The shortcut that an action has unless a person changes it."""
        return self.entries[name].key

    def changed_keys(self) -> dict[str, str]:
        """The shortcuts that a person changed, by name."""
        return {
            name: self.key(name) for name in self.entries if self.key(name) != self.own_key(name)
        }

    def change_key(self, name: str, key: str) -> None:
        """Give an action another shortcut, or none; refused where another action has it."""
        if why_not := self.why_no_key(name, key):
            raise Refusal(why_not)
        self[name].setShortcut(QKeySequence(key))
        self.retell()

    def retell(self) -> None:
        """Let what names shortcuts name those of now."""
        changed = self.changed_keys()
        self._tips.retell({self.own_key(name): key for name, key in changed.items()})

    def why_no_key(self, name: str, key: str) -> str:
        """Why an action cannot have a shortcut; empty where it can."""
        if not key:
            return ""
        wanted = QKeySequence(key)
        if wanted.count() != 1 or not _TYPES_NOTHING.fullmatch(key):
            return f"{key} is for typing: take a key with Ctrl or Alt, or a function key"
        for other, entry in self.entries.items():
            if other != name and entry.action.shortcut() == wanted:
                return f"{key} is the shortcut of {plain(entry.action.text())}: change that first"
        return ""

    def take_keys(self, changed: dict[str, str]) -> list[str]:
        """Change shortcuts all at once, the rest as their own; why those left out cannot be."""
        for name, entry in self.entries.items():
            entry.action.setShortcut(QKeySequence("" if name in changed else entry.key))
        known = {name: key for name, key in changed.items() if name in self.entries}
        refused: list[str] = []
        for name, key in known.items():
            try:
                self.change_key(name, key)
            except Refusal as refusal:
                refused.append(str(refusal))
        self.retell()
        return refused


def plain(text: str) -> str:
    """The words of a menu or a button, without the mark of its letter."""
    return text.replace("&", "").rstrip("\N{HORIZONTAL ELLIPSIS}")
