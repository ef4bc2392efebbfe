"""The signs on the buttons of a transport, drawn in the colour of the text."""

from collections.abc import Callable

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QIcon, QPainter, QPen, QPixmap
from PySide6.QtWidgets import QToolButton

from kappaskin_app.theme import Theme
from kappaskin_app.widgets.course import HEIGHT

_SIDE = 64  # px, fine enough for every screen


def _bar(painter: QPainter, x: float) -> None:
    painter.drawRoundedRect(QRectF(x, 8, 13, 48), 3, 3)


def _triangle(painter: QPainter, back: float, tip: float) -> None:
    painter.drawConvexPolygon([QPointF(back, 6), QPointF(tip, 32), QPointF(back, 58)])


def _pause(painter: QPainter) -> None:
    _bar(painter, 14)
    _bar(painter, 37)


def _play(painter: QPainter) -> None:
    _triangle(painter, 14, 56)


def _forward(painter: QPainter) -> None:
    _bar(painter, 8)
    _triangle(painter, 27, 60)


def _back(painter: QPainter) -> None:
    _triangle(painter, 37, 4)
    _bar(painter, 43)


def _next(painter: QPainter) -> None:
    _triangle(painter, 4, 28)
    _flag(painter, 36)


def _previous(painter: QPainter) -> None:
    _flag(painter, 6)
    _triangle(painter, 60, 36)


def _flag(painter: QPainter, x: float) -> None:
    """An event, as it is marked on the course."""
    painter.drawRect(QRectF(x + 8, 6, 6, 52))
    painter.drawEllipse(QPointF(x + 11, 15), 10, 10)


def _loop(painter: QPainter) -> None:
    painter.setPen(QPen(painter.brush().color(), 8))
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawArc(QRectF(10, 10, 44, 44), 60 * 16, 280 * 16)
    painter.setBrush(painter.pen().color())
    painter.setPen(Qt.PenStyle.NoPen)
    painter.drawConvexPolygon([QPointF(36, 0), QPointF(36, 28), QPointF(58, 14)])


GLYPHS: dict[str, Callable[[QPainter], None]] = {
    "pause": _pause,
    "play": _play,
    "forward": _forward,
    "back": _back,
    "next": _next,
    "previous": _previous,
    "loop": _loop,
}


def icon(name: str, theme: Theme) -> QIcon:
    """The sign called `name`, paler where it cannot be pressed."""
    made = QIcon()
    modes = (QIcon.Mode.Normal, theme.text), (QIcon.Mode.Disabled, theme.missing)
    for mode, colour in modes:
        picture = QPixmap(_SIDE, _SIDE)
        picture.fill(Qt.GlobalColor.transparent)
        painter = QPainter(picture)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(colour))
        GLYPHS[name](painter)
        painter.end()
        made.addPixmap(picture, mode)
    return made


def glyph_button(name: str) -> QToolButton:
    """A flat square button for a sign, called `name`."""
    button = QToolButton(autoRaise=True)  # pyright: ignore[reportCallIssue]
    button.setObjectName(name)
    button.setIconSize(QSize(16, 16))
    button.setFixedSize(HEIGHT - 2, HEIGHT - 2)
    return button
