"""A surface as a map in colours, seen from above, with its scale and where the contact is."""

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QVBoxLayout, QWidget

from kappaskin.frames import Array
from kappaskin_app.theme import DARK_INK, LIGHT_INK, Colours, current, follow_look
from kappaskin_app.widgets.colour_bar import ColourBar
from kappaskin_app.widgets.line import Line
from kappaskin_app.widgets.parts import Label
from kappaskin_app.widgets.tint import Part, Tint

_DOT = 1.8  # px, the radius of a point
_LINES = 5  # of letters, as high as a map is at least
_CROSS = 6.0  # px from the middle of a contact's cross to its ends


class _Map(QWidget):
    """The colours, in the proportions of the skin."""

    def __init__(self) -> None:
        super().__init__()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self._image: QImage | None = None
        self._contact, self._sides, self._faded = np.full(2, np.nan), (1.0, 1.0), False
        self._points: Array | None = None
        self._outline: Array | None = None

    def sizeHint(self) -> QSize:
        return QSize(180, 180)

    def minimumSizeHint(self) -> QSize:
        side = _LINES * self.fontMetrics().height()
        return QSize(side, side)

    def show_map(self, rgb: Colours | None, contact: Array, sides: tuple[float, float]) -> None:
        """Colours (ny, nx, 3), None for nothing; the contact (2,) in m on a skin with `sides`."""
        self._image = None
        if rgb is not None:
            ny, nx, _ = rgb.shape
            # y points up on the skin, down in an image.
            data = np.ascontiguousarray(rgb[::-1]).tobytes()
            self._image = QImage(data, nx, ny, 3 * nx, QImage.Format.Format_RGB888).copy()
        self._contact, self._sides = contact, sides
        self.update()

    def show_points(self, positions: Array | None, outline: Array | None = None) -> None:
        """Mark places (P, 2) in m on the skin, or none, within its `outline` (k, 2), else a box."""
        self._points, self._outline = positions, outline
        self.update()

    def show_faded(self, faded: bool) -> None:
        if faded != self._faded:
            self._faded = faded
            self.update()

    def area(self) -> QRectF:
        """Where the skin is drawn: as large as fits."""
        a, b = self._sides
        width, height = float(self.width() - 2), float(self.height() - 2)
        width, height = min(width, height * a / b), min(height, width * b / a)
        return QRectF((self.width() - width) / 2, (self.height() - height) / 2, width, height)

    def paintEvent(self, event: QPaintEvent) -> None:
        with QPainter(self) as painter:
            self._paint(painter, self.area())

    def _paint(self, painter: QPainter, area: QRectF) -> None:
        if self._image is not None:
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
            painter.setOpacity(0.3 if self._faded else 1.0)
            painter.drawImage(area, self._image)
            painter.setOpacity(1.0)
        painter.setPen(QPen(QColor(current().line), 1))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, self._outline is not None)
        if self._outline is None:
            painter.drawRect(area)
        else:
            painter.drawPolygon([self._at(area, *at) for at in self._outline.tolist()])
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if self._points is not None:
            painter.setPen(QPen(QColor(DARK_INK), 1))
            painter.setBrush(QColor(LIGHT_INK))
            for x, y in self._points.tolist():
                painter.drawEllipse(self._at(area, x, y), _DOT, _DOT)
        if self._image is not None and np.isfinite(self._contact).all():
            self._paint_cross(painter, area)

    def _at(self, area: QRectF, x: float, y: float) -> QPointF:
        a, b = self._sides
        return QPointF(area.left() + x / a * area.width(), area.bottom() - y / b * area.height())

    def _paint_cross(self, painter: QPainter, area: QRectF) -> None:
        at = self._at(area, *self._contact.tolist())
        for colour, width in (("#16191d", 4), ("#ffffff", 2)):  # seen on every colour
            painter.setPen(QPen(QColor(colour), width))
            for d in (QPointF(_CROSS, _CROSS), QPointF(_CROSS, -_CROSS)):
                painter.drawLine(at - d, at + d)


class SurfaceMap(QWidget):
    """A titled map with its scale and a line of words below."""

    def __init__(self, title: str, unit: str, tip: str) -> None:
        super().__init__()
        self.title, self.words = Label(title), Line()
        bold = self.title.font()
        bold.setBold(True)
        self.title.setFont(bold)
        self.map, self.bar, self.unit = _Map(), ColourBar(), unit
        self._tint = Tint("sequential", (0.0, 1.0), unit)
        self.bar.show_tint(self._tint)
        self._values: Array | None = None
        self._sides, self._contact = (1.0, 1.0), np.full(2, np.nan)
        self.setAccessibleName(title)
        for widget in (self, self.words):
            widget.setToolTip(tip)
        beside, around = QHBoxLayout(), QVBoxLayout(self)
        beside.setSpacing(0)
        around.setContentsMargins(0, 0, 0, 0)
        around.setSpacing(2)
        beside.addWidget(self.map, 1)
        beside.addWidget(self.bar)
        around.addWidget(self.title, 0, Qt.AlignmentFlag.AlignLeft)
        around.addLayout(beside, 1)
        around.addWidget(self.words)
        follow_look(self, self._show)

    def show_surface(
        self,
        values: Array | None,
        limits: tuple[float, float],
        part: Part,
        contact: Array,
        sides: tuple[float, float],
        noise: float = 0.0,
    ) -> None:
        """Show `values` (ny, nx) in the unit of the scale, NaN off the skin; None for nothing.

        `part` of the colour map is used; `noise` is the standard deviation of a value.
        """
        self._values, self._contact, self._sides = values, contact, sides
        self._tint = Tint(part, limits, self.unit, noise=noise)
        self.bar.show_tint(self._tint)
        self._show()

    def _show(self) -> None:
        rgb = None
        if self._values is not None:
            rgb = self._tint.rgb(self._values, current().window)
        self.map.show_map(rgb, self._contact, self._sides)
