"""A time that changes many times a second, without the jitter of its digits."""

import math

from PySide6.QtCore import QEvent, QRectF, Qt
from PySide6.QtGui import QFontMetricsF, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget

from kappaskin_app.widgets.course import HEIGHT
from kappaskin_app.widgets.lettering import read_from_afar


class Clock(QWidget):
    """Draws a line of text, every digit in a place of its own width."""

    def __init__(self, tip: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.text, self._longest = "", ""
        self.setToolTip(tip)

    def show_text(self, text: str, longest: str) -> None:
        """Show `text` where there is room for what may be as long as `longest`."""
        if len(longest) != len(self._longest):
            self._longest = longest
            self._fit()
        if text != self.text:
            self.text = text
            self.update()

    def show_unit(self, unit: float) -> None:
        """Be read from afar where a unit is so many px; else as usual."""
        self.setFont(read_from_afar(unit))

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        self._fit()

    def _fit(self) -> None:
        self.setFixedSize(math.ceil(sum(self._widths(self._longest))), HEIGHT)

    def _widths(self, text: str) -> list[float]:
        metrics = QFontMetricsF(self.font())
        digit = max(metrics.horizontalAdvance(c) for c in "0123456789")
        return [digit if c.isdigit() else metrics.horizontalAdvance(c) for c in text]

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setPen(self.palette().windowText().color())
        widths = self._widths(self.text)
        x = self.width() - sum(widths)
        for character, width in zip(self.text, widths, strict=True):
            place = QRectF(x - 1, 0, width + 2, self.height())
            painter.drawText(place, Qt.AlignmentFlag.AlignCenter, character)
            x += width
