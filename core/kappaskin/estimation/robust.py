"""Robust estimator: least squares without outliers, and the likely fault of each."""

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, cast

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from kappaskin._state import StateArrays, Stateful
from kappaskin.bases import Basis
from kappaskin.errors import RankDeficient, Refusal
from kappaskin.estimation.bayes import MarginalLikelihood, prior_root
from kappaskin.estimation.estimator import Estimator, PatternCache, real_array
from kappaskin.estimation.fit import Fit, power_of_two
from kappaskin.estimation.least_squares import LeastSquares
from kappaskin.frames import Array, Mask
from kappaskin.mechanics import Plate

_FUNCTIONS = 15  # along each side at least, of the shapes that elements are tested against
_ALARM = 1e-3  # chance that a frame of good readings has any of them suspected
_PLACES = 25  # along each side, where a load is tried
_LOADS = 3  # that are tried at most
_UNSEEN = 1e-12  # of a load's readings: so much is left of one that the elements do not read
_CLEAREST = 1e10  # signal over noise in power: beyond it rounding decides
_FEWEST, _MOST_DECIDED = 0.15, 0.85  # of the readings that suspects and loads leave, by the prior
_BACK = 0.5  # of what makes a suspect: below it, one is trusted again
_ROUNDS = 12  # of suspecting and trusting again
_AT_ONCE = 4.0  # a suspect is left out together with those at least a fourth as far off
_MOST = 1 / 3  # of the elements: if more contradict the rest, no outlier can be identified
_DECIDED = 1 / 3  # of the readings, by a shape that none of many outliers bends after itself
_LOWER = 0.6  # times the last: the next limit of what an element may be off by
_STEPS = 30  # towards the solution for a limit
_STILL = 0.02  # of a limit: a step that changes less is the last
_QUIET = 0.25  # of the elements are good, whatever others are: they tell the noise
_NEARLY, _OTHERS = 40.0, 0.1  # -2 ln of evidence, and share of the elements, of another answer
_HALF = 0.5  # of the variance of the noise, at least, has half of the good elements
_ROUNDED = 1e-4  # of the largest reading: less noise is rounding
_BAD = 1 / 30  # of one element is bad in a usual frame
_FRAMES = 32  # from which the fault is identified
_ENOUGH = 6  # of them: with fewer, any suspect may be a spike
_OFTEN = 0.3  # of the frames: a suspect of fewer has spikes
_CROSSED = 0.2  # of the squares left when two elements are swapped back

FAULTS = ("", "spike", "stuck", "noisy", "swapped", "offset", "dead", "saturated", "drifting")
"""Faults of an element by number; 0, the empty word, means none."""


@dataclass(frozen=True, slots=True, eq=False)
class _OutlierTest:
    """What depends on which readings are `used` (3 P,), `count` of them.

    `U` (3 P, k) are the directions of the likelihood, zero where there is no reading. For a load at
    each of G places, `by_load` (G, k) are the squared components along them, `beyond` (G,) those
    along none. `sensed` (P,) is the number of readings of each element.
    """

    likelihood: MarginalLikelihood
    U: Array
    by_load: Array
    beyond: Array
    used: Mask
    count: int
    sensed: NDArray[np.intp]
    prior: "_PriorStrength"
    first: "_FirstSuspects"


@dataclass(frozen=True, slots=True, eq=False)
class _OutlierResult:
    """Suspected elements (P,), and how far `off` (3, P) their readings are, 0 for the others.

    `cost` is -2 ln of its evidence, infinite where too many elements are suspects; `converged` is
    False then, where other suspects are as likely, and where outliers are taken for noise.
    """

    suspects: Mask
    off: Array
    rounds: int
    cost: float = math.inf
    converged: bool = False


