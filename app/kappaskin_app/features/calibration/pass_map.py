"""Which channels of a calibration passed, element by element; a click or the arrows choose one."""

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QHelpEvent, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QToolTip, QWidget

from kappaskin.frames import COMPONENTS
from kappaskin.sensing import SensorLayout
from kappaskin_app.theme import LIGHT, Theme

Array = NDArray[np.float64]

_HIGH = 91  # px of each map
_WIDEST = "xx: 100 pass"  # of the titles, more or less
_GAP = 8
_TIP = "Which channels passed. Click one, or use the arrow keys, to see its readings below."
_SHARE = 0.86  # of the distance between elements that a square fills
_WAYS = {
    Qt.Key.Key_Left: (-1.0, 0.0),
    Qt.Key.Key_Right: (1.0, 0.0),
    Qt.Key.Key_Up: (0.0, 1.0),
    Qt.Key.Key_Down: (0.0, -1.0),
}


class PassMap(QWidget):
    """Three small maps, xx, yy and xy; `chosen` tells of channel component * P + element."""

    chosen = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._layout: SensorLayout | None = None
        self._failures: dict[int, str] = {}
        self._tips: list[str] = []
        self._channel, self._spacing, self._theme = 0, 0.0, LIGHT
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("Channels that passed")

    def sizeHint(self) -> QSize:
        return QSize(280, _HIGH + self._title)

    def minimumSizeHint(self) -> QSize:
        wide = 3 * self.fontMetrics().horizontalAdvance(_WIDEST) + 2 * _GAP
        return QSize(wide, _HIGH + self._title)

    def show_channels(
        self, layout: SensorLayout, failures: dict[int, str], tips: list[str]
    ) -> None:
        """Show which channels failed, and `tips` in words for each of all."""
        self._layout, self._failures, self._tips = layout, failures, tips
        self._spacing = _spacing(layout)
        self.update()

    def show_channel(self, channel: int) -> None:
        self._channel = channel
        self.update()

    def show_theme(self, theme: Theme) -> None:
        self._theme = theme
        self.update()

    @property
    def _title(self) -> int:
        """The px above each map."""
        return self.fontMetrics().height() + 2

    def _squares(self, component: int) -> list[QRectF]:
        """Where each element is drawn in the map of a component."""
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
        layout, theme = self._layout, self._theme
        if layout is None:
            return
        painter = QPainter(self)
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
        """A full square where it passed, a crossed one where not: not told by colour alone."""
        theme = self._theme
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
        """The nearest element that way, or the same in the next map where there is none."""
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
    """What separates the two nearest elements, in m, along x or y."""
    positions = layout.positions
    if len(positions) < 2:
        return 0.3 * min(layout.patch.a, layout.patch.b)
    apart = np.max(np.abs(positions[:, None] - positions[None]), axis=-1)
    np.fill_diagonal(apart, np.inf)
    return max(float(apart.min()), 0.02 * layout.patch.a)
