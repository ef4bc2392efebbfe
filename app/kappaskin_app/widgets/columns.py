"""Widgets one below the other, as the docks beside the skin hold them, or beside each other."""

from PySide6.QtCore import QEvent, QObject, QSize, Qt
from PySide6.QtGui import QResizeEvent, QShowEvent
from PySide6.QtWidgets import (
    QDockWidget,
    QHBoxLayout,
    QMainWindow,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

_LOWEST = 240  # px of what is below the skin
_HIGHEST = 0.5  # of the window's height, of what is below the skin and asks for more than its share


def row(*widgets: QWidget) -> QWidget:
    """The widgets beside each other, as wide as they like to be."""
    whole = QWidget()
    beside = QHBoxLayout(whole)
    beside.setContentsMargins(0, 0, 0, 0)
    for widget in widgets:
        beside.addWidget(widget)
    return whole


def scrolled(*widgets: QWidget) -> QScrollArea:
    """The widgets as tall as they like to be, scrolled where the window is too low for them."""
    whole, stack = QWidget(), QVBoxLayout()
    for widget in widgets:
        stack.addWidget(widget)
    stack.addStretch(1)
    whole.setLayout(stack)
    area = _Scrolled()
    area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    area.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # a stop on the way of Tab that nobody sees
    area.setFrameShape(QScrollArea.Shape.NoFrame)
    area.setWidget(whole)
    area.widen()
    return area


class _Scrolled(QScrollArea):
    """As wide as what is in it needs with the letters of now."""

    def __init__(self) -> None:
        super().__init__(widgetResizable=True)  # pyright: ignore[reportCallIssue]
        self._letters = -1.0

    @property
    def _needed(self) -> int:
        bar, inside = self.verticalScrollBar().sizeHint().width(), self.widget()
        return 0 if inside is None else inside.minimumSizeHint().width() + bar

    def widen(self) -> None:
        self._letters = self.font().pointSizeF()
        self.setMinimumWidth(self._needed)

    def sizeHint(self) -> QSize:
        # No higher than it has to be: a dock that scrolls too would make room for all of it.
        return QSize(super().sizeHint().width(), self.minimumSizeHint().height())

    def showEvent(self, event: QShowEvent) -> None:
        self.widen()  # what is hidden learns of other letters only now
        super().showEvent(event)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.LayoutRequest and (
            self._letters != self.font().pointSizeF() or self._needed > self.minimumWidth()
        ):
            self.widen()  # with other letters, or what is wider than all that was shown
        return super().eventFilter(watched, event)


def scroll_to(widget: QWidget) -> None:
    """Bring a widget in sight, where it is on a page that is scrolled."""
    area = widget.parentWidget()
    while area is not None and not isinstance(area, QScrollArea):
        area = area.parentWidget()
    if area is not None:
        area.ensureWidgetVisible(widget)


def heighten(window: QMainWindow, dock: QDockWidget, share: float, least: int) -> None:
    """Give a `dock` below the skin its `share` of a `window`'s height, or `least` px if it can."""
    least = min(least, round(_HIGHEST * window.height()))
    height = max(_LOWEST, least, round(share * window.height()))
    window.resizeDocks([dock], [height], Qt.Orientation.Vertical)


def widen(window: QMainWindow, dock: QDockWidget, event: QResizeEvent) -> None:
    """Let `dock` keep its share of the width of a `window` that changed its size."""
    was, now = event.oldSize().width(), event.size().width()
    if was > 0 and was != now and dock.isVisible() and not dock.isFloating():
        window.resizeDocks([dock], [round(dock.width() * now / was)], Qt.Orientation.Horizontal)
