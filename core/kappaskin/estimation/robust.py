"""Least squares without the elements that the rest of the skin contradicts, and why."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, cast

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from kappaskin._state import StateArrays, Stateful
from kappaskin.bases import Basis
from kappaskin.errors import RankDeficient, Refusal
from kappaskin.estimation.bayes import Evidence
from kappaskin.estimation.estimator import Estimator, numbers
from kappaskin.estimation.fit import Fit, in_time
from kappaskin.estimation.least_squares import LeastSquares
from kappaskin.estimation.prior import prior_root
from kappaskin.estimation.remembered import Remembered
from kappaskin.frames import Array, Mask
from kappaskin.mechanics import Plate

_FUNCTIONS = 15  # along each side at least, of the shapes that elements are judged by
_ALARM = 1e-3  # chance that a frame of good readings has any of them suspected
_PLACES = 25  # along each side, where a load is thought of
_LOADS = 3  # that are thought of at most
_OUTRAGEOUS = 50.0  # times what three quarters of the elements read at most
_UNSEEN = 1e-12  # of a load's readings: so much is left of one that the elements do not tell
_CLEAREST = 1e10  # signal over noise in power: beyond it rounding tells elements apart
_BACK = 0.5  # of what makes a suspect: below it, one is trusted again
_ROUNDS = 12  # of suspecting and trusting again
_AT_ONCE = 4.0  # a suspect is left out together with those at least a fourth as far off
_MOST = 0.25  # of the elements: if more contradict the rest, none can be told from the others
_FRAMES = 32  # that the why is told from
_ENOUGH = 6  # of them: with fewer, any suspect may be a spike
_OFTEN = 0.3  # of the frames: a suspect of fewer has spikes
_CROSSED = 0.2  # of the squares left when two elements are swapped back

WHY = ("", "spike", "stuck", "noisy", "swapped", "offset", "dead", "saturated", "drifting")
"""Why an element is left out of a fit, by number; the first of them that it is not."""


@dataclass(frozen=True, slots=True, eq=False)
class _Judge:
    """What depends on which readings are `used` (3 P,), `count` of them.

    U (3 P, k) of the evidence, zero where there is none; `by_press` (G, k) the squares of what each
    direction has of a load at each place, `beyond` (G,) those of what none has.
    """

    evidence: Evidence
    U: Array
    by_press: Array
    beyond: Array
    used: Mask
    count: int


@dataclass(frozen=True, slots=True, eq=False)
class _Verdict:
    """Suspected elements (P,), and by how much their readings are off, (3, P), 0 for others."""

    suspects: Mask
    off: Array
    rounds: int
    hopeless: bool


# Under the prior the readings have the covariance sigma^2 S, S^-1 = Q = 1 - U diag(w) U^T with
# w = gamma s^2 / (1 + gamma s^2). What the others tell of the readings E of some elements, and how
# well, needs blocks of Q alone: K_E is off by Q_EE^-1 (Q K)_E, with covariance sigma^2 Q_EE^-1
# (leaving one out, as in kriging: doi:10.1007/BF01033232). Leaving E out changes
# Q to Q - Q_.E Q_EE^-1 Q_E. for the rest.
class Robust(Estimator, Stateful):
    """Least squares from the elements that agree with each other.

    An element is suspected when its three readings are further from what the others tell of them
    than noise explains once in a thousand frames, by the likelihood of a plate under a white load
    (`Bayes`), so that the fine structure under a load is not taken for a failure. Suspects are
    left out one round after the other, and let in again where the rest agrees with them after
    all; the shape is that of `LeastSquares` with them dead. `Fit.suspect` says which and why:
    what the last frames tell. Where more than a quarter of the elements contradict the rest, none
    is left out and `Fit.converged` says no; without a `sigma` they may pass for noise, which is
    then told as large.
    """

    STATE = ("_history",)

    def _set_up(self) -> None:
        basis, layout = self.basis, self.layout
        self._linear = LeastSquares(basis, layout, self.sigma, self.rim_sd, self.dtype)
        across = 1 if basis.patch.strip else max(basis.shape[1], _FUNCTIONS)
        rich = replace(cast("Any", basis), Ni=max(basis.shape[0], _FUNCTIONS), Nj=across)
        self._A: Array = self.weight[:, None] * (layout.curvature_operator(rich) @ prior_root(rich))
        self._take_presses(rich)
        self._judges = Remembered[_Judge]()
        P = len(layout)
        sensing = np.maximum(layout.live.sum(axis=0), 1)
        self._limit: Array = scipy.special.chdtri(sensing, _ALARM / P)
        self._history = _History(P)
        self._judges(self.readable, self._judge)

    def _take_presses(self, rich: Basis) -> None:
        """What a load at each of G places does to the readings, and how it changes from there."""
        patch = rich.patch
        x, y = patch.grid(_PLACES + 2, 3 if patch.strip else _PLACES + 2)
        points = np.stack(np.meshgrid(x[1:-1], y[1:-1]), -1).reshape(-1, 2)
        points = points[patch.moves(points)]
        of, orders = Plate(patch).compliance(rich), ((0, 0), (1, 0), (0, 1))
        M = of.after(self.weight[:, None] * self.layout.curvature_operator(rich))
        jets = [rich.at(points, *order) for order in orders[: 2 if patch.strip else 3]]
        wider = rich.at(points, 2, 0) + (0.0 if patch.strip else rich.at(points, 0, 2))
        self._presses: Array = np.stack([M @ jet.T for jet in (*jets, wider)], axis=-1)
        """Per place (3 P, G, 4): of a force, of moving it along x, along y, of widening it."""
        self._presses /= np.linalg.norm(self._presses, axis=0)
        self._forces = np.ascontiguousarray(self._presses[..., 0])
        self._press_limit = float(scipy.special.chdtri(1, _ALARM / len(points)))

    def _press(self, view: "_View", judge: _Judge) -> Array:
        """How much better the readings are explained (G,) with a load at each place."""
        seen = judge.beyond + judge.by_press @ (1 - view.w)
        known = seen > _UNSEEN
        return np.divide((view.r @ self._forces) ** 2, seen, where=known, out=np.zeros_like(seen))

    def _judge(self, used: Mask) -> _Judge:
        evidence = Evidence(self._A[used], self.sigma is not None, 1e-10)
        U = np.zeros((len(used), evidence.U.shape[1]))
        U[used] = evidence.U
        by_press = (self._forces.T @ U) ** 2
        beyond = np.sum(self._forces[used] ** 2, axis=0) - by_press.sum(axis=1)
        return _Judge(evidence, U, by_press, np.maximum(beyond, 0.0), used, int(used.sum()))

    def __call__(self, curvature: ArrayLike) -> Fit:
        """Fit `curvature` (3, P), or (T, 3, P) in the order of time, in 1/m."""
        K = numbers(curvature, "curvature", self.dtype)
        self._check_shape(K)
        there = np.abs(K) <= self._largest
        if K.ndim == 2 or (there == there[:1]).all():
            return super().__call__(K)
        # Not those together that lack the same readings: the why is told by the frames before.
        return in_time([self._next(frame, t) for t, frame in enumerate(K)])

    def _next(self, frame: Array, number: int) -> Fit:
        try:
            return super().__call__(frame)
        except RankDeficient as error:
            raise RankDeficient(f"frame {number}: {error}") from error

    def at_rest(self, missing: Mask | None = None) -> Fit:
        """The fit to a skin at rest, which is no frame of the past."""
        past, self._history = self._history, _History(len(self.layout))
        try:
            return super().at_rest(missing)
        finally:
            self._history = past

    def _fit(self, flat: Array, used: Mask) -> Fit:
        if not used.any():
            raise self.refusal(0, 0)
        frames, P = flat.shape[:-1], len(self.layout)
        K = flat.reshape(*frames, 3, P)
        verdicts = [self._told(frame, used) for frame in np.atleast_2d(flat)]
        why = [
            self._history(readings, told.suspects, told.off)
            for readings, told in zip(K.reshape(-1, 3, P), verdicts, strict=True)
        ]
        out = np.reshape([told.suspects for told in verdicts], (*frames, 1, P))
        return replace(
            self._linear(np.where(out, np.nan, K)),
            estimator=self,
            steps=np.array([told.rounds for told in verdicts], int).reshape(frames),
            converged=np.array([not told.hopeless for told in verdicts], bool).reshape(frames),
            suspect=np.array(why, np.uint8).reshape(*frames, P),
        )

    def _told(self, flat: Array, used: Mask) -> _Verdict:
        judge, P = self._judges(used, self._judge), len(self.layout)
        K = np.where(used, flat, 0.0) * self.weight
        there = cast("Mask", used.reshape(3, P).any(axis=0))
        suspects, loads, rounds = _outrageous(K, there), list[int](), 0
        (gamma,) = judge.evidence(K[None, used])[1]
        while suspects.sum() <= _MOST * there.sum():
            free = np.hstack([_columns(suspects), *(self._presses[:, g] for g in loads)])
            view = _View(judge, K, free, float(gamma))
            _, (gamma,), (sigma,) = judge.evidence((K - view.explained)[None, used])
            left = judge.count - free.shape[1]
            given = self.sigma is not None
            variance = 1.0 if given else float(sigma) ** 2 * judge.count / left
            found, place = self._found(view, judge, suspects, variance)
            if place is not None and len(loads) < _LOADS:
                loads.append(place)
            elif (found == suspects).all() or rounds == _ROUNDS:
                off = np.zeros(3 * P)
                out = np.tile(suspects, 3)
                off[out] = view.amounts[: 3 * suspects.sum()]
                out &= judge.used
                off[out] /= self.weight[out]
                return _Verdict(suspects, off.reshape(3, P), rounds, hopeless=False)
            else:
                suspects = found
            rounds += 1
        return _Verdict(np.zeros(P, bool), np.zeros((3, P)), rounds, hopeless=True)

    def _found(
        self, view: "_View", judge: _Judge, suspects: Mask, variance: float
    ) -> tuple[Mask, int | None]:
        """Which elements (P,) the rest contradicts; a place where a load would explain more."""
        if not variance:  # nothing but zeros
            return suspects, None
        t, press = view.contradiction(suspects) / variance, self._press(view, judge) / variance
        most, place = t[~suspects].max(initial=0.0), int(press.argmax())
        least = np.maximum(self._limit, most / _AT_ONCE)
        found = t > np.where(suspects, _BACK * self._limit, least)
        return found, place if press[place] > max(most, self._press_limit) else None


def _outrageous(K: Array, there: Mask) -> Mask:
    """The elements (P,) that read so much more than most of those `there`: suspected at once."""
    size = np.abs(K.reshape(3, -1)).max(axis=0)
    found = size > _OUTRAGEOUS * np.quantile(size[there], 1 - _MOST)
    return found & (found.sum() <= _MOST * there.sum())


def _columns(elements: Mask) -> Array:
    """A unit column (3 P, 3 e) for each reading of some elements (P,)."""
    readings = np.flatnonzero(np.tile(elements, 3))
    columns = np.zeros((3 * len(elements), len(readings)))
    columns[readings, np.arange(len(readings))] = 1
    return columns


class _View:
    """What the readings K (3 P,) tell of each other, in units of sigma, but for what is free.

    `free` (3 P, f) are directions in which they may be anything: whole elements, loads.
    """

    def __init__(self, judge: _Judge, K: Array, free: Array, gamma: float) -> None:
        U = judge.U
        s2 = judge.evidence.s2[: U.shape[1]]
        s2 = min(gamma, _CLEAREST / s2[0]) * s2
        self.w = s2 / (1 + s2)
        self._Uw = U * self.w
        self._U, self._free = U, free
        self._QF = free - self._Uw @ (U.T @ free)
        self._inverse = cast("Array", np.linalg.inv(free.T @ self._QF))
        r = K - self._Uw @ (K @ U)
        self.amounts = self._inverse @ (free.T @ r)
        self.explained = free @ self.amounts
        """What of K (3 P,) goes in free directions, `amounts` (f,) in each."""
        self.r = r - self._QF @ self.amounts
        """Q K (3 P,), as far as it is not free."""

    def contradiction(self, out: Mask) -> Array:
        """How far each element is from the rest (P,), chi-squared; those `out` come first."""
        P = len(out)
        taken = _crossed(self._QF @ self._inverse, self._QF, P)
        D: Array = np.eye(3) - _crossed(self._Uw, self._U, P) - taken
        r = self.r.reshape(3, P).T.copy()
        own = np.flatnonzero(out)
        block = np.arange(len(own))[:, None] + len(own) * np.arange(3)
        D[own] = self._inverse[block[:, :, None], block[:, None, :]]
        r[own] = self.amounts[block]
        return np.vecdot(r, np.linalg.solve(D, r[..., None])[..., 0])


def _crossed(left: Array, right: Array, P: int) -> Array:
    """The blocks (P, 3, 3) of left right^T that belong to one element each, of rows (3 P, k)."""
    left, right = (rows.reshape(3, P, -1).swapaxes(0, 1) for rows in (left, right))
    return np.matmul(left, right.swapaxes(1, 2))


class _History(Stateful):
    """Why some of P elements are suspected, as far as the last frames tell."""

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
        """Numbers (P,) of `WHY` for readings K (3, P) that are `off` (3, P) in 1/m."""
        self._frames.append((K, suspects, off))
        why = np.where(suspects, WHY.index("spike"), 0).astype(np.uint8)
        if not suspects.any():
            return why
        if len(self._frames) >= _ENOUGH:
            self._by_the_past(why, np.flatnonzero(suspects))
        self._swapped(why, K, off, np.flatnonzero(suspects))
        return why

    def _by_the_past(self, why: NDArray[np.uint8], suspects: NDArray[np.intp]) -> None:
        Ks, were, offs = (np.stack(part) for part in zip(*self._frames, strict=True))
        latest = Ks[-_ENOUGH:]
        # A missing reading, as of a dead channel, contradicts nothing.
        still = ((latest == latest[-1]) | np.isnan(latest)).all(axis=(0, 1))
        spans = np.ptp(latest, axis=0)
        moving = np.count_nonzero(spans > 0) > np.count_nonzero(spans == 0)
        for p in suspects:
            if still[p] and moving:
                why[p] = WHY.index("stuck")
            elif were[:, p].mean() > _OFTEN:
                steady = offs[were[:, p], :, p]
                drift = np.abs(steady.mean(axis=0)).max() > steady.std(axis=0).max()
                why[p] = WHY.index("offset" if drift else "noisy")

    def _swapped(
        self, why: NDArray[np.uint8], K: Array, off: Array, suspects: NDArray[np.intp]
    ) -> None:
        told = K - off
        for p, q in combinations(suspects, 2):
            both = np.isfinite(K[:, p] + K[:, q])  # channels
            crossed = (K[both, p] - told[both, q]) ** 2 + (K[both, q] - told[both, p]) ** 2
            if crossed.sum() < _CROSSED * np.sum(off[both, p] ** 2 + off[both, q] ** 2):
                why[[p, q]] = WHY.index("swapped")
