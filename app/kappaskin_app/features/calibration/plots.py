"""Drawings of a calibration: skin on its cylinder, and map of results."""

import math

import numpy as np
from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QHelpEvent,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QPen,
    QPolygonF,
)
from PySide6.QtWidgets import QSizePolicy, QToolTip, QWidget

from kappaskin.frames import COMPONENTS, Array, Mask
from kappaskin.scenes.cylinders import CylinderStep
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Patch
from kappaskin_app.theme import current
from kappaskin_app.widgets.chart import ChartAxis, Series

_POINTS = 61  # of the skin's cross-section
_MOST_WRAPPED = math.pi  # rad: the rest of a long skin hangs down straight
_CYLINDER_HIGH = 102  # px of the drawings without their captions
_LONGEST = "outer face down"
_THICK = 5.0  # px, of each face
_BENDS = {"x": (1.0, 0.0), "y": (0.0, 1.0), "diagonal": (math.sqrt(0.5), math.sqrt(0.5))}


class CylinderView(QWidget):
    """Drawing of the skin on a cylinder, from the side to scale and from above."""

    def __init__(self) -> None:
        super().__init__()
        self._step: CylinderStep | None = None
        self._patch = Patch(0.1, 0.1)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setToolTip(
            "Left: the skin on its cylinder along the axis, to scale; the thick line is the outer "
            "face. Right: from above, with the axis dashed."
        )

    def sizeHint(self) -> QSize:
        return QSize(280, _CYLINDER_HIGH + 2 * self.fontMetrics().height())

    def minimumSizeHint(self) -> QSize:
        high, wide = self.sizeHint().height(), self.fontMetrics().horizontalAdvance(_LONGEST)
        return QSize(max(220, high + wide + 16), high)

    def show_step(self, step: CylinderStep, patch: Patch) -> None:
        if step is not self._step or patch is not self._patch:
            self._step, self._patch = step, patch
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        if self._step is None:
            return
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            height = float(self.height())
            above = QRectF(self.width() - height + 4, 4, height - 8, height - 8)
            self._paint_side(painter, QRectF(2, 2, above.left() - 14, height - 4), self._step)
            metrics = painter.fontMetrics()
            beside, below = metrics.horizontalAdvance("y") + 5, metrics.height() - 3
            self._paint_above(painter, above.adjusted(beside, 4, -4, -below), self._step)

    # From the side.

    def _paint_side(self, painter: QPainter, area: QRectF, step: CylinderStep) -> None:
        theme = current()
        high = painter.fontMetrics().height()
        painter.save()
        painter.setClipRect(area)
        along_x, along_y = _BENDS[step.along]
        length = 1e3 * min(
            self._patch.a / along_x if along_x > 1e-9 else math.inf,
            self._patch.b / along_y if along_y > 1e-9 else math.inf,
        )
        per_mm = 0.62 * area.width() / length
        top = QPointF(area.center().x(), area.top() + high + 15)
        if step.flat:
            ground = QRectF(area.left(), top.y() + _THICK, area.width(), area.height())
            painter.fillRect(ground, QColor(theme.line))
        else:
            radius = 1e3 * step.radius * per_mm
            painter.setPen(QPen(QColor(theme.faint), 1))
            painter.setBrush(QColor(theme.line))
            painter.drawEllipse(QPointF(top.x(), top.y() + _THICK + radius), radius, radius)
        inward = step.face * _THICK / 2
        line = _draped(length * per_mm, 1e3 * step.radius * per_mm + _THICK)
        for offset, colour, width in (
            (inward, theme.faint, 2.0),
            (-inward, theme.accent, _THICK),
        ):
            pen = QPen(QColor(colour), width)
            pen.setCapStyle(Qt.PenCapStyle.FlatCap)
            painter.strokePath(_shifted(line, top, offset), pen)
        painter.setPen(QColor(theme.accent))
        words = "outer face up" if step.face > 0 else "outer face down"
        painter.drawText(area, Qt.AlignmentFlag.AlignTop | Qt.AlignmentFlag.AlignHCenter, words)
        painter.setPen(QColor(theme.text))
        size = "table" if step.flat else f"{1e3 * step.radius:g} mm"
        at = QRectF(area.left(), area.bottom() - 2 * high - 4, area.width(), 2 * high)
        painter.drawText(at, Qt.AlignmentFlag.AlignCenter, size)
        painter.restore()

    # From above.

    def _paint_above(self, painter: QPainter, area: QRectF, step: CylinderStep) -> None:
        theme = current()
        per_m = min(area.width() / self._patch.a, area.height() / self._patch.b)
        width, height = self._patch.a * per_m, self._patch.b * per_m
        skin = QRectF(0, 0, width, height)
        skin.moveCenter(area.center())
        painter.setPen(QPen(QColor(theme.text), 1))
        painter.setBrush(QColor(theme.base))
        painter.drawRect(skin)
        flags = Qt.AlignmentFlag.AlignCenter
        painter.setPen(QColor(theme.faint))
        line, wide = painter.fontMetrics().height(), painter.fontMetrics().horizontalAdvance("y")
        painter.drawText(QRectF(skin.left(), skin.bottom() + 1, width, line), flags, "x")
        y_at = QRectF(skin.left() - wide - 4, skin.top(), wide + 2, height)
        painter.drawText(y_at, flags, "y")
        if step.flat:
            painter.drawText(skin, flags, "flat")
            return
        dx, dy = _BENDS[step.along]
        self._paint_axis(painter, skin, dx, dy, 1e3 * step.radius * per_m / 1e3)
        _paint_arrow(painter, skin, dx, -dy, QColor(theme.accent))

    def _paint_axis(
        self, painter: QPainter, skin: QRectF, dx: float, dy: float, radius: float
    ) -> None:
        """Draw the cylinder below the skin and its axis."""
        painter.save()
        painter.setClipRect(skin)
        painter.translate(skin.center())
        painter.rotate(-math.degrees(math.atan2(dy, dx)))
        far = skin.width() + skin.height()
        cylinder = QColor(current().line)
        painter.fillRect(QRectF(-radius, -far, 2 * radius, 2 * far), cylinder)
        painter.setPen(QPen(QColor(current().faint), 1.5, Qt.PenStyle.DashLine))
        painter.drawLine(QPointF(0, -far), QPointF(0, far))
        painter.restore()
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(QColor(current().text), 1))
        painter.drawRect(skin)


