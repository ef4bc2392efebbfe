"""Influence of a load: what the elements read of a load at any place on the skin, of any size."""

import hashlib
import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial
from itertools import product
from typing import Any, Protocol, cast

import numpy as np
import scipy
from numpy.typing import NDArray

from kappaskin._files import cached
from kappaskin._processes import progress
from kappaskin.bases import Basis, CapBasis, MeshBasis, ProductBasis, SineBasis, basis_for
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Indices
from kappaskin.mechanics import CapWaves, Compliance, Plate, Shell, cap_shell
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Base, Cap, MeshSkin, Patch

Single = NDArray[np.float32]


class Influence(Protocol):
    """What C channels read of a load anywhere on a skin."""

    unit: float
    """The load in N that the readings are of."""
    sized: bool
    """Whether they depend on the size of the load; else they are those of a point load."""
    nodes: tuple[Array, Single] | None
    """Loads to search among, x, y and s (S, 3) each, and their readings (S, C); None for a grid."""

    def at(self, x: float, y: float, s: float) -> None:
        """Write the readings in 1/m of a load at (x, y) in m into the first row of `out` (4, C).

        And their derivatives by x, y and s; the load is spread over a disc of radius sqrt(s) in m.
        """
        ...

    def trust(self, s: float, share: float) -> Array | None:
        """Weights (P,) of the elements around the last place; None where all are 1.

        The readings of one that lies under the load depend on how it is spread over it: its
        variance is 1 + `share`. On a mesh they are inexact, in proportion to what is read.
        """
        ...

    def profile(self, s: float) -> Array | None:
        """What the readings of a Gaussian load at the last place differ by from those of `at`.

        Of one as wide, with the standard deviation sqrt(s) / 2 each way, and its derivatives,
        (4, C), on a cap or a mesh, where they differ all around; else None.
        """
        ...

    def gives(self, x: float, y: float) -> float:
        """Displacement of the skin in m per N under a point load at (x, y) in m."""
        ...


def influence_of(
    plate: Plate, layout: SensorLayout, edge: str, functions: int, out: Array
) -> Influence:
    """The influence of loads, converged where the skin is a plate or a shell on a rectangle.

    On strips, disks, polygons and drum heads it is that of a basis of so many `functions` each way;
    that of heights and slopes, which are bounded under a load, is one of more.
    """
    is_rectangle = type(plate.patch) is Patch and not plate.patch.strip
    _check_decay(plate, functions)
    if not isinstance(plate.patch, Cap | MeshSkin) and not (is_rectangle and _is_stiff(plate)):
        return _OfFunctions(plate, layout, edge, functions, out)
    is_mesh = isinstance(plate.patch, MeshSkin)
    if not layout.senses_curvature_only or (layout.reads and layout.gage_length and not is_mesh):
        return _OfFunctions(plate, layout, edge, _FINE, out)
    if layout.reads or layout.scale is not None:
        return _OfDirections(plate, layout, edge, out)
    return _of_curvature(plate)(plate, layout, edge, out)


def _of_curvature(plate: Plate) -> Callable[[Plate, SensorLayout, str, Array], Influence]:
    """What makes the influence on gages along x and y of a plate, a shell, a cap or a mesh."""
    if isinstance(plate.patch, Cap):
        return _OfCap
    return _OfMesh if isinstance(plate.patch, MeshSkin) else _OfPlate


_START, _LEAST, _LARGEST = 0.03, 1e-3, 0.2  # of the shorter side: radius of a load


def sizes_on(patch: Patch) -> tuple[float, float, float]:
    """Squared radii in m^2 of a load: one to begin with, the least and the largest fitted."""
    side = patch.a if patch.strip else min(patch.a, patch.b)
    largest = _WIDEST if isinstance(patch, MeshSkin) else _LARGEST
    return (_START * side) ** 2, (_LEAST * side) ** 2, (largest * side) ** 2


@lru_cache(1)  # the same array for all, which is read in half the time
def read_of_modes(
    plate: Plate, layout: SensorLayout, edge: str, functions: int
) -> tuple[Basis, Compliance, Array]:
    """So many functions each way, and what the channels read of a unit force on each, (C, N).

    Fewer on a mesh that has not the nodes for them.
    """
    basis = _basis_of(plate, edge, functions)
    compliance = plate.compliance(basis)
    return basis, compliance, compliance.after(layout.operator(basis, plate))


def _basis_of(plate: Plate, edge: str, functions: int) -> Basis:
    patch = plate.patch
    if isinstance(patch, MeshSkin):
        functions = min(functions, math.isqrt(patch.most_functions))
    return basis_for(patch, edge, functions, 1 if patch.strip else functions)


_FINE = 32  # functions each way that heights and slopes are followed by

# Seven points of the unit disc, and shares: their mean is that over the disc of all powers of x and
# y up to the fifth (Abramowitz and Stegun, 25.4.61).
_ANGLES = np.arange(6) * np.pi / 3
_RING = math.sqrt(2 / 3) * np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])
_PLACES, _SHARES = np.vstack([[0.0, 0.0], _RING]), np.array([1 / 4] + 6 * [1 / 8])


class _OfFunctions:
    """As the functions of a basis follow it; heights and slopes depend on the size of a load."""

    unit = 1.0
    nodes: tuple[Array, Single] | None = None

    def __init__(
        self, plate: Plate, layout: SensorLayout, edge: str, functions: int, out: Array
    ) -> None:
        self._basis, self._compliance, M = read_of_modes(plate, layout, edge, functions)
        self._readings, self._out = M.T, out
        self.sized = layout.reads is not None and not plate.patch.strip

    def at(self, x: float, y: float, s: float) -> None:
        felt = self._over_disc(x, y, s) if self.sized else self._basis.jet(x, y, 1)
        np.dot(felt, self._readings, self._out[: len(felt)])

    def _over_disc(self, x: float, y: float, s: float) -> Array:
        """The mean of each function over the disc, and its derivatives by x, y and s (4, N)."""
        places = (x, y) + math.sqrt(s) * _PLACES
        on = self._basis.patch.contains(places)
        places, share, at = places[on], _SHARES[on], self._basis.at
        f, f_x, f_y = share @ at(places), at(places, 1, 0), at(places, 0, 1)
        outward = (share[:, None] * _PLACES[on] / (2 * math.sqrt(s))).T
        return np.stack([f, share @ f_x, share @ f_y, outward[0] @ f_x + outward[1] @ f_y])

    def trust(self, s: float, share: float) -> Array | None:
        return None

    def profile(self, s: float) -> Array | None:
        return None

    def gives(self, x: float, y: float) -> float:
        f = self._basis.jet(x, y, 0)
        return float(np.vdot(self._compliance.after(f), f))


