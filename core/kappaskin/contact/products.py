"""A place on the skin to how a point load there reads: products with itself and with readings."""

import math
from typing import NamedTuple, Protocol

import numpy as np
from scipy.linalg import blas

from kappaskin.bases import Basis, SineBasis
from kappaskin.frames import Array


class Products(NamedTuple):
    """Scalar products of T, what a unit load at a place makes of the readings, and its slopes.

    `tt`, `tx`, `ty`, `xx`, `xy`, `yy` are those of T, T_x and T_y with each other, `h`, `hx` and
    `hy` those with the readings; `gives` in m/N is how far the load moves the skin below it.
    """

    tt: float
    tx: float
    ty: float
    xx: float
    xy: float
    yy: float
    h: float
    hx: float
    hy: float
    gives: float


class Loads(Protocol):
    """Point loads at every place, read by the same channels."""

    def on_grid(self, x: Array, y: Array) -> Array:
        """T'T (ny, nx) on the grid of `x` (nx,), `y` (ny,) in m."""
        ...

    def at(self, x: float, y: float, h: Array) -> Products:
        """The products at (x, y) in m; `h` (N,) are those of each function with the readings."""
        ...


def loads_on(basis: Basis, G: Array, C: Array) -> Loads:
    """The loads whose functions have the products G = M'M (N, N); C (N, N) in m/N is how they give.

    M (R, N) is what the channels read of unit modal forces.
    """
    if isinstance(basis, SineBasis) and not basis.patch.strip:
        return _Sines(basis, G, C)
    return _Dense(basis, G, C)


class _Dense:
    """With F the functions and their slopes along x and y, F G F' holds the products."""

    def __init__(self, basis: Basis, G: Array, C: Array) -> None:
        self._basis, self._G, self._C = basis, np.asfortranarray(G), C

    def on_grid(self, x: Array, y: Array) -> Array:
        points = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
        functions = self._basis.at(points)
        return np.vecdot(functions @ self._G, functions).reshape(len(y), len(x))

    def at(self, x: float, y: float, h: Array) -> Products:
        F = self._basis.jet(x, y)[:3]
        # Faster than one thin product: of a symmetric G in Fortran's order only half is read.
        GF = np.array([blas.dsymv(1.0, self._G, f) for f in F])
        (tt, tx, ty), (_, xx, xy), (_, _, yy) = (GF @ F.T).tolist()
        gives = float(F[0] @ blas.dsymv(1.0, self._C, F[0]))
        hh, hx, hy = (F @ h).tolist()
        return Products(tt, tx, ty, xx, xy, yy, hh, hx, hy, gives)


# Products of two sines are sums of few waves: with t = pi x/a,
#     sin(i t) sin(k t) = sin(t) (sin((|i - k| + 1) t) + sin((|i - k| + 3) t) + ... ),
#     cos(i t) cos(k t) = (cos((i - k) t) + cos((i + k) t)) / 2,
#     cos(i t) sin(k t) = (sin((i + k) t) - sin((i - k) t)) / 2,
# the first up to i + k - 1, so that T'T is as exact near the rim, where it vanishes, as inside.
# Of G, N^2 numbers for N functions, tables of about 4 N are left, which a cache holds.


