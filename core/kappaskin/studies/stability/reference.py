"""Reference of a hard case: its condition, and its answer in extended precision.

Coefficients are compared in the scaled unknowns, each times the length of its column of M, in which
every function bends the skin alike.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy import fft, linalg

from kappaskin.estimation import column_lengths, singular_values
from kappaskin.frames import Array
from kappaskin.studies.stability.gallery import CaseKind, HardCase

# Least squares in extended precision.
#
# Numbers are pairs whose sum counts: the nearest float64 and what is missing from it, 106 bits in
# all (Dekker, doi:10.1007/BF01397083). The residuals of the augmented system r + A g = b, A^T r = 0
# are taken in them and corrected with one factorisation in float64 (Bjorck,
# doi:10.1007/BF01939321), until nothing changes any more.

_SPLITTER = 2.0**27 + 1
_STEPS = 60
_DONE = 1e-18  # of the solution: so small must the last correction be
_CONTRACTS = 0.5  # a correction longer than this share of the one before: no more to gain


def _two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    """a + b as a pair, without error."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


def _halves(a: Array) -> tuple[Array, Array]:
    t = _SPLITTER * a
    high = t - (t - a)
    return high, a - high


def _two_product(a: Array, b: Array) -> tuple[Array, Array]:
    """a b as a pair, without error."""
    p = a * b
    (a1, a2), (b1, b2) = _halves(a), _halves(b)
    return p, ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2


@dataclass(frozen=True, slots=True, eq=False)
class DoubleDouble:
    """Numbers to 106 bits: `high`, the nearest float64, and `low`, what is missing from it."""

    high: Array
    low: Array

    @classmethod
    def of(cls, values: Array) -> "DoubleDouble":
        return cls(values, np.zeros_like(values))

    @classmethod
    def _carried(cls, high: Array, low: Array) -> "DoubleDouble":
        s = high + low
        return cls(s, low - (s - high))

    def __add__(self, other: "DoubleDouble") -> "DoubleDouble":
        s, e = _two_sum(self.high, other.high)
        return DoubleDouble._carried(s, e + (self.low + other.low))

    def __neg__(self) -> "DoubleDouble":
        return DoubleDouble(-self.high, -self.low)

    def __sub__(self, other: "DoubleDouble") -> "DoubleDouble":
        return self + -other

    def before(self, A: Array) -> "DoubleDouble":
        """A (R, N) times these numbers (N,)."""
        p, e = _two_product(A, self.high)
        terms = DoubleDouble._carried(p, e + A * self.low)
        while (count := terms.high.shape[1]) > 1:  # halved by adding, so that errors stay few
            half = count // 2
            left = DoubleDouble(terms.high[:, :half], terms.low[:, :half])
            added = left + DoubleDouble(
                terms.high[:, half : 2 * half], terms.low[:, half : 2 * half]
            )
            odd = terms.high[:, 2 * half :], terms.low[:, 2 * half :]
            terms = DoubleDouble(np.hstack([added.high, odd[0]]), np.hstack([added.low, odd[1]]))
        return DoubleDouble(terms.high[:, 0], terms.low[:, 0])


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """The unknowns g (F,) and what they leave of the readings, r = b - A g (R,)."""

    unknowns: DoubleDouble
    residual: DoubleDouble


def least_squares(A: Array, free: Array | None, b: Array) -> Solution | None:
    """The g (F,) that make |b - A W g| smallest, for A (R, N) and `free` W (N, F), b (R,).

    W is the identity when None. None where A W has not full rank to float64, so that no correction
    gets any nearer; its columns should be of about equal length.
    """
    factors = [A] if free is None else [A, free]
    product: Array = A if free is None else A @ free
    if product.shape[0] < product.shape[1]:
        return None
    Q, R = cast("tuple[Array, Array]", linalg.qr(product, mode="economic"))
    if not np.abs(np.diag(R)).min() > 0:
        return None
    g = DoubleDouble.of(np.zeros_like(product[0]))
    r, K = DoubleDouble.of(b), DoubleDouble.of(b)
    last = np.inf
    for _ in range(_STEPS):
        f = K - r - _applied(factors, g)
        h = -_applied([X.T for X in reversed(factors)], r)
        u = linalg.solve_triangular(R, h.high, trans="T")
        seen = Q.T @ f.high
        step = linalg.solve_triangular(R, seen - u)
        g, r = g + DoubleDouble.of(step), r + DoubleDouble.of(f.high + Q @ (u - seen))
        change, size = float(np.linalg.norm(step)), float(np.linalg.norm(g.high))
        if not change > _DONE * size:
            return Solution(g, r)
        if not change <= _CONTRACTS * last:
            break
        last = change
    return None


def _applied(factors: list[Array], x: DoubleDouble) -> DoubleDouble:
    for A in reversed(factors):
        x = x.before(A)
    return x


# The reference

_Precise = NDArray[np.longdouble]
_EPS = float(np.finfo(float).eps)
_TWO_DIGITS = 0.01


