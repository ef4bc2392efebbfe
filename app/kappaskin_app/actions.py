"""Every action a person can take, registered once: menus, shortcuts and palette come from here."""

from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QMainWindow, QMenu

from kappaskin_app.guard import guarded


@dataclass(frozen=True)
class Entry:
    """An action with the menu it stands in."""

    name: str
    menu: str
    action: QAction


class Actions:
    """The registry, by name; adding an action also puts it into its menu."""

    def __init__(self, window: QMainWindow) -> None:
        self._window = window
        self.entries: dict[str, Entry] = {}
        self._menus: dict[str, QMenu] = {}
        self._why_not: dict[str, str] = {}

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
        action.setToolTip(tip or text)
        action.setStatusTip(tip or text)
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
        self.entries[name] = Entry(name, menu, action)
        self._menu(menu).addAction(action)
        self._window.addAction(action)

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
        if title not in self._menus:
            self._menus[title] = self._window.menuBar().addMenu(title)
        return self._menus[title]

    def __getitem__(self, name: str) -> QAction:
        return self.entries[name].action

    def cheat_sheet(self) -> str:
        """Every shortcut with what it does, menu by menu in two columns, as HTML."""
        menus: dict[str, list[str]] = {}
        for entry in self.entries.values():
            if key := entry.action.shortcut().toString():
                does = entry.action.text().replace("&", "")
                row = f"<tr><td><b>{key}</b>&nbsp;&nbsp;</td><td><nobr>{does}</nobr></td></tr>"
                menus.setdefault(entry.menu.replace("&", ""), []).append(row)
        half = sum(1 + len(rows) for rows in menus.values()) / 2
        columns, count = ["", ""], 0
        for menu, rows in menus.items():
            head = f'<tr><td colspan="2"><u>{menu}</u></td></tr>'
            columns[count + len(rows) / 2 > half] += "".join([head, *rows])
            count += 1 + len(rows)
        left, right = (f'<td><table cellpadding="1">{rows}</table></td>' for rows in columns)
        mouse = "<p>Drag the red arrow to move the load, drag elsewhere to turn, wheel to zoom.</p>"
        return f"<table><tr>{left}<td>{8 * '&nbsp;'}</td>{right}</tr></table>{mouse}"
