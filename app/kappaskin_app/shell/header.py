"""The header across the whole window: the badge, and what features show beside it."""

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QToolBar, QWidget

from kappaskin_app.shell.badge import Badge


class Header(QToolBar):
    """Begins with the `badge`."""

    def __init__(self, badge: Badge) -> None:
        super().__init__("Header")
        self.setObjectName("header")
        self.setMovable(False)
        self.toggleViewAction().setEnabled(False)
        self._first: QAction | None = None
        self.addWidget(badge)

    def add(self, widget: QWidget) -> None:
        """Show a widget after all others."""
        shown = self.addWidget(widget)
        self._first = self._first or shown

    def add_mark(self, widget: QWidget) -> QAction:
        """Show a widget right after the badge; the action shows and hides it."""
        if self._first is None:
            return self.addWidget(widget)
        return self.insertWidget(self._first, widget)
