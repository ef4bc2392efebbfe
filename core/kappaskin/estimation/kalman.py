"""Square-root Kalman filter of a moving skin, with estimates of noise and signal."""

import math
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
class KalmanUpdate:
    """The result of an update with R readings: `left` (R,), unexplained, and a test of the model.

    `score` is the slope of the log likelihood with the logarithm of the variance expected of the
    readings, `information` the Fisher information on it. Both for unit noise.
    """

    left: Array
    surprise: float
    spread: float
    information: float

    def score(self, variance: float) -> float:
        return (self.surprise / variance - self.spread) / 2


class ModalKalmanFilter(Stateful):
    """Amplitudes (F,) of modes and their rates: `mean` (2, F), covariance root' root (2 F, 2 F).

    Each mode is a stationary Gaussian process of Matern's class 3/2 with the rate
    lambda = sqrt(3) speed wavenumber, as of a shape that moves past with that speed. It has one
    derivative, decays without readings, and so its covariance stays bounded
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
        """Add the variance of another `amplitude` of each mode, as for a new contact."""
        still = np.full(len(self._k), amplitude)
        moving = amplitude * self._rates(speed)
        self.root = self._triangle(self._stacked(still, 0 * still, moving), self.root)

    def advance(self, seconds: float, amplitude: float, speed: float) -> None:
        """Predict the modes, of this `amplitude`, `seconds` later."""
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
        """Predicted readings (R,), A (R, F) times the modes, `lag` (R,) s from now."""
        x, rate = self.mean
        return A @ x + lag * (A @ rate)

    def absorb(self, A: Array, lag: Array, readings: Array) -> KalmanUpdate:
        """Update with `readings` (R,), A (R, F) times modes + unit noise, `lag` (R,) s from now."""
        innovation = readings - self.foreseen(A, lag)
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
        white = self._trsm(1.0, U, innovation[:, None], trans_a=1)
        self.mean = self.mean + (learned.T @ white[:, 0]).reshape(self.mean.shape)
        left = self._trsm(1.0, U, white)[:, 0]  # V^-1 innovation
        part: Array = self._trsm(1.0, U, Z.T, trans_a=1).astype(float)  # 1 - V^-1, but for a turn
        part = part @ part.T
        surprise = float(np.sum((Z @ left).astype(float) ** 2))
        return KalmanUpdate(left, surprise, float(np.trace(part)), float(np.sum(part**2)) / 2)


START_SPEED = 0.1  # m/s, of a contact of which nothing is known
_SLOWEST, _FASTEST = 1e-4, 30.0
_NUDGE = 0.05  # of the logarithm of the speed, per standard deviation of its score
_SLOW = 0.02  # of the information of a step on that logarithm, where it is little
_SWIFT = 0.3  # of the logarithm at most
_MEMORY = 3000.0  # readings over which the noise is averaged
_FEW = 30.0  # of them that still count when something new touches
_BREAK = 8.0  # standard deviations of the chi-squared of readings that are something new
_BARELY = 10.0  # of that chi-squared: a single reading is no proof
_UNSEEN = 1e-3  # of a usual reading's signal
_FAINT = 0.1  # of the noise: the least signal that is expected
_USUAL, _USUAL_SD = math.log(100.0), 3.0  # of the signal's variance over the noise's, e-folds
_RATIOS = np.exp(np.linspace(math.log(1e-4), math.log(1e14), 145))


@dataclass(slots=True)
class SignalLevel(Stateful):
    """Running estimates of the noise and of the signal.

    `variance` of the noise of a reading, known as from `count` readings, infinite when it was
    given; the `amplitude` of the modes in units of its root, and the `speed` in m/s with which they
    move. `rounding` is the relative rounding error of a number.
    """

    STATE = ("variance", "count", "rounding", "amplitude", "speed")

    variance: float
    count: float
    rounding: float
    amplitude: float = 0.0
    speed: float = START_SPEED

    @property
    def _most(self) -> float:
        """The largest ratio of signal to noise variance that can be computed with."""
        return self.rounding**-1.5

    def explain(self, A: Array, readings: Array, signal: float) -> float:
        """The most likely amplitude for `readings` (R,), in units of the noise; updates the noise.

        Readings A (R, F) of modes have the covariance variance (1 + amplitude^2 A A'), the variance
        being known as from `count` others (Student's t). The prior expects a signal of ten times
        the noise, within three e-folds of its square. Where the readings see next to nothing of the
        modes, as on a held rim, `signal` takes its place, the variance of a typical reading for
        unit amplitude.
        """
        U, s, _ = np.linalg.svd(A.astype(float), full_matrices=False)
        R, observed = len(readings), float(s @ s) / len(readings)
        signal = observed if observed > _UNSEEN * signal else signal
        squares = _RATIOS[self._most >= _RATIOS] / signal
        within = (U.T @ readings) ** 2
        beyond = max(float(readings @ readings - within.sum()), 0.0)
        grown = 1 + np.multiply.outer(squares, s**2)
        power = beyond + (within / grown).sum(axis=1)
        doubt = np.log(grown).sum(axis=1)
        doubt += ((np.log(squares * signal) - _USUAL) / _USUAL_SD) ** 2
        if math.isinf(self.count):
            return math.sqrt(squares[int(np.argmin(power / self.variance + doubt))])
        known = min(self.count, _FEW) if self.variance else 0.0
        total = known * self.variance + power
        if not total.all():  # nothing but zeros was ever read
            return math.sqrt(math.exp(_USUAL) / signal)
        best = int(np.argmin((known + R) * np.log(total) + doubt))
        self.variance, self.count = float(total[best]) / (known + R), known
        return math.sqrt(squares[best])

    def renew(self, A: Array, innovation: Array, signal: float) -> float:
        """The amplitude of what is new in the `innovation` (R,) of readings A (R, F)."""
        extra = self.explain(A, innovation, signal)
        self.amplitude = max(self.amplitude, extra)
        self.speed = max(self.speed, START_SPEED)
        return extra

    def surprised(self, power: float, count: int) -> bool:
        """Whether `power`, chi-squared times the variance, of `count` readings is beyond chance."""
        return power > self.variance * (count + _BREAK * math.sqrt(2 * count) + _BARELY)

    def pace(self, learned: KalmanUpdate) -> None:
        """Update the speed: faster where readings were further off than expected, else slower."""
        if self.variance and learned.information:
            root = math.sqrt(learned.information)
            score = learned.score(self.variance) / root
            step = score * max(_NUDGE, _SLOW / root)
            step = min(max(step, -_SWIFT), _SWIFT)
            self.speed = min(max(self.speed * math.exp(step), _SLOWEST), _FASTEST)

    def weigh(self, power: float, readings: Array) -> None:
        """Update the noise, the mean product `power` of innovation and residual of `readings` (R,).

        It has that mean whatever the weights, if the model is right (doi:10.1256/qj.05.108).
        """
        if not math.isinf(self.count):
            known, count = min(self.count, _MEMORY), len(readings)
            least = self.rounding**2 * float(readings @ readings) / count
            self.variance = max((known * self.variance + power) / (known + count), least)
            self.count = known + count

    def size(self, x: Array, undecided: float, signal: float) -> None:
        """Update the amplitude from the modes x (F,); `undecided` is the sum of their variances.

        Both count as far as the readings determined them (MacKay, doi:10.1162/neco.1992.4.3.415).
        `signal` is the variance of a reading for unit amplitude.
        """
        decided = len(x) - undecided / self.amplitude**2
        if decided > 1 and self.variance:
            found = float(x @ x) / self.variance / decided
            found = min(max(found, _FAINT**2 / signal), self._most / signal)
            self.amplitude *= (found / self.amplitude**2) ** (_NUDGE / 2)