# Under the prior the readings have the covariance sigma^2 S, S^-1 = Q = 1 - U diag(w) U^T with
# w = gamma s^2 / (1 + gamma s^2). What the others predict of the readings E of some elements, and
# how well, needs blocks of Q alone: K_E is off by Q_EE^-1 (Q K)_E, with covariance sigma^2 Q_EE^-1
# (leaving one out, as in kriging: doi:10.1007/BF01033232). Leaving E out changes
# Q to Q - Q_.E Q_EE^-1 Q_E. for the rest.
class Robust(Estimator, Stateful):
    """Least squares from the elements that agree with each other.

    An element is suspected when its three readings are further from the prediction by the others
    than noise explains once in a thousand frames. The prediction uses the likelihood of a plate
    under a white load (`Bayes`), so that the fine structure under a load is not taken for a fault.
    Suspects are excluded round by round, and included again where the rest agrees with them; the
    shape is that of `LeastSquares` with them dead. `Fit.suspect` has their faults, identified from
    the last frames. The rounds begin twice: with no suspects, and with those of `_FirstSuspects`,
    which a quarter of bad elements does not mislead. The end with more evidence holds.
    `Fit.converged` is false where the other has nearly as much and quite other suspects, where the
    noise told is far more than most elements have, and where more than a third of the elements
    contradict the rest: then none is excluded.
    """

    failure = (
        "too many elements contradict each other{}: the shape may be wrong; "
        "tare, or repair what Health lists"
    )
    STATE = ("_history",)

    def _set_up(self) -> None:
        basis, layout = self.basis, self.layout
        self._linear = LeastSquares(basis, layout, self.sigma, self.rim_sd, self.dtype)
        across = 1 if basis.patch.strip else max(basis.shape[1], _FUNCTIONS)
        rich = replace(cast("Any", basis), Ni=max(basis.shape[0], _FUNCTIONS), Nj=across)
        self._A: Array = self.weight[:, None] * (layout.curvature_operator(rich) @ prior_root(rich))
        self._set_up_loads(rich)
        self._tests = PatternCache[_OutlierTest]()
        P = len(layout)
        sensing = np.maximum(layout.live.sum(axis=0), 1)
        self._sensing: Array = sensing.astype(float)
        self._limit: Array = scipy.special.chdtri(sensing, _ALARM / P)
        self._history = _SuspectHistory(P)
        self._tests(self.readable, self._outlier_test)

    def _set_up_loads(self, rich: Basis) -> None:
        """Readings of a load at each of G places, and their changes when it moves or widens."""
        patch = rich.patch
        x, y = patch.grid(_PLACES + 2, 3 if patch.strip else _PLACES + 2)
        points = np.stack(np.meshgrid(x[1:-1], y[1:-1]), -1).reshape(-1, 2)
        points = points[patch.moves(points)]
        plate, orders = Plate(patch), ((0, 0), (1, 0), (0, 1))
        read = self.weight[:, None] * self.layout.curvature_operator(rich, plate)
        M = plate.compliance(rich).after(read)
        jets = [rich.at(points, *order) for order in orders[: 2 if patch.strip else 3]]
        wider = rich.at(points, 2, 0) + (0.0 if patch.strip else rich.at(points, 0, 2))
        self._load_readings: Array = np.stack([M @ jet.T for jet in (*jets, wider)], axis=-1)
        """Per place (3 P, G, 4): of a force, of moving it along x, along y, of widening it."""
        self._load_readings /= np.linalg.norm(self._load_readings, axis=0)
        self._forces = np.ascontiguousarray(self._load_readings[..., 0])
        self._load_limit = float(scipy.special.chdtri(1, _ALARM / len(points)))

    def _load_gain(self, residuals: "_Residuals", test: _OutlierTest) -> Array:
        """Drop (G,) of chi-squared when a load is added at each place."""
        observed = test.beyond + test.by_load @ (1 - residuals.w)
        known = observed > _UNSEEN
        return np.divide(
            (residuals.r @ self._forces) ** 2, observed, where=known, out=np.zeros_like(observed)
        )

    def _outlier_test(self, used: Mask) -> _OutlierTest:
        likelihood = MarginalLikelihood(self._A[used], self.sigma is not None, 1e-10)
        U = np.zeros((len(used), likelihood.U.shape[1]))
        U[used] = likelihood.U
        by_load = (self._forces.T @ U) ** 2
        beyond = np.sum(self._forces[used] ** 2, axis=0) - by_load.sum(axis=1)
        sensed = cast("NDArray[np.intp]", used.reshape(3, -1).sum(axis=0))
        prior = _PriorStrength(likelihood.s2[: U.shape[1]])
        first = _FirstSuspects(U, prior.shares(_DECIDED * sensed.sum()), sensed)
        beyond, count = np.maximum(beyond, 0.0), int(used.sum())
        return _OutlierTest(likelihood, U, by_load, beyond, used, count, sensed, prior, first)

    def __call__(self, curvature: ArrayLike) -> Fit:
        """Fit `curvature` (3, P), or (T, 3, P) in the order of time, in 1/m."""
        K = real_array(curvature, "curvature", self.dtype)
        self._check_shape(K)
        there = np.abs(K) <= self._largest
        if K.ndim == 2 or (there == there[:1]).all():
            return super().__call__(K)
        # Not grouped by missing readings: faults are identified from the frames before.
        return Fit.stacked([self._next(frame, t) for t, frame in enumerate(K)])

    def _next(self, frame: Array, number: int) -> Fit:
        try:
            return super().__call__(frame)
        except RankDeficient as error:
            raise RankDeficient(f"frame {number}: {error}") from error

    def at_rest(self, missing: Mask | None = None) -> Fit:
        """The fit to a skin at rest, which does not enter the history."""
        past, self._history = self._history, _SuspectHistory(len(self.layout))
        try:
            return super().at_rest(missing)
        finally:
            self._history = past

    def _fit(self, flat: Array, used: Mask) -> Fit:
        if not used.any():
            raise self.refusal(0, 0)
        frames, P = flat.shape[:-1], len(self.layout)
        K = flat.reshape(*frames, 3, P)
        results = [self._screened(frame, used) for frame in np.atleast_2d(flat)]
        why = [
            self._history(readings, result.suspects, result.off)
            for readings, result in zip(K.reshape(-1, 3, P), results, strict=True)
        ]
        out = np.reshape([result.suspects for result in results], (*frames, 1, P))
        return replace(
            self._linear(np.where(out, np.nan, K)),
            estimator=self,
            steps=np.array([result.rounds for result in results], int).reshape(frames),
            converged=np.array([result.converged for result in results], bool).reshape(frames),
            suspect=np.array(why, np.uint8).reshape(*frames, P),
        )

    def _screened(self, flat: Array, used: Mask) -> _OutlierResult:
        test, P = self._tests(used, self._outlier_test), len(self.layout)
        weighted = np.where(used, flat, 0.0).astype(float) * self.weight
        unit = 1.0 if self.sigma is not None else float(power_of_two(weighted)[0])
        K = weighted / unit
        none = np.zeros(P, bool)
        first = test.first(K, 0.0 if self.sigma is None else 1.0)
        ends = [self._searched(K, test, none)]
        if first.any():
            ends.append(self._searched(K, test, first))
        best, rounds = min(ends, key=lambda end: end.cost), sum(end.rounds for end in ends)
        if not math.isfinite(best.cost):
            return _OutlierResult(none, np.zeros((3, P)), rounds)
        off = best.off * unit
        np.divide(off, self.weight.reshape(3, P), where=off != 0, out=off)
        converged = best.converged and not _undecided(best, ends)
        return replace(best, off=off, rounds=rounds, converged=converged)

    def _searched(self, K: Array, test: _OutlierTest, suspects: Mask) -> _OutlierResult:
        """Where rounds end that begin with some `suspects` (P,), in units of sigma."""
        loads, rounds, P, used = list[int](), 0, len(suspects), test.used
        most = _MOST * np.count_nonzero(test.sensed)
        (gamma,) = test.likelihood(np.where(np.tile(suspects, 3), 0.0, K)[None, used])[1]
        while suspects.sum() <= most:
            free = np.hstack([_columns(suspects), *(self._load_readings[:, g] for g in loads)])
            left, out = test.count - free.shape[1], np.tile(suspects, 3)
            if left < 1:  # as many free directions as readings: nothing is left to contradict
                break
            residuals = _Residuals(test, K, free, float(gamma), out)
            _, (gamma,), (sigma,) = test.likelihood(residuals.unexplained[None, used])
            gamma = np.clip(gamma, *test.prior.between(_FEWEST * left, _MOST_DECIDED * left))
            residuals = _Residuals(test, K, free, float(gamma), out)
            variance = 1.0 if self.sigma is not None else float(sigma) ** 2 * test.count / left
            found, place = self._contradicted(residuals, test, suspects, variance)
            a_load = self._load_readings.shape[-1]
            if place is not None and len(loads) < _LOADS and left > a_load:
                loads.append(place)
            elif (found == suspects).all() or rounds == _ROUNDS:
                off = np.zeros(3 * P)
                off[out & used] = residuals.amounts[: 3 * suspects.sum()][used[out]]
                cost = residuals.cost(K, self.sigma is not None)
                good = (test.sensed > 0) & ~suspects
                even = self._even(residuals.chi_squared(suspects)[good], variance, good, K)
                return _OutlierResult(suspects, off.reshape(3, P), rounds, cost, even)
            else:
                suspects = found
            rounds += 1
        return _OutlierResult(suspects, np.zeros((3, P)), rounds)

    def _even(self, t: Array, variance: float, good: Mask, K: Array) -> bool:
        """Whether half of the `good` (P,) elements, with t (g,), scatter as the noise of all says.

        Outliers that are taken for noise make it too large for them.
        """
        if self.sigma is not None or variance <= (_ROUNDED * np.abs(K).max()) ** 2:
            return True
        usual = scipy.special.chdtri(self._sensing[good], 0.5)
        return bool(np.median(t / usual) >= _HALF * variance)

    def _contradicted(
        self, residuals: "_Residuals", test: _OutlierTest, suspects: Mask, variance: float
    ) -> tuple[Mask, int | None]:
        """Elements (P,) that the rest contradicts; the place where a load would explain more."""
        if not variance:  # nothing but zeros
            return suspects, None
        t, gain = (
            residuals.chi_squared(suspects) / variance,
            self._load_gain(residuals, test) / variance,
        )
        most, place = t[~suspects].max(initial=0.0), int(gain.argmax())
        limit = self._limit
        if self.sigma is None:  # the noise is estimated from what the shape leaves of the readings
            chance = 1 - _ALARM / len(t)
            limit = self._sensing * scipy.special.fdtri(self._sensing, residuals.spare, chance)
        least = np.maximum(limit, most / _AT_ONCE)
        found = t > np.where(suspects, _BACK * limit, least)
        return found, place if gain[place] > max(most, self._load_limit) else None


