"""Timelines: a slider, buttons and a clock."""

import math
from collections.abc import Callable

from PySide6.QtCore import QEvent, QPointF, QRectF, QSignalBlocker, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFontMetricsF,
    QIcon,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QPixmap,
)
from PySide6.QtWidgets import QAbstractSlider, QSizePolicy, QToolButton, QWidget

from kappaskin_app.guard import guarded
from kappaskin_app.theme import current
from kappaskin_app.widgets.lettering import read_from_afar

HEIGHT = 30  # px of the row
_COURSE_SIDE = 8.0  # px beside the course, for half of the handle
_KNOB = 5.5  # px: radius of the handle
_MS = 1e3


def _whole_ms(seconds: float) -> int:
    """A time in whole ms, as far as a slider can count: 24 days."""
    return min(round(_MS * seconds), 2**31 - 1)


class Course(QAbstractSlider):
    """The handle over `paint_course`; its value is the time in ms, for those who do not see it.

    `sought` requests a time in s, from 0 to `last`.
    """

    sought = Signal(float)

    def __init__(self, name: str, tip: str) -> None:
        super().__init__()
        self.setOrientation(Qt.Orientation.Horizontal)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setFixedHeight(HEIGHT)
        self.setMinimumWidth(50)
        self.setAccessibleName(name)
        self.setToolTip(tip)
        self.time, self.last, self.duration = 0.0, 0.0, 1.0
        self.valueChanged.connect(guarded(lambda ms: self.seek(ms / _MS)))

    def sizeHint(self) -> QSize:
        return QSize(300, HEIGHT)

    def show_duration(self, duration: float, step: float, last: float) -> None:
        """Span `duration` s in steps of `step` s, up to `last`."""
        self.duration, self.last = duration, last
        with QSignalBlocker(self):
            self.setRange(0, _whole_ms(duration))
            self.setSingleStep(max(_whole_ms(step), 1))
            self.setPageStep(max(_whole_ms(duration / 10), 1))
        self.show_time(0.0)

    def show_time(self, seconds: float) -> None:
        self.time = seconds
        with QSignalBlocker(self):
            self.setValue(_whole_ms(seconds))
        self.update()

    def seek(self, seconds: float) -> None:
        """Show a time, or the nearest one that there is, and ask for it."""
        self.show_time(min(max(seconds, 0.0), self.last))
        self.sought.emit(self.time)

    # Mouse and keys.

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.setSliderDown(True)
            self.seek(self.time_at(event.position().x()))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self.isSliderDown():
            self.seek(self.time_at(event.position().x()))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.setSliderDown(False)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        event.ignore()  # the row's: they are whole frames there, and not whole ms

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        self.update()

    # How it is drawn.

    @property
    def area(self) -> QRectF:
        return QRectF(self.rect()).adjusted(_COURSE_SIDE, 4, -_COURSE_SIDE, -4)

    def at(self, seconds: float) -> float:
        """Where a time is drawn, in px from the left."""
        area = self.area
        return area.left() + area.width() * seconds / self.duration

    def time_at(self, x: float) -> float:
        """The time in s that is drawn at x px from the left."""
        area = self.area
        return (x - area.left()) / max(area.width(), 1.0) * self.duration

    def paintEvent(self, event: QPaintEvent) -> None:
        theme, area = current(), self.area
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(QPen(QColor(theme.text if self.hasFocus() else theme.line), 1))
            painter.setBrush(QColor(theme.base))
            painter.drawRoundedRect(area.adjusted(-2.5, -2.5, 2.5, 2.5), 4, 4)
            handle = self.at(self.time)
            self.paint_course(painter, area, handle)
            self._paint_handle(painter, area, handle)

    def paint_course(self, painter: QPainter, area: QRectF, handle: float) -> None:
        """Draw what happens meanwhile into `area`; the handle is `handle` px from the left."""

    def halves(self, area: QRectF, handle: float) -> tuple[tuple[QRectF, QColor], ...]:
        """What is before the handle and what behind it, each with the ink that it is drawn in."""
        passed, coming = QColor(current().accent), QColor(current().faint)
        passed.setAlphaF(0.55)
        coming.setAlphaF(0.45)
        height = float(self.height())
        before = QRectF(area.left(), 0, max(handle - area.left(), 0.0), height)
        behind = QRectF(handle, 0, max(area.right() - handle, 0.0), height)
        return (before, passed), (behind, coming)

    def _paint_handle(self, painter: QPainter, area: QRectF, x: float) -> None:
        theme = current()
        painter.setPen(QPen(QColor(theme.text), 1.5))
        painter.drawLine(QPointF(x, area.top() - 2), QPointF(x, area.bottom() + 2))
        painter.setPen(QPen(QColor(theme.base), 1.5))
        painter.setBrush(QColor(theme.accent))
        painter.drawEllipse(QPointF(x, area.center().y()), _KNOB, _KNOB)


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


def icon(name: str) -> QIcon:
    """The sign called `name` in the theme of now, paler where it cannot be pressed."""
    made, theme = QIcon(), current()
    modes = (QIcon.Mode.Normal, theme.text), (QIcon.Mode.Disabled, theme.missing)
    for mode, colour in modes:
        picture = QPixmap(_SIDE, _SIDE)
        picture.fill(Qt.GlobalColor.transparent)
        with QPainter(picture) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(colour))
            GLYPHS[name](painter)
        made.addPixmap(picture, mode)
    return made


def glyph_button(name: str) -> QToolButton:
    """A flat square button for a sign, called `name`."""
    button = QToolButton(autoRaise=True)  # pyright: ignore[reportCallIssue]
    button.setObjectName(name)
    button.setIconSize(QSize(16, 16))
    button.setFixedSize(HEIGHT - 2, HEIGHT - 2)
    return button


class Clock(QWidget):
    """Draws a line of text, every digit in a place of its own width.

    Where there is no room for all of it, only the text before " of " is drawn.
    """

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
        """Use large letters where a unit is so many px; 0: the usual ones."""
        self.setFont(read_from_afar(unit))

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        self._fit()

    def _fit(self) -> None:
        high = max(HEIGHT, self.fontMetrics().height())
        self.setMinimumSize(self._wide(self._longest.partition(" of ")[0]), high)
        self.setMaximumSize(self._wide(self._longest), high)

    def sizeHint(self) -> QSize:
        return self.maximumSize()

    def _wide(self, text: str) -> int:
        return math.ceil(sum(self._widths(text)))

    def _widths(self, text: str) -> list[float]:
        metrics = QFontMetricsF(self.font())
        digit = max(metrics.horizontalAdvance(c) for c in "0123456789")
        return [digit if c.isdigit() else metrics.horizontalAdvance(c) for c in text]

    def paintEvent(self, event: QPaintEvent) -> None:
        with QPainter(self) as painter:
            painter.setPen(self.palette().windowText().color())
            text = (
                self.text
                if self._wide(self.text) <= self.width()
                else self.text.partition(" of ")[0]
            )
            widths = self._widths(text)
            x = self.width() - sum(widths)
            for character, width in zip(text, widths, strict=True):
                place = QRectF(x - 1, 0, width + 2, self.height())
                painter.drawText(place, Qt.AlignmentFlag.AlignCenter, character)
                x += width
