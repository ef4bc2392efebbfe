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
from kappaskin.sensing import SensorLayout

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


class _Elements:
    """Which readings are of which of P elements; `of` (R,) is the element of each reading."""

    def __init__(self, layout: SensorLayout) -> None:
        self.of, self.count = layout.element, len(layout)
        self.kind = layout.kind
        counts = np.bincount(self.of, minlength=self.count)
        order = np.argsort(self.of, kind="stable")
        place = np.arange(len(order)) - np.repeat(np.cumsum(counts) - counts, counts)
        self.members = np.full((self.count, counts.max()), -1)
        """The readings (P, k) of each element, filled up with -1."""
        self.members[self.of[order], place] = order
        self._uneven = bool(counts.min() < counts.max())

    def total(self, values: Array | Mask) -> Array:
        """Sums (P,) of `values` (R,) over the readings of each element."""
        return np.bincount(self.of, values, self.count).astype(float)

    def size(self, values: Array) -> Array:
        """Root (P,) of the summed squares of `values` (R,)."""
        return np.sqrt(self.total(values * values))

    def rows(self, values: Array) -> Array:
        """The rows (P, k, ...) of `values` (R, ...) of each element; zeros fill up."""
        rows = values[self.members]
        if self._uneven:
            rows[self.members < 0] = 0
        return rows

    def alike(self, p: int, q: int) -> bool:
        """Whether two elements read the same."""
        there = (self.members[[p, q]] >= 0).all(axis=0)
        own, other = self.members[[p, q]]
        return bool(
            np.array_equal(own < 0, other < 0) and (self.kind[own] == self.kind[other])[there].all()
        )


