"""Elements to cells on the skin, each of one colour up to half way to the next."""

from typing import Any

import numpy as np
import pyvista as pv
import scipy
from numpy.typing import NDArray

from kappaskin.sensing import SensorLayout
from kappaskin_app.theme import Colours

_PIXELS = 384  # along each side, of cells that are no rectangles of a regular grid


class ElementCells:
    """A picture that lies on the skin; written in place, and not at all while it is not seen."""

    def __init__(self) -> None:
        self.texture: Any = None
        self._which: NDArray[np.intp] = np.empty(0, np.intp)

    def meet(self, layout: SensorLayout) -> None:
        """Lay out the cells of another skin: each pixel shows its nearest element."""
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
        """Colour each element by its own of `rgb` (P, 3)."""
        self.pixels[:] = rgb[self._which]
        self._image.Modified()
        self.texture.Modified()
