"""The skin's surface as it is drawn: its shape, and colours of its points or of its elements."""

from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from kappaskin.sensing import SensorLayout
from kappaskin_app.features.membrane.element_cells import ElementCells
from kappaskin_app.shell.drawn_skin import DrawnSkin
from kappaskin_app.theme import Colours, Theme


class Surface:
    """A mesh that is written in place; its actor is None until there is a skin."""

    def __init__(self, plotter: Any) -> None:
        self._plotter = plotter
        self._colours, self._cells = pv.LookupTable(), ElementCells()
        # Any: what PyVista says of its own types is too narrow to write into arrays in place.
        self.mesh: Any = pv.PolyData()
        self.actor: Any = None
        self._arrays: dict[str, Any] = {}
        self._lost = self._by_element = False
        self._missing = "#808080"

    def show_skin(self, skin: DrawnSkin, layout: SensorLayout) -> None:
        """Draw another skin, at rest."""
        self.mesh = pv.PolyData(skin.points(), faces=skin.faces().ravel())
        self.mesh.point_data["value"] = np.zeros(skin.on.size)
        self.mesh.point_data.active_normals = skin.shading()
        self.mesh.active_texture_coordinates = skin.shares
        self._cells.meet(layout)
        if self.actor is not None:
            self._plotter.remove_actor(self.actor, render=False)
        self.actor = self._plotter.add_mesh(
            self.mesh,
            scalars="value",
            cmap=self._colours,
            show_scalar_bar=False,
            smooth_shading=False,
            reset_camera=False,
            render=False,
            specular=0.0,
            ambient=0.6,
            diffuse=0.42,
        )
        self.actor.prop.interpolation = "Gouraud"
        # VTK's own arrays: looking them up takes longer than to fill them.
        data = self.mesh.point_data
        self._arrays = {
            "points": self.mesh.points,
            "normals": data.active_normals,
            "values": data["value"],
        }
        self._dress()

    def show_shape(self, skin: DrawnSkin) -> None:
        self._arrays["points"][:] = skin.points()
        self._arrays["normals"][:] = skin.shading()

    def show_values(
        self, skin: DrawnSkin, values: NDArray[Any], limits: tuple[float, float]
    ) -> None:
        """Colour by `values` (ny, nx) between `limits`, or by colours (P, 3) of the elements."""
        by_element = values.dtype == np.uint8
        if by_element != self._by_element:
            self._by_element = by_element
            self._dress()
        if by_element:
            self._cells.show(values)
        else:
            self._arrays["values"][:] = skin.values(values)
            self.actor.mapper.scalar_range = limits

    def show_colours(self, colours: Colours) -> None:
        """Colour values by a map of 256 colours (256, 3)."""
        opaque = np.full((len(colours), 1), 255, np.uint8)
        self._colours.values = np.hstack([colours, opaque])

    @property
    def lost(self) -> bool:
        """Whether it is drawn grey."""
        return self._lost

    def show_lost(self, lost: bool) -> None:
        self._lost = lost
        self._dress()

    def show_theme(self, theme: Theme) -> None:
        self._missing = theme.missing
        self._colours.nan_color = theme.missing
        self._dress()

    def _dress(self) -> None:
        """Show the values, a picture of the elements, or neither when lost."""
        if self.actor is None:
            return
        pictured = self._by_element and not self._lost
        self.actor.SetTexture(self._cells.texture if pictured else None)
        self.actor.mapper.scalar_visibility = not (self._lost or pictured)
        self.actor.prop.color = "#ffffff" if pictured else self._missing
