"""What the program is doing, at the foot of the window, with a button that ends it."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QToolButton, QWidget

_TIP = "What takes longer than a moment. The window goes on meanwhile."


class Activity(QWidget):
    """Shows what is done, or hides; `cancel_wanted` asks that it be ended."""

    cancel_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.words, self.cancel = QLabel(), QToolButton()
        self.words.setToolTip(_TIP)
        self.cancel.setText("Cancel")
        self.cancel.setToolTip("End it, and keep what was there before.")
        self.cancel.clicked.connect(self.cancel_wanted)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(4, 0, 4, 0)
        layout.addWidget(self.words)
        layout.addWidget(self.cancel)
        self.hide()

    def show_work(self, words: str, may_cancel: bool) -> None:
        """Show what is done, and whether it can be ended; nothing when there are no `words`."""
        self.words.setText(words)
        self.cancel.setVisible(may_cancel)
        self.cancel.setAccessibleName(f"Cancel: {words}")
        self.setVisible(bool(words))
