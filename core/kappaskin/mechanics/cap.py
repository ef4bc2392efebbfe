"""Caps: how a domed skin that stretches gives, and what it reads."""

import math

import numpy as np

from kappaskin.bases import CapBasis, gauss, radial
from kappaskin.frames import Array
from kappaskin.skin import Meridian

# Sanders' and Koiter's theory of a shell of revolution, with the displacement f inward and the
# tangential ones u along the meridian and v around, r the radius of the parallel and ' the
# derivative by the arc s. Of the wave m around, f = F cos m t, u = U cos m t, v = V sin m t:
#
#     strain       e_s = U' - k1 F      e_t = (m V + r' U) / r - k2 F      g = V' - (m U + r' V) / r
#     reading      ss = F'' + k1^2 F + k1' U
#                  tt = r' F' / r - m^2 F / r^2 + k2^2 F + k2' U
#                  st = m (r' F / r - F') / r + (k2 - k1) (V' + (m U + r' V) / r) / 2 + k2' V
#     curvature    ss + k1 e_s      tt + k2 e_t      st + (k1 + k2) g / 4
#
# The energy is that of a cylinder (shell.py) with these, the tension's with k1^2 + k2^2 for H^2.
# The readings are those of gages back to back, as there: half of what the strains at z and -z
# differ by, over z. At z a line is 1 + z k times as long, so that they are the changes of the
# second form less k e twice. In general they are f_;ij + (K^2)_ij f, what the rotation of the skin
# in its plane turns the form K by, and what u carries it: on a sphere the first two terms alone.
#
# Smooth at the pole, (u + i v) turned to the fixed frame, are A r^(m+1) and B r^|m-1| times
# polynomials of r^2: U = A + B and V = A - B. Nothing presses the skin along itself: they are those
# of the least energy for a given F. No wave m mixes with another.

# A load spread evenly over a disc of radius r feels of a wave of a membrane over the cap, which has
# -(f_;ss + f_;tt) = k^2 f, 2 J1(k r) / (k r) times its value in the middle: exactly on a plane.

_MORE = 12  # functions of u and v along the meridian, more than f has
_AT_POLE = 1e-8  # of the arc to the rim: nearer, nothing depends on u and v


def _radii(fineness: int) -> tuple[Array, Array]:
    """Radii (Q,) of the unit disk and weights (Q,) of an integral over them.

    Every product of two functions times the radius is one of r^2 times r: half as many points do.
    """
    squares, weights = gauss(1.0, math.ceil(fineness / 2))
    rho: Array = np.sqrt(squares)
    return rho, weights / (2 * rho)


def _parts(k: int, Q: int, M: int, n: int) -> Array:
    """Zeros (k, Q, M, n) in the order that `_products` has them in."""
    return np.moveaxis(np.zeros((M, k, Q, n)), 0, 2)


def _products(S: Array) -> Array:
    """S' S (M, n, n) of parts S (k, Q, M, n)."""
    rows = np.ascontiguousarray(np.moveaxis(S, 2, 0)).reshape(S.shape[2], -1, S.shape[3])
    return np.matmul(np.swapaxes(rows, 1, 2), rows)


