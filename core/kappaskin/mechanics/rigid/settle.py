"""Where a rigid object bears on a skin: forces that push and never pull, by active sets.

At n places the forces F in N, the deflection w = G F in m and the object's underside, at e (d - h)
below the skin at rest when its depth is d, leave a gap g and meet

    F >= 0,    g = G F + t F - e (d - h) >= 0,    F g = 0,

with e = 1 on a flat skin and t in m/N what a thin layer of the skin gives by itself. G alone is
singular, more places than functions; with t the problem is the least of a strictly convex energy
F'(G + t)F/2 - F'e(d - h) on F >= 0 and has one answer. With the whole force given, e'F = P, d is
the multiplier of that constraint.

It is solved as Lawson and Hanson solve non-negative least squares (Solving Least Squares Problems,
doi:10.1137/1.9781611971217, chapter 23), on the normal equations as Bro and de Jong do
(doi:10.1002/(SICI)1099-128X(199709/10)11:5<393::AID-CEM483>3.0.CO;2-L), from any forces that may
stand: the energy falls from one set of bearing places to the next, so no set returns and the
sets come to an end.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask

Indices = NDArray[np.intp]

_TIGHT = 1e-10  # of the largest force: a gap that closes under less is closed
_ROUNDING = 1e-14  # of the deepest place: what a gap is known to


@dataclass(frozen=True, eq=False)
class Support:
    """How a skin gives at n places: what each function feels there, and the thin layer's `soft`.

    `felt` are the functions (k, N) at given places, `after` what (k, N) answers to forces there,
    `deflection` (n,) in m that of coefficients (N,), `soft` (n,) in m/N the layer's compression
    per force, `own` (n,) in m/N how far a place gives under a force on it alone.
    """

    felt: Callable[[Indices], Array]
    after: Callable[[Array], Array]
    deflection: Callable[[Array], Array]
    soft: Array
    own: Array


@dataclass(frozen=True, eq=False)
class Underside:
    """The object over the n places: `height` h (n,) in m above its lowest point, `slant` e (n,)."""

    height: Array
    slant: Array


@dataclass(frozen=True, eq=False)
class Bearing:
    """The answer: `forces` (n,) in N, `gap` (n,) in m, `coefficients` and `modal` (N,), `depth`."""

    forces: Array
    gap: Array
    coefficients: Array
    modal: Array
    depth: float
    steps: int


@dataclass(frozen=True, eq=False)
class _Places:
    """The a places that bear: what they feel, and how each gives under force on the others."""

    at: Indices
    felt: Array
    answer: Array
    gives: Array

    def joined(self, support: Support, i: int) -> "_Places":
        """These and place `i`."""
        at = np.append(self.at, i)
        felt = np.vstack([self.felt, support.felt(at[-1:])])
        answer = np.vstack([self.answer, support.after(felt[-1:])])
        row = felt @ answer[-1]
        row[-1] += support.soft[i]
        gives = np.empty((len(at), len(at)))
        gives[:-1, :-1], gives[-1], gives[:, -1] = self.gives, row, row
        return _Places(at, felt, answer, gives)

    def only(self, kept: Mask) -> "_Places":
        """Those of them that are `kept` (a,)."""
        return _Places(self.at[kept], self.felt[kept], self.answer[kept], self.gives[kept][:, kept])

    def closed(self, under: Underside, depth: float | None, force: float) -> tuple[Array, float]:
        """The forces (a,) that leave no gap at any of them, pushing or pulling, and the depth."""
        e = under.slant[self.at]
        if not len(e):
            return e, cast("float", depth)
        both = np.column_stack([e, e * under.height[self.at]])
        # LAPACK itself: scipy's wrappers take longer than it does for so few places.
        _, solved, failed = lapack.dposv(self.gives, both, lower=True)
        if failed:
            raise Refusal(
                "the skin gives so unevenly that rounding hides how; press with fewer nodes, or "
                "with a thicker layer"
            )
        per_depth, for_height = solved.T
        d = (force + e @ for_height) / (e @ per_depth) if depth is None else depth
        return d * per_depth - for_height, float(d)


def _places(support: Support, at: Indices) -> _Places:
    felt = support.felt(at)
    answer = support.after(felt)
    return _Places(at, felt, answer, answer @ felt.T + np.diag(support.soft[at]))


def _towards(F: Array, target: Array) -> tuple[Array, Mask]:
    """As far from F (a,) to the target (a,) as no force pulls, and which of them still push."""
    pulls = target <= 0
    share = np.full(len(F), np.inf)
    share[pulls] = F[pulls] / (F[pulls] - target[pulls])
    step = share.min()
    kept = share > step
    return (F + step * (target - F))[kept], kept


def settle(
    support: Support, under: Underside, start: Array, depth: float | None, force: float
) -> Bearing:
    """Forces of an object at `depth` in m, or, where that is None, that bears `force` in N.

    From the forces `start` (n,), none below zero, whose sum along the object is then `force`.
    """
    places = _places(support, np.flatnonzero(start))
    forces = start[places.at]
    most = 3 * len(start) + 10
    for step in range(1, most):
        target, d = places.closed(under, depth, force)
        if not (target > 0).all():
            forces, kept = _towards(forces, target)
            places = places.only(kept)
            continue
        found = _bearing(support, under, places, target, d, step)
        if (deepest := _deepest(support, under, found)) is None:
            return found
        places, forces = places.joined(support, deepest), np.append(target, 0.0)
    raise Refusal(
        f"the contact did not settle in {most} steps; press less deep, or with fewer nodes"
    )


def _bearing(
    support: Support, under: Underside, places: _Places, F: Array, depth: float, step: int
) -> Bearing:
    forces = np.zeros(len(under.slant))
    forces[places.at] = F
    c = F @ places.answer
    gap = support.deflection(c) + support.soft * forces
    gap -= under.slant * (depth - under.height)
    return Bearing(forces, gap, c, F @ places.felt, depth, step)


def _deepest(support: Support, under: Underside, found: Bearing) -> int | None:
    """The place without force that the object penetrates deepest; None if it does nowhere."""
    reach = np.abs(under.slant * (found.depth - under.height)).max()
    allowed = _TIGHT * found.forces.max() * support.own + _ROUNDING * reach
    open_gap = np.where(found.forces > 0, np.inf, found.gap + allowed)
    deepest = int(np.argmin(open_gap))
    return deepest if open_gap[deepest] < 0 else None
