"""Where the elements are and what they sense."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from kappaskin.bases import Basis, mean_curvature_at
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask
from kappaskin.skin import Patch

_SHORTEST = 1e-6  # m: shorter gages than that tell no mean, only rounding
_ROUNDING = 1e-9  # of a depth: gages as long as elements are apart end on the rim


def _channels(patch: Patch, elements: int) -> Mask:
    """All channels (3, P); on a strip, which bends along x only, those of xx."""
    live = np.ones((3, elements), bool)
    live[1:] = not patch.strip
    return live


@dataclass(frozen=True, eq=False)
class SensorLayout:
    """P elements at `positions` (P, 2) in m; each senses curvature xx, yy and xy.

    `live` (3, P) is False for the channels that are dead. `shape` is (m, n) for a regular grid,
    with element `p + m q` in column p (along x) and row q (along y), and None otherwise. Each reads
    the mean over gages of `gage_length` in m along x, along y and along both diagonals.
    """

    patch: Patch
    positions: Array
    live: Mask
    shape: tuple[int, int] | None = None
    gage_length: float = 0.0

    def __post_init__(self) -> None:
        P = self.positions
        if P.ndim != 2 or P.shape[1] != 2 or len(P) == 0:
            raise Refusal(f"expected positions of shape (P, 2) with P >= 1, got {P.shape}")
        if self.live.shape != (3, len(P)):
            raise Refusal(f"expected live of shape (3, {len(P)}), got {self.live.shape}")
        if self.shape and self.shape[0] * self.shape[1] != len(P):
            raise Refusal(f"expected {self.shape[0]} x {self.shape[1]} elements, got {len(P)}")
        outside = np.flatnonzero(~self.patch.contains(P))  # NaN counts as outside
        if outside.size:
            p, (x, y) = int(outside[0]), P[outside[0]]
            raise Refusal(
                f"{outside.size} of {len(P)} elements lie outside the {self.patch.name}: element "
                f"{p} is at ({x:g}, {y:g}) m; positions are in metres from the corner x = y = 0"
            )
        self._check_gages()

    def _check_gages(self) -> None:
        L = self.gage_length
        if not L:
            return
        if not _SHORTEST <= L < math.inf:
            raise Refusal(f"expected a gage length of 0 m, or {_SHORTEST:g} m and more, got {L}")
        depth = self.patch.depth(self.positions)
        least = int(np.argmin(depth))
        if depth[least] * (1 + _ROUNDING) < L / 2:
            longest = 2 * depth[least]
            if float(f"{longest:.4g}") > longest * (1 + _ROUNDING):
                longest *= 1 - 5e-4  # which is rounded down to no more than it was
            raise Refusal(
                f"gages of {L:g} m reach over the rim of the {self.patch.name}: element {least} is "
                f"{depth[least]:.4g} m inside; expected a gage length of at most "
                f"{longest:.4g} m"
            )

    @classmethod
    def regular(cls, patch: Patch, m: int, n: int) -> "SensorLayout":
        """Elements at the centres of an m x n tiling; those off a disk or a polygon are left out.

        A layout that lacks some has no shape.
        """
        x, y = patch.cell_centres(m, n)
        positions = np.column_stack([np.tile(x, n), np.repeat(y, m)])
        on = patch.contains(positions)
        shape = (m, n) if on.all() else None
        return cls(patch, positions[on], _channels(patch, int(on.sum())), shape)

    @classmethod
    def scattered(cls, patch: Patch, positions: ArrayLike) -> "SensorLayout":
        """Elements at `positions` (P, 2) in m, anywhere on the patch."""
        try:
            points = np.array(positions, float)
        except ValueError as error:
            raise Refusal(f"expected positions of shape (P, 2) in m, got {error}") from error
        if points.ndim != 2:
            raise Refusal(f"expected positions of shape (P, 2) in m, got {points.shape}")
        return cls(patch, points, _channels(patch, len(points)))

    def without(self, elements: Iterable[int]) -> "SensorLayout":
        """The same layout with all three channels of `elements` dead."""
        live = self.live.copy()
        dead = list(elements)
        if any(not 0 <= p < len(self) for p in dead):
            raise Refusal(f"expected dead elements between 0 and {len(self) - 1}, got {dead}")
        live[:, dead] = False
        return replace(self, live=live)

    @property
    def lacking(self) -> Mask:
        """The channels (3, P) that are dead, of those that there are on this patch."""
        return _channels(self.patch, len(self)) & ~self.live

    def __len__(self) -> int:
        return len(self.positions)

    def __str__(self) -> str:
        return "{} x {} elements".format(*self.shape) if self.shape else f"{len(self)} elements"

    def curvature_operator(self, basis: Basis) -> Array:
        """M (3 P, N): `M @ coefficients.ravel()` is curvature (3, P) flattened (Eqs. 2-5, 11)."""
        if basis.patch != self.patch:
            raise Refusal(f"the layout is on {self.patch}, the basis on {basis.patch}; use one")
        K = mean_curvature_at(basis, self.positions, self.gage_length)
        return K.reshape(3 * len(self), basis.size)
