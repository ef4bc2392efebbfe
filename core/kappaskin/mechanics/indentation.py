"""Indentation: a rigid object pressed into a skin, to a given depth or by a given force.

The skin is the plate of `kappaskin.mechanics.plate`, whose midsurface yields at the nodes of a grid
and below the object's keel by w = Phi C Phi' F. A Kirchhoff plate meets a rigid object with forces
along lines and at points, of zero width; their width comes from the skin's own thickness h, which
they compress by about h/E per pressure, modelled as a thin Winkler layer.
"""

import math
from dataclasses import dataclass

import numpy as np

from kappaskin.bases import Basis
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask
from kappaskin.mechanics.contact_solver import (
    ContactForces,
    ContactNodes,
    NodeCompliance,
    Underside,
    layer_compliance,
    solve_contact,
)
from kappaskin.mechanics.plate import Plate
from kappaskin.mechanics.rigid_objects import RigidObject
from kappaskin.skin import Patch


@dataclass(frozen=True, slots=True, eq=False)
class Indentation:
    """The contact forces under an object at n points, and the shape of the skin.

    `points` (n, 2) in m are the nodes of the skin under the object, then its keel. At each of them
    act the `forces` (n,) in N along the skin's normal; `gap` (n,) in m is the distance along it,
    and `compression` (n,) in m that of the skin's thickness, by which its midsurface stays behind
    the object. `nodal` (ny, nx) in N are the forces summed at the nodes, each of which stands for
    `node_area` in m^2. `modal` (Ni, Nj) in N are the modal forces, `coefficients` (Ni, Nj) in m the
    deflection.

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
        """Which nodes (ny, nx) are in contact."""
        return self.nodal > 0

    @property
    def area(self) -> float:
        """Area of the contact patch in m^2."""
        return float(np.count_nonzero(self.nodal)) * self.node_area

    @property
    def centre(self) -> Array:
        """The centre of force (2,) in m; NaN without contact."""
        whole = self.forces.sum()
        return self.forces @ self.points / whole if whole else np.full(2, np.nan)


_NODES = (64, 64)  # unless others are asked for


def _turned(points: Array, angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    return points @ np.array([[c, s], [-s, c]])


@dataclass(frozen=True, eq=False)
class PlacedObject:
    """A rigid object at `place` (2,) in m on the skin, turned by `turn` in rad about the normal."""

    object_: RigidObject
    place: Array
    turn: float

    def keel(self, patch: Patch) -> Array:
        """Points (k, 2) in m of its keel, as far as they lie on the skin."""
        x, y = self.place.tolist()
        points = patch.around(x, y, _turned(self.object_.keel(), self.turn))
        return points[patch.moves(points)]

    def over(self, patch: Patch, points: Array) -> tuple[Array, Array]:
        """Height (P,) in m above the skin at rest when it just touches its place, and slant (P,).

        The slant is the cosine between the normals at `points` (P, 2) in m and at its place.
        """
        base = patch.base(*self.place.tolist())
        space, normals = patch.at_rest(points)
        away, up = space - base.point, np.array(base.normal)
        across = away @ np.array([base.along, base.across]).T
        return self.object_.height(_turned(across, -self.turn)) - away @ up, normals @ up

    def meets(self, patch: Patch) -> bool:
        """Whether any of the default nodes of the skin, or a point of its keel, lies under it."""
        cells = np.stack(np.meshgrid(*patch.cell_centres(*_NODES)), axis=-1).reshape(-1, 2)
        height, slant = self.over(patch, np.vstack([cells[patch.moves(cells)], self.keel(patch)]))
        return bool((np.isfinite(height) & (slant > 0)).any())

    def carried(self, points: Array, by: Indentation) -> Array:
        """Where `points` (P, 2) in m under the object at the indentation `by` are now."""
        return _turned(points - by.position, self.turn - by.turn) + self.place


class IndentationSolver:
    """`press = IndentationSolver(plate, basis)`, built once; `press(object_, x, y, depth=...)`.

    `nodes` (nx, ny) divide the skin; forces act at the centres of the cells that lie on it and at
    the points of the object's keel. `layer` in m^3/N is the thickness of the skin over its Young's
    modulus; None means that of a uniform sheet with the plate's rigidity and thickness, 0.25 mm
    unless told. The skin bends as a plate does, to first order; the
    part of an object that overhangs the rim meets nothing. There is no friction.
    """

    def __init__(
        self,
        plate: Plate,
        basis: Basis,
        nodes: tuple[int, int] = _NODES,
        layer: float | None = None,
    ) -> None:
        self._patch, self._shape = plate.patch, basis.shape
        self._nodes = ContactNodes(
            plate, basis, *nodes, layer_compliance(plate) if layer is None else layer
        )
        self._deepest = min(plate.patch.a, plate.patch.b)

    def __call__(
        self,
        object_: RigidObject,
        x: float,
        y: float,
        turn: float = 0.0,
        *,
        depth: float | None = None,
        force: float | None = None,
        after: Indentation | None = None,
    ) -> Indentation:
        """The indentation by an object at (x, y) in m that is turned by `turn` in rad from x to y.

        Either its `depth` in m is given or the `force` in N on it. Starting from the previous
        indentation, `after`, saves time and changes nothing else. Raises a `Refusal` for an object
        beside the skin.
        """
        self._check(x, y, turn, depth, force)
        placed = PlacedObject(object_, np.array([x, y], float), turn)
        keel = placed.keel(self._patch)
        height, slant = placed.over(self._patch, np.vstack([self._nodes.points, keel]))
        under = np.flatnonzero(np.isfinite(height) & (slant > 0))
        if not len(under):
            raise Refusal(
                f"expected an object over the {self._patch.name}, got {object_} at ({x:g}, {y:g}) "
                "m, which misses its nodes; positions are in metres from the corner x = y = 0"
            )
        support = self._nodes.support(keel, under)
        side = Underside(height[under], slant[under])
        start = np.zeros(len(under)) if after is None else self._moved(support, placed, after)
        if force is not None:
            start = _bearing_all(start, side, force)
        if force == 0:  # it touches
            depth = float(side.height.min())
        found = solve_contact(support, side, start, depth, force or 0.0)
        return self._answer(support, side, placed, found)

    def _check(
        self, x: float, y: float, turn: float, depth: float | None, force: float | None
    ) -> None:
        if not all(map(math.isfinite, (x, y, turn))):
            raise Refusal(f"expected a position in m and angle in rad, got ({x}, {y}) and {turn}")
        if (depth is None) == (force is None):
            raise Refusal(f"expected either a depth or a force, got {depth} and {force}")
        if force is not None and not 0 <= force < math.inf:
            raise Refusal(f"expected a force of at least zero in N, got {force}")
        if depth is not None and not abs(depth) <= self._deepest:
            raise Refusal(
                f"expected a depth of at most {self._deepest:g} m, the skin's shorter side, got "
                f"{depth}; depths are in metres"
            )

    def _moved(self, support: NodeCompliance, placed: PlacedObject, after: Indentation) -> Array:
        """Forces (n,) in N to start from: those of `after`, moved with the object."""
        ny, nx = self._nodes.shape
        candidate = np.full(nx * ny, -1)
        # Where a cell has a node and a point of the keel, the latter.
        candidate[self._nodes.cell(support.points)] = np.arange(len(support.points))
        on = after.forces > 0
        at = candidate[self._nodes.cell(placed.carried(after.points[on], after))]
        forces = np.zeros(len(support.points))
        np.add.at(forces, at[at >= 0], after.forces[on][at >= 0])
        return forces

    def _answer(
        self, support: NodeCompliance, under: Underside, placed: PlacedObject, found: ContactForces
    ) -> Indentation:
        if abs(found.depth) > self._deepest:
            raise Refusal(
                f"this force would press the object {found.depth:.3g} m deep, further than the "
                f"skin's shorter side of {self._deepest:g} m; press with less force"
            )
        F, most = found.forces, float(found.forces.max())
        short = float(np.abs(np.minimum(F, found.gap / support.own)).max())
        return Indentation(
            points=support.points,
            forces=F,
            gap=found.gap,
            compression=support.soft * F,
            nodal=self._nodes.summed(support.points[F > 0], F[F > 0]),
            node_area=self._nodes.area,
            modal=found.modal.reshape(self._shape),
            coefficients=found.coefficients.reshape(self._shape),
            position=placed.place,
            turn=placed.turn,
            force=float(under.slant @ F),
            depth=found.depth,
            residual=short / most if most else 0.0,
            steps=found.steps,
        )


def _bearing_all(forces: Array, under: Underside, force: float) -> Array:
    """The `forces` (n,) scaled to sum to `force` in N; without any, one at the lowest point."""
    if not forces.any():
        forces[np.argmin(under.height)] = 1.0
    return forces * (force / (under.slant @ forces))
