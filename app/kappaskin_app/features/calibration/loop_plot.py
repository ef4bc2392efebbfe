"""One channel of a calibration: what it read on each cylinder, its line and its loop (Fig. 8)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from kappaskin_app.theme import LIGHT, Theme

Array = NDArray[np.float64]

_TOP, _RIGHT = 8.0, 10.0
_HIGH = 158  # px of the plot without the words below it
_APART = 6.0  # px between two numbers
_AXES = "read (up) on applied, 1/m"


@dataclass(frozen=True, eq=False)
class Loop:
    """Readings (n,) on curvatures `applied` (n,), both in 1/m, in the order they were taken.

    `back` (n,) tells the way to larger radii; a new round begins where `begins` (n,) says so.
    """

    applied: Array
    read: Array
    back: NDArray[np.bool_]
    begins: NDArray[np.bool_]
    gain: float
    offset: float


class LoopPlot(QWidget):
    """Draws a `Loop`: filled points on the way there, open ones on the way back."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._loop: Loop | None = None
        self._theme = LIGHT
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setToolTip(
            "Nominal curvature as Eq. 8 reads it, 4 V / (V_in GF (t_s + t_g) G), over that of the "
            "cylinder. Dashed: the line of the calibration. Filled points: to smaller radii; "
            "open ones: back. What lies between the two ways is hysteresis."
        )

    def sizeHint(self) -> QSize:
        return QSize(280, _HIGH + 2 * self.fontMetrics().height())

    def minimumSizeHint(self) -> QSize:
        wide = self.fontMetrics().horizontalAdvance(_AXES) + 4
        return QSize(max(220, wide), self.sizeHint().height())

    def show_loop(self, loop: Loop) -> None:
        self._loop = loop
        self.update()

    def show_theme(self, theme: Theme) -> None:
        self._theme = theme
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        loop, theme = self._loop, self._theme
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if loop is None or not np.isfinite(loop.read).any():
            area = self._area(0.0)
            painter.fillRect(area, QColor(theme.base))
            painter.setPen(QColor(theme.faint))
            painter.drawText(area, Qt.AlignmentFlag.AlignCenter, "No readings")
            return
        most = 1.08 * max(
            float(np.abs(loop.applied).max()), float(np.nanmax(np.abs(loop.read))), 1e-9
        )
        ticks = _ticks(most)
        widest = max(map(self.fontMetrics().horizontalAdvance, ticks.values()))
        area = self._area(widest)
        painter.fillRect(area, QColor(theme.base))

        def at(x: float, y: float) -> QPointF:
            return QPointF(
                area.center().x() + x / most * area.width() / 2,
                area.center().y() - y / most * area.height() / 2,
            )

        self._paint_axes(painter, area, most, ticks, widest)
        painter.setClipRect(area.adjusted(-4, -4, 4, 4))
        if math.isfinite(loop.gain):
            painter.setPen(QPen(QColor(theme.faint), 1.5, Qt.PenStyle.DashLine))
            ends = (at(x, loop.offset + loop.gain * x) for x in (-most, most))
            painter.drawLine(*ends)
        accent = QColor(theme.accent)
        painter.setPen(QPen(accent, 1))
        rounds = np.split(np.arange(len(loop.read)), np.flatnonzero(loop.begins)[1:])
        points = [at(x, y) for x, y in zip(loop.applied, loop.read, strict=True)]
        good = np.isfinite(loop.read)
        for turn in rounds:
            painter.drawPolyline(QPolygonF([points[k] for k in turn if good[k]]))
        for k in np.flatnonzero(good):
            painter.setBrush(QColor(theme.base) if loop.back[k] else accent)
            painter.drawEllipse(points[k], 2.6, 2.6)

    def _area(self, widest: float) -> QRectF:
        """Where the loop is drawn, beside numbers that are so many px wide."""
        below = 2 * self.fontMetrics().height() + 2
        return QRectF(self.rect()).adjusted(widest + 6, _TOP, -_RIGHT, -below)

    def _paint_axes(
        self, painter: QPainter, area: QRectF, most: float, ticks: dict[float, str], widest: float
    ) -> None:
        theme, flags = self._theme, Qt.AlignmentFlag
        line = painter.fontMetrics().height()
        painter.setPen(QPen(QColor(theme.line), 1))
        painter.drawRect(area)
        step = _round(most) / most / 2
        # Every so many of them, so that no two lie over each other.
        beside = math.ceil((widest + _APART) / (step * area.width()))
        above = math.ceil(line / (step * area.height()))
        for number, (value, words) in enumerate(ticks.items(), -(len(ticks) // 2)):
            x = area.center().x() + value / most * area.width() / 2
            y = area.center().y() - value / most * area.height() / 2
            painter.setPen(QPen(QColor(theme.line), 1))
            painter.drawLine(QPointF(x, area.top()), QPointF(x, area.bottom()))
            painter.drawLine(QPointF(area.left(), y), QPointF(area.right(), y))
            painter.setPen(QColor(theme.faint))
            if not number % above:
                box = QRectF(0, y - line / 2, area.left() - 4, line)
                painter.drawText(box, flags.AlignRight | flags.AlignVCenter, words)
            if not number % beside:
                box = QRectF(x - widest, area.bottom() + 1, 2 * widest, line)
                painter.drawText(box, flags.AlignCenter, words)
        below = QRectF(0, self.height() - line - 1, self.width(), line)
        painter.drawText(below, flags.AlignCenter, _AXES)


def _ticks(most: float) -> dict[float, str]:
    """Round values on both sides of zero up to `most`, and how they are written."""
    step = _round(most)
    values = (np.arange(-math.floor(most / step), math.floor(most / step) + 1) * step).tolist()
    return {value: f"{value:g}".replace("-", "\N{MINUS SIGN}") for value in values}


def _round(most: float) -> float:
    """A distance of ticks that gives two to four on each side."""
    power = 10.0 ** math.floor(math.log10(most / 2))
    return next(m * power for m in (5.0, 2.0, 1.0) if m * power <= most / 2)
