"""A radius as a circle to scale, standing on the skin, with its error bar and a scale bar."""

import math

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPainterPath, QPen

from kappaskin_app.features.presenter.board import Board
from kappaskin_app.features.presenter.cue import Roundness
from kappaskin_app.shell.scale import SteadyRange
from kappaskin_app.widgets.lettering import CAPTION, LEFT, Words

_LEAST, _MOST = 0.02, 0.2  # m of radius that fill the picture: a larger circle leaves it
_MARGIN = 0.04  # of the picture's height
_BAR = 0.3  # of the picture's width that the scale bar takes at most
_SHARP = 0.6  # of the picture's height that an edge is drawn high


class RoundView(Board):
    """The circles all touch the skin where the object does: the band lies between two of them."""

    def __init__(self) -> None:
        super().__init__()
        self._range = SteadyRange(_LEAST)
        self.roundness: Roundness | None = None
        self.edge = False
        self.setMinimumHeight(60)

    def show_roundness(self, roundness: Roundness | None, edge: bool, now: float) -> None:
        """A radius at `now` in s, or an edge, or nothing."""
        self.roundness, self.edge = roundness, edge
        if roundness is not None:
            known = [r for r in (roundness.radius, *roundness.between) if 0 < r < math.inf]
            self._range.follow(min(max(known, default=_LEAST), _MOST), now)
        self.update()

    @property
    def per_metre(self) -> float:
        """Pixels per metre: the largest circle of late fills the height."""
        return self.height() * (1 - 2 * _MARGIN) / (2 * self._range.limit)

    @property
    def bar(self) -> float:
        """The length in m of the scale bar: a round one."""
        most = _BAR * self.width() / self.per_metre
        return next(
            b for b in (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 0.0) if b <= most
        )

    @property
    def foot(self) -> QPointF:
        """Where the object touches the skin."""
        return QPointF(self.width() / 2, self.height() * (1 - _MARGIN))

    def circle(self, radius: float) -> QRectF:
        """Where a circle of `radius` in m is drawn."""
        r, foot = radius * self.per_metre, self.foot
        return QRectF(foot.x() - r, foot.y() - 2 * r, 2 * r, 2 * r)

    def draw(self, painter: QPainter) -> None:
        theme, foot = self.theme, self.foot
        painter.setClipRect(self.rect())
        if self.roundness is not None:
            self._draw_round(painter, self.roundness)
        elif self.edge:
            self._draw_edge(painter)
        pen = QPen(QColor(theme.text), max(2.0, 4 * self.unit))
        painter.setPen(pen)
        painter.drawLine(
            QPointF(0.16 * self.width(), foot.y()), QPointF(0.84 * self.width(), foot.y())
        )
        bar = self._bar_place
        painter.drawLine(bar.bottomLeft(), bar.bottomRight())
        for x in (bar.left(), bar.right()):
            painter.drawLine(QPointF(x, bar.bottom() - 8 * self.unit), QPointF(x, bar.bottom()))

    def _draw_round(self, painter: QPainter, round_: Roundness) -> None:
        theme, (low, high) = self.theme, round_.between
        band = QPainterPath()
        band.addRect(QRectF(0, 0, self.width(), self.foot.y())) if high == math.inf else (
            band.addEllipse(self.circle(high))
        )
        inner = QPainterPath()
        inner.addEllipse(self.circle(low))
        painter.fillPath(band.subtracted(inner), self.clear(theme.accent, 0.45))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        width = max(2.0, 4 * self.unit)
        if math.isfinite(round_.radius):
            painter.setPen(QPen(QColor(theme.accent), width))
            painter.drawEllipse(self.circle(round_.radius))
        elif high < math.inf:
            painter.setPen(QPen(QColor(theme.accent), width, Qt.PenStyle.DashLine))
            painter.drawEllipse(self.circle(high))

    def _draw_edge(self, painter: QPainter) -> None:
        foot, high = self.foot, _SHARP * self.height()
        painter.setPen(QPen(QColor(self.theme.accent), max(2.0, 4 * self.unit)))
        for side in (-1, 1):
            painter.drawLine(foot, QPointF(foot.x() + side * high, foot.y() - high))

    @property
    def _bar_place(self) -> QRectF:
        high = 2 * CAPTION * self.unit
        return QRectF(2, 0, self.bar * self.per_metre, high)

    def words(self) -> list[Words]:
        place = self._bar_place
        place.setWidth(0.5 * self.width())
        place.setHeight(place.height() - 6 * self.unit)
        text = f"{1e3 * self.bar:g} mm"
        return [Words(text, self.letters(CAPTION), place, align=LEFT)]
