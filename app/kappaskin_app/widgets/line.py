"""A line of text that changes many times a second."""

from PySide6.QtCore import QEvent, QRect, QSize, Qt
from PySide6.QtGui import QFontMetrics, QHelpEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QToolTip, QWidget

from kappaskin_app.widgets.lettering import LEFT

_NARROW = 0.9  # width of letters where room is short


class Line(QWidget):
    """A line of text drawn in place; a QLabel would lay out the whole window again.

    Where the text does not fit, spare beginnings or ends are left out, the first ones first, and
    the letters are narrower by at most a tenth; where the rest does not fit either, the tooltip
    begins with the text.
    """

    def __init__(self, text: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._text = text
        self._spare: tuple[str, ...] = ()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def sizeHint(self) -> QSize:
        return QSize(60, QFontMetrics(self.font()).height() + 2)

    def minimumSizeHint(self) -> QSize:
        return QSize(20, self.sizeHint().height())

    def text(self) -> str:
        return self._text

    def show_text(self, text: str, *spare: str) -> None:
        """Show `text`, which may do without `spare` beginnings or ends where room is short."""
        if text != self._text:
            self._text, self._spare = text, spare
            self.update()

    def _fits(self, text: str) -> bool:
        return self.fontMetrics().horizontalAdvance(text) * _NARROW <= self.contentsRect().width()

    @property
    def shown(self) -> str:
        """What of the text there is room for, before what lacks room is cut off."""
        text = self._text
        for spare in self._spare:
            if self._fits(text):
                break
            text = text.removeprefix(spare).removesuffix(spare)
        return text

    @property
    def whole(self) -> bool:
        """Whether there is room for all of the text that is needed."""
        return self._fits(self.shown)

    def tip(self) -> str:
        """What the tooltip says."""
        return self.toolTip() if self.whole else f"{self._text}\n\n{self.toolTip()}".strip()

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ToolTip and isinstance(event, QHelpEvent):
            QToolTip.showText(event.globalPos(), self.tip(), self)
            return True
        return super().event(event)

    def paintEvent(self, event: QPaintEvent) -> None:
        with QPainter(self) as painter:
            self._paint(painter)

    def _paint(self, painter: QPainter) -> None:
        painter.setPen(self.palette().color(self.foregroundRole()))
        text, place = self.shown, self.contentsRect()
        wide = painter.fontMetrics().horizontalAdvance(text)
        if self.whole and wide > place.width():
            painter.translate(place.x(), 0)
            painter.scale(place.width() / wide, 1.0)
            place = QRect(0, place.y(), wide, place.height())
        elif not self.whole:
            right = Qt.TextElideMode.ElideRight
            text = painter.fontMetrics().elidedText(text, right, place.width())
        painter.drawText(place, LEFT, text)
