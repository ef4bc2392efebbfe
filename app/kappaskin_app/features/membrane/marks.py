"""Elements to marks on the skin: those left out, and the one that is to be pressed."""

from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from kappaskin_app.features.membrane.unlit import UNLIT, pixels
from kappaskin_app.shell.drawn_skin import DrawnSkin, Indices

Array = NDArray[np.float64]

_ABOVE = 1.5  # times as high as the elements are drawn, or one hides in the other


class Marks:
    """Large points of one colour at some elements, which move with the skin."""

    def __init__(self, plotter: Any, size: int, colour: str) -> None:
        self._points: Any = pv.PolyData(np.zeros((1, 3)))
        self.actor = plotter.add_mesh(
            self._points,
            style="points",
            point_size=pixels(plotter, size),
            color=colour,
            **UNLIT,
        )
        self.actor.visibility = False
        self._at_rest = (np.empty((0, 3)), np.empty((0, 3)))
        self._nearest: Indices = np.empty(0, np.intp)

    def place(self, skin: DrawnSkin, positions: Array) -> None:
        """Mark the elements at `positions` (n, 2) in m on this `skin`."""
        self.actor.visibility = bool(len(positions))
        if not len(positions):
            return
        self._at_rest, self._nearest = skin.at_rest(positions), skin.nearest(positions)
        self._points.points = self._at_rest[0].copy()
        count = len(positions)
        self._points.verts = np.column_stack([np.ones(count, int), np.arange(count)]).ravel()

    def follow(self, skin: DrawnSkin, lift: float) -> None:
        """Move with a `skin` that has another shape, `lift` above it."""
        if self.actor.visibility:
            points, out = self._at_rest
            height = skin.height.ravel()[self._nearest] + _ABOVE * lift
            self._points.points[:] = points + out * height[:, None]
