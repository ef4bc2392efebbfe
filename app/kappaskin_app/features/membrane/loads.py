"""Simulated loads on the skin: arrows, and outlines of distributed loads."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyvista as pv

from kappaskin.frames import Array
from kappaskin.mechanics import Load
from kappaskin_app.features.membrane.annotations import UNLIT, pixels
from kappaskin_app.features.membrane.mouse import ARROW
from kappaskin_app.shell.drawn_skin import DrawnSkin
from kappaskin_app.shell.loads import footprint

LOAD = "#e8543f"
"""The colour of what is simulated: loads and the true shape."""


class DrawnLoads:
    """Arrows and outlines of loads."""

    def __init__(self, plotter: Any) -> None:
        self._plotter = plotter
        # Sized for a skin of size 1, and scaled by the present one.
        self._arrow = pv.Arrow(
            start=(0, 0, ARROW), direction=(0, 0, -1), scale=ARROW, tip_length=0.35
        )
        self._arrows: list[pv.Actor] = []
        self._line: Any = pv.PolyData(np.zeros((2, 3)), lines=[2, 0, 1])
        self._line_actor = plotter.add_mesh(
            self._line,
            line_width=pixels(plotter, 5),
            color=LOAD,
            **UNLIT,
        )

    def show(
        self, loads: Sequence[Load], skin: DrawnSkin, lift: float, visible: bool = True
    ) -> Array:
        """Draw `loads` on `skin` if `visible`; their positions (k, 2) in m."""
        centres = np.array([load.centre() for load in loads]).reshape(-1, 2)
        while len(self._arrows) < len(centres):
            self._arrows.append(
                self._plotter.add_mesh(self._arrow, color=LOAD, reset_camera=False, render=False)
            )
        for number, arrow in enumerate(self._arrows):
            there = visible and number < len(centres)
            # Inwards for a push; for a pull outwards, from the surface.
            pulls = there and loads[number].force < 0
            arrow.scale = (skin.size, skin.size, -skin.size if pulls else skin.size)
            place = centres[number] if there else np.full(2, np.nan)
            put_upright(arrow, skin, place, ARROW * skin.size if pulls else 0.0)
        self._show_footprints(loads if visible else (), skin, lift)
        return centres

    def _show_footprints(self, loads: Sequence[Load], skin: DrawnSkin, lift: float) -> None:
        found = (footprint(load, skin.patch) for load in loads)
        lines = [line for line in found if line is not None]
        self._line_actor.visibility = bool(lines)
        if lines:
            points, _ = skin.place(np.concatenate(lines), lift)
            if len(points) != self._line.n_points:
                each = np.arange(len(points)).reshape(len(lines), -1)
                self._line.points = points
                self._line.lines = np.insert(each, 0, each.shape[1], axis=1).ravel()
            self._line.points[:] = points


def put_upright(actor: pv.Actor, skin: DrawnSkin, position: Array, above: float = 0.0) -> None:
    """Place an actor normal to the drawn skin at `position` (2,) in m; hide it at NaN."""
    actor.visibility = shown = bool(np.isfinite(position).all())
    if shown:
        points, out = skin.place(position[None], above)
        actor.position = tuple(points[0])
        x, y, z = out[0]  # turned about y first, then about x
        actor.orientation = tuple(np.degrees([np.arctan2(-y, z), np.arcsin(x), 0.0]))
