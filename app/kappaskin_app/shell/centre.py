"""The main view in the centre of the window, and the banner of actions above it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from PySide6.QtCore import QEvent, Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QHBoxLayout,
    QMenu,
    QPushButton,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from kappaskin._text import printable
from kappaskin_app.guard import guarded
from kappaskin_app.widgets.layout import Flow
from kappaskin_app.widgets.parts import Label, plain_tip


@dataclass(frozen=True)
class BannerAction:
    """A button of the banner: its text, its tooltip, and the function or menu behind it."""

    text: str
    tip: str
    act: Callable[[], object] | QMenu


class ActionBanner(QWidget):
    """Shows a text and a button for each action; hides once one is pressed.

    `shown` reports new buttons.
    """

    shown = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("offer")
        self.setAccessibleName("Banner")
        self.words, self.away = Label(), QToolButton()
        self.buttons: list[QPushButton] = []
        self.away.setText("\N{MULTIPLICATION SIGN}")
        self.away.setAccessibleName("Close the banner")
        self.away.setToolTip("Close (Esc)")
        self.away.setAutoRaise(True)
        self.away.clicked.connect(self.hide)
        row, self._flow = QHBoxLayout(self), Flow()
        row.setContentsMargins(8, 3, 4, 3)
        row.addLayout(self._flow, 1)
        row.addWidget(self.away, 0, Qt.AlignmentFlag.AlignTop)
        self._flow.addWidget(self.words)
        self.hide()

    def show_actions(self, words: str, tip: str, offered: Sequence[BannerAction]) -> None:
        """Show `words` with a tooltip and these actions."""
        for button in self.buttons:
            self._flow.removeWidget(button)
            button.hide()  # at once, or its key would be that of two buttons
            button.deleteLater()
        self.words.setText(printable(words, keep="\n"))
        self.words.setToolTip(plain_tip(tip))
        self.buttons = [self._button(each) for each in offered]
        for before, after in pairwise([self, *self.buttons, self.away]):
            QWidget.setTabOrder(before, after)
        self.show()
        self._heighten()
        self.shown.emit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._heighten()

    def _heighten(self) -> None:
        """Set the height of all lines: a main window asks for no height for a width."""
        self.setMinimumHeight(self.heightForWidth(self.width()))

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.FontChange:
            self._heighten()

    def _button(self, offered: BannerAction) -> QPushButton:
        button = QPushButton(offered.text, self)
        button.setToolTip(offered.tip)
        if isinstance(act := offered.act, QMenu):
            button.setMenu(act)
            act.triggered.connect(self.hide)
        else:
            button.clicked.connect(guarded(lambda *_: (self.hide(), act())))
        self._flow.addWidget(button)
        return button


class Centre(QWidget):
    """Holds the main `view`, once a feature sets one."""

    def __init__(self) -> None:
        super().__init__()
        self.view: QWidget | None = None
        self._row, self._column = QHBoxLayout(), QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        for layout in (self._row, self._column):
            layout.setSpacing(0)
        self._column.addLayout(self._row, 1)

    def show_view(self, view: QWidget) -> None:
        """Set the main view."""
        self.view = view
        self.setFocusProxy(view)
        self._row.insertWidget(0, view, 1)

    def add_beside(self, widget: QWidget) -> None:
        self._row.addWidget(widget)

    def add_below(self, widget: QWidget) -> None:
        """Put a widget between the main view and those put there before."""
        self._column.insertWidget(1, widget)
