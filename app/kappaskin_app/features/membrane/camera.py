"""Where to look at a skin from, so that all of it and what is written beside it is seen."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kappaskin_app.shell.drawn_skin import FROM_THE_LEFT, MM, Direction, DrawnSkin

Array = NDArray[np.float64]

_LOW = 0.2  # of the shorter side: how far in the view reaches below the skin at rest
_MARGIN = 0.06  # of the longer side: room for the labels beside the edges and the arrow above


DIRECTIONS = {
    "left": FROM_THE_LEFT,
    "above": Direction("from above", (0.0, 0.0, 1.6), (0.0, 1.0, 0.0)),
    "front": Direction("along y", (0.0, -1.6, 0.0)),
    "side": Direction("along x", (1.6, 0.0, 0.0)),
    "below": Direction("from below", (0.0, 0.0, -1.6), (0.0, 1.0, 0.0)),
    "corner": Direction("from a corner, all sides alike", (-1.0, -1.0, 1.0)),
}
_NUMBERS = 12  # that say how a camera stands


def fit_camera(renderer: Any, skin: DrawnSkin, direction: Direction, label: float) -> None:
    """Look at the whole of `skin` from `direction`.

    With room to its left and right for a label each, which takes this share of the picture's width.
    """
    camera = renderer.GetActiveCamera()
    body = _around(skin, 0.0)
    least, most = body.min(axis=0), body.max(axis=0)
    middle = (least + most) / 2
    camera.SetFocalPoint(*middle)
    camera.SetPosition(*(middle + skin.side * np.array(direction.towards)))
    camera.SetViewUp(*direction.up)
    camera.SetViewAngle(30.0)
    renderer.ResetCamera(*np.column_stack([least, most]).ravel())
    camera.SetWindowCenter(0.0, 0.0)
    seen = np.array([_in_view(renderer, *point) for point in _around(skin, _MARGIN)])
    least, most = seen.min(axis=0), seen.max(axis=0)
    skin_alone = np.ptp([_in_view(renderer, *point)[0] for point in body])
    beside = (2.0 - 4.0 * label) / float(skin_alone)
    zoom = min(1.94 / float(np.max(most - least)), beside)
    camera.Zoom(zoom)
    camera.SetWindowCenter(*(zoom * (least + most) / 2))
    renderer.ResetCameraClippingRange()


def camera_of(renderer: Any, skin: DrawnSkin) -> tuple[float, ...]:
    """How the camera stands: what it looks at and from where, what is up, its angle, its shift.

    From the middle of `skin`, with its longer side for a unit, so that another is seen so too.
    """
    camera, middle = renderer.GetActiveCamera(), _middle(skin)
    places = (camera.GetFocalPoint(), camera.GetPosition())
    seen = [(np.array(place) - middle) / skin.side for place in places]
    rest = (*camera.GetViewUp(), camera.GetViewAngle(), *camera.GetWindowCenter())
    return tuple(float(value) for value in (*seen[0], *seen[1], *rest))


def place_camera(renderer: Any, skin: DrawnSkin, numbers: Sequence[float]) -> None:
    """Have the camera stand as `camera_of` told it; other numbers leave it as it is."""
    if len(numbers) != _NUMBERS:
        return
    camera, middle = renderer.GetActiveCamera(), _middle(skin)
    at, stands, up = (np.array(numbers[n : n + 3]) for n in (0, 3, 6))
    camera.SetFocalPoint(*(middle + skin.side * at))
    camera.SetPosition(*(middle + skin.side * stands))
    camera.SetViewUp(*up)
    camera.SetViewAngle(numbers[9])
    camera.SetWindowCenter(*numbers[10:])
    renderer.ResetCameraClippingRange()


def _middle(skin: DrawnSkin) -> Array:
    """The middle (3,) of what a skin reaches at rest, in mm."""
    body = _around(skin, 0.0)
    return (body.min(axis=0) + body.max(axis=0)) / 2


def _around(skin: DrawnSkin, share: float) -> Array:
    """Points (k, 3) in mm around the skin and what is drawn within this share of it."""
    a, b = skin.patch.a, skin.patch.b
    margin = share * skin.side
    x = np.linspace(0, a, 9 if skin.patch.base_curvature else 2)
    points, out = skin.at_rest(np.stack(np.meshgrid(x, (0, b)), axis=-1).reshape(-1, 2))
    low, high = -_LOW * MM * min(a, b), 2 * margin
    corners = [(dx, dy, 0.0) for dx in (-margin, 2.5 * margin) for dy in (-margin, margin)]
    return np.concatenate([points + z * out + at for z in (low, high) for at in corners])


def _in_view(renderer: Any, x: float, y: float, z: float) -> Array:
    """Where a point in mm is in the picture, (2,), each from -1 to 1."""
    renderer.SetWorldPoint(x, y, z, 1.0)
    renderer.WorldToView()
    return np.array(renderer.GetViewPoint()[:2])
