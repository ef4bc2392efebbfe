"""Menus: the shell's own actions, undo and redo, the finder and the shortcuts."""

from functools import partial

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QActionGroup, QUndoStack

from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import WITHIN, Actions
from kappaskin_app.shell.finder import EntrySource, Finder, entries_in
from kappaskin_app.shell.parts import EDIT, FILE, HELP, VIEW, Parts
from kappaskin_app.shell.shortcuts import ShortcutDialog
from kappaskin_app.shell.welcome import Welcome
from kappaskin_app.widgets.parts import ELLIPSIS, plain_tip
from kappaskin_app.widgets.text import ERROR_BARS

_LONGEST = 60  # characters of a step in a menu
_TIPS = {
    "undo": "Undo the last change of a setting or scene; readings continue",
    "redo": "Repeat the change that was undone last",
}


class UndoActions(QObject):
    """The actions Undo and Redo of a `stack`."""

    def __init__(self, stack: QUndoStack, actions: Actions, menu: str) -> None:
        super().__init__(stack)
        self._stack, self._actions = stack, actions
        actions.add("undo", menu, "&Undo", stack.undo, "Ctrl+Z", _TIPS["undo"])
        actions.add("redo", menu, "&Redo", stack.redo, "Ctrl+Shift+Z", _TIPS["redo"])
        stack.indexChanged.connect(guarded(self._show))
        self._show()

    def _show(self, *_: object) -> None:
        for name, text in (("undo", self._stack.undoText()), ("redo", self._stack.redoText())):
            word, action = name.capitalize(), self._actions[name]
            cut = text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}{ELLIPSIS}"
            action.setText(f"&{word}: {cut.replace('&', '&&')}" if text else f"&{word}")
            action.setToolTip(plain_tip(f"{word}: {text}") if text else _TIPS[name])
            self._actions.allow(name, "" if text else f"there is nothing to {name}")


_FIND = "Find commands, settings, scenes, panels and files by a few letters"
_RESET = (
    "All settings to their defaults, except calibration, tare, publishing, the operator's and the "
    "look of the window"
)
_PAUSE = "Pause or continue a scene or a recording; a sensor is not paused"
_THEME = "Switch between the light and the dark theme"
_BARS = f"{VIEW}{WITHIN}&Error bars"
_BARS_TIP = (
    "Error bars of all views: 1 \u03c3, the standard deviation, or the half width of the 95 % "
    "interval; files and messages always have standard deviations"
)
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
        self.undoing = UndoActions(window.history.stack, window.actions_by_name, EDIT)
        add("reset", EDIT, "&Reset settings", window.requests.reset, "", _RESET)
        find = self.finder.open_empty
        add("find", EDIT, f"&Find a command{ELLIPSIS}", find, "Ctrl+K", _FIND)
        add("pause", VIEW, "&Pause or continue", window.session.pause, "Ctrl+P", _PAUSE)
        add("theme", VIEW, "Light or &dark theme", window.requests.switch_theme, "Ctrl+T", _THEME)
        self._add_error_bars()

    def _add_error_bars(self) -> None:
        """Register an action for each kind of error bars, of which the one in use is checked."""
        window, kinds = self._window, QActionGroup(self)
        for name, bars in ERROR_BARS.items():
            use = partial(window.requests.set, "error_bars", name)
            title = f"Error bars: {bars.title}"
            action = window.actions_by_name.add(f"bars-{name}", _BARS, title, use, "", _BARS_TIP)
            action.setCheckable(True)
            kinds.addAction(action)
            window.settings_shown.connect(
                lambda s, a=action, n=name: a.setChecked(s.error_bars == n)
            )

    def finish(self) -> None:
        """Register the actions that follow those of features."""
        window, add = self._window, self._window.actions_by_name.add
        recent = add("recent", FILE, "Open r&ecent", lambda: None, "", _RECENT)
        recent.setMenu(window.opening.menu)
        add("quit", FILE, "&Quit", self.quit_requested.emit, "Ctrl+Q", _QUIT)
        after, before = (partial(window.panels.turn, pages) for pages in (1, -1))
        add("next-panels", VIEW, "&Next settings page", after, "Ctrl+PgDown", _NEXT)
        add("last-panels", VIEW, "&Previous settings page", before, "Ctrl+PgUp", _PREVIOUS)
        window.docks.add_actions(window.actions_by_name, VIEW)
        window.layouts.add_actions(window.actions_by_name)
        self.shortcuts = ShortcutDialog(window.actions_by_name, window)
        add("shortcuts", HELP, "&Shortcuts", self.shortcuts.open_all, "F1", _SHEET)
        add("begin", HELP, "&Welcome", self.welcome.offer, "", _WELCOME)
        window.actions_by_name.drop_empty_menus()
