"""A box out of which nothing is drawn of the skin, to look inside."""

from typing import Any

from vtkmodules.vtkCommonDataModel import vtkPlane, vtkPlaneCollection

from kappaskin_app.views.drawn import DrawnSkin

Shares = tuple[float, float, float, float]

WHOLE: Shares = (0.0, 1.0, 0.0, 1.0)
"""Nothing is cut away."""


class Box:
    """Four planes across x and y; they hold for every actor that it was told to cut."""

    def __init__(self) -> None:
        self._planes = [vtkPlane() for _ in range(4)]
        self._all, self._none = vtkPlaneCollection(), vtkPlaneCollection()
        for plane in self._planes:
            self._all.AddItem(plane)
        self.shares = WHOLE

    def show(self, skin: DrawnSkin) -> None:
        """Stand where the skin is, from and to these shares of it along x and y."""
        x0, x1, y0, y1 = skin.bounds
        places = [
            low + share * (high - low)
            for share, (low, high) in zip(
                self.shares, ((x0, x1), (x0, x1), (y0, y1), (y0, y1)), strict=True
            )
        ]
        for number, (plane, place) in enumerate(zip(self._planes, places, strict=True)):
            inward = 1.0 if number % 2 == 0 else -1.0
            along_x = number < 2
            plane.SetOrigin(place if along_x else 0.0, 0.0 if along_x else place, 0.0)
            plane.SetNormal(inward if along_x else 0.0, 0.0 if along_x else inward, 0.0)

    def cut(self, actors: Any) -> None:
        """Cut all `actors` that have a mapper, or let them be whole again."""
        wanted = self._none if self.shares == WHOLE else self._all
        for actor in actors:
            mapper = getattr(actor, "mapper", None)
            if mapper is not None and mapper.GetClippingPlanes() is not wanted:
                mapper.SetClippingPlanes(wanted)