def _undecided(best: _OutlierResult, ends: Sequence[_OutlierResult]) -> bool:
    """Whether nearly as much speaks for another end, with quite other suspects."""
    few = _OTHERS * len(best.suspects)
    return any(
        end.cost < best.cost + _NEARLY and np.count_nonzero(end.suspects != best.suspects) > few
        for end in ends
    )


class _FirstSuspects:
    """Which elements are far from a smooth shape of the others, even if a quarter of them is.

    With Q as above, for a prior that decides a third of the readings by its `shares` w (k,),
    (K - o)^T Q (K - o) / 2 + sum_p limit_p |o_p| is minimised over what the elements are off by, o
    (3, P): none pulls at the shape harder than its limit. That is convex, and solved by accelerated
    proximal steps (doi:10.1137/080716542) for lower and lower limits, until more than a third of
    the elements would be off.
    """

    def __init__(self, U: Array, shares: Array, sensed: NDArray[np.intp]) -> None:
        self._root = U * np.sqrt(shares)
        self._there = sensed > 0
        n = np.maximum(sensed, 1)
        left = 1 - np.square(self._root).sum(axis=1).reshape(3, -1).sum(axis=0) / n
        self._limit: Array = np.sqrt(scipy.special.chdtri(n, _ALARM))
        lowest = scipy.special.chdtri(n, 1 - _QUIET)
        self._usual: Array = np.sqrt(np.maximum(left, 1e-3) * lowest)

    def __call__(self, K: Array, least: float) -> Mask:
        """Suspected elements (P,) from weighted readings K (3 P,) of noise `least` or more."""
        o, sigma = np.zeros_like(K), self._noise(K)
        most = _MOST * np.count_nonzero(self._there)
        while sigma:
            found = self._solved(K, o, sigma * self._limit)
            if np.count_nonzero(found.reshape(3, -1).any(axis=0)) > most:
                break
            o, sigma = found, _LOWER * sigma
        limit = max(self._noise(K - o), least) * self._limit
        return self._there & (np.linalg.norm(o.reshape(3, -1), axis=0) > limit)

    def _rest(self, K: Array) -> Array:
        """Q K (3 P,)."""
        return K - self._root @ (K @ self._root)

    def _noise(self, K: Array) -> float:
        size = np.linalg.norm(self._rest(K).reshape(3, -1), axis=0)
        return float(np.quantile((size / self._usual)[self._there], _QUIET))

    def _solved(self, K: Array, o: Array, limit: Array) -> Array:
        """What the elements are off by (3 P,) for a `limit` (P,) each, from o on."""
        ahead, pace, still = o, 1.0, _STILL * limit.min()
        for _ in range(_STEPS):
            pulled = (ahead + self._rest(K - ahead)).reshape(3, -1)
            size = np.linalg.norm(pulled, axis=0)
            new = (pulled * (1 - limit / np.maximum(size, limit))).ravel()
            moved, faster = new - o, (1 + math.sqrt(1 + 4 * pace**2)) / 2
            ahead, o = new + (pace - 1) / faster * moved, new
            pace = faster
            if np.abs(moved).max() <= still:
                break
        return o


