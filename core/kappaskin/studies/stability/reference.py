"""A case to what rounding may cost in it: conditions, and the answer to more digits than asked for.

Coefficients are compared in the scaled unknowns, each times the length of its column of M, in which
every function bends the skin alike.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from kappaskin.estimation import column_lengths, singular_values
from kappaskin.frames import Array
from kappaskin.studies.stability.case import Case, Kind
from kappaskin.studies.stability.precise import least_squares

_Precise = NDArray[np.longdouble]
_EPS = float(np.finfo(float).eps)
_TWO_DIGITS = 0.01


@dataclass(frozen=True, eq=False)
class Reference:
    """Of a case's first frame: what decides how far rounding may move the least-squares answer.

    `free` W (N, F) and `length` (F,) of the columns of M W; `condition` of the scaled M W and
    `unscaled` of M as Eq. 6 has it, infinite where not all is determined; `norm` of the scaled M W.
    `readings` is the norm in 1/m of the `count` R readings, `left` that of what least squares
    leaves of them. `answer` (N,) in m is that of least squares without rounding, if there is one.
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


def reference_of(case: Case) -> Reference:
    """The reference of the readings that the first frame has."""
    if case.kind is Kind.LARGE:
        return _by_transforms(case)
    used = case.layout.live & np.isfinite(case.curvature[0])
    M = case.layout.curvature_operator(case.basis)[used.ravel()]
    b, W = case.curvature[0][used], case.basis.free
    A = M if W is None else M @ W
    length = column_lengths(A)
    values = singular_values(case.basis, replace(case.layout, live=used))[0][: len(length)]
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


def _by_transforms(case: Case) -> Reference:
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
