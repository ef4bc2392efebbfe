"""A rigid object pressed into a skin: from where it is, and how deep or hard, to the skin's shape.

The skin is the plate of `kappaskin.mechanics.plate`, whose midsurface gives at the nodes of a grid
and below the object's keel by w = Phi C Phi' F. A Kirchhoff plate meets a rigid object with forces
along lines and at points, of no width; what gives them one is the skin's own thickness h, which
they compress by about h/E per pressure: a thin layer (Winkler's), exact to its part of the answer.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kappaskin.bases import Basis
from kappaskin.bases.product import ProductBasis
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask
from kappaskin.mechanics.plate import Plate
from kappaskin.mechanics.rigid.objects import RigidObject
from kappaskin.mechanics.rigid.settle import Bearing, Indices, Support, Underside, settle
from kappaskin.patch import Patch

_MOST = 2**25  # values of functions at nodes, a quarter of a gigabyte
_STIFFEST = 1e-9  # of the skin's own give: a thinner layer is lost in rounding


@dataclass(frozen=True, slots=True, eq=False)
class Indentation:
    """What an object does to the skin: n places under it, and what follows from their forces.

    `points` (n, 2) in m are the nodes of the skin under the object, then its keel. There are the
    `forces` (n,) in N along the skin's normal, the `gap` (n,) in m along it, and the `compression`
    (n,) in m of the skin's own thickness, by which its midsurface stays behind the object. `nodal`
    (ny, nx) in N has every force at the node next to it, whose share of the skin is `node_area` in
    m^2. `modal` (Ni, Nj) in N makes `coefficients` (Ni, Nj) in m. The object bears `force` in N in
    all and stands `depth` in m below the skin at rest; above it, when below zero. `residual` is
    the largest |min(F, g / (G + t))| as share of the largest force, with G + t in m/N how far a
    place gives under force on it alone; `steps` counts the linear systems solved.
    """

    points: Array
    forces: Array
    gap: Array
    compression: Array
    nodal: Array
    node_area: float
    modal: Array
    coefficients: Array
    force: float
    depth: float
    residual: float
    steps: int
    position: Array
    turn: float

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


@dataclass(frozen=True, eq=False)
class _Frame:
    """The skin at rest as an object at (x, y) sees it, its normal there being up."""

    along: Array
    up: Array
    origin: Array
    y: float

    @classmethod
    def at(cls, patch: Patch, x: float, y: float) -> "_Frame":
        (origin,), (up,) = patch.at_rest(np.array([[x, y]]))
        return cls(np.array([up[2], 0.0, -up[0]]), up, origin, y)

    def seen(self, patch: Patch, points: Array) -> tuple[Array, Array, Array]:
        """Where `points` (P, 2) are beside it (P, 2), how far below (P,), and their slant (P,)."""
        space, normals = patch.at_rest(points)
        away = space - self.origin
        return (
            np.column_stack([away @ self.along, away[:, 1]]),
            -(away @ self.up),
            normals @ self.up,
        )


def _turned(points: Array, angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    return points @ np.array([[c, s], [-s, c]])


class Press:
    """Presses rigid objects into one skin, made once for it and called per frame.

    `nodes` (nx, ny) divide the skin; forces act at the centres of the cells that lie on it, and
    at the points of the object's keel. `layer` in m^3/N is the thickness of the skin over its
    Young's modulus; left out, it is that of an even sheet with the plate's rigidity and axial
    stiffness, 0.25 mm thick unless these say otherwise. The skin bends as a plate does, to first
    order; what of an object overhangs the skin's rim meets nothing there. There is no friction.
    """

    def __init__(
        self,
        plate: Plate,
        basis: Basis,
        nodes: tuple[int, int] = (64, 64),
        layer: float | None = None,
    ) -> None:
        self._plate, self._basis, self._grid = plate, basis, _checked_nodes(nodes, basis)
        self._compliance = plate.compliance(basis)
        nx, ny = nodes
        x, y = plate.patch.cell_centres(nx, ny)
        cells = np.column_stack([np.tile(x, ny), np.repeat(y, nx)])
        self._cells = np.flatnonzero(plate.patch.moves(cells))
        self._points = cells[self._cells]
        self._felt = basis.at(self._points)
        own = np.einsum("pn,pn->p", self._felt, self._compliance.after(self._felt))
        self._node_area = plate.patch.a * plate.patch.b / (nx * ny)
        layer = _layer_of(plate) if layer is None else layer
        if not 0 < layer < math.inf:
            raise Refusal(f"expected a layer above zero in m^3/N, got {layer}")
        self._soft = max(layer / self._node_area, _STIFFEST * float(own.max()))
        self._own = own + self._soft
        self._nodes_give = self._nodes_map(x, y)

    def _nodes_map(self, x: Array, y: Array) -> Callable[[Array], Array]:
        """The deflection (K,) of all nodes for coefficients (N,)."""
        if not isinstance(self._basis, ProductBasis):
            return lambda c: self._felt @ c  # a mode's own map is in single precision
        values, shape = self._basis.on_grid(x, y), self._basis.shape
        return lambda c: values(c.reshape(shape)).ravel()[self._cells]

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
        """The skin under an object at (x, y) in m that is turned by `turn` in rad from x to y.

        Either its `depth` in m is given, or the `force` in N that it bears. To start from the
        answer `after` which it moves saves time and changes nothing else.
        """
        self._check(x, y, turn, depth, force)
        keel = self._keel_on_skin(object_, x, y, turn)
        points = np.vstack([self._points, keel])
        beside, below, slant = _Frame.at(self._plate.patch, x, y).seen(self._plate.patch, points)
        height = object_.height(_turned(beside, -turn)) + below
        under = np.flatnonzero(np.isfinite(height) & (slant > 0))
        if not len(under):
            raise Refusal(
                f"expected an object over the {self._plate.patch.name}, got {object_} at "
                f"({x:g}, {y:g}) m, which misses its nodes; positions are in metres from the "
                "corner x = y = 0"
            )
        support = self._support(keel, under)
        side = Underside(height[under], slant[under])
        start = self._start(side, points[under], (x, y), turn, force, after)
        if force == 0:
            depth = float(side.height.min())
        found = settle(support, side, start, depth, force or 0.0)
        return self._indentation(support, side, points[under], found, x, y, turn)

    def _check(
        self, x: float, y: float, turn: float, depth: float | None, force: float | None
    ) -> None:
        if not all(map(math.isfinite, (x, y, turn))):
            raise Refusal(f"expected a place in m and a turn in rad, got ({x}, {y}) and {turn}")
        if (depth is None) == (force is None):
            raise Refusal(f"expected either a depth or a force, got {depth} and {force}")
        if force is not None and not 0 <= force < math.inf:
            raise Refusal(f"expected a force of at least zero in N, got {force}")
        if depth is not None and not abs(depth) <= self._deepest:
            raise Refusal(
                f"expected a depth of at most {self._deepest:g} m, the skin's shorter side, got "
                f"{depth}; depths are in metres"
            )

    @cached_property
    def _deepest(self) -> float:
        return min(self._plate.patch.a, self._plate.patch.b)

    def _keel_on_skin(self, object_: RigidObject, x: float, y: float, turn: float) -> Array:
        keel = _turned(object_.keel(), turn) + np.array([x, y])
        return keel[self._plate.patch.moves(keel)]

    def _support(self, keel: Array, under: Indices) -> Support:
        K = len(self._points)
        felt = self._basis.at(keel)
        own = np.einsum("pn,pn->p", felt, self._compliance.after(felt)) + self._soft

        def felt_at(at: Indices) -> Array:
            place = under[at]
            on_keel = place >= K
            return np.vstack([self._felt[place[~on_keel]], felt[place[on_keel] - K]])

        def deflection(c: Array) -> Array:
            return np.concatenate([self._nodes_give(c), felt @ c])[under]

        soft = np.full(len(under), self._soft)
        return Support(
            felt_at, self._compliance.after, deflection, soft, np.append(self._own, own)[under]
        )

    def _indentation(
        self,
        support: Support,
        under: Underside,
        points: Array,
        found: Bearing,
        x: float,
        y: float,
        turn: float,
    ) -> Indentation:
        if abs(found.depth) > self._deepest:
            raise Refusal(
                f"so hard a push would press the object {found.depth:.3g} m deep, further than the "
                f"skin's shorter side of {self._deepest:g} m; press with less force"
            )
        F, most = found.forces, found.forces.max()
        short = np.abs(np.minimum(F, found.gap / support.own)).max()
        shape = self._basis.shape
        return Indentation(
            points,
            F,
            found.gap,
            support.soft * F,
            self._at_nodes(points, F),
            self._node_area,
            found.modal.reshape(shape),
            found.coefficients.reshape(shape),
            float(under.slant @ F),
            found.depth,
            float(short / most) if most else 0.0,
            found.steps,
            np.array([x, y]),
            turn,
        )

    def _cell(self, points: Array) -> Indices:
        """The cell, row by row, that each of `points` (P, 2) lies in or next to."""
        nx, ny = self._grid
        sides = (self._plate.patch.a / nx, self._plate.patch.b / ny)
        column, row = np.clip((points / sides).astype(int), 0, (nx - 1, ny - 1)).T
        return row * nx + column

    def _at_nodes(self, points: Array, forces: Array) -> Array:
        nx, ny = self._grid
        on = forces > 0
        summed: Array = np.bincount(self._cell(points[on]), forces[on], nx * ny).astype(float)
        return summed.reshape(ny, nx)

    def _start(
        self,
        under: Underside,
        points: Array,
        place: tuple[float, float],
        turn: float,
        force: float | None,
        after: Indentation | None,
    ) -> Array:
        """Forces (n,) to start from: those of `after`, moved along with the object."""
        forces = np.zeros(len(points))
        if after is not None:
            on = after.forces > 0
            moved = _turned(after.points[on] - after.position, turn - after.turn) + place
            candidate = np.full(self._grid[0] * self._grid[1], -1)
            candidate[self._cell(points)] = np.arange(len(points))  # the keel's, where it has one
            at = candidate[self._cell(moved)]
            np.add.at(forces, at[at >= 0], after.forces[on][at >= 0])
        if force is None:
            return forces
        if not forces.any():
            forces[np.argmin(under.height)] = 1.0
        return forces * (force / (under.slant @ forces))


def _checked_nodes(nodes: tuple[int, int], basis: Basis) -> tuple[int, int]:
    nx, ny = nodes
    if not (nx > 0 and ny > 0 and nx * ny * basis.size <= _MOST):
        raise Refusal(
            f"expected 1 x 1 to {_MOST // basis.size} nodes for {basis.size} functions, got "
            f"{nx} x {ny}"
        )
    return nodes


def _layer_of(plate: Plate) -> float:
    """h/E in m^3/N of an even sheet: with D = E h^3 / (12 (1 - nu^2)) and C = E h it is h^2/C."""
    D, C = plate.rigidity, plate.stretching
    if not (D and C):
        raise Refusal(
            "a skin without rigidity or without axial stiffness does not tell how thick it is; "
            "give the layer, its thickness over its Young's modulus, in m^3/N"
        )
    return 12 * (1 - plate.poisson**2) * D / C**2