class _PriorStrength:
    """How many of the readings a prior decides, sum w of w = gamma s2 / (1 + gamma s2), by gamma.

    Of directions with the squares `s2` (k,) of their singular values.
    """

    def __init__(self, s2: Array) -> None:
        self._s2 = s2
        self._ln = np.linspace(-12.0, 60.0, 289) - math.log(s2[0] or 1.0)
        gs2 = np.exp(self._ln)[:, None] * s2
        self._decided: Array = np.sum(gs2 / (1 + gs2), axis=1)

    def between(self, *counts: float) -> Array:
        """The gammas with which it decides so many readings."""
        return np.exp(np.interp(counts, self._decided, self._ln))

    def shares(self, count: float) -> Array:
        """w (k,) where it decides `count` readings."""
        gs2 = self.between(count) * self._s2
        return gs2 / (1 + gs2)


def _columns(elements: Mask) -> Array:
    """A unit column (3 P, 3 e) for each reading of some elements (P,)."""
    readings = np.flatnonzero(np.tile(elements, 3))
    columns = np.zeros((3 * len(elements), len(readings)))
    columns[readings, np.arange(len(readings))] = 1
    return columns


class _Residuals:
    """Residuals of the readings K (3 P,) against each other, in units of sigma.

    `free` (3 P, f) are directions in which they are not constrained: the readings `out` (3 P,) of
    whole elements, then loads.
    """

    def __init__(self, test: _OutlierTest, K: Array, free: Array, gamma: float, out: Mask) -> None:
        U = test.U
        s2 = test.likelihood.s2[: U.shape[1]]
        s2 = min(gamma, _CLEAREST / s2[0]) * s2
        self.w = s2 / (1 + s2)
        self._Uw = U * self.w
        self._U = U
        self._QF = free - self._Uw @ (U.T @ free)
        self._inverse = cast("Array", np.linalg.inv(free.T @ self._QF))
        # What is along a free direction leaves no residual; kept in, it would leave its rounding.
        rest = np.where(out, 0.0, K)
        r = rest - self._Uw @ (rest @ U)
        self._left, self._out = test.count - free.shape[1], int(np.count_nonzero(out))
        amounts = self._inverse @ (free.T @ r)
        self.unexplained = rest - free @ amounts
        """K (3 P,) without its part along the free directions."""
        self.r = r - self._QF @ amounts
        """Q K (3 P,) without its free part."""
        self.amounts = amounts
        """Of the part of K along the free directions (f,)."""
        self.amounts[: np.count_nonzero(out)] += K[out]

    @property
    def spare(self) -> float:
        """How many readings neither the free directions nor the prior decide, 1 at least."""
        return max(self._left - float(self.w.sum()), 1.0)

    def cost(self, K: Array, sigma_known: bool) -> float:
        """-2 ln of the evidence for the free directions.

        The amount of an outlier may be anything up to the largest of the readings K (3 P,); a
        direction of a load costs 1.5 times what Schwarz's criterion says.
        """
        tiny, P, f = np.finfo(float).tiny, len(K) // 3, len(self._inverse)
        squares = max(float(self.unexplained @ self.r), tiny)
        variance = 1.0 if sigma_known else max(squares / self._left, tiny)
        width = math.log(max(float(np.abs(K).max()) ** 2, tiny)) - math.log(variance)
        volume = -np.log1p(-self.w).sum() - np.linalg.slogdet(self._inverse)[1]
        count, outliers = self._left + f, self._out / 3
        cost = squares / variance + count * math.log(variance) + float(volume)
        cost += outliers * (3 * width + 2 * math.log(P / _BAD))
        return cost + 1.5 * (f - self._out) * math.log(count)

    def chi_squared(self, out: Mask) -> Array:
        """Chi-squared (P,) of each element against the rest; those `out` are free directions."""
        P = len(out)
        taken = _element_blocks(self._QF @ self._inverse, self._QF, P)
        D: Array = np.eye(3) - _element_blocks(self._Uw, self._U, P) - taken
        r = self.r.reshape(3, P).T.copy()
        own = np.flatnonzero(out)
        block = np.arange(len(own))[:, None] + len(own) * np.arange(3)
        D[own] = self._inverse[block[:, :, None], block[:, None, :]]
        r[own] = self.amounts[block]
        return np.vecdot(r, np.linalg.solve(D, r[..., None])[..., 0])


