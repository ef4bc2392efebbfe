"""The pages of settings: features add panels to them; all show settings and status."""

from typing import TypeVar

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QScrollArea, QTabWidget, QWidget

from kappaskin.live import Status
from kappaskin_app.shell.form import Form
from kappaskin_app.shell.panel import Panel
from kappaskin_app.shell.settings import Settings
from kappaskin_app.widgets.layout import scrolled

_Some = TypeVar("_Some", bound=Panel)
LIVE, SKIN, SENSOR, CALIBRATE = "&Live", "S&kin", "Se&nsor", "C&alibrate"
"""The titles of the pages, in their order."""
_PAGES = (LIVE, SKIN, SENSOR, CALIBRATE)


class Pages(QTabWidget):
    """`requested` says which setting is to be what.

    `reset_requested` says of which panel, and which, are to be as they are at first, and
    `read_wanted` which page of the guide a person wants to read.
    """

    requested = Signal(str, object)
    reset_requested = Signal(str, tuple)
    read_wanted = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._pages: dict[str, list[Panel]] = {}

    def add(self, page: str, panel: _Some) -> _Some:
        """A panel at the end of the page with this title."""
        self._pages.setdefault(page, []).append(panel)
        self.join(panel)
        return panel

    def join(self, panel: Panel) -> None:
        """Pass on what is asked for in a panel, be it on a page or elsewhere."""
        panel.wished.connect(self.requested)
        panel.read_wanted.connect(self.read_wanted)
        if isinstance(panel, Form):
            panel.reset_wanted.connect(self.reset_requested)

    def build(self) -> None:
        """Make the pages, once all panels are there."""
        for title in _PAGES:
            if title in self._pages:
                self.addTab(scrolled(*self._pages[title]), title)
        self.setUsesScrollButtons(False)  # every title is to be seen
        self.tabBar().setElideMode(Qt.TextElideMode.ElideNone)

    def all(self) -> list[Panel]:
        return [panel for page in _PAGES for panel in self._pages.get(page, ())]

    def turn(self, pages: int) -> None:
        """Show the page so many further on, round and round."""
        self.setCurrentIndex((self.currentIndex() + pages) % self.count())
        self.tabBar().setFocus(Qt.FocusReason.TabFocusReason)

    def place(self, title: str) -> int:
        """The place of the page of this title, counted from 0."""
        return [there for there in _PAGES if there in self._pages].index(title)

    def reveal(self, panel: Panel) -> None:
        """Show the page of a panel, scrolled to it."""
        [of] = [title for title, panels in self._pages.items() if panel in panels]
        self.setCurrentIndex(self.place(of))
        page = self.currentWidget()
        if isinstance(page, QScrollArea):
            page.ensureWidgetVisible(panel)

    def show_settings(self, settings: Settings) -> None:
        for panel in self.all():
            panel.show_settings(settings)

    def show_status(self, status: Status, simulating: bool) -> None:
        for panel in self.all():
            panel.show_status(status, simulating)
