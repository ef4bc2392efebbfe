"""Widgets beside each other, in as many lines as the width makes of them."""

from PySide6.QtCore import QPoint, QRect, QSize
from PySide6.QtWidgets import QLayout, QLayoutItem, QWidget

_GAP = 6  # px between two widgets, and between two lines


class Flow(QLayout):
    """Lays its widgets out like words; as narrow as the widest of them at least."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
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
        wide = sum(item.sizeHint().width() + _GAP for item in self._items)
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
            x += item.sizeHint().width() + _GAP
        top = place.y()
        for line in lines:
            high = max((item.sizeHint().height() for item in line), default=0)
            if move:
                _put(line, QPoint(place.x(), top), high)
            top += high + _GAP
        return top - _GAP - place.y()


def _put(line: list[QLayoutItem], at: QPoint, high: int) -> None:
    """Put what stands in one line beside each other, each in the middle of its height."""
    x = at.x()
    for item in line:
        size = item.sizeHint()
        item.setGeometry(QRect(QPoint(x, at.y() + (high - size.height()) // 2), size))
        x += size.width() + _GAP
