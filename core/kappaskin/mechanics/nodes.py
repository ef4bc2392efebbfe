"""The nodes of a skin: where forces may act on it, and how it gives there."""

from collections.abc import Callable

import numpy as np

from kappaskin.bases import Basis, ProductBasis
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics.plate import Plate
from kappaskin.mechanics.settle import Indices, Support

_MOST = 2**25  # values of functions at nodes, a quarter of a gigabyte
_REGIONS = 8  # of the grid, along each side
_STIFFEST = 1e-9  # of the skin's own give: a thinner layer is lost in rounding


def layer_of(plate: Plate) -> float:
    """h/E in m^3/N of an even sheet: with D = E h^3 / (12 (1 - nu^2)) and C = E h it is h^2/C."""
    D, C = plate.rigidity, plate.stretching
    if not (D and C):
        raise Refusal(
            "a skin without rigidity or without axial stiffness does not tell how thick it is; "
            "give the layer, its thickness over its Young's modulus, in m^3/N"
        )
    return 12 * (1 - plate.poisson**2) * D / C**2


class Nodes:
    """The centres of nx x ny equal cells of a skin, those that lie on it."""

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
        """The deflection (K,) of all nodes for coefficients (N,)."""
        if not isinstance(self._basis, ProductBasis):
            return lambda c: self._felt @ c  # a mode's own map is in single precision
        values, shape = self._basis.on_grid(x, y), self._basis.shape
        return lambda c: values(c.reshape(shape)).ravel()[self._cells]

    def cell(self, points: Array) -> Indices:
        """The cell, counted row by row, that each of `points` (P, 2) lies in or next to."""
        (ny, nx) = self.shape
        column, row = np.clip((points / self._sides).astype(int), 0, (nx - 1, ny - 1)).T
        return row * nx + column

    def summed(self, points: Array, forces: Array) -> Array:
        """What of `forces` (P,) at `points` (P, 2) acts in each cell, (ny, nx) in N."""
        ny, nx = self.shape
        found: Array = np.bincount(self.cell(points), forces, nx * ny).astype(float)
        return found.reshape(self.shape)

    def support(self, keel: Array, under: Indices) -> Support:
        """How the skin gives at those numbered `under` of the nodes and, after them, the `keel`."""
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

        return Support(
            points,
            felt_at,
            self._compliance.after,
            lambda c: np.concatenate([self._give(c), felt @ c])[under],
            np.full(len(under), self.soft),
            np.append(self._own, self._own_of(felt) + self.soft)[under],
            row // rows * self.shape[1] + column // columns,
        )