def _draped(length: float, radius: float) -> list[tuple[QPointF, QPointF]]:
    """Points and upward normals of a line of `length` draped over a circle below the origin."""
    wrapped = min(length / 2, _MOST_WRAPPED / 2 * radius)
    found: list[tuple[QPointF, QPointF]] = []
    for k in range(_POINTS):
        s = length * (k / (_POINTS - 1) - 0.5)
        on = max(-wrapped, min(wrapped, s))
        if math.isinf(radius):
            found.append((QPointF(s, 0.0), QPointF(0.0, -1.0)))
            continue
        angle, rest = on / radius, abs(s) - abs(on)
        side = math.copysign(1.0, s)
        out = QPointF(math.sin(angle), -math.cos(angle))
        along = QPointF(side * math.cos(angle), side * math.sin(angle))
        at = QPointF(radius * out.x(), radius * (1 + out.y()))
        found.append((at + along * rest, out))
    return found


def _shifted(line: list[tuple[QPointF, QPointF]], to: QPointF, down: float) -> QPainterPath:
    points = [to + at - out * down for at, out in line]
    path = QPainterPath(points[0])
    for point in points[1:]:
        path.lineTo(point)
    return path


def _paint_arrow(painter: QPainter, skin: QRectF, dx: float, dy: float, colour: QColor) -> None:
    """Draw a double arrow along the direction of bending."""
    half = 0.34 * min(skin.width() / max(abs(dx), 1e-9), skin.height() / max(abs(dy), 1e-9))
    along, across, middle = QPointF(dx, dy), QPointF(-dy, dx), skin.center()
    painter.setPen(QPen(colour, 2.5))
    painter.drawLine(middle - along * half, middle + along * half)
    painter.setBrush(colour)
    painter.setPen(Qt.PenStyle.NoPen)
    for way in (1.0, -1.0):
        tip = middle + along * (way * (half + 5))
        back = tip - along * (way * 11)
        painter.drawPolygon(QPolygonF([tip, back + across * 5.5, back - across * 5.5]))


