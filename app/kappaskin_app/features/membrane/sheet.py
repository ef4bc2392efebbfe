"""The underside of an object, as far as it is near the skin, translucent in its place."""

from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from kappaskin.mechanics import PlacedObject
from kappaskin_app.features.membrane.unlit import UNLIT
from kappaskin_app.shell.drawn_skin import MM, DrawnSkin

Array = NDArray[np.float64]

_AROUND, _OUT, _FINE = 64, 14, 48  # points around, outwards, and to find how far it is near
_ABOVE = 0.35  # of the skin's size: what is higher is not drawn
_WAYS = 2 * np.pi * np.arange(_AROUND) / _AROUND
_SIDES = np.stack([np.cos(_WAYS), np.sin(_WAYS)], axis=-1)


class Sheet:
    """A mesh round the object's place, stretched in height as the skin is, so that both fit."""

    def __init__(self, plotter: Any, colour: str) -> None:
        self._mesh: Any = pv.PolyData(np.zeros((_OUT * _AROUND, 3)), faces=_faces())
        self.actor = plotter.add_mesh(
            self._mesh,
            color=colour,
            opacity=0.35,
            **UNLIT,
        )
        self.actor.visibility = False

    def show(self, stands: PlacedObject | None, skin: DrawnSkin, times: float) -> None:
        """Draw the object that `stands` there resting on the `skin`; nothing of None."""
        points = None if stands is None else underside(stands, skin, times)
        self.actor.visibility = points is not None
        if points is not None:
            self._mesh.points[:] = points


def underside(stands: PlacedObject, skin: DrawnSkin, times: float) -> Array | None:
    """Points (k, 3) in mm of the underside, so low that it touches the drawn skin.

    None where it is nowhere above it.
    """
    reach = min(float(np.hypot(*stands.object_.extent)), skin.side / MM)
    shares = np.linspace(0.0, 1.0, _FINE)
    places = stands.place + reach * shares[:, None, None] * _SIDES
    height = stands.over(skin.patch, places.reshape(-1, 2))[0].reshape(_FINE, _AROUND)
    depth = _depth(skin, places.reshape(-1, 2), height.ravel(), times)
    if not np.isfinite(depth):
        return None
    near = np.isfinite(height) & (times * MM * (height - depth) < _ABOVE * skin.size)
    outermost = np.where(near.all(axis=0), _FINE, near.argmin(axis=0)) - 1
    if outermost.max() <= 0:
        return None
    far = reach * shares[np.maximum(outermost, 0)]
    places = stands.place + np.linspace(0, 1, _OUT)[:, None, None] * far[:, None] * _SIDES
    flat = places.reshape(-1, 2)
    rise = np.nan_to_num(stands.over(skin.patch, flat)[0] - depth, posinf=0.0)
    rest, out = skin.at_rest(flat)
    return rest + out * (times * MM * rise)[:, None]


def _depth(skin: DrawnSkin, places: Array, height: Array, times: float) -> float:
    """How far in m its lowest point is in, when it touches the skin and enters it nowhere."""
    over = np.isfinite(height) & skin.patch.contains(places)
    if not over.any():
        return float("nan")
    moved = -skin.height_at(places[over]) / (MM * times)
    return float(np.min(moved + height[over]))


def _faces() -> NDArray[np.intp]:
    """Squares between the rings, VTK's way."""
    index = np.arange(_OUT * _AROUND).reshape(_OUT, _AROUND)
    beside = np.roll(index, -1, axis=1)
    corners = np.stack([index[:-1], beside[:-1], beside[1:], index[1:]], axis=-1).reshape(-1, 4)
    return np.insert(corners, 0, 4, axis=1).ravel()
