"""How far two places of a skin are apart, through the air and along it."""

from dataclasses import dataclass

import numpy as np

from kappaskin.frames import Array
from kappaskin.skin.patch import Patch

_STEPS = 256  # of the line along the skin


@dataclass(frozen=True)
class Distances:
    """From a first place to a second, in m: `straight`, `along` the skin, and how much `higher`.

    Along the line that is straight in the skin's own coordinates, on the skin as it is bent.
    """

    straight: float
    along: float
    higher: float


def distances(patch: Patch, surface: Array, first: Array, second: Array) -> Distances:
    """Those between the places `first` and `second` (2,) in m, displaced by `surface` (ny, nx)."""
    places = first + np.linspace(0.0, 1.0, _STEPS + 1)[:, None] * (second - first)
    rest, out = patch.at_rest(places)
    points = rest - out * between(patch, surface, places)[:, None]
    whole = points[-1] - points[0]
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return Distances(float(np.linalg.norm(whole)), float(steps.sum()), float(whole[2]))


def between(patch: Patch, values: Array, places: Array) -> Array:
    """What `values` (ny, nx) on the grid of a patch are at `places` (P, 2), evenly between them.

    Zero where they are NaN, as off the skin.
    """
    ny, nx = values.shape
    known = np.nan_to_num(values)
    p, q = np.clip(places / (patch.a, patch.b) * (nx - 1, ny - 1), 0, (nx - 1, ny - 1)).T
    i, j = np.minimum(p.astype(int), nx - 2), np.minimum(q.astype(int), ny - 2)
    low, high = (known[k, i] * (1 - p + i) + known[k, i + 1] * (p - i) for k in (j, j + 1))
    return low * (1 - q + j) + high * (q - j)
