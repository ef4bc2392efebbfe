"""Frames and parts of frames, each reading at its own time, to the shape of a moving skin."""

import math
from collections.abc import Mapping
from copy import copy
from functools import cached_property
from typing import ClassVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kappaskin._state import Stateful
from kappaskin.bases import Basis
from kappaskin.errors import Refusal
from kappaskin.estimation.choosing import telling_most
from kappaskin.estimation.estimator import Estimator, numbers
from kappaskin.estimation.fit import Fit, in_time
from kappaskin.estimation.kalman import MovingModes
from kappaskin.estimation.level import START, Level
from kappaskin.estimation.prior import prior_root
from kappaskin.frames import Array, Mask

_MOST = 100  # readings that share one step of the filter
_PHASE = 0.5  # rad that the fastest mode turns meanwhile at most, or
_SHORTEST = 1e-3  # s, if that is longer: a step must not take longer than its readings
_PERIOD = 6e-3  # s that a frame takes which comes without times: the paper's 300 channels
_HELD = 0.1  # s after which a reading no longer tells what lies between the modes
_BACK = 0.05  # s by which a clock may go back within one run of a device
_FORGOTTEN = 1e9  # s: of what is so long ago nothing is left, and squares are still numbers
_COARSE = 8  # modes that make nearly all of the displacement
_PLACE = 6.0  # of the contact's depth, times its distance in sides of the skin, as displacement


class TrackedSpread:
    """The spread that a root S tells of amplitudes of `modes` (N, F): modes S' S modes'."""

    def __init__(self, modes: Array, root: Array) -> None:
        self._modes, self._root = modes, root

    @cached_property
    def _half(self) -> Array:
        return self._root.astype(float) @ self._modes.T

    @property
    def sd(self) -> Array:
        return np.linalg.norm(self._half, axis=0)

    def of(self, rows: Array) -> Array:
        half = rows @ self._half.T
        return half @ half.swapaxes(-1, -2)

    def sd_of(self, rows: Array) -> Array:
        return np.linalg.norm(rows @ self._half.T, axis=-1)


