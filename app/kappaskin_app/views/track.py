"""The course of a scene, how hard it presses over time, under a handle that can be dragged."""

import math

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QPointF, QRectF, QSignalBlocker, QSize, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QAbstractSlider, QSizePolicy, QWidget

from kappaskin import Scene
from kappaskin_app.guard import guarded
from kappaskin_app.theme import LIGHT, Theme

Array = NDArray[np.float64]

HEIGHT = 30  # px of the row
_SAMPLES = 200  # of how hard it presses
_SIDE = 8.0  # px beside the track, for half of the handle
_KNOB = 5.5  # px: radius of the handle
_APART = 3.0  # px that two ticks are apart at least
_FRAME = 1 / 60  # s: the shortest step that is seen
_MS = 1e3
_TIP = (
    "How hard the scene presses over its duration; ticks where a motion changes. Press or drag to "
    "go to another time; Left and Right go by one frame, Page Up and Page Down by a tenth, Home "
    "and End to the ends; Space plays or pauses."
)


def profile(scene: Scene) -> Array:
    """How hard `scene` presses at 200 times over its duration, as shares of the hardest, (200,)."""
    if scene.laid is not None:
        return np.ones(_SAMPLES)
    times = np.linspace(0, np.nextafter(scene.duration, 0), _SAMPLES).tolist()
    amount = np.array([sum(s.pose_at(t).amount for s in scene.stimuli) for t in times], float)
    most = amount.max()
    return amount / most if most > 0 else amount


def _whole_ms(seconds: float) -> int:
    """A time in whole ms, as far as a slider can count: 24 days."""
    return min(round(_MS * seconds), 2**31 - 1)


class Track(QAbstractSlider):
    """The handle over the profile; its value is the time in ms, for those who do not see it."""

    sought = Signal(float)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setOrientation(Qt.Orientation.Horizontal)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setFixedHeight(HEIGHT)
        self.setMinimumWidth(80)
        self.setAccessibleName("Time in the scene, in ms")
        self.setToolTip(_TIP)
        self.time, self.last, self.frame = 0.0, 0.0, _FRAME
        self._duration, self._profile, self._moments = 1.0, np.zeros(_SAMPLES), [0.0]
        self._theme = LIGHT
        self.valueChanged.connect(guarded(lambda ms: self.seek(ms / _MS)))

    def sizeHint(self) -> QSize:
        return QSize(300, HEIGHT)

    def show_scene(self, scene: Scene) -> None:
        self._duration = scene.duration
        self.frame = min(max(1 / scene.rate, _FRAME), scene.duration)
        self.last = scene.duration - self.frame
        self._profile, self._moments = profile(scene), scene.moments
        with QSignalBlocker(self):
            self.setRange(0, _whole_ms(scene.duration))
            self.setSingleStep(max(_whole_ms(self.frame), 1))
            self.setPageStep(max(_whole_ms(scene.duration / 10), 1))
        self.show_time(0.0)

    def show_theme(self, theme: Theme) -> None:
        self._theme = theme
        self.update()

    def show_time(self, seconds: float) -> None:
        self.time = seconds
        with QSignalBlocker(self):
            self.setValue(_whole_ms(seconds))
        self.update()

    def seek(self, seconds: float) -> None:
        """Show a time, or the nearest one that the scene has, and ask for it."""
        self.show_time(min(max(seconds, 0.0), self.last))
        self.sought.emit(self.time)

    # What a person does.

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.setSliderDown(True)
            self.seek(self._time_at(event.position().x()))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self.isSliderDown():
            self.seek(self._time_at(event.position().x()))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.setSliderDown(False)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        event.ignore()  # the row's: they are whole frames there, and not whole ms

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        self.update()

    # How it is drawn.

    @property
    def _area(self) -> QRectF:
        return QRectF(self.rect()).adjusted(_SIDE, 4, -_SIDE, -4)

    def at(self, seconds: float) -> float:
        """Where a time is drawn, in px from the left."""
        area = self._area
        return area.left() + area.width() * seconds / self._duration

    def _time_at(self, x: float) -> float:
        area = self._area
        return (x - area.left()) / max(area.width(), 1.0) * self._duration

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, theme, area = QPainter(self), self._theme, self._area
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(QColor(theme.text if self.hasFocus() else theme.line), 1))
        painter.setBrush(QColor(theme.base))
        painter.drawRoundedRect(area.adjusted(-2.5, -2.5, 2.5, 2.5), 4, 4)
        handle = self.at(self.time)
        shape = self._shape(area)
        painter.setPen(Qt.PenStyle.NoPen)
        for left, right, colour, share in (
            (area.left(), handle, theme.accent, 0.55),
            (handle, area.right(), theme.faint, 0.45),
        ):
            painter.save()
            painter.setClipRect(QRectF(left, 0, max(right - left, 0.0), self.height()))
            ink = QColor(colour)
            ink.setAlphaF(share)
            painter.setBrush(ink)
            painter.drawPolygon(shape)
            painter.restore()
        self._paint_ticks(painter, area)
        self._paint_handle(painter, area, handle)

    def _shape(self, area: QRectF) -> QPolygonF:
        """The profile, with a little of it where nothing presses."""
        x = np.linspace(area.left(), area.right(), _SAMPLES).tolist()
        heights = 1.5 + self._profile * (area.height() - 4)
        top = [QPointF(u, area.bottom() - h) for u, h in zip(x, heights.tolist(), strict=True)]
        return QPolygonF([area.bottomLeft(), *top, area.bottomRight()])

    def _paint_ticks(self, painter: QPainter, area: QRectF) -> None:
        painter.setPen(QPen(QColor(self._theme.text), 1))
        drawn = -math.inf
        for moment in self._moments:
            x = round(self.at(moment)) + 0.5  # or it would be blurred over two px
            if x - drawn >= _APART and 0 < moment < self._duration:
                drawn = x
                painter.drawLine(QPointF(x, area.bottom() - 5), QPointF(x, area.bottom()))

    def _paint_handle(self, painter: QPainter, area: QRectF, x: float) -> None:
        theme = self._theme
        painter.setPen(QPen(QColor(theme.text), 1.5))
        painter.drawLine(QPointF(x, area.top() - 2), QPointF(x, area.bottom() + 2))
        painter.setPen(QPen(QColor(theme.base), 1.5))
        painter.setBrush(QColor(theme.accent))
        painter.drawEllipse(QPointF(x, area.center().y()), _KNOB, _KNOB)
