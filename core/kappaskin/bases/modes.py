"""Mode bases: the vibration modes of round and polygonal plates."""

import cmath
import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray

from kappaskin.bases.basis import ORDERS, FunctionBasis, Order
from kappaskin.bases.product import gauss
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.skin import Disk, Polygon

if TYPE_CHECKING:
    from kappaskin.bases.argyris import PlateModes


_MOST = 1024  # modes: more take minutes to make


@dataclass(frozen=True, eq=False)
class PointMap:
    """A map from coefficients to values on a grid by one dense product; NaN off the skin.

    Reading its matrix takes most of the time: single precision, exact to a ten-millionth of the
    coefficients, halves it, and no point off the skin is in it. Its columns are the points on the
    skin and one off it, of NaN; `column` (ny, nx) is that of each point of the grid.
    """

    values: NDArray[np.float32]
    column: NDArray[np.intp]

    def __call__(self, coefficients: Array) -> Array:
        """Values (..., ny, nx) for `coefficients` (..., Ni, Nj)."""
        flat = coefficients.reshape(*coefficients.shape[:-2], -1).astype(np.float32, copy=False)
        return np.dot(flat, self.values).astype(float).take(self.column, axis=-1)


@dataclass(frozen=True)
class ModeBasis(FunctionBasis):
    """The first Ni x Nj modes of a flat skin by frequency; their mean square is 1/4, as sines'."""

    def __post_init__(self) -> None:
        if not (self.Ni > 0 and self.Nj > 0 and self.size <= _MOST):
            raise Refusal(
                f"expected 1 x 1 to {_MOST} functions on a {self.patch.name}, got "
                f"{self.Ni} x {self.Nj}"
            )

    @abstractmethod
    def _derivative(self, positions: Array, order: Order) -> Array:
        """The derivative (P, N) of one order at `positions` (P, 2); NaN off the skin."""

    def at(self, positions: Array, dx: int = 0, dy: int = 0) -> Array:
        """Every function's derivative of order `dx`, `dy`, (P, N), at `positions`; NaN off it."""
        if (dx, dy) not in ORDERS:
            raise Refusal(
                f"expected derivatives up to second order, got order {dx} along x and {dy} along y"
            )
        return self._derivative(positions, (dx, dy))

    def on_grid(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> PointMap:
        """The map from coefficients to that derivative on the grid of `x` (nx,), `y` (ny,)."""
        points = np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))])
        values = self.at(points, dx, dy).T
        on = np.flatnonzero(np.isfinite(values[0]))
        column = np.full(len(points), len(on))
        column[on] = np.arange(len(on))
        nan = np.full((self.size, 1), np.nan)
        of_skin = np.hstack([values[:, on], nan]).astype(np.float32)
        return PointMap(of_skin, column.reshape(len(y), len(x)))


Complex = NDArray[np.complex128]

_ROUNDING = 1e-9  # of the radius: gages that end on the rim may stand this far outside
_POISSON = 0.3  # of the plate whose hinged modes these are


@dataclass(frozen=True)
class DiskBasis(ModeBasis):
    """The vibration modes of a round plate, hinged or `clamped` along its rim.

    With r = 1 at the rim they are (J_m(k r) - J_m(k)/I_m(k) I_m(k r)) times cos m theta and, for
    m > 0, sin m theta. All vanish at the rim. Clamped, J_m+1(k)/J_m(k) + I_m+1(k)/I_m(k) = 0 makes
    their slope vanish too; hinged, that sum is 2 k/(1 - nu) with nu = 0.3, and the bending moment
    across the rim vanishes.

    Either set spans every shape of finite bending energy that its edge allows, whatever the skin's
    own nu, and so do membrane modes J_m(k r). But the curvature of a loaded plate converges as
    n^(-5/2) with n functions of r when it has the same nu, else as n^(-1/2); with membrane modes,
    whose Laplacian vanishes at the rim, always as n^(-1/2), with three times the error.
    """

    clamped: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.patch, Disk):
            raise Refusal(f"expected a disk, got a {self.patch.name}")

    @cached_property
    def _modes(self) -> "_DiskModes":
        return _disk_modes(self.size, self.clamped)

    def _derivative(self, positions: Array, order: Order) -> Array:
        R = self.patch.a / 2
        x, y = (positions.T - R) / R
        on = np.hypot(x, y) <= 1 + _ROUNDING
        values = np.full((len(positions), self.size), np.nan)
        values[on] = self._modes.derivative(x[on] + 1j * y[on], order) / R ** sum(order)
        return values

    def _place(self, x: float, y: float) -> Array:
        R = self.patch.a / 2
        z = complex(x - R, y - R) / R
        if not abs(z) <= 1 + _ROUNDING:
            return np.full((len(ORDERS), self.size), np.nan)
        return self._modes.jet(z, R)

    def quadrature(self) -> tuple[Array, Array]:
        """Points (Q, 2) in m and weights (Q,) in m^2: Gauss along the radius, even in angle."""
        R, modes = self.patch.a / 2, self._modes
        r, w = gauss(1.0, int(modes.k[-1]) + 20)
        count = 2 * int(modes.m.max()) + 8
        angle = 2 * np.pi * np.arange(count) / count
        direction = np.column_stack([np.cos(angle), np.sin(angle)])
        points = R + R * np.multiply.outer(r, direction).reshape(-1, 2)
        return points, np.repeat(R**2 * w * r * 2 * np.pi / count, count)


