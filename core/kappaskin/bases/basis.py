"""The interface of a basis, and the curvature of its functions."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import Refusal
from kappaskin.frames import COMPONENTS, Array
from kappaskin.skin import Cap, MeshSkin, Patch

Order = tuple[int, int]
ORDERS: tuple[Order, ...] = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
"""Orders of the derivatives along x and y that `Basis.jet` gives."""
_COUNTS = 1, 3, 6  # of them, up to each order


class ValueMap(Protocol):
    """A map from coefficients to values on a grid, built once and called per frame."""

    def __call__(self, coefficients: Array) -> Array:
        """Values (..., ny, nx) for `coefficients` (..., Ni, Nj); NaN off the skin."""
        ...


class Basis(Protocol):
    """Ni x Nj functions on a patch; they, or combinations of them, meet its boundary conditions.

    Coefficients are (Ni, Nj) arrays in m; flattened, N = Ni Nj with j running fastest. Functions
    that are not products are ordered by frequency, row by row.
    """

    @property
    def patch(self) -> Patch: ...

    @property
    def shape(self) -> tuple[int, int]: ...

    @property
    def size(self) -> int: ...

    @property
    def free(self) -> Array | None:
        """The combinations (N, F) of functions that a fit may use; None for all of them.

        The boundary conditions allow these and the `unobservable` ones.
        """
        ...

    @property
    def unobservable(self) -> Array | None:
        """Shapes (N, q) without curvature, of unit RMS along the rim; None where there are none."""
        ...

    def at(self, positions: Array, dx: int = 0, dy: int = 0) -> Array:
        """Derivatives (P, N) of order `dx`, `dy` of every function at `positions` (P, 2) in m.

        NaN off a disk or a polygon. `dx` = -1 is the integral along x whose values at the two ends
        cancel.
        """
        ...

    def jet(self, x: float, y: float, order: int = 2) -> Array:
        """Derivatives (6, N) of every function at one point, in the order of `ORDERS`.

        Those up to an `order` of 1 (3, N) or 0 (1, N) take less.
        """
        ...

    def value(self, x: float, y: float, coefficients: Array) -> float:
        """The value at one point of the shape with `coefficients` (Ni, Nj) in m."""
        ...

    def on_grid(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> ValueMap:
        """The map from coefficients to a derivative on the grid of `x` (nx,), `y` (ny,) in m."""
        ...

    def quadrature(self) -> tuple[Array, Array]:
        """Points (Q, 2) in m and weights (Q,) in m^2, exact for products of two functions."""
        ...


# On a skin bent along x to 1/R = H, a displacement f inward changes the curvature by
#     xx: f_xx + H^2 f,    yy: f_yy,    xy: f_xy + H v_y   with   v_x = H f.
# These are Sanders' and Koiter's changes of curvature when neither the hoop nor the shear strain
# changes: the tangential displacement v follows from f, and u_x = -v_y. Flat, they are Eqs. 3-5.
# A fit of the shape knows no loads and no stiffness, and nothing better of v and u; where they are
# known, mechanics has them (`Plate.curvature`). Of a skin 0.25 mm thick, half round (R 12.9 mm),
# the twist differs by 2 % of its peak, and the shape so fitted by 5 % in RMS.
# A shallow skin's tangential displacements are neglected in bending and twist (Marguerre):
#     xx: f_xx + f / Rx^2,    yy: f_yy + f / Ry^2,    xy: f_xy.
_ORDERS = {"xx": (2, 0), "yy": (0, 2), "xy": (1, 1)}


def curvature_terms(patch: Patch, component: str) -> list[tuple[float, Order]]:
    """The factors and derivative orders whose sum is a `component` of curvature."""
    if component not in _ORDERS:
        raise Refusal(f"expected a component among {', '.join(COMPONENTS)}; got {component!r}")
    Hx, Hy = patch.curvatures
    bent = {"xx": (Hx, (0, 0)), "yy": (Hy, (0, 0)), "xy": (patch.arc_curvature, (-1, 1))}
    H, order = bent[component]
    return [(1.0, _ORDERS[component])] + ([(H**2, order)] if H else [])


# On a cap, along the frame of `Patch.local`, with the curvature form K at rest, a displacement f
# inward changes the curvature by
#     f_;ij + (K^2)_ij f.
# Of a sphere that is exact, whatever the tangential displacements are; of a spheroid it neglects
# how far these carry the skin to where it is curved otherwise (mechanics/cap.py has that).


def covariant_at(basis: Basis, positions: Array) -> Array:
    """Covariant derivatives (6, P, N) of every function along the frame of `Patch.local`.

    At `positions` (P, 2) in m; in the order of `ORDERS`.
    """
    jet = np.stack([basis.at(positions, *order) for order in ORDERS])
    found: Array = np.einsum("pij,jpn->ipn", basis.patch.base(*positions.T).covariant, jet)
    return found


def _on_cap(basis: Basis, cap: Cap, positions: Array) -> Array:
    """As `curvature_at`, on a cap."""
    f, _, _, xx, xy, yy = covariant_at(basis, positions)
    Kxx, Kyy, Kxy = cap.base(*positions.T).form
    squares = np.stack([Kxx**2 + Kxy**2, Kyy**2 + Kxy**2, Kxy * (Kxx + Kyy)])
    found: Array = np.stack([xx, yy, xy]) + squares[..., None] * f
    return found


def curvature_at(basis: Basis, positions: Array) -> Array:
    """Curvature change xx, yy, xy (3, P, N) in 1/m per m of each function (Eqs. 3-5, 11).

    Of a bent skin as if it were inextensible. On a cap they are those along `Patch.local`'s frame.
    """
    if isinstance(basis.patch, Cap):
        return _on_cap(basis, basis.patch, positions)
    if isinstance(basis.patch, MeshSkin):
        return cast("Any", basis).curvature_at(positions)  # a `MeshBasis` has its own
    return np.stack(
        [
            sum(
                h * basis.at(positions, *order)
                for h, order in curvature_terms(basis.patch, component)
            )
            for component in COMPONENTS
        ]
    )


def hoop_at(basis: Basis, positions: Array) -> Array:
    """v along an inextensible arc with v_y and v_yy, (3, P, N) per m of each function."""
    v = np.stack([basis.at(positions, -1, order) for order in range(3)])
    return basis.patch.arc_curvature * v


@dataclass(frozen=True, eq=False)
class PointMap:
    """A map from coefficients to values on a grid by one dense product; NaN off the skin.

    Reading its matrix takes most of the time: single precision, exact to a ten-millionth of the
    coefficients, halves it, and no point off the skin is in it. Its columns are the points on the
    skin and one off it, of NaN; `column` (ny, nx) is that of each point of the grid.
    """

    values: NDArray[np.float32]
    column: NDArray[np.intp]

    @classmethod
    def of(cls, values_at: Callable[[Array], Array], x: Array, y: Array) -> "PointMap":
        """The map to what `values_at` positions (P, 2) gives (P, N), on the grid of `x` and `y`."""
        values = values_at(np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))])).T
        on = np.flatnonzero(np.isfinite(values[0]))
        column = np.full(values.shape[1], len(on))
        column[on] = np.arange(len(on))
        nan = np.full((len(values), 1), np.nan)
        of_skin = np.hstack([values[:, on], nan]).astype(np.float32, "C")
        return cls(of_skin, column.reshape(len(y), len(x)))

    def __call__(self, coefficients: Array) -> Array:
        """Values (..., ny, nx) for `coefficients` (..., Ni, Nj)."""
        flat = coefficients.reshape(*coefficients.shape[:-2], -1).astype(np.float32, copy=False)
        return np.dot(flat, self.values).astype(float).take(self.column, axis=-1)


def covariant_maps(basis: Basis, x: Array, y: Array) -> list[ValueMap]:
    """The maps from coefficients to what `covariant_at` gives, on the grid of `x` and `y`."""
    if not basis.patch.base(float(x[0]), float(y[0])).slopes:
        return [basis.on_grid(x, y, *order) for order in ORDERS]
    jets = covariant_at(basis, np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))]))
    return [PointMap.of(lambda _, jet=jet: jet, x, y) for jet in jets]


class CurvatureMap:
    """A map from coefficients to the change of one curvature component on a grid."""

    def __init__(self, basis: Basis, component: str, x: Array, y: Array) -> None:
        self._terms: list[tuple[float, ValueMap]]
        if isinstance(basis.patch, Cap | MeshSkin):
            k = COMPONENTS.index(component)
            self._terms = [(1.0, PointMap.of(lambda at: curvature_at(basis, at)[k], x, y))]
        else:
            self._terms = [
                (h, basis.on_grid(x, y, *o)) for h, o in curvature_terms(basis.patch, component)
            ]

    def __call__(self, coefficients: Array) -> Array:
        """Curvature (..., ny, nx) in 1/m for `coefficients` (..., Ni, Nj)."""
        first, *others = (h * values(coefficients) for h, values in self._terms)
        return sum(others, first)


@dataclass(frozen=True)
class FunctionBasis(ABC):
    """Common base of the bases: Ni x Nj functions, all free and all observable by default."""

    patch: Patch
    Ni: int
    Nj: int

    @property
    def shape(self) -> tuple[int, int]:
        return self.Ni, self.Nj

    @property
    def size(self) -> int:
        return self.Ni * self.Nj

    @property
    def free(self) -> Array | None:
        return None

    @property
    def unobservable(self) -> Array | None:
        return None

    @abstractmethod
    def _place(self, x: float, y: float, count: int) -> Array:
        """The first `count` derivatives of every function at one point, (count, N), of `ORDERS`."""

    @cached_property
    def _last(self) -> dict[tuple[float, float, int], Array]:
        return {}

    def jet(self, x: float, y: float, order: int = 2) -> Array:
        """Derivatives (6, N) of every function at one point; the last point's are cached."""
        if (x, y, order) not in self._last:
            self._last.clear()
            self._last[x, y, order] = self._place(x, y, _COUNTS[order])
        return self._last[x, y, order]

    def value(self, x: float, y: float, coefficients: Array) -> float:
        """The value at one point of the shape with `coefficients` (Ni, Nj)."""
        return float(self.jet(x, y, 0)[0].dot(coefficients.ravel()))
