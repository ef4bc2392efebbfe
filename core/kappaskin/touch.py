"""From the readings and the shape fitted to them to the contact: where and how hard."""

import math
from collections import OrderedDict

import numpy as np

from kappaskin.bases import basis_for
from kappaskin.fit import Fit
from kappaskin.frames import Array, Mask, Touch
from kappaskin.layout import SensorLayout
from kappaskin.mechanics import Plate

_SIGNIFICANT = 30.0  # drop of chi-squared below which a contact may be noise found by searching
_SEARCHED = 49  # points searched along each side
_FUNCTIONS = 15  # along each side, of the shape a point load makes: Table 1's definition
_STEPS = 2  # of Gauss-Newton, from the best point searched
_REMEMBERED = 8  # sets of missing readings whose norms are kept

_AS_WELL = 1.2  # times the residual of the fitted shape that a single point load may leave
_RIDGE = 1e-12 * np.eye(3)  # keeps a load on the rim, which moves nothing, solvable

NO_TOUCH = Touch(
    np.full(2, np.nan), np.full(2, np.nan), math.nan, math.nan, math.nan, math.nan, False
)


class PointContact:
    """The point load on a plate that explains the readings best, by maximum likelihood.

    A load P at (x, y) makes the readings P T(x, y), T = M t with t = compliance times sine
    products (Eqs. 2, 9). The best P for readings K is T'K / T'T, and what it explains of their sum
    of squares is (T'K)^2 / T'T: searched on a grid, where T'K is one map from M'K, then refined by
    Gauss-Newton steps in x, y and P, whose normal matrix gives the error bars.
    """

    def __init__(self, plate: Plate, layout: SensorLayout, edge: str = "hinged") -> None:
        across = 1 if plate.patch.strip else _FUNCTIONS
        self.basis = basis_for(plate.patch, edge, _FUNCTIONS, across)
        self._compliance = plate.compliance(self.basis)
        self._M = self._compliance.after(layout.curvature_operator(self.basis))
        self._live = layout.live.ravel()
        self._x, self._y = (s[1:-1] for s in plate.patch.grid(_SEARCHED + 2, _SEARCHED + 2))
        self._map = self.basis.on_grid(self._x, self._y)
        self._points = np.stack(np.meshgrid(self._x, self._y), axis=-1).reshape(-1, 2)
        self._functions = self.basis.at(self._points)
        self._norms: OrderedDict[bytes, Array] = OrderedDict()
        self._norm(self._live)

    def _norm(self, used: Mask) -> Array:
        """T'T (ny, nx) on the grid for the readings `used` (3 P,), remembered."""
        key = used.tobytes()
        if key not in self._norms:
            M = self._M[used]
            squares = np.einsum("gn,gn->g", self._functions @ (M.T @ M), self._functions)
            self._norms[key] = squares.reshape(len(self._y), len(self._x))
            if len(self._norms) > _REMEMBERED:
                self._norms.popitem(last=False)
        return self._norms[key]

    def __call__(self, curvature: Array, fit: Fit) -> Touch:
        """The contact for `curvature` (3, P) in 1/m, NaN where missing, and the `fit` to it."""
        used = self._live & np.isfinite(curvature).ravel()
        K = np.where(used, curvature.ravel(), 0.0)
        explained = self._map((K @ self._M).reshape(self.basis.shape)) ** 2 / self._norm(used)
        best = int(np.argmax(explained))
        spare = int(used.sum()) - fit.estimator.unknowns
        if not explained.flat[best] > _threshold(spare) * float(fit.noise) ** 2:
            return NO_TOUCH
        return self._refined(K, used, self._points[best], fit)

    def _refined(self, K: Array, used: Mask, position: Array, fit: Fit) -> Touch:
        side = np.array([self.basis.patch.a, self.basis.patch.b])
        readings = self._readings(position, used)
        force = float(readings[0] @ K) / float(readings[0] @ readings[0])
        covariance = np.empty((3, 3))
        for _ in range(_STEPS):
            J: Array = np.stack([force * readings[1], force * readings[2], readings[0]])
            length: Array = np.sqrt(np.einsum("ir,ir->i", J, J))
            scale = np.outer(length, length)  # metres and newtons: scale, then solve
            covariance: Array = np.linalg.inv(J @ J.T / scale + _RIDGE) / scale
            step = covariance @ (J @ (K - force * readings[0]))
            position = np.clip(position + step[:2], 1e-3 * side, (1 - 1e-3) * side)
            force += float(step[2])
            readings = self._readings(position, used)
        left = K - force * readings[0]
        # What a point load leaves of the readings: the noise, or more where it is none.
        spread = math.sqrt(float(left @ left) / max(int(used.sum()) - 3, 1))
        sd = spread * np.sqrt(np.diag(covariance))
        moved, moved_sd = self._displacement(fit, position, force)
        single = spread < _AS_WELL * float(fit.noise)
        return Touch(position, sd[:2], force, float(sd[2]), moved, moved_sd, single)

    def _readings(self, position: Array, used: Mask) -> Array:
        """T and its slopes along x and y (3, 3 P) at `position`; zero where not `used`."""
        functions = self.basis.with_slopes(float(position[0]), float(position[1]))
        readings = np.stack([self._M @ f for f in functions])  # faster than one thin product
        return readings if used.all() else readings * used

    def _displacement(self, fit: Fit, position: Array, force: float) -> tuple[float, float]:
        """Displacement at `position` in m, of the fitted shape, and how far it may be off.

        Besides the noise, by as much as the point load's own shape disagrees: what lies between is
        finer than the fit's functions.
        """
        b = fit.estimator.basis.with_slopes(float(position[0]), float(position[1]))[0]
        fitted = float(b @ fit.coefficients.ravel())
        variance = float(b @ fit.estimator.unit_covariance(np.isnan(fit.residual)) @ b)
        t = self.basis.with_slopes(float(position[0]), float(position[1]))[0]
        loaded = force * float(t @ self._compliance(t.reshape(self.basis.shape)).ravel())
        return fitted, math.hypot(float(fit.noise) * math.sqrt(variance), fitted - loaded)


def _threshold(spare: int) -> float:
    """What a contact must explain, in units of the noise's variance known from `spare` readings.

    The likelihood ratio spare ln(1 + F / spare) must exceed `_SIGNIFICANT`.
    """
    return spare * math.expm1(_SIGNIFICANT / spare) if spare > 1 else math.inf