LOOP_AXES = ChartAxis("Reading", "1/m"), ChartAxis("Applied", "1/m")
LOOP_TIP = (
    "Nominal curvature by Eq. 8, 4 V / (V_in GF (t_s + t_g) G), over that of the "
    "cylinder. Dashed: line of the calibration. Filled points: falling radius; open "
    "points: rising radius. Their difference is hysteresis."
)


def loop_series(
    applied: Array, read: Array, back: Mask, begins: Mask, gain: float, offset: float
) -> list[Series]:
    """Readings `read` (n,) at curvatures `applied` (n,), both in 1/m, and the calibration's line.

    They are in order of capture. `back` (n,) is true at rising radii; a new cycle begins where
    `begins` (n,) is true.
    """
    cycles = np.flatnonzero(begins)[1:]
    ends = np.array([-1.0, 1.0]) * np.abs(applied).max()
    return [
        Series("falling radius", applied[~back], read[~back], "accent", "", "o", 6.0),
        Series("rising radius", applied[back], read[back], "accent", "", "o", 6.0, False),
        Series("calibration", ends, offset + gain * ends, "faint", "dashed"),
        Series("", np.insert(applied, cycles, np.nan), np.insert(read, cycles, np.nan), "accent"),
    ]


_MAP_HIGH = 91  # px of each map
_WIDEST = "xx: 100 pass"  # typical title
_GAP = 8
_TIP = "Results of the channels. Click one, or use the arrow keys, to plot its readings below."
_SHARE = 0.86  # side of a square, of the distance between elements
_WAYS = {
    Qt.Key.Key_Left: (-1.0, 0.0),
    Qt.Key.Key_Right: (1.0, 0.0),
    Qt.Key.Key_Up: (0.0, 1.0),
    Qt.Key.Key_Down: (0.0, -1.0),
}


