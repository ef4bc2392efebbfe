"""What a person can do in a window, menu by menu."""

import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject
from PySide6.QtGui import QGuiApplication

from kappaskin.calibration import tare_folder
from kappaskin.errors import Refusal
from kappaskin.studies import FIGURES
from kappaskin_app.actions import Actions
from kappaskin_app.figures import TITLES, FigureWindow
from kappaskin_app.finder.finder import Finder
from kappaskin_app.finder.sheet import CheatSheet
from kappaskin_app.finder.things import things_in
from kappaskin_app.guard import guarded
from kappaskin_app.presenting import SOUND_TIP, TIP
from kappaskin_app.scripting import script_of
from kappaskin_app.settings.shown import COLOURS
from kappaskin_app.undoing import Undoing

if TYPE_CHECKING:
    from kappaskin_app.window import MainWindow

_DOTS = "\N{HORIZONTAL ELLIPSIS}"
_FILE, _EDIT, _SOURCE, _VIEW = "&File", "&Edit", "&Source", "&View"
_FIND = "Whatever this window can do, found by a few letters: commands, settings, scenes, files"
_SHEET = "Every shortcut, to look up and to change"
_BEGIN = "Offer above the skin what one may begin with: a scene, a sensor, a lesson, a recording"
_PYTHON = "A script that does what the window does now: source, scene, setup; it prints the contact"
_RECENT = "Scenes, recordings, calibrations and meshes opened last; each may also be dropped here"
_FIGURES, _HELP = "Fi&gures", "&Help"