@dataclass(frozen=True, slots=True, eq=False)
class _OutlierTest:
    """What depends on which readings are `used` (R,), `count` of them.

    `U` (R, k) are the directions of the likelihood, zero where there is no reading. For a load at
    each of G places, `by_load` (G, k) are the squared components along them, `beyond` (G,) those
    along none. `sensed` (P,) is the number of readings of each element.
    """

    elements: _Elements
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
    """Suspected elements (P,), and how far `off` (R,) their readings are, 0 for the others.

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
    has_rim = False
    STATE = ("_history",)

    def _set_up(self) -> None:
        basis, layout = self.basis, self.layout
        self._linear = LeastSquares(basis, layout, self.sigma, self.rim_sd, self.dtype)
        across = 1 if basis.patch.strip else max(basis.shape[1], _FUNCTIONS)
        rich = replace(cast("Any", basis), Ni=max(basis.shape[0], _FUNCTIONS), Nj=across)
        self._A: Array = self.weight[:, None] * (layout.operator(rich) @ prior_root(rich))
        self._set_up_loads(rich)
        self._tests = PatternCache[_OutlierTest]()
        self._elements = _Elements(layout)
        self._sensing = np.maximum(self._elements.total(layout.live.ravel()), 1)
        self._limit = cast("Array", scipy.special.chdtri(self._sensing, _ALARM / len(layout)))
        self._history = _SuspectHistory(self._elements, self.frame_shape)
        self._tests(self.readable, self._outlier_test)

    def _set_up_loads(self, rich: Basis) -> None:
        """Readings of a load at each of G places, and their changes when it moves or widens."""
        patch = rich.patch
        x, y = patch.grid(_PLACES + 2, 3 if patch.strip else _PLACES + 2)
        points = np.stack(np.meshgrid(x[1:-1], y[1:-1]), -1).reshape(-1, 2)
        points = points[patch.moves(points)]
        plate, orders = Plate(patch), ((0, 0), (1, 0), (0, 1))
        read = self.weight[:, None] * self.layout.operator(rich, plate)
        M = plate.compliance(rich).after(read)
        jets = [rich.at(points, *order) for order in orders[: 2 if patch.strip else 3]]
        wider = rich.at(points, 2, 0) + (0.0 if patch.strip else rich.at(points, 0, 2))
        self._load_readings: Array = np.stack([M @ jet.T for jet in (*jets, wider)], axis=-1)
        """Per place (R, G, 4): of a force, of moving it along x, along y, of widening it."""
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
        sensed = self._elements.total(used).astype(np.intp)
        prior = _PriorStrength(likelihood.s2[: U.shape[1]])
        shares = prior.shares(_DECIDED * sensed.sum())
        first = _FirstSuspects(self._elements, U, shares, sensed)
        beyond, count = np.maximum(beyond, 0.0), int(used.sum())
        return _OutlierTest(
            self._elements, likelihood, U, by_load, beyond, used, count, sensed, prior, first
        )

    def __call__(self, readings: ArrayLike) -> Fit:
        """Fit `readings` (3, P), or (T, 3, P) in the order of time, in 1/m."""
        K = real_array(readings, "readings", self.dtype)
        alone = self._of_one_frame(K)
        there = np.abs(K) <= self._largest
        if alone or (there == there[:1]).all():
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
        past = self._history
        self._history = _SuspectHistory(self._elements, self.frame_shape)
        try:
            return super().at_rest(missing)
        finally:
            self._history = past

    def _fit(self, flat: Array, used: Mask) -> Fit:
        if not used.any():
            raise self.refusal(0, 0)
        frames, P = flat.shape[:-1], len(self.layout)
        every = np.atleast_2d(flat)
        results = [self._screened(frame, used) for frame in every]
        why = [
            self._history(readings, result.suspects, result.off)
            for readings, result in zip(every, results, strict=True)
        ]
        out = np.array([result.suspects[self._elements.of] for result in results], bool)
        left = np.where(out.reshape(flat.shape), np.nan, flat)
        return replace(
            self._linear(left.reshape(*frames, *self.frame_shape)),
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
            return _OutlierResult(none, np.zeros(len(flat)), rounds)
        off = best.off * unit
        np.divide(off, self.weight, where=off != 0, out=off)
        converged = best.converged and not _undecided(best, ends)
        return replace(best, off=off, rounds=rounds, converged=converged)

    def _searched(self, K: Array, test: _OutlierTest, suspects: Mask) -> _OutlierResult:
        """Where rounds end that begin with some `suspects` (P,), in units of sigma."""
        loads, rounds, used, of = list[int](), 0, test.used, self._elements.of
        most = _MOST * np.count_nonzero(test.sensed)
        (gamma,) = test.likelihood(np.where(suspects[of], 0.0, K)[None, used])[1]
        while suspects.sum() <= most:
            out = suspects[of]
            free = np.hstack([_columns(out), *(self._load_readings[:, g] for g in loads)])
            left = test.count - free.shape[1]
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
                off = np.zeros(len(K))
                off[out & used] = residuals.amounts[: np.count_nonzero(out)][used[out]]
                cost = residuals.cost(K, self.sigma is not None, int(suspects.sum()))
                good = (test.sensed > 0) & ~suspects
                even = self._even(residuals.chi_squared(suspects)[good], variance, good, K)
                return _OutlierResult(suspects, off, rounds, cost, even)
            else:
                suspects = found
            rounds += 1
        return _OutlierResult(suspects, np.zeros(len(K)), rounds)

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
    (R,): none pulls at the shape harder than its limit. That is convex, and solved by accelerated
    proximal steps (doi:10.1137/080716542) for lower and lower limits, until more than a third of
    the elements would be off.
    """

    def __init__(
        self, elements: _Elements, U: Array, shares: Array, sensed: NDArray[np.intp]
    ) -> None:
        self._elements = elements
        self._root = U * np.sqrt(shares)
        self._there = sensed > 0
        n = np.maximum(sensed, 1)
        left = 1 - elements.total(np.square(self._root).sum(axis=1)) / n
        self._limit: Array = np.sqrt(scipy.special.chdtri(n, _ALARM))
        lowest = scipy.special.chdtri(n, 1 - _QUIET)
        self._usual: Array = np.sqrt(np.maximum(left, 1e-3) * lowest)

    def __call__(self, K: Array, least: float) -> Mask:
        """Suspected elements (P,) from weighted readings K (R,) of noise `least` or more."""
        o, sigma = np.zeros_like(K), self._noise(K)
        most = _MOST * np.count_nonzero(self._there)
        while sigma:
            found = self._solved(K, o, sigma * self._limit)
            if np.count_nonzero(self._elements.total(found != 0)) > most:
                break
            o, sigma = found, _LOWER * sigma
        limit = max(self._noise(K - o), least) * self._limit
        return self._there & (self._elements.size(o) > limit)

    def _rest(self, K: Array) -> Array:
        """Q K (R,)."""
        return K - self._root @ (K @ self._root)

    def _noise(self, K: Array) -> float:
        size = self._elements.size(self._rest(K))
        return float(np.quantile((size / self._usual)[self._there], _QUIET))

    def _solved(self, K: Array, o: Array, limit: Array) -> Array:
        """What the elements are off by (R,) for a `limit` (P,) each, from o on."""
        ahead, pace, still = o, 1.0, _STILL * limit.min()
        for _ in range(_STEPS):
            pulled = ahead + self._rest(K - ahead)
            size = self._elements.size(pulled)
            new = pulled * (1 - limit / np.maximum(size, limit))[self._elements.of]
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


def _columns(out: Mask) -> Array:
    """A unit column (R, r) for each of the r readings `out` (R,)."""
    readings = np.flatnonzero(out)
    columns = np.zeros((len(out), len(readings)))
    columns[readings, np.arange(len(readings))] = 1
    return columns


