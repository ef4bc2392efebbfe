"""Words painted so large that they are read from across a room, whatever the size of the screen."""

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from kappaskin_app.theme import LIGHT, Theme
from kappaskin_app.widgets.lettering import Words, letters, shrunk


class Board(QWidget):
    """Paints what `words` lays out; `unit` is the px of this screen for one of 1080 px of height.

    A screen of 24 inches is read alike whether it has 720 px, 1080 px or twice as many: letters
    grow with the picture.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.unit, self.theme = 1.0, LIGHT
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Ignored)

    def words(self) -> list[Words]:
        """What is written, and where."""
        return []

    def draw(self, painter: QPainter) -> None:
        """What lies below the words."""

    def show_unit(self, unit: float) -> None:
        self.unit = unit
        self.update()

    def fix_height(self, units: float) -> None:
        """Be so many units high."""
        # Ignored, a layout would give it no height beside what stretches.
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self.setFixedHeight(round(units * self.unit))

    def show_theme(self, theme: Theme) -> None:
        self.theme = theme
        self.update()

    def letters(self, capital: float, bold: bool = False) -> QFont:
        """Letters whose capitals are so many units high."""
        return letters(self.font(), capital * self.unit, bold)

    def line(self, text: str, font: QFont, x: float, baseline: float, width: float) -> Words:
        """One line that begins at `x` and stands on `baseline`, smaller if `width` asks for it."""
        metrics = QFontMetricsF(font)
        top, height = baseline - metrics.ascent(), metrics.height()
        align = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignBottom
        return shrunk(Words(text, font, QRectF(x, top, width, height), align=align))

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self.draw(painter)
        for words in self.words():
            painter.setPen(QColor(self.ink(words)))
            words.paint(painter)

    def ink(self, words: Words) -> str:
        """The colour that the words have."""
        return self.theme.faint if words.faint else self.theme.text

    def fill(self, painter: QPainter, place: QRectF, colour: str, radius: float = 0.0) -> None:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(colour))
        painter.drawRoundedRect(place, radius, radius)

    def clear(self, colour: str, strength: float) -> QColor:
        """A `colour` that what lies below shows through, from 0 to 1 strong."""
        made = QColor(colour)
        made.setAlphaF(strength)
        return made

    @property
    def middle(self) -> QPointF:
        return QRectF(self.rect()).center()
