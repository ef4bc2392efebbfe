"""Where to look at a skin from, so that all of it and what is written beside it is seen."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kappaskin import Patch

Array = NDArray[np.float64]


def fit_camera(renderer: Any, patch: Patch) -> None:
    """Look at the whole of `patch`, drawn in mm, from the front and a little from the left."""
    camera = renderer.GetActiveCamera()
    a, b = patch.a * 1e3, patch.b * 1e3
    side, low = max(a, b), -0.2 * min(a, b)
    camera.SetFocalPoint(a / 2, b / 2, low / 2)
    camera.SetPosition(a / 2 - 0.45 * side, b / 2 - 1.1 * side, side)
    camera.SetViewUp(0.0, 0.0, 1.0)
    camera.SetViewAngle(30.0)
    renderer.ResetCamera(0.0, a, 0.0, b, low, 0.0)
    camera.SetWindowCenter(0.0, 0.0)
    # Room for the labels beside the edges and the arrow above them.
    margin = 0.06 * side
    seen = np.array(
        [
            _in_view(renderer, x, y, z)
            for x in (-margin, a + 2.5 * margin)
            for y in (-margin, b + margin)
            for z in (low, 2 * margin)
        ]
    )
    least, most = seen.min(axis=0), seen.max(axis=0)
    zoom = 1.94 / float(np.max(most - least))
    camera.Zoom(zoom)
    camera.SetWindowCenter(*(zoom * (least + most) / 2))
    renderer.ResetCameraClippingRange()


def _in_view(renderer: Any, x: float, y: float, z: float) -> Array:
    """Where a point in mm is in the picture, (2,), each from -1 to 1."""
    renderer.SetWorldPoint(x, y, z, 1.0)
    renderer.WorldToView()
    return np.array(renderer.GetViewPoint()[:2])
