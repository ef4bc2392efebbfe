"""Shells: what a bent skin that stretches reads, and how far it gives."""

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy import linalg

from kappaskin.bases import Basis, ProductBasis, SineBasis, gauss
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask
from kappaskin.skin import Patch

# Sanders' and Koiter's theory of a cylinder bent along x to H = 1/R, straight along y, with the
# displacement f inward and the tangential ones v along x (hoop) and u along y (axial):
#
#     strain       e_x = v_x - H f        e_y = u_y      g = v_y + u_x
#     curvature    k_x = f_xx + H v_x     k_y = f_yy     t = f_xy + H (3 v_y - u_x) / 4
#
# The energy is half the integral of
#
#     C (e_x^2 + e_y^2 + 2 nu e_x e_y + (1 - nu)/2 g^2)
#     + D (k_x^2 + k_y^2 + 2 nu k_x k_y + 2 (1 - nu) t^2)
#     + T (f_x^2 + f_y^2 - H^2 f^2) + k_f f^2
#
# with D = E h^3 / (12 (1 - nu^2)) and C = E h / (1 - nu^2). A pair of gages back to back reads half
# of what their strains differ by over half the thickness. On a line at z from the middle surface,
# 1 + z H times as long, the strain is (e_x + z k_x) / (1 + z H), and likewise in shear, so that
#
#     xx = k_x - H e_x = f_xx + H^2 f    yy = k_y    xy = t - H g / 4 = f_xy + H (v_y - u_x) / 2
#
# The curved ends hold f and v and let u go: v goes as sin(q y), u as cos(q y) with q = j pi/b, and
# no wave j mixes with another. The straight edges hold f and, as they are held in plane, v and u.
# Tension: a skin that the pressure T H blows up has the energy T area - p volume, of which the
# second variation is the third line: nil for a rigid translation.


def _once(a: float, count: int, x: Array) -> Array:
    """Integrals of the Legendre polynomials P_n on [0, a], n = 1 to `count`, and these (2, X, n).

    The polynomials are orthonormal, the integrals vanish at both ends.
    """
    P, n = legvander(2 * x / a - 1, count + 1), np.arange(1, count + 1)
    integrals = (P[:, 2:] - P[:, :-2]) / (2 * n + 1) * a / 2
    scale: Array = np.sqrt((2 * n + 1) / a)
    return np.stack([integrals, P[:, 1:-1]]) * scale


def _twice(a: float, count: int, x: Array) -> Array:
    """Integrals of integrals of P_n, n = 0 to `count` - 1, and two derivatives (3, X, n).

    The second derivatives are orthonormal, the functions vanish at both ends.
    """
    P, n, nil = legvander(2 * x / a - 1, count + 1), np.arange(count), np.zeros((len(x), 2))
    integrals = np.hstack([nil, (P[:, 2:] - P[:, :-2]) / (2 * np.arange(1, count + 1) + 1)])
    slopes = (P[:, 1:-1] - np.hstack([nil, P[:, 1 : count - 1]])) / (2 * n + 1)
    values = (integrals[:, 2:] - integrals[:, :-2]) / (2 * n + 1)
    scale: Array = np.sqrt((2 * n + 1) / a)
    return np.stack([values * a**2 / 4, slopes * a / 2, P[:, :-2]]) * scale


def _lines(a: float, x: Array) -> Array:
    """1 and 2x/a - 1, and their derivatives (2, X, 2)."""
    one = np.ones_like(x)
    values, slopes = (one, 2 * x / a - 1), (0 * one, 2 / a * one)
    return np.stack([np.stack(values, axis=-1), np.stack(slopes, axis=-1)])


@dataclass(frozen=True)
class Sheet:
    """A bent sheet: D in N m, C and T in N/m, nu, k_f in N/m^3, and which edges hold v and u.

    Below may be a `fluid` that keeps its volume.
    """

    patch: Patch
    D: float
    C: float
    nu: float
    T: float
    k_f: float
    fluid: bool
    v_held: bool
    u_held: bool


