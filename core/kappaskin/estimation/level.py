"""Readings to how large the noise is, how large the signal, and how fast it moves."""

import math
from dataclasses import dataclass

import numpy as np

from kappaskin._state import Stateful
from kappaskin.estimation.kalman import Learned
from kappaskin.frames import Array

START = 0.1  # m/s, of a contact of which nothing is known
_SLOWEST, _FASTEST = 1e-4, 30.0
_NUDGE = 0.05  # of the logarithm of the speed, per standard deviation of its score
_SLOW = 0.02  # of what a step tells of that logarithm, where it tells little
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
class Level(Stateful):
    """What is known of the noise and the signal, kept up to date.

    `variance` of a reading, known as from `count` readings, infinitely many when it was told; the
    `amplitude` of modes in units of its root, and the `speed` in m/s with which they move. Of a
    number, a share as large as `rounding` is not known.
    """

    STATE = ("variance", "count", "rounding", "amplitude", "speed")

    variance: float
    count: float
    rounding: float
    amplitude: float = 0.0
    speed: float = START

    @property
    def _most(self) -> float:
        """Of the signal's variance over the noise's, what can be computed with."""
        return self.rounding**-1.5

    def explain(self, A: Array, readings: Array, signal: float) -> float:
        """The amplitude in units of the noise that makes `readings` (R,) likeliest, with the noise.

        Readings A (R, F) of modes have the covariance variance (1 + amplitude^2 A A'), the variance
        being known as from `count` others (Student's t). An amplitude is expected of which the
        signal is ten times the noise, give or take three e-folds of its square; of readings that
        see next to nothing of the modes, as on a rim that is held, one with that `signal`, which is
        the variance of a usual reading for unit amplitude.
        """
        U, s, _ = np.linalg.svd(A.astype(float), full_matrices=False)
        R, seen = len(readings), float(s @ s) / len(readings)
        signal = seen if seen > _UNSEEN * signal else signal
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

    def renew(self, A: Array, ahead: Array, signal: float) -> float:
        """How much of something else `ahead` (R,) of A (R, F) tells, as an amplitude."""
        extra = self.explain(A, ahead, signal)
        self.amplitude = max(self.amplitude, extra)
        self.speed = max(self.speed, START)
        return extra

    def surprised(self, power: float, count: int) -> bool:
        """Whether chi-squared times the variance, of `count` readings, is beyond all chance."""
        return power > self.variance * (count + _BREAK * math.sqrt(2 * count) + _BARELY)

    def pace(self, learned: Learned) -> None:
        """Move faster where readings were further off than expected, slower where nearer."""
        if self.variance and learned.information:
            root = math.sqrt(learned.information)
            score = learned.score(self.variance) / root
            step = score * max(_NUDGE, _SLOW / root)
            step = min(max(step, -_SWIFT), _SWIFT)
            self.speed = min(max(self.speed * math.exp(step), _SLOWEST), _FASTEST)

    def weigh(self, power: float, readings: Array) -> None:
        """Learn the noise: what was ahead of `readings` (R,) times what was left averages to it.

        That holds for any weights which a right model gives (doi:10.1256/qj.05.108).
        """
        if not math.isinf(self.count):
            known, count = min(self.count, _MEMORY), len(readings)
            least = self.rounding**2 * float(readings @ readings) / count
            self.variance = max((known * self.variance + power) / (known + count), least)
            self.count = known + count

    def size(self, x: Array, undecided: float, signal: float) -> None:
        """Learn the amplitude from the modes x (F,), `undecided` the sum of their variances.

        Both count as far as readings decided them (MacKay, doi:10.1162/neco.1992.4.3.415).
        `signal` is the variance of a reading for unit amplitude.
        """
        decided = len(x) - undecided / self.amplitude**2
        if decided > 1 and self.variance:
            found = float(x @ x) / self.variance / decided
            found = min(max(found, _FAINT**2 / signal), self._most / signal)
            self.amplitude *= (found / self.amplitude**2) ** (_NUDGE / 2)
