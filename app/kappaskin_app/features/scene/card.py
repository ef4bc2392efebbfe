"""One scene of a list as a card: its picture, its title below, and whether it is played."""

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QPainter, QPen, QPixmap
from PySide6.QtWidgets import QStyle, QStyledItemDelegate, QStyleOptionViewItem

from kappaskin_app.theme import LIGHT

PICTURE, PLAYING = int(Qt.ItemDataRole.UserRole), int(Qt.ItemDataRole.UserRole) + 1
"""Roles of an item: its QPixmap, and whether it is played."""

_GAP, _PAD = 4, 6  # px around a card, and inside of it
_FLAT = 0.63  # height of a picture over its width
_LINES = 2  # of a title

_Index = QModelIndex | QPersistentModelIndex


def picture_size(cell: int) -> QSize:
    """Size in px of the picture on a card in a cell so many px wide."""
    width = max(cell - 2 * (_GAP + _PAD), 16)
    return QSize(width, round(_FLAT * width))


class CardPainter(QStyledItemDelegate):
    """Draws the items of a list as cards in cells `cell` px wide."""

    def __init__(self) -> None:
        super().__init__()
        self.cell, self.theme = 160, LIGHT

    def sizeHint(self, option: QStyleOptionViewItem, index: _Index) -> QSize:
        return self.size(option.fontMetrics.height())

    def size(self, line: int) -> QSize:
        """Size in px of a cell whose title has lines `line` px high."""
        height = picture_size(self.cell).height() + _LINES * line + 2 * _GAP + 3 * _PAD
        return QSize(self.cell, height)

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: _Index) -> None:
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        card = QRectF(option.rect).adjusted(_GAP, _GAP, -_GAP, -_GAP)
        self._paint_ground(painter, card, option.state)
        size = picture_size(self.cell)
        place = QRectF(card.left() + _PAD, card.top() + _PAD, size.width(), size.height())
        self._paint_picture(painter, place, index.data(PICTURE))
        if index.data(PLAYING):
            self._paint_playing(painter, place)
        words = card.adjusted(_PAD, size.height() + 2 * _PAD, -_PAD, -_PAD)
        self._paint_title(painter, words, str(index.data()))
        painter.restore()

    def _paint_ground(self, painter: QPainter, card: QRectF, state: QStyle.StateFlag) -> None:
        theme, flags = self.theme, QStyle.StateFlag
        width, colour = 1.0, theme.line
        if state & flags.State_Selected:
            width, colour = 2.0, theme.accent if state & flags.State_Active else theme.faint
        elif state & flags.State_MouseOver:
            colour = theme.faint
        painter.setPen(QPen(QColor(colour), width))
        painter.setBrush(QColor(theme.base))
        half = width / 2
        painter.drawRoundedRect(card.adjusted(half, half, -half, -half), 7, 7)

    def _paint_picture(self, painter: QPainter, place: QRectF, picture: QPixmap | None) -> None:
        if picture is not None:
            painter.drawPixmap(place, picture, QRectF(picture.rect()))
            return
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(self.theme.scene))
        painter.drawRoundedRect(place, 5, 5)
        painter.setPen(QColor(self.theme.faint))
        painter.drawText(place, Qt.AlignmentFlag.AlignCenter, "\N{HORIZONTAL ELLIPSIS}")

    def _paint_playing(self, painter: QPainter, place: QRectF) -> None:
        theme, words = self.theme, "Playing"
        metrics = QFontMetricsF(painter.font())
        height = metrics.height() + 2
        width = metrics.horizontalAdvance(words) + 1.5 * height + 4
        pill = QRectF(place.left() + 5, place.top() + 5, width, height)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(theme.accent))
        painter.drawRoundedRect(pill, height / 2, height / 2)
        painter.setBrush(QColor(theme.base))
        left, middle, half = pill.left() + height / 2, pill.center().y(), height / 4
        painter.drawConvexPolygon(
            [
                QPointF(left, middle - half),
                QPointF(left + 1.6 * half, middle),
                QPointF(left, middle + half),
            ]
        )
        painter.setPen(QColor(theme.base))
        flags = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        painter.drawText(pill.adjusted(0, 0, -height / 2 + 1, 0), flags, words)

    def _paint_title(self, painter: QPainter, place: QRectF, title: str) -> None:
        metrics, flags = QFontMetricsF(painter.font()), Qt.AlignmentFlag
        how = int(flags.AlignCenter) | int(Qt.TextFlag.TextWordWrap)
        if metrics.boundingRect(place, how, title).height() > _LINES * metrics.height() + 1:
            title = metrics.elidedText(title, Qt.TextElideMode.ElideRight, 1.7 * place.width())
        painter.setPen(QColor(self.theme.text))
        painter.drawText(place, how, title)