class _Arc:
    """Displacements along the arc by Ritz's method, which meet the straight edges.

    `f` gives the functions of f and their first two derivatives (3, X, N) at x (X,); v and u are
    integrals of `count` Legendre polynomials, and lines where they are not held. The n functions
    are those of f, of v and of u.
    """

    def __init__(self, sheet: Sheet, f: Callable[[Array], Array], count: int) -> None:
        self._sheet, self._f, self._count = sheet, f, count
        self.x, self.weights = gauss(sheet.patch.a, 2 * count + 16)
        self._fields = self.fields(self.x)
        ends = np.cumsum([0, *(field.shape[-1] for field in self._fields)]).tolist()
        self.f, self.v, self.u = (slice(*pair) for pair in itertools.pairwise(ends))
        self.size = ends[-1]

    def fields(self, x: Array) -> tuple[Array, Array, Array]:
        """The functions of f (3, X, N), v (2, X, Nv) and u (2, X, Nu) with derivatives at `x`."""
        a, sheet = self._sheet.patch.a, self._sheet
        held = _once(a, self._count, x)
        free = np.dstack([_lines(a, x), held])
        return self._f(x), held if sheet.v_held else free, held if sheet.u_held else free

    def rows(self, x: Array) -> Array:
        """f, f_x, f_xx, v, u_x (5, ..., n) of all functions at `x` (...) in m."""
        f, v, u = self.fields(x.ravel())
        found = np.zeros((5, x.size, self.size))
        found[:3, :, self.f], found[3, :, self.v], found[4, :, self.u] = f, v[0], u[1]
        return found.reshape(5, *x.shape, self.size)

    def stiffness(self, q: Array) -> Array:
        """Stiffness (J, n, n) for `q` (J,) in 1/m, over the integral of sin(q y)^2 along y."""
        strains, n = self._strains(), self.size
        stress = np.einsum("ij,pjxn,x->pixn", self._law(), strains, self.weights)
        left, right = strains.reshape(3, -1, n), stress.reshape(3, -1, n)
        powers = np.zeros((5, n, n))
        for one in range(3):
            for other in range(3):
                powers[one + other] += left[one].T @ right[other]
        return np.tensordot(q[:, None] ** np.arange(5), powers, 1)

    def _strains(self) -> Array:
        """Strains (3, 9, X, n) by powers of q: e_x, e_y, g, k_x, k_y, t, f_x, f_y, f."""
        H, F, V, U = self._sheet.patch.arc_curvature, self.f, self.v, self.u
        f, v, u = self._fields
        S = np.zeros((3, 9, len(self.x), self.size))
        S[0, 0, :, F], S[0, 0, :, V] = -H * f[0], v[1]
        S[1, 1, :, U] = -u[0]
        S[1, 2, :, V], S[0, 2, :, U] = v[0], u[1]
        S[0, 3, :, F], S[0, 3, :, V] = f[2], H * v[1]
        S[2, 4, :, F] = -f[0]
        S[1, 5, :, F], S[1, 5, :, V], S[0, 5, :, U] = f[1], 3 / 4 * H * v[0], -H / 4 * u[1]
        S[0, 6, :, F], S[1, 7, :, F], S[0, 8, :, F] = f[1], f[0], f[0]
        return S

    def _law(self) -> Array:
        sheet = self._sheet
        C, D, nu, T = sheet.C, sheet.D, sheet.nu, sheet.T
        squares = sheet.k_f - T * sheet.patch.arc_curvature**2
        law = np.diag([C, C, C * (1 - nu) / 2, D, D, 2 * D * (1 - nu), T, T, squares])
        law[0, 1] = law[1, 0] = nu * C
        law[3, 4] = law[4, 3] = nu * D
        return law


