"""The skin's own coordinates: a rectangle, x in [0, a], y in [0, b], flat or bent along x."""

import math
from dataclasses import dataclass

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask


@dataclass(frozen=True)
class Patch:
    """A rectangular skin of `a` by `b` metres, held along its edges.

    At rest it is bent along x to `radius` in m, infinite when flat: an arc of length a, or with
    its width b a cylinder skin. A `strip` is held at its two ends in x only and is alike all along
    y: a planar curve.

    In space, x runs along the arc, whose highest point is at (a/2, y, 0); the outward normal there
    is (0, 0, 1). Displacement is positive inward, as a load presses; curvature is positive where
    the skin is convex seen from outside, so that pressing in adds f_xx (Eq. 3) to 1/radius.
    """

    a: float
    b: float
    radius: float = math.inf
    strip: bool = False

    def __post_init__(self) -> None:
        if not all(math.isfinite(side) and side > 0 for side in (self.a, self.b)):
            raise Refusal(
                f"expected a patch with two sides above zero in metres, got {self.a} x {self.b}; "
                "give lengths such as 0.1 x 0.1"
            )
        if not self.radius >= self.a / (2 * math.pi):  # NaN too
            raise Refusal(
                f"an arc of {self.a:g} m goes once round at a radius of {self.a / 2 / math.pi:.4g} "
                f"m: expected a larger base radius, or infinity for a flat skin, got {self.radius}"
            )

    @property
    def base_curvature(self) -> float:
        """1 / radius in 1/m; zero when flat."""
        return 1 / self.radius

    @property
    def opening(self) -> float:
        """The angle of the arc, a / radius in rad; zero when flat."""
        return self.a / self.radius

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

    def at_rest(self, positions: Array) -> tuple[Array, Array]:
        """Points (..., 3) in m of the skin at rest and its outward normals (..., 3) there."""
        s, y = positions[..., 0] - self.a / 2, positions[..., 1]
        H = self.base_curvature
        angle = H * s
        # R sin(s/R) and R (cos(s/R) - 1), with their flat limits s and 0.
        x, z = s * np.sinc(angle / np.pi), -s * np.sinc(angle / 2 / np.pi) * np.sin(angle / 2)
        points = np.stack([x + self.a / 2, y, z], axis=-1)
        normals = np.stack([np.sin(angle), np.zeros_like(s), np.cos(angle)], axis=-1)
        return points, normals
