"""The course of a scene, how hard it presses over time, under a handle that can be dragged."""

import math

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen, QPolygonF
from PySide6.QtWidgets import QWidget

from kappaskin.scenes import Scene
from kappaskin_app.widgets.course import Course

Array = NDArray[np.float64]

_SAMPLES = 200  # of how hard it presses
_APART = 3.0  # px that two ticks are apart at least
_FRAME = 1 / 60  # s: the shortest step that is seen
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


class Track(Course):
    """The handle over the profile."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Time in the scene, in ms", _TIP, parent)
        self.frame = _FRAME
        self._profile, self._moments = np.zeros(_SAMPLES), [0.0]
        self._shaped, self._shape = QRectF(), QPolygonF()

    def show_scene(self, scene: Scene) -> None:
        self._shaped = QRectF()
        self.frame = min(max(1 / scene.rate, _FRAME), scene.duration)
        self._profile, self._moments = profile(scene), scene.moments
        self.show_duration(scene.duration, self.frame, scene.duration - self.frame)

    def paint_course(self, painter: QPainter, area: QRectF, handle: float) -> None:
        if area != self._shaped:  # it is drawn as often as the skin is
            self._shaped, self._shape = area, self._shape_in(area)
        painter.setPen(Qt.PenStyle.NoPen)
        for part, ink in self.halves(area, handle):
            painter.save()
            painter.setClipRect(part)
            painter.setBrush(ink)
            painter.drawPolygon(self._shape)
            painter.restore()
        self._paint_ticks(painter, area)

    def _shape_in(self, area: QRectF) -> QPolygonF:
        """The profile, with a little of it where nothing presses."""
        x = np.linspace(area.left(), area.right(), _SAMPLES).tolist()
        heights = 1.5 + self._profile * (area.height() - 4)
        top = [QPointF(u, area.bottom() - h) for u, h in zip(x, heights.tolist(), strict=True)]
        return QPolygonF([area.bottomLeft(), *top, area.bottomRight()])

    def _paint_ticks(self, painter: QPainter, area: QRectF) -> None:
        painter.setPen(QPen(QColor(self.theme.text), 1))
        drawn = -math.inf
        for moment in self._moments:
            x = round(self.at(moment)) + 0.5  # or it would be blurred over two px
            if x - drawn >= _APART and 0 < moment < self.duration:
                drawn = x
                painter.drawLine(QPointF(x, area.bottom() - 5), QPointF(x, area.bottom()))
