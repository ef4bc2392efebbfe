"""The frame of the contact: its normal with a cone of how sure it is, and both directions."""

from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from kappaskin_app.features.membrane.unlit import UNLIT, pixels
from kappaskin_app.shell.drawn_skin import MM, DrawnSkin
from kappaskin_app.theme import DIVERGING

Array = NDArray[np.float64]

_LONG = 0.2  # of the skin's size
_POINTS = 9  # of a line
_RIM = 32  # points of the cone's rim
_WIDE = 2.0  # standard deviations of the slopes
_NORMAL = (31, 209, 122)  # as the contact's own mark
_COLOURS = np.array([_NORMAL, DIVERGING[215], DIVERGING[40]], np.uint8)


class ContactFrame:
    """Three lines from the contact on the drawn skin, and a translucent cone round the normal."""

    def __init__(self, plotter: Any) -> None:
        points = np.arange(3 * _POINTS).reshape(3, -1)
        lines = np.insert(points, 0, _POINTS, axis=1).ravel()
        self._lines: Any = pv.PolyData(np.zeros((3 * _POINTS, 3)), lines=lines)
        self._lines.cell_data["rgb"] = _COLOURS
        rim = 1 + np.arange(_RIM)
        faces = np.column_stack([np.full(_RIM, 3), np.zeros(_RIM, int), rim, 1 + rim % _RIM])
        self._cone: Any = pv.PolyData(np.zeros((1 + _RIM, 3)), faces=faces.ravel())
        self.actor = plotter.add_mesh(
            self._lines, scalars="rgb", rgb=True, line_width=pixels(plotter, 5), **UNLIT
        )
        self.cone = plotter.add_mesh(
            self._cone, color=np.array(_NORMAL) / 255, opacity=0.35, **UNLIT
        )
        self.hide()

    def hide(self) -> None:
        self.actor.visibility = self.cone.visibility = False

    def show(
        self,
        skin: DrawnSkin,
        position: Array,
        angle: float,
        slope_sd: Array | None,
        lift: float = 0.0,
    ) -> None:
        """Draw it at `position` (2,) in m, the first direction `angle` rad from x.

        The directions lie on the skin, `lift` mm above it. `slope_sd` (2,) are the standard
        deviations of the drawn slopes, None if unknown.
        """
        (origin,), _ = skin.place(position[None])
        x, y = skin.tangents(position)
        normal = np.cross(x, y)
        normal /= np.linalg.norm(normal)
        length = _LONG * skin.size
        lines = [origin + length * np.linspace(0, 1, _POINTS)[:, None] * normal]
        for turn in (angle, angle + np.pi / 2):
            # Along the skin: straight ones would be hidden where it is hollow.
            along = length / MM * np.linspace(-0.5, 0.5, _POINTS)[:, None]
            there = position + along * (np.cos(turn), np.sin(turn))
            lines.append(skin.place(there, lift)[0])
        self._lines.points[:] = np.concatenate(lines)
        self.actor.visibility = True
        self.cone.visibility = slope_sd is not None
        if slope_sd is not None:
            around = 2 * np.pi * np.arange(_RIM) / _RIM
            off = _WIDE * slope_sd[:, None] * np.stack([np.cos(around), np.sin(around)])
            rim = normal + off[0, :, None] * x + off[1, :, None] * y
            rim *= length / np.linalg.norm(rim, axis=1, keepdims=True)
            self._cone.points[:] = np.vstack([origin, origin + rim])