# With z = x + i y the derivatives of J_m(k r) e^(i m theta) along D- = d/dx - i d/dy and
# D+ = d/dx + i d/dy are k J_m-1 e^(i (m-1) theta) and -k J_m+1 e^(i (m+1) theta), those of I_m the
# same with +: no division by r, so that they are regular at the centre. Each derivative along x
# and y as a sum of factors times the steps D-^p D+^q:
_STEPS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
_BY_STEPS = np.array(
    [
        [1, 0, 0, 0, 0, 0],
        [0, 1 / 2, 1 / 2, 0, 0, 0],
        [0, 1j / 2, -1j / 2, 0, 0, 0],
        [0, 0, 0, 1 / 4, 1 / 2, 1 / 4],
        [0, 0, 0, 1j / 4, 0, -1j / 4],
        [0, 0, 0, -1 / 4, 1 / 2, -1 / 4],
    ]
)
_TURNS = np.array([q - p for p, q in _STEPS])
_SUMS = np.array([[sum(order)] for order in ORDERS])


class _DiskModes:
    """The first `count` modes on the disk of radius 1, their radial parts as Chebyshev series."""

    def __init__(self, count: int, clamped: bool) -> None:
        self.k, self.m, self._columns = _lowest(count, clamped)
        self._degrees = np.arange(int(self.k[-1] / 2) + 33)  # resolve k r, then to rounding
        r, w = gauss(1.0, int(self.k[-1]) + 20)
        around = np.where(self.m > 0, 0.5, 1.0)
        mean_square = 2 * (w * r) @ self._radial(r, 0, 0) ** 2 * around
        nodes = np.pi * (self._degrees + 0.5) / len(self._degrees)
        to_series = 2 / len(nodes) * np.cos(np.multiply.outer(self._degrees, nodes))
        to_series[0] /= 2
        at_nodes = np.stack([self._radial((1 + np.cos(nodes)) / 2, *step) for step in _STEPS])
        self._series = to_series @ at_nodes / (2 * np.sqrt(mean_square))
        self._flat = np.hstack(list(self._series))

    def _radial(self, r: Array, p: int, q: int) -> Array:
        """The radial part of D-^p D+^q of the pairs of modes, (P, U), at `r` (P,)."""
        k, m, kr = self.k, self.m, np.multiply.outer(r, self.k)
        growing: Array = (
            scipy.special.ive(m - p + q, kr) / scipy.special.ive(m, k) * np.exp(kr - k)
        )  # I_m-p+q(k r)/I_m(k)
        return k ** (p + q) * (
            (-1.0) ** q * scipy.special.jv(m - p + q, kr) - scipy.special.jv(m, k) * growing
        )

    def derivative(self, z: Complex, order: Order) -> Array:
        """The derivatives (P, N) of one order at the points z = x + i y (P,) of the disk."""
        t = np.arccos(np.clip(2 * np.abs(z) - 1, -1, 1))
        polynomials = np.cos(np.multiply.outer(t, self._degrees))
        turn = np.exp(1j * np.angle(z))[:, None]
        values = np.zeros((len(z), len(self.m)), complex)
        for step, factor in enumerate(_BY_STEPS[ORDERS.index(order)]):
            if factor:
                values += factor * turn ** _TURNS[step] * (polynomials @ self._series[step])
        return self._parts(values * np.exp(1j * np.multiply.outer(np.angle(z), self.m)))

    def jet(self, z: complex, R: float) -> Array:
        """All derivatives (6, N) at one point, z = x + i y on the disk of radius 1, of radius R."""
        r, angle = cmath.polar(z)
        t = math.acos(min(max(2 * r - 1, -1.0), 1.0))
        steps = np.cos(t * self._degrees).dot(self._flat).reshape(6, -1)
        turn = cmath.rect(1.0, angle)
        turned: Complex = _BY_STEPS * turn**_TURNS / R**_SUMS
        values: Complex = (turned @ steps) * turn**self.m
        return self._parts(values)

    def _parts(self, values: Complex) -> Array:
        """The modes (..., N): the real parts of `values` (..., U) are cosines, the others sines."""
        return values.view(float).take(self._columns, axis=-1)