# A point load bends a plate without bound around itself, which no sum of few waves follows. So the
# readings are taken apart: what grows without bound is that of a plate without edges, in closed
# form; the rest, which the edges make, is smooth: summed until it stands, once per setup, and
# interpolated.
#
# A disc of radius r (s = r^2) on a plate without edges (Timoshenko, Theory of plates and shells,
# art. 16 to 19): with t = x^2 + y^2 and m = max(s, t), in units of P / (8 pi D),
#     w_xx = A + B x^2,   w_yy = A + B y^2,   w_xy = B x y,
#     A = ln m + (s + t) / (2 m) and any constant,   B = (2 - s / m) / m.
# Derivatives: A_t = B / 2, B_t = -2 (1 - s / m) / m^2, A_s = (1 - t / (2 m)) / m, B_s = -1 / m^2.
# A Gaussian load of standard deviation sd, with u = t / (2 sd^2):
#     A = ln t + E1(u) + (1 - exp(-u)) / u,   B = 2 (1 - (1 - exp(-u)) / u) / t.


class _Disc:
    """Readings of short gages at `positions` (P, 2) under a disc on a plate without edges.

    A call writes them and their derivatives into `out` (4, 3 P). It takes a third of a whole
    contact: numpy is quickest with arrays that exist already, of one shape.
    """

    def __init__(self, positions: Array, out: Array) -> None:
        P = len(positions)
        self._positions, self._out = positions.T.copy(), list(out.reshape(12, P))
        self.d, self.t = np.empty((2, P)), np.empty(P)
        self._numbers = list(np.repeat([[0.5], [1.0], [2.0], [4.0]], P, axis=1))
        self._work = list(np.empty((12, P)))

    def __call__(self, x: float, y: float, s: float) -> None:
        np.subtract(((x,), (y,)), self._positions, self.d)
        self.under(s)

    def under(self, s: float) -> None:
        """As a call, with the load at `d` (2, P) in m from the gages."""
        add, subtract, multiply, t = np.add, np.subtract, np.multiply, self.t
        half, one, two, four = self._numbers
        size, m, q, qq, v, w, B, b, x2, y2, e, f = self._work
        xx, yy, xy, xx_x, yy_x, xy_x, xx_y, yy_y, xy_y, xx_s, yy_s, xy_s = self._out
        dx, dy = self.d
        multiply(dx, dx, x2)
        multiply(dy, dy, y2)
        add(x2, y2, t)
        size.fill(s)
        np.maximum(t, size, out=m)
        np.divide(one, m, q)
        multiply(q, q, qq)
        multiply(size, q, v)
        multiply(t, q, w)
        subtract(two, v, B)
        multiply(B, q, B)
        subtract(v, one, b)
        multiply(b, qq, b)
        multiply(b, four, b)  # 2 B_t
        add(v, w, v)  # v w is v + w - 1, as one of them is 1
        multiply(v, half, v)
        np.log(m, m)
        add(m, v, m)  # A, and 1/2
        multiply(w, half, w)
        subtract(one, w, w)
        multiply(w, q, w)  # A_s
        multiply(dx, dy, v)
        multiply(B, x2, xx)
        add(xx, m, xx)
        multiply(B, y2, yy)
        add(yy, m, yy)
        multiply(B, v, xy)
        multiply(qq, x2, xx_s)
        subtract(w, xx_s, xx_s)
        multiply(qq, y2, yy_s)
        subtract(w, yy_s, yy_s)
        multiply(qq, v, xy_s)
        np.negative(xy_s, xy_s)
        multiply(b, x2, e)
        add(e, B, e)
        multiply(b, y2, f)
        add(f, B, f)
        multiply(e, dy, xy_x)
        multiply(e, dy, xx_y)
        multiply(f, dx, xy_y)
        multiply(f, dx, yy_x)
        add(B, B, B)
        add(e, B, e)
        multiply(e, dx, xx_x)
        add(f, B, f)
        multiply(f, dy, yy_y)


_DIAGONAL = math.sqrt(0.5)
_WAYS = np.array([(1, 0), (0, 1), (_DIAGONAL, _DIAGONAL), (_DIAGONAL, -_DIAGONAL)])
"""Directions of the gages: along x, along y, and along both diagonals."""
_ENDS = np.concatenate([_WAYS, -_WAYS])


class _DiscOnGages:
    """As `_Disc`, for gages of a `length`: what the slope along them differs by at their ends."""

    def __init__(self, positions: Array, length: float, out: Array) -> None:
        self._positions, self._length = positions.T, length
        self._out, self.t = out.reshape(4, 3, -1), np.empty(len(positions))
        self.d = np.empty((2, len(positions)))

    def __call__(self, x: float, y: float, s: float) -> None:
        np.subtract(((x,), (y,)), self._positions, self.d)
        self.under(s)

    def under(self, s: float) -> None:
        """As a call, with the load at `d` (2, P) in m from the middles of the gages."""
        d, out = self.d, self._out
        np.sum(d * d, axis=0, out=self.t)
        D = d[:, None] + self._length / 2 * _ENDS.T[..., None]
        t: Array = np.sum(D * D, axis=0)
        m = np.maximum(t, s)
        q = 1 / m
        A, B = np.log(m) + 0.5 + (s / 2) * t * q * q, (2 - s * q) * q
        nx, ny = np.concatenate([_WAYS, _WAYS]).T[..., None]
        along = D[0] * nx + D[1] * ny
        by_x, by_y = (B * D[0] * along + A * nx, B * D[1] * along + A * ny)
        slopes = np.stack([A * along, by_x, by_y, q * (1 - 0.5 * t * q) * along])
        xx, yy, rising, falling = np.moveaxis((slopes[:, :4] - slopes[:, 4:]) / self._length, 1, 0)
        out[:, 0], out[:, 1], out[:, 2] = xx, yy, (rising - falling) / 2


_NEAREST = 1e-6  # of a standard deviation: nearer, a Gaussian load bends the plate no more
_FAR = 40.0  # exp1 of it is less than the rounding of what it is added to
_TAIL = 6.0  # times the squared radius: so far off, a Gaussian as wide has exp(-12) left
_PER_TAIL = 6000  # steps of its table, which is exact to 1e-4 of a load's middle


def _gaussian(d: Array, sd: float) -> tuple[Array, Array]:
    """A and B (...) of a Gaussian load, by `d` (2, ...) to its centre."""
    t = np.maximum(d[0] ** 2 + d[1] ** 2, (_NEAREST * sd) ** 2)
    u = t / (2 * sd**2)
    mean: Array = -np.expm1(-u) / u
    integral, near = np.zeros_like(u), u < _FAR
    integral[near] = scipy.special.exp1(u[near])
    return np.log(t) + 0.5 + integral + mean, 2 * (1 - mean) / t


def _sharper(d: Array, s: float) -> tuple[Array, Array]:
    """What A and B of a Gaussian load differ by from those of a disc as wide, of s = r^2."""
    t = d[0] ** 2 + d[1] ** 2
    t *= _PER_TAIL / (_TAIL * s)
    A, B = (each.take(t.astype(np.intp), mode="clip") for each in _sharper_table())
    return A, B / s


@lru_cache(1)
def _sharper_table() -> Array:
    """`_sharper` of s = 1 (2, t) by the squared distance t; farther off both loads are alike."""
    t = _TAIL * (np.arange(_PER_TAIL) + 0.5) / _PER_TAIL
    A, B = _gaussian(np.stack([np.sqrt(t), np.zeros_like(t)]), 0.5)
    m = np.maximum(t, 1.0)
    return np.stack([A - np.log(m) - (1 + t) / (2 * m), B - (2 - 1 / m) / m])


