"""Modes of a plate with corners."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from kappaskin.bases.basis import Order
from kappaskin.bases.modes import ModeBasis
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.skin import Polygon

if TYPE_CHECKING:
    from kappaskin.bases.argyris import PlateModes

_STRAIGHT, _BLUNT = 1e-6, math.radians(35)  # turns at a corner: none, and too little to be one


@dataclass(frozen=True)
class PolygonBasis(ModeBasis):
    """The plate modes of a polygon, hinged or `clamped` along its edges, by finite elements.

    They meet the edge exactly and have continuous slopes. A hinged polygon with ever more corners
    does not become a hinged round plate: where two edges meet the slope vanishes, so that it turns
    as stiff as a clamped one (Babuska's paradox); blunt corners are refused.
    """

    clamped: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        angle = np.abs(self._polygon.outline.turns)
        blunt = (angle > _STRAIGHT) & (angle < _BLUNT)
        if blunt.any() and not self.clamped:
            raise Refusal(
                f"the outline turns by only {math.degrees(angle[blunt][0]):.3g} degrees at vertex "
                f"{int(np.argmax(blunt))}: hinged there it would be as stiff as clamped; take a "
                "disk, fewer corners, or clamp its edges"
            )

    @property
    def _polygon(self) -> Polygon:
        if not isinstance(self.patch, Polygon):
            raise Refusal(f"expected a polygon, got a {self.patch.name}")
        return self.patch

    @cached_property
    def _modes(self) -> "PlateModes":
        # scipy.sparse and scipy.spatial are slow to import, and seldom needed.
        from kappaskin.bases.argyris import plate_modes

        return plate_modes(self._polygon.vertices, self.size, self.clamped)

    def _derivative(self, positions: Array, order: Order) -> Array:
        return self._modes.functions.derivative(positions, order)

    def _place(self, x: float, y: float) -> Array:
        return self._modes.functions.jet(x, y)

    def quadrature(self) -> tuple[Array, Array]:
        """Points (Q, 2) in m and weights (Q,) in m^2: exact for two quintics on each triangle."""
        return self._modes.points, self._modes.weights
