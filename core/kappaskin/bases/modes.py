"""Bases of whole skins: vibration modes of disks and polygons, polynomials of caps."""

import cmath
import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, ClassVar, cast

import numpy as np
import scipy
from numpy.typing import NDArray

from kappaskin.bases.basis import ORDERS, FunctionBasis, Order, PointMap
from kappaskin.bases.product import gauss
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.skin import Cap, Disk, MeshSkin, Polygon

if TYPE_CHECKING:
    from kappaskin.bases.argyris import PlateModes
    from kappaskin.bases.mesh import MeshFunctions


@dataclass(frozen=True)
class ModeBasis(FunctionBasis):
    """Ni x Nj functions of a whole skin; their mean square is 1/4, as that of sines.

    Of a flat skin they are the first modes by frequency.
    """

    MOST: ClassVar = 1024  # more take minutes to make

    def __post_init__(self) -> None:
        if not (self.Ni > 0 and self.Nj > 0 and self.size <= self.MOST):
            raise Refusal(
                f"expected 1 x 1 to {self.MOST} functions on a {self.patch.name}, got "
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
        return PointMap.of(lambda points: self.at(points, dx, dy), x, y)


Complex = NDArray[np.complex128]

_ROUNDING = 1e-9  # of the radius: gages that end on the rim may stand this far outside
_POISSON = 0.3  # of the plate whose hinged modes these are


@dataclass(frozen=True)
class RoundBasis(ModeBasis):
    """Functions of the radius times cos m theta or sin m theta, in the box of a disk."""

    clamped: bool = False

    @abstractmethod
    def _made(self) -> "_PolarFunctions":
        """Them on the disk of radius 1."""

    @cached_property
    def _functions(self) -> "_PolarFunctions":
        return self._made()

    def _derivative(self, positions: Array, order: Order) -> Array:
        R = self.patch.a / 2
        x, y = (positions.T - R) / R
        on = np.hypot(x, y) <= 1 + _ROUNDING
        values = np.full((len(positions), self.size), np.nan)
        values[on] = self._functions.derivative(x[on] + 1j * y[on], order) / R ** sum(order)
        return values

    def weighed(self, positions: Array, weights: Array) -> Array:
        """The sum (N,) of each function at `positions` (P, 2) in m, by `weights` (P,)."""
        R = self.patch.a / 2
        x, y = (positions.T - R) / R
        return self._functions.weighed(x + 1j * y, weights)

    def _place(self, x: float, y: float, count: int) -> Array:
        R = self.patch.a / 2
        z = complex(x - R, y - R) / R
        if not abs(z) <= 1 + _ROUNDING:
            return np.full((count, self.size), np.nan)
        return self._functions.jet(z, R, count)

    def quadrature(self) -> tuple[Array, Array]:
        """Points (Q, 2) in m and weights (Q,) in m^2: Gauss along the radius, even in angle."""
        R, functions = self.patch.a / 2, self._functions
        r, w = gauss(1.0, functions.fineness + 20)
        count = 2 * int(functions.m.max()) + 8
        angle = 2 * np.pi * np.arange(count) / count
        direction = np.column_stack([np.cos(angle), np.sin(angle)])
        points = R + R * np.multiply.outer(r, direction).reshape(-1, 2)
        return points, np.repeat(R * w * self._parallel(R * r) * 2 * np.pi / count, count)

    def _parallel(self, distance: Array) -> Array:
        """Radius in m of the parallel at each `distance` in m from the middle."""
        return distance


@dataclass(frozen=True)
class DiskBasis(RoundBasis):
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

    def __post_init__(self) -> None:
        super().__post_init__()
        if type(self.patch) is not Disk:
            raise Refusal(f"expected a disk, got a {self.patch.name}")

    def _made(self) -> "_PolarFunctions":
        return _disk_modes(self.size, self.clamped)


@dataclass(frozen=True)
class CapBasis(RoundBasis):
    """Polynomials on a cap: Ni along its meridian, times Nj of 1, cos t, sin t, cos 2t ... around.

    With r = 1 at the rim they are r^m (1 - r^2) P_i(2 r^2 - 1) times cos m t or sin m t, with the
    Jacobi polynomials P_i = P_i^(2, m) that make them orthogonal on the disk; clamped,
    (1 - r^2)^2 and P_i^(4, m). All are smooth at the pole and vanish at the rim, clamped with their
    slope.
    """

    MOST: ClassVar = 8192

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.patch, Cap):
            raise Refusal(f"expected a cap, got a {self.patch.name}")

    @property
    def cap(self) -> Cap:
        return cast("Cap", self.patch)

    @property
    def free(self) -> Array | None:
        """On a hemisphere, or nearly one, those without a part that moves along its axis.

        To move so changes no curvature, on a clamped one but at its rim, where what is finer than
        the functions looks the same: of all shapes that explain the readings it is the least.
        """
        return self._bent if self.cap.moves_as_a_whole else None

    @cached_property
    def _bent(self) -> Array:
        points, weights = self.quadrature()
        moved = (weights * self.cap.at_rest(points)[1][:, 2]) @ self.at(points)
        return np.linalg.qr(moved[:, None], mode="complete")[0][:, 1:]

    def _made(self) -> "_PolarFunctions":
        return _cap_functions(*self.shape, self.clamped)

    def _parallel(self, distance: Array) -> Array:
        return self.cap.meridian(distance).radius

    def along(self, r: Array, orders: int = 3) -> Array:
        """Each function along a meridian, and its derivatives, (`orders`, Q, M, Ni).

        At the shares `r` (Q,) of the arc to the rim, and by them; for m = 0 to M - 1.
        """
        return radial(r, np.arange(self.Nj // 2 + 1), self.Ni, 1 + self.clamped, orders)

    def around_pole(self, r: Array) -> Array:
        """f, f', m f / r, f'', m (f' / r - f / r^2) and f' / r - m^2 f / r^2, (6, Q, M, Ni).

        As `along`, of functions f that go as cos m t or sin m t around. No division by r: they are
        regular at the pole.
        """
        f, down, up, *second = _jacobi(r, np.arange(self.Nj // 2 + 1), self.Ni, 1 + self.clamped)
        both, twist = (second[0] + second[2]) / 4, (second[0] - second[2]) / 4
        mixed = second[1] / 2
        return np.stack([f, (down + up) / 2, (down - up) / 2, both + mixed, twist, mixed - both])


def radial(r: Array, m: NDArray[np.intp], count: int, k: int, orders: int = 3) -> Array:
    """r^m (1 - r^2)^k P_i(2 r^2 - 1) and derivatives, (`orders`, Q, M, count), at `r` (Q,).

    For each of `m` (M,). P_i = P_i^(2k, m), i < count. Their mean square over the disk, times that
    of cos m t, is 1/4. At most two derivatives.
    """
    G, (m, r) = _scaled(r, m, count, k, orders), (m[:, None], r[:, None, None])
    found = np.empty((orders, *G[0].shape))
    np.multiply(r**m, G[0], found[0])
    if orders > 1:
        found[1] = m * r ** np.maximum(m - 1, 0) * G[0] + 2 * r ** (m + 1) * G[1]
    if orders > 2:
        found[2] = m * (m - 1) * r ** np.maximum(m - 2, 0) * G[0]
        found[2] += (4 * m + 2) * r**m * G[1] + 4 * r ** (m + 2) * G[2]
    return found


def _scaled(r: Array, m: NDArray[np.intp], count: int, k: int, orders: int) -> list[Array]:
    """The functions of `radial` over r^m, (Q, M, count), and derivatives by r^2."""
    i, m, t = np.arange(count), m[:, None], r[:, None, None] ** 2
    share = np.prod([(i + d) / (i + m + d) for d in range(1, 2 * k + 1)], axis=0)
    mean_square = share / (2 * i + 2 * k + m + 1) * np.where(m > 0, 0.5, 1.0)
    scale = 1 / (2 * np.sqrt(mean_square))
    P, rest = list[Array](), list[Array]()  # P(2 t - 1), (1 - t)^k, and derivatives by t
    for d in range(orders):
        rising = np.prod([i + 2 * k + m + 1 + e for e in range(d)], axis=0) * scale
        P.append(rising * _polynomials(2 * k + d, m[:, 0] + d, count, 2 * t[..., 0] - 1, d))
        rest.append((-1.0) ** d * math.perm(k, d) * (1 - t) ** max(k - d, 0))
    return [
        sum((math.comb(d, e) * rest[d - e] * P[e] for e in range(1, d + 1)), rest[d] * P[0])
        for d in range(orders)
    ]


def _jacobi(r: Array, m: NDArray[np.intp], count: int, k: int) -> Array:
    """Radial parts (6, Q, M, count) of the functions of `radial` by `_STEPS`."""
    (G, G1, G2), (m, r) = _scaled(r, m, count, k, 3), (m[:, None], r[:, None, None])
    # With r^m G(r^2) D- adds 2 m r^(m-1) G + 2 r^(m+1) G', D+ 2 r^(m+1) G', and so on.
    below, two_below = r ** np.maximum(m - 1, 0), r ** np.maximum(m - 2, 0)
    up, twice = 2 * r ** (m + 1) * G1, 4 * r ** (m + 2) * G2
    steps = [
        r**m * G,
        2 * m * below * G + up,
        up,
        4 * m * (m - 1) * two_below * G + 8 * m * r**m * G1 + twice,
        4 * (m + 1) * r**m * G1 + twice,
        twice,
    ]
    return np.stack(steps)


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


def _polynomials(a: int, b: NDArray[np.intp], count: int, x: Array, skipped: int) -> Array:
    """Jacobi polynomials P_i^(a, b) (Q, M, count) at `x` (Q, 1), for each of `b` (M,).

    After as many zeros as are `skipped`. By their three-term recurrence.
    """
    found = np.zeros((count + 3, len(x), len(b)))
    own = found[skipped:]
    own[0], own[1] = 1.0, a + 1 + (a + b + 2) * (x - 1) / 2
    for i in range(2, count - skipped):
        c = 2 * i + a + b
        below = 2 * i * (i + a + b) * (c - 2)
        ahead = (c - 1) / below * (c * (c - 2) * x + (a - b) * (a + b)) * own[i - 1]
        own[i] = ahead - 2 * (i + a - 1) * (i + b - 1) * c / below * own[i - 2]
    return np.moveaxis(found[:count], 0, 2)


class _PolarFunctions:
    """Functions on the disk of radius 1, their radial parts as Chebyshev series.

    They are the real and imaginary parts of U radial functions times e^(i m theta), with `m` (U,);
    `columns` (N,) are 2 u of the real part of the function u, 2 u + 1 of the imaginary one.
    `parts` gives the radial parts (6, P, U) by `_STEPS` at r (P,). `fineness` is that of them, as
    the argument k r of Bessel functions.
    """

    def __init__(
        self,
        m: Array,
        columns: NDArray[np.intp],
        fineness: int,
        parts: Callable[[Array], Array],
    ) -> None:
        self.m, self._columns, self.fineness = m, columns, fineness
        self._turns, self._which = np.unique(m, return_inverse=True)
        self._degrees = np.arange(fineness // 2 + 33)  # resolve k r, then to rounding
        nodes = np.pi * (self._degrees + 0.5) / len(self._degrees)
        to_series = 2 / len(nodes) * np.cos(np.multiply.outer(self._degrees, nodes))
        to_series[0] /= 2
        self._series = to_series @ parts((1 + np.cos(nodes)) / 2)
        self._flat = np.hstack(list(self._series))

    def _factors(self, z: Complex) -> tuple[Array, Complex]:
        """Chebyshev's polynomials (P, D) of the radius, and e^(i m angle) (P, M), at z (P,)."""
        t = np.arccos(np.clip(2 * np.abs(z) - 1, -1, 1))
        turns = np.exp(1j * np.multiply.outer(np.angle(z), self._turns))
        return np.cos(np.multiply.outer(t, self._degrees)), turns

    def weighed(self, z: Complex, weights: Array) -> Array:
        """The sums (N,) of the modes at the points z = x + i y (P,) of the disk, by `weights`."""
        polynomials, turns = self._factors(z)
        by_turn = polynomials.T @ (weights[:, None] * turns)  # before there are so many functions
        return self._parts((self._series[0] * by_turn[:, self._which]).sum(axis=0))

    def derivative(self, z: Complex, order: Order) -> Array:
        """The derivatives (P, N) of one order at the points z = x + i y (P,) of the disk."""
        polynomials, turns = self._factors(z)
        turn = np.exp(1j * np.angle(z))[:, None]
        values = np.zeros((len(z), len(self.m)), complex)
        for step, factor in enumerate(_BY_STEPS[ORDERS.index(order)]):
            if factor:
                values += factor * turn ** _TURNS[step] * (polynomials @ self._series[step])
        return self._parts(values * turns[:, self._which])

    def jet(self, z: complex, R: float, count: int) -> Array:
        """The first `count` derivatives (count, N) at one point.

        It is z = x + i y on the disk of radius 1, of radius R.
        """
        r, angle = cmath.polar(z)
        t = math.acos(min(max(2 * r - 1, -1.0), 1.0))
        series = self._flat[:, : count * len(self.m)]
        steps = np.cos(t * self._degrees).dot(series).reshape(count, -1)
        turned: Complex = _BY_STEPS[:count, :count] * cmath.rect(1.0, angle) ** _TURNS[:count]
        turns: Complex = np.exp(1j * angle * self._turns)  # far quicker than powers
        values: Complex = (turned / R ** _SUMS[:count]).dot(steps)
        values *= turns.take(self._which)
        return self._parts(values)

    def _parts(self, values: Complex) -> Array:
        """The modes (..., N): the real parts of `values` (..., U) are cosines, the others sines."""
        return values.view(float).take(self._columns, axis=-1)


@lru_cache(8)
def _cap_functions(Ni: int, Nj: int, clamped: bool) -> _PolarFunctions:
    around = np.arange(Nj // 2 + 1)
    i, j = np.divmod(np.arange(Ni * Nj), Nj)
    columns = 2 * (i * len(around) + (j + 1) // 2) + (j > 0) * (1 - j % 2)

    def parts(r: Array) -> Array:
        return np.swapaxes(_jacobi(r, around, Ni, 1 + clamped), 2, 3).reshape(6, len(r), -1)

    m = np.tile(around, Ni).astype(float)
    return _PolarFunctions(m, columns, 2 * (2 * Ni + len(around) + 4), parts)


@lru_cache(8)
def _disk_modes(count: int, clamped: bool) -> _PolarFunctions:
    """The first `count` modes."""
    k, m, columns = _lowest(count, clamped)
    fineness = int(k[-1])
    r, w = gauss(1.0, fineness + 20)
    mean_square = 2 * (w * r) @ _bessel(r, k, m, 0, 0) ** 2 * np.where(m > 0, 0.5, 1.0)

    def parts(r: Array) -> Array:
        at = [_bessel(r, k, m, *step) for step in _STEPS]
        return np.stack(at) / (2 * np.sqrt(mean_square))

    return _PolarFunctions(m, columns, fineness, parts)


def _bessel(r: Array, k: Array, m: Array, p: int, q: int) -> Array:
    """The radial part of D-^p D+^q of the pairs of modes, (P, U), at `r` (P,)."""
    kr = np.multiply.outer(r, k)
    growing: Array = (
        scipy.special.ive(m - p + q, kr) / scipy.special.ive(m, k) * np.exp(kr - k)
    )  # I_m-p+q(k r)/I_m(k)
    return k ** (p + q) * (
        (-1.0) ** q * scipy.special.jv(m - p + q, kr) - scipy.special.jv(m, k) * growing
    )


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

    def _place(self, x: float, y: float, count: int) -> Array:
        return self._modes.functions.jet(x, y, count)

    def quadrature(self) -> tuple[Array, Array]:
        """Points (Q, 2) in m and weights (Q,) in m^2: exact for two quintics on each triangle."""
        return self._modes.points, self._modes.weights


def most_functions(mesh: MeshSkin) -> int:
    """How many functions a mesh has nodes for."""
    return len(mesh.points) // 4  # two loads for each, of two nodes each


@dataclass(frozen=True)
class MeshBasis(ModeBasis):
    """The softest shapes of a mesh, hinged or `clamped` where it is held, by finite elements.

    Combinations of what loads all over it make; the tangential displacements of a bent skin are in
    them. For a skin of the mesh's thickness and Poisson's ratio 0.3, they do not mix.
    """

    clamped: bool = False

    @property
    def mesh(self) -> MeshSkin:
        if not isinstance(self.patch, MeshSkin):
            raise Refusal(f"expected a mesh, got a {self.patch.name}")
        return self.patch

    @property
    def edge(self) -> str:
        return "clamped" if self.clamped else "hinged"

    @cached_property
    def functions(self) -> "MeshFunctions":
        # scipy.sparse is slow to import, and seldom needed.
        from kappaskin.bases.mesh import mesh_functions

        return mesh_functions(self.mesh, self.edge, self.size)

    def _derivative(self, positions: Array, order: Order) -> Array:
        values = np.full((len(positions), self.size), np.nan)
        on = self.patch.contains(positions)
        design = self.mesh.splines.design(positions[on], *order)
        values[on] = design @ self.functions.values
        return values

    def _place(self, x: float, y: float, count: int) -> Array:
        if not self.mesh.holds(x, y):
            return np.full((count, self.size), np.nan)
        return self.mesh.splines.jet(self.functions.values, x, y, count)

    def curvature_at(self, positions: Array) -> Array:
        """Curvature xx, yy, xy (3, P, N) in 1/m per m of each function; NaN off the skin."""
        found = np.full((3, len(positions), self.size), np.nan)
        on = self.patch.contains(positions)
        found[:, on] = self.functions.curvature_at(positions[on])
        return found

    def quadrature(self) -> tuple[Array, Array]:
        """Points (Q, 2) in m and weights (Q,) in m^2: the middles of all sides of triangles."""
        mesh = self.mesh
        corners, flat = mesh.points[mesh.triangles], mesh.places[mesh.triangles]
        middles = (flat + np.roll(flat, 1, axis=1)) / 2
        u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area: Array = np.linalg.norm(np.cross(u, v), axis=1) / 2
        return middles.reshape(-1, 2), np.repeat(area / 3, 3)