class Menus(QObject):
    """Registers all that the rooms of a `window` can be asked for, as `actions`."""

    def __init__(self, window: "MainWindow") -> None:
        super().__init__(window)
        self._window, self.actions = window, Actions(window)
        self.finder = Finder(partial(things_in, window), window)
        self._add_file()
        self._add_edit()
        self._add_source()
        self._add_view()
        for name in FIGURES:
            self.actions.add(name, _FIGURES, TITLES.get(name, name), partial(self._draw, name))
        self._add_export()
        self.actions.repeat("dock-guide", _HELP)
        self.sheet = CheatSheet(self.actions, window.history, window)
        self.actions.add("shortcuts", _HELP, "&Shortcuts", self.sheet.open_all, "F1", _SHEET)
        begin = window.beginning.offer
        self.actions.add("begin", _HELP, "&Ways to begin", begin, "", _BEGIN)
        window.mishaps.add_actions(self.actions, _HELP)

    def _add_file(self) -> None:
        add, window = self.actions.add, self._window
        add("open-scene", _FILE, f"&Open scene{_DOTS}", window.staging.open, "Ctrl+O")
        recent = add("recent", _FILE, "Open r&ecent", lambda: None, "", _RECENT)
        recent.setMenu(window.opening.menu)
        add("save-scene", _FILE, f"Save scene &as{_DOTS}", window.staging.save, "Ctrl+Shift+S")
        add("picture", _FILE, "Save &picture", self._save_picture, "Ctrl+S")
        add("quit", _FILE, "&Quit", window.quit, "Ctrl+Q")

    def _add_edit(self) -> None:
        window = self._window
        self.undoing = Undoing(window.history.stack, window.layouts.note, self.actions, _EDIT)
        self.actions.add("reset", _EDIT, "&Reset settings", self._window.wishes.reset)
        find = self.finder.open_empty
        add = self.actions.add
        add("copy-python", _EDIT, "Copy as P&ython", self._copy_python, "Ctrl+Shift+C", _PYTHON)
        add("find", _EDIT, f"&Find a command{_DOTS}", find, "Ctrl+K", _FIND)

    def _add_source(self) -> None:
        add, window = self.actions.add, self._window
        take = window.calibrating.take
        add("simulate", _SOURCE, "&Simulated skin", window.simulate, "Ctrl+M")
        add("connect", _SOURCE, "&Connect", window.connect_chosen, "Ctrl+Return")
        add("disconnect", _SOURCE, "&Disconnect", window.session.disconnect_from, "Ctrl+D")
        add("tare", _SOURCE, "Ta&re", window.taring.tare, "Ctrl+0")
        add("ports", _SOURCE, "&Look for ports", window.plugs.look, "F5")
        add("happenings", _SOURCE, "What &happened", window.happenings.open_list, "F4")
        window.taping.add_actions(self.actions)
        window.replaying.add_actions(self.actions)
        window.looking.add_actions(self.actions)
        add("calibrate", _SOURCE, "C&alibrate", window.panels.show_calibration, "Ctrl+L")
        add("take-step", _SOURCE, "&Take the step of the calibration", take, "Ctrl+Shift+K")

    def _add_view(self) -> None:
        add, window = self.actions.add, self._window
        add("pause", _VIEW, "&Pause or go on", window.pause, "Ctrl+P")
        add("present", _VIEW, "&Presenter", window.presenting.turn, "F11", TIP)
        sound = add("sound", _VIEW, "S&ound of the force", self._turn_sound, "F12", SOUND_TIP)
        sound.setCheckable(True)
        window.presenting.sound.ended.connect(guarded(self._show_sound))
        add("theme", _VIEW, "Light or &dark", window.wishes.switch_theme, "Ctrl+T")
        add("next-panels", _VIEW, "&Next panels", partial(window.panels.turn, 1), "Ctrl+PgDown")
        add("last-panels", _VIEW, "&Previous panels", partial(window.panels.turn, -1), "Ctrl+PgUp")
        window.docks.add_actions(self.actions, _VIEW)
        window.layouts.add_actions(self.actions)

    def _add_export(self) -> None:
        window = self._window
        solid = {"the window": window, "the skin": window.centralWidget()}
        words = {name: words[0].lower() + words[1:] for name, words in COLOURS}
        maps = {f"the map of {words[name]}": view for name, view in window.heatmaps.items()}
        docks = {
            dock.windowTitle(): window.docks.widget(dock.objectName())
            for dock in window.docks.below
        }
        flat = {"Picture of a &map": maps, "Picture of a &panel": docks}
        window.exports.register(self.actions, solid, flat)

    def _turn_sound(self) -> None:
        sound, before = self._window.presenting.sound, self._window.presenting.sound.on
        self._have_sound(not before)
        if sound.on != before:  # or there is nothing to undo: nothing here can play it
            words = "sound of the force on" if sound.on else "sound of the force off"
            self._window.history.step(words, self._have_sound, before, sound.on)

    def _have_sound(self, on: bool) -> None:
        sound = self._window.presenting.sound
        if sound.on != on:
            self._show_sound(sound.turn())

    def _show_sound(self, why_not: str) -> None:
        self._window.tell(why_not)
        self.actions["sound"].setChecked(self._window.presenting.sound.on)

    def _save_picture(self) -> None:
        path = Path(time.strftime("kappaskin-%Y%m%d-%H%M%S.png")).resolve()
        self._window.exports.save(self._window.grab().toImage(), path)

    def _copy_python(self) -> None:
        """Put a script on the clipboard, and what it reads into a folder."""
        window, folder = self._window, tare_folder().parent / "scripts"
        try:
            script = script_of(window.session, window.history.settings, folder)
            for name, content in script.files.items():
                folder.mkdir(parents=True, exist_ok=True)
                (folder / name).write_bytes(content)
        except (Refusal, OSError) as error:
            window.tell(f"Nothing was copied: {error}")
            return
        QGuiApplication.clipboard().setText(script.text)
        window.tell(f"Copied a script of {script.text.count(chr(10))} lines: paste it into a file")

    def _draw(self, name: str) -> None:
        """Draw a figure of the paper from a run of its own, in a window beside this one."""
        FigureWindow(name, self._window).show()