class _Sines:
    """Sines: every product of T and its slopes is a sum of waves along x times waves along y."""

    def __init__(self, basis: SineBasis, G: Array, C: Array) -> None:
        patch, self._shape = basis.patch, basis.shape
        Ni, Nj = self._shape
        self._kx, self._ky = kx, ky = np.pi / patch.a, np.pi / patch.b
        (ss_x, cc_x, cs_x), (ss_y, cc_y, cs_y) = _waves(Ni, kx), _waves(Nj, ky)
        sc_y = cs_y.swapaxes(1, 2)

        def table(in_x: Array, values: Array, in_y: Array) -> Array:
            """How much of each wave in x (2 Ni + 1) times each in y (2 Nj + 1) there is."""
            pairs = values.reshape(Ni, Nj, Ni, Nj).transpose(0, 2, 1, 3).reshape(Ni * Ni, Nj * Nj)
            return in_x.reshape(-1, Ni * Ni) @ pairs @ in_y.reshape(-1, Nj * Nj).T

        self._squares = tt = table(ss_x, G, ss_y)
        p, q = np.arange(2.0 * Ni + 1)[:, None], np.arange(2.0 * Nj + 1)
        # Times the sines of y, and times its cosines.
        self._of_sines = np.vstack(
            [tt, p * tt, table(cc_x, G, ss_y), table(cs_x, G, sc_y), table(ss_x, C, ss_y)]
        )
        self._of_cosines = np.vstack([q * tt, table(ss_x, G, cc_y)])
        self._turns = np.zeros((2, p.size + q.size), complex)
        self._turns[0, : p.size], self._turns[1, p.size :] = 1j * kx * p.ravel(), 1j * ky * q
        self._jet_x, self._jet_y = (
            np.stack([k * np.arange(1.0, count + 1), np.ones(count)], axis=-1)
            for k, count in ((kx, Ni), (ky, Nj))
        )

    def on_grid(self, x: Array, y: Array) -> Array:
        Ni, Nj = self._shape
        X = np.sin(np.multiply.outer(np.arange(2 * Ni + 1), self._kx * x))
        Y = np.sin(np.multiply.outer(np.arange(2 * Nj + 1), self._ky * y))
        return np.multiply.outer(Y[1], X[1]) * (Y.T @ self._squares.T @ X)

    def at(self, x: float, y: float, h: Array) -> Products:
        Ni, Nj = self._shape
        # Cosine and sine (..., 2) of each wave.
        waves = np.exp(np.dot((x, y), self._turns)).view(float).reshape(-1, 2)
        X, Y = waves[: 2 * Ni + 1], waves[2 * Ni + 1 :]
        by_sines = self._of_sines.dot(Y[:, 1]).reshape(5, -1).dot(X).tolist()
        by_cosines = self._of_cosines.dot(Y[:, 0]).reshape(2, -1).dot(X).tolist()
        (_, tt), (p_tt, _), (xx, _), (_, xy), (_, gives) = by_sines
        (_, q_tt), (_, yy) = by_cosines
        jet_x, jet_y = X[1 : Ni + 1] * self._jet_x, Y[1 : Nj + 1] * self._jet_y
        (_, hx), (hy, hh) = jet_x.T.dot(h.reshape(Ni, Nj)).dot(jet_y).tolist()
        kx, ky, sx, sy = self._kx, self._ky, math.sin(self._kx * x), math.sin(self._ky * y)
        return Products(
            sx * sy * tt,
            kx / 2 * sy * (math.cos(kx * x) * tt + sx * p_tt),
            ky / 2 * sx * (math.cos(ky * y) * tt + sy * q_tt),
            sy * xx,
            xy,
            sx * yy,
            hh,
            hx,
            hy,
            sx * sy * gives,
        )


def _waves(count: int, k: float) -> tuple[Array, Array, Array]:
    """Sines times sines, slopes times slopes, and slopes times sines as waves.

    Each (2 count + 1, count, count), for every pair of sines of wave numbers k, 2 k ...; the first
    has the sine of wave number k taken out.
    """
    i, j = np.indices((count, count)) + 1
    n = np.arange(2 * count + 1)[:, None, None]
    apart, both = np.abs(i - j), i + j
    sines = (n > apart) & (n < both) & ((n - apart) % 2 == 1)
    at_apart, at_both = n == apart, n == both
    slopes = k**2 * i * j / 2 * (1.0 * at_apart + at_both)
    mixed = k * i / 2 * (at_both - np.sign(i - j) * at_apart)
    return sines.astype(float), slopes, mixed
