"""A matrix and readings to their least-squares solution, to more digits than float64 has.

Numbers are pairs whose sum counts: the nearest float64 and what is missing from it, 106 bits in
all (Dekker, doi:10.1007/BF01397083). The residuals of the augmented system r + A g = b, A^T r = 0
are taken in them and corrected with one factorisation in float64 (Bjorck,
doi:10.1007/BF01939321), until nothing changes any more.
"""

from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy import linalg

from kappaskin.frames import Array

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
class Pair:
    """Numbers to 106 bits: `high`, the nearest float64, and `low`, what is missing from it."""

    high: Array
    low: Array

    @classmethod
    def of(cls, values: Array) -> "Pair":
        return cls(values, np.zeros_like(values))

    @classmethod
    def _carried(cls, high: Array, low: Array) -> "Pair":
        s = high + low
        return cls(s, low - (s - high))

    def __add__(self, other: "Pair") -> "Pair":
        s, e = _two_sum(self.high, other.high)
        return Pair._carried(s, e + (self.low + other.low))

    def __neg__(self) -> "Pair":
        return Pair(-self.high, -self.low)

    def __sub__(self, other: "Pair") -> "Pair":
        return self + -other

    def before(self, A: Array) -> "Pair":
        """A (R, N) times these numbers (N,)."""
        p, e = _two_product(A, self.high)
        terms = Pair._carried(p, e + A * self.low)
        while (count := terms.high.shape[1]) > 1:  # halved by adding, so that errors stay few
            half = count // 2
            left = Pair(terms.high[:, :half], terms.low[:, :half])
            added = left + Pair(terms.high[:, half : 2 * half], terms.low[:, half : 2 * half])
            odd = terms.high[:, 2 * half :], terms.low[:, 2 * half :]
            terms = Pair(np.hstack([added.high, odd[0]]), np.hstack([added.low, odd[1]]))
        return Pair(terms.high[:, 0], terms.low[:, 0])


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """The unknowns g (F,) and what they leave of the readings, r = b - A g (R,)."""

    unknowns: Pair
    residual: Pair


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
    g = Pair.of(np.zeros_like(product[0]))
    r, K = Pair.of(b), Pair.of(b)
    last = np.inf
    for _ in range(_STEPS):
        f = K - r - _applied(factors, g)
        h = -_applied([X.T for X in reversed(factors)], r)
        u = linalg.solve_triangular(R, h.high, trans="T")
        seen = Q.T @ f.high
        step = linalg.solve_triangular(R, seen - u)
        g, r = g + Pair.of(step), r + Pair.of(f.high + Q @ (u - seen))
        change, size = float(np.linalg.norm(step)), float(np.linalg.norm(g.high))
        if not change > _DONE * size:
            return Solution(g, r)
        if not change <= _CONTRACTS * last:
            break
        last = change
    return None


def _applied(factors: list[Array], x: Pair) -> Pair:
    for A in reversed(factors):
        x = x.before(A)
    return x
