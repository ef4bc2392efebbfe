"""Shells: readings and deflection of a bent skin that stretches as it bends."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, repeat
from typing import Protocol

import numpy as np
from numpy.polynomial import legendre

from kappaskin.bases import gauss
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics.plate import Plate

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
# with D = E h^3 / (12 (1 - nu^2)) and C = E h / (1 - nu^2). Gages read k_x, k_y and t. The curved
# ends hold f and v and let u go: f and v go as sin(q y), u as cos(q y) with q = j pi/b, and no wave
# j mixes with another. The straight edges hold f and, as they are held in plane, v and u.

_MOST_FUNCTIONS, _MOST_WAVES = 96, 160
_DIAGONAL = 1 / math.sqrt(2)
_POINTS = 12  # along a gage: exact to rounding for waves as short as the gage


class Gages(Protocol):
    """P elements at `positions` (P, 2) in m whose gages are `gage_length` long in m."""

    @property
    def positions(self) -> Array: ...

    @property
    def gage_length(self) -> float: ...


@dataclass(frozen=True)
class _ArcFunctions:
    """Functions on the arc [0, a]: integrals of `count` Legendre polynomials.

    Those of f vanish at the ends, those of v and u where they are held. f'', v' and u' are
    orthonormal, but for the lines of a v or u that is not held.
    """

    a: float
    count: int
    v_held: bool
    u_held: bool

    @property
    def sizes(self) -> tuple[int, int, int]:
        """The numbers of functions of f, v and u."""
        N = self.count
        return N, N + 2 * (not self.v_held), N + 2 * (not self.u_held)

    def at(self, x: Array) -> tuple[Array, Array, Array]:
        """f (3, X, N), v (2, X, Nv) and u (2, X, Nu) and their derivatives at `x` (X,) in m."""
        N, half = self.count, self.a / 2
        t = x / half - 1
        P = legendre.legvander(t, N + 2)
        n = np.arange(N + 2)
        # The integral of P_n, n > 0, is (P_{n+1} - P_{n-1}) / (2n + 1) and vanishes at both ends.
        once = np.zeros((len(x), N + 2))
        once[:, 1:] = (P[:, 2:] - P[:, :-2]) / (2 * n[1:] + 1)
        twice, slope = np.empty((len(x), N)), once[:, :N].copy()
        slope[:, 0], twice[:, 0] = P[:, 1], once[:, 1]
        slope[:, 1], twice[:, 1] = P[:, 2] / 3, once[:, 2] / 3
        twice[:, 2:] = (once[:, 3 : N + 1] - once[:, 1 : N - 1]) / (2 * n[2:N] + 1)
        scale: Array = np.sqrt((2 * n + 1) / self.a)
        f: Array = np.stack([half**2 * twice, half * slope, P[:, :N]]) * scale[:N]
        held: Array = np.stack([half * once[:, 1 : N + 1], P[:, 1 : N + 1]]) * scale[1 : N + 1]
        lines = np.stack([np.stack([half + 0 * t, half * t], -1), np.stack([0 * t, 1 + 0 * t], -1)])
        free: Array = np.concatenate([lines * scale[0], held], axis=2)
        return f, held if self.v_held else free, held if self.u_held else free


class Shell:
    """A bent skin as a shell that stretches, hinged: Ritz's method, resolved for small loads.

    `finest` in m is the least standard deviation of a load. `sliding` edges let the hoop
    displacement go however they are held in plane.
    """

    def __init__(self, plate: Plate, finest: float = 1e-3, sliding: bool = False) -> None:
        patch = plate.patch
        if not patch.base_curvature or patch.strip:
            raise Refusal(f"expected a skin that is bent, with two sides, got a {patch.name}")
        # A Gaussian has exp(-8) of its amplitude left at the wave number 4 / sd.
        functions, waves = math.ceil(2 * patch.a / finest), math.ceil(4 * patch.b / finest / np.pi)
        if functions > _MOST_FUNCTIONS or waves > _MOST_WAVES:
            least = max(2 * patch.a / _MOST_FUNCTIONS, 4 * patch.b / np.pi / _MOST_WAVES)
            raise Refusal(
                f"expected a load of a standard deviation of at least {least:.3g} m on a "
                f"{patch.name}, got {finest:g} m"
            )
        self.plate, self.finest = plate, finest
        edge = plate.inplane_edge
        self._arc = _ArcFunctions(
            patch.a,
            max(functions, 16),
            v_held=edge in ("hoop", "held") and not sliding,
            u_held=edge in ("diaphragm", "held"),
        )
        self._q = np.pi / patch.b * np.arange(1, max(waves, 16) + 1)
        self._x, self._weights = gauss(patch.a, 2 * self._arc.count + 16)

    def _split(self) -> list[slice]:
        ends = np.cumsum((0, *self._arc.sizes))
        return [slice(a, b) for a, b in pairwise(ends)]

    def _strains(self) -> tuple[Array, Array]:
        """Strains (3, 9, X, n) of the functions by powers of q, and their stiffness (9, 9).

        e_x, e_y, g, k_x, k_y, t, f_x, f_y, f.
        """
        H, (F, V, U) = self.plate.patch.base_curvature, self._split()
        f, v, u = self._arc.at(self._x)
        S = np.zeros((3, 9, len(self._x), U.stop))
        S[0, 0, :, F], S[0, 0, :, V] = -H * f[0], v[1]
        S[1, 1, :, U] = -u[0]
        S[1, 2, :, V], S[0, 2, :, U] = v[0], u[1]
        S[0, 3, :, F], S[0, 3, :, V] = f[2], H * v[1]
        S[2, 4, :, F] = -f[0]
        S[1, 5, :, F], S[1, 5, :, V], S[0, 5, :, U] = f[1], 3 / 4 * H * v[0], -H / 4 * u[1]
        S[0, 6, :, F], S[1, 7, :, F], S[0, 8, :, F] = f[1], f[0], f[0]
        return S, self._law()

    def _law(self) -> Array:
        plate, nu = self.plate, self.plate.poisson
        D, T, H = plate.rigidity, plate.tension, plate.patch.base_curvature
        C = plate.stretching / (1 - nu**2)
        law = np.diag(
            [C, C, C * (1 - nu) / 2, D, D, 2 * D * (1 - nu), T, T, plate.foundation - T * H**2]
        )
        law[0, 1] = law[1, 0] = nu * C
        law[3, 4] = law[4, 3] = nu * D
        return law

    @cached_property
    def _answer(self) -> Array:
        """The displacements (J, n, N) in m of each wave under unit forces on the functions of f."""
        strains, law = self._strains()
        n, F = strains.shape[-1], self._split()[0]
        stress = np.einsum("ij,pjxn,x->pixn", law, strains, self._weights).reshape(3, -1, n)
        strain = strains.reshape(3, -1, n)
        powers = np.zeros((5, n, n))
        for a in range(3):
            for b in range(3):
                powers[a + b] += strain[a].T @ stress[b]
        K: Array = np.tensordot(self._q[:, None] ** np.arange(5), powers, 1)
        scale: Array = 1 / np.sqrt(np.einsum("jnn->jn", K))
        scaled: Array = K * scale[:, :, None] * scale[:, None, :]
        forces = np.zeros((len(K), n, self._arc.count))
        forces[:, F] = np.eye(self._arc.count) * scale[:, None, F]
        # The integral of sin^2 or cos^2 along y is b / 2.
        answer: Array = np.linalg.solve(scaled, forces) * scale[:, :, None]
        return answer * (2 / self.plate.patch.b)

    def _loads(self, x: Array, sd: float) -> tuple[Array, Array]:
        """Forces (N, X) on the functions of f under unit loads at `x`, and their second derivative.

        Beyond the ends the load is reflected with the other sign, as sines do along y.
        """
        a, f = self.plate.patch.a, self._arc.at(self._x)[0][0]
        load, second = np.zeros((2, len(self._x), len(x)))
        for sign, centre in ((1, x), (-1, -x), (-1, 2 * a - x)):
            r = (self._x[:, None] - centre) / sd
            bell = sign * np.exp(-(r**2) / 2) / (sd * math.sqrt(2 * np.pi))
            load += bell
            second += bell * (r**2 - 1) / sd**2
        felt = f.T * self._weights
        return felt @ load, felt @ second

    def readings_under(self, gages: Gages, x: Array, y: Array, sd: float) -> tuple[Array, Array]:
        """Readings (2, ny, nx, 3 P) under 1 N at each node of `x` (nx,), `y` (ny,), and its give.

        The load is a Gaussian of standard deviation `sd`; all in m. The first are the readings in
        1/m per N, xx of all elements, then yy, then xy; the second their Laplacian by the load's
        place in 1/m^3 per N. The give (ny, nx) in m per N is the displacement at the load's centre.
        """
        if sd < self.finest * (1 - 1e-9):
            raise Refusal(
                f"expected a load of a standard deviation of at least {self.finest:g} m, got {sd:g}"
            )
        q, P = self._q, len(gages.positions)
        along = np.exp(-((q * sd) ** 2) / 2) * np.sin(np.multiply.outer(y, q))  # (ny, J)
        answer = self._answer @ np.hstack(self._loads(x, sd))  # (J, n, 2 nx)
        answer[:, :, len(x) :] -= q[:, None, None] ** 2 * answer[:, :, : len(x)]
        at, place = np.unique(gages.positions[:, 0], return_inverse=True)
        T = np.empty((2, len(y), len(x), 3, P))
        for c, rows in enumerate(self._rows(at, gages.gage_length)):
            read = np.stack([row @ of for row, of in zip(rows, answer, strict=False)])
            read = read.reshape(len(q), len(at), 2, len(x)).transpose(2, 1, 0, 3)  # (2, U, J, nx)
            turn = np.cos if c == 2 else np.sin
            for p, (u, z) in enumerate(zip(place, gages.positions[:, 1], strict=True)):
                T[:, :, :, c, p] = (along * turn(q * z)) @ read[:, u]
        f = self._arc.at(x)[0][0]
        own = np.einsum("xn,jnx->jx", f, answer[:, self._split()[0], : len(x)])
        give = (along * np.sin(np.multiply.outer(y, q))) @ own
        return T.reshape(2, len(y), len(x), 3 * P), give

    def _rows(self, x: Array, gage_length: float) -> tuple[Iterable[Array], ...]:
        """For xx, yy and xy the readings (X, n) of the functions at `x` (X,), wave by wave.

        They are the factors of sin(q y), sin(q y) and cos(q y). A gage along a diagonal reads the
        mean of (k_x + k_y) / 2 + t or - t; the twist is half of what the two differ by.
        """
        H, q = self.plate.patch.base_curvature, self._q[:, None]
        s, w = _along_gage(gage_length)
        _, _, fxx, _, vx, _ = self._spread(np.add.outer(s, x))
        straight = self._spread(x)[0]
        xx: Array = np.einsum("s,sxn->xn", w, fxx + H * vx)
        shorter = np.sinc(q * gage_length / (2 * np.pi)) * q**2
        yy = (-k * straight for k in shorter)
        f, fx, fxx, v, vx, ux = self._spread(np.add.outer(s * _DIAGONAL, x))
        shapes = np.stack([fx + 3 / 4 * H * v, ux, fxx + H * vx, f])
        cos, sin = w * np.cos(q * s * _DIAGONAL), w * np.sin(q * s * _DIAGONAL) / 2
        factors = np.stack([q * cos, -H / 4 * cos, sin, -(q**2) * sin], axis=1)
        return repeat(xx), yy, np.tensordot(factors, shapes, 2)

    def _spread(self, x: Array) -> Array:
        """f, f_x, f_xx, v, v_x, u_x (6, ..., n) of all functions at `x` (...) in m."""
        (F, V, U), (f, v, u) = self._split(), self._arc.at(x.ravel())
        rows = np.zeros((6, x.size, U.stop))
        rows[:3, :, F], rows[3:5, :, V], rows[5, :, U] = f, v, u[1]
        return rows.reshape(6, *x.shape, U.stop)


def _along_gage(length: float) -> tuple[Array, Array]:
    """Places (S,) in m along a gage from its middle, and weights (S,) that sum to one."""
    if not length:
        return np.zeros(1), np.ones(1)
    s, w = gauss(length, _POINTS)
    return s - length / 2, w / length
