"""The centre of the window: a view, what stands beside and below it, and a banner above."""

from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from kappaskin_app.shell.banner import Offer


class Centre(QWidget):
    """Holds the main `view`, once a feature shows one."""

    def __init__(self) -> None:
        super().__init__()
        self.offer = Offer()
        self.view: QWidget | None = None
        self._row, self._column = QHBoxLayout(), QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        for layout in (self._row, self._column):
            layout.setSpacing(0)
        self._column.addWidget(self.offer)
        self._column.addLayout(self._row, 1)

    def show_view(self, view: QWidget) -> None:
        """Have `view` in the middle of the window."""
        self.view = view
        self._row.insertWidget(0, view, 1)

    def add_beside(self, widget: QWidget) -> None:
        self._row.addWidget(widget)

    def add_below(self, widget: QWidget) -> None:
        self._column.addWidget(widget)