def _element_blocks(left: Array, right: Array, P: int) -> Array:
    """The diagonal blocks (P, 3, 3) of left right^T, one per element, for rows (3 P, k)."""
    left, right = (rows.reshape(3, P, -1).swapaxes(0, 1) for rows in (left, right))
    return np.matmul(left, right.swapaxes(1, 2))


class _SuspectHistory(Stateful):
    """The last frames of P elements, from which the fault of each suspect is identified."""

    def __init__(self, P: int) -> None:
        self._P = P
        self._frames: deque[tuple[Array, Mask, Array]] = deque(maxlen=_FRAMES)

    def state(self, prefix: str = "") -> StateArrays:
        frames = [np.vstack(frame).astype(float) for frame in self._frames]
        return {f"{prefix}frames": np.array(frames)} if frames else {}

    def restore(self, state: Mapping[str, NDArray[np.float64]], prefix: str = "") -> None:
        saved = state.get(f"{prefix}frames", np.empty((0, 7, self._P)))
        if saved.ndim != 3 or saved.shape[1:] != (7, self._P):
            raise Refusal(
                f"expected {prefix}frames of shape (T, 7, {self._P}) to go on from, got "
                f"shape {saved.shape}"
            )
        self._frames.clear()
        self._frames.extend((frame[:3], frame[3] > 0, frame[4:]) for frame in saved)

    def __call__(self, K: Array, suspects: Mask, off: Array) -> NDArray[np.uint8]:
        """Faults (P,) by number in `FAULTS`, for readings K (3, P) that are `off` (3, P) in 1/m."""
        self._frames.append((K, suspects, off))
        why = np.where(suspects, FAULTS.index("spike"), 0).astype(np.uint8)
        if not suspects.any():
            return why
        if len(self._frames) >= _ENOUGH:
            self._from_history(why, np.flatnonzero(suspects))
        self._swapped(why, K, off, np.flatnonzero(suspects))
        return why

    def _from_history(self, why: NDArray[np.uint8], suspects: NDArray[np.intp]) -> None:
        Ks, were, offs = (np.stack(part) for part in zip(*self._frames, strict=True))
        latest = Ks[-_ENOUGH:]
        # A missing reading, as of a dead channel, contradicts nothing.
        still = ((latest == latest[-1]) | np.isnan(latest)).all(axis=(0, 1))
        spans = np.ptp(latest, axis=0)
        moving = np.count_nonzero(spans > 0) > np.count_nonzero(spans == 0)
        for p in suspects:
            if still[p] and moving:
                why[p] = FAULTS.index("stuck")
            elif were[:, p].mean() > _OFTEN:
                steady = offs[were[:, p], :, p]
                drift = np.abs(steady.mean(axis=0)).max() > steady.std(axis=0).max()
                why[p] = FAULTS.index("offset" if drift else "noisy")

    def _swapped(
        self, why: NDArray[np.uint8], K: Array, off: Array, suspects: NDArray[np.intp]
    ) -> None:
        expected = K - off
        for p, q in combinations(suspects, 2):
            both = np.isfinite(K[:, p] + K[:, q])  # channels
            crossed = (K[both, p] - expected[both, q]) ** 2 + (K[both, q] - expected[both, p]) ** 2
            if crossed.sum() < _CROSSED * np.sum(off[both, p] ** 2 + off[both, q] ** 2):
                why[[p, q]] = FAULTS.index("swapped")
