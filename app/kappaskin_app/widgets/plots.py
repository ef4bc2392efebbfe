"""Plots: a logarithmic axis, and curves over one axis."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from kappaskin.frames import Array
from kappaskin_app.theme import current, series
from kappaskin_app.widgets.text import in_digits, round_up

_ROUND = (1.0, 2.0, 5.0)
_FEW = 2.5  # decades, up to which 2 and 5 are written too


@dataclass(frozen=True)
class LogAxis:
    """From `least` to `most`, both above zero."""

    least: float
    most: float

    @classmethod
    def around(cls, values: Iterable[float]) -> "LogAxis":
        """Round limits beyond all `values` that are above zero and finite, with some room."""
        known = [value for value in values if 0 < value < math.inf]
        low, high = (min(known), max(known)) if known else (1.0, 10.0)
        return cls(_rounded(low / 1.15, down=True), _rounded(high * 1.15, down=False))

    def share(self, value: float) -> float:
        """How far along the axis a value is, from 0 to 1; at its ends what lies beyond."""
        if not value > 0:
            return 0.0
        along = math.log(value / self.least) / math.log(self.most / self.least)
        return min(max(along, 0.0), 1.0)

    def at(self, share: float) -> float:
        """The value that far along the axis."""
        return self.least * (self.most / self.least) ** share

    def ticks(self) -> list[tuple[float, bool]]:
        """Round values on the axis, and whether each is to be written."""
        every = math.log10(self.most / self.least) <= _FEW
        first, last = (math.floor(math.log10(end) + 1e-9) for end in (self.least, self.most))
        return [
            (value, every or digit == 1)
            for power in range(first, last + 1)
            for digit in _ROUND
            if self.least * (1 - 1e-9) <= (value := digit * 10.0**power) <= self.most * (1 + 1e-9)
        ]


def _rounded(value: float, down: bool) -> float:
    """The nearest of 1, 2, 5 times a power of ten below `value`, or above."""
    power = 10.0 ** math.floor(math.log10(value))
    if down:
        return max(d * power for d in _ROUND if d * power <= value * (1 + 1e-9))
    return min(d * power for d in (*_ROUND, 10.0) if d * power >= value * (1 - 1e-9))


_RIGHT, _TOP = 8.0, 4.0
_WIDEST = "\N{MINUS SIGN}0.15"  # of the numbers, more or less
_THIN = 1.0  # px: what is a little wider takes Qt fourteen times as long
_DENSE = 2  # places in each px: more are drawn one over the other
_NEAR = 12.0  # px from a curve at which it is meant


@dataclass(frozen=True, eq=False)
class Curve:
    """`values` (T,) in the colour `number` of `SERIES`, called `name`; of an `element`, or -1."""

    name: str
    number: int
    values: Array
    element: int = -1


class CurvePlot(QWidget):
    """Curves over the same axis `x`; `pointed` brings the element of the curve under the mouse."""

    pointed = Signal(int)

    def __init__(self, title: str, unit: str, signed: bool, tip: str) -> None:
        super().__init__()
        self._title, self._unit, self._signed = title, unit, signed
        self._empty = ""
        self._x: Array = np.empty(0)
        self._span, self._x_unit = (0.0, 1.0), "s"
        self.curves: tuple[Curve, ...] = ()
        self._limit, self._marked = 1.0, -1
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMouseTracking(True)
        self.setAccessibleName(title)
        self.setToolTip(tip)

    def show_title(self, title: str, unit: str, tip: str) -> None:
        """Show another quantity from now on."""
        self._title, self._unit, self.curves = title, unit, ()
        self.setAccessibleName(title)
        self.setToolTip(tip)
        self.update()

    def sizeHint(self) -> QSize:
        return QSize(260, 130)

    def minimumSizeHint(self) -> QSize:
        line = self.fontMetrics().height()
        return QSize(9 * line, 4 * line)

    def show_curves(
        self,
        x: Array,
        curves: Sequence[Curve],
        span: tuple[float, float],
        x_unit: str,
        empty: str = "",
    ) -> None:
        """Draw `curves` over `x` (T,) within `span`; where there are none, `empty` is written."""
        self._x, self.curves, self._span, self._x_unit = x, tuple(curves), span, x_unit
        self._empty = empty
        known = [curve.values[np.isfinite(curve.values)] for curve in self.curves]
        largest = max((float(np.abs(v).max()) for v in known if len(v)), default=0.0)
        self._limit = round_up(largest) or 1.0
        self.update()

    def mark(self, element: int) -> None:
        """Draw the curves of one element boldly, as it is pointed at; -1 for none."""
        if element != self._marked:
            self._marked = element
            self.update()

    @property
    def _left(self) -> float:
        return max(map(self.fontMetrics().horizontalAdvance, (_WIDEST, *self._ends))) + 8.0

    @property
    def _ends(self) -> tuple[str, str]:
        """The numbers at the upper and the lower end."""
        high, low = self._limit, -self._limit if self._signed else 0.0
        return in_digits(high, high), in_digits(low, high)

    @property
    def _area(self) -> QRectF:
        line = self.fontMetrics().height()
        return QRectF(self.rect()).adjusted(self._left, _TOP + line, -_RIGHT, -line - 4)

    def _places(self, curve: Curve) -> list[list[QPointF]]:
        """The curve in pieces between what is missing."""
        area, (low, high) = self._area, self._span
        x = area.left() + (self._x - low) / (high - low) * area.width()
        share = curve.values / self._limit
        share = (share + 1) / 2 if self._signed else share
        y = area.bottom() - share * area.height()
        there = np.isfinite(y)
        ends = np.flatnonzero(np.diff(there, prepend=False, append=False)).reshape(-1, 2)
        pieces = (as_seen(x[begin:end], y[begin:end]) for begin, end in ends.tolist())
        return [[QPointF(*p) for p in zip(u.tolist(), v.tolist(), strict=True)] for u, v in pieces]

    # Mouse.

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        at = event.position()
        near = [
            (abs(np.interp(at.x(), *np.array([(p.x(), p.y()) for p in piece]).T) - at.y()), curve)
            for curve in self.curves
            for piece in self._places(curve)
            if piece[0].x() <= at.x() <= piece[-1].x()
        ]
        away, curve = min(near, key=lambda one: one[0], default=(math.inf, None))
        self.pointed.emit(curve.element if curve is not None and away < _NEAR else -1)

    def leaveEvent(self, event: QEvent) -> None:
        self.pointed.emit(-1)

    # How it is drawn.

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, area, theme = QPainter(self), self._area, current()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(area, QColor(theme.base))
        self._paint_words(painter, area)
        if not self.curves:
            paint_empty(painter, area, self._empty)
            return
        painter.setClipRect(area)
        for curve in sorted(self.curves, key=lambda curve: curve.element == self._marked >= 0):
            bold = curve.element == self._marked >= 0
            painter.setPen(QPen(series(curve.number), 3.0 if bold else _THIN))
            for piece in self._places(curve):
                painter.drawPolyline(QPolygonF(piece))

    def _paint_words(self, painter: QPainter, area: QRectF) -> None:
        theme, flags, line = current(), Qt.AlignmentFlag, painter.fontMetrics().height()
        painter.setPen(QPen(QColor(theme.line), 1))
        painter.drawRect(area)
        middle = area.center().y()
        painter.drawLine(QPointF(area.left(), middle), QPointF(area.right(), middle))
        painter.setPen(QColor(theme.faint))
        tops = area.top(), area.bottom() - line
        for words, top in zip(self._ends, tops, strict=True) if self.curves else ():
            box = QRectF(0, top, area.left() - 4, line)
            painter.drawText(box, flags.AlignRight | flags.AlignVCenter, words)
        below = QRectF(area.left(), area.bottom() + 2, area.width(), line)
        ends = ((self._span[0], flags.AlignLeft), (self._span[1], flags.AlignRight))
        for value, side in ends if self.curves else ():
            words = f"{in_digits(value, self._span[1] - self._span[0])} {self._x_unit}"
            painter.drawText(below, side | flags.AlignVCenter, words)
        painter.setPen(QColor(theme.text))
        head = f"{self._title}, {self._unit}"
        painter.drawText(QPointF(4, painter.fontMetrics().ascent() + 1), head)
        x = 4.0 + painter.fontMetrics().horizontalAdvance(head) + 12
        for curve in self.curves:
            painter.setPen(series(curve.number))
            painter.drawText(QPointF(x, painter.fontMetrics().ascent() + 1), curve.name)
            x += painter.fontMetrics().horizontalAdvance(curve.name) + 8


def paint_empty(painter: QPainter, area: QRectF, text: str) -> None:
    """Write a text in the middle of a plot without values."""
    painter.setPen(QColor(current().faint))
    flags = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
    painter.drawText(area.adjusted(6, 2, -6, -2), flags, text)


def as_seen(x: Array, y: Array) -> tuple[Array, Array]:
    """A piece of a curve by what is seen of it: in each column of px its lowest and highest.

    Of 10 s at 500 readings a second all take ten times as long to draw.
    """
    if len(x) <= _DENSE * (x[-1] - x[0]):
        return x, y
    begins = np.flatnonzero(np.diff(np.floor(x), prepend=-np.inf))
    lowest, highest = (reduce(y, begins) for reduce in (np.minimum.reduceat, np.maximum.reduceat))
    return np.repeat(x[begins], 2), np.stack([lowest, highest], axis=1).ravel()
