"""Export: recordings as tables, pictures, films, figures, scripts."""

from datetime import datetime
from functools import partial

from PySide6.QtCore import QRect, QTimer
from PySide6.QtGui import QGuiApplication

from kappaskin._files import write_whole
from kappaskin.calibration import TareStore
from kappaskin.errors import Refusal
from kappaskin.studies import FIGURES
from kappaskin_app.features.export.exports import Exports
from kappaskin_app.features.export.figures import TITLES, FigureWindow
from kappaskin_app.features.export.scripting import script_of
from kappaskin_app.guard import guarded
from kappaskin_app.shell import parts as menus
from kappaskin_app.shell.folders import dated
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.window import MainWindow

_PYTHON = "Copy a Python script with the present source, scene and setup; it prints the contact"

_SETTLED = 1500  # ms from the start: the window is drawn
_WINDOW = "Save the whole window as a PNG in the folder Kappaskin of your documents"
_FIGURE = "Compute this figure of the paper, and show it in a window"
_INITIAL = "Compute section 6.2 of the paper, and show it in a window"


class ExportFeature:
    name = "export"

    def install(self, shell: MainWindow) -> None:
        self._shell, add = shell, shell.actions_by_name.add
        self.exports = Exports(shell.session, shell.display.centre, shell.tasks, shell)
        add("picture", menus.FILE, "Save &picture", self._save_picture, "Ctrl+S", _WINDOW)
        copy = self._copy_python
        add("copy-python", menus.EDIT, "Copy as P&ython", copy, "Ctrl+Shift+C", _PYTHON)
        for name in FIGURES:
            tip = _INITIAL if name == "initial-curvature" else _FIGURE
            add(name, menus.FIGURES, TITLES.get(name, name), partial(self._draw, name), "", tip)
        self._register(shell)
        self.exports.notified.connect(guarded(shell.notify))
        shell.closing.connect(guarded(self.exports.close))
        QTimer.singleShot(_SETTLED, shell, guarded(self._settle))

    def _settle(self) -> None:
        """Give hidden widgets their sizes, for which the first picture would wait."""
        if self._shell.isVisible():
            self._shell.grab(QRect(0, 0, 1, 1))

    def _register(self, shell: MainWindow) -> None:
        """Register pictures of all views and docks."""
        solid = {"the window": shell, "the skin": shell.centralWidget()}
        docks = {
            dock.windowTitle(): shell.docks.widget(dock.objectName())
            for dock in (*shell.docks.below, *shell.docks.beside)
        }
        flat = shell.display.views | {"Picture of a &panel": docks}
        self.exports.register(shell.actions_by_name, solid, flat)
        shell.settings_shown.connect(guarded(self._offer))

    def _offer(self, _: Settings) -> None:
        """Offer pictures of the views that the present sensor has."""
        self.exports.offer(self._shell.actions_by_name, self._shell.display.views)

    def _save_picture(self) -> None:
        self.exports.save(self._shell.grab().toImage(), dated(datetime.now(), ".png"))

    def _copy_python(self) -> None:
        """Copy a script to the clipboard, and write the files it reads into a folder."""
        shell, folder = self._shell, TareStore.user_folder().parent / "scripts"
        try:
            script = script_of(shell.session, shell.history.settings, folder)
            for name, content in script.files.items():
                folder.mkdir(parents=True, exist_ok=True)
                write_whole(folder / name, content)
        except (Refusal, OSError) as error:
            shell.notify(f"Nothing was copied: {error}")
            return
        QGuiApplication.clipboard().setText(script.text)
        shell.notify(f"Copied a script of {script.text.count(chr(10))} lines: paste it into a file")

    def _draw(self, name: str) -> None:
        """Compute a figure of the paper, and show it in a window."""
        FigureWindow(name, self._shell.tasks, self._shell).show()
