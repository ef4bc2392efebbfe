"""The skin's own coordinates: a flat rectangle, x in [0, a], y in [0, b]."""

import math
from dataclasses import dataclass

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask


@dataclass(frozen=True)
class Patch:
    """A flat rectangular skin of `a` by `b` metres, held along its four edges."""

    a: float
    b: float

    def __post_init__(self) -> None:
        if not all(math.isfinite(side) and side > 0 for side in (self.a, self.b)):
            raise Refusal(
                f"expected a patch with two sides above zero in metres, got {self.a} x {self.b}; "
                "give lengths such as 0.1 x 0.1"
            )

    def grid(self, nx: int, ny: int) -> tuple[Array, Array]:
        """Evenly spaced x (nx,) and y (ny,) in m that include the edges."""
        if nx < 2 or ny < 2:
            raise Refusal(f"expected a grid of at least 2 x 2 points, got {nx} x {ny}")
        return np.linspace(0.0, self.a, nx), np.linspace(0.0, self.b, ny)

    def cell_centres(self, m: int, n: int) -> tuple[Array, Array]:
        """Centres x (m,) and y (n,) in m of an m x n tiling."""
        if m < 1 or n < 1:
            raise Refusal(f"expected at least 1 x 1 cells, got {m} x {n}")
        return (np.arange(m) + 0.5) * self.a / m, (np.arange(n) + 0.5) * self.b / n

    def contains(self, positions: Array) -> Mask:
        """Which of `positions` (P, 2) in m lie on the patch, edges included."""
        return np.all((positions >= 0) & (positions <= (self.a, self.b)), axis=-1)