def _under_gaussian(d: Array, sd: float, gage_length: float) -> Array:
    """Curvature (3, ...) read at `d` (2, ...) from the centre of a Gaussian load."""
    return _read(lambda D: _gaussian(D, sd), d, gage_length)


def _read(load: Callable[[Array], tuple[Array, Array]], d: Array, gage_length: float) -> Array:
    """Curvature (3, ...) read at `d` (2, ...) of a load's A and B there."""
    if not gage_length:
        (x, y), (A, B) = d, load(d)
        return np.array([A + B * x * x, A + B * y * y, B * x * y])

    def slope(x: float, y: float, along: float) -> Array:
        D = d + (along * np.array([x, y])).reshape(2, *[1] * (d.ndim - 1))
        return load(D)[0] * (x * D[0] + y * D[1])

    half = gage_length / 2
    ways: list[tuple[float, float]] = _WAYS.tolist()
    means = [(slope(x, y, half) - slope(x, y, -half)) / gage_length for x, y in ways]
    return np.stack([means[0], means[1], (means[2] - means[3]) / 2])


_NODES = 41  # along the shorter side
_PER_DECAY = 2  # nodes at least over the distance that a load on a shallow skin is felt
_MOST_BYTES = 64e6  # of a table; four times as many where that distance is short
_SD = 0.02  # of the shorter side, of the Gaussian load that the table is summed for
_SD_OF_DECAY = 0.3  # at most, of that distance
_VANISHED = 5.3  # k sd, beyond which a Gaussian load moves less than 1e-6 of what a point load does
_MOST_WAVES = 256  # along a side
_MIXED, _MOST_MIXED = 24, 1500  # functions where a load mixes them: along the shorter side, in all
_MIXED_SD = 3.0  # over the largest wave number of those
_SINES = "hinged", "sliding"
_TOGETHER = 200  # elements: 100 MB


def _is_stiff(plate: Plate) -> bool:
    """Whether the skin bends as a plate up to the distance of two nodes from a load."""
    D, near = plate.rigidity, min(plate.patch.a, plate.patch.b) / (_NODES - 1)
    return max(plate.tension * near**2, plate.foundation * near**4) < D


CUBICS = np.asarray(np.linalg.inv(np.vander(np.arange(4.0), increasing=True).T).T, float)
"""Lagrange's cubics through four even nodes, by the powers of the place."""
SPLINES: Array = np.array([[8, -5, 4, -1], [-12, 21, -12, 3], [6, -15, 12, -3], [-1, 3, -3, 1]]) / 6
"""The same of a cubic spline, between the second and third of four nodes."""
BY_PROFILE = 0.27  # of P / (8 pi D): by so much a disc and a Gaussian differ in their middle
_BESIDE = 2.5  # of a load's squared radius: an element as far off does not lie under it


def _trust(t: Array, s: float, share: float) -> Array | None:
    """`Influence.trust` of elements at squared distances `t` (P,) in m^2 from the load."""
    if t.min() > _BESIDE * s:
        return None
    under = t * (-2 / s)
    np.exp(under, under)
    under *= share
    under += 1
    return np.reciprocal(under, under)


class _Sizes:
    """What a load of any size makes where that is smooth, of what n Gaussian loads make.

    Their `variances` (n,) are in m^2. It is followed by a polynomial of the variance, of which a
    disc has other even moments than a Gaussian as wide.
    """

    def __init__(self, variances: Array) -> None:
        self._widest, n = float(variances[-1]), len(variances)
        self._shares = np.linalg.inv(np.vander(variances / self._widest, increasing=True))
        self._powers = k = np.arange(float(n))
        of_disc = 2.0**k / scipy.special.factorial(k + 1)
        self._moments = np.stack([of_disc, 1 - of_disc, k * of_disc, k * (1 - of_disc)])

    def __call__(self, s: float) -> Array:
        """Shares (4, n): of a disc of s = r^2, of what a Gaussian differs, and both by s."""
        sizes = (s / 4 / self._widest) ** self._powers * self._moments
        sizes[2:] /= s
        return sizes.dot(self._shares)


class _OfPlate:
    """A plate's or a shell's: in closed form what grows without bound, and a table of the rest."""

    sized = True
    nodes: tuple[Array, Single] | None = None

    def __init__(self, plate: Plate, layout: SensorLayout, edge: str, out: Array) -> None:
        self.unit = 8 * math.pi * plate.rigidity
        positions, length = layout.positions, layout.gage_length
        self._table, self._gives, variances = _rest_of(plate, edge, positions.tobytes(), length)
        patch, (ny, nx) = plate.patch, self._gives.shape
        self._steps = patch.a / (nx - 1), patch.b / (ny - 1)
        self._last = nx - 4, ny - 4
        self._out, self._of_size = out, _Sizes(variances)
        self._disc = _DiscOnGages(positions, length, out) if length else _Disc(positions, out)
        self._weights = np.empty((4, len(variances), 16), self._table.dtype)
        self._all, self._cubics = self._weights.reshape(4, -1), np.empty((4, 4))
        self._block = lru_cache(16)(self._block_at)

    def _among_nodes(self, x: float, y: float) -> tuple[int, int, float, float]:
        """The first of the four nodes each way around (x, y), and the place from it, in steps."""
        (hx, hy), (last_x, last_y) = self._steps, self._last
        i, j = min(max(int(x / hx) - 1, 0), last_x), min(max(int(y / hy) - 1, 0), last_y)
        return i, j, x / hx - i, y / hy - j

    def _block_at(self, i: int, j: int) -> "np.ndarray[Any, np.dtype[np.floating[Any]]]":
        table = self._table[:, j : j + 4, i : i + 4]
        return table.reshape(-1, table.shape[-1])

    def at(self, x: float, y: float, s: float) -> None:
        self._disc(x, y, s)
        (hx, hy), weights = self._steps, self._weights
        i, j, u, v = self._among_nodes(x, y)
        uu, vv = u * u, v * v
        powers = (
            (1.0, u, uu, u * uu),
            (0.0, 1 / hx, 2 * u / hx, 3 * uu / hx),
            (1.0, v, vv, v * vv),
            (0.0, 1 / hy, 2 * v / hy, 3 * vv / hy),
        )
        cubics = np.dot(powers, CUBICS, self._cubics)
        # Value and slopes along x and y; the fourth, which is mixed, gives way to that by size.
        pairs = (cubics[2:, None, :, None] * cubics[None, :2, None]).reshape(4, 16)
        of_disc, _, by_size, _ = self._of_size(s)[..., None]
        np.multiply(pairs[:3, None], of_disc, weights[:3])
        np.multiply(pairs[0], by_size, weights[3])
        self._out += self._all.dot(self._block(i, j))

    def trust(self, s: float, share: float) -> Array | None:
        return _trust(self._disc.t, s, share)

    def profile(self, s: float) -> Array | None:
        return None

    def gives(self, x: float, y: float) -> float:
        i, j, u, v = self._among_nodes(x, y)
        of_x, of_y = np.dot(((1.0, u, u * u, u * u * u), (1.0, v, v * v, v * v * v)), CUBICS)
        return float(of_y.dot(self._gives[j : j + 4, i : i + 4]).dot(of_x))