_disk_modes = lru_cache(8)(_DiskModes)


def _lowest(count: int, clamped: bool) -> tuple[Array, Array, NDArray[np.intp]]:
    """k and m (U,) of the pairs of modes, and which real (2 u) or imaginary part each mode is."""
    most = 2 * np.sqrt(count) + 6  # Weyl's law, with room for the edge
    found = [(k, m) for m in range(int(most) + 1) for k in _frequencies(m, most, clamped)]
    k, m = np.array(sorted(found)).T
    parts = np.flatnonzero(np.column_stack([np.ones_like(m), m]).ravel())[:count]
    pairs = parts[-1] // 2 + 1
    return k[:pairs], m[:pairs], parts


def _frequencies(m: int, most: float, clamped: bool) -> list[float]:
    """The roots k up to `most` of the edge's equation, one between two zeros of J_m."""
    from scipy.optimize import brentq  # slow to import, and seldom needed

    def edge(k: float) -> float:
        turning = 0.0 if clamped else 2 * k / (1 - _POISSON)
        return float(
            scipy.special.jv(m + 1, k)
            + scipy.special.jv(m, k)
            * (scipy.special.ive(m + 1, k) / scipy.special.ive(m, k) - turning)
        )

    zeros = scipy.special.jn_zeros(m, int(most / np.pi) + 2)
    low = zeros[:-1] if clamped else [max(m, 1), *zeros[:-1]]
    high = zeros[1:] if clamped else zeros
    roots = [brentq(edge, a, b, xtol=1e-13) for a, b in zip(low, high, strict=True) if a < most]
    return [root for root in roots if root <= most]


_STRAIGHT, _BLUNT = 1e-6, math.radians(35)  # turns at a corner: none, and too little to be one


@dataclass(frozen=True)
class PolygonBasis(ModeBasis):
    """The vibration modes of a polygonal plate, hinged or `clamped`, by finite elements.

    They meet the edge exactly and have continuous slopes. A hinged polygon with ever more corners
    does not become a hinged round plate: where two edges meet the slope vanishes, so that it turns
    as stiff as a clamped one (Babuska's paradox); blunt corners are refused.
    """

    clamped: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        angle = np.abs(self._polygon.outline.turns)
        blunt = (angle > _STRAIGHT) & (angle < _BLUNT)
        if blunt.any() and not self.clamped:
            raise Refusal(
                f"the outline turns by only {math.degrees(angle[blunt][0]):.3g} degrees at vertex "
                f"{int(np.argmax(blunt))}: hinged there it would be as stiff as clamped; use a "
                "disk, fewer corners, or clamped edges"
            )

    @property
    def _polygon(self) -> Polygon:
        if not isinstance(self.patch, Polygon):
            raise Refusal(f"expected a polygon, got a {self.patch.name}")
        return self.patch

    @cached_property
    def _modes(self) -> "PlateModes":
        # scipy.sparse and scipy.spatial are slow to import, and seldom needed.
        from kappaskin.bases.argyris import plate_modes

        return plate_modes(self._polygon.vertices, self.size, self.clamped)

    def _derivative(self, positions: Array, order: Order) -> Array:
        return self._modes.functions.derivative(positions, order)

    def _place(self, x: float, y: float) -> Array:
        return self._modes.functions.jet(x, y)

    def quadrature(self) -> tuple[Array, Array]:
        """Points (Q, 2) in m and weights (Q,) in m^2: exact for two quintics on each triangle."""
        return self._modes.points, self._modes.weights
