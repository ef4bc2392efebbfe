"""Menus: the shell's own actions, undo and redo, the finder and the shortcuts."""

from collections.abc import Callable
from functools import partial

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QUndoStack

from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import Actions
from kappaskin_app.shell.finder import EntrySource, Finder, entries_in
from kappaskin_app.shell.parts import EDIT, FILE, HELP, VIEW, Parts
from kappaskin_app.shell.shortcuts import ShortcutDialog
from kappaskin_app.shell.welcome import Welcome
from kappaskin_app.widgets.parts import ELLIPSIS, plain_tip

_LONGEST = 60  # characters of a step in a menu
_TIPS = {
    "undo": "Undo the last change of a setting, scene or layout; readings continue",
    "redo": "Repeat the change that was undone last",
}


class UndoActions(QObject):
    """The actions Undo and Redo of a `stack`; `settle` first records pending changes."""

    def __init__(
        self, stack: QUndoStack, settle: Callable[[], object], actions: Actions, menu: str
    ) -> None:
        super().__init__(stack)
        self._stack, self._settle, self._actions = stack, settle, actions
        actions.add("undo", menu, "&Undo", self._undo, "Ctrl+Z", _TIPS["undo"])
        actions.add("redo", menu, "&Redo", self._redo, "Ctrl+Shift+Z", _TIPS["redo"])
        stack.indexChanged.connect(guarded(self._show))
        self._show()

    def _undo(self) -> None:
        self._settle()
        self._stack.undo()

    def _redo(self) -> None:
        self._settle()
        self._stack.redo()

    def _show(self, *_: object) -> None:
        for name, text in (("undo", self._stack.undoText()), ("redo", self._stack.redoText())):
            word, action = name.capitalize(), self._actions[name]
            cut = text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}{ELLIPSIS}"
            action.setText(f"&{word}: {cut.replace('&', '&&')}" if text else f"&{word}")
            action.setToolTip(plain_tip(f"{word}: {text}") if text else _TIPS[name])
            self._actions.allow(name, "" if text else f"there is nothing to {name}")


_FIND = "Find commands, settings, scenes, panels and files by a few letters"
_RESET = "All settings to their defaults, except calibration, tare and publishing"
_PAUSE = "Pause or continue a scene or a recording; a sensor is not paused"
_THEME = "Switch between the light and the dark theme"
_QUIT = "Close the program; asks for confirmation during a recording"
_NEXT = "Next page of Settings: Live, Skin, Sensor, Calibrate"
_PREVIOUS = "Previous page of Settings"
_SHEET = "All shortcuts, to look up and to change"
_WELCOME = "Where to start: a scene, a sensor, a lesson, a recording"
_RECENT = (
    "Files opened last: scenes, recordings, calibrations, meshes; they can also be dropped here"
)


class Menus(QObject):
    """Registers the shell's own actions before and after those of features.

    `entry_sources` yield the finder's entries of features, besides actions, panels and settings.
    `quit_requested` requests that the window be closed.
    """

    quit_requested = Signal()

    def __init__(self, window: Parts) -> None:
        super().__init__(window)
        self._window = window
        self.entry_sources: list[EntrySource] = []
        self.welcome = Welcome(
            window.display.banner,
            window.history,
            window.session,
            window.requests,
            window.opening.menu,
            window,
        )
        self.finder = Finder(lambda: entries_in(window, self.entry_sources), window)
        add = window.actions_by_name.add
        self.undoing = UndoActions(
            window.history.stack, window.layouts.note, window.actions_by_name, EDIT
        )
        add("reset", EDIT, "&Reset settings", window.requests.reset, "", _RESET)
        find = self.finder.open_empty
        add("find", EDIT, f"&Find a command{ELLIPSIS}", find, "Ctrl+K", _FIND)
        add("pause", VIEW, "&Pause or continue", window.session.pause, "Ctrl+P", _PAUSE)
        add("theme", VIEW, "Light or &dark", window.requests.switch_theme, "Ctrl+T", _THEME)

    def finish(self) -> None:
        """Register the actions that follow those of features."""
        window, add = self._window, self._window.actions_by_name.add
        recent = add("recent", FILE, "Open r&ecent", lambda: None, "", _RECENT)
        recent.setMenu(window.opening.menu)
        add("quit", FILE, "&Quit", self.quit_requested.emit, "Ctrl+Q", _QUIT)
        after, before = (partial(window.panels.turn, pages) for pages in (1, -1))
        add("next-panels", VIEW, "&Next panels", after, "Ctrl+PgDown", _NEXT)
        add("last-panels", VIEW, "&Previous panels", before, "Ctrl+PgUp", _PREVIOUS)
        window.docks.add_actions(window.actions_by_name, VIEW)
        window.layouts.add_actions(window.actions_by_name)
        self.shortcuts = ShortcutDialog(window.actions_by_name, window.history, window)
        add("shortcuts", HELP, "&Shortcuts", self.shortcuts.open_all, "F1", _SHEET)
        add("begin", HELP, "&Welcome", self.welcome.offer, "", _WELCOME)
        window.actions_by_name.drop_empty_menus()
