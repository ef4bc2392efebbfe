"""Where a load that is more than a point presses, as a line to draw on the skin."""

import numpy as np
from numpy.typing import NDArray

from kappaskin.mechanics import DiscLoad, GaussianLoad, LineLoad, Load, RectangleLoad

Array = NDArray[np.float64]

_POINTS = 41  # of every footprint, so that one line on the skin can be any of them
_CORNERS = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]) / 2


def footprint(load: Load) -> Array | None:
    """Positions (41, 2) in m along a line load, or round a spread one; None of a point.

    A Gaussian is drawn two standard deviations wide: 86 % of its force press inside.
    """
    along = np.linspace(0, 1, _POINTS)
    if isinstance(load, LineLoad):
        ends = np.array([(load.x0, load.y0), (load.x1, load.y1)])
        return _between(along, ends)
    if isinstance(load, RectangleLoad):
        corners = load.centre() + _CORNERS * (load.width, load.height)
        return _between(4 * along, corners)
    if isinstance(load, DiscLoad | GaussianLoad):
        radius = load.radius if isinstance(load, DiscLoad) else 2 * load.sd
        turn = 2 * np.pi * along
        return load.centre() + radius * np.column_stack([np.cos(turn), np.sin(turn)])
    return None


def _between(at: Array, corners: Array) -> Array:
    """Where the line through `corners` (k, 2) is when the corners are passed at 0, 1, 2, ..."""
    passed = np.arange(len(corners))
    return np.column_stack([np.interp(at, passed, corners[:, axis]) for axis in (0, 1)])
