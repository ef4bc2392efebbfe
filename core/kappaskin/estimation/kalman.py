"""Readings as they come to the state of a moving skin: a Kalman filter in square-root form."""

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import scipy
from numpy.typing import DTypeLike
from scipy.linalg import get_blas_funcs, get_lapack_funcs

from kappaskin._state import Stateful
from kappaskin.frames import Array

_BLOCK, _BLOCK_OF_READINGS = 16, 32  # columns that LAPACK reflects at once: the fastest, of 128


@dataclass(frozen=True, slots=True, eq=False)
class Learned:
    """What `absorb` made of R readings: `left` (R,) of them unexplained, and a test of the model.

    `score` is the slope of the log likelihood with the logarithm of the variance expected of the
    readings, `information` how much the readings tell of that (Fisher's). Both for unit noise.
    """

    left: Array
    surprise: float
    spread: float
    information: float

    def score(self, variance: float) -> float:
        return (self.surprise / variance - self.spread) / 2


class MovingModes(Stateful):
    """Amplitudes x (F,) of modes and their rates, expected (2, F), with covariance root' root.

    Each mode is a stationary Gaussian process of Matern's class 3/2 with the rate
    lambda = sqrt(3) speed wavenumber, as of a shape that moves past with that speed. It has one
    derivative, decays when nothing is read, and so has a bounded covariance for ever
    (doi:10.1109/MLSP.2010.5589113). Variances are in units of that of a reading.

    Only roots of covariances are kept, changed by orthogonal reflections (LAPACK's tpqrt, of a
    triangle on top of what is added): no rounding can make a variance negative.
    """

    STATE = ("mean", "root")

    def __init__(self, wavenumbers: Array, dtype: DTypeLike) -> None:
        # Typed as float64: what holds for one holds for the other.
        self._k, self._dtype = wavenumbers, cast("np.dtype[np.float64]", np.dtype(dtype))
        n = 2 * len(wavenumbers)
        self._nb, self._eye = min(_BLOCK, n), np.eye(n, dtype=dtype, order="F")
        self._tpqrt = cast("Any", get_lapack_funcs("tpqrt", (self._eye,)))
        self._tpmqrt = cast("Any", get_lapack_funcs("tpmqrt", (self._eye,)))
        self._trsm = cast("Any", get_blas_funcs("trsm", (self._eye,)))
        self.mean = np.zeros((2, len(wavenumbers)), dtype)
        self.root = np.zeros((n, n), dtype)

    def _triangle(self, upper: Array, below: Array) -> Array:
        """The triangle R with R'R = upper'upper + below'below; `upper` is overwritten."""
        return self._tpqrt(0, self._nb, upper, below, overwrite_a=1)[0]

    def _rates(self, speed: float) -> Array:
        return np.sqrt(3) * speed * self._k

    def _stacked(self, first: Array, mixed: Array, second: Array) -> Array:
        """The triangle [[first, mixed], [0, second]] of diagonals."""
        F = len(self._k)
        upper = np.zeros_like(self._eye)
        flat, n = upper.reshape(-1, order="F"), 2 * F  # a view: column by column
        flat[: F * n : n + 1] = first
        flat[F * n :: n + 1], flat[F * n + F :: n + 1] = mixed, second
        return upper

    def expect(self, amplitude: float, speed: float) -> None:
        """Expect another `amplitude` of each mode on top, as when something else touches."""
        still = np.full(len(self._k), amplitude)
        moving = amplitude * self._rates(speed)
        self.root = self._triangle(self._stacked(still, 0 * still, moving), self.root)

    def advance(self, seconds: float, amplitude: float, speed: float) -> None:
        """Let `seconds` pass for modes that have this `amplitude`."""
        rate = self._rates(speed)
        x = rate * seconds
        decay = np.exp(-x)
        # The process's transition [[a, b], [c, d]] over that time, and the root of what it adds:
        # 1 - e^-2x (1 + 2x + 2x^2) is the incomplete gamma function, without its cancellation.
        a, b, c, d = (1 + x) * decay, seconds * decay, -rate * x * decay, (1 - x) * decay
        first = np.sqrt(scipy.special.gammainc(3, 2 * x))
        tiny = first == 0
        mixed = 2 * x**2 * decay**2 / np.where(tiny, 1.0, first)
        added = -np.expm1(-2 * x) + 2 * x * (1 - x) * decay**2
        second = np.sqrt(np.maximum(added - mixed**2, 0.0))
        a, b, c, d = (factor.astype(self._dtype) for factor in (a, b, c, d))
        x1, x2 = self.mean
        self.mean = np.stack([a * x1 + b * x2, c * x1 + d * x2])
        S1, S2 = self.halves
        below = np.empty_like(self._eye)
        np.add(a * S1, b * S2, out=below[:, : len(a)])
        np.add(c * S1, d * S2, out=below[:, len(a) :])
        upper = self._stacked(
            amplitude * first, amplitude * rate * mixed, amplitude * rate * second
        )
        self.root = self._triangle(upper, below)

    @property
    def halves(self) -> tuple[Array, Array]:
        """The columns of the root that belong to the modes, and to their rates."""
        F = len(self._k)
        return self.root[:, :F], self.root[:, F:]

    def foreseen(self, A: Array, lag: Array) -> Array:
        """What readings A (R, F) of the modes would have been `lag` (R,) s from now."""
        x, rate = self.mean
        return A @ x + lag * (A @ rate)

    def absorb(self, A: Array, lag: Array, readings: Array) -> Learned:
        """Take in `readings` (R,) of A (R, F) times the modes, with unit noise, read at `lag` s."""
        ahead = readings - self.foreseen(A, lag)
        S1, S2 = self.halves
        Z, R = S1 @ A.T + (S2 @ A.T) * lag, len(readings)  # their covariance is V = 1 + Z'Z
        one = np.eye(R, dtype=Z.dtype, order="F")
        U, reflectors, t, _ = self._tpqrt(0, min(_BLOCK_OF_READINGS, R), one, Z)
        # The reflections that make [1; Z] to [U; 0], U'U = V, make [0; S] to [U'^-1 Z'S; S+], whose
        # products are those of [0; S]: S'S less what was learned. The gain is S'Z U^-1 U'^-1.
        nothing = np.zeros((R, len(S1)), Z.dtype, order="F")
        learned, self.root, _ = self._tpmqrt(
            0, reflectors, t, nothing, self.root, trans="T", overwrite_a=1
        )
        white = self._trsm(1.0, U, ahead[:, None], trans_a=1)
        self.mean = self.mean + (learned.T @ white[:, 0]).reshape(self.mean.shape)
        left = self._trsm(1.0, U, white)[:, 0]  # V^-1 ahead
        seen: Array = self._trsm(1.0, U, Z.T, trans_a=1).astype(float)  # 1 - V^-1, but for a turn
        seen = seen @ seen.T
        surprise = float(np.sum((Z @ left).astype(float) ** 2))
        return Learned(left, surprise, float(np.trace(seen)), float(np.sum(seen**2)) / 2)