@dataclass(frozen=True, eq=False)
class Reference:
    """Of a case's first frame: what decides how far rounding may move the least-squares answer.

    `free` W (N, F) and `length` (F,) of the columns of M W; `condition` of the scaled M W and
    `unscaled` of M as Eq. 6 has it, infinite where not all is determined; `norm` of the scaled M W.
    `readings` is the norm in 1/m of the `count` R readings, `left` that of what least squares
    leaves of them; of readings that differ in unit, over their sigma. `answer` (N,) in m is that of
    least squares without rounding, if there is one.
    """

    free: Array | None
    length: Array
    condition: float
    unscaled: float
    norm: float
    count: int
    readings: float
    left: float
    answer: Array | None

    def scaled(self, coefficients: Array) -> Array:
        """The scaled unknowns (F,) of `coefficients` (N,)."""
        W = self.free
        return self.length * (coefficients if W is None else self._inverse @ coefficients)

    @cached_property
    def _inverse(self) -> Array:
        W = np.empty(0) if self.free is None else self.free
        return np.linalg.pinv(W).astype(float)

    def allowed(self, size: float, eps: float) -> float:
        """How far rounding may move scaled unknowns of the norm `size`.

        Wedin's bound (doi:10.1007/BF01933494) for relative errors e of M and the readings,
        e k (|g| + |b| / |A| + k |r| / |A|) with the scaled condition k. Sums of R terms make e
        about 2 sqrt(R) `eps`.
        """
        k, e = self.condition, 2 * math.sqrt(self.count) * eps
        return e * k * (size + (self.readings + k * self.left) / self.norm)

    def near(self, coefficients: Array, other: Array, eps: float) -> bool:
        """Whether two answers differ by rounding alone, which must leave two digits of them."""
        g, h = self.scaled(coefficients), self.scaled(other)
        size = float(np.linalg.norm(h))
        allowed = self.allowed(size, eps)
        return allowed <= _TWO_DIGITS * size and float(np.linalg.norm(g - h)) <= allowed

    def digits_lost(self, coefficients: Array, eps: float) -> float | None:
        """-log10(eps) less the correct digits of the scaled unknowns, at least 0."""
        if self.answer is None:
            return None
        g, h = self.scaled(coefficients), self.scaled(self.answer)
        off, size = float(np.linalg.norm(g - h)), float(np.linalg.norm(h))
        if not math.isfinite(off):
            return -math.log10(eps)
        if off <= eps * size:
            return 0.0
        return min(math.log10(off / (eps * size)), -math.log10(eps)) if size else -math.log10(eps)


def reference_of(case: HardCase) -> Reference:
    """The reference of the readings that the first frame has."""
    if case.kind is CaseKind.LARGE:
        return _by_transforms(case)
    used = case.layout.live & np.isfinite(case.curvature[0])
    scale = None if case.sigma is None or not case.layout.reads else 1 / case.sigma
    layout = replace(case.layout, live=used, scale=scale)
    M = layout.operator(case.basis)[used.ravel()]
    b, W = (case.curvature[0] * (1.0 if scale is None else scale))[used], case.basis.free
    A = M if W is None else M @ W
    length = column_lengths(A)
    values = singular_values(case.basis, layout)[0][: len(length)]
    k = _condition(values, A.shape)
    bare = _condition(np.linalg.svd(M, compute_uv=False).astype(float), M.shape)
    R, size = len(b), float(np.linalg.norm(b))
    if not math.isfinite(k):
        return Reference(W, length, k, bare, float(values.max(initial=0.0)), R, size, size, None)
    # Scaled by powers of two, which round nothing.
    two = np.exp2(np.rint(np.log2(length)))
    found = least_squares(M, W / two, b) if W is not None else least_squares(M / two, None, b)
    if found is None:
        return Reference(W, length, k, bare, float(values[0]), R, size, size, None)
    g = found.unknowns.high / two
    answer = g if W is None else W @ g
    left = float(np.linalg.norm(found.residual.high))
    return Reference(W, length, k, bare, float(values[0]), R, size, left, answer)


def _condition(values: Array, shape: tuple[int, int]) -> float:
    """The first singular value over the last; infinite where the last are rounding."""
    if shape[0] < shape[1] or not values[-1] > values[0] * max(shape) * _EPS:
        return math.inf
    return float(values[0] / values[-1])


def _by_transforms(case: HardCase) -> Reference:
    """Of sines on a regular grid of more elements: M^T M is diagonal, M^T K three transforms.

    They are computed in extended precision, 64 bits where the machine has them.
    """
    (Ni, Nj), (m, n), patch = (
        case.basis.shape,
        cast("tuple[int, int]", case.layout.shape),
        case.basis.patch,
    )
    K = case.curvature[0].reshape(3, n, m).swapaxes(1, 2).astype(np.longdouble)
    pi = 4 * np.arctan(np.longdouble(1))
    k = np.arange(1, Ni + 1)[:, None] * pi / patch.a
    l = np.arange(1, Nj + 1) * pi / patch.b
    xx, yy = (cast("_Precise", fft.dstn(X, 2))[:Ni, :Nj] for X in K[:2])
    xy = cast("_Precise", fft.dctn(K[2], 2))[1 : Ni + 1, 1 : Nj + 1]
    d = m * n / 4 * (k**4 + l**4 + k**2 * l**2)
    c = (k * l * xy - k**2 * xx - l**2 * yy) / (4 * d)
    b, length = float(np.linalg.norm(case.curvature[0])), np.sqrt(d).ravel().astype(float)
    left = math.sqrt(max(b**2 - float(np.sum(d * c**2)), 0.0))
    spread = float(length.max() / length.min())
    return Reference(None, length, 1.0, spread, 1.0, K.size, b, left, c.ravel().astype(float))