class _OfDirections:
    """That of curvatures along any direction, from xx, yy and xy: c^2 xx + 2 c s xy + s^2 yy.

    Times the `scale` of the readings.
    """

    sized = True

    def __init__(self, plate: Plate, layout: SensorLayout, edge: str, out: Array) -> None:
        each, self._of_each, self._channels, self._parts = _read_along(layout)
        self._rows, self._out = np.zeros((4, 3 * len(each))), out
        self._of = _of_curvature(plate)(plate, each, edge, self._rows)
        self.unit = self._of.unit
        self.nodes: tuple[Array, Single] | None = None
        if layout.scale is not None:
            self._parts *= layout.scale
        self._trust = np.ones(len(layout))
        if self._of.nodes is not None:
            places, read = self._of.nodes
            parts = self._parts.astype(np.float32)
            turned: Single = np.einsum("cr,ncr->nr", parts, read[:, self._channels])
            self.nodes = places, turned

    def at(self, x: float, y: float, s: float) -> None:
        self._of.at(x, y, s)
        np.einsum("cr,ncr->nr", self._parts, self._rows[:, self._channels], out=self._out)

    def trust(self, s: float, share: float) -> Array | None:
        found = self._of.trust(s, share)
        if found is None or len(found) == len(self._trust):
            return found
        self._trust[self._of_each] = found
        return self._trust

    def profile(self, s: float) -> Array | None:
        rows = self._of.profile(s)
        if rows is None:
            return None
        turned: Array = np.einsum("cr,ncr->nr", self._parts, rows[:, self._channels])
        return turned

    def gives(self, x: float, y: float) -> float:
        return self._of.gives(x, y)


def _read_along(layout: SensorLayout) -> tuple[SensorLayout, Indices, Indices, Array]:
    """Elements that read curvature, which of the layout's they are, and each reading from theirs.

    As the sum of three of their readings (3, C), by parts (3, C).
    """
    reads, P = layout.reads, len(layout)
    channels = layout.element + P * np.arange(3)[:, None]
    if reads is None:
        return layout, np.arange(P), channels, np.repeat(np.eye(3), P, axis=1)
    twist = reads.quantity == "twist"
    if not layout.gage_length:
        c, s = reads.along.T
        parts = np.where(twist, [[0.0], [0.0], [1.0]], [c * c, s * s, 2 * c * s])
        return layout.of_curvature, np.arange(P), channels, parts
    # On a mesh. What one gage reads does not follow from what others do: each is taken for an
    # element of its own, which reads along it; a twist has two of them.
    both = np.arange(np.count_nonzero(twist))
    turns = [np.where(twist, np.pi / 4, reads.direction), np.full(len(both), -np.pi / 4)]
    own = np.concatenate([reads.element, reads.element[twist]])
    each = SensorLayout.scattered(layout.patch, layout.positions[own])
    each = each.reading(np.arange(len(own)), "curvature").turned(np.concatenate(turns))
    channels = np.tile(np.arange(len(twist)), (3, 1))
    channels[1, twist] = len(twist) + both
    parts = np.where(twist, [[0.5], [-0.5], [0.0]], [[1.0], [0.0], [0.0]])
    return replace(each, gage_length=layout.gage_length), own, channels, parts


class _OfCap:
    """A cap's: a table of what discs and Gaussian loads of several sizes make.

    It is summed until it stands, and a cubic spline between its nodes.
    """

    sized = True

    def __init__(self, plate: Plate, layout: SensorLayout, edge: str, out: Array) -> None:
        self._cap = cast("Cap", plate.patch)
        self.unit = 8 * math.pi * plate.rigidity
        places, length = layout.positions.tobytes(), layout.gage_length
        self._table, self._steps, self._gives = cap_table(plate, edge, places, length)
        self._out = out
        self._last, self._discs = [n - 4 for n in self._table.shape[:3]], len(_radii(1))
        self._block, self._first = lru_cache(32)(self._block_at), (0, 0)
        self._of_place: Array = np.empty((3, 4, 4))
        self._difference: Array = np.empty(out.shape)
        self._weights = np.empty((4, 4, 4, 4), np.float32)
        self.nodes: tuple[Array, Single] | None = self._searched()

    def _searched(self) -> tuple[Array, Single]:
        """`nodes`: rings of the table, as far apart as the places on them."""
        table, (step, step_t, step_r) = self._table, self._steps
        found = list[tuple[int, int, int]]()
        for i in range(1, table.shape[0] - 1, _RINGS):
            radius = float(self._cap.meridian(np.array((i - 1) * step)).radius)
            around = max(round(2 * math.pi * radius / (_RINGS * step)), 1)
            for n in range(around):
                turn = 1 + n * (table.shape[1] - 3) // around
                found += [(turn, size, i) for size in _SEARCHED_SIZES]
        turn, size, ring = np.array(found).T
        angle, away = (turn - 1) * step_t, (ring - 1) * step
        offset = away * np.stack([np.cos(angle), np.sin(angle)])
        s = ((size - 1.5) * step_r) ** 2
        places: Array = np.column_stack([*(self._cap.rim_radius + offset), s])
        read: Single = np.zeros((len(places), table.shape[3]), np.float32)
        for i, j, k in product((-1, 0, 1), repeat=3):
            share = 4.0 ** (3 - abs(i) - abs(j) - abs(k)) / 216
            read += np.float32(share) * table[ring + i, turn + j, size + k]
        return places, read

    def _block_at(self, i: int, j: int, k: int) -> Single:
        return self._table[i : i + 4, j : j + 4, k : k + 4].reshape(64, -1)

    def at(self, x: float, y: float, s: float) -> None:
        dx, dy = x - self._cap.rim_radius, y - self._cap.rim_radius
        (step, step_t, _), d = self._steps, math.hypot(dx, dy)
        if d < (near := _AT_POLE * step):
            dx, dy, d = (dx, dy, d) if d else (near, 0.0, near)
            dx, dy, d = dx * near / d, dy * near / d, near
        azimuth, (last, last_t, _) = math.atan2(dy, dx) % (2 * math.pi), self._last
        i, along, along_s = _spline(d / step + 1, step, last)
        j, turn, turn_t = _spline(azimuth / step_t + 1, step_t, last_t)
        cos, sin = dx / d, dy / d
        outward, around = np.outer(along_s, turn), np.outer(along, turn_t / d)
        W = self._of_place
        np.outer(along, turn, W[0])
        W[1] = cos * outward - sin * around
        W[2] = sin * outward + cos * around
        self._first = i, j
        self._out[:] = self._under(s, 0, 1)

    def _under(self, s: float, begin: int, coarser: int) -> Single:
        """Readings and derivatives (4, C) of a load of size s, by sizes of the table."""
        r, step, (i, j) = math.sqrt(s), coarser * self._steps[2], self._first
        k, size, size_r = _spline(r / step + 1.5, step, self._last[2])
        W, here = self._weights, self._of_place[..., None]
        np.multiply(here, size, W[:3])
        np.multiply(here[0], size_r / (2 * r), W[3])
        return W.reshape(4, 64).dot(self._block(i, j, begin + k))

    def trust(self, s: float, share: float) -> Array | None:
        return None

    def profile(self, s: float) -> Array | None:
        np.subtract(self._under(s, self._discs, _COARSER), self._out, self._difference)
        return self._difference

    def gives(self, x: float, y: float) -> float:
        d = math.hypot(x - self._cap.rim_radius, y - self._cap.rim_radius)
        at = np.linspace(0, self._cap.rim_radius, len(self._gives))
        return float(np.interp(d, at, self._gives))


