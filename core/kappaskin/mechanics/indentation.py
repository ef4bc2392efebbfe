"""What a rigid object does to a skin."""

from dataclasses import dataclass

import numpy as np

from kappaskin.frames import Array, Mask


@dataclass(frozen=True, slots=True, eq=False)
class Indentation:
    """The forces under an object at n places, and what follows from them.

    `points` (n, 2) in m are the nodes of the skin under the object, then its keel. There are the
    `forces` (n,) in N along the skin's normal, the `gap` (n,) in m along it, and the `compression`
    (n,) in m of the skin's own thickness, by which its midsurface stays behind the object. `nodal`
    (ny, nx) in N has every force at the node next to it, whose share of the skin is `node_area` in
    m^2. `modal` (Ni, Nj) in N makes `coefficients` (Ni, Nj) in m.

    The object is at `position` (2,) in m, its `turn` in rad; it bears `force` in N in all and
    stands `depth` in m below the skin at rest; above it, when below zero. `residual` is the
    largest |min(F, g / (G + t))| as share of the largest F: G + t in m/N is how far a place gives
    under force on it alone, so that g / (G + t) is the force that would open the gap g there.
    `steps` counts the linear systems solved.
    """

    points: Array
    forces: Array
    gap: Array
    compression: Array
    nodal: Array
    node_area: float
    modal: Array
    coefficients: Array
    position: Array
    turn: float
    force: float
    depth: float
    residual: float
    steps: int

    @property
    def pressure(self) -> Array:
        """Force per area of each node, (ny, nx) in Pa."""
        return self.nodal / self.node_area

    @property
    def patch(self) -> Mask:
        """Which nodes (ny, nx) bear force."""
        return self.nodal > 0

    @property
    def area(self) -> float:
        """What the nodes that bear force cover of the skin, in m^2."""
        return float(np.count_nonzero(self.nodal)) * self.node_area

    @property
    def centre(self) -> Array:
        """The centre of force (2,) in m; NaN without contact."""
        whole = self.forces.sum()
        return self.forces @ self.points / whole if whole else np.full(2, np.nan)
