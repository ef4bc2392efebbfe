"""From the coefficients of a shape to the contact that made it: where and how hard."""

import math

import numpy as np

from kappaskin.bases import GridMap
from kappaskin.fit import LeastSquares
from kappaskin.frames import Array, Touch
from kappaskin.mechanics import Plate

_SIGNIFICANT = 30.0  # drop of chi-squared below which a contact may be noise found by searching
_FINE = 49  # points searched along each side

NO_TOUCH = Touch(np.full(2, np.nan), np.full(2, np.nan), *[math.nan] * 4)


class PointContact:
    """The point load on a plate that explains the coefficients best, by maximum likelihood.

    A load P at (x, y) makes the coefficients P t(x, y), t = compliance times sine products
    (Eq. 9). With the information A of the fit, the best P is t'Ac / t'At, and what it explains of
    the readings' sum of squares is (t'Ac)^2 / t'At: searched on a grid, refined by a parabola, its
    curvature there giving the error bar.
    """

    def __init__(self, plate: Plate, fit: LeastSquares) -> None:
        self.basis = basis = fit.basis
        self._A, self._covariance = fit.information, fit.unit_covariance()
        self._compliance = plate.compliance(basis)
        n = max(_FINE, 3 * max(basis.shape))
        self._x, self._y = (side[1:-1] for side in plate.patch.grid(n + 2, n + 2))
        self._grid: GridMap = basis.on_grid(self._x, self._y)
        self._norm = np.stack([self._squared_length(y) for y in self._y])  # (ny, nx)

    def _squared_length(self, y: float) -> Array:
        """t'At (nx,) along one row of the grid."""
        points = np.column_stack([self._x, np.full_like(self._x, y)])
        t = self.basis.at(points) * self._compliance.ravel()
        return np.einsum("gn,gn->g", t @ self._A, t)

    def __call__(self, coefficients: Array, noise: float) -> Touch:
        """The contact for `coefficients` (Ni, Nj) in m fitted to readings of `noise` in 1/m."""
        seen = (self._A @ coefficients.ravel()).reshape(self.basis.shape) * self._compliance
        explained = self._grid(seen) ** 2 / self._norm
        q, p = divmod(int(np.argmax(explained)), len(self._x))
        if not explained[q, p] > _SIGNIFICANT * noise**2:
            return NO_TOUCH
        position, variance = self._refine(explained, q, p)
        return self._touch(coefficients, seen, position, np.sqrt(variance) * noise, noise)

    def _refine(self, explained: Array, q: int, p: int) -> tuple[Array, Array]:
        """The top of the parabola through nine points, and its variance for unit noise."""
        q, p = np.clip(q, 1, len(self._y) - 2), np.clip(p, 1, len(self._x) - 2)
        s = explained[q - 1 : q + 2, p - 1 : p + 2]
        slope = np.array([s[1, 2] - s[1, 0], s[2, 1] - s[0, 1]]) / 2
        hxy = (s[2, 2] - s[2, 0] - s[0, 2] + s[0, 0]) / 4
        hessian = np.array(
            [[s[1, 2] - 2 * s[1, 1] + s[1, 0], hxy], [hxy, s[2, 1] - 2 * s[1, 1] + s[0, 1]]]
        )
        step = np.array([self._x[1] - self._x[0], self._y[1] - self._y[0]])
        here = np.array([self._x[p], self._y[q]])
        if not (hessian[0, 0] < 0 and np.linalg.det(hessian) > 0):
            return here, np.full(2, np.inf)  # no top inside: the contact sits on the rim
        inverse = np.linalg.inv(hessian)
        offset = np.clip(-inverse @ slope, -1, 1)
        return here + offset * step, -2 * np.diag(inverse) * step**2

    def _touch(
        self, coefficients: Array, seen: Array, position: Array, position_sd: Array, noise: float
    ) -> Touch:
        b = self.basis.at(position[None])[0]
        t = b * self._compliance.ravel()
        At = self._A @ t
        length = float(t @ At)
        force = float(b @ seen.ravel()) / length
        displacement = float(b @ coefficients.ravel())
        sd = noise * math.sqrt(float(b @ self._covariance @ b))
        return Touch(position, position_sd, force, noise / math.sqrt(length), displacement, sd)
