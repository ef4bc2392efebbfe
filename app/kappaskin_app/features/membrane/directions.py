"""Principal directions as crosses on the skin: along each, how much the skin curves that way."""

from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from kappaskin_app.features.membrane.unlit import UNLIT, pixels
from kappaskin_app.shell.drawn_skin import MM, DrawnSkin
from kappaskin_app.theme import DIVERGING

Array = NDArray[np.float64]

_STRIDE = 6  # points of the surface between two crosses
_SHARE = 0.9  # of the distance between two crosses: the longest arm to arm
_HOLLOW, _CONVEX = DIVERGING[40], DIVERGING[215]


class Directions:
    """Two lines a cross, as long as the curvature is large; blue where hollow, orange where convex.

    As seen from outside.
    """

    def __init__(self, plotter: Any) -> None:
        self._plotter = plotter
        self._skin: DrawnSkin | None = None
        self._nodes: NDArray[np.intp] = np.empty(0, np.intp)
        self._lines: Any = None
        self.actor: Any = None

    def show(
        self, skin: DrawnSkin, found: Array | None, most: float = 1.0, lift: float = 0.0
    ) -> None:
        """Draw curvatures and angle `found` (3, ny, nx), `lift` mm above the skin; none of None.

        A curvature of `most` in 1/m has the longest arm.
        """
        if found is not None and skin is not self._skin:
            self._meet(skin)
        if self.actor is not None:
            self.actor.visibility = found is not None
        if found is None or not len(self._nodes):
            return
        first, second, angle = found.reshape(3, -1)[:, self._nodes]
        curvature = np.concatenate([first, second])
        turned = np.concatenate([angle, angle + np.pi / 2])
        half = _SHARE * self._apart / 2 * np.minimum(np.abs(curvature) / most, 1.0)
        step = half * np.stack([np.cos(turned), np.sin(turned)])
        self._lines.points[:] = np.nan_to_num(self._ends(skin, step, lift))
        colours = np.where((curvature < 0)[:, None], _HOLLOW, _CONVEX)
        self._lines.cell_data["rgb"][:] = colours

    def _ends(self, skin: DrawnSkin, step: Array, lift: float) -> Array:
        """Both ends (4 G, 3) in mm of each line, `step` (2, 2 G) in mm from its node."""
        h_y, h_x = np.gradient(skin.height, skin.cell[1] * MM, skin.cell[0] * MM)
        nodes = np.tile(self._nodes, 2)
        slope = step[0] * h_x.ravel()[nodes] + step[1] * h_y.ravel()[nodes]
        height = skin.height.ravel()[nodes] + lift
        ends: list[Array] = []
        for side in (-1, 1):
            rest, out = skin.at_rest(self._positions + side * step.T / MM)
            ends.append(rest + out * (height + side * slope)[:, None])
        return np.stack(ends, axis=1).reshape(-1, 3)

    def _meet(self, skin: DrawnSkin) -> None:
        self._skin = skin
        stride = _STRIDE * max(1, skin.on.shape[1] // 64)
        chosen = np.zeros(skin.on.shape, bool)
        chosen[stride // 2 :: stride, stride // 2 :: stride] = True
        self._nodes = np.flatnonzero(chosen & skin.on)
        self._positions = np.tile(skin.shares[self._nodes] * (skin.patch.a, skin.patch.b), (2, 1))
        self._apart = stride * MM * float(skin.cell.min())
        if self.actor is not None:
            self._plotter.remove_actor(self.actor, render=False)
        count = 2 * len(self._nodes)
        cells = np.column_stack([np.full(count, 2), np.arange(2 * count).reshape(-1, 2)])
        self._lines = pv.PolyData(np.zeros((2 * count, 3)), lines=cells.ravel())
        self._lines.cell_data["rgb"] = np.zeros((count, 3), np.uint8)
        self.actor = self._plotter.add_mesh(
            self._lines,
            scalars="rgb",
            rgb=True,
            line_width=pixels(self._plotter, 3),
            **UNLIT,
        )
