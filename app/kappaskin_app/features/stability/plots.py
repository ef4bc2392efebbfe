"""Plots of the observability: singular values, and one mode as a map."""

import math

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QImage, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from kappaskin.frames import Array
from kappaskin.sensing import SensorLayout
from kappaskin_app.features.stability.observability import Spectrum
from kappaskin_app.theme import DIVERGING, current
from kappaskin_app.widgets.plots import LogAxis, paint_empty
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
        return QSize(170, 130)

    def show_surface(self, surface: Array | None, layout: SensorLayout | None) -> None:
        self._surface, self._layout = surface, layout
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        if self._surface is None or self._layout is None:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        area = self._area(self._layout)
        # y points up on the skin, down in an image.
        rgb = Tint(DIVERGING, (-1.0, 1.0), "").rgb(self._surface[::-1], current().window)
        ny, nx = self._surface.shape
        image = QImage(
            np.ascontiguousarray(rgb).tobytes(), nx, ny, 3 * nx, QImage.Format.Format_RGB888
        )
        painter.drawImage(area, image)
        painter.setPen(QPen(QColor(current().line), 1))
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
        patch, alive = layout.patch, layout.alive
        painter.setPen(QPen(QColor("#16191d"), 1))
        for element, (x, y) in enumerate((layout.positions / (patch.a, patch.b)).tolist()):
            at = QPointF(area.left() + x * area.width(), area.bottom() - y * area.height())
            if alive[element]:
                painter.drawPoint(at)
            else:
                for way in (QPointF(2.5, 2.5), QPointF(2.5, -2.5)):
                    painter.drawLine(at - way, at + way)


_TOP, _RIGHT = 10.0, 12.0
_AXIS = "Singular value (vertical) of each mode"
_POWERS = str.maketrans(
    "-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"
)
_STEPS = {Qt.Key.Key_Left: -1, Qt.Key.Key_Right: 1, Qt.Key.Key_Down: -1, Qt.Key.Key_Up: 1}


class SpectrumPlot(QWidget):
    """Draws a `Spectrum`; a click or the arrow keys select a mode by its number from 1."""

    chosen = Signal(int)

    def __init__(self) -> None:
        super().__init__()
        self.spectrum: Spectrum | None = None
        self._number, self._empty = 0, ""
        self._axis = LogAxis(0.1, 1.0)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName("Singular values")
        self.setToolTip(
            "Observability of each mode: the singular values of the curvature operator M (Eq. 2) "
            "with columns of unit length. The noise of a mode is inversely proportional to its "
            "value. Click a value, or use the arrow keys, to show its mode."
        )

    def sizeHint(self) -> QSize:
        return QSize(420, 190)

    def minimumSizeHint(self) -> QSize:
        metrics = self.fontMetrics()
        return QSize(metrics.horizontalAdvance(_AXIS) + 4, 8 * metrics.height())

    def show_spectrum(self, spectrum: Spectrum | None, number: int, empty: str) -> None:
        """Draw it with a ring around the mode `number`; without a spectrum, the text `empty`."""
        self.spectrum, self._number, self._empty = spectrum, number, empty
        if spectrum is not None:
            floor = max(spectrum.floor, 1e-300)
            values = [v / 1.3 for v in spectrum.values.tolist() if v > floor]
            values += [float(spectrum.values[0]), *([floor / 30] if spectrum.silent else [])]
            self._axis = LogAxis.around(values)  # with room for the ring around the last one
        self.update()

    @property
    def _area(self) -> QRectF:
        metrics = self.fontMetrics()
        left, below = metrics.horizontalAdvance(_power(2e-10)) + 8, 2 * metrics.height() + 2
        return QRectF(self.rect()).adjusted(left, _TOP, -_RIGHT, -below)

    def place_of(self, number: int) -> QPointF:
        """Position of the value of the mode `number`; an unobservable one is at the floor."""
        area, spectrum = self._area, self.spectrum
        if spectrum is None:
            return area.center()
        count = len(spectrum.values)
        x = area.left() + (number - 0.5) / count * area.width()
        value = max(float(spectrum.values[number - 1]), spectrum.floor)
        return QPointF(x, area.bottom() - self._axis.share(value) * area.height())

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if self.spectrum is None or event.button() != Qt.MouseButton.LeftButton:
            return
        area, count = self._area, len(self.spectrum.values)
        along = (event.position().x() - area.left()) / area.width()
        self.chosen.emit(min(max(math.floor(along * count) + 1, 1), count))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        step = _STEPS.get(Qt.Key(event.key()))
        if step is None or self.spectrum is None:
            super().keyPressEvent(event)
        else:
            self.chosen.emit(self._number + step)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, area, theme = QPainter(self), self._area, current()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(area, QColor(theme.base))
        spectrum = self.spectrum
        if spectrum is None:
            paint_empty(painter, area, self._empty)
            return
        self._paint_axes(painter, area, len(spectrum.values))
        size = min(max(0.35 * area.width() / len(spectrum.values), 1.5), 4.0)
        painter.setPen(Qt.PenStyle.NoPen)
        for number, value in enumerate(spectrum.values.tolist(), 1):
            silent = value <= spectrum.floor
            painter.setBrush(QColor(theme.alert if silent else theme.accent))
            painter.drawEllipse(self.place_of(number), size, size)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        if self._number:
            painter.setPen(QPen(QColor(theme.text), 2.5 if self.hasFocus() else 1.5))
            painter.drawEllipse(self.place_of(self._number), 7, 7)

    def _paint_axes(self, painter: QPainter, area: QRectF, count: int) -> None:
        theme, flags = current(), Qt.AlignmentFlag
        line = painter.fontMetrics().height()
        free = -math.inf
        # From the top, where values of 1 are: labels without space are omitted below.
        for value, written in reversed(self._axis.ticks()):
            y = area.bottom() - self._axis.share(value) * area.height()
            if not written or y - free < 1.3 * line:
                continue
            free = y
            painter.setPen(QPen(QColor(theme.line), 1))
            painter.drawLine(QPointF(area.left(), y), QPointF(area.right(), y))
            painter.setPen(QColor(theme.faint))
            top = min(y - line / 2, area.bottom() - line + 3)
            box = QRectF(0, top, area.left() - 5, line)
            painter.drawText(box, flags.AlignRight | flags.AlignVCenter, _power(value))
        for number in sorted({1, (count + 1) // 2, count}):
            x = self.place_of(number).x()
            box = QRectF(x - 2 * line, area.bottom() + 1, 4 * line, line)
            painter.setPen(QColor(theme.faint))
            painter.drawText(box, flags.AlignCenter, f"{number}")
        below = QRectF(0, self.height() - line - 1, self.width(), line)
        painter.drawText(below, flags.AlignCenter, _AXIS)
        painter.setPen(QPen(QColor(theme.line), 1))
        painter.drawRect(area)


def _power(value: float) -> str:
    """A round value; a power of ten where it has many digits."""
    if 1e-3 < value * 1.0000001 < 1e4:
        return f"{value:g}"
    power = math.floor(math.log10(value) + 1e-9)
    digit = round(value / 10.0**power)
    ten = "10" + str(power).translate(_POWERS)
    return ten if digit == 1 else f"{digit}\N{MIDDLE DOT}{ten}"
