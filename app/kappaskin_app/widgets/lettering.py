"""Fonts of a given capital height, and texts painted in rectangles."""

from dataclasses import dataclass

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QFont, QFontMetricsF, QPainter

LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
CENTRE = Qt.AlignmentFlag.AlignCenter

PRIMARY, SECONDARY, CAPTION = 56.0, 30.0, 22.0
"""Heights of capitals in px of a picture of 1080 px: 15.5, 8 and 6 mm on a screen of 24 inches."""
_SAMPLE = 200  # px, at which a font is measured


def letters(font: QFont, capital: float, bold: bool = False) -> QFont:
    """`font` so large that a capital is `capital` px high."""
    made = QFont(font)
    made.setWeight(QFont.Weight.DemiBold if bold else QFont.Weight.Normal)
    made.setPixelSize(_SAMPLE)
    made.setPixelSize(max(1, round(capital * _SAMPLE / QFontMetricsF(made).capHeight() + 0.5)))
    return made


def read_from_afar(unit: float) -> QFont:
    """The font of captions where a unit of the picture is so many px; the default one where 0."""
    return letters(QFont(), CAPTION * unit) if unit else QFont()


@dataclass(frozen=True)
class Words:
    """A text in a place of a picture; `lines` says whether it may be broken into several."""

    text: str
    font: QFont
    place: QRectF
    faint: bool = False
    align: Qt.AlignmentFlag = LEFT
    lines: bool = False

    @property
    def needed(self) -> QRectF:
        """The room that the text takes, in as much width as there is."""
        flags = self.align | (Qt.TextFlag.TextWordWrap if self.lines else Qt.TextFlag(0))
        room = QRectF(0, 0, self.place.width(), 1e5) if self.lines else QRectF(0, 0, 1e5, 1e5)
        return QFontMetricsF(self.font).boundingRect(room, int(flags), self.text)

    @property
    def fits(self) -> bool:
        room = self.needed
        return room.width() <= self.place.width() + 1 and room.height() <= self.place.height() + 1

    def paint(self, painter: QPainter) -> None:
        painter.setFont(self.font)
        flags = self.align | (Qt.TextFlag.TextWordWrap if self.lines else Qt.TextFlag(0))
        painter.drawText(self.place, int(flags), self.text)


def width_of(font: QFont, text: str) -> float:
    return QFontMetricsF(font).horizontalAdvance(text)


def shrunk(words: Words) -> Words:
    """The words in the largest font in which they fit."""
    font = QFont(words.font)
    while not words.fits and font.pixelSize() > 8:
        font.setPixelSize(max(8, round(0.92 * font.pixelSize())))
        words = Words(words.text, font, words.place, words.faint, words.align, words.lines)
        font = QFont(font)
    return words
