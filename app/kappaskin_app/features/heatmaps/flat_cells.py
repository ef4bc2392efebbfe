"""The elements of a skin as cells of colour on a widget, marked, and pointed at with the mouse."""

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QImage, QMouseEvent, QPainter, QPainterPath, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from kappaskin.sensing import SensorLayout
from kappaskin_app.theme import DARK_INK, WANTED, Colours

Indices = NDArray[np.intp]

_LETTERS: dict[str, str] = dict(
    zip(
        ("spike", "stuck", "noisy", "swapped", "offset", "dead", "saturated", "drifting"),
        "PSNXODRT",
        strict=True,
    )
)

_LEGIBLE = 9  # px at least, of a letter
_ROOM = 18.0  # px of a cell with room for a letter in a ring


class FlatCells(QWidget):
    """The elements, drawn as cells that tile a regular grid or as squares where they are."""

    pointed = Signal(int)
    chosen = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._layout: SensorLayout | None = None
        self._colours: Colours = np.empty((0, 3), np.uint8)
        self._line = QColor("#888888")
        self._under, self._faded = -1, False
        self._marks: tuple[list[int], ...] = ([], [])
        self._kinds: dict[int, str] = {}
        self._wanted = -1
        self.setMouseTracking(True)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(90, 90)

    def sizeHint(self) -> QSize:
        return QSize(200, 200)

    def show_layout(self, layout: SensorLayout) -> None:
        self._layout = layout
        self._under, self._marks, self._kinds, self._wanted = -1, ([], []), {}, -1

    def _spacing(self) -> float:
        """What separates the two nearest elements, in m: squares of that side hide none."""
        positions = self._layout.positions if self._layout else np.empty((0, 2))
        if len(positions) < 2 or self._layout is None:
            return 0.2 * self._layout.patch.a if self._layout else 1.0
        apart = np.max(np.abs(positions[:, None] - positions[None]), axis=-1)
        nearest = float(np.min(apart + np.where(np.eye(len(positions)), np.inf, 0.0)))
        return max(0.9 * nearest, 0.02 * self._layout.patch.a)

    def show_cells(self, rgb: Colours) -> None:
        self._colours = rgb
        self.update()

    def show_marks(self, crossed: Indices, dotted: Indices, kinds: dict[int, str]) -> None:
        """Cross out and dot elements by number, and ring those of some kind in `FAULTS`."""
        marks = (crossed.tolist(), dotted.tolist())
        if (marks, kinds) != (self._marks, self._kinds):
            self._marks, self._kinds = marks, kinds
            self.update()

    def show_wanted(self, element: int) -> None:
        """Frame the element that is to be pressed; -1 for none."""
        if element != self._wanted:
            self._wanted = element
            self.update()

    def show_faded(self, faded: bool) -> None:
        if faded != self._faded:
            self._faded = faded
            self.update()

    def show_line(self, colour: str) -> None:
        self._line = QColor(colour)
        self.update()

    def area_of_patch(self) -> QRectF:
        """The patch on the widget: as large as fits, in its own proportions."""
        patch = self._layout.patch if self._layout else None
        ratio = patch.a / patch.b if patch else 1.0
        width, height = float(self.width() - 2), float(self.height() - 2)
        width, height = min(width, height * ratio), min(height, width / ratio)
        return QRectF((self.width() - width) / 2, (self.height() - height) / 2, width, height)

    def _squares(self, area: QRectF) -> list[QRectF]:
        """One square for each element that stands alone."""
        layout = self._layout
        if layout is None:
            return []
        side = self._spacing() * area.width() / layout.patch.a
        return [
            QRectF(c.x() - side / 2, c.y() - side / 2, side, side)
            for c in (self.pixel_of(area, x, y) for x, y in layout.positions)
        ]

    def pixel_of(self, area: QRectF, x: float, y: float) -> QPointF:
        patch = self._layout.patch if self._layout else None
        a, b = (patch.a, patch.b) if patch else (1.0, 1.0)
        return QPointF(area.left() + x / a * area.width(), area.bottom() - y / b * area.height())

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        area = self.area_of_patch()
        layout = self._layout
        if layout is None or len(self._colours) != len(layout):
            return
        painter.setOpacity(0.3 if self._faded else 1.0)
        if layout.shape:
            m, n = layout.shape
            # y points up on the skin, down in an image.
            rgb = np.ascontiguousarray(self._colours.reshape(n, m, 3)[::-1])
            painter.drawImage(area, QImage(rgb.tobytes(), m, n, 3 * m, QImage.Format.Format_RGB888))
        else:
            painter.setPen(QPen(self._line, 1))  # or those near zero are lost on a light ground
            for square, rgb in zip(self._squares(area), self._colours, strict=True):
                painter.setBrush(QColor(*(int(v) for v in rgb)))
                painter.drawRect(square)
            painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setOpacity(1.0)
        painter.setPen(QPen(self._line, 1))
        painter.drawRect(area)
        self._paint_marks(painter, area)
        self._paint_kinds(painter, area)
        if self._wanted >= 0:
            self._frame(painter, self._cell(area, self._wanted))
        if self._under >= 0:
            cell = self._cell(area, self._under)
            for colour, width in (("#16191d", 4), ("#ffffff", 2)):  # seen on every colour
                painter.setPen(QPen(QColor(colour), width))
                painter.drawRect(cell)

    def _frame(self, painter: QPainter, cell: QRectF) -> None:
        """A frame around what is to be pressed, wider than the cell: seen at a glance."""
        around = cell.adjusted(-3, -3, 3, 3)
        for colour, width in (("#16191d", 6), (WANTED, 3)):
            painter.setPen(QPen(QColor(colour), width))
            painter.drawRect(around)

    def _paint_marks(self, painter: QPainter, area: QRectF) -> None:
        crossed, dotted = self._marks
        for colour, width in (("#16191d", 3), ("#ffffff", 1)):  # seen on every colour
            painter.setPen(QPen(QColor(colour), width))
            for element in crossed:
                cell = self._cell(area, element)
                painter.drawLine(cell.topLeft(), cell.bottomRight())
                painter.drawLine(cell.bottomLeft(), cell.topRight())
            painter.setBrush(QColor(colour))
            for element in dotted:
                painter.drawEllipse(self._cell(area, element).center(), 1.5, 1.5)
            painter.setBrush(Qt.BrushStyle.NoBrush)

    def _paint_kinds(self, painter: QPainter, area: QRectF) -> None:
        """A letter for each element that is left out, in a ring where there is room for both."""
        for element, kind in self._kinds.items():
            cell = self._cell(area, element)
            side = min(cell.width(), cell.height())
            ringed, font = side >= _ROOM, painter.font()
            font.setPixelSize(max(_LEGIBLE, round((0.55 if ringed else 0.95) * side)))
            font.setBold(True)
            path = QPainterPath()
            path.addText(0, 0, font, _LETTERS[kind])
            path.translate(cell.center() - path.boundingRect().center())
            painter.strokePath(path, QPen(QColor(DARK_INK), 2.5))
            painter.fillPath(path, QColor("#ffffff"))
            for colour, width in ((DARK_INK, 3), ("#ffffff", 1)) if ringed else ():
                painter.setPen(QPen(QColor(colour), width))
                painter.drawEllipse(cell.center(), 0.42 * side, 0.42 * side)

    def _cell(self, area: QRectF, element: int) -> QRectF:
        if self._layout is None or not self._layout.shape:
            return self._squares(area)[element]
        m, n = self._layout.shape
        q, p = divmod(element, m)
        width, height = area.width() / m, area.height() / n
        return QRectF(area.left() + p * width, area.bottom() - (q + 1) * height, width, height)

    def _element_at(self, at: QPointF) -> int:
        layout, area = self._layout, self.area_of_patch()
        if layout is None or not area.contains(at):
            return -1
        position = [
            (at.x() - area.left()) / area.width() * layout.patch.a,
            (area.bottom() - at.y()) / area.height() * layout.patch.b,
        ]
        return int(np.argmin(np.linalg.norm(layout.positions - position, axis=1)))

    def mousePressEvent(self, event: QMouseEvent) -> None:
        element = self._element_at(event.position())
        if element >= 0 and event.button() == Qt.MouseButton.LeftButton:
            self.chosen.emit(element)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        self.point_at(self._element_at(event.position()))
        self.pointed.emit(self._under)

    def leaveEvent(self, event: object) -> None:
        self.point_at(-1)
        self.pointed.emit(-1)

    def point_at(self, element: int) -> None:
        if element != self._under:
            self._under = element
            self.update()
