"""Product bases on a rectangle: sines, clamped beams, and sines with an elastic rim."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from kappaskin.bases.basis import ORDERS, Basis, FunctionBasis, Order
from kappaskin.errors import Refusal
from kappaskin.frames import Array

_IN_X, _IN_Y = np.array(ORDERS, np.intp).T
_ALIKE = np.array([[1.0], [0.0], [0.0]])  # along y of a strip


@dataclass(frozen=True, eq=False)
class GridMap:
    """A map from coefficients to values on a grid, as one matrix along x and one along y."""

    X: Array
    Y: Array

    def __call__(self, coefficients: Array) -> Array:
        """Values (..., ny, nx) for `coefficients` (..., Ni, Nj)."""
        if coefficients.ndim == 2:
            return self.Y.dot(coefficients.T).dot(self.X.T)  # a quarter faster for one frame
        return self.Y @ np.swapaxes(coefficients, -1, -2) @ self.X.T


@dataclass(frozen=True)
class ProductBasis(FunctionBasis):
    """Ni x Nj products of Ni functions of x and Nj functions of y on a rectangle.

    On a strip they are the Ni functions of x alone, constant along y (Nj = 1).
    """

    def __post_init__(self) -> None:
        if self.Ni < 1 or self.Nj < 1:
            raise Refusal(f"expected at least 1 x 1 functions, got {self.Ni} x {self.Nj}")
        if self.patch.strip and self.Nj != 1:
            raise Refusal(
                f"a strip is constant along y: expected {self.Ni} x 1 functions, got "
                f"{self.Ni} x {self.Nj}"
            )

    @abstractmethod
    def _along(self, x: Array, length: float, count: int, derivative: int) -> Array:
        """Derivatives (P, count) of `count` functions on [0, `length`] at `x` (P,).

        Of order -1 it is the integral whose values at 0 and `length` cancel.
        """

    @abstractmethod
    def _factors(self, x: float, y: float) -> tuple[Array, Array]:
        """What every derivative at one point is a product of: in x (6, Ni), and in y (6, Nj)."""

    def _along_x(self, x: Array, derivative: int) -> Array:
        if derivative not in (-1, 0, 1, 2):
            raise Refusal(f"expected a derivative of order -1 to 2, got {derivative}")
        return self._along(x, self.patch.a, self.Ni, derivative)

    def _along_y(self, y: Array, derivative: int) -> Array:
        if derivative not in (0, 1, 2):
            raise Refusal(f"expected a derivative of order 0, 1 or 2 along y, got {derivative}")
        if self.patch.strip:
            return np.full((len(y), 1), float(derivative == 0))
        return self._along(y, self.patch.b, self.Nj, derivative)

    def _place(self, x: float, y: float, count: int) -> Array:
        in_x, in_y = self._factors(x, y)
        return (in_x[:count, :, None] * in_y[:count, None, :]).reshape(count, self.size)

    def value(self, x: float, y: float, coefficients: Array) -> float:
        in_x, in_y = self._factors(x, y)
        return float(in_x[0].dot(coefficients).dot(in_y[0]))

    def at(self, positions: Array, dx: int = 0, dy: int = 0) -> Array:
        """Every function's derivative of order `dx`, `dy`, (P, Ni Nj), at `positions` (P, 2)."""
        X, Y = self._along_x(positions[:, 0], dx), self._along_y(positions[:, 1], dy)
        return (X[:, :, None] * Y[:, None, :]).reshape(len(positions), self.size)

    def on_grid(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> GridMap:
        """The map from coefficients to that derivative on the grid of `x` (nx,), `y` (ny,)."""
        return GridMap(self._along_x(x, dx), self._along_y(y, dy))

    @cached_property
    def _rules(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Points and weights along x and along y: Gauss, exact to rounding."""
        along_y = 1 if self.patch.strip else 2 * self.Nj + 16
        return gauss(self.patch.a, 2 * self.Ni + 16), gauss(self.patch.b, along_y)

    def quadrature(self) -> tuple[Array, Array]:
        """Points (Q, 2) in m and weights (Q,) in m^2: Gauss, exact to rounding."""
        (x, wx), (y, wy) = self._rules
        points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        return points, np.multiply.outer(wx, wy).ravel()

    def volumes(self) -> Array:
        """The integral (N,) in m^2 of each function."""
        (x, wx), (y, wy) = self._rules
        volumes = np.kron(wx @ self._along_x(x, 0), wy @ self._along_y(y, 0))
        return volumes.astype(float)

    def overlap(self, one: Order, other: Order) -> Array:
        """The integrals (N, N) of one derivative of each function times another of each.

        Of products they are products of an integral along x and one along y.
        """
        (x, wx), (y, wy) = self._rules
        along_x: Array = (self._along_x(x, one[0]).T * wx) @ self._along_x(x, other[0])
        along_y: Array = (self._along_y(y, one[1]).T * wy) @ self._along_y(y, other[1])
        return np.kron(along_x, along_y).astype(float)

    def _without_mean(self, means: Array) -> Array:
        """The combinations (N, N - Nj) of products whose factor along x has no mean.

        Of `means` (Ni,) of the functions of x the first is not zero: it is eliminated.
        """
        along_x: Array = np.vstack([-means[1:] / means[0], np.eye(self.Ni - 1)])
        return np.kron(along_x, np.eye(self.Nj)).astype(float)


class JetProductBasis(ProductBasis):
    """Products of functions that are evaluated at one point of a side at a time."""

    @abstractmethod
    def _jet(self, x: float, length: float, count: int) -> Array:
        """Values, slopes and second derivatives (3, count) of the same at one place."""

    def _factors(self, x: float, y: float) -> tuple[Array, Array]:
        X = self._jet(x, self.patch.a, self.Ni)
        Y = _ALIKE if self.patch.strip else self._jet(y, self.patch.b, self.Nj)
        return X[_IN_X], Y[_IN_Y]


def gauss(length: float, count: int) -> tuple[Array, Array]:
    """Gauss-Legendre points (count,) and weights (count,) on [0, length]."""
    t, w = np.polynomial.legendre.leggauss(count)
    return (t + 1) * length / 2, w * length / 2


@dataclass(frozen=True)
class SineBasis(ProductBasis):
    """The Ni x Nj products sin(i pi x/a) sin(j pi y/b), zero along the edges (Eq. 1).

    The ends of a bent skin are pinned and it is inextensible, so that f has no mean along the arc;
    with `sliding` ends it may have one.
    """

    sliding: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self._pinned and self.Ni < 2:
            raise Refusal(
                "a pinned inextensible arc cannot bend with one function only: expected at "
                "least 2 functions along x, got 1; use more, or let the ends slide"
            )

    @property
    def _pinned(self) -> bool:
        return self.patch.arc_curvature > 0 and not self.sliding

    @property
    def free(self) -> Array | None:
        """On a pinned arc, c_1 = - sum over odd i >= 3 of c_i / i leaves Ni - 1 of Ni."""
        return self._inextensible if self._pinned else None

    @cached_property
    def _inextensible(self) -> Array:
        i = np.arange(1, self.Ni + 1)
        return self._without_mean(np.where(i % 2, 1 / i, 0.0))

    @cached_property
    def wavenumbers(self) -> tuple[Array, Array]:
        """Wave numbers i pi/a (Ni,) and j pi/b (Nj,) in rad/m; 0 along y of a strip."""
        ki, kj = _wavenumbers(self.patch.a, self.Ni), _wavenumbers(self.patch.b, self.Nj)
        return ki, kj * (not self.patch.strip)

    @cached_property
    def laplacian(self) -> Array:
        """Eigenvalues k_i^2 + k_j^2 of minus the Laplacian, (Ni, Nj) in 1/m^2."""
        ki, kj = self.wavenumbers
        return np.add.outer(ki**2, kj**2)

    def _along(self, x: Array, length: float, count: int, derivative: int) -> Array:
        k = _wavenumbers(length, count)
        kx = np.multiply.outer(x, k)
        if derivative == 0:
            return np.sin(kx)
        if derivative == -1:
            return ((1 + np.cos(k * length)) / 2 - np.cos(kx)) / k
        return k * np.cos(kx) if derivative == 1 else -(k**2) * np.sin(kx)

    @cached_property
    def _waves(self) -> "_Waves":
        return _Waves(*self.wavenumbers)

    def _factors(self, x: float, y: float) -> tuple[Array, Array]:
        factors = self._waves(x, y)
        return factors[:, : self.Ni], factors[:, self.Ni :]


class _Waves:
    """Sines of x and of y with their derivatives, all from one exponential."""

    def __init__(self, ki: Array, kj: Array) -> None:
        k = np.concatenate([ki, kj])
        of_y = np.arange(len(k)) >= len(ki)
        self._turns = 1j * np.stack([k * ~of_y, k * of_y])
        order = np.array([[dx] * len(ki) + [dy] * len(kj) for dx, dy in ORDERS], np.intp)
        cosines = (order % 2 == 1) | (k == 0)  # on a strip: one, which is the cosine of nothing
        self._which: NDArray[np.intp] = 2 * np.arange(len(k)) + ~cosines
        self._times: Array = k**order * np.where(order == 2, -1, 1)

    def __call__(self, x: float, y: float) -> Array:
        """Derivatives (6, Ni + Nj) along x and y, in the order of `ORDERS`."""
        values = np.exp(np.dot((x, y), self._turns)).view(float).take(self._which)
        values *= self._times
        return values


@lru_cache(64)
def _wavenumbers(length: float, count: int) -> Array:
    """The wave numbers i pi/length (count,) in rad/m, from i = 1 on."""
    return np.arange(1.0, count + 1) * np.pi / length


@dataclass(frozen=True)
class ClampedBasis(JetProductBasis):
    """The Ni x Nj products of clamped-beam modes: value and slope vanish along the edges.

    Between the edges they are nearly sines, so that elements at cell centres tell them apart as
    well; a smooth shape's coefficients fall as 1/k^5, its curvature converges as N^(-5/2). Their
    mean square is a sine's, 1/2 along each side. A bent skin is inextensible: f has no mean along
    the arc. With the `tip` free they are a cantilever's, of a flat strip: clamped at x = 0, without
    moment and shear force at x = a.
    """

    tip: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.tip and (not self.patch.strip or self.patch.arc_curvature):
            raise Refusal(
                f"expected a flat strip for a cantilever, got a {self.patch.name} with a base "
                f"curvature of {self.patch.arc_curvature:g} 1/m; select another edge"
            )
        if self.patch.arc_curvature and self.Ni < 2:
            raise Refusal(
                "a clamped inextensible arc cannot bend with one function only: expected at "
                "least 2 functions along x, got 1"
            )

    @property
    def free(self) -> Array | None:
        """On an arc, that the mean along x vanishes leaves Ni - 1 of Ni."""
        return self._inextensible if self.patch.arc_curvature else None

    @cached_property
    def _inextensible(self) -> Array:
        ends = self._along_x(np.array([0.0, self.patch.a]), -1)
        return self._without_mean(ends[1] - ends[0])

    def _along(self, x: Array, length: float, count: int, derivative: int) -> Array:
        values = _beam(x / length - 0.5, count, self.tip, derivative)[0]
        if derivative < 0:
            values -= _beam(np.array([-0.5, 0.5]), count, self.tip, -1)[0].mean(axis=0)
        return values * length**-derivative

    def _jet(self, x: float, length: float, count: int) -> Array:
        jet = _beam(np.array([x / length - 0.5]), count, self.tip, 0, 1, 2)[:, 0]
        jet[1] /= length
        jet[2] /= length**2
        return jet


def _beam(s: Array, count: int, tip: bool, *orders: int) -> Array:
    """The derivatives (O, S, N) of the first `count` modes of a beam of length 1.

    With `s` (S,) from -1/2 to 1/2, even ones are cos(k s)/cos(k/2) - cosh(k s)/cosh(k/2), odd ones
    the same with sin and sinh, over sqrt(2). With a free `tip`, at x = s + 1/2, they are
    cosh(k x) - cos(k x) - r (sinh(k x) - sin(k x)), r = (cosh k + cos k)/(sinh k + sin k), over
    sqrt(2). cosh and sinh are decaying exponentials from either end, so that nothing overflows or
    cancels.
    """
    modes = _beam_modes(count, tip, orders)
    ks, half = np.multiply.outer(s, modes.k), modes.k / 2
    wave = modes.waves * np.sin(ks + modes.phases)
    return wave - modes.decays * (np.exp(ks - half) + modes.far * np.exp(-ks - half))


@dataclass(frozen=True, eq=False)
class _BeamModes:
    """Wave numbers k (N,); phases and factors (O, 1, N) of the waves, the decays and far ends."""

    k: Array
    phases: Array
    waves: Array
    decays: Array
    far: Array


@lru_cache(64)
def _beam_modes(count: int, tip: bool, orders: tuple[int, ...]) -> _BeamModes:
    """What the derivatives of `orders` share; k are the roots of cos k cosh k = 1 above zero.

    With a free `tip`, of cos k cosh k = -1.
    """
    right = -1.0 if tip else 1.0
    k = (np.arange(1.0, count + 1) + right / 2) * np.pi
    for _ in range(6):  # nearly: Newton's method does the rest
        sech = 2 * np.exp(-k) / (1 + np.exp(-2 * k))
        k -= (np.cos(k) - right * sech) / (right * sech * np.tanh(k) - np.sin(k))
    d = np.array(orders, float)[:, None, None]
    sign = np.where(np.arange(count) % 2, -1.0, 1.0)
    scale = k**d / np.sqrt(2)
    if tip:
        # The factor of exp(k x), (1 - r)/2, as that of exp(k (x - 1)); the other is (1 + r)/2.
        rising = (np.sin(k) - np.cos(k) - np.exp(-k)) / (
            1 - np.exp(-2 * k) + 2 * np.exp(-k) * np.sin(k)
        )
        r = 1 - 2 * rising * np.exp(-k)
        phase, waves = k / 2 - np.arctan2(1, r), np.hypot(1, r)
        decays, far = -rising, (1 + r) / 2 / rising
    else:
        phase = (1 + sign) * np.pi / 4
        waves, decays, far = 1 / np.sin(k / 2 + phase), 1 / (1 + sign * np.exp(-k)), sign
    phases = phase + d * np.pi / 2
    return _BeamModes(k, phases, scale * waves, scale * decays, far * (-1.0) ** d)


@dataclass(frozen=True)
class ElasticBasis(JetProductBasis):
    """The Ni x Nj products of 1, 2x/a - 1, sin(pi x/a), sin(2 pi x/a) ... and the same along y.

    Every shape with finite bending energy is a sum of them: along x, what is left of a function
    when the line through its ends is taken out vanishes at both, which sines are complete for.

    Readings of curvature see neither a translation nor a tilt: 1, x and y (1 and x on a strip) are
    `unobservable`, and of all shapes that explain the readings `free` keeps the one whose rim is
    nearest to rest. The fit's error bar says how far the rim may be from there.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.patch.arc_curvature:
            raise Refusal(
                f"expected a flat skin for an elastic rim, got a base radius of "
                f"{self.patch.radius:g} m; select hinged, clamped or sliding edges"
            )
        least = (3, 1) if self.patch.strip else (2, 2)
        if self.Ni < least[0] or self.Nj < least[1]:
            raise Refusal(
                "a translation and a tilt have no curvature: expected at least "
                f"{least[0]} x {least[1]} functions, got {self.Ni} x {self.Nj}"
            )

    def _along(self, x: Array, length: float, count: int, derivative: int) -> Array:
        if derivative < 0:
            raise Refusal("a flat skin needs no integral along x; expected an order of at least 0")
        k = np.arange(1.0, count - 1) * (np.pi / length)
        lines = np.zeros((len(x), 2))
        lines[:, 0] = derivative == 0
        lines[:, 1] = (2 * x / length - 1, 2 / length, 0)[derivative]
        waves = k**derivative * np.sin(np.multiply.outer(x, k) + derivative * np.pi / 2)
        return np.hstack([lines, waves])

    def _jet(self, x: float, length: float, count: int) -> Array:
        jet = np.zeros((3, count))
        jet[:2, :2] = (1, 2 * x / length - 1), (0, 2 / length)
        k = np.arange(1.0, count - 1) * (np.pi / length)
        jet[0, 2:] = sine = np.sin(k * x)
        jet[1, 2:], jet[2, 2:] = k * np.cos(k * x), -(k**2) * sine
        return jet

    def rim(self) -> tuple[Array, Array]:
        """Points (Q, 2) in m and weights (Q,) in m that integrate products along the rim."""
        (a, b), strip = (self.patch.a, self.patch.b), self.patch.strip
        x, along_x = gauss(a, 2 * self.Ni + 16)
        y, along_y = gauss(b, 1 if strip else 2 * self.Nj + 16)
        sides = [(end, y, along_y) for end in (0.0, a)]
        sides += [] if strip else [(x, end, along_x) for end in (0.0, b)]
        points = [np.column_stack(np.broadcast_arrays(*side[:2])) for side in sides]
        return np.vstack(points), np.concatenate([side[2] for side in sides])

    @property
    def _rigid(self) -> list[int]:
        """Which functions are 1, x and, but on a strip, y."""
        return [0, self.Nj] if self.patch.strip else [0, self.Nj, 1]

    @property
    def unobservable(self) -> Array:
        """The rigid shapes (N, 3), on a strip (N, 2), with unit RMS along the rim."""
        return self._unobservable

    @cached_property
    def _unobservable(self) -> Array:
        points, weights = self.rim()
        mean_square = weights @ self.at(points)[:, self._rigid] ** 2 / weights.sum()
        return np.eye(self.size)[:, self._rigid] / np.sqrt(mean_square)

    @property
    def free(self) -> Array:
        """Every other function less the rigid shape nearest to it along the rim, (N, N - 3)."""
        return self._nearest_to_rest

    @cached_property
    def _nearest_to_rest(self) -> Array:
        points, weights = self.rim()
        R = self.at(points)
        others = np.delete(np.eye(self.size), self._rigid, axis=1)
        # The rigid shapes are orthogonal along the rim, by its symmetry.
        share = (R @ self.unobservable).T * weights / weights.sum() @ R @ others
        return others - self.unobservable @ share


Overlaps = Callable[[Order, Order], Array]


def overlaps(basis: Basis) -> Overlaps:
    """A function of two orders: the integrals (N, N) of products of those derivatives in m^2."""
    if isinstance(basis, ProductBasis):
        return basis.overlap
    points, weights = basis.quadrature()

    @cache
    def at(order: Order) -> Array:
        return basis.at(points, *order)

    return lambda one, other: (at(one).T * weights) @ at(other)
