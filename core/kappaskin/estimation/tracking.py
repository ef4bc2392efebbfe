"""Tracking estimator of a moving skin from readings at their own times."""

import math
from collections.abc import Mapping
from copy import copy
from typing import ClassVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kappaskin._state import Stateful
from kappaskin.bases import Basis
from kappaskin.errors import RankDeficient, Refusal
from kappaskin.estimation.bayes import prior_root
from kappaskin.estimation.estimator import Estimator, real_array
from kappaskin.estimation.fit import Fit, RootUncertainty, Uncertainty
from kappaskin.estimation.kalman import START_SPEED, ModalKalmanFilter, SignalLevel
from kappaskin.frames import Array, Mask

_CANDIDATES = 80  # readings of which the next ones are chosen
_AT_ONCE = 8  # of them, as good in the end as one by one


def most_informative(
    A: Array, P: Array, quantities: Array, worth: Array, count: int
) -> NDArray[np.intp]:
    """The `count` most informative of R readings about `quantities` (q, F), greedily.

    The readings are A (R, F) times modes of the covariance P (F, F) in units of the noise. Each
    reduces the summed variances of the quantities by (quantities P A')^2 over its own variance,
    times its `worth` (R,).
    """
    AP = A @ P
    E = AP @ quantities.T
    first = worth * np.vecdot(E, E) / (1 + np.vecdot(AP, A))
    most = min(max(_CANDIDATES, count), len(first))
    left = np.argpartition(-first, most - 1)[:most]
    return left[_greedy(AP[left] @ A[left].T, E[left], worth[left], count)]


def _greedy(shared: Array, quantities: Array, worth: Array, count: int) -> NDArray[np.intp]:
    """The same for all R readings, whose signals have the covariance `shared` (R, R).

    A Cholesky factor of the covariance of those chosen, (count, R), grows some rows at a time.
    """
    R, variance = len(worth), 1 + shared.diagonal()
    both = np.hstack([shared, quantities])
    factor, chosen = np.empty((count, both.shape[1])), np.empty(count, np.intp)
    for first in range(0, count, _AT_ONCE):
        information = worth * np.vecdot(quantities, quantities) / variance
        information[chosen[:first]] = -1.0
        k = np.argsort(-information, kind="stable")[: min(_AT_ONCE, count - first)]
        chosen[first : first + len(k)] = k
        before = factor[:first]
        left = both[k] - before[:, k].T @ before
        L = np.linalg.cholesky(left[:, k] + np.eye(len(k)))
        factor[first : first + len(k)] = rows = np.linalg.solve(L, left)
        # Given those readings, the others are less uncertain by what they share with them.
        quantities = quantities - rows[:, :R].T @ rows[:, R:]
        variance = np.maximum(variance - np.sum(rows[:, :R] ** 2, axis=0), 1.0)
    return chosen


_MOST = 100  # readings that share one step of the filter
_PHASE = 0.5  # rad that the fastest mode turns meanwhile at most, or
_SHORTEST = 1e-3  # s, if that is longer: a step must not take longer than its readings
_PERIOD = 6e-3  # s that a frame takes which comes without times: the paper's 300 channels
_HELD = 0.1  # s after which a reading no longer determines what lies between the modes
_BACK = 0.05  # s by which a clock may go back within one run of a device
_FORGOTTEN = 1e9  # s: of what is so long ago nothing is left, and squares are still numbers
_COARSE = 8  # modes that make nearly all of the displacement
_PLACE = 6.0  # of the contact's depth, times its distance in sides of the skin, as displacement


