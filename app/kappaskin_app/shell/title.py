"""The title of a dock in the letters of now, with what lets it float and closes it."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDockWidget, QHBoxLayout, QStyle, QToolButton, QWidget

from kappaskin_app.guard import guarded
from kappaskin_app.widgets.line import Line


class Title(QWidget):
    """Stands for Qt's own title of a `dock`, whose letters stay as they were when it was made.

    The dock itself answers to the mouse, which drags it or, pressed twice, lets it float.
    """

    def __init__(self, dock: QDockWidget) -> None:
        super().__init__(dock)
        self.words = Line(dock.windowTitle())
        self.words.setToolTip(dock.toolTip())
        row, icons = QHBoxLayout(self), QStyle.StandardPixmap
        row.setContentsMargins(6, 1, 4, 1)
        row.setSpacing(2)
        row.addWidget(self.words, 1)
        self.float = self._button(icons.SP_TitleBarNormalButton, "Let it float, or put it back")
        self.float.clicked.connect(guarded(lambda *_: dock.setFloating(not dock.isFloating())))
        self.close_ = self._button(icons.SP_TitleBarCloseButton, "Close")
        self.close_.clicked.connect(guarded(lambda *_: dock.close()))
        for button in (self.float, self.close_):
            row.addWidget(button)

    def _button(self, icon: QStyle.StandardPixmap, words: str) -> QToolButton:
        button = QToolButton()
        button.setIcon(self.style().standardIcon(icon))
        button.setAutoRaise(True)
        button.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the menus have both for the keyboard
        button.setToolTip(words)
        button.setAccessibleName(f"{self.words.text()}: {words.lower()}")
        return button
