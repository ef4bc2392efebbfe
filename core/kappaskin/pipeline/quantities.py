"""Quantities: an estimate to values at the points of its surface, or at the elements."""

import math
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import NDArray

from kappaskin.bases import Basis, CurvatureMap, ValueMap
from kappaskin.contact import CurvatureFormMap
from kappaskin.errors import Refusal
from kappaskin.estimation import Estimator, Uncertainty
from kappaskin.frames import COMPONENTS, Array, Estimate
from kappaskin.pipeline.reported import Reported, colours_of, curvature_invariant
from kappaskin.sensing import SensorLayout

_AT_ONCE = 2**21  # values of functions that are worked out at once


class ErrorBars:
    """Standard deviations of the shape that an `estimator` finds from `curvature` (3, P) in 1/m.

    On the surface of `x` (nx,), `y` (ny,) in m. They hold for every frame with the same readings
    missing, NaN among `curvature`, for its own noise.
    """

    def __init__(self, estimator: Estimator, curvature: Array, x: Array, y: Array) -> None:
        self.basis, self._estimator = estimator.basis, estimator
        self._spread = cast("Uncertainty", estimator(curvature).uncertainty)
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        on = np.flatnonzero(self.basis.patch.contains(points))
        self._unit, self._undecided = np.full((2, len(points)), np.nan)
        step = max(_AT_ONCE // self.basis.size, 1)
        for part in (on[n : n + step] for n in range(0, len(on), step)):
            self._unit[part], self._undecided[part] = self._of(self.basis.at(points[part]))
        self._shape = len(y), len(x)

    def _of(self, rows: Array) -> tuple[Array, Array]:
        """Standard deviations (R,) of `rows` (R, N): for unit noise, and undetermined."""
        return self._spread.sd_of(rows), np.linalg.norm(rows @ self._estimator.undecided, axis=1)

    def on_surface(self, noise: float) -> Array:
        """Standard deviations (ny, nx) of the displacement in m; NaN off the skin."""
        return np.hypot(noise * self._unit, self._undecided).reshape(self._shape)

    def of_slopes(self, position: Array, noise: float) -> Array:
        """Standard deviations (2,) of the slopes along x and y at `position` (2,) in m.

        On a cap along the axes of its elements.
        """
        x, y = position.tolist()
        slopes = self.basis.patch.base(x, y).covariant[1:3] @ self.basis.jet(x, y)
        unit, undecided = self._of(slopes)
        return np.hypot(noise * unit, undecided)


class Quantities:
    """Values of `colours_of` the `layout` for estimates with one `basis` and one size of surface.

    What a quantity needs is computed when it is first asked for. `error_bar` is NaN until
    `error_bars` is set.
    """

    def __init__(self, layout: SensorLayout, basis: Basis, nx: int, ny: int) -> None:
        self.layout, self.basis = layout, basis
        self._colours = colours_of(layout)
        self.grid = layout.patch.grid(nx, ny)
        self.error_bars: ErrorBars | None = None
        self._changes: dict[str, CurvatureMap] = {}

    @cached_property
    def form(self) -> CurvatureFormMap:
        """The map from coefficients to the curvature form (3, ny, nx) in 1/m of the skin itself."""
        return CurvatureFormMap(self.basis, *self.grid)

    @cached_property
    def _interpolation(self) -> tuple[NDArray[np.intp], Array]:
        """For each element the corners (P, 4) of its square of the grid, and their weights."""
        x, y = self.grid
        cell = np.array([x[1] - x[0], y[1] - y[0]])
        place = self.layout.positions / cell
        low = np.minimum(place.astype(np.intp), (len(x) - 2, len(y) - 2))
        (p, q), (u, v) = low.T, (place - low).T
        corners = (q * len(x) + p)[:, None] + (0, 1, len(x), len(x) + 1)
        weights = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], axis=-1)
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        on = np.flatnonzero(self.layout.patch.contains(points))
        weights *= np.isin(corners, on)  # off the rim nothing is known
        for element in np.flatnonzero(weights.sum(axis=1) <= 0):  # in a narrow corner of the rim
            away = np.linalg.norm(points[on] - self.layout.positions[element], axis=1)
            corners[element, 0], weights[element, 0] = on[np.argmin(away)], 1.0
        return corners, weights / weights.sum(axis=1, keepdims=True)

    def at_rest(self, name: str) -> float:
        """The value of a skin at rest, in SI units."""
        of = self._colours[name].at_rest
        return 0.0 if of is None else of(np.array([*self.layout.patch.curvatures, 0.0]))

    def on_surface(self, name: str, estimate: Estimate) -> Array:
        """The values (ny, nx) in SI units; NaN off the skin and where they are not known."""
        of = self._colours[name].on_surface
        if of is None:
            raise Refusal(f"expected a quantity that a surface has, got {name!r}; use of_elements")
        return of(Reported(estimate, skin=self))

    def of_elements(self, name: str, estimate: Estimate) -> Array:
        """The values (P,) in SI units: as each element reads it, else as the fit has it there.

        NaN where missing, and of readings that the layout does not have.
        """
        if name not in self._colours:
            return np.full(len(self.layout), np.nan)
        if (of := self._colours[name].of_elements) is not None:
            return of(Reported(estimate, skin=self))
        corners, weights = self._interpolation
        values = self.on_surface(name, estimate).ravel()[corners]
        return np.sum(np.where(weights > 0, values, 0.0) * weights, axis=1)

    def directions(self, estimate: Estimate) -> Array:
        """Both principal curvatures in 1/m, and the angle of the first in rad from x, on the grid.

        They are (3, ny, nx).
        """
        xx, yy, xy = form = self.form(estimate.coefficients)
        angle = np.arctan2(xy, (xx - yy) / 2) / 2
        return np.stack(
            [curvature_invariant("first", form), curvature_invariant("second", form), angle]
        )

    # What quantities of the table are computed of.

    def surface_sd(self, estimate: Estimate) -> Array:
        """Standard deviations (ny, nx) of the displacement in m; NaN where they are not known."""
        bars, unknown = self.error_bars, np.full(estimate.surface.shape, np.nan)
        return unknown if bars is None else bars.on_surface(estimate.noise)

    def change(self, component: str, estimate: Estimate) -> Array:
        """The change (ny, nx) of a component of curvature in 1/m that the fit has."""
        if component not in self._changes:
            self._changes[component] = CurvatureMap(self.basis, component, *self.grid)
        return self._changes[component](estimate.coefficients)

    @cached_property
    def _slopes(self) -> list[ValueMap]:
        """The derivatives along x and y; on a bent skin the integral along the arc too."""
        orders = [(1, 0), (0, 1)] + [(-1, 0)] * bool(self.layout.patch.arc_curvature)
        return [self.basis.on_grid(*self.grid, *order) for order in orders]

    def reading(self, quantity: str, direction: float, estimate: Estimate) -> Array:
        """What a small element at each point (ny, nx) would read of the fit, in SI units."""
        c, s = math.cos(direction), math.sin(direction)
        if quantity == "height":
            return estimate.surface
        if quantity == "slope":
            p, q, *along = (of(estimate.coefficients) for of in self._slopes)
            return c * sum((self.layout.patch.arc_curvature**2 * v for v in along), p) + s * q
        xx, yy, xy = (self.change(name, estimate) for name in COMPONENTS)
        return xy if quantity == "twist" else c * c * xx + s * s * yy + 2 * c * s * xy

    def form_at_elements(self, curvature: Array) -> Array:
        """The curvature form (3, P) in 1/m as the elements read it, where slopes are small."""
        form = curvature + self._elements_at_rest
        return np.where([[False], [True], [True]], 0.0, form) if self.layout.patch.strip else form

    @cached_property
    def _elements_at_rest(self) -> Array:
        """The curvature form (3, P) in 1/m of the skin at rest at its elements."""
        return self.layout.patch.read_at_rest(self.layout.positions)
