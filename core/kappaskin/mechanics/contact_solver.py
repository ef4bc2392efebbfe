"""Contact solver: the forces between a skin and a rigid object, by an active-set method.

At n places the forces F in N, the deflection w = G F in m and the object's underside, at e (d - h)
below the skin at rest when its depth is d, leave a gap g and meet

    F >= 0,    g = G F + t F - e (d - h) >= 0,    F g = 0,

with e = 1 on a flat skin and t in m/N what a thin layer of the skin gives by itself. G alone is
singular, more places than functions; with t the problem is the least of a strictly convex energy
F'(G + t)F/2 - F'e(d - h) on F >= 0 and has one answer. With the whole force given, e'F = P, d is
the multiplier of that constraint.

It is solved as Lawson and Hanson solve non-negative least squares (Solving Least Squares Problems,
doi:10.1137/1.9781611971217, chapter 23), on the normal equations as Bro and de Jong do
(doi:10.1002/(SICI)1099-128X(199709/10)11:5<393::AID-CEM483>3.0.CO;2-L), from any forces that may
stand: the energy falls from one set of bearing places to the next, so no set returns and the
sets come to an end. To be sooner there, the deepest place of each region of the skin joins at
once, and all that pull leave at once where that lowers the energy (Bertsekas' projection,
doi:10.1137/0320018); where it does not, one joins and one leaves, as proven.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy.linalg import lapack

from kappaskin.bases import Basis, ProductBasis
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Indices, Mask
from kappaskin.mechanics.plate import USUAL_THICKNESS, Plate

_MOST_PLACES, _MOST_STEPS = 1024, 500  # some seconds
_ROUNDING = 1e-14  # of what sums to it: a gap is known to that


@dataclass(frozen=True, eq=False)
class NodeCompliance:
    """How a skin gives under forces at n `points` (n, 2) in m.

    `felt` gives the functions (k, N) at k of them, `after` the coefficients (k, N) per N of force
    there, `deflection` the deflection (n,) in m for coefficients (N,). `soft` (n,) in m/N is the
    compression of the layer per force, `own` (n,) in m/N how far a point gives under a force on it
    alone, `region` (n,) the number of the part of the skin that it lies in.
    """

    points: Array
    felt: Callable[[Indices], Array]
    after: Callable[[Array], Array]
    deflection: Callable[[Array], Array]
    soft: Array
    own: Array
    region: Indices


@dataclass(frozen=True, eq=False)
class Underside:
    """The object above n points: `height` h (n,) in m over its lowest point, `slant` e (n,)."""

    height: Array
    slant: Array


@dataclass(frozen=True, eq=False)
class ContactForces:
    """The solution: `forces` (n,) in N, `gap` (n,) in m, `coefficients` (N,) in m, `depth` in m.

    `modal` (N,) in N are the modal forces, `steps` the linear systems solved.
    """

    forces: Array
    gap: Array
    coefficients: Array
    modal: Array
    depth: float
    steps: int


@dataclass(frozen=True, eq=False)
class _ActiveSet:
    """The points in contact: their functions, and how each gives under force on the others."""

    at: Indices
    felt: Array
    answer: Array
    gives: Array

    def joined(self, support: NodeCompliance, more: Indices) -> "_ActiveSet":
        """These and the places `more` (m,)."""
        other = _places(support, more)
        between = self.answer @ other.felt.T
        return _ActiveSet(
            np.concatenate([self.at, more]),
            np.concatenate([self.felt, other.felt]),
            np.concatenate([self.answer, other.answer]),
            np.block([[self.gives, between], [between.T, other.gives]]),
        )

    def only(self, active: Mask) -> "_ActiveSet":
        """Those of them that are `active` (a,)."""
        return _ActiveSet(
            self.at[active], self.felt[active], self.answer[active], self.gives[active][:, active]
        )


def _places(support: NodeCompliance, at: Indices) -> _ActiveSet:
    felt = support.felt(at)
    answer = support.after(felt)
    return _ActiveSet(at, felt, answer, answer @ felt.T + np.diag(support.soft[at]))


@dataclass(frozen=True, eq=False)
class _ContactProblem:
    """A skin, an object, and its `depth` in m or, where that is None, its `force` in N."""

    support: NodeCompliance
    under: Underside
    depth: float | None
    force: float

    def balanced(self, places: _ActiveSet) -> tuple[Array, float]:
        """The forces (a,) that leave no gap at any point, pushing or pulling, and the depth."""
        e = self.under.slant[places.at]
        if not len(e):
            return e, cast("float", self.depth)
        both = np.column_stack([e, e * self.under.height[places.at]])
        # LAPACK itself: scipy's wrappers take longer than it does for so few places.
        _, solved, failed = lapack.dposv(places.gives, both, lower=True)
        if failed:
            raise Refusal(
                "the compliance of the skin is too ill-conditioned to invert; use fewer nodes, or "
                "a thicker layer"
            )
        per_depth, for_height = solved.T
        d = self.depth
        if d is None:
            d = float((self.force + e @ for_height) / (e @ per_depth))
        return d * per_depth - for_height, d

    def energy(self, places: _ActiveSet, forces: Array) -> float:
        """The energy in J that the forces of the solution minimise."""
        above = self.under.height[places.at] - (self.depth or 0.0)
        return float(forces @ (places.gives @ forces / 2 + self.under.slant[places.at] * above))

    def pushing(self, places: _ActiveSet, forces: Array, target: Array) -> tuple[_ActiveSet, Array]:
        """Fewer points, and forces (a,) that only push, between `forces` and the `target`."""
        active = target > 0
        fewer, active_forces = places.only(active), target[active]
        if self.depth is None and len(active_forces):
            active_forces *= self.force / (self.under.slant[fewer.at] @ active_forces)
        if len(active_forces) and self.energy(fewer, active_forces) < self.energy(places, forces):
            return fewer, active_forces
        share = np.full(len(forces), np.inf)
        share[~active] = forces[~active] / (forces[~active] - target[~active])
        active = share > (step := share.min())
        return places.only(active), (forces + step * (target - forces))[active]

    def bearing(self, places: _ActiveSet, forces: Array, depth: float, step: int) -> ContactForces:
        """The solution if these are all the points in contact."""
        F, soft = np.zeros(len(self.under.slant)), self.support.soft
        F[places.at] = forces
        c = forces @ places.answer
        gap = self.support.deflection(c) + soft * F - self.under.slant * (depth - self.under.height)
        return ContactForces(F, gap, c, forces @ places.felt, depth, step)

    def entered(self, found: ContactForces, one: bool) -> Indices:
        """The points without force deepest inside the object, per region or only `one`."""
        # A place's own give and another's bound what a force on the one does to the other.
        root = np.sqrt(self.support.own)
        known = _ROUNDING * (abs(found.depth) + root * (root @ found.forces))
        gap = np.where(found.forces > 0, np.inf, found.gap + known)
        inside = np.flatnonzero(gap < 0)
        inside = inside[np.argsort(gap[inside])]
        if one:
            return inside[:1]
        return inside[np.unique(self.support.region[inside], return_index=True)[1]]


def solve_contact(
    support: NodeCompliance, under: Underside, start: Array, depth: float | None, force: float
) -> ContactForces:
    """Contact forces of an object at `depth` in m, or, where that is None, under `force` in N.

    `start` (n,) in N are forces to start from, none below zero; with a given `force` they sum to it
    along the object. Raises a `Refusal` where the method does not end in a few seconds.
    """
    task, places = (
        _ContactProblem(support, under, depth, force),
        _places(support, np.flatnonzero(start)),
    )
    forces, energy = start[places.at], -np.inf  # so that only one joins at first
    for step in range(1, _MOST_STEPS):
        target, d = task.balanced(places)
        if not (target > 0).all():
            places, forces = task.pushing(places, forces, target)
            continue
        found = task.bearing(places, target, d, step)
        before, energy = energy, task.energy(places, target)
        if not len(more := task.entered(found, one=energy >= before)):
            return found
        if len(places.at) + len(more) > _MOST_PLACES:
            break
        places, forces = places.joined(support, more), np.append(target, np.zeros(len(more)))
    raise Refusal(
        f"the object touches more than {_MOST_PLACES} nodes or needs more than {_MOST_STEPS} "
        "steps to converge; use a smaller depth, a smaller object or fewer nodes"
    )


_MOST = 2**25  # values of functions at nodes, a quarter of a gigabyte
_REGIONS = 8  # of the grid, along each side
_STIFFEST = 1e-9  # of the skin's own give: a thinner layer is lost in rounding


def layer_compliance(plate: Plate) -> float:
    """h/E in m^3/N of a uniform sheet of the plate's thickness, 0.25 mm if unknown."""
    if not plate.rigidity:
        raise Refusal(
            "a skin without rigidity does not determine its Young's modulus; give the layer, its "
            "thickness over that, in m^3/N"
        )
    h = plate.sheet_thickness or USUAL_THICKNESS
    return h / plate.modulus(h)