class Tracking(Estimator, Stateful):
    """`fit = Tracking(basis, layout)`; `fit(readings)` tracks the skin frame by frame.

    A Kalman filter of a plate under unknown loads (`prior_root`), whose modes move the faster the
    finer they are (`ModalKalmanFilter`). It has a memory: each frame, complete or not, is used at
    the times of its readings, and the fit is the shape at the last of them. A frame without times
    counts as read 6 ms after the one before.

    The amplitude of the modes, their speed and, without a `sigma`, the noise are estimated: from
    the likelihood of the first frame, then from the innovations. Readings far beyond expectation
    mean a contact or its end; the uncertainty of the modes then grows to that of the start.
    """

    has_memory: ClassVar = True
    has_prior: ClassVar = True
    has_rim: ClassVar = False
    STATE = ("_filter", "_level", "_now", "_left", "_read")

    def _set_up(self) -> None:
        if not self.readable.any():
            raise self.refusal(0, 0)
        # Of the first readings: the squares of what rounding leaves of them are no numbers below.
        self._least_first = float(np.finfo(self.dtype).tiny) ** 0.4
        self._modes, self._wavenumbers, self._displacements = _principal(self.basis)
        A = self.weight[:, None] * (self.M @ self._modes)
        A[~self.readable] = 0.0
        self._A = A.astype(self.dtype)
        self._signal = float(np.vdot(A, A)) / int(self.readable.sum())
        self.restart()

    def restart(self) -> None:
        """Forget every frame."""
        self._filter = ModalKalmanFilter(self._wavenumbers, self.dtype)
        self._level: SignalLevel | None = None
        self._now = -math.inf
        self._left = np.full(self._A.shape[0], np.nan)
        self._read = np.full(self._A.shape[0], -math.inf)

    def restore(self, state: Mapping[str, Array], prefix: str = "") -> None:
        if f"{prefix}_level.variance" in state and self._level is None:
            self._level = SignalLevel(0.0, 0.0, 0.0)
        super().restore(state, prefix)

    def at_rest(self, missing: Mask | None = None) -> Fit:
        """The fit to a skin at rest, without memory and without a trace in it."""
        fresh = copy(self)
        fresh.restart()
        return fresh(self._rest(missing))

    def scatter(self, noise: float, readings: Array | None = None) -> Uncertainty:
        raise Refusal(
            "expected an estimator without memory to predict the scatter of, got tracking, whose "
            "estimates depend on the frames before; simulate them"
        )

    def __call__(self, readings: ArrayLike) -> Fit:
        """Fit the next frame (3, P) in 1/m, or T of them (T, 3, P), read 6 ms after each other."""
        K = real_array(readings, "readings")
        if self._of_one_frame(K):
            return self.follow(K, np.full(K.shape, self._next))
        if not len(K):
            none = np.empty((0, *self.basis.shape), self.dtype)
            return Fit(self, K.astype(self.dtype), none, [], np.zeros(0), np.zeros(0))
        return Fit.stacked([self.follow(frame, np.full(frame.shape, self._next)) for frame in K])

    @property
    def _next(self) -> float:
        """Time in s of a frame that comes without one."""
        return self._now + _PERIOD if math.isfinite(self._now) else 0.0

    def follow(self, readings: ArrayLike, times: ArrayLike, held: Array | None = None) -> Fit:
        """Fit `readings` (3, P) in 1/m read at `times` (3, P) in s on the device's clock.

        Missing readings are NaN as in any estimator; the time of a channel that was not read at
        all is NaN too. Readings of one channel must come in the order of their times. A clock that
        goes back means that the device has restarted. `held`, readings of earlier frames, is not
        used: the filter knows them. Raises a `Refusal` for a reading without a time.
        """
        frame, when = real_array(readings, "readings"), real_array(times, "times")
        if not self._of_one_frame(frame) or when.shape != frame.shape:
            raise Refusal(
                f"expected readings and times of shape {self.frame_shape}, got {frame.shape} and "
                f"{when.shape}"
            )
        K, t = frame.ravel(), when.ravel()
        used = np.flatnonzero(self._there(K))
        scanned = ~np.isnan(t)
        if not np.isfinite(t[scanned]).all() or not scanned[used].all():
            raise Refusal("expected a time in s with every reading, got NaN or infinity")
        self._begin(t[scanned])
        if self._level is None:
            if not used.size:
                raise self.refusal(0, 0)
            self._start(self.weight[used] * K[used], self._A[used])
        self._read[scanned] = -math.inf  # a channel that was read and failed has no reading
        for channels in self._groups(used, t):
            self._take(channels, K[channels], t[channels])
        if scanned.any():
            self._advance(float(t[scanned].max()))
        return self._fitted()

    def choose(self, count: int, position: Array, lead: float) -> NDArray[np.intp]:
        """The `count` channels to read next, `lead` s from now, in increasing order.

        Those that reduce most the uncertainty of the surface, and of the place of the contact at
        `position` (2,) in m, NaN without one. They follow from the covariance alone. A channel that
        was just read is worth little until the finest mode has moved on: what the modes leave of a
        reading is not noise that averages out.
        """
        x, rate = self._filter.halves
        S, count = x + lead * rate, min(count, int(self.readable.sum()))
        readable = np.flatnonzero(self.readable)
        A, worth = self._A[readable], self._aged(lead)[readable]
        return np.sort(
            readable[most_informative(A, S.T @ S, self._quantities(position), worth, count)]
        )

    def _quantities(self, position: Array) -> Array:
        """Quantities (q, F) of interest of the modes: displacements in m, the contact's place."""
        coarse = np.diag(self._displacements)[: min(_COARSE, self.unknowns)]
        if not np.isfinite(position).all():
            return coarse
        jet = self.basis.jet(*position.tolist()) @ self._modes
        w, _, _, xx, _, yy = (jet @ self._filter.mean[0]).tolist()
        # Where the surface is deepest moves by the change of slope over the curvature.
        share = _PLACE * abs(w) / self.basis.patch.a / max(abs(xx + yy) / 2, 1e-30)
        return np.vstack([coarse, share * jet[1:3]])

    def _aged(self, lead: float) -> Array:
        """Share (R,) of the next reading of each channel that would be new."""
        level = self._level
        if level is None:  # nothing was read yet
            return np.ones(len(self._read))
        finest = math.sqrt(3) * level.speed * float(self._wavenumbers.max())
        return -np.expm1(-finest * (self._now + lead - self._read))

    def _begin(self, times: Array) -> None:
        """Restart where the clock went back."""
        if times.size and times.min() < self._now - _BACK:
            self.restart()

    def _groups(self, used: NDArray[np.intp], t: Array) -> list[NDArray[np.intp]]:
        """The channels `used` in the order of their times, in groups that share one filter step."""
        order = used[np.argsort(t[used], kind="stable")]
        if not order.size:
            return []
        level = cast("SignalLevel", self._level)
        fastest = math.sqrt(3) * level.speed * float(self._wavenumbers.max())
        span = max(_PHASE / fastest, _SHORTEST)
        later = np.flatnonzero(np.diff((t[order] - t[order[0]]) // span)) + 1
        return [
            group
            for together in np.split(order, later)
            for group in np.array_split(together, math.ceil(len(together) / _MOST))
        ]

    def _start(self, readings: Array, A: Array) -> None:
        """Start with the most likely amplitude for the first readings."""
        if self.sigma is None and 0 < (largest := np.max(np.abs(readings))) < self._least_first:
            raise RankDeficient(
                f"expected first readings of 0, or of at least {self._least_first:.1g} 1/m in "
                f"{self.dtype}, got {largest:.3g} 1/m; check their unit, or give sigma"
            )
        noise = (0.0, 0.0) if self.sigma is None else (1.0, math.inf)
        self._level = SignalLevel(*noise, float(np.finfo(self.dtype).eps))
        self._filter.expect(self._level.renew(A, readings, self._signal), START_SPEED)

    def _advance(self, time: float) -> None:
        level = cast("SignalLevel", self._level)
        if time > self._now and math.isfinite(self._now):
            passed = min(time - self._now, _FORGOTTEN)
            self._filter.advance(passed, level.amplitude, level.speed)
        self._now = max(time, self._now)

    def _take(self, channels: NDArray[np.intp], K: Array, t: Array) -> None:
        """Update the filter with readings of `channels`, in the order of their times `t` in s."""
        level, filter_ = cast("SignalLevel", self._level), self._filter
        self._advance(float(t[-1]))
        A, lag = self._A[channels], (t - self._now).astype(self.dtype)
        readings = (self.weight[channels] * K).astype(self.dtype)
        mean, root = filter_.mean, filter_.root
        innovation = (readings - filter_.foreseen(A, lag)).astype(float)
        learned = filter_.absorb(A, lag, readings)
        power = float(innovation @ learned.left)  # chi-squared, times the noise's variance
        if level.surprised(power, len(K)):
            filter_.mean, filter_.root = mean, root
            filter_.expect(level.renew(A, innovation, self._signal), level.speed)
            learned = filter_.absorb(A, lag, readings)
            power = float(innovation @ learned.left)
        else:
            level.pace(learned)
        self._left[channels] = learned.left / self.weight[channels]
        self._read[channels] = t
        level.weigh(power, readings.astype(float))
        S1, _ = filter_.halves
        level.size(filter_.mean[0], float(np.vdot(S1, S1)), self._signal)

    def _fitted(self) -> Fit:
        level = cast("SignalLevel", self._level)
        c = (self._modes @ self._filter.mean[0]).reshape(self.basis.shape).astype(self.dtype)
        root = self._filter.halves[0]
        there = self._read > self._now - _HELD
        K = np.where(there, self._left, np.nan) + self.predicted(c).ravel()
        if self.sigma is None:
            noise, spare = math.sqrt(level.variance), int(level.count)
        else:
            noise, spare = 1.0, int(there.sum())
        return Fit(
            self,
            K.reshape(self.frame_shape).astype(self.dtype),
            c,
            RootUncertainty(lambda: root.astype(float) @ self._modes.T),
            spare,
            np.array(noise),
        )

    def _fit(self, flat: Array, used: Mask) -> Fit:
        return self(flat.reshape(*flat.shape[:-1], *self.frame_shape))


def _principal(basis: Basis) -> tuple[Array, Array, Array]:
    """Principal modes (N, F) of the prior, their wave numbers (F,) in rad/m, and RMS (F,) in m.

    The largest first; their displacements are orthogonal over the skin.
    """
    L = prior_root(basis)
    points, weights = basis.quadrature()
    w = np.sqrt(weights / weights.sum())[:, None]

    def rms(shapes: Array, *order: int) -> Array:
        return np.linalg.norm(w * (basis.at(points, *order) @ shapes), axis=0)

    f = cast("Array", np.linalg.qr(w * basis.at(points), mode="r")) @ L
    modes = L @ np.linalg.svd(f)[2].T
    slopes, displacements = np.hypot(rms(modes, 1, 0), rms(modes, 0, 1)), rms(modes, 0, 0)
    return modes, slopes / displacements, displacements