class PassMap(QWidget):
    """Maps of the results of xx, yy and xy; `chosen` emits the channel component * P + element."""

    chosen = Signal(int)

    def __init__(self) -> None:
        super().__init__()
        self._layout: SensorLayout | None = None
        self._failures: dict[int, str] = {}
        self._tips: list[str] = []
        self._channel, self._spacing = 0, 0.0
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("Channels that passed")

    def sizeHint(self) -> QSize:
        return QSize(280, _MAP_HIGH + self._title)

    def minimumSizeHint(self) -> QSize:
        wide = 3 * self.fontMetrics().horizontalAdvance(_WIDEST) + 2 * _GAP
        return QSize(wide, _MAP_HIGH + self._title)

    def show_channels(
        self, layout: SensorLayout, failures: dict[int, str], tips: list[str]
    ) -> None:
        """Show the failed channels, and `tips` for every channel."""
        self._layout, self._failures, self._tips = layout, failures, tips
        self._spacing = _spacing(layout)
        self.update()

    def show_channel(self, channel: int) -> None:
        self._channel = channel
        self.update()

    @property
    def _title(self) -> int:
        """Height in px of the title above each map."""
        return self.fontMetrics().height() + 2

    def _squares(self, component: int) -> list[QRectF]:
        """Squares of the elements in the map of a component."""
        layout = self._layout
        if layout is None:
            return []
        width = (self.width() - 2 * _GAP) / 3
        height = self.height() - self._title - 2
        a, b = layout.patch.a, layout.patch.b
        scale = min((width - 2) / a, height / b)
        left = component * (width + _GAP) + (width - scale * a) / 2
        bottom = self._title + (height + scale * b) / 2
        side = max(_SHARE * self._spacing * scale, 2.0)
        return [
            QRectF(left + x * scale - side / 2, bottom - y * scale - side / 2, side, side)
            for x, y in layout.positions
        ]

    def paintEvent(self, event: QPaintEvent) -> None:
        layout, theme = self._layout, current()
        if layout is None:
            return
        with QPainter(self) as painter:
            width, elements = (self.width() - 2 * _GAP) / 3, len(layout)
            for c, name in enumerate(COMPONENTS):
                painter.setPen(QColor(theme.text))
                title = QRectF(c * (width + _GAP), 0, width, self._title - 2)
                failed = sum(1 for channel in self._failures if channel // elements == c)
                passed = f"{name}: {elements - failed} pass" if failed else f"{name}: all pass"
                painter.drawText(title, Qt.AlignmentFlag.AlignCenter, passed)
                for element, square in enumerate(self._squares(c)):
                    self._paint_channel(painter, square, c * elements + element)
            if self._channel < 3 * elements:
                component, element = divmod(self._channel, elements)
                painter.setPen(QPen(QColor(theme.text), 3 if self.hasFocus() else 2))
                painter.setBrush(Qt.BrushStyle.NoBrush)
                painter.drawRect(self._squares(component)[element].adjusted(-1, -1, 1, 1))

    def _paint_channel(self, painter: QPainter, square: QRectF, channel: int) -> None:
        """Draw a plain square if passed, a crossed one if failed, for the colour-blind too."""
        theme = current()
        if channel not in self._failures:
            painter.fillRect(square, QColor(theme.good))
            return
        painter.fillRect(square, QColor(theme.bad))
        painter.setPen(QPen(QColor("#ffffff"), 1))
        painter.drawLine(square.topLeft(), square.bottomRight())
        painter.drawLine(square.bottomLeft(), square.topRight())

    def _channel_at(self, at: QPointF) -> int:
        if self._layout is not None:
            for c in range(3):
                for element, square in enumerate(self._squares(c)):
                    if square.adjusted(-1, -1, 1, 1).contains(at):
                        return c * len(self._layout) + element
        return -1

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if (channel := self._channel_at(event.position())) >= 0:
            self.chosen.emit(channel)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        way = _WAYS.get(Qt.Key(event.key()))
        if way is None or self._layout is None:
            super().keyPressEvent(event)
            return
        self.chosen.emit(self._next(*way))

    def _next(self, dx: float, dy: float) -> int:
        """The nearest element in a direction, else the same one in the next map."""
        layout = self._layout
        if layout is None:
            return self._channel
        component, element = divmod(self._channel, len(layout))
        away = layout.positions - layout.positions[element]
        ahead = away @ [dx, dy]
        off = np.abs(away @ [dy, dx])
        cost = np.where(ahead > 1e-9, ahead + 2 * off, np.inf)
        if np.isfinite(cost).any():
            return component * len(layout) + int(np.argmin(cost))
        if not dx:
            return self._channel
        return (component + int(dx)) % 3 * len(layout) + element

    def event(self, event: QEvent) -> bool:
        if isinstance(event, QHelpEvent) and event.type() == QEvent.Type.ToolTip:
            channel = self._channel_at(QPointF(event.pos()))
            text = self._tips[channel] if 0 <= channel < len(self._tips) else _TIP
            QToolTip.showText(event.globalPos(), text, self)
            return True
        return super().event(event)


def _spacing(layout: SensorLayout) -> float:
    """Smallest distance of two elements along x or y, in m."""
    positions = layout.positions
    if len(positions) < 2:
        return 0.3 * min(layout.patch.a, layout.patch.b)
    distance = np.max(np.abs(positions[:, None] - positions[None]), axis=-1)
    np.fill_diagonal(distance, np.inf)
    return max(float(distance.min()), 0.02 * layout.patch.a)
