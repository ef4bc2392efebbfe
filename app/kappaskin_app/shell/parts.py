"""The parts of the shell, as one window that features are installed into."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QMainWindow

from kappaskin._text import printable
from kappaskin.live import Engine, Fingers
from kappaskin_app.guard import log
from kappaskin_app.shell.actions import Actions
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.display import Display
from kappaskin_app.shell.docks import Docks
from kappaskin_app.shell.history import History
from kappaskin_app.shell.layouts import Layouts
from kappaskin_app.shell.opening import Opening
from kappaskin_app.shell.pages import Pages
from kappaskin_app.shell.requests import Requests
from kappaskin_app.shell.selection import Selection
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import Settings

FILE, EDIT, SOURCE, RECORDING, SKIN = "&File", "&Edit", "&Source", "&Recording", "Sk&in"
VIEW, LAYOUT, FIGURES, EXPORT, HELP = "&View", "Layo&ut", "Fi&gures", "E&xport", "&Help"
MENUS = (FILE, EDIT, SOURCE, RECORDING, SKIN, VIEW, LAYOUT, FIGURES, EXPORT, HELP)
"""The titles of the menus, in their order."""


class Parts(QMainWindow):
    """A window with settings and their history, a session, a display, docks and actions.

    `settings_shown` brings the settings that views follow, with the quantities that may be shown of
    the sensor, also of another one. `begun` reports, once all is
    installed, the recording resumed from another window (or None) and the source;
    `guide_requested` the page of the guide to show. `closing` ends tasks before the session
    ends, `closed` ends views after it.
    """

    settings_shown = Signal(Settings)
    begun = Signal(object, str)
    guide_requested = Signal(str)
    closing = Signal()
    closed = Signal()

    def __init__(self, settings: Settings, engine: Engine | Fingers | None = None) -> None:
        super().__init__()
        self.history = History(settings, self)
        self.tasks = Tasks(self)
        self.session = Session(self.history, engine or Engine(), self.tasks, self)
        self.requests = Requests(self.history, self.session)
        self.selection = Selection(self)
        self.display = Display(self.session, self.tasks, self)
        self.actions_by_name = Actions(self, MENUS)
        self.docks, self.panels = Docks(self), Pages()
        self.opening = Opening(self, self.session)
        self.layouts = Layouts(self, self.docks, self.panels)

    def notify(self, text: str) -> None:
        """Show a message for some seconds."""
        text = printable(text)
        self.statusBar().showMessage(text, 10_000)
        if text:
            log.info("%s", text)
