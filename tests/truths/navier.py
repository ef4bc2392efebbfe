"""Navier's hinged plate: displacement and curvature under a load, summed to 240 modes each way.

It shares no code with the library that it tests. Displacement is positive inward, and curvature
the plain second derivatives f_xx, f_yy and f_xy.
"""

from dataclasses import dataclass, replace
from functools import cache, lru_cache

import numpy as np
from scipy.special import j1


@dataclass(frozen=True)
class Load:
    """A force in N at (x, y) in m: at a point, even over a disc of `radius`, or Gaussian with `sd`.

    Radius and sd in m; a disc and nearly all of a Gaussian lie inside the plate.
    """

    x: float
    y: float
    force: float = 1.0
    radius: float = 0.0
    sd: float = 0.0

    def mean(self, k):
        """Mean over the load of a wave of wave number k in 1/m, at its middle 1.

        Over a circle it is J_0(k r), by Helmholtz's equation; from it come disc and Gaussian.
        """
        t = np.maximum(k * self.radius, 1e-12)
        return 2 * j1(t) / t * np.exp(-((k * self.sd) ** 2) / 2)


@dataclass(frozen=True)
class HingedPlate:
    """A plate of a x b in m and flexural `rigidity` D in N m, hinged along its rim."""

    a: float = 0.1
    b: float = 0.1
    rigidity: float = 3.7e-3
    modes: int = 240

    def displacement(self, load, places):
        """Displacement (G,) in m at `places` (G, 2) in m."""
        return self.surface(self.coefficients(load), places)

    def readings(self, load, elements, gage_length=0.0):
        """Curvature xx, yy, xy (3, P) in 1/m at `elements` (P, 2) in m.

        Each is the mean over gages of `gage_length` in m: xx along x, yy along y; xy is half of
        what the mean normal curvatures along the two diagonals differ by.
        """
        return self.curvature(self.coefficients(load), elements, gage_length)

    def coefficients(self, load):
        """c_ij (modes, modes) in m: the force on a mode over a b / 4 D (k_i^2 + l_j^2)^2."""
        return self.forces(load) / self.stiffness

    def forces(self, load):
        """The work of a load on each mode per m: (modes, modes) in N."""
        k, l = self.waves()
        return load.force * self.mean(load) * np.outer(np.sin(k * load.x), np.sin(l * load.y))

    def mean(self, load):
        """Mean (modes, modes) of each mode over a load, wherever it is, by that in its middle."""
        return _mean(self, replace(load, x=0.0, y=0.0, force=1.0))

    @property
    def stiffness(self):
        """Of each mode (modes, modes) in N/m."""
        return _stiffness(self)

    def surface(self, c, places):
        """Displacement (G,) of the modes `c` (modes, modes), both in m."""
        return _surface(self, places.tobytes())(c)

    def slope(self, c, places, direction):
        """Slope (G,) along a `direction` in rad from x of the modes `c` (modes, modes) in m."""
        (k, l), (x, y) = self.waves(), places.T
        kx, ly = np.outer(x, k), np.outer(y, l)
        along_x = _sums(k * np.cos(kx), np.sin(ly))(c)
        return np.cos(direction) * along_x + np.sin(direction) * _sums(np.sin(kx), l * np.cos(ly))(
            c
        )

    def read(self, c, places, name):
        """The reading (G,) of a `name`: height, slope@30, curvature@45 (in degrees from x), twist.

        The curvature along t = (cos, sin) is cos^2 xx + 2 cos sin xy + sin^2 yy.
        """
        quantity, _, degrees = name.partition("@")
        direction = np.radians(float(degrees or 0))
        if quantity == "height":
            return self.surface(c, places)
        if quantity == "slope":
            return self.slope(c, places, direction)
        (xx, yy, xy), cos, sin = self.curvature(c, places), np.cos(direction), np.sin(direction)
        return xy if quantity == "twist" else cos**2 * xx + 2 * cos * sin * xy + sin**2 * yy

    def curvature(self, c, elements, gage_length=0.0):
        """Readings (3, P) of the modes `c` (modes, modes) in m."""
        return _gages(self, elements.tobytes(), gage_length)(c)

    def waves(self):
        """Wave numbers (modes,) along x and along y in 1/m."""
        n = np.pi * np.arange(1, self.modes + 1)
        return n / self.a, n / self.b


@cache
def _squares(plate):
    k, l = plate.waves()
    return np.add.outer(k**2, l**2)


@cache
def _stiffness(plate):
    return plate.a * plate.b / 4 * plate.rigidity * _squares(plate) ** 2


@lru_cache(64)  # half a megabyte each: loads of random widths would fill the memory
def _mean(plate, load):
    return load.mean(np.sqrt(_squares(plate)))


@lru_cache(8)
def _surface(plate, places):
    """The map from modes to displacements, for the bytes of `places` (G, 2)."""
    (k, l), (x, y) = plate.waves(), np.frombuffer(places).reshape(-1, 2).T
    return _sums(np.sin(np.outer(x, k)), np.sin(np.outer(y, l)))


# The mean of a wave k over a length L is sinc(k L / 2) times its middle. Along a diagonal, x and y
# both move by t in [-h, h], h = L / sqrt(8), and a gage reads (f_xx + f_yy) / 2 + f_xy, along the
# other one (f_xx + f_yy) / 2 - f_xy. Of f = sin(k x) sin(l y) half of what they differ by is
# cos(k x) cos(l y) times
#     k l <cos(k t) cos(l t)> - (k^2 + l^2) / 2 <sin(k t) sin(l t)>
#     = ((k + l)^2 sinc((k + l) h) - (k - l)^2 sinc((k - l) h)) / 4,  <> the mean over t.


@cache
def _gages(plate, elements, L):
    """The map from modes to readings, for the bytes of `elements` (P, 2)."""
    x, y = np.frombuffer(elements).reshape(-1, 2).T
    k, l = np.ix_(*plate.waves())
    h, both, difference = L / np.sqrt(8), k + l, k - l
    by_xx, by_yy = -(k**2) * _sinc(k * L / 2), -(l**2) * _sinc(l * L / 2)
    by_xy = (both**2 * _sinc(both * h) - difference**2 * _sinc(difference * h)) / 4
    kx, ly = np.outer(x, k), np.outer(y, l)
    sines, cosines = _sums(np.sin(kx), np.sin(ly)), _sums(np.cos(kx), np.cos(ly))
    return lambda c: np.stack([sines(c * by_xx), sines(c * by_yy), cosines(c * by_xy)])


def _sinc(t):
    return np.sinc(t / np.pi)


def _sums(X, Y):
    """The sum over i and j of c_ij X_i Y_j at each place; places of one column share a product."""
    columns, which = np.unique(X, axis=0, return_inverse=True)
    return lambda c: np.vecdot((columns @ c)[which.ravel()], Y)
