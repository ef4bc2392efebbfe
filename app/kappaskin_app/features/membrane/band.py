"""How sure the surface is: two translucent surfaces, one below and one above it."""

from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from kappaskin_app.features.membrane.unlit import UNLIT
from kappaskin_app.shell.drawn_skin import MM, DrawnSkin

Array = NDArray[np.float64]

TIMES_SD = 2.0
"""Standard deviations from the surface to either side of the band."""
_COLOUR = "#8fd0ff"


class Band:
    """The surface, `TIMES_SD` error bars out and as many in."""

    def __init__(self, plotter: Any) -> None:
        self._plotter = plotter
        self._skin: DrawnSkin | None = None
        self._meshes: list[Any] = []
        self._actors: list[Any] = []

    def show(self, skin: DrawnSkin, sd: Array | None, times: float) -> None:
        """Draw it around `skin` for standard deviations `sd` (ny, nx) in m; nothing of None."""
        if sd is not None and skin is not self._skin:
            self._meet(skin)
        for actor in self._actors:
            actor.visibility = sd is not None
        if sd is not None:
            wide = TIMES_SD * MM * times * np.nan_to_num(sd).ravel()
            for side, mesh in zip((-1, 1), self._meshes, strict=True):
                mesh.points[:] = skin.points(height=skin.height.ravel() + side * wide)

    def _meet(self, skin: DrawnSkin) -> None:
        for actor in self._actors:
            self._plotter.remove_actor(actor, render=False)
        self._skin = skin
        faces = skin.faces().ravel()
        self._meshes = [pv.PolyData(skin.points(), faces=faces) for _ in range(2)]
        self._actors = [
            self._plotter.add_mesh(
                mesh,
                color=_COLOUR,
                opacity=0.3,
                **UNLIT,
            )
            for mesh in self._meshes
        ]
