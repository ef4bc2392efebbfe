"""Surface of the skin: mesh, lines of its grid, colours and clipping box."""

from typing import Any

import numpy as np
import pyvista as pv
import scipy
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPlane, vtkPlaneCollection

from kappaskin.frames import Array, Indices
from kappaskin.sensing import SensorLayout
from kappaskin_app.features.membrane.annotations import UNLIT, pixels
from kappaskin_app.shell.drawn_skin import DrawnSkin
from kappaskin_app.theme import Colours, current, follow_look

_PIXELS = 384  # per side, for elements of an irregular layout


class ElementCells:
    """Texture with one cell per element."""

    def __init__(self) -> None:
        self.texture: Any = None
        self._which: Indices = np.empty(0, np.intp)

    def set_layout(self, layout: SensorLayout) -> None:
        """Set the layout of another skin: each pixel shows its nearest element."""
        if layout.shape:
            width, height = layout.shape
            self._which = np.arange(len(layout))
        else:
            width = height = _PIXELS
            x, y = layout.patch.cell_centres(width, height)
            pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
            self._which = np.asarray(scipy.spatial.KDTree(layout.positions).query(pixels)[1])
        self._image: Any = pv.ImageData(dimensions=(width, height, 1))
        self._image.point_data["rgb"] = np.zeros((width * height, 3), np.uint8)
        self.pixels = self._image.point_data["rgb"]
        self.texture = pv.Texture(self._image)
        self.texture.interpolate = False
        self.texture.repeat = False

    def show(self, rgb: Colours) -> None:
        """Colour the elements by `rgb` (P, 3)."""
        self.pixels[:] = rgb[self._which]
        self._image.Modified()
        self.texture.Modified()


Shares = tuple[float, float, float, float, float, float]

WHOLE: Shares = (0.0, 1.0, 0.0, 1.0, 0.0, 1.0)
"""No clipping."""
_EDGE = 1e-3  # of the box: margin, so that a skin of the largest depth is not clipped


class Box:
    """Clipping box of six planes across x, y and height."""

    def __init__(self) -> None:
        self._planes = [vtkPlane() for _ in range(6)]
        self._all, self._none = vtkPlaneCollection(), vtkPlaneCollection()
        for number, plane in enumerate(self._planes):
            self._all.AddItem(plane)
            inward = [0.0, 0.0, 0.0]
            inward[number // 2] = 1.0 if number % 2 == 0 else -1.0
            plane.SetNormal(*inward)
        self.shares = WHOLE

    def show(self, skin: DrawnSkin) -> None:
        """Place the planes on the skin, at its `shares`."""
        low, high = (np.repeat(side, 2) for side in skin.bounds)
        places = low + np.array(self.shares) * (high - low)
        outwards = np.tile([-_EDGE, _EDGE], 3) * (high - low)
        for number, place in enumerate(places + outwards):
            origin = [0.0, 0.0, 0.0]
            origin[number // 2] = float(place)
            self._planes[number].SetOrigin(*origin)

    def cut(self, actors: Any) -> None:
        """Clip all `actors` that have a mapper; none if the box is whole."""
        wanted = self._none if self.shares == WHOLE else self._all
        for actor in actors:
            mapper = getattr(actor, "mapper", None)
            if mapper is not None and mapper.GetClippingPlanes() is not wanted:
                mapper.SetClippingPlanes(wanted)


class GridLines:
    """Every `stride`th line of the grid from the `first` on, on a surface over the skin."""

    def __init__(self, plotter: Any, stride: int, first: int, **style: Any) -> None:
        self._stride, self._first = stride, first
        self._mesh: Any = pv.PolyData(np.zeros((2, 3)), lines=[2, 0, 1])
        self.actor = plotter.add_mesh(self._mesh, line_width=pixels(plotter, 1), **style, **UNLIT)
        self.actor.visibility = False

    def show_skin(self, skin: DrawnSkin) -> None:
        lines = skin.lines(self._stride, self._first)
        self._which = np.concatenate(lines)
        ends = np.cumsum([len(line) for line in lines])
        cells = [np.r_[len(x), np.arange(e - len(x), e)] for x, e in zip(lines, ends, strict=True)]
        self._mesh.points = skin.points(self._which)
        self._mesh.lines = np.concatenate(cells)
        self._points = self._mesh.points  # looking it up takes longer than filling it

    def show(self, skin: DrawnSkin, height: Array) -> None:
        """Draw them `height` (ny, nx) mm above the skin at rest; hide them where it is unknown."""
        there = height.ravel()[self._which]
        self.actor.visibility = bool(np.isfinite(there).any())
        self._points[:] = skin.points(self._which, np.nan_to_num(there))


class Surface:
    """Mesh of the skin, written in place; its actor is None until there is a skin."""

    def __init__(self, plotter: Any) -> None:
        self._plotter = plotter
        self._colours, self._cells = pv.LookupTable(), ElementCells()
        # Any: PyVista's annotations are too narrow for writing into arrays in place.
        self.mesh: Any = pv.PolyData()
        self.actor: Any = None
        self._arrays: dict[str, Any] = {}
        self._lost = self._by_element = False
        follow_look(plotter, self._apply_theme)

    def show_skin(self, skin: DrawnSkin, layout: SensorLayout) -> None:
        """Draw another skin, at rest."""
        mesh = pv.PolyData(skin.points(), faces=skin.faces().ravel())
        mesh.point_data["value"] = np.zeros(skin.on.size)
        mesh.point_data.active_normals = skin.shading()
        mesh.active_texture_coordinates = skin.shares
        self.mesh.shallow_copy(mesh)
        self._cells.set_layout(layout)
        if self.actor is None:
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
        # VTK arrays: looking them up takes longer than filling them.
        data = self.mesh.point_data
        self._arrays = {
            "points": self.mesh.points,
            "normals": data.active_normals,
            "values": data["value"],
        }
        self._apply_theme()

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
            self._apply_theme()
        if by_element:
            self._cells.show(values)
        else:
            self._arrays["values"][:] = skin.values(values)
            self.actor.mapper.scalar_range = limits

    def show_colours(self, colours: Colours) -> None:
        """Set the colour map (256, 3) of values."""
        opaque = np.full((len(colours), 1), 255, np.uint8)
        self._colours.values = np.hstack([colours, opaque])

    @property
    def lost(self) -> bool:
        """Whether it is drawn grey."""
        return self._lost

    def show_lost(self, lost: bool) -> None:
        self._lost = lost
        self._apply_theme()

    def _apply_theme(self) -> None:
        """Show the values, the texture of the elements, or grey when lost."""
        self._colours.nan_color = current().missing
        if self.actor is None:
            return
        pictured = self._by_element and not self._lost
        self.actor.SetTexture(self._cells.texture if pictured else None)
        self.actor.mapper.scalar_visibility = not (self._lost or pictured)
        self.actor.prop.color = "#ffffff" if pictured else current().missing
