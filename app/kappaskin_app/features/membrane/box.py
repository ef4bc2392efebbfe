"""A box out of which nothing is drawn of the skin, to look inside."""

from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPlane, vtkPlaneCollection

from kappaskin_app.shell.drawn_skin import DrawnSkin

Shares = tuple[float, float, float, float, float, float]

WHOLE: Shares = (0.0, 1.0, 0.0, 1.0, 0.0, 1.0)
"""Nothing is cut away."""
_EDGE = 1e-3  # of the box: a skin that is drawn just as deep as it may be is not cut there


class Box:
    """Six planes across x, y and the height; they hold for every actor that it was told to cut."""

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
        """Stand where the skin is, from and to these shares of it along x, y and the height."""
        low, high = (np.repeat(side, 2) for side in skin.bounds)
        places = low + np.array(self.shares) * (high - low)
        outwards = np.tile([-_EDGE, _EDGE], 3) * (high - low)
        for number, place in enumerate(places + outwards):
            origin = [0.0, 0.0, 0.0]
            origin[number // 2] = float(place)
            self._planes[number].SetOrigin(*origin)

    def cut(self, actors: Any) -> None:
        """Cut all `actors` that have a mapper, or let them be whole again."""
        wanted = self._none if self.shares == WHOLE else self._all
        for actor in actors:
            mapper = getattr(actor, "mapper", None)
            if mapper is not None and mapper.GetClippingPlanes() is not wanted:
                mapper.SetClippingPlanes(wanted)