class _OfMesh:
    """A mesh's: in closed form what grows without bound, and splines of the rest."""

    sized = True

    def __init__(self, plate: Plate, layout: SensorLayout, edge: str, out: Array) -> None:
        self._mesh, self._out = cast("MeshSkin", plate.patch), out
        self.unit = 8 * math.pi * plate.rigidity
        self._gage_length = length = layout.gage_length
        turns = np.zeros(len(layout)) if layout.turns is None else layout.turns
        places = np.column_stack([layout.positions, turns]).tobytes()
        table, variances = _rest_on_mesh(plate, edge, places, length)
        self._block = lru_cache(32)(partial(self._mesh.splines.block, table))
        self._of_size = _Sizes(variances)
        self._basis = _basis_of(plate, edge, _ON_MESH)
        self._compliance = plate.compliance(self._basis)
        N, area = self._basis.size, float(self._mesh.areas.sum())
        self._finer = area / (16 * math.pi**2 * plate.rigidity * N)
        base = self._mesh.base(*layout.positions.T)
        tangents = _tangents(base, turns)
        self._origin = np.vecdot(tangents, np.stack(base.point, axis=-1))
        self._tangents: Array = np.ascontiguousarray(tangents.reshape(-1, 3).T)
        self._along = np.empty(self._tangents.shape)
        at = layout.positions
        self._disc = _DiscOnGages(at, length, out) if length else _Disc(at, out)
        self._difference, self._smooth = np.zeros(out.shape), np.zeros((3, 4, out.shape[1]))
        self.nodes: tuple[Array, Single] | None = self._searched()

    def _searched(self) -> tuple[Array, Single]:
        mesh = self._mesh
        found = mesh.spread(min(_SPREAD, len(mesh.points) // 2))
        side = min(mesh.a, mesh.b)
        places = np.concatenate(
            [
                np.insert(mesh.places[found[: len(found) // each]], 2, (share * side) ** 2, axis=1)
                for share, each in _SEARCHED.items()
            ]
        )
        read = np.empty((len(places), self._out.shape[1]), np.float32)
        for row, place in zip(read, places.tolist(), strict=True):
            self.at(*place)
            row[:] = self._out[0]
        return places, read

    def at(self, x: float, y: float, s: float) -> None:
        mesh, disc, out = self._mesh, self._disc, self._out
        r = mesh.jet(x, y)
        # The load from each element along its tangents, and how that moves with x and y.
        np.dot(r[:3], self._tangents, self._along)
        at, by_x, by_y = self._along.reshape(3, 2, -1)
        np.subtract(at, self._origin, disc.d)
        disc.under(s)
        by_d, work = out[1:3].reshape(2, 3, -1), self._difference.reshape(4, 3, -1)
        np.multiply(by_d, by_x[:, None], work[:2])
        np.multiply(by_d, by_y[:, None], work[2:])
        np.add(work[0], work[1], by_d[0])
        np.add(work[2], work[3], by_d[1])
        first, weights = mesh.splines.at(x, y)
        rest = weights[:3].dot(self._block(*first))
        # What is smooth, of the place and by x and y: of a disc, and how a Gaussian load differs.
        shares = self._of_size(s)
        np.matmul(shares, rest.reshape(3, shares.shape[1], -1), out=self._smooth)
        out[:3] += self._smooth[:, 0]
        out[3] += self._smooth[0, 2]

    def trust(self, s: float, share: float) -> Array | None:
        felt = self._out[0].reshape(3, -1)
        under: Array = np.square(felt).sum(axis=0)
        inexact = _INEXACT_IN_PART if self._mesh.is_held_in_part else _INEXACT
        under *= share * (inexact / BY_PROFILE) ** 2 / 3
        under += 1
        return np.reciprocal(under, under)

    def profile(self, s: float) -> Array | None:
        found, smooth, length = self._difference, self._smooth, self._gage_length
        found[:3], found[3] = smooth[:, 1], smooth[0, 3]
        # And right under the load; its slopes there are taken to be those of a disc.
        near = np.flatnonzero(self._disc.t < _TAIL * s + length**2)
        if len(near):
            more = _read(lambda d: _sharper(d, s), self._disc.d[:, near], length)
            found[0].reshape(3, -1)[:, near] += more
        return found

    def gives(self, x: float, y: float) -> float:
        f, N = self._basis.jet(x, y, 0), self._basis.size
        # Finer waves, of which by Weyl's law there are k dk / 2 pi to an area, move 1 / (D k^4).
        finer = self._finer * min(4 * float(np.vdot(f, f)) / N, 1.0)
        return float(np.vdot(self._compliance.after(f), f)) + finer


_ON_MESH = 15  # functions each way, of the displacement under a load
_INEXACT = 0.01  # of a reading: by elements and theory of shells (`tests/truths/test_meshes.py`)
_INEXACT_IN_PART = 0.03  # the same, where a part of the rim is free
_SPREAD = 300  # places searched
_SEARCHED = {0.02: 1, 0.07: 2, 0.16: 4}  # radii of the shorter side, and at every how many places
_MESH_SD = 1.2  # steps of the splines: of a Gaussian load
_CUT = 3.0  # of it: farther away such a load presses no more
_WIDEST = 0.3  # of the shorter side: a disc as large as the Gaussian loads of the table
_WIDE = 1.2  # times the decay squared: wider loads are followed by more variances
_FEW, _MANY = (0.0, 0.4, 1.0), (0.0, 0.08, 0.3, 0.6, 0.85, 1.0)  # of the largest: the variances
_BLOCK = 16  # elements together: 100 MB
_READ = 0.5  # of the time that the influence takes: what elements read of forces at nodes


@lru_cache(2)
def _rest_on_mesh(
    plate: Plate, edge: str, places: bytes, gage_length: float
) -> tuple[Single, Array]:
    """Splines (G, n C) of what is read of n Gaussian loads less that on a plate without edges.

    In the units of `_Disc`; and the variances of the loads in m^2.
    """
    mesh, C = cast("MeshSkin", plate.patch), plate.membrane_stiffness
    of_sheet = plate.rigidity / C, plate.poisson, plate.foundation / C
    sizes = " ".join(f"{each:.12g}" for each in (*of_sheet, gage_length))
    made = cached(
        f"discs {mesh.content} {edge} {sizes} {hashlib.sha256(places).hexdigest()}",
        lambda: _made_on_mesh(mesh, edge, of_sheet, places, gage_length, _decay(plate)),
    )
    return made["splines"], made["variances"]


def _made_on_mesh(
    mesh: MeshSkin,
    edge: str,
    of_sheet: tuple[float, float, float],
    places: bytes,
    gage_length: float,
    decay: float,
) -> dict[str, NDArray[Any]]:
    basis = cast("MeshBasis", basis_for(mesh, edge, 1, 1))
    n, unit, functions = len(mesh.points), 8 * math.pi * of_sheet[0], basis.functions
    x, y, turns = np.frombuffer(places).reshape(-1, 3).T
    positions = np.column_stack([x, y])
    read = np.zeros((n, 3, len(x)))
    for i in range(0, len(x), _BLOCK):
        progress.get()(_READ * i / len(x))
        own = np.s_[i : i + _BLOCK]
        part = SensorLayout.scattered(mesh, positions[own])
        if turns.any():
            part = part.reading(np.arange(len(part)), "curvature").turned(turns[own])
        part = replace(part, gage_length=gage_length)
        rows = part.mean_curvature(basis, functions.nodal_curvature)
        of_forces = functions.read_of_forces(rows, *of_sheet)
        of_forces = of_forces.reshape(n, -1, len(part))
        read[:, : of_forces.shape[1], own] = unit * of_forces
    sd = _MESH_SD * float(mesh.splines.step.max())
    spread, base = _spread_by(mesh, sd), mesh.base(x, y)
    away = mesh.points.T[:, :, None] - np.stack(base.point)[:, None]
    d = np.einsum("apk,knp->anp", _tangents(base, turns), away)
    cut, found = _CUT**2 / 2, list[Array]()
    # Spread again and again, up to the largest load.
    least, largest = sd**2 * (1 - cut / math.expm1(cut)), (_WIDEST * min(mesh.a, mesh.b)) ** 2 / 4
    shares = np.array(_FEW if largest < _WIDE * decay**2 else _MANY)
    times = np.unique(np.round(1 + shares * max(largest / least - 1, 2 * len(shares))))
    variances = least * times
    for k in range(1, int(times[-1]) + 1):
        progress.get()(_READ + (1 - _READ) * (k - 1) / int(times[-1]))
        read = (spread @ read.reshape(n, -1)).reshape(read.shape)
        if k in times:
            plain = _under_gaussian(d, math.sqrt(variances[len(found)]), gage_length)
            found.append(mesh.splines.fit((read - np.moveaxis(plain, 0, 1)).reshape(n, -1)))
    return {"splines": np.hstack(found).astype(np.float32), "variances": variances}


def _tangents(base: Base, turns: Array) -> Array:
    """Unit vectors (2, P, 3) of a base, turned by `turns` (P,) in rad."""
    (x, y), c, s = np.swapaxes(base.frame, 0, 1), np.cos(turns)[:, None], np.sin(turns)[:, None]
    return np.stack([c * x + s * y, c * y - s * x])


def _spread_by(mesh: MeshSkin, sd: float) -> Any:
    """The sparse mean (n, n) of values at nodes under a Gaussian about each, as far as `_CUT`."""
    from scipy.sparse import csr_array, diags_array  # slow to import, and seldom needed
    from scipy.spatial import KDTree

    near = KDTree(mesh.points)
    far = csr_array(near.sparse_distance_matrix(near, _CUT * sd, output_type="coo_matrix"))
    far.data = np.exp(-(far.data**2) / (2 * sd**2))
    shares: Any = far * mesh.areas
    return diags_array(1 / shares.sum(axis=1)) @ shares


def _coefficients(nodes: int) -> Array:
    """The map (n + 1, n) from values at even nodes to the coefficients of a cubic spline.

    The last coefficient is that of a node beyond.
    """
    A = (np.eye(nodes, k=-1) + 4 * np.eye(nodes) + np.eye(nodes, k=1)) / 6
    B = np.eye(nodes)
    for end, inward in ((0, slice(4)), (-1, slice(-1, -5, -1))):
        A[end], B[end, inward] = np.eye(nodes)[end], np.array([4, 5, -4, 1]) / 6
    inside = np.asarray(np.linalg.solve(A, B), float)
    return np.vstack([inside, 6 * np.eye(nodes)[-1] - 4 * inside[-1] - inside[-2]])


def _spline(at: float, step: float, last: int) -> tuple[int, Array, Array]:
    """The first of four nodes around `at`, in steps, their weights, and those of the slope."""
    i = min(int(at) - 1, last)
    u = at - i
    powers = (1.0, u, u * u, u * u * u), (0.0, 1 / step, 2 * u / step, 3 * u * u / step)
    weights, slopes = np.dot(powers, SPLINES)
    return i, weights, slopes


_WAVES = 28  # functions along the meridian of a cap that a load is followed by
_ON_CAP = 64  # steps of the table of a cap across its box
_AT_POLE = 1e-3  # of a step: nearer, it is taken for a place so far away
_RINGS = 2  # steps between the places searched
_SEARCHED_SIZES = 3, 6, 10  # of the table: radii of 1.5, 4.5 and 8.5 steps
_COARSER = 2  # times the step between sizes, of Gaussian loads, whose readings are smoother
_TINY = 1e-15  # of the largest of a sum's terms


def _radii(steps: int) -> Array:
    """Radii of loads in steps of the table, every so many."""
    return steps * np.abs(np.arange(math.ceil(_LARGEST * _ON_CAP / steps) + 4) - 1.5)


@lru_cache(2)
def cap_table(
    plate: Plate, edge: str, places: bytes, gage_length: float
) -> tuple[Single, tuple[float, ...], Array]:
    """Splines of the readings (S, T, Q, C) in 1/m per N, the steps, and displacements in m per N.

    By distance from the pole from -1 step, azimuth from -1 step, and size of the load; the steps
    are in m, rad and m. Sizes are radii of discs from -3/2 steps, then those of Gaussian loads as
    wide, every `_COARSER` steps. The displacements under a point load are at even distances from
    the pole to the rim.
    """
    cap = cast("Cap", plate.patch)
    k, along, rows, gives = _waves_on_cap(plate, edge, places, gage_length)
    step, (_, M, _, C) = cap.a / _ON_CAP, rows.shape
    turns = math.ceil(np.pi * _rim_share(cap) * _ON_CAP)
    discs, gaussians = step * _radii(1), step * _radii(_COARSER)
    of_discs, of_gaussians = (_coefficients(len(of))[:-1] for of in (discs, gaussians))
    r, u = np.multiply.outer(discs, k), np.multiply.outer(gaussians, k)
    means = (
        np.tensordot(of_discs, 2 * scipy.special.j1(r) / r, 1),
        np.tensordot(of_gaussians, np.exp(-u * u / 8), 1),
    )
    share = np.swapaxes(np.concatenate(means), 0, 1)
    along = np.tensordot(_coefficients(len(along)), along, 1)
    azimuths = 2 * np.pi / turns * np.arange(-1.0, turns + 2)
    turn = np.multiply.outer(azimuths, np.arange(float(M)))
    sharper = 3 / (2 + np.cos(turn[2]))  # the coefficients of a wave's spline over it
    around: Single = np.hstack([sharper * np.cos(turn), sharper * np.sin(turn)]).astype(np.float32)
    table = np.empty((len(along), len(around), share.shape[1], C), np.float32)
    # Ring by ring: what a ring is made of stays in the cache.
    for ring, shape in zip(table.reshape(*table.shape[:2], -1), along, strict=True):
        by_m: Single = (share * shape[:, None]).astype(np.float32) @ rows
        np.matmul(around, by_m.reshape(2 * M, -1), out=ring)
    return table, (step, 2 * np.pi / turns, step), gives


def cap_half_wave(cap: Cap) -> float:
    """Half of the shortest wave in m that the table follows."""
    return cap.rim_radius / _WAVES


def _rim_share(cap: Cap) -> float:
    """Radius of the rim in space over the arc to it."""
    return float(cap.meridian(np.array(cap.rim_radius)).radius) / cap.rim_radius


def _waves_on_cap(
    plate: Plate, edge: str, places: bytes, gage_length: float
) -> tuple[Array, Array, Single, Array]:
    """Wave numbers (M, n), waves along the meridian (S, M, n), their readings, and displacements.

    The readings (2, M, n, C) are of waves that go as a cosine around and as a sine.
    """
    cap = cast("Cap", plate.patch)
    layout = SensorLayout.scattered(cap, np.frombuffer(places).reshape(-1, 2))
    layout = replace(layout, gage_length=gage_length)
    Nj = 2 * math.ceil(_WAVES * np.pi * _rim_share(cap)) + 1  # as fine around as along
    basis = cast("CapBasis", basis_for(cap, edge, _WAVES, Nj))
    compliance, waves = plate.compliance_by_wave(basis), CapWaves(basis)
    shell, shape = cap_shell(plate, basis), (layout.channels, 2, *waves.k.shape)

    def curvature(positions: Array) -> Array:
        read = np.moveaxis(shell.curvature_by_wave(positions), 0, 2)
        return read.reshape(3, len(positions), -1)

    read = layout.mean_curvature(basis, curvature).reshape(shape)
    by_m = read.transpose(1, 2, 0, 3)
    unit = 8 * math.pi * plate.rigidity
    rows: Array = np.swapaxes(by_m @ (unit * compliance @ waves.shares), 2, 3)
    f = np.swapaxes(basis.along(np.linspace(0, 1, _ON_CAP + 1), 1)[0], 0, 1)
    gives: Array = np.vecdot(f @ compliance, f).sum(axis=0)
    along = waves.along(cap.a / _ON_CAP * np.arange(-1.0, _ON_CAP // 2 + 1))
    return waves.k, _rounded(along), _rounded(rows).astype(np.float32), gives


def _rounded(values: Array) -> Array:
    """`values` with zeros for what is too small to count: products of subnormals take long."""
    return np.where(np.abs(values) > _TINY * np.abs(values).max(), values, 0.0)


@lru_cache(4)
def _rest_of(
    plate: Plate, edge: str, places: bytes, gage_length: float
) -> tuple["np.ndarray[Any, np.dtype[np.floating[Any]]]", Array, Array]:
    """What the edges make of a load at each node, in the units of `_Disc`.

    A table (n, ny, nx, C) of the readings of n Gaussian loads less those on a plate without edges;
    displacements (ny, nx) in m per N under a point load; and the variances of the loads in m^2.
    """
    patch, positions = plate.patch, np.frombuffer(places).reshape(-1, 2)
    layout = replace(SensorLayout.scattered(patch, positions), gage_length=gage_length)
    largest = sizes_on(patch)[2] / 4
    shares = _MANY if largest > _WIDE * _decay(plate) ** 2 else (0.0, 1.0)
    kind = np.dtype(np.float64 if len(shares) == 2 else np.float32)
    x, y = patch.grid(*_nodes(plate, 3 * len(positions) * len(shares) * kind.itemsize))
    is_shell = patch.arc_curvature and edge in _SINES
    of_skin = _of_shell if is_shell else _of_functions

    def rest(least: float) -> tuple[Array, Array, float]:
        """Readings (ny, nx, C) of a Gaussian load of this standard deviation at least."""
        found, gives, sd = of_skin(plate, layout, edge, x, y, least)
        for i in range(0, len(positions), _TOGETHER):
            part = slice(i, i + _TOGETHER)
            d = positions[part].T[:, None, None] - np.stack(np.meshgrid(x, y))[..., None]
            found[..., part] -= np.moveaxis(_under_gaussian(d, sd, gage_length), 0, 2)
        return found.reshape(len(y), len(x), -1), gives, sd

    first, gives, sd = rest(0.0)
    variances = sd**2 + np.array(shares) * largest
    if len(shares) == 2:  # the mean over a load is the value and half its variance of the Laplacian
        rests = [first, first + largest / 2 * (_second(first, y, 0) + _second(first, x, 1))]
    else:
        rests = [first, *(rest(math.sqrt(each))[0] for each in variances[1:].tolist())]
    return np.stack(rests).astype(kind), gives, variances


def _of_functions(
    plate: Plate, layout: SensorLayout, edge: str, x: Array, y: Array, least: float
) -> tuple[Array, Array, float]:
    """Readings (ny, nx, 3, P) under a Gaussian load at each node, and displacements.

    And the standard deviation of the load in m, which is the `least` if it can be followed.
    """
    if edge in _SINES and not plate.mixes_sines:
        sines, sd = _sines(plate, least)
        return *_felt(plate, layout, sines, _means(sines, x, y, sd), x, y), sd
    basis, sd = _mixed(plate.patch, edge, least)
    if not plate.patch.is_shallow:
        return *_felt(plate, layout, basis, _means(basis, x, y, sd), x, y), sd
    # So few functions do not follow how a load fades on a skin that stretches. Sines do where the
    # edges are diaphragms; what other edges change is smooth.
    usual, sines = replace(plate, inplane="diaphragm"), SineBasis(plate.patch, *basis.shape)
    fine, fine_gives, sd = _of_functions(usual, layout, "hinged", x, y, least)
    (read, gives), (usual_read, usual_gives) = (
        _felt(skin, layout, few, _means(few, x, y, sd), x, y)
        for skin, few in ((plate, basis), (usual, sines))
    )
    return fine + (read - usual_read), fine_gives + (gives - usual_gives), sd


def _felt(
    plate: Plate,
    layout: SensorLayout,
    basis: ProductBasis,
    means: tuple[Array, Array],
    x: Array,
    y: Array,
) -> tuple[Array, Array]:
    """Readings and displacements at each node, of functions with these `means` under a load."""
    (along_x, along_y), compliance = means, plate.compliance(basis)
    T, unit = np.empty((len(y), len(x), 3, len(layout))), 8 * math.pi * plate.rigidity
    for i in range(0, len(layout), _TOGETHER):
        here = slice(i, i + _TOGETHER)
        part = replace(layout, positions=layout.positions[here], live=layout.live[:, here])
        M = compliance.after(part.operator(basis, plate)).reshape(-1, *basis.shape)
        read = unit * (along_x @ (M @ along_y.T)).T
        T[..., here] = read.reshape(len(y), len(x), 3, len(part))
    return T, _displacement(basis, compliance, x, y)


def _of_shell(
    plate: Plate, layout: SensorLayout, edge: str, x: Array, y: Array, least: float
) -> tuple[Array, Array, float]:
    """As `_of_functions`, as a shell."""
    sd = max(_SD * min(plate.patch.a, plate.patch.b), Shell.finest_on(plate.patch), least)
    shell = Shell(plate.sheet(sliding=edge == "sliding"), sd)
    T, gives = shell.readings_under(layout, x, y)
    unit = 8 * math.pi * plate.rigidity
    return unit * T.reshape(len(y), len(x), 3, len(layout)), gives, sd


def _decay(plate: Plate) -> float:
    """Distance in m over which what stretching adds to a load on a curved skin fades.

    (D / (E h H^2))^(1/4), with the mean over all directions of H^2 = (c^2 / Ry + s^2 / Rx)^2.
    """
    patch = plate.patch
    Hx, Hy = (0.0, 0.0) if patch.strip else patch.curvatures
    square = (3 * Hx**2 + 3 * Hy**2 + 2 * Hx * Hy) / 8
    if isinstance(patch, MeshSkin):
        xx, yy, xy = patch.read_at_rest(patch.places)
        square = (3 * xx**2 + 3 * yy**2 + 2 * xx * yy + 4 * xy**2) / 8
        square = float(np.percentile(square, _BENT_MORE))
    stretch = (1 - plate.poisson**2) * plate.membrane_stiffness * square
    return (plate.rigidity / stretch) ** 0.25 if stretch else math.inf


_BENT_MORE = 90  # percent of the nodes of a mesh are bent less than it is taken to be
_STEPS_OF_DECAY = 2  # steps of a mesh's splines: over less a load is not felt as these have it
_FOLLOWED = 0.8  # half waves on a cap: over less a load is not felt as the table has it


def _check_decay(plate: Plate, functions: int) -> None:
    """Refuse a domed skin on which loads are felt nearer than they can be followed.

    What a load makes on a shallow one goes once up and down over pi times the `_decay`, in a half
    wave of so many functions.
    """
    patch = plate.patch
    if patch.arc_curvature:
        return
    least, remedy = max(patch.a, patch.b) / functions / math.pi, "check thickness and radii"
    if isinstance(patch, MeshSkin):
        least = _STEPS_OF_DECAY * float(patch.splines.step.max())
        remedy = "check the thickness, or use smaller triangles"
    elif isinstance(patch, Cap):
        least = _FOLLOWED * cap_half_wave(patch)
    if (decay := _decay(plate)) < least:
        raise Refusal(
            f"expected a skin on which a load is felt over {1e3 * least:.2g} mm at least, got "
            f"{1e3 * decay:.2g} mm on a {patch.name}: it is too thin for its radii to find "
            f"contacts; {remedy}"
        )


def _nodes(plate: Plate, each: int) -> tuple[int, int]:
    """Nodes along x and y: as near one another along both, and within the memory.

    Each takes so many bytes.
    """
    patch = plate.patch
    least = math.sqrt(patch.a * patch.b * each / _MOST_BYTES)
    near = max(min(patch.a, patch.b) / (_NODES - 1), least)
    if not patch.arc_curvature:  # along whose arc a load is felt further
        near = min(near, max(_decay(plate) / _PER_DECAY, least / 2))
    nx, ny = (max(math.ceil(side / near * (1 - 1e-9)) + 1, 5) for side in (patch.a, patch.b))
    return nx, ny


def _sines(plate: Plate, least: float) -> tuple[SineBasis, float]:
    """Sines that follow a Gaussian load, and its standard deviation in m."""
    sides = plate.patch.a, plate.patch.b
    sd = min(_SD * min(sides), _SD_OF_DECAY * _decay(plate))
    sd = max(sd, _VANISHED * max(sides) / (math.pi * _MOST_WAVES), least)
    Ni, Nj = (math.ceil(_VANISHED * side / (math.pi * sd)) for side in sides)
    return SineBasis(plate.patch, Ni, Nj), sd


def _mixed(patch: Patch, edge: str, least: float) -> tuple[ProductBasis, float]:
    """The same of other functions: as fine along both sides, as many as a matrix may have."""
    shorter = min(patch.a, patch.b)
    most = min(_MIXED, math.sqrt(_MOST_MIXED * shorter / max(patch.a, patch.b)))
    Ni, Nj = (math.ceil(most * side / shorter) for side in (patch.a, patch.b))
    mixed = cast("ProductBasis", basis_for(patch, edge, Ni, Nj))
    return mixed, max(_MIXED_SD * shorter / (math.pi * most), least)


def _means(basis: ProductBasis, x: Array, y: Array, sd: float) -> tuple[Array, Array]:
    """Means (nx, Ni), (ny, Nj) of the functions under Gaussians at the nodes."""
    if isinstance(basis, SineBasis):
        ki, kj = basis.wavenumbers
        share_i, share_j = (np.exp(-((sd * k) ** 2) / 2) for k in (ki, kj))
        return np.sin(np.multiply.outer(x, ki)) * share_i, np.sin(
            np.multiply.outer(y, kj)
        ) * share_j
    z, weights = np.polynomial.hermite_e.hermegauss(9)
    near_x, near_y = (
        np.clip(np.add.outer(at, sd * z), 0.0, side).ravel()
        for at, side in ((x, basis.patch.a), (y, basis.patch.b))
    )
    grid, shares = basis.on_grid(near_x, near_y), weights / weights.sum()
    along_x = np.einsum("q,pqn->pn", shares, grid.X.reshape(len(x), len(z), -1))
    along_y = np.einsum("q,pqn->pn", shares, grid.Y.reshape(len(y), len(z), -1))
    return along_x, along_y


def _second(values: Array, nodes: Array, axis: int) -> Array:
    """Second derivative of `values` along `axis`, by differences."""
    f, out = np.moveaxis(values, axis, 0), np.empty_like(values)
    second = np.moveaxis(out, axis, 0)
    second[1:-1] = f[2:] - 2 * f[1:-1] + f[:-2]
    second[0] = 2 * f[0] - 5 * f[1] + 4 * f[2] - f[3]
    second[-1] = 2 * f[-1] - 5 * f[-2] + 4 * f[-3] - f[-4]
    return out / (nodes[1] - nodes[0]) ** 2


def _displacement(basis: ProductBasis, compliance: Compliance, x: Array, y: Array) -> Array:
    """Displacement (ny, nx) in m per N under a point load at each node."""
    grid, values, volume = basis.on_grid(x, y), compliance.values, compliance.volume
    if values.ndim == 1:
        gives: Array = grid.Y**2 @ values.reshape(basis.shape).T @ (grid.X**2).T
        if volume is not None:  # less what the pressure below, which keeps the volume, moves back
            swelling = values * volume
            moved = grid.Y @ swelling.reshape(basis.shape).T @ grid.X.T
            gives -= moved**2 / float(volume @ swelling)
        return gives
    f = basis.at(np.stack(np.meshgrid(x, y), -1).reshape(-1, 2))
    return np.vecdot(compliance.after(f), f).reshape(len(y), len(x))
