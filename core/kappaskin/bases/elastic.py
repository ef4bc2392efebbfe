"""Products of a constant, a slope and sines: the shapes of a skin whose rim gives."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kappaskin.bases.product import JetProductBasis, gauss
from kappaskin.errors import Refusal
from kappaskin.frames import Array


@dataclass(frozen=True)
class ElasticBasis(JetProductBasis):
    """The Ni x Nj products of 1, 2x/a - 1, sin(pi x/a), sin(2 pi x/a) ... and the same along y.

    Every shape with finite bending energy is a sum of them: along x, what is left of a function
    when the line through its ends is taken out vanishes at both, which sines are complete for.

    Readings of curvature see neither a translation nor a tilt: 1, x and y (1 and x on a strip) are
    `unseen`, and of all shapes that explain the readings `free` keeps the one whose rim is nearest
    to rest. How far the rim may be from there is for the fit's error bar to say.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.patch.base_curvature:
            raise Refusal(
                f"expected a flat skin for a rim that gives, got a base radius of "
                f"{self.patch.radius:g} m; hold its edges, or let its ends slide"
            )
        least = (3, 1) if self.patch.strip else (2, 2)
        if self.Ni < least[0] or self.Nj < least[1]:
            raise Refusal(
                "a translation and a tilt bend nothing: expected at least "
                f"{least[0]} x {least[1]} functions, got {self.Ni} x {self.Nj}"
            )

    def _along(self, x: Array, length: float, count: int, derivative: int) -> Array:
        if derivative < 0:
            raise Refusal("a flat skin needs no integral along x; expected an order of at least 0")
        k = np.arange(1.0, count - 1) * (np.pi / length)
        lines = np.zeros((len(x), 2))
        lines[:, 0] = derivative == 0
        lines[:, 1] = (2 * x / length - 1, 2 / length, 0)[derivative]
        waves = k**derivative * np.sin(np.multiply.outer(x, k) + derivative * np.pi / 2)
        return np.hstack([lines, waves])

    def _jet(self, x: float, length: float, count: int) -> Array:
        jet = np.zeros((3, count))
        jet[:2, :2] = (1, 2 * x / length - 1), (0, 2 / length)
        k = np.arange(1.0, count - 1) * (np.pi / length)
        jet[0, 2:] = sine = np.sin(k * x)
        jet[1, 2:], jet[2, 2:] = k * np.cos(k * x), -(k**2) * sine
        return jet

    def rim(self) -> tuple[Array, Array]:
        """Points (Q, 2) in m and weights (Q,) in m that integrate products along the rim."""
        (a, b), strip = (self.patch.a, self.patch.b), self.patch.strip
        x, along_x = gauss(a, 2 * self.Ni + 16)
        y, along_y = gauss(b, 1 if strip else 2 * self.Nj + 16)
        sides = [(end, y, along_y) for end in (0.0, a)]
        sides += [] if strip else [(x, end, along_x) for end in (0.0, b)]
        points = [np.column_stack(np.broadcast_arrays(*side[:2])) for side in sides]
        return np.vstack(points), np.concatenate([side[2] for side in sides])

    @property
    def _rigid(self) -> list[int]:
        """Which functions are 1, x and, but on a strip, y."""
        return [0, self.Nj] if self.patch.strip else [0, self.Nj, 1]

    @property
    def unseen(self) -> Array:
        """The rigid shapes (N, 3), on a strip (N, 2), with unit RMS along the rim."""
        return self._unseen

    @cached_property
    def _unseen(self) -> Array:
        points, weights = self.rim()
        mean_square = weights @ self.at(points)[:, self._rigid] ** 2 / weights.sum()
        return np.eye(self.size)[:, self._rigid] / np.sqrt(mean_square)

    @property
    def free(self) -> Array:
        """Every other function less the rigid shape nearest to it along the rim, (N, N - 3)."""
        return self._nearest_to_rest

    @cached_property
    def _nearest_to_rest(self) -> Array:
        points, weights = self.rim()
        R = self.at(points)
        others = np.delete(np.eye(self.size), self._rigid, axis=1)
        # The rigid shapes are orthogonal along the rim, by its symmetry.
        share = (R @ self.unseen).T * weights / weights.sum() @ R @ others
        return others - self.unseen @ share
