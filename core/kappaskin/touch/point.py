"""From the readings and the shape fitted to them to the contact: where and how hard."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import blas

from kappaskin.bases import basis_for
from kappaskin.fit import Fit
from kappaskin.fit.remembered import Remembered
from kappaskin.frames import Array, Mask, Touch
from kappaskin.layout import SensorLayout
from kappaskin.mechanics import Plate

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
    """Readings K as the contact needs them: M'K (N,), K'K, and how many there are."""

    h: Array
    power: float
    count: int


@dataclass(frozen=True, slots=True, eq=False)
class _Tables:
    """What depends on which readings are used: G = M'M (N, N), and T'T (ny, nx) on the grid."""

    G: Array
    norm: Array


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
        self._compliance = plate.compliance(self.basis)
        self._M = self._compliance.after(layout.curvature_operator(self.basis))
        self._live = layout.live.ravel()
        x, y = self.patch.grid(_SEARCHED + 2, 3 if strip else _SEARCHED + 2)
        self._x, self._y = x[1:-1], y[1:-1]
        self._map = self.basis.on_grid(self._x, self._y)
        points = np.stack(np.meshgrid(self._x, self._y), -1).reshape(-1, 2)
        self._still = ~self.patch.moves(points).reshape(len(self._y), -1)
        self._functions = np.where(self._still.reshape(-1, 1), 0.0, self.basis.at(points))
        self._remembered = Remembered[_Tables]()
        self._remembered(self._live, self._tables)

    def _tables(self, used: Mask) -> _Tables:
        """The tables for the readings `used` (3 P,)."""
        M = self._M[used]
        G: Array = np.asfortranarray(M.T @ M)
        squares = np.vecdot(self._functions @ G, self._functions).reshape(self._still.shape)
        return _Tables(G, np.where(self._still, 1.0, squares))

    def __call__(self, curvature: Array, fit: Fit) -> Touch:
        """The contact for `curvature` (3, P) in 1/m, NaN where missing, and the `fit` to it."""
        used = self._live & np.isfinite(curvature).ravel()
        K = np.where(used, curvature.ravel(), 0.0)
        tables = self._remembered(used, self._tables)
        readings = _Readings(K @ self._M, float(K @ K), int(used.sum()))
        explained = self._map(readings.h.reshape(self.basis.shape)) ** 2 / tables.norm
        explained[self._still] = 0.0
        row, column = divmod(int(explained.argmax()), len(self._x))
        least = _threshold(float(np.asarray(fit.spare))) * float(fit.noise) ** 2
        if not explained[row, column] > least:
            return NO_TOUCH
        x = _highest(self._x, explained[row], column)
        y = _highest(self._y, explained[:, column], row)
        return self._refined(*self.patch.inward(x, y), readings, tables.G, fit)

    def _refined(self, x: float, y: float, readings: _Readings, G: Array, fit: Fit) -> Touch:
        x, y, place = self._climbed(x, y, readings.h, G)
        spare = max(readings.count - 3, 1)
        # What a point load leaves of the readings: the noise, or more where it is none.
        spread = math.sqrt(max(readings.power - place.explained, 0.0) / spare)
        sd = spread * place.unit_sd
        return Touch(
            np.array([x, y]),
            sd[:2],
            place.force,
            float(sd[2]),
            *self._displacement(fit, x, y, place),
            spare,
            spread < _AS_WELL * float(fit.noise),
            self._near_rim(x, y, readings.h, G, place.explained - (_REACH * spread) ** 2),
        )

    def _climbed(self, x: float, y: float, h: Array, G: Array) -> "tuple[float, float, _Place]":
        """The best position from (x, y) on, and what holds at the last step to it."""
        a, b = self.patch.a, self.patch.b
        place = self._place(x, y, h, G)
        for _ in range(_STEPS):
            dx, dy = place.step
            x, y = x + _between(-a / 50, dx, a / 50), y + _between(-b / 50, dy, b / 50)
            x, y = self.patch.inward(x, y)
            if abs(dx) < _CONVERGED * a and abs(dy) < _CONVERGED * b:
                break
            place = self._place(x, y, h, G)
        return x, y, place

    def _place(self, x: float, y: float, h: Array, G: Array) -> "_Place":
        # With F the functions and their slopes along x and y, A = F G F' holds the products of T
        # and its slopes, and F h their products with K.
        F = self.basis.jet(x, y)[:3]
        GF = np.array([_times(G, f) for f in F])  # faster than one thin product
        return _Place(F[0], (GF @ F.T).tolist(), (F @ h).tolist())

    def _near_rim(self, x: float, y: float, h: Array, G: Array, least: float) -> bool:
        """Whether the contact is within the shortest half wave of the functions from a held edge.

        Or whether a load on the rim beside it explains `least` or more of the readings, as well as
        one here: the force goes to infinity there.
        """
        if self.basis.unseen is not None:
            return False
        for x_rim, y_rim, share in self.patch.near_rim(x, y, _DOUBTFUL):
            if share < 1 / _FUNCTIONS:
                return True
            t = self.basis.jet(x_rim, y_rim)[0]
            if float(h @ t) ** 2 > least * float(t @ _times(G, t)):
                return True
        return False

    def _displacement(self, fit: Fit, x: float, y: float, place: "_Place") -> tuple[float, float]:
        """Displacement in m at (x, y), of the fitted shape, and how far it may be off.

        Besides the noise, by as much as the point load's own shape disagrees: what lies between is
        finer than the fit's functions.
        """
        b = fit.estimator.basis.jet(x, y)[0]
        fitted = float(b @ fit.coefficients.ravel())
        seen = float(fit.sd_of(b[None])[0])
        t = place.functions
        loaded = place.force * float(t @ self._compliance.after(t[None])[0])
        return fitted, math.hypot(seen, fitted - loaded)


class _Place:
    """The best force at a place, the Gauss-Newton step from there, and the error bars.

    `A` (3, 3) are the products of T, T_x and T_y with each other, `h` (3,) with the readings.
    `force` is the one after the step.
    """

    def __init__(self, functions: Array, A: list[list[float]], h: list[float]) -> None:
        (tt, tx, ty), (_, xx, xy), (_, _, yy) = A
        force, u, v = h[0] / tt, tx / tt, ty / tt
        # The slopes without what T itself explains of them: S, with the gradient g.
        Sxx, Sxy = xx - u * tx, xy - u * ty
        Syy = yy - v * ty if yy else math.inf  # a strip is alike along y: no step, no error
        gx, gy = h[1] - u * h[0], h[2] - v * h[0]
        Cx = max(Sxx - Sxy**2 / Syy, _RIDGE * xx)
        Cy = max(Syy - Sxy**2 / max(Sxx, _RIDGE * xx), _RIDGE * yy)
        dx, dy = (gx - gy * Sxy / Syy) / (Cx * force), (gy - gx * Sxy / Sxx) / (Cy * force)
        self.functions, self.step, self.explained = functions, (dx, dy), h[0] * force
        self.force = force * (1 - u * dx - v * dy)
        of_force = math.sqrt(1 / tt + (u - v * Sxy / Syy) ** 2 / Cx + v**2 / Syy)
        self.unit_sd = np.array([1 / math.sqrt(Cx), 1 / math.sqrt(Cy), of_force * abs(force)])
        self.unit_sd /= abs(force)


def _times(G: Array, f: Array) -> Array:
    """G f, of which a symmetric G in Fortran's order is read only half."""
    return blas.dsymv(1.0, G, f)


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