class CapShell:
    """A cap of D in N m, C and T in N/m, nu and k_f in N/m^3, on the functions of a `basis`.

    Its rim holds u and v, or with `u_free` v alone.
    """

    def __init__(
        self,
        basis: CapBasis,
        D: float,
        C: float,
        nu: float,
        T: float = 0.0,
        k_f: float = 0.0,
        u_free: bool = False,
    ) -> None:
        self._basis, self._u_free = basis, u_free
        self._m = np.arange(basis.Nj // 2 + 1)
        self._count = basis.Ni + _MORE
        rho, weights = _radii(2 * self._count + len(self._m) + 24)
        a = basis.cap.rim_radius
        along, m = basis.cap.meridian(a * rho), self._m[:, None]
        F = basis.along(rho) / np.array([1.0, a, a**2])[:, None, None, None]
        r = along.radius[:, None, None]
        area: Array = np.pi * a * weights[:, None, None] * r * np.where(m > 0, 1.0, 2.0)
        self.volume: Array = np.einsum("qi,q->i", F[0, :, 0], area[:, 0, 0])
        """The integral (Ni,) in m^2 of the functions that are alike all around."""
        S = self._strains(F, rho, along)
        for one, other in ((0, 1), (3, 4)):  # x^2 + y^2 + 2 nu x y = (x + nu y)^2 + (1 - nu^2) y^2
            S[one] += nu * S[other]
            S[other] *= np.sqrt(1 - nu**2)
        law = np.array([C, C, C * (1 - nu) / 2, D, D, 2 * D * (1 - nu)])
        np.multiply(np.sqrt(law[:, None, None, None] * area), S, out=S)
        K = _products(S)
        f, t = slice(0, basis.Ni), slice(basis.Ni, None)
        f_s, f_t, flat = (np.sqrt(area) * of for of in (F[1], m * F[0] / r, F[0]))
        own = K[:, f, f] + T * _products(np.stack([f_s, f_t])) + k_f * _products(flat[None])
        alone: Array = np.einsum("mtt->mt", K[:, t, t])
        scale: Array = 1 / np.sqrt(np.where(alone > 0, alone, 1.0))  # there is no v at m = 0
        Ktt: Array = K[:, t, t] * scale[:, :, None] * scale[:, None, :]
        np.einsum("mtt->mt", Ktt)[:] = 1.0
        coupled: Array = K[:, t, f] * scale[:, :, None]
        least = np.asarray(np.linalg.solve(Ktt, coupled), float)
        self._least = -scale[:, :, None] * least
        squares = T * np.sum(along.curvatures**2, axis=0)
        curved = np.sqrt(squares)[:, None, None] * flat
        relief: Array = np.matmul(K[:, f, t], self._least)
        self.stiffness: Array = own - _products(curved[None]) + relief
        """Stiffness (M, Ni, Ni) in N/m of the functions of each wave m around."""
        self.bare = own
        """The same without u, v and the negative terms, for scaling."""

    def _tangential(self, rho: Array) -> tuple[Array, Array]:
        """U and V of each function of them with their derivatives by s, (2, Q, M, n)."""
        per_arc = np.array([1.0, 1 / self._basis.cap.rim_radius])[:, None, None, None]
        powers = self._m + 1, np.abs(self._m - 1)
        A, B = (per_arc * radial(rho, m, self._count, 1, 2) for m in powers)
        of_u, of_v = [A, B], [A, -B]
        if self._u_free:  # one more of each, alike at the rim
            ends = [radial(np.append(rho, 1.0), m, 1, 0, 2) for m in powers]
            one, other = (per_arc * of[:, :-1] / of[0, -1] for of in ends)
            of_u, of_v = [*of_u, one + other], [*of_v, one - other]
        U, V = np.concatenate(of_u, axis=-1), np.concatenate(of_v, axis=-1)
        U[:, :, 0, self._count : 2 * self._count] = 0.0  # of m = 0 as A
        V[:, :, 0] = 0.0
        return U, V

    def _strains(self, F: Array, rho: Array, along: Meridian) -> Array:
        """Strains (6, Q, M, n): e_s, e_t, g, and of curvature ss, tt and st."""
        (k1, k2), (c1, c2) = along.curvatures[..., None, None], along.changes[..., None, None]
        r, slope = along.radius[:, None, None], along.slope[:, None, None]
        m, Ni = self._m[:, None], self._basis.Ni
        (U, U1), (V, V1) = self._tangential(rho)
        S = _parts(6, len(rho), len(m), Ni + U.shape[-1])
        f, t = S[..., :Ni], S[..., Ni:]
        f[0], f[1] = -k1 * F[0], -k2 * F[0]
        t[0], t[1], t[2] = U1, (m * V + slope * U) / r, V1 - (m * U + slope * V) / r
        f[3], f[4] = F[2] + k1**2 * F[0], (slope * F[1] - m**2 * F[0] / r) / r + k2**2 * F[0]
        f[5] = m * (slope * F[0] / r - F[1]) / r
        t[3], t[4], t[5] = c1 * U, c2 * U, (k2 - k1) / 2 * (V1 + (m * U + slope * V) / r) + c2 * V
        S[3] += k1 * S[0]
        S[4] += k2 * S[1]
        S[5] += (k1 + k2) / 4 * S[2]
        return S

    def _tangential_waves(self, s: Array) -> tuple[Array, Array]:
        """U and V of each function of f, with their derivatives, (2, P, M, Ni), at arcs s (P,)."""
        of = np.stack(self._tangential(s / self._basis.cap.rim_radius))
        U, V = np.moveaxis(np.moveaxis(of, 3, 2) @ self._least, 2, 3)
        return U, V

    def _polar(self, positions: Array) -> tuple[Array, Array]:
        """Distance from the pole in m and azimuth (P,)."""
        x, y = (positions - self._basis.cap.rim_radius).T
        return np.hypot(x, y), np.arctan2(y, x)

    def _by_function(self, cosines: Array, sines: Array) -> Array:
        """Of every function (..., N), of waves (..., M, Ni) as cos m t and as sin m t."""
        Ni, Nj = self._basis.shape
        each = np.swapaxes(np.stack([cosines, sines], axis=-1), -3, -2)
        own = each.reshape(*each.shape[:-3], Ni, -1)  # with a sine of m = 0
        return np.delete(own, 1, axis=-1)[..., :Nj].reshape(*own.shape[:-2], -1)

    def _turned(self, angle: Array) -> tuple[Array, Array]:
        """cos m t and sin m t (P, M, 1)."""
        turn = np.multiply.outer(angle, self._m)[..., None]
        return np.cos(turn), np.sin(turn)

    def curvature_by_wave(self, positions: Array) -> Array:
        """Curvature xx, yy, xy (2, 3, P, M, Ni) in 1/m per m of each wave, at `positions` (P, 2).

        First of waves as cos m t around, then of those as sin m t.
        """
        (s, angle), cap, a = self._polar(positions), self._basis.cap, self._basis.cap.rim_radius
        per_arc = (a ** -np.array([0, 1, 1, 2, 2, 2.0]))[:, None, None, None]
        f, f_s, f_t, ss, st, tt = per_arc * self._basis.around_pole(s / a)
        s = np.maximum(s, _AT_POLE * a)
        along = cap.meridian(s)
        (k1, k2), (c1, c2) = along.curvatures[..., None, None], along.changes[..., None, None]
        r, slope = along.radius[:, None, None], along.slope[:, None, None]
        g = r / s[:, None, None]
        ss += k1**2 * f
        tt = tt / g**2 + (slope - 1 / g) / r * f_s + k2**2 * f
        st = (slope / g - 1) / r * f_t - st / g
        if cap.stretch != 1:
            (U, _), (V, V1) = self._tangential_waves(s)
            m = self._m[:, None]
            ss += c1 * U
            tt += c2 * U
            st += (k2 - k1) / 2 * (V1 + (m * U + slope * V) / r) + c2 * V
        (cos, sin), found = self._turned(angle), np.empty((2, 3, *f.shape))
        c, z = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
        for out, even, odd in ((found[0], cos, sin), (found[1], sin, -cos)):
            twice, mean, half = 2 * c * z * odd * st, even * (ss + tt) / 2, even * (ss - tt) / 2
            out[0] = mean + (c**2 - z**2) * half - twice
            out[1] = mean - (c**2 - z**2) * half + twice
            out[2] = 2 * c * z * half + (c**2 - z**2) * odd * st
        return found

    def curvature_at(self, positions: Array) -> Array:
        """Curvature xx, yy, xy (3, P, N) in 1/m per m of each function at `positions` (P, 2)."""
        return self._by_function(*self.curvature_by_wave(positions))

    def by_function(self, blocks: Array) -> Array:
        """A matrix (N, N) of the functions from its `blocks` (M, Ni, Ni) of each wave m."""
        Ni, Nj = self._basis.shape
        found = np.zeros((Ni, Nj, Ni, Nj))
        for j in range(Nj):
            found[:, j, :, j] = blocks[(j + 1) // 2]
        return found.reshape(Ni * Nj, Ni * Nj)


class CapWaves:
    """The waves of a membrane over a cap with a fixed rim, made of the functions of a `basis`."""

    def __init__(self, basis: CapBasis) -> None:
        a, m = basis.cap.rim_radius, np.arange(basis.Nj // 2 + 1)
        rho, weights = _radii(2 * basis.Ni + len(m) + 24)
        radius = basis.cap.meridian(a * rho).radius[:, None, None]
        self._basis, self._m = basis, m
        f, f_s, _ = np.sqrt(a * weights[:, None, None] * radius) * basis.along(rho)
        gram = _products(f[None])
        slopes = _products(np.stack([f_s / a, m[:, None] * f / radius]))
        inverse = np.asarray(np.linalg.inv(np.linalg.cholesky(gram)), float)
        squares, turned = np.linalg.eigh(inverse @ slopes @ np.swapaxes(inverse, 1, 2))
        self.k: Array = np.sqrt(squares)
        """Wave numbers (M, Ni) in 1/m, for each number m of waves around."""
        shapes: Array = np.swapaxes(inverse, 1, 2) @ turned
        self._shapes = shapes
        self.shares: Array = gram @ shapes
        """From the functions of each m to its waves (M, Ni, Ni): M @ shares are rows on them."""

    def along(self, distance: Array) -> Array:
        """Each wave along a meridian (Q, M, Ni), at each `distance` (Q,) in m from the pole.

        It may be negative: on the other side.
        """
        f = self._basis.along(np.abs(distance) / self._basis.cap.rim_radius, 1)[0]
        odd = (distance[:, None] < 0) & (self._m % 2 == 1)
        waves = np.swapaxes(np.swapaxes(f, 0, 1) @ self._shapes, 0, 1)
        return np.where(odd, -1, 1)[..., None] * waves
