"""Plots of the observability: singular values, and one mode as a map."""

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QImage, QKeyEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from kappaskin.frames import Array
from kappaskin.sensing import SensorLayout
from kappaskin_app.features.stability.observability import Spectrum
from kappaskin_app.guard import guarded
from kappaskin_app.theme import current
from kappaskin_app.widgets.chart import Chart, ChartAxis, ChartLine, Series
from kappaskin_app.widgets.tint import Tint

_THINNEST = 0.2  # of the longer side, so that a narrow skin is visible


class ModeMap(QWidget):
    """Draws a surface (ny, nx) between -1 and 1, NaN off the skin; dead elements are crossed."""

    def __init__(self) -> None:
        super().__init__()
        self._surface: Array | None = None
        self._layout: SensorLayout | None = None
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(120, 70)
        self.setToolTip(
            "Displacement of the selected mode, inward in one colour and outward in the other, on "
            "an arbitrary scale. Dots: elements; crosses: dead elements."
        )

    def sizeHint(self) -> QSize:
        return QSize(170, 70)  # else the text below has no room

    def show_surface(self, surface: Array | None, layout: SensorLayout | None) -> None:
        self._surface, self._layout = surface, layout
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        if self._surface is not None and self._layout is not None:
            with QPainter(self) as painter:
                self._paint(painter, self._surface, self._layout)

    def _paint(self, painter: QPainter, surface: Array, layout: SensorLayout) -> None:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        area = self._area(layout)
        # y points up on the skin, down in an image.
        rgb = Tint("diverging", (-1.0, 1.0), "").rgb(surface[::-1], current().window)
        ny, nx = surface.shape
        image = QImage(
            np.ascontiguousarray(rgb).tobytes(), nx, ny, 3 * nx, QImage.Format.Format_RGB888
        )
        painter.drawImage(area, image)
        painter.setPen(QPen(QColor(current().line), 1))
        painter.drawRect(area)
        self._paint_elements(painter, area, layout)

    def _area(self, layout: SensorLayout) -> QRectF:
        ratio = min(max(layout.patch.a / layout.patch.b, _THINNEST), 1 / _THINNEST)
        width, height = self.width() - 2.0, self.height() - 2.0
        width, height = min(width, height * ratio), min(height, width / ratio)
        area = QRectF(0, 0, width, height)
        area.moveCenter(QPointF(self.width() / 2, self.height() / 2))
        return area

    def _paint_elements(self, painter: QPainter, area: QRectF, layout: SensorLayout) -> None:
        patch, alive = layout.patch, layout.alive
        painter.setPen(QPen(QColor("#16191d"), 1))
        for element, (x, y) in enumerate((layout.positions / (patch.a, patch.b)).tolist()):
            at = QPointF(area.left() + x * area.width(), area.bottom() - y * area.height())
            if alive[element]:
                painter.drawPoint(at)
            else:
                for way in (QPointF(2.5, 2.5), QPointF(2.5, -2.5)):
                    painter.drawLine(at - way, at + way)


_AXES = ChartAxis("Singular value", log=True), ChartAxis("Mode")
_TIP = (
    "Observability of each mode: the singular values of the curvature operator M (Eq. 2) "
    "with columns of unit length. The noise of a mode is inversely proportional to its "
    "value. Click a value, or use the arrow keys, to show its mode."
)
_STEPS = {Qt.Key.Key_Left: -1, Qt.Key.Key_Right: 1, Qt.Key.Key_Down: -1, Qt.Key.Key_Up: 1}


class SpectrumPlot(Chart):
    """Draws a `Spectrum`; a click or the arrow keys select a mode by its number from 1."""

    chosen = Signal(int)

    def __init__(self) -> None:
        super().__init__(*_AXES, _TIP)
        self.spectrum: Spectrum | None = None
        self._number = 0
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("Singular values")
        self.clicked.connect(guarded(lambda at: self.chosen.emit(round(at.series.x[at.index]))))

    def show_spectrum(self, spectrum: Spectrum | None, number: int, empty: str) -> None:
        """Draw it with a ring around the mode `number`; without a spectrum, the text `empty`."""
        self.spectrum, self._number = spectrum, number
        if spectrum is None:
            self.show_series([], empty)
            return
        modes = np.arange(1.0, len(spectrum.values) + 1)
        silent = spectrum.values <= spectrum.floor
        values = np.maximum(spectrum.values, spectrum.floor)
        ring = modes == number
        shown = [
            Series("observable", modes[~silent], values[~silent], "accent", "", "o", 6.0),
            Series("selected", modes[ring], values[ring], "text", "", "o", 15.0, False),
        ]
        lines = []
        if silent.any():  # at the floor, below which rounding decides
            lines = [ChartLine(spectrum.floor, "alert")]
            shown += [Series("unobservable", modes[silent], values[silent], "alert", "", "o", 6.0)]
        self.show_series(shown, lines=lines)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        step = _STEPS.get(Qt.Key(event.key()))
        if step is None or self.spectrum is None:
            super().keyPressEvent(event)
        else:
            self.chosen.emit(self._number + step)
