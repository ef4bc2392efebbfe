"""The pages of settings, to which features add panels."""

from collections.abc import Collection
from typing import TypeVar

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QScrollArea, QTabWidget

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
    """Tabs of panels; `requested` brings the name and value of a setting.

    `reset_requested` brings a panel's title and the settings to reset, `guide_requested` the name
    of a page of the guide.
    """

    requested = Signal(str, object)
    reset_requested = Signal(str, tuple)
    guide_requested = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self._pages: dict[str, list[Panel]] = {}

    def add(self, page: str, panel: _Some) -> _Some:
        """Add a panel at the end of the page with this title."""
        self._pages.setdefault(page, []).append(panel)
        panel.fold.show()
        self.join(panel)
        return panel

    def join(self, panel: Panel) -> None:
        """Pass on the requests of a panel, on a page or elsewhere."""
        panel.requested.connect(self.requested)
        panel.guide_requested.connect(self.guide_requested)
        if isinstance(panel, Form):
            panel.reset_wanted.connect(self.reset_requested)

    def build(self) -> None:
        """Make the pages, once all panels are there."""
        for title in _PAGES:
            if title in self._pages:
                self.addTab(scrolled(*self._pages[title]), title)
        self.setUsesScrollButtons(False)  # every title must be visible
        self.tabBar().setElideMode(Qt.TextElideMode.ElideNone)

    def all(self) -> list[Panel]:
        return [panel for page in _PAGES for panel in self._pages.get(page, ())]

    def turn(self, pages: int) -> None:
        """Show the page so many further on, cyclically."""
        there = [index for index in range(self.count()) if self.isTabVisible(index)]
        now = there.index(self.currentIndex())
        self.setCurrentIndex(there[(now + pages) % len(there)])
        self.tabBar().setFocus(Qt.FocusReason.TabFocusReason)

    def place(self, title: str) -> int:
        """The index of the page of this title."""
        return [there for there in _PAGES if there in self._pages].index(title)

    def reveal(self, panel: Panel) -> None:
        """Show the page of a panel, scrolled to it."""
        [of] = [title for title, panels in self._pages.items() if panel in panels]
        self.setCurrentIndex(self.place(of))
        panel.fold.setChecked(False)
        page = self.currentWidget()
        if isinstance(page, QScrollArea):
            page.ensureWidgetVisible(panel)

    def show_settings(self, settings: Settings) -> None:
        for panel in self.all():
            panel.show_settings(settings)

    def show_status(self, status: Status, simulating: bool) -> None:
        """Show the status; a page of which no panel applies to the source is hidden."""
        for panel in self.all():
            panel.show_status(status, simulating)
        for index, page in enumerate(page for page in _PAGES if page in self._pages):
            applies = any(not panel.isHidden() for panel in self._pages[page])
            if applies != self.isTabVisible(index):
                self.setTabVisible(index, applies)

    @property
    def folded(self) -> tuple[str, ...]:
        """The titles of the collapsed panels."""
        return tuple(panel.title() for panel in self.all() if panel.fold.isChecked())

    def fold(self, titles: Collection[str]) -> None:
        """Collapse the panels of these titles, and no others."""
        for panel in self.all():
            panel.fold.setChecked(panel.title() in titles)
