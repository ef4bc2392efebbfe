"""The status bar: messages and warnings, what touches the skin, and background tasks."""

from PySide6.QtWidgets import QStatusBar, QWidget

from kappaskin_app.shell.activity import Activity
from kappaskin_app.shell.notice import Notice
from kappaskin_app.widgets.columns import row
from kappaskin_app.widgets.line import Line


class StatusBar(QStatusBar):
    """Shows a `notice`, the `object` that touches, and background tasks (`activity`)."""

    def __init__(self, notice: Notice) -> None:
        super().__init__()
        # There from the start, or its first message would push the rest up.
        self.addWidget(notice)
        self.object, self.activity = Line(), Activity()
        self.addPermanentWidget(self.object, 1)
        self._corner = row(self.activity)
        self._grow(self._corner)
        self.addPermanentWidget(self._corner)
        # What it takes of the bar, all that the rest leaves, a passing message needs.
        self.messageChanged.connect(lambda text: self.object.setHidden(bool(text)))

    def add(self, widget: QWidget) -> None:
        """Show a widget at the end."""
        layout = self._corner.layout()
        if layout is not None:
            layout.addWidget(widget)
        self._grow(widget)

    def _grow(self, widget: QWidget) -> None:
        # As high from the start: a bar that grows shows all again that a message hides.
        least = max(self._corner.minimumHeight(), widget.sizeHint().height())
        self._corner.setMinimumHeight(least)
