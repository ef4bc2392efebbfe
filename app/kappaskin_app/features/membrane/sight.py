"""Pixels to lines of sight, and points to pixels, in the picture of a plotter."""

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF
from pyvistaqt import QtInteractor

Array = NDArray[np.float64]


class Sight:
    """What is seen where; points (3,) are in mm, pixels the widget's."""

    def __init__(self, plotter: QtInteractor) -> None:
        self._plotter = plotter

    def to_screen(self, point: Array) -> Array:
        """Widget pixels (2,) of a point."""
        renderer, ratio = self._plotter.renderer, self._plotter.devicePixelRatioF()
        renderer.SetWorldPoint(*point, 1.0)
        renderer.WorldToDisplay()
        x, y, _ = renderer.GetDisplayPoint()
        return np.array([x / ratio, self._plotter.height() - y / ratio])

    def line(self, at: QPointF) -> tuple[Array, Array]:
        """The nearest and the farthest point that lie under a pixel."""
        renderer, ratio = self._plotter.renderer, self._plotter.devicePixelRatioF()
        ends: list[Array] = []
        for depth in (0.0, 1.0):
            y_up = self._plotter.height() - at.y()
            renderer.SetDisplayPoint(at.x() * ratio, y_up * ratio, depth)
            renderer.DisplayToWorld()
            x, y, z, w = renderer.GetWorldPoint()
            ends.append(np.array([x, y, z]) / w)
        return ends[0], ends[1]
