"""A line above the skin that offers something to do, waits for no answer, and can be put away."""

from collections.abc import Callable, Mapping

from PySide6.QtWidgets import QHBoxLayout, QLabel, QPushButton, QToolButton, QWidget

from kappaskin_app.guard import guarded
from kappaskin_app.theme import LIGHT, Theme


class Offer(QWidget):
    """Shows words, and a button for each thing that is offered; hides once one is taken."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("offer")
        self.setAccessibleName("Offer")
        self._theme = LIGHT
        self.words, self.away = QLabel(), QToolButton()
        self.buttons: list[QPushButton] = []
        self.away.setText("\N{MULTIPLICATION SIGN}")
        self.away.setAccessibleName("Put the offer away")
        self.away.setToolTip("Put this away")
        self.away.setAutoRaise(True)
        self.away.clicked.connect(self.hide)
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(8, 3, 4, 3)
        self._row.addWidget(self.words)
        self._row.addStretch()
        self._row.addWidget(self.away)
        self.hide()

    def show_offer(self, words: str, tip: str, offered: Mapping[str, Callable[[], object]]) -> None:
        """Offer, in `words` that a `tip` explains, what is done by its name."""
        for button in self.buttons:
            button.deleteLater()
        self.words.setText(words)
        self.words.setToolTip(tip)
        self.buttons = [self._button(text, act) for text, act in offered.items()]
        for place, button in enumerate(self.buttons, 1):
            self._row.insertWidget(place, button)
        self.show()

    def _button(self, text: str, act: Callable[[], object]) -> QPushButton:
        button = QPushButton(text, self)
        button.clicked.connect(guarded(lambda *_: (self.hide(), act())))
        return button

    def show_theme(self, theme: Theme) -> None:
        if theme != self._theme:
            self._theme = theme
            self.words.setStyleSheet(f"color: {theme.text};")
