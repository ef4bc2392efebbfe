"""One shape of the skin as a map of colours on its outline, with the elements on it."""

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from kappaskin.sensing import SensorLayout
from kappaskin_app.theme import DIVERGING, LIGHT, Theme
from kappaskin_app.widgets.tint import Tint

Array = NDArray[np.float64]

_THINNEST = 0.2  # of the longer side, so that a narrow skin is seen


class ModeMap(QWidget):
    """Draws a surface (ny, nx) between -1 and 1, NaN off the skin; dead elements are crossed."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._surface: Array | None = None
        self._layout: SensorLayout | None = None
        self._theme = LIGHT
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(120, 70)
        self.setToolTip(
            "Where the chosen shape moves the skin, inward in one colour and outward in the other, "
            "of an arbitrary height. Dots: elements; crosses: dead ones."
        )

    def sizeHint(self) -> QSize:
        return QSize(170, 130)

    def show_surface(self, surface: Array | None, layout: SensorLayout | None) -> None:
        self._surface, self._layout = surface, layout
        self.update()

    def show_theme(self, theme: Theme) -> None:
        self._theme = theme
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        if self._surface is None or self._layout is None:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        area = self._area(self._layout)
        # y points up on the skin, down in an image.
        rgb = Tint(DIVERGING, (-1.0, 1.0), "").rgb(self._surface[::-1], self._theme.window)
        ny, nx = self._surface.shape
        image = QImage(
            np.ascontiguousarray(rgb).tobytes(), nx, ny, 3 * nx, QImage.Format.Format_RGB888
        )
        painter.drawImage(area, image)
        painter.setPen(QPen(QColor(self._theme.line), 1))
        painter.drawRect(area)
        self._paint_elements(painter, area, self._layout)

    def _area(self, layout: SensorLayout) -> QRectF:
        ratio = min(max(layout.patch.a / layout.patch.b, _THINNEST), 1 / _THINNEST)
        width, height = self.width() - 2.0, self.height() - 2.0
        width, height = min(width, height * ratio), min(height, width / ratio)
        area = QRectF(0, 0, width, height)
        area.moveCenter(QPointF(self.width() / 2, self.height() / 2))
        return area

    def _paint_elements(self, painter: QPainter, area: QRectF, layout: SensorLayout) -> None:
        patch, alive = layout.patch, np.any(layout.live, axis=0)
        painter.setPen(QPen(QColor("#16191d"), 1))
        for element, (x, y) in enumerate((layout.positions / (patch.a, patch.b)).tolist()):
            at = QPointF(area.left() + x * area.width(), area.bottom() - y * area.height())
            if alive[element]:
                painter.drawPoint(at)
            else:
                for way in (QPointF(2.5, 2.5), QPointF(2.5, -2.5)):
                    painter.drawLine(at - way, at + way)
