"""From the readings and the shape fitted to them to the contact: where and how hard."""

import math
from dataclasses import dataclass
from typing import cast

import numpy as np

from kappaskin.bases import basis_for
from kappaskin.contact.modal import modal
from kappaskin.contact.products import Loads, Products, loads_on
from kappaskin.estimation import Fit, Remembered
from kappaskin.frames import Array, Mask, Touch
from kappaskin.mechanics import Plate
from kappaskin.sensing import SensorLayout

_SIGNIFICANT = 30.0  # drop of chi-squared below which a contact may be noise found by searching
_SEARCHED = 49  # points searched along each side
_FUNCTIONS = 15  # along each side, of the shape a point load makes: Table 1's definition
_STEPS = 20  # of Gauss-Newton at most; 2 or 3 do but for the last millimetres at the rim
_CONVERGED = 1e-4  # of a side: the step after one as short is shorter than 1e-6
_RIDGE = 1e-12  # keeps a load on the rim, which moves nothing, solvable
_DOUBTFUL = 0.15  # of a side: within it, a contact may be one on the rim

_AS_WELL = 1.2  # times the residual of the fitted shape that a single point load may leave
_REACH = 1.96  # standard deviations to either side in a 95 % interval

NO_TOUCH = Touch(
    np.full(2, np.nan), np.full(2, np.nan), math.nan, math.nan, math.nan, math.nan, 0, False, False
)


@dataclass(frozen=True, slots=True, eq=False)
class _Readings:
    """Readings K as the contact needs them: M'K (N,), K'K, and `spare` more than it takes."""

    h: Array
    power: float
    spare: int


@dataclass(frozen=True, slots=True, eq=False)
class _Tables:
    """What depends on which readings are used: T'T everywhere, and on the grid (ny, nx)."""

    loads: Loads
    norm: Array
    spare: int


class PointContact:
    """The point load on a skin that explains the readings best, by maximum likelihood.

    A load P at (x, y) makes the readings P T(x, y), T = M t with t = compliance times what each
    function feels there (Eqs. 2, 9). The best P for readings K is T'K / T'T, and what it explains
    of their sum of squares is (T'K)^2 / T'T: searched on a grid in every frame, where T'K is one
    map from M'K, so that no jump of the contact is missed; then refined by Gauss-Newton steps in
    x and y, with P at its best for each (variable projection, doi:10.1137/0710036). All of it
    needs the readings only as M'K and M'M.
    """

    def __init__(self, plate: Plate, layout: SensorLayout, edge: str = "hinged") -> None:
        self.patch, strip = plate.patch, plate.patch.strip
        self.basis = basis_for(self.patch, edge, _FUNCTIONS, 1 if strip else _FUNCTIONS)
        compliance = plate.compliance(self.basis)
        self._gives = compliance.after(np.eye(self.basis.size))
        self._M = compliance.after(layout.curvature_operator(self.basis))
        self._modal = modal(layout, self.basis, compliance, self._M)
        self._live = layout.live.ravel()
        x, y = self.patch.grid(_SEARCHED + 2, 3 if strip else _SEARCHED + 2)
        self._x, self._y = x[1:-1], y[1:-1]
        self._map = self.basis.on_grid(self._x, self._y)
        points = np.stack(np.meshgrid(self._x, self._y), -1).reshape(-1, 2)
        self._still = np.flatnonzero(~self.patch.moves(points))
        self._remembered = Remembered[_Tables]()
        self._whole = self._remembered(self._live, self._tables)
        self._all_live = bool(self._live.all())

    def _tables(self, used: Mask) -> _Tables:
        """The tables for the readings `used` (3 P,)."""
        M = self._M[used]
        loads = loads_on(self.basis, M.T @ M, self._gives)
        norm = loads.on_grid(self._x, self._y)
        norm[norm <= 0] = math.inf  # a load that these readings do not see explains nothing
        return _Tables(loads, norm, max(len(M) - 3, 1))

    def __call__(self, curvature: Array, fit: Fit) -> Touch:
        """The contact for `curvature` (3, P) in 1/m, NaN where missing, and the `fit` to it."""
        K, tables, power = self._used(curvature.ravel())
        readings = _Readings(self._modal(K), power, tables.spare)
        explained = self._map(readings.h.reshape(self.basis.shape))
        explained *= explained
        explained /= tables.norm
        explained.put(self._still, 0.0)
        row, column = divmod(int(explained.argmax()), len(self._x))
        least = _threshold(float(cast("float", fit.spare))) * float(fit.noise) ** 2
        if not explained[row, column] > least:
            return NO_TOUCH
        x = _highest(self._x, explained[row], column)
        y = _highest(self._y, explained[:, column], row)
        return self._refined(*self.patch.inward(x, y), readings, tables.loads, fit)

    def _used(self, K: Array) -> tuple[Array, _Tables, float]:
        """The readings that are there, zero for the others, their tables and sum of squares."""
        power = float(K.dot(K))
        if self._all_live and math.isfinite(power):
            return K, self._whole, power
        used = self._live & np.isfinite(K)
        known = np.where(used, K, 0.0)
        return known, self._remembered(used, self._tables), float(known.dot(known))

    def _refined(self, x: float, y: float, readings: _Readings, loads: Loads, fit: Fit) -> Touch:
        x, y, place = self._climbed(x, y, readings.h, loads)
        # What a point load leaves of the readings: the noise, or more where it is none.
        spread = math.sqrt(max(readings.power - place.explained, 0.0) / readings.spare)
        sd_x, sd_y, sd_force = place.unit_sd
        return Touch(
            np.array([x, y]),
            np.array([spread * sd_x, spread * sd_y]),
            place.force,
            spread * sd_force,
            *self._displacement(fit, x, y, place),
            readings.spare,
            spread < _AS_WELL * float(fit.noise),
            self._near_rim(x, y, readings.h, loads, place.explained - (_REACH * spread) ** 2),
        )

    def _climbed(self, x: float, y: float, h: Array, loads: Loads) -> "tuple[float, float, _Place]":
        """The best position from (x, y) on, and what holds at the last step to it."""
        a, b = self.patch.a, self.patch.b
        place = _Place(loads.at(x, y, h))
        for _ in range(_STEPS):
            dx, dy = place.step
            x, y = x + _between(-a / 50, dx, a / 50), y + _between(-b / 50, dy, b / 50)
            x, y = self.patch.inward(x, y)
            if abs(dx) < _CONVERGED * a and abs(dy) < _CONVERGED * b:
                break
            place = _Place(loads.at(x, y, h))
        return x, y, place

    def _near_rim(self, x: float, y: float, h: Array, loads: Loads, least: float) -> bool:
        """Whether the contact is within the shortest half wave of the functions from a held edge.

        Or whether a load on the rim beside it explains `least` or more of the readings, as well as
        one here: the force goes to infinity there.
        """
        if self.basis.unseen is not None:
            return False
        for x_rim, y_rim, share in self.patch.near_rim(x, y, _DOUBTFUL):
            if share < 1 / _FUNCTIONS:
                return True
            there = loads.at(x_rim, y_rim, h)
            if there.h**2 > least * there.tt:
                return True
        return False

    def _displacement(self, fit: Fit, x: float, y: float, place: "_Place") -> tuple[float, float]:
        """Displacement in m at (x, y), of the fitted shape, and how far it may be off.

        Besides the noise, by as much as the point load's own shape disagrees: what lies between is
        finer than the fit's functions.
        """
        shape, covariance = fit.jet(x, y)
        fitted, seen = float(shape[0]), float(covariance[0, 0])
        seen = math.sqrt(seen) if seen >= 0 else math.nan
        return fitted, math.hypot(seen, fitted - place.force * place.gives)