class Tracking(Estimator, Stateful):
    """`fit = Tracking(basis, layout)`; `fit(curvature)` follows frame after frame.

    A Kalman filter of what the skin does: a plate under loads that nobody knows (`prior_root`),
    each of its shapes moving the faster the finer it is (`MovingModes`). It remembers: every frame,
    whole or not, is taken in at the times of its readings, and the answer is the shape at the last
    of them. A frame that comes without times is read 6 ms after the one before.

    How large shapes are, how fast they move and, without a `sigma`, the noise are found on the way:
    from the first frame by its evidence, then by what is left unexplained. Readings that are beyond
    what was expected are a touch or its end; the filter then expects anything once more.
    """

    remembers: ClassVar = True
    has_prior: ClassVar = True
    STATE = ("_filter", "_level", "_now", "_left", "_read")

    def _set_up(self) -> None:
        if not self.readable.any():
            raise self.refusal(0, 0)
        self._modes, self._wavenumbers, self._displacements = _principal(self.basis)
        A = self.weight[:, None] * (self.M @ self._modes)
        A[~self.readable] = 0.0
        self._A = A.astype(self.dtype)
        self._signal = float(np.vdot(A, A)) / int(self.readable.sum())
        self.restart()

    def restart(self) -> None:
        """Forget every frame."""
        self._filter = MovingModes(self._wavenumbers, self.dtype)
        self._level: Level | None = None
        self._now = -math.inf
        self._left = np.full(self._A.shape[0], np.nan)
        self._read = np.full(self._A.shape[0], -math.inf)

    def restore(self, state: Mapping[str, Array], prefix: str = "") -> None:
        if f"{prefix}_level.variance" in state and self._level is None:
            self._level = Level(0.0, 0.0, 0.0)
        super().restore(state, prefix)

    def at_rest(self, missing: Mask | None = None) -> Fit:
        """The fit to a skin at rest by which nothing is remembered."""
        fresh = copy(self)
        fresh.restart()
        return fresh(self._rest(missing))

    def __call__(self, curvature: ArrayLike) -> Fit:
        """Take in the next frame (3, P) or T of them (T, 3, P), read 6 ms after each other."""
        K = numbers(curvature, "curvature")
        self._check_shape(K)
        if K.ndim == 2:
            return self.follow(K, np.full(K.shape, self._next))
        if not len(K):
            none = np.empty((0, *self.basis.shape), self.dtype)
            return Fit(self, K.astype(self.dtype), none, [], np.zeros(0), np.zeros(0))
        return in_time([self.follow(frame, np.full(frame.shape, self._next)) for frame in K])

    @property
    def _next(self) -> float:
        """When a frame is read of which nobody says when."""
        return self._now + _PERIOD if math.isfinite(self._now) else 0.0

    def follow(self, curvature: ArrayLike, times: ArrayLike, held: Array | None = None) -> Fit:
        """Take in `curvature` (3, P) in 1/m read at `times` (3, P) in s on the device's clock.

        Which readings are missing is told as in any call of an estimator; the time of a channel
        that was not read at all is NaN. Readings of one channel are to come in the order of their
        times. A clock that goes back is that of a device that started anew. What is `held` of
        earlier frames is known already.
        """
        frame, when = numbers(curvature, "curvature"), numbers(times, "times")
        self._check_shape(frame)
        if frame.ndim != 2 or when.shape != frame.shape:
            raise Refusal(
                f"expected curvature and times of shape (3, {len(self.layout)}), got {frame.shape} "
                f"and {when.shape}"
            )
        K, t = frame.ravel(), when.ravel()
        used = np.flatnonzero((np.abs(K) <= self._largest) & self.readable)
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

    def choose(self, count: int, position: Array, ahead: float) -> NDArray[np.intp]:
        """The `count` channels to read next, `ahead` s from now, upwards.

        Always the few that take most of what is uncertain of the surface, and of where
        the contact is that was found at `position` (2,) in m, NaN when there is none. Choosing
        looks at the covariance alone. A channel says again what it said until the finest shape has
        moved on: what the modes leave of a reading is no noise that averages out.
        """
        x, rate = self._filter.halves
        S, count = x + ahead * rate, min(count, int(self.readable.sum()))
        readable = np.flatnonzero(self.readable)
        A, worth = self._A[readable], self._aged(ahead)[readable]
        return np.sort(readable[telling_most(A, S.T @ S, self._wanted(position), worth, count)])

    def _wanted(self, position: Array) -> Array:
        """What is wanted of the modes (q, F): displacements in m, and the contact's place."""
        coarse = np.diag(self._displacements)[: min(_COARSE, self.unknowns)]
        if not np.isfinite(position).all():
            return coarse
        jet = self.basis.jet(*position.tolist()) @ self._modes
        w, _, _, xx, _, yy = (jet @ self._filter.mean[0]).tolist()
        # Where the surface is deepest moves by the change of slope over the curvature.
        share = _PLACE * abs(w) / self.basis.patch.a / max(abs(xx + yy) / 2, 1e-30)
        return np.vstack([coarse, share * jet[1:3]])

    def _aged(self, ahead: float) -> Array:
        """How much of a reading (3 P,) would be new."""
        level = self._level
        if level is None:  # nothing was read yet
            return np.ones(len(self._read))
        finest = math.sqrt(3) * level.speed * float(self._wavenumbers.max())
        return -np.expm1(-finest * (self._now + ahead - self._read))

    def _begin(self, times: Array) -> None:
        """Start anew where the clock went back."""
        if times.size and times.min() < self._now - _BACK:
            self.restart()

    def _groups(self, used: NDArray[np.intp], t: Array) -> list[NDArray[np.intp]]:
        """The channels `used` in the order of their times, as many at once as move together."""
        order = used[np.argsort(t[used], kind="stable")]
        if not order.size:
            return []
        level = cast("Level", self._level)
        fastest = math.sqrt(3) * level.speed * float(self._wavenumbers.max())
        span = max(_PHASE / fastest, _SHORTEST)
        later = np.flatnonzero(np.diff((t[order] - t[order[0]]) // span)) + 1
        return [
            group
            for together in np.split(order, later)
            for group in np.array_split(together, math.ceil(len(together) / _MOST))
        ]

    def _start(self, readings: Array, A: Array) -> None:
        """Expect what the evidence of the first readings says."""
        told = (0.0, 0.0) if self.sigma is None else (1.0, math.inf)
        self._level = Level(*told, float(np.finfo(self.dtype).eps))
        self._filter.expect(self._level.renew(A, readings, self._signal), START)

    def _advance(self, time: float) -> None:
        level = cast("Level", self._level)
        if time > self._now and math.isfinite(self._now):
            passed = min(time - self._now, _FORGOTTEN)
            self._filter.advance(passed, level.amplitude, level.speed)
        self._now = max(time, self._now)

    def _take(self, channels: NDArray[np.intp], K: Array, t: Array) -> None:
        """Take in readings of `channels`, in the order of their times `t`."""
        level, filter_ = cast("Level", self._level), self._filter
        self._advance(float(t[-1]))
        A, lag = self._A[channels], (t - self._now).astype(self.dtype)
        readings = (self.weight[channels] * K).astype(self.dtype)
        mean, root = filter_.mean, filter_.root
        ahead = (readings - filter_.foreseen(A, lag)).astype(float)
        learned = filter_.absorb(A, lag, readings)
        power = float(ahead @ learned.left)  # chi-squared, times the noise's variance
        if level.surprised(power, len(K)):
            filter_.mean, filter_.root = mean, root
            filter_.expect(level.renew(A, ahead, self._signal), level.speed)
            learned = filter_.absorb(A, lag, readings)
            power = float(ahead @ learned.left)
        else:
            level.pace(learned)
        self._left[channels] = learned.left / self.weight[channels]
        self._read[channels] = t
        level.weigh(power, readings.astype(float))
        S1, _ = filter_.halves
        level.size(filter_.mean[0], float(np.vdot(S1, S1)), self._signal)

    def _fitted(self) -> Fit:
        level = cast("Level", self._level)
        c = (self._modes @ self._filter.mean[0]).reshape(self.basis.shape).astype(self.dtype)
        there = self._read > self._now - _HELD
        K = np.where(there, self._left, np.nan) + self.predicted(c).ravel()
        if self.sigma is None:
            noise, spare = math.sqrt(level.variance), int(level.count)
        else:
            noise, spare = 1.0, int(there.sum())
        return Fit(
            self,
            K.reshape(3, -1).astype(self.dtype),
            c,
            TrackedSpread(self._modes, self._filter.halves[0]),
            spare,
            np.array(noise),
        )

    def _fit(self, flat: Array, used: Mask) -> Fit:
        return self(flat.reshape(*flat.shape[:-1], 3, -1))


def _principal(basis: Basis) -> tuple[Array, Array, Array]:
    """Shapes (N, F) that are expected independently, their wave numbers (F,) in rad/m, and RMS.

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
