"""A step of a calibration as a drawing: the skin on its cylinder, from the side and from above."""

import math

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPainterPath, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from kappaskin.scenes import CylinderStep
from kappaskin.skin import Patch
from kappaskin_app.theme import LIGHT, Theme

_POINTS = 61  # of the skin's line
_MOST_WRAPPED = math.pi  # rad: the rest of a long skin hangs down straight
_HIGH = 102  # px of the drawings without the words above and below them
_LONGEST = "outer face down"
_THICK = 5.0  # px, of each face
_BENDS = {"x": (1.0, 0.0), "y": (0.0, 1.0), "diagonal": (math.sqrt(0.5), math.sqrt(0.5))}


class CylinderView(QWidget):
    """Draws where the skin of a patch is to lie; the radius is to the scale of the skin."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._step: CylinderStep | None = None
        self._patch, self._theme = Patch(0.1, 0.1), LIGHT
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setToolTip(
            "Left: the skin on its cylinder, seen along the axis and to scale; the thick line is "
            "the outer face, which objects touch. Right: from above, with the axis dashed."
        )

    def sizeHint(self) -> QSize:
        return QSize(280, _HIGH + 2 * self.fontMetrics().height())

    def minimumSizeHint(self) -> QSize:
        high, wide = self.sizeHint().height(), self.fontMetrics().horizontalAdvance(_LONGEST)
        return QSize(max(220, high + wide + 16), high)

    def show_step(self, step: CylinderStep, patch: Patch) -> None:
        if step is not self._step or patch is not self._patch:
            self._step, self._patch = step, patch
            self.update()

    def show_theme(self, theme: Theme) -> None:
        self._theme = theme
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        if self._step is None:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        height = float(self.height())
        above = QRectF(self.width() - height + 4, 4, height - 8, height - 8)
        self._paint_side(painter, QRectF(2, 2, above.left() - 14, height - 4), self._step)
        metrics = painter.fontMetrics()
        beside, below = metrics.horizontalAdvance("y") + 5, metrics.height() - 3
        self._paint_above(painter, above.adjusted(beside, 4, -4, -below), self._step)

    # From the side.

    def _paint_side(self, painter: QPainter, area: QRectF, step: CylinderStep) -> None:
        theme = self._theme
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
        theme = self._theme
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
        """The cylinder below the skin, and its axis, across the direction of bending."""
        painter.save()
        painter.setClipRect(skin)
        painter.translate(skin.center())
        painter.rotate(-math.degrees(math.atan2(dy, dx)))
        far = skin.width() + skin.height()
        cylinder = QColor(self._theme.line)
        painter.fillRect(QRectF(-radius, -far, 2 * radius, 2 * far), cylinder)
        painter.setPen(QPen(QColor(self._theme.faint), 1.5, Qt.PenStyle.DashLine))
        painter.drawLine(QPointF(0, -far), QPointF(0, far))
        painter.restore()
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(QColor(self._theme.text), 1))
        painter.drawRect(skin)


def _draped(length: float, radius: float) -> list[tuple[QPointF, QPointF]]:
    """Points of a line of `length` over a circle below the origin, with the normals there, up."""
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
    """An arrow with two heads through the middle, along the direction of bending."""
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
