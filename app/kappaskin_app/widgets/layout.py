"""Layouts of widgets: rows, scrolled columns, flow."""

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, QSize, Qt
from PySide6.QtGui import QResizeEvent, QShowEvent
from PySide6.QtWidgets import (
    QBoxLayout,
    QDockWidget,
    QHBoxLayout,
    QLayout,
    QLayoutItem,
    QMainWindow,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

_LOWEST = 240  # px of what is below the skin
_HIGHEST = 0.5  # of the window's height, of what is below the skin and asks for more than its share


def row(*widgets: QWidget) -> QWidget:
    """The widgets in a row, with their preferred widths."""
    whole = QWidget()
    beside = QHBoxLayout(whole)
    beside.setContentsMargins(0, 0, 0, 0)
    for widget in widgets:
        beside.addWidget(widget)
    return whole


def scrolled(*widgets: QWidget) -> QScrollArea:
    """The widgets in a column with their preferred heights, scrolled where it does not fit."""
    whole, stack = QWidget(), QVBoxLayout()
    for widget in widgets:
        stack.addWidget(widget)
    stack.addStretch(1)
    whole.setLayout(stack)
    area = _Scrolled()
    area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    area.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # else an invisible stop of Tab
    area.setFrameShape(QScrollArea.Shape.NoFrame)
    area.setWidget(whole)
    area.widen()
    return area


class _Scrolled(QScrollArea):
    """A scroll area as wide as its widget in the present font."""

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


def page_of(widget: QWidget) -> QScrollArea | None:
    """The scrolled page that a widget is on, if it is on one."""
    area = widget.parentWidget()
    while area is not None and not isinstance(area, QScrollArea):
        area = area.parentWidget()
    return area


def scroll_to(widget: QWidget) -> None:
    """Scroll to a widget, where it is on a scrolled page."""
    if (area := page_of(widget)) is not None:
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


_GAP = 6  # px between two widgets, and between two lines


class Flow(QLayout):
    """A layout of widgets in lines, `gap` px apart, like words; at least as wide as the widest."""

    def __init__(self, gap: int = _GAP) -> None:
        super().__init__()
        self._gap = gap
        self._items: list[QLayoutItem] = []

    # What Qt asks of a layout.

    def addItem(self, item: QLayoutItem) -> None:
        self._items.append(item)

    def count(self) -> int:
        return len(self._items)

    def itemAt(self, index: int) -> QLayoutItem | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        return self._items[index] if 0 <= index < len(self._items) else None

    def takeAt(self, index: int) -> QLayoutItem | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        return self._items.pop(index) if 0 <= index < len(self._items) else None

    def hasHeightForWidth(self) -> bool:
        return True

    def heightForWidth(self, width: int) -> int:
        return self._arrange(QRect(0, 0, width, 0), move=False)

    def minimumSize(self) -> QSize:
        size = QSize()
        for item in self._items:
            size = size.expandedTo(item.minimumSize())
        return size

    def sizeHint(self) -> QSize:
        wide = sum(item.sizeHint().width() + self._gap for item in self._items)
        return QSize(wide, self.minimumSize().height())

    def setGeometry(self, place: QRect) -> None:
        super().setGeometry(place)
        self._arrange(place, move=True)

    def _arrange(self, place: QRect, move: bool) -> int:
        """Put the widgets into a place, if they are to `move`; the height in px that they take."""
        lines: list[list[QLayoutItem]] = [[]]
        x = 0
        for item in self._items:
            if lines[-1] and x + item.sizeHint().width() > place.width():
                lines.append([])
                x = 0
            lines[-1].append(item)
            x += item.sizeHint().width() + self._gap
        top = place.y()
        for line in lines:
            high = max((item.sizeHint().height() for item in line), default=0)
            if move:
                _put(line, QPoint(place.x(), top), high, self._gap)
            top += high + self._gap
        return top - self._gap - place.y()


def _put(line: list[QLayoutItem], at: QPoint, high: int, gap: int) -> None:
    """Put the items of a line beside each other, `gap` px apart, vertically centred."""
    x = at.x()
    for item in line:
        size = item.sizeHint()
        item.setGeometry(QRect(QPoint(x, at.y() + (high - size.height()) // 2), size))
        x += size.width() + gap


class BesideOrBelow(QBoxLayout):
    """Items beside each other, or where they do not fit below each other."""

    def __init__(self) -> None:
        super().__init__(QBoxLayout.Direction.LeftToRight)

    def _widths(self) -> list[int]:
        items = [self.itemAt(index) for index in range(self.count())]
        return [item.minimumSize().width() for item in items if item is not None]

    def minimumSize(self) -> QSize:
        return QSize(max(self._widths(), default=0), super().minimumSize().height())

    def setGeometry(self, place: QRect) -> None:
        widths = self._widths()
        fits = sum(widths) + self.spacing() * (len(widths) - 1) <= place.width()
        ways = QBoxLayout.Direction
        way = ways.LeftToRight if fits else ways.TopToBottom
        if way != self.direction():
            self.setDirection(way)
            if (parent := self.parentWidget()) is not None:
                parent.updateGeometry()  # it is of another height
        super().setGeometry(place)