class Tangential:
    """The tangential displacements of a bent skin that go with each function of a `basis`.

    Nothing presses the skin along itself: v and u are those of the least energy for a given f.
    `relief` (N, N) in N/m is by how much they lower the stiffness that f has without them.
    """

    def __init__(self, sheet: Sheet, basis: Basis) -> None:
        if not isinstance(basis, ProductBasis):
            raise TypeError(f"a bent skin has products of functions, got {type(basis).__name__}")
        Ni, Nj = basis.shape
        a, b = sheet.patch.a, sheet.patch.b
        self._basis, self._H = basis, sheet.patch.arc_curvature
        self._arc = arc = _Arc(sheet, self._along, 2 * Ni + 16)
        waves = Nj if isinstance(basis, SineBasis) else 2 * Nj + 16
        self._q = np.pi / b * np.arange(1.0, waves + 1)
        square = b / 2  # the integral of a squared sine
        y, weights = gauss(b, 2 * waves + 16)
        of_y = basis.on_grid(np.array([a / 2]), y).Y
        sines_there = np.sin(np.multiply.outer(self._q, y))
        share = (sines_there * weights) @ of_y / square  # (J, Nj): of a function of y, of a wave
        K, F, T = arc.stiffness(self._q), arc.f, slice(arc.v.start, arc.size)
        least = -np.linalg.solve(K[:, T, T], K[:, T, F])
        relief = np.einsum("jit,jtm->jim", -K[:, F, T], least)
        self.relief: Array = square * np.einsum(
            "jn,jl,jim->inml", share, share, relief, optimize=True
        ).reshape(basis.size, basis.size)
        self._share, self._least = share, np.zeros((len(self._q), arc.size, Ni))
        self._least[:, T] = least

    def _along(self, x: Array) -> Array:
        maps = (self._basis.on_grid(x, np.zeros(1), order) for order in range(3))
        return np.stack([each.X for each in maps])

    def hoop_at(self, positions: Array) -> Array:
        """v and its first two derivatives along y, (3, P, N) per m of each function."""
        along = self._arc.rows(positions[:, 0])[3]
        turn = np.multiply.outer(positions[:, 1], self._q)
        v = np.einsum("pn,jni->pij", along, self._least, optimize=True)
        waves = np.sin(turn), self._q * np.cos(turn), -(self._q**2) * np.sin(turn)
        found = [v @ (wave[:, :, None] * self._share) for wave in waves]
        return np.stack(found).reshape(3, len(positions), -1)

    def curvature_at(self, positions: Array) -> Array:
        """Curvature xx, yy, xy (3, P, N) in 1/m per m of each function at `positions` (P, 2)."""
        f, xx, yy, xy = (
            self._basis.at(positions, *order) for order in ((0, 0), (2, 0), (0, 2), (1, 1))
        )
        _, _, _, v, ux = self._arc.rows(positions[:, 0])
        turned = np.einsum("pn,j,jni->pij", v, self._q, self._least, optimize=True)
        turned -= np.einsum("pn,jni->pij", ux, self._least, optimize=True)
        cos = np.cos(np.multiply.outer(positions[:, 1], self._q))
        twist = (turned @ (cos[:, :, None] * self._share)).reshape(xy.shape)
        return np.stack([xx + self._H**2 * f, yy, xy + self._H / 2 * twist])


# A shallow skin (Marguerre): strains e_x = u_x - f / Rx, e_y = v_y - f / Ry, g = u_y + v_x with u
# along x and v along y, and the bending of a plate. Stretching adds the energy of the u and v that
# make it least. All functions are even or odd about the middle, along x and along y. An f that is
# even along x has a u that is odd along it, and a v that is even; likewise along y: four kinds of f
# that do not mix.

_IN_PLANE = 16  # functions of u and v along a side, more than f has


def _are_even(functions: Array) -> Mask:
    """Which of `functions` (..., X, n) at points (X,) on either side are even about the middle."""
    values = functions.reshape(-1, *functions.shape[-2:])[0]
    return np.einsum("xn,xn->n", values, values[::-1]) > 0


def shallow_stiffness(patch: Patch, C: float, nu: float, inplane: str, basis: Basis) -> Array:
    """What stretching adds to the stiffness (N, N) in N/m of the functions of a `basis`.

    `C` = E h / (1 - nu^2) in N/m; `inplane` is one of `held`, `diaphragm` and `free`.
    """
    if not isinstance(basis, ProductBasis):
        raise TypeError(f"a shallow skin has products of functions, got {type(basis).__name__}")
    sides = (patch.a, basis.Ni), (patch.b, basis.Nj)
    rules = [gauss(side, 2 * count + 2 * _IN_PLANE) for side, count in sides]
    fixed, loose = list[Array](), list[Array]()  # by x and by y, with derivatives (2, X, n)
    for (points, _), (side, count) in zip(rules, sides, strict=True):
        fixed.append(_once(side, count + _IN_PLANE, points))
        loose.append(np.dstack([_lines(side, points), fixed[-1]]))
    across = fixed if inplane == "held" else loose
    along_edge = loose if inplane == "free" else fixed
    maps, (Hx, Hy), shear = basis.on_grid(rules[0][0], rules[1][0]), patch.curvatures, (1 - nu) / 2
    X, Y = maps.X, maps.Y

    def product(one: tuple[Array, Array], other: tuple[Array, Array]) -> Array:
        (_, x), (_, y) = rules
        along_x, along_y = (one[0].T * x) @ other[0], (one[1].T * y) @ other[1]
        return np.kron(along_x, along_y).astype(float)

    def half(functions: Array, even: bool) -> Array:
        return functions[..., _are_even(functions) == even]

    added = np.zeros((*basis.shape, *basis.shape))
    for even_x, even_y in itertools.product((True, False), repeat=2):
        f = half(X, even_x), half(Y, even_y)
        u = half(across[0], not even_x), half(along_edge[1], even_y)
        v = half(along_edge[0], even_x), half(across[1], not even_y)
        (u_x, u_y), (v_x, v_y) = (((x[1], y[0]), (x[0], y[1])) for x, y in (u, v))
        K_u = product(u_x, u_x) + shear * product(u_y, u_y)
        K_v = product(v_y, v_y) + shear * product(v_x, v_x)
        mixed = nu * product(u_x, v_y) + shear * product(u_y, v_x)
        stiffness: Array = np.block([[K_u, mixed], [mixed.T, K_v]])
        coupled = np.vstack([(Hx + nu * Hy) * product(u_x, f), (Hy + nu * Hx) * product(v_y, f)])
        if inplane == "free" and not (even_x and even_y):  # a shift or a turn, which strain nothing
            shift = len(K_u) if even_x else 0
            stiffness = np.delete(np.delete(stiffness, shift, 0), shift, 1)
            coupled = np.delete(coupled, shift, 0)
        own = (Hx**2 + Hy**2 + 2 * nu * Hx * Hy) * product(f, f) - _relief(stiffness, coupled)
        i, j = np.flatnonzero(_are_even(X) == even_x), np.flatnonzero(_are_even(Y) == even_y)
        added[np.ix_(i, j, i, j)] = own.reshape((len(i), len(j)) * 2)
    return C * added.reshape(basis.size, basis.size)