class _Place:
    """The best force at a place, the Gauss-Newton step from there, and the error bars.

    `force` is the one after the step, `gives` how far the skin does there, in m/N.
    """

    def __init__(self, of: Products) -> None:
        tt, tx, ty, xx, xy, yy, h, hx, hy, self.gives = of
        force, u, v = h / tt, tx / tt, ty / tt
        # The slopes without what T itself explains of them: S, with the gradient g.
        Sxx, Sxy = xx - u * tx, xy - u * ty
        Syy = yy - v * ty if yy else math.inf  # a strip is alike along y: no step, no error
        gx, gy = hx - u * h, hy - v * h
        Cx = max(Sxx - Sxy**2 / Syy, _RIDGE * xx)
        Cy = max(Syy - Sxy**2 / max(Sxx, _RIDGE * xx), _RIDGE * yy)
        dx, dy = (gx - gy * Sxy / Syy) / (Cx * force), (gy - gx * Sxy / Sxx) / (Cy * force)
        self.step, self.explained = (dx, dy), h * force
        self.force = force * (1 - u * dx - v * dy)
        of_force = math.sqrt(1 / tt + (u - v * Sxy / Syy) ** 2 / Cx + v**2 / Syy)
        strength = abs(force)
        self.unit_sd = 1 / math.sqrt(Cx) / strength, 1 / math.sqrt(Cy) / strength, of_force


def _between(low: float, value: float, high: float) -> float:
    return min(max(value, low), high)


def _highest(x: Array, values: Array, i: int) -> float:
    """Where the parabola through `values` at `x` around their largest, number `i`, is highest."""
    if not 0 < i < len(x) - 1:
        return float(x[i])
    before, here, after = values[i - 1 : i + 2].tolist()
    bend = before - 2 * here + after
    return float(x[i] + (x[1] - x[0]) * (before - after) / (2 * bend)) if bend else float(x[i])


def _threshold(spare: float) -> float:
    """What a contact must explain, in units of the noise's variance known from `spare` readings.

    The likelihood ratio spare ln(1 + F / spare) must exceed `_SIGNIFICANT`.
    """
    return spare * math.expm1(_SIGNIFICANT / spare) if spare > 1 else math.inf
