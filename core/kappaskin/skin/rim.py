"""The grid of a skin that ends inside its rectangle, with the points beside it moved to its rim."""

import numpy as np
from numpy.typing import NDArray

from kappaskin.skin.patch import Patch

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

_HALVINGS = 24  # of a cell, until the rim is found


def onto_rim(patch: Patch, grid: Array, on: Mask) -> tuple[Array, Indices]:
    """The `grid` (ny, nx, 2) with every point that has a neighbour `on` the skin on it or its rim.

    And whose value each point shows, (ny nx): its own, or its neighbour's where there is none.
    """
    ny, nx = on.shape
    moved, shown = grid.copy(), np.arange(on.size).reshape(ny, nx)
    least = np.full(on.shape, np.inf)
    for dy, dx in ((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j):
        q, p = np.nonzero(~on)
        beside = (q + dy >= 0) & (q + dy < ny) & (p + dx >= 0) & (p + dx < nx)
        q, p = q[beside], p[beside]
        beside = on[q + dy, p + dx]
        q, p = q[beside], p[beside]
        inside, outside = grid[q + dy, p + dx], grid[q, p]
        for _ in range(_HALVINGS):
            middle = (inside + outside) / 2
            there = patch.contains(middle)[:, None]
            inside, outside = np.where(there, middle, inside), np.where(there, outside, middle)
        far = np.linalg.norm(inside - grid[q, p], axis=-1)
        near = far < least[q, p]
        q, p = q[near], p[near]
        least[q, p], moved[q, p] = far[near], inside[near]
        shown[q, p] = shown[q + dy, p + dx]
    return moved, shown.ravel()
