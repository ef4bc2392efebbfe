"""How what only marks something is put into the picture."""

from typing import Any

UNLIT = {"lighting": False, "pickable": False, "reset_camera": False, "render": False}
"""For `add_mesh`: the same colour from every side, nothing drawn and the camera left alone."""


def pixels(plotter: Any, size: float) -> float:
    """How many of VTK's pixels, which are the screen's, are `size` of the window's."""
    return size * plotter.devicePixelRatioF()