class _Residuals:
    """Residuals of the readings K (R,) against each other, in units of sigma.

    `free` (R, f) are directions in which they are not constrained: the readings `out` (R,) of
    whole elements, then loads.
    """

    def __init__(self, test: _OutlierTest, K: Array, free: Array, gamma: float, out: Mask) -> None:
        U, self._elements = test.U, test.elements
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
        """K (R,) without its part along the free directions."""
        self.r = r - self._QF @ amounts
        """Q K (R,) without its free part."""
        self.amounts = amounts
        """Of the part of K along the free directions (f,)."""
        self.amounts[: np.count_nonzero(out)] += K[out]

    @property
    def spare(self) -> float:
        """How many readings neither the free directions nor the prior decide, 1 at least."""
        return max(self._left - float(self.w.sum()), 1.0)

    def cost(self, K: Array, sigma_known: bool, outliers: int) -> float:
        """-2 ln of the evidence for the free directions, with `outliers` elements among them.

        The amount of an outlier may be anything up to the largest of the readings K (R,); a
        direction of a load costs 1.5 times what Schwarz's criterion says.
        """
        tiny, P, f = np.finfo(float).tiny, self._elements.count, len(self._inverse)
        squares = max(float(self.unexplained @ self.r), tiny)
        variance = 1.0 if sigma_known else max(squares / self._left, tiny)
        width = math.log(max(float(np.abs(K).max()) ** 2, tiny)) - math.log(variance)
        volume = -np.log1p(-self.w).sum() - np.linalg.slogdet(self._inverse)[1]
        count = self._left + f
        cost = squares / variance + count * math.log(variance) + float(volume)
        cost += self._out * width + outliers * 2 * math.log(P / _BAD)
        return cost + 1.5 * (f - self._out) * math.log(count)

    def chi_squared(self, out: Mask) -> Array:
        """Chi-squared (P,) of each element against the rest; those `out` are free directions."""
        rows, members = self._elements.rows, self._elements.members
        taken = self._blocks(self._QF @ self._inverse, self._QF)
        D: Array = np.eye(members.shape[1]) - self._blocks(self._Uw, self._U) - taken
        r = rows(self.r)
        place = np.cumsum(out[self._elements.of]) - 1  # of a reading among those that are out
        for p in np.flatnonzero(out):
            there = members[p] >= 0
            own = place[members[p, there]]
            D[np.ix_([p], there, there)] = self._inverse[np.ix_(own, own)]
            r[p, there] = self.amounts[own]
        return np.vecdot(r, np.linalg.solve(D, r[..., None])[..., 0])

    def _blocks(self, left: Array, right: Array) -> Array:
        """The diagonal blocks (P, k, k) of left right^T, one per element, for rows (R, ...)."""
        rows = self._elements.rows
        return np.matmul(rows(left), rows(right).swapaxes(1, 2))


class _SuspectHistory(Stateful):
    """The last frames of P elements, from which the fault of each suspect is identified."""

    def __init__(self, elements: _Elements, shape: tuple[int, ...]) -> None:
        self._elements, P = elements, elements.count
        self._shape = (2 * shape[0] + 1, P) if len(shape) == 2 else (2 * shape[0] + P,)
        self._frames: deque[tuple[Array, Mask, Array]] = deque(maxlen=_FRAMES)

    def state(self, prefix: str = "") -> StateArrays:
        frames = [np.concatenate(frame).astype(float) for frame in self._frames]
        if not frames:
            return {}
        return {f"{prefix}frames": np.reshape(frames, (len(frames), *self._shape))}

    def restore(self, state: Mapping[str, NDArray[np.float64]], prefix: str = "") -> None:
        saved = state.get(f"{prefix}frames", np.empty((0, *self._shape)))
        if saved.shape[1:] != self._shape:
            shape = ", ".join(map(str, self._shape))
            raise Refusal(
                f"expected {prefix}frames of shape (T, {shape}) to go on from, got shape "
                f"{saved.shape}"
            )
        P, R = self._elements.count, len(self._elements.of)
        self._frames.clear()
        for frame in saved.reshape(-1, 2 * R + P):
            self._frames.append((frame[:R], frame[R : R + P] > 0, frame[R + P :]))

    def __call__(self, K: Array, suspects: Mask, off: Array) -> NDArray[np.uint8]:
        """Faults (P,) by number in `FAULTS`, for readings K (R,) that are `off` (R,)."""
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
        changed = ((latest != latest[-1]) & ~np.isnan(latest)).any(axis=0)
        still = self._elements.total(changed) == 0
        spans = np.ptp(latest, axis=0)
        moving = np.count_nonzero(spans > 0) > np.count_nonzero(spans == 0)
        for p in suspects:
            if still[p] and moving:
                why[p] = FAULTS.index("stuck")
            elif were[:, p].mean() > _OFTEN:
                steady = offs[np.ix_(were[:, p], self._elements.of == p)]
                drift = np.abs(steady.mean(axis=0)).max() > steady.std(axis=0).max()
                why[p] = FAULTS.index("offset" if drift else "noisy")

    def _swapped(
        self, why: NDArray[np.uint8], K: Array, off: Array, suspects: NDArray[np.intp]
    ) -> None:
        expected, members = K - off, self._elements.members
        for p, q in combinations(suspects, 2):
            if not self._elements.alike(p, q):
                continue
            own, other = members[[p, q]]
            both = (own >= 0) & np.isfinite(K[own] + K[other])
            own, other = own[both], other[both]
            crossed = (K[own] - expected[other]) ** 2 + (K[other] - expected[own]) ** 2
            if crossed.sum() < _CROSSED * np.sum(off[own] ** 2 + off[other] ** 2):
                why[[p, q]] = FAULTS.index("swapped")