def _relief(K: Array, coupled: Array) -> Array:
    """C' K^-1 C (N, N) of a stiffness K (n, n) and what is `coupled` to it, C (n, N)."""
    scale: Array = 1 / np.sqrt(np.diag(K))
    root = np.linalg.cholesky(K * np.multiply.outer(scale, scale))
    eased = linalg.solve_triangular(root, coupled * scale[:, None], lower=True)
    return eased.T @ eased


_MOST_FUNCTIONS, _MOST_WAVES = 96, 160
_DIAGONAL = 1 / math.sqrt(2)
_POINTS = 12  # along a gage: exact to rounding for waves as short as the gage


class Gages(Protocol):
    """P elements at `positions` (P, 2) in m whose gages are `gage_length` long in m."""

    @property
    def positions(self) -> Array: ...

    @property
    def gage_length(self) -> float: ...


class Shell:
    """A bent skin with hinged edges under Gaussian loads, resolved to convergence.

    Their standard deviation is `sd` in m, at least that of `finest_on`.
    """

    def __init__(self, sheet: Sheet, sd: float) -> None:
        patch = sheet.patch
        if sd < (least := self.finest_on(patch)) * (1 - 1e-9):
            raise Refusal(
                f"expected a load of a standard deviation of at least {least:.3g} m on a "
                f"{patch.name}, got {sd:g} m"
            )
        # A Gaussian has exp(-8) of its amplitude left at the wave number 4 / sd.
        functions = math.ceil(2 * patch.a / sd * (1 - 1e-9))
        waves = math.ceil(4 * patch.b / sd / np.pi * (1 - 1e-9))
        self._sheet, self._sd, count = sheet, sd, max(functions, 16)
        self._arc = _Arc(sheet, partial(_twice, patch.a, count), count)
        self._q = np.pi / patch.b * np.arange(1.0, max(waves, 16) + 1)
        self._felt = self._arc.rows(self._arc.x)[0][:, self._arc.f].T * self._arc.weights
        self._answer = self._solved()

    @staticmethod
    def finest_on(patch: Patch) -> float:
        """The least standard deviation in m that can be asked for on `patch`."""
        return max(2 * patch.a / _MOST_FUNCTIONS, 4 * patch.b / (math.pi * _MOST_WAVES))

    def _solved(self) -> Array:
        """The displacements (J, n, N) in m of each wave under unit forces on the functions of f."""
        K, f = self._arc.stiffness(self._q), self._arc.f
        scale: Array = 1 / np.sqrt(np.einsum("jnn->jn", K))
        forces = np.zeros((*scale.shape, f.stop))
        forces[:, f] = np.eye(f.stop) * scale[:, None, f]
        scaled: Array = K * scale[:, :, None] * scale[:, None, :]
        answer: Array = np.linalg.solve(scaled, forces) * scale[:, :, None]
        return answer * (2 / self._sheet.patch.b)  # the integral of a squared sine is b / 2

    def _loads(self, x: Array) -> Array:
        """Forces (N, X) on the functions of f under unit loads at `x` (X,), over sin(q y).

        Beyond the ends the load is reflected with the other sign, as sines do along y.
        """
        load = np.zeros((len(self._arc.x), len(x)))
        for sign, centre in ((1, x), (-1, -x), (-1, 2 * self._sheet.patch.a - x)):
            r = (self._arc.x[:, None] - centre) / self._sd
            load += sign * np.exp(-(r**2) / 2) / (self._sd * math.sqrt(2 * np.pi))
        return self._felt @ load

    def readings_under(self, gages: Gages, x: Array, y: Array) -> tuple[Array, Array]:
        """Readings (ny, nx, 3 P) under 1 N at each node of `x` (nx,), `y` (ny,), and its give.

        Nodes are in m. The readings are in 1/m per N: xx of all elements, then yy, then xy; the
        give (ny, nx) in m per N is the displacement at the load's centre.
        """
        q, f = self._q, self._arc.rows(x)[0]
        sines: Array = np.sin(np.multiply.outer(y, q))
        along: Array = np.exp(-((q * self._sd) ** 2) / 2) * sines
        moved: Array = self._answer @ self._loads(x)
        read = self._read(gages, moved, along)
        give: Array = (along * sines) @ np.einsum("xn,jnx->jx", f, moved)
        if not self._sheet.fluid:
            return read, give
        # The pressure that takes the volume back which the load displaces.
        over: Array = np.multiply.outer(
            (1 - np.cos(q * self._sheet.patch.b)) / q, self._felt.sum(axis=1)
        )
        swollen = np.einsum("jnf,jf->jn", self._answer, over)
        displaced: Array = along @ np.einsum("jf,jfx->jx", over, moved[:, self._arc.f])
        pressure = displaced / np.sum(over * swollen[:, self._arc.f])
        alike = self._read(gages, swollen[..., None], np.ones((1, len(q))))
        return read - pressure[..., None] * alike, give - pressure * (sines @ swollen @ f.T)

    def _read(self, gages: Gages, moved: Array, along: Array) -> Array:
        """Readings (Y, X, 3 P) of displacements `moved` (J, n, X), by shares `along` (Y, J)."""
        at, place = np.unique(gages.positions[:, 0], return_inverse=True)
        T = np.empty((len(along), moved.shape[2], 3, len(place)))
        for c, rows in enumerate(self._rows(at, gages.gage_length)):
            read = np.stack([row @ of for row, of in zip(rows, moved, strict=False)], axis=1)
            turn = np.cos if c == 2 else np.sin
            for p, (u, z) in enumerate(zip(place, gages.positions[:, 1], strict=True)):
                T[:, :, c, p] = (along * turn(self._q * z)) @ read[u]
        return T.reshape(*T.shape[:2], -1)

    def _rows(self, x: Array, gage_length: float) -> tuple[Iterable[Array], ...]:
        """For xx, yy and xy the readings (X, n) of the functions at `x` (X,), wave by wave.

        They are the factors of sin(q y), sin(q y) and cos(q y). A gage along a diagonal reads the
        mean of (xx + yy) / 2 + xy or - xy; the twist is half of what the two differ by.
        """
        H, q = self._sheet.patch.arc_curvature, self._q[:, None]
        s, w = _along_gage(gage_length)
        f, _, fxx, _, _ = self._arc.rows(np.add.outer(s, x))
        straight = self._arc.rows(x)[0]
        xx: Array = np.einsum("s,sxn->xn", w, fxx + H**2 * f)
        shorter = np.sinc(q * gage_length / (2 * np.pi)) * q**2
        yy = (-k * straight for k in shorter)
        f, fx, fxx, v, ux = self._arc.rows(np.add.outer(s * _DIAGONAL, x))
        shapes = np.stack([fx + H / 2 * v, ux, fxx + H**2 * f, f])
        cos, sin = w * np.cos(q * s * _DIAGONAL), w * np.sin(q * s * _DIAGONAL) / 2
        factors = np.stack([q * cos, -H / 2 * cos, sin, -(q**2) * sin], axis=1)
        return itertools.repeat(xx), yy, np.tensordot(factors, shapes, 2)


def _along_gage(length: float) -> tuple[Array, Array]:
    """Places (S,) in m along a gage from its middle, and weights (S,) that sum to one."""
    if not length:
        return np.zeros(1), np.ones(1)
    s, w = gauss(length, _POINTS)
    return s - length / 2, w / length