class ContactNodes:
    """Contact nodes: the centres of nx x ny equal cells, as far as they lie on the skin."""

    def __init__(self, plate: Plate, basis: Basis, nx: int, ny: int, layer: float) -> None:
        if not (nx > 0 and ny > 0 and nx * ny * basis.size <= _MOST):
            raise Refusal(
                f"expected 1 x 1 to {_MOST // basis.size} nodes for {basis.size} functions, got "
                f"{nx} x {ny}"
            )
        if not 0 < layer < np.inf:
            raise Refusal(f"expected a layer above zero in m^3/N, got {layer}")
        self._basis, self._compliance = basis, plate.compliance(basis)
        self._sides = plate.patch.a / nx, plate.patch.b / ny
        self.shape, self.area = (ny, nx), self._sides[0] * self._sides[1]
        x, y = plate.patch.cell_centres(nx, ny)
        cells = np.column_stack([np.tile(x, ny), np.repeat(y, nx)])
        self._cells = np.flatnonzero(plate.patch.moves(cells))
        self.points: Array = cells[self._cells]
        self._felt = basis.at(self.points)
        own = self._own_of(self._felt)
        self.soft = max(layer / self.area, _STIFFEST * float(own.max(initial=0.0)))
        self._own = own + self.soft
        self._give = self._map(x, y)

    def _own_of(self, felt: Array) -> Array:
        return np.einsum("pn,pn->p", felt, self._compliance.after(felt))

    def _map(self, x: Array, y: Array) -> Callable[[Array], Array]:
        """A map from coefficients (N,) to the deflection (K,) in m of all nodes."""
        if not isinstance(self._basis, ProductBasis):
            return lambda c: self._felt @ c  # a mode's own map is in single precision
        values, shape = self._basis.on_grid(x, y), self._basis.shape
        return lambda c: values(c.reshape(shape)).ravel()[self._cells]

    def cell(self, points: Array) -> Indices:
        """Number (P,), row by row, of the cell that each of `points` (P, 2) lies in or next to."""
        (ny, nx) = self.shape
        column, row = np.clip((points / self._sides).astype(int), 0, (nx - 1, ny - 1)).T
        return row * nx + column

    def summed(self, points: Array, forces: Array) -> Array:
        """The sum (ny, nx) in N of the `forces` (P,) at `points` (P, 2) in each cell."""
        ny, nx = self.shape
        found: Array = np.bincount(self.cell(points), forces, nx * ny).astype(float)
        return found.reshape(self.shape)

    def support(self, keel: Array, under: Indices) -> NodeCompliance:
        """The compliance at the points `under` of the nodes followed by the `keel` (k, 2) in m."""
        K = len(self.points)
        felt = self._basis.at(keel)
        points = np.vstack([self.points, keel])[under]
        row, column = np.divmod(self.cell(points), self.shape[1])
        rows, columns = (max(count // _REGIONS, 1) for count in self.shape)

        def felt_at(at: Indices) -> Array:
            found = np.empty((len(at), self._basis.size))
            on_keel = under[at] >= K
            found[~on_keel] = self._felt[under[at[~on_keel]]]
            found[on_keel] = felt[under[at[on_keel]] - K]
            return found

        return NodeCompliance(
            points,
            felt_at,
            self._compliance.after,
            lambda c: np.concatenate([self._give(c), felt @ c])[under],
            np.full(len(under), self.soft),
            np.append(self._own, self._own_of(felt) + self.soft)[under],
            row // rows * self.shape[1] + column // columns,
        )
