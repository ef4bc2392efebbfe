"""The splash screen, until the skin is drawn."""

from typing import TYPE_CHECKING

from PySide6.QtCore import QMetaObject, Qt, QTimer
from PySide6.QtGui import QColor, QGuiApplication, QMouseEvent, QPainter, QPaintEvent, QPalette
from PySide6.QtWidgets import QApplication, QLabel, QVBoxLayout, QWidget

from kappaskin_app.theme import FAINT, current
from kappaskin_app.widgets.parts import ELLIPSIS, Label

if TYPE_CHECKING:
    from kappaskin_app.shell.parts import Parts

_WIDTH = 66  # letters wide
_MOST = 2500  # ms that it is shown without a reading
_READING = "Waiting for the first reading"


class Splash(QWidget):
    """Shows what is loaded; closes with the first estimate, at a click, or after 2.5 s."""

    def __init__(self) -> None:
        super().__init__(None, Qt.WindowType.SplashScreen | Qt.WindowType.FramelessWindowHint)
        self.setObjectName("splash")
        self.setAccessibleName("Kappaskin is starting")
        # Closed before there is a window, it would end the program.
        self.setAttribute(Qt.WidgetAttribute.WA_QuitOnClose, False)
        self._watching: QMetaObject.Connection | None = None
        self.words = Label()
        self.words.setForegroundRole(FAINT)
        layout = QVBoxLayout(self)
        margin = self.fontMetrics().height()
        layout.setContentsMargins(2 * margin, margin, 2 * margin, margin)
        for label in (_name(), Label("The shape of a skin from its curvature"), self.words):
            layout.addWidget(label)
        self.setFixedSize(_WIDTH * self.fontMetrics().averageCharWidth(), self.sizeHint().height())
        self.move(QGuiApplication.primaryScreen().geometry().center() - self.rect().center())

    def say(self, words: str) -> None:
        """Show this at once: nothing else is drawn while modules are loaded."""
        self.words.setText(words + ELLIPSIS)
        self.words.setAccessibleName(self.words.text())
        QApplication.processEvents()

    def finish(self, window: "Parts") -> None:
        """Wait for the first estimate drawn in a `window`, and close."""
        self.say(_READING)
        # The connection holds the only reference to this splash.
        self._watching = window.display.drawn.connect(
            lambda: self._go() if window.display.estimate_shown() is not None else None
        )
        QTimer.singleShot(_MOST, self, self._go)

    def _go(self) -> None:
        if self._watching is not None:
            self.disconnect(self._watching)
            self._watching = None
            self.close()

    def paintEvent(self, event: QPaintEvent) -> None:
        with QPainter(self) as painter:
            painter.setPen(QColor(current().line))
            painter.drawRect(self.rect().adjusted(0, 0, -1, -1))

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self.close()


def _name() -> QLabel:
    name = Label("Kappaskin")
    font = name.font()
    font.setPointSizeF(2 * font.pointSizeF())
    font.setBold(True)
    name.setFont(font)
    name.setForegroundRole(QPalette.ColorRole.Link)
    return name
