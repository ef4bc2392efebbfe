"""Heatmaps: a quantity of every element, one cell each; a grid of them."""

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QImage,
    QMouseEvent,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QPen,
    QPolygonF,
)
from PySide6.QtWidgets import (
    QGridLayout,
    QHBoxLayout,
    QScrollArea,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from kappaskin.estimation import FAULTS
from kappaskin.frames import Array, Indices, Mask
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Cap, MeshSkin
from kappaskin_app.shell.colouring import SHADES, Shade
from kappaskin_app.theme import DARK_INK, WANTED, Colours, current, follow_look
from kappaskin_app.widgets.colour_bar import ColourBar, LockButton
from kappaskin_app.widgets.line import Line
from kappaskin_app.widgets.parts import Label
from kappaskin_app.widgets.tint import Tint

_LETTERS: dict[str, str] = dict(
    zip(
        ("spike", "stuck", "noisy", "swapped", "offset", "dead", "saturated", "drifting"),
        "PSNXODRT",
        strict=True,
    )
)

_LEGIBLE = 9  # px, height of the smallest letter
_ROOM = 18.0  # px, side of the smallest cell with a ring around its letter


_BEYOND = 1.5  # of the longer side: how far out points bound the cells at the rim


@lru_cache(1)  # for all heatmaps
def cells_of(layout: SensorLayout) -> list[Array]:
    """For each element of a cap or mesh the corners (k, 2) in m of what is nearest on its map.

    The cells at the rim end on it, or just outside. Other skins have none.
    """
    patch, positions, turns = layout.patch, layout.positions, np.arange(0, 2 * np.pi, 0.5)
    if isinstance(patch, Cap):
        offset = positions - patch.rim_radius
        far = np.linalg.norm(offset, axis=1, keepdims=True)
        feet = patch.rim_radius * (1 + offset / np.maximum(far, 1e-6 * patch.rim_radius))
    elif isinstance(patch, MeshSkin):
        feet = patch.outline.feet(positions)
        nearest = np.linalg.norm(feet - positions[:, None], axis=-1).argmin(axis=1)
        feet = feet[np.arange(len(feet)), nearest]
    else:
        return []
    ways, sides = np.stack([np.cos(turns), np.sin(turns)], axis=-1), np.array([patch.a, patch.b])
    around = sides / 2 + _BEYOND * sides.max() * ways
    found = scipy.spatial.Voronoi(np.concatenate([positions, 2 * feet - positions, around]))
    regions = found.point_region[: len(positions)]
    return [found.vertices[found.regions[region]] for region in regions]


@lru_cache(1)  # for all heatmaps
def _square_side(layout: SensorLayout) -> float:
    """Side in m of squares at the elements that hide none: the smallest distance of two."""
    positions = layout.positions
    if len(positions) < 2:
        return 0.2 * layout.patch.a
    distance = np.max(np.abs(positions[:, None] - positions[None]), axis=-1)
    nearest = float(np.min(distance + np.where(np.eye(len(positions)), np.inf, 0.0)))
    return max(0.9 * nearest, 0.02 * layout.patch.a)


class CellGrid(QWidget):
    """Elements as the cells of a regular grid, cap or mesh, else as squares at their positions."""

    pointed = Signal(int)
    chosen = Signal(int)

    def __init__(self) -> None:
        super().__init__()
        self._layout: SensorLayout | None = None
        self._regions, self._side = list[Array](), 0.0
        self._colours: Colours = np.empty((0, 3), np.uint8)
        self._hovered, self._pressed, self._faded = -1, -1, False
        self._marks: tuple[list[int], ...] = ([], [])
        self._faults: dict[int, str] = {}
        self._target = -1
        self.setMouseTracking(True)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(90, 90)

    def sizeHint(self) -> QSize:
        return QSize(200, 200)

    def show_layout(self, layout: SensorLayout) -> None:
        self._layout, self._regions = layout, cells_of(layout)
        self._side = _square_side(layout)
        self._hovered, self._marks, self._faults, self._target = -1, ([], []), {}, -1

    def show_cells(self, rgb: Colours) -> None:
        self._colours = rgb
        self.update()

    def show_marks(self, crossed: Indices, dotted: Indices, kinds: dict[int, str]) -> None:
        """Cross out and dot elements by number, and letter those with a fault of `FAULTS`."""
        marks = (crossed.tolist(), dotted.tolist())
        if (marks, kinds) != (self._marks, self._faults):
            self._marks, self._faults = marks, kinds
            self.update()

    def show_target(self, element: int) -> None:
        """Frame the element that is to be pressed; -1 for none."""
        if element != self._target:
            self._target = element
            self.update()

    def show_faded(self, faded: bool) -> None:
        if faded != self._faded:
            self._faded = faded
            self.update()

    def area_of_patch(self) -> QRectF:
        """The patch on the widget, as large as fits at its aspect ratio."""
        patch = self._layout.patch if self._layout else None
        ratio = patch.a / patch.b if patch else 1.0
        width, height = float(self.width() - 2), float(self.height() - 2)
        width, height = min(width, height * ratio), min(height, width / ratio)
        return QRectF((self.width() - width) / 2, (self.height() - height) / 2, width, height)

    def pixel_of(self, area: QRectF, x: float, y: float) -> QPointF:
        patch = self._layout.patch if self._layout else None
        a, b = (patch.a, patch.b) if patch else (1.0, 1.0)
        return QPointF(area.left() + x / a * area.width(), area.bottom() - y / b * area.height())

    def paintEvent(self, event: QPaintEvent) -> None:
        line = QPen(QColor(current().line), 1)
        with QPainter(self) as painter:
            area = self.area_of_patch()
            layout = self._layout
            if layout is None or len(self._colours) != len(layout):
                return
            painter.setOpacity(0.3 if self._faded else 1.0)
            if layout.shape:
                m, n = layout.shape
                # y points up on the skin, down in an image.
                rgb = np.ascontiguousarray(self._colours.reshape(n, m, 3)[::-1])
                painter.drawImage(
                    area, QImage(rgb.tobytes(), m, n, 3 * m, QImage.Format.Format_RGB888)
                )
            else:
                painter.setPen(line)  # or values near zero vanish on a light background
                if self._regions:
                    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
                    painter.setClipPath(self._rim(area))
                for element, rgb in enumerate(self._colours):
                    painter.setBrush(QColor(*(int(v) for v in rgb)))
                    self._draw_cell(painter, area, element)
                painter.setClipping(False)
                painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.setOpacity(1.0)
            painter.setPen(line)
            painter.drawPath(self._rim(area))
            self._paint_marks(painter, area)
            self._paint_faults(painter, area)
            if self._target >= 0:
                self._paint_target(painter, self._cell(area, self._target))
            if self._hovered >= 0:
                for colour, width in (("#16191d", 4), ("#ffffff", 2)):  # visible on every colour
                    painter.setPen(QPen(QColor(colour), width))
                    self._draw_cell(painter, area, self._hovered)

    def _rim(self, area: QRectF) -> QPainterPath:
        """The outline of the skin: of a cap or mesh its rim, else its rectangle."""
        path, patch = QPainterPath(), self._layout.patch if self._layout else None
        if isinstance(patch, MeshSkin):
            path.addPolygon(QPolygonF([self.pixel_of(area, *at) for at in patch.vertices]))
            path.closeSubpath()
        elif self._regions:
            path.addEllipse(area)
        else:
            path.addRect(area)
        return path

    def _draw_cell(self, painter: QPainter, area: QRectF, element: int) -> None:
        if self._regions:
            corners = self._regions[element].tolist()
            painter.drawPolygon(QPolygonF([self.pixel_of(area, *corner) for corner in corners]))
        else:
            painter.drawRect(self._cell(area, element))

    def _paint_target(self, painter: QPainter, cell: QRectF) -> None:
        """Draw a frame wider than the cell around the element to press."""
        around = cell.adjusted(-3, -3, 3, 3)
        for colour, width in (("#16191d", 6), (WANTED, 3)):
            painter.setPen(QPen(QColor(colour), width))
            painter.drawRect(around)

    def _paint_marks(self, painter: QPainter, area: QRectF) -> None:
        crossed, dotted = self._marks
        for colour, width in (("#16191d", 3), ("#ffffff", 1)):  # visible on every colour
            painter.setPen(QPen(QColor(colour), width))
            for element in crossed:
                cell = self._cell(area, element)
                painter.drawLine(cell.topLeft(), cell.bottomRight())
                painter.drawLine(cell.bottomLeft(), cell.topRight())
            painter.setBrush(QColor(colour))
            for element in dotted:
                painter.drawEllipse(self._cell(area, element).center(), 1.5, 1.5)
            painter.setBrush(Qt.BrushStyle.NoBrush)

    def _paint_faults(self, painter: QPainter, area: QRectF) -> None:
        """Draw a letter on each excluded element, with a ring where there is room for both."""
        for element, kind in self._faults.items():
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
        layout = self._layout
        if layout is None:
            return QRectF()
        if not layout.shape:
            side = self._side * area.width() / layout.patch.a
            centre = self.pixel_of(area, *layout.positions[element].tolist())
            return QRectF(centre.x() - side / 2, centre.y() - side / 2, side, side)
        m, n = layout.shape
        q, p = divmod(element, m)
        width, height = area.width() / m, area.height() / n
        return QRectF(area.left() + p * width, area.bottom() - (q + 1) * height, width, height)

    def _element_at(self, at: QPointF) -> int:
        layout, area = self._layout, self.area_of_patch()
        if layout is None or not self._rim(area).contains(at):
            return -1
        position = [
            (at.x() - area.left()) / area.width() * layout.patch.a,
            (area.bottom() - at.y()) / area.height() * layout.patch.b,
        ]
        return int(np.argmin(np.linalg.norm(layout.positions - position, axis=1)))

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._pressed = self._element_at(event.position())

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        # Not when the button is pressed: the element may be dragged to a chart.
        element = self._element_at(event.position())
        if element == self._pressed >= 0 and event.button() == Qt.MouseButton.LeftButton:
            self.chosen.emit(element)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        self.point_at(self._element_at(event.position()))
        self.pointed.emit(self._hovered)

    def leaveEvent(self, event: object) -> None:
        self.point_at(-1)
        self.pointed.emit(-1)

    def point_at(self, element: int) -> None:
        if element != self._hovered:
            self._hovered = element
            self.update()


_LEGEND = (
    "One cell for each element. Grey: no reading. Violet: saturated, at an end of the converter's "
    "range. Crossed: bent beyond 1 % strain, where the gage is no longer elastic. Dotted: "
    "scanned in every frame. Letter: excluded, by fault: D dead, S stuck, N noisy, R saturated, "
    "X swapped, T drifting, O offset, P spike. Framed: to be pressed now."
)


class Heatmap(QWidget):
    """A quantity of every element, with colour bar and value.

    `pointed` emits the element under the mouse (-1: none), `chosen` the one clicked, and
    `lock_wanted` the limit to fix the colours at in SI units (0: automatic).
    """

    pointed = Signal(int)
    chosen = Signal(int)
    lock_wanted = Signal(float)

    def __init__(self, name: str, shade: Shade | None = None) -> None:
        super().__init__()
        self.name, self._shade = name, shade or SHADES[name]
        self._title = Label(f"<b>{self._shade.symbol}</b>", rich=True)
        self._title.setToolTip(self._shade.tip)
        self.value = Line()
        self.value.setToolTip("The element under the mouse, else the largest reading.")
        self.lock = LockButton()
        self.lock.wanted.connect(self._request_lock)
        self.lock.setVisible(name != "health")  # a classification has no range
        self.lock.setEnabled(name != "health")
        self.cells, self.bar = CellGrid(), ColourBar()
        self.cells.setToolTip(_LEGEND)
        self.cells.setAccessibleName(f"Heatmap of {self._shade.label.lower()}")
        self.cells.pointed.connect(self.pointed)
        self.cells.chosen.connect(self.chosen)
        self._tint, self._layout, self._element = self._shade.tint(1.0), None, -1
        self._values, self._railed = np.empty(0), None
        self._faults: dict[int, str] = {}
        top = QHBoxLayout()
        top.addWidget(self._title)
        top.addWidget(self.value, 1)
        top.addWidget(self.lock)
        middle = QHBoxLayout()
        middle.addWidget(self.cells, 1)
        middle.addWidget(self.bar)
        around = QVBoxLayout(self)
        around.setContentsMargins(6, 4, 4, 4)
        around.setSpacing(3)
        around.addLayout(top)
        around.addLayout(middle, 1)
        follow_look(self, self._colour)

    def show_lock(self, locked: bool) -> None:
        self.lock.show_locked(locked)

    def show_layout(self, layout: SensorLayout) -> None:
        self._layout = layout
        self._element = -1
        self.cells.show_layout(layout)

    def show_element(self, element: int) -> None:
        """Mark the element that is pointed at in any view; -1 for none."""
        self._element = element
        self.cells.point_at(element)

    @property
    def limit(self) -> float:
        """Limit of the colour range, in SI units."""
        return self._tint.limit / self._shade.scale

    def _request_lock(self, locked: bool) -> None:
        self.lock_wanted.emit(self.limit * locked)

    def show_values(self, values: Array, tint: Tint, railed: Mask | None = None) -> None:
        """Colour `values` (P,) in display units by `tint`, except where `railed` (P,)."""
        self._values, self._tint, self._railed = values, tint, railed
        self._colour()

    def _colour(self) -> None:
        tint, shown = self._tint, (self._values, current().missing, self._railed)
        self.cells.show_cells(tint.rgb(*shown))
        self.bar.show_tint(tint, tint.legend(*shown))

    def show_marks(self, crossed: Mask, dotted: Mask, kinds: NDArray[np.uint8]) -> None:
        """Cross out elements (P,) bent too far, dot those of the scan region, letter faulty ones.

        `kinds` (P,) are the faults, by number in `FAULTS`.
        """
        self._faults = {int(p): FAULTS[kinds[p]] for p in np.flatnonzero(kinds)}
        self.cells.show_marks(np.flatnonzero(crossed), np.flatnonzero(dotted), self._faults)

    def show_target(self, element: int) -> None:
        """Frame the element to press; -1 for none."""
        self.cells.show_target(element)

    def show_lost(self, lost: bool) -> None:
        """Fade the cells while the connection is lost."""
        self.cells.show_faded(lost)

    def show_reading(self, values: Array) -> None:
        """Write the value of the element under the mouse, else the peak."""
        if self._layout is None or len(values) != len(self._layout):
            self.value.show_text("")
        elif self._element >= 0:
            self.value.show_text(self._value_at(self._element, values[self._element], self._layout))
        else:
            self.value.show_text(self._summary(values), "peak ", f" {self._shade.unit_shown}")

    def _value_at(self, element: int, value: float, layout: SensorLayout) -> str:
        x, y = layout.positions[element] * 1e3
        what = self._shade.written(value) if math.isfinite(value) else "no reading"
        why = f", {self._faults[element]}" if element in self._faults and self.bar.scaled else ""
        return f"{what} at ({x:.0f}, {y:.0f}) mm{why}"

    def _summary(self, values: Array) -> str:
        finite = values[np.isfinite(values)]
        if not self.bar.scaled:
            faulty = int(np.count_nonzero(finite))
            return f"{faulty} faulty" if faulty else "all OK"
        peak = finite[np.argmax(np.abs(finite))] if len(finite) else math.nan
        missing = len(values) - len(finite)
        parts = [f"peak {self._shade.written(peak)}"] if len(finite) else []
        return ", ".join(parts + [f"{missing} missing"] * bool(missing))


_COLUMN = 3  # heatmaps at most in a single column
_NARROWEST = (210, 360)  # px, minimum width of one column and of two


class HeatmapGrid(QScrollArea):
    """Scrollable grid of the heatmaps; hidden ones are not drawn."""

    def __init__(self) -> None:
        super().__init__()
        self.heatmaps: dict[str, Heatmap] = {}
        self._none = Label("Select heatmaps under View.", alignment=Qt.AlignmentFlag.AlignCenter)  # pyright: ignore[reportCallIssue]
        self._shown: tuple[str, ...] | None = None
        self._whole = whole = QWidget()
        self._grid = QGridLayout(whole)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setSpacing(0)
        self._none.setParent(whole)
        self._none.hide()
        self.add(SHADES)
        self.setWidget(whole)
        self.setWidgetResizable(True)
        self.setFrameShape(QScrollArea.Shape.NoFrame)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setMinimumWidth(_NARROWEST[0])

    def add(self, shades: Mapping[str, Shade]) -> list[Heatmap]:
        """Have a heatmap of each of these too; returns the new ones."""
        made = [Heatmap(name, shade) for name, shade in shades.items() if name not in self.heatmaps]
        for heatmap in made:
            heatmap.setParent(self._whole)
            heatmap.hide()
        self.heatmaps |= {heatmap.name: heatmap for heatmap in made}
        return made

    def show_selected(self, names: tuple[str, ...]) -> None:
        """Show only the heatmaps called `names`."""
        if names == self._shown:
            return
        self._shown = names
        columns = 1 if len(names) <= _COLUMN else 2
        for widget in (*self.heatmaps.values(), self._none):
            self._grid.removeWidget(widget)
            widget.hide()
        shown = [self.heatmaps[name] for name in names] or [self._none]
        for number, widget in enumerate(shown):
            self._grid.addWidget(widget, *divmod(number, columns))
            widget.show()
        for row in range(len(self.heatmaps)):
            self._grid.setRowStretch(row, row * columns < len(shown))
        self._grid.setColumnStretch(1, columns - 1)
        self._grid.setColumnStretch(0, 1)
        self.setMinimumWidth(_NARROWEST[columns - 1])
